//! The analytic base parameters, compared with the numeric method: singular values of the scaled
//! observation matrix (Gautier, 1991), from the regressor of the second derivation.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use regen_codegen::base::Exactness;
use regen_tests::base::{Derivation, Verdict, check_base, states_for};
use regen_tests::random_checks::agreement;
use regen_tests::reference::{Mechanism, Random};
use regen_tests::{files, random_spec, sample_size};

/// Mechanisms with fewer base parameters than the analysis of spanning trees finds: the file, the
/// number that it finds and the true number.
const SPECIAL: [(&str, usize, usize); 17] = [
    ("agile_eye.yaml", 31, 7),
    ("pantograph.yaml", 34, 25),
    ("delta.yaml", 43, 34),
    ("linear_delta.yaml", 37, 28),
    ("palletiser.yaml", 36, 22),
    ("parallelogram_cut.yaml", 8, 3),
    ("fourbar_two_names.yaml", 8, 3),
    ("bennett.yaml", 10, 9),
    ("sarrus.yaml", 12, 5),
    ("delta4.yaml", 54, 43),
    ("schoenflies.yaml", 81, 63),
    ("pin.yaml", 22, 21),
    ("rocker.yaml", 22, 21),
    // the translation of a screw is proportional to its angle, which the analysis of trees cannot
    // use in loops
    ("screw_jack.yaml", 12, 11),
    ("rail.yaml", 9, 8),
    ("thread.yaml", 9, 8),
    // the rotors of two motors on the same joints replace one joint's inertia
    ("tendons.yaml", 15, 14),
];

fn all_files() -> Vec<PathBuf> {
    let mut folders = vec![
        files::robots(),
        files::mechanisms(),
        files::oracle(),
        files::fixtures().join("base"),
    ];
    folders.extend(files::folders(&files::pairs()).unwrap());
    folders
        .iter()
        .flat_map(|folder| files::list(folder, "yaml").unwrap())
        .collect()
}

