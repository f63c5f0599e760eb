//! Specs of simple random mechanisms: trees, and single loops that close at home. The same seed
//! gives the same text.

use std::fmt::Write as _;

use crate::reference::{CutKind, Mechanism, Random};

/// The joint types of random specs, with their numbers of coordinates.
const JOINTS: [(&str, usize); 6] = [
    ("revolute", 1),
    ("prismatic", 1),
    ("cylindrical", 2),
    ("universal", 2),
    ("spherical", 3),
    ("fixed", 0),
];

const FRICTION: [&str; 6] = [
    "none",
    "viscous",
    "coulomb",
    "linear",
    "coulomb_asymmetric",
    "asymmetric",
];

const CUTS: [(&str, CutKind); 6] = [
    ("spherical", CutKind::Spherical),
    ("universal", CutKind::Universal),
    ("revolute", CutKind::Revolute),
    ("prismatic", CutKind::Prismatic),
    ("cylindrical", CutKind::Cylindrical),
    ("fixed", CutKind::Fixed),
];

/// The YAML of the pitch of helical joints and cuts, m per turn.
const PITCH: &str = ", pitch: 0.7";

/// Which joint types are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Hinges {
    /// All joint types except helical ones.
    Plain,
    /// Helical joints instead of revolute ones, and one cut is helical.
    Screws,
}

/// A tree of three limbs with two joints each; types of joints, friction and placements are random.
/// The second limb starts at a body of the first.
pub fn tree(seed: u64) -> String {
    tree_of(seed, Hinges::Plain)
}

/// A tree like [`tree`]'s, with helical instead of revolute joints.
pub fn screw_tree(seed: u64) -> String {
    tree_of(seed, Hinges::Screws)
}

fn tree_of(seed: u64, hinges: Hinges) -> String {
    let mut writer = Writer::new(seed, "tree", hinges);
    for limb in 0..3 {
        let from = writer.bodies.first().cloned().filter(|_| limb == 1);
        writer.limb(from.as_deref());
        for _ in 0..2 {
            let kind = JOINTS[writer.below(JOINTS.len())];
            writer.joint(kind, true);
        }
    }
    writer.text
}

/// A single loop of one or two limbs and a cut, of mobility 1 or 2, regular at home.
///
/// # Errors
/// When no regular loop is found, which no tried seed has caused.
pub fn closed_loop(seed: u64) -> Result<String, String> {
    loop_of(seed, Hinges::Plain)
}

/// A loop like [`closed_loop`]'s, with helical instead of revolute joints, cut at a helical joint
/// for every second seed.
///
/// # Errors
/// When no regular loop is found.
pub fn screw_loop(seed: u64) -> Result<String, String> {
    loop_of(seed, Hinges::Screws)
}

fn loop_of(seed: u64, hinges: Hinges) -> Result<String, String> {
    let mut last = String::new();
    for attempt in 0..200 {
        match try_loop(
            seed.wrapping_mul(1000) + attempt,
            hinges,
            seed.is_multiple_of(2),
        ) {
            Ok(text) => return Ok(text),
            Err(error) => last = error,
        }
    }
    Err(format!("seed {seed}: {last}"))
}

/// Draws one loop; with `Hinges::Screws` and `screw_cut`, its cut is helical.
fn try_loop(seed: u64, hinges: Hinges, screw_cut: bool) -> Result<String, String> {
    let mut writer = Writer::new(seed, "loop", hinges);
    let (mut cut, mut kind) = CUTS[writer.below(CUTS.len())];
    let mut pitch = "";
    if hinges == Hinges::Screws && screw_cut {
        (cut, kind, pitch) = ("helical", CutKind::Helical, PITCH);
    }
    let mobility = 1 + writer.below(2);
    let mut left = mobility + kind.rows();
    let limbs = 1 + writer.below(2);
    let mut ends = Vec::new();
    for limb in 0..limbs {
        writer.limb(None);
        let share = if limb + 1 == limbs { left } else { left / 2 };
        let mut open = share;
        while open > 0 {
            let joint = JOINTS[writer.below(JOINTS.len())];
            // a fixed joint always fits; others must not take more coordinates than remain
            if joint.1 <= open {
                writer.joint(joint, false);
                open -= joint.1;
            }
        }
        left -= share;
        ends.push(writer.bodies.last().cloned().ok_or("no body")?);
    }
    let mut home = String::from("home: {");
    for (name, slides) in &writer.coordinates {
        let reach = if *slides { 0.3 } else { 1.0 };
        let value = writer.random.uniform(-reach, reach);
        let _ = write!(home, "{name}: {value:.3}, ");
    }
    home.push_str("}\n");
    writer.text.push_str(&home);
    // the loop closes at home if the second frame of the cut is placed there by the open chain
    let chain = Mechanism::from_yaml(&format!("{}independent: []\n", writer.text))?;
    let place = |label: &str| {
        let body = chain.bodies.iter().position(|b| b.label == label);
        body.map(|b| chain.poses(&chain.home_guess)[b])
    };
    let a = place(&ends[0]).ok_or("no body")?;
    let (label, b) = match ends.get(1) {
        Some(end) => (end.as_str(), relative(&place(end).ok_or("no body")?, &a)),
        None => ("world", a),
    };
    let [r, p, y] = rpy(&b);
    let _ = write!(
        writer.text,
        "cuts:\n  - {{name: cut, joint: {cut}{pitch}, between: [{{body: {}}}, {{body: {label}, \
         xyz: [{}, {}, {}], rpy: [{r}, {p}, {y}]}}]}}\n",
        ends[0], b[9], b[10], b[11]
    );
    let names: Vec<String> = writer.coordinates.iter().map(|c| c.0.clone()).collect();
    for _ in 0..20 {
        let mut chosen: Vec<String> = Vec::new();
        while chosen.len() < mobility {
            let name = &names[writer.below(names.len())];
            if !chosen.contains(name) {
                chosen.push(name.clone());
            }
        }
        let text = format!("{}independent: [{}]\n", writer.text, chosen.join(", "));
        let mechanism = Mechanism::from_yaml(&text)?;
        let regular = mechanism.home().is_ok_and(|home| {
            mechanism.mobility(&home) == mobility && mechanism.conditioning(&home) > 0.03
        });
        if regular {
            return Ok(text);
        }
    }
    Err("no regular choice of independent coordinates".into())
}