fn text_of(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn combinations_reproduce_the_regressor_and_kept_columns_are_independent() {
    let mut wrong = Vec::new();
    for path in all_files() {
        let text = text_of(&path);
        let mechanism = Mechanism::from_yaml(&text).unwrap();
        let derivation = Derivation::new(&text).unwrap();
        let states = mechanism.random_states(3, states_for(&mechanism)).unwrap();
        let found = derivation
            .agreement(&mechanism, &states, &Derivation::value)
            .unwrap();
        let file = path.display();
        assert!(found.error < 1e-10, "{file}: {found:?}");
        assert!(found.gap > 1e3, "{file}: {found:?}");
        let kept = derivation.kept().len();
        let name = path.file_name().unwrap().to_string_lossy();
        let special = SPECIAL.iter().find(|s| s.0 == name && s.1 == kept);
        let expected = special.map_or(kept, |s| s.2);
        if found.rank != expected || special.is_none() && found.independence < 1e-9 {
            wrong.push(format!("{file}: {kept} kept, {found:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn completed_bases_reproduce_the_regressor_with_independent_columns() {
    let mut checked = 0;
    for path in all_files() {
        let text = text_of(&path);
        let name = path.file_name().unwrap().to_string_lossy();
        if SPECIAL.iter().all(|s| s.0 != name) {
            continue;
        }
        let trees = Derivation::new(&text).unwrap().kept().len();
        let special = SPECIAL.iter().find(|s| s.0 == name && s.1 == trees);
        let Some((_, _, rank)) = special else {
            continue;
        };
        checked += 1;
        let mechanism = Mechanism::from_yaml(&text).unwrap();
        let derivation = Derivation::completed(&text).unwrap();
        let states = mechanism.random_states(4, states_for(&mechanism)).unwrap();
        let found = derivation
            .agreement(&mechanism, &states, &Derivation::value)
            .unwrap();
        let file = path.display();
        assert_eq!(derivation.kept().len(), *rank, "{file}");
        assert!(found.error < 1e-10, "{file}: {found:?}");
        assert!(found.independence > 1e-9, "{file}: {found:?}");
    }
    assert!(checked >= SPECIAL.len());
}

/// A file, its number of base parameters, and three sets of replacements in its geometry.
type Variations = (
    &'static str,
    usize,
    [&'static [(&'static str, &'static str)]; 3],
);

/// The replacements preserve the relations among values on which the base parameters depend.
const OTHER_GEOMETRIES: [Variations; 7] = [
    (
        "oracle/3rps.yaml",
        25,
        [
            &[("a: 0.4563 ", "a: 0.39 ")],
            &[("a: 0.4563 ", "a: 0.5 ")],
            &[
                ("a: 0.4563 ", "a: sqrt(0.3) "),
                ("r: 0.4563/sqrt(3)", "r: 0.3"),
            ],
        ],
    ),
    (
        "oracle/fivebar.yaml",
        11,
        [
            &[("l1: 0.30, l2: 0.40, w: 0.20", "l1: 0.27, l2: 0.44, w: 0.25")],
            &[("l1: 0.30, l2: 0.40, w: 0.20", "l1: 0.33, l2: 0.41, w: 0.15")],
            &[("l1: 0.30, l2: 0.40, w: 0.20", "l1: 1/3, l2: 0.37, w: 0.2")],
        ],
    ),
    (
        "oracle/puma560.yaml",
        36,
        [
            &[(
                "{a2: 0.4318, a3: -0.0203, d2: 0.2435, d3: -0.0934, d4: 0.4331}",
                "{a2: 0.5, a3: 0.07, d2: 0.1, d3: 0.3, d4: 0.6}",
            )],
            &[("d3: -0.0934", "d3: 0"), ("d2: 0.2435", "d2: 0.15")],
            &[("a3: -0.0203", "a3: 0"), ("a2: 0.4318", "a2: sqrt(0.2)")],
        ],
    ),
    (
        "mechanisms/rrr3.yaml",
        19,
        [
            &[("R: 0.5, l: 0.3, b: 0.12", "R: 0.52, l: 0.31, b: 0.11")],
            &[("R: 0.5, l: 0.3, b: 0.12", "R: 0.48, l: 0.3, b: 0.14")],
            &[("R: 0.5, l: 0.3, b: 0.12", "R: 0.5, l: 1/3, b: sqrt(0.01)")],
        ],
    ),
    (
        "mechanisms/hexapod.yaml",
        82,
        [
            &[("rb: 0.5, rp: 0.28", "rb: 0.5, rp: 0.25")],
            &[("rb: 0.5, rp: 0.28", "rb: 0.6, rp: 0.3")],
            &[("rb: 0.5, rp: 0.28", "rb: 0.45, rp: 2/7")],
        ],
    ),
    (
        "pairs/slider_crank/pin.yaml",
        6,
        [
            &[("l1: 0.15, l2: 0.40, e: 0.05", "l1: 0.2, l2: 0.5, e: 0.05")],
            &[("l1: 0.15, l2: 0.40, e: 0.05", "l1: 0.1, l2: 0.35, e: 0.02")],
            &[("l1: 0.15, l2: 0.40, e: 0.05", "l1: 0.15, l2: 0.45, e: -0.1")],
        ],
    ),
    (
        "base/panda.yaml",
        43,
        [
            &[("d3: 0.316", "d3: 0.4"), ("a4: 0.0825", "a4: 0.1")],
            &[("d5: 0.384", "d5: -0.2"), ("a7: 0.088", "a7: 0.3")],
            &[("d1: 0.333", "d1: 0"), ("a4: 0.0825", "a4: -0.05")],
        ],
    ),
];

#[test]
fn one_derivation_is_right_at_other_geometries() {
    for (file, count, variations) in OTHER_GEOMETRIES {
        let text = text_of(&files::fixtures().join(file));
        let derivation = Derivation::new(&text).unwrap();
        assert_eq!(derivation.kept().len(), count, "{file}");
        assert!(
            derivation.base.coincidences.is_empty(),
            "{file}: {:?}",
            derivation.base.coincidences
        );
        for replacements in variations {
            let mut other = text.clone();
            for (from, to) in replacements {
                assert!(other.contains(from), "{file}: {from}");
                other = other.replacen(from, to, 1);
            }
            let mechanism = Mechanism::from_yaml(&other).unwrap();
            let spec = Derivation::new(&other).unwrap().spec;
            let states = mechanism
                .random_states(5, states_for(&mechanism))
                .unwrap_or_else(|e| panic!("{file} with {replacements:?}: {e}"));
            let found = derivation
                .agreement(&mechanism, &states, &|term| {
                    Derivation::value_at(term, &spec)
                })
                .unwrap();
            // the derived null space equals that of the singular values: it has the same dimension
            // and is contained in it
            assert!(found.error < 1e-10, "{file} {replacements:?}: {found:?}");
            assert_eq!(found.rank, count, "{file} {replacements:?}: {found:?}");
            assert!(found.gap > 1e3, "{file} {replacements:?}: {found:?}");
            assert!(found.independence > 1e-9, "{file} {replacements:?}");
        }
    }
}

/// The text with other values for the names of its geometry that are numbers or multiples of pi:
/// angles change by up to 0.3 rad, lengths by up to 15 percent.
fn with_other_values(text: &str, angles: &[&str], random: &mut Random) -> String {
    let spec = Derivation::new(text).unwrap().spec;
    let lines = text.lines().map(|line| {
        let Some(list) = line.strip_prefix("geometry: {") else {
            return line.to_owned();
        };
        let pairs = list.trim_end_matches('}').split(", ").map(|pair| {
            let (name, written) = pair.split_once(": ").unwrap();
            let (_, own) = spec.geometry.iter().find(|(n, _)| n.value == name).unwrap();
            let own = own.value.to_f64();
            if angles.contains(&name) {
                format!("{name}: {}", own + random.uniform(-0.3, 0.3))
            } else if written.parse::<f64>().is_ok() {
                format!("{name}: {}", own * random.uniform(0.85, 1.15))
            } else {
                pair.to_owned()
            }
        });
        format!("geometry: {{{}}}", pairs.collect::<Vec<_>>().join(", "))
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Compares the combinations of one derivation with singular values at ten other random geometries.
fn check_other_angles(text: &str, derivation: &Derivation, angles: &[&str], what: &str) {
    let mut random = Random::new(3);
    let count = derivation.kept().len();
    for _ in 0..10 {
        let other = with_other_values(text, angles, &mut random);
        let mechanism = Mechanism::from_yaml(&other).unwrap();
        let spec = Derivation::new(&other).unwrap().spec;
        let states = mechanism.random_states(5, states_for(&mechanism)).unwrap();
        let found = derivation
            .agreement(&mechanism, &states, &|term| {
                Derivation::value_at(term, &spec)
            })
            .unwrap();
        let geometry = other
            .lines()
            .find(|line| line.starts_with("geometry"))
            .unwrap();
        assert!(found.error < 1e-9, "{what}, {geometry}: {found:?}");
        assert_eq!(found.rank, count, "{what}, {geometry}: {found:?}");
        assert!(found.gap > 1e3, "{what}, {geometry}: {found:?}");
        assert!(found.independence > 1e-9, "{what}, {geometry}: {found:?}");
    }
}

#[test]
fn one_derivation_is_right_at_other_named_angles() {
    let cases: [(&str, usize, &[&str]); 3] = [
        ("base/named_angles.yaml", 20, &["al", "be", "de"]),
        ("base/rps3_angles.yaml", 25, &["second", "third", "corner"]),
        ("base/spherical_fourbar.yaml", 11, &["crank", "coupler"]),
    ];
    for (file, count, angles) in cases {
        let text = text_of(&files::fixtures().join(file));
        let derivation = Derivation::completed(&text).unwrap();
        assert_eq!(derivation.kept().len(), count, "{file}");
        check_other_angles(&text, &derivation, angles, file);
    }
}

/// An arm whose twists are written with the names al and be in the ways that specs write angles.
fn arm_with_named_angles(seed: u64) -> String {
    const WAYS: [&str; 16] = [
        "0",
        "pi/2",
        "-pi/2",
        "pi/6",
        "al",
        "-al",
        "pi/2 + al",
        "al - pi/2",
        "pi - be",
        "al/2",
        "2*be",
        "al + be",
        "al - be/2",
        "(al + be)/2",
        "0.3 + al",
        "pi/6 - 3*be",
    ];
    let mut random = Random::new(seed);
    let mut one_of = |all: &[&'static str]| {
        let at = random.uniform(0.0, all.len() as f64);
        all[(1..all.len()).filter(|k| at >= *k as f64).count()]
    };
    let mut text = format!(
        "name: arm\ngeometry: {{al: {}, be: {}, l: 0.37, h: {}}}\nlimbs:\n  - name: arm\n    \
         base: {{rpy: [{}, {}, 0]}}\n    joints:\n",
        one_of(&["0.7", "pi/5", "pi/3"]),
        one_of(&["0.31", "-0.4", "pi/7"]),
        one_of(&["0.21", "l*sin(al)", "l*tan(be)"]),
        one_of(&WAYS),
        one_of(&WAYS),
    );
    for k in 1..=3 {
        let kind = one_of(&["revolute", "revolute", "revolute", "prismatic", "universal"]);
        let frame = if one_of(&["dh", "origin"]) == "dh" {
            let (alpha, theta) = (one_of(&WAYS), one_of(&WAYS));
            let (a, d) = (one_of(&["0", "l", "h"]), one_of(&["0", "l"]));
            format!("dh: {{alpha: {alpha}, a: {a}, d: {d}, theta: {theta}}}")
        } else {
            let rpy = [(); 3].map(|()| one_of(&WAYS)).join(", ");
            let (x, z) = (one_of(&["0", "l"]), one_of(&["0", "h"]));
            format!("origin: {{xyz: [{x}, 0, {z}], rpy: [{rpy}]}}")
        };
        let _ = writeln!(
            text,
            "      - {{name: q{k}, type: {kind}, {frame}, body: {k}, actuated: true}}"
        );
    }
    text
}

#[test]
fn combinations_are_right_at_other_angles_of_random_arms() {
    let (count, mut checked) = (sample_size(40, 10), 0);
    for seed in 0..count {
        let text = arm_with_named_angles(seed);
        let derivation = Derivation::completed(&text).unwrap();
        // at special values another rank is right; expressions may be too long
        let rows = derivation.base.parameters.iter();
        let is_symbolic = rows.clone().all(|p| p.exactness == Exactness::Symbolic);
        if derivation.base.coincidences.is_empty() && is_symbolic {
            check_other_angles(&text, &derivation, &["al", "be"], &text);
            checked += 1;
        }
    }
    assert!(3 * checked >= count, "{checked} of {count}");
}

/// Factors that were recognised as expressions in the geometry's names are right at other values of
/// these names.
#[test]
fn completed_factors_are_right_at_other_geometries() {
    let cases: [(&str, usize, [&str; 2]); 5] = [
        (
            "mechanisms/parallelogram_cut.yaml",
            3,
            ["l: 0.4, w: 0.25", "l: 0.31, w: sqrt(0.1)"],
        ),
        (
            "mechanisms/delta.yaml",
            34,
            [
                "rb: 0.2, rp: 0.06, l1: 0.25, l2: 0.6",
                "rb: 0.21, rp: 0.05, l1: 0.28, l2: 0.57",
            ],
        ),
        ("base/sarrus.yaml", 5, ["l: 0.3, r: 0.2", "l: 1/3, r: 0.1"]),
        (
            "base/delta4.yaml",
            43,
            [
                "rb: 0.2, rp: 0.06, l1: 0.25, l2: 0.6",
                "rb: 0.21, rp: 0.05, l1: 0.28, l2: 0.57",
            ],
        ),
        (
            "base/fourbar_two_names.yaml",
            3,
            ["crank: 0.4, rocker: 0.4", "crank: 0.5, rocker: 0.5"],
        ),
    ];
    for (file, count, [from, to]) in cases {
        let text = text_of(&files::fixtures().join(file));
        let derivation = Derivation::completed(&text).unwrap();
        assert_eq!(derivation.kept().len(), count, "{file}");
        assert!(text.contains(from), "{file}: {from}");
        let other = text.replacen(from, to, 1);
        let mechanism = Mechanism::from_yaml(&other).unwrap();
        let spec = Derivation::new(&other).unwrap().spec;
        let states = mechanism.random_states(6, states_for(&mechanism)).unwrap();
        let found = derivation
            .agreement(&mechanism, &states, &|term| {
                Derivation::value_at(term, &spec)
            })
            .unwrap();
        assert!(found.error < 1e-10, "{file}: {found:?}");
        assert_eq!(found.rank, count, "{file}: {found:?}");
        assert!(found.independence > 1e-9, "{file}: {found:?}");
    }
}

#[test]
fn the_texts_of_coefficients_evaluate_to_their_values() {
    for path in all_files() {
        let text = text_of(&path);
        let derivation = Derivation::new(&text).unwrap();
        let null = derivation.base.null.iter().flat_map(|n| &n.terms);
        let kept = derivation.base.parameters.iter().flat_map(|p| &p.terms);
        for term in null.chain(kept) {
            let value = Derivation::value_at(term, &derivation.spec).unwrap();
            let expected = term.value.to_f64();
            assert!(
                (value - expected).abs() <= 1e-13 * expected.abs(),
                "{}: {} is {value}, not {expected}",
                path.display(),
                term.coefficient
            );
        }
    }
}

/// Checks on random specs that the derived combinations are right and, if these are complete, that
/// the kept columns are independent.
fn check_random(specs: impl Iterator<Item = String>, complete: bool) {
    for (seed, text) in (0..).zip(specs) {
        let derivation = Derivation::new(&text).unwrap();
        let found = agreement(&derivation, &text, seed, 1e-10).unwrap_or_else(|e| panic!("{e}"));
        if let Some(found) = found.filter(|_| complete) {
            let kept = derivation.kept().len();
            assert!(found.independence > 1e-9, "{kept} {found:?}\n{text}");
        }
    }
}

#[test]
fn combinations_are_right_on_random_trees_and_kept_columns_are_independent() {
    check_random((0..sample_size(25, 8)).map(random_spec::tree), true);
}

#[test]
fn combinations_are_right_on_random_loops() {
    check_random(
        (0..sample_size(12, 4)).map(|seed| random_spec::closed_loop(seed).unwrap()),
        false,
    );
}

#[test]
fn combinations_are_right_on_random_screws() {
    check_random((0..sample_size(8, 3)).map(random_spec::screw_tree), true);
    check_random(
        (0..sample_size(6, 2)).map(|seed| random_spec::screw_loop(seed).unwrap()),
        false,
    );
}

/// The largest number of parameters for this test; larger specs are checked in an optimised build:
/// `tests/records/base.md`.
const SMALL: usize = 40;

/// Derives the base of a random loop, and fails unless it is certified and right.
fn check_loop(seed: u64) -> Result<(), String> {
    let text = random_spec::closed_loop(seed)?;
    match check_base(&text, seed)? {
        Verdict::Correct(_) => Ok(()),
        Verdict::Uncertified(why) | Verdict::Wrong(why) => Err(format!("seed {seed}: {why}")),
    }
}

#[test]
fn bases_of_random_loops_are_complete_and_reproduce_the_regressor() {
    let small = |seed: &u64| {
        let text = random_spec::closed_loop(*seed).unwrap();
        Mechanism::from_yaml(&text).unwrap().parameters.len() <= SMALL
    };
    let failed: Vec<String> = (0..200)
        .filter(small)
        .take(sample_size(16, 6) as usize)
        .filter_map(|seed| check_loop(seed).err())
        .collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// These seeds have prismatic joints with asymmetric friction that a spanning tree passes in
/// reverse.
#[test]
fn random_loops_that_failed_once_pass() {
    for seed in [87, 94] {
        check_loop(seed).unwrap();
    }
}

/// The cut's frame is written with sixteen digits, so it meets a joint's axis only to these digits:
/// the rates of the other joints are rounding errors, and no base can be certified.
#[test]
fn a_loop_that_is_special_only_to_sixteen_digits_is_not_certified() {
    let text = random_spec::closed_loop(228).unwrap();
    let verdict = check_base(&text, 228).unwrap();
    assert!(matches!(verdict, Verdict::Uncertified(_)), "{verdict:?}");
}