/// Draws parts of a mechanism at random and writes them as YAML.
struct Writer {
    random: Random,
    hinges: Hinges,
    text: String,
    bodies: Vec<String>,
    /// The names of the coordinates, and whether they are translations.
    coordinates: Vec<(String, bool)>,
    joints: usize,
    limbs: usize,
}

impl Writer {
    fn new(seed: u64, name: &str, hinges: Hinges) -> Writer {
        let mut random = Random::new(seed);
        let g: Vec<f64> = random.vector(3, 9.0);
        let text = format!(
            "name: {name}_{seed}\ngravity: [{:.2}, {:.2}, {:.2}]\nlimbs:\n",
            g[0], g[1], g[2]
        );
        Writer {
            random,
            hinges,
            text,
            bodies: Vec::new(),
            coordinates: Vec::new(),
            joints: 0,
            limbs: 0,
        }
    }

    /// A random index below `n`.
    fn below(&mut self, n: usize) -> usize {
        #[allow(clippy::cast_sign_loss, reason = "the drawn number is not negative")]
        let k = self.random.uniform(0.0, n as f64) as usize;
        k.min(n - 1)
    }

    /// A random pose, in m and rad.
    fn placement(&mut self) -> String {
        let (x, a) = (self.random.vector(3, 0.4), self.random.vector(3, 1.5));
        format!(
            "{{xyz: [{:.3}, {:.3}, {:.3}], rpy: [{:.3}, {:.3}, {:.3}]}}",
            x[0], x[1], x[2], a[0], a[1], a[2]
        )
    }

    /// Begins a limb at a body, or at the world.
    fn limb(&mut self, from: Option<&str>) {
        let base = self.placement();
        let from = from.unwrap_or("world");
        let name = self.limbs;
        let _ = write!(
            self.text,
            "  - name: limb{name}\n    from: {from}\n    base: {base}\n    joints:\n"
        );
        self.limbs += 1;
    }

    /// Appends a joint of a type with its number of coordinates to the last limb; it is actuated at
    /// random unless `actuated` demands it.
    fn joint(&mut self, (kind, coordinates): (&str, usize), actuated: bool) {
        let (kind, pitch) = match (kind, self.hinges) {
            ("revolute", Hinges::Screws) => ("helical", PITCH),
            _ => (kind, ""),
        };
        let name = format!("j{}", self.joints);
        let body = format!("b{}", self.joints);
        self.joints += 1;
        let frame = if self.below(2) == 0 {
            format!("origin: {}", self.placement())
        } else {
            let v = self.random.vector(4, 0.9);
            format!(
                "dh: {{alpha: {:.3}, a: {:.3}, d: {:.3}, theta: {:.3}}}",
                v[0], v[1], v[2], v[3]
            )
        };
        let mut line =
            format!("      - {{name: {name}, type: {kind}{pitch}, {frame}, body: {body}");
        if coordinates == 1 {
            let _ = write!(line, ", axis: {}", ["x", "y", "z"][self.below(3)]);
        }
        if coordinates > 0 {
            let friction = FRICTION[self.below(FRICTION.len())];
            let rotor = self.below(3) == 0;
            let actuated = actuated || self.below(2) == 0;
            let _ = write!(
                line,
                ", friction: {friction}, rotor_inertia: {rotor}, actuated: {actuated}"
            );
        }
        line.push_str("}\n");
        self.text.push_str(&line);
        self.bodies.push(body);
        for k in 0..coordinates {
            let slides = kind == "prismatic" || (kind == "cylindrical" && k == 1);
            let coordinate = match coordinates {
                1 => name.clone(),
                _ => format!("{name}.{}", k + 1),
            };
            self.coordinates.push((coordinate, slides));
        }
    }
}

/// The frame `to` relative to the frame `from`, both in the world: rotation row by row, then the
/// origin.
fn relative(from: &[f64; 12], to: &[f64; 12]) -> [f64; 12] {
    let mut out = [0.0; 12];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * i + j] = (0..3).map(|k| from[3 * k + i] * to[3 * k + j]).sum();
        }
        out[9 + i] = (0..3)
            .map(|k| from[3 * k + i] * (to[9 + k] - from[9 + k]))
            .sum();
    }
    out
}

/// Roll, pitch and yaw of a rotation, rad.
fn rpy(m: &[f64; 12]) -> [f64; 3] {
    [
        m[7].atan2(m[8]),
        (-m[6]).atan2(m[7].hypot(m[8])),
        m[3].atan2(m[0]),
    ]
}
