//! The known ranks of some mechanisms, from samples in multiple precision.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write;
use std::path::PathBuf;

use regen_codegen::base::certificate::{CertificateError, Float320, Samples, certify};
use regen_codegen::base::derive;
use regen_codegen::constraints::{NumericLoops, close_home, world_equations};
use regen_codegen::diag::Source;
use regen_codegen::kinematics::{Frames, Geometry};
use regen_codegen::model::{self, Model};
use regen_codegen::spec;
use regen_codegen::sym::{Graph, Number};

fn file(path: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    std::fs::read_to_string(root.join(path)).unwrap()
}

/// A mechanism with a home that satisfies the closure equations.
fn mechanism(text: &str) -> (Model, Vec<f64>) {
    let spec = spec::parse(&Source::new("test.yaml", text)).unwrap_or_else(|e| panic!("{e}"));
    let model = model::build(&spec);
    let mut g = Graph::new();
    for coordinate in &model.coordinates {
        g.symbol(&coordinate.name);
    }
    let frames = Frames::new(&mut g, &model, Geometry::Values);
    let equations = world_equations(&mut g, &frames, &model, None);
    let loops = NumericLoops::new(&g, &equations, &model);
    let home = close_home(&loops, &model).unwrap();
    (model, home)
}

fn samples(text: &str) -> (Model, Samples) {
    let (model, home) = mechanism(text);
    let samples = certify(&model, &home, 1).unwrap();
    (model, samples)
}

/// The certified rank of a spec.
fn rank(text: &str) -> usize {
    let certificate = samples(text).1.certificate();
    assert!(certificate.is_certain(), "{certificate:?}");
    assert!(
        certificate.smallest_pivot > 1e60 * certificate.largest_remainder,
        "{certificate:?}"
    );
    certificate.rank
}

#[test]
fn trees_and_loops_have_their_known_ranks() {
    for (path, expected) in [
        ("tests/fixtures/oracle/3rps.yaml", 25),
        ("tests/fixtures/oracle/fivebar.yaml", 11),
        ("tests/fixtures/oracle/puma560.yaml", 36),
        ("tests/fixtures/oracle/tree_branch.yaml", 29),
        ("robots/fourbar.yaml", 8),
        ("tests/fixtures/pairs/slider_crank/pin.yaml", 6),
        ("tests/fixtures/mechanisms/rrr3.yaml", 19),
        // in addition 12 columns of friction
        ("tests/fixtures/mechanisms/prs3.yaml", 19 + 12),
    ] {
        assert_eq!(rank(&file(path)), expected, "{path}");
    }
}

#[test]
fn a_six_legged_platform_has_82_base_parameters() {
    assert_eq!(rank(&file("tests/fixtures/mechanisms/hexapod.yaml")), 82);
}

#[test]
fn where_a_loop_is_cut_does_not_matter() {
    for (one, other) in [
        ("slider_crank/pin", "slider_crank/rail"),
        ("fivebar/base", "fivebar/tip"),
        ("rsur/universal", "rsur/spherical"),
        ("rsur/universal", "rsur/revolute"),
        ("rscr/cylindrical", "rscr/spherical"),
        ("turntable/pin", "turntable/rocker"),
    ] {
        let [one, other] =
            [one, other].map(|p| rank(&file(&format!("tests/fixtures/pairs/{p}.yaml"))));
        assert_eq!(one, other);
    }
}

#[test]
fn a_parallelogram_stays_on_its_branch_and_has_3_base_parameters() {
    assert_eq!(
        rank(&file("tests/fixtures/mechanisms/parallelogram_cut.yaml")),
        3
    );
    // with viscous and Coulomb friction of q2, and a rotor that has the effect of an inertia
    assert_eq!(
        rank(&file("tests/fixtures/mechanisms/parallelogram.yaml")),
        3 + 2
    );
}

#[test]
fn friction_and_rotors_of_the_3_rps_are_independent_of_its_25() {
    let linear = file("robots/3rps_friction.yaml");
    let asymmetric = linear.replace("friction: linear", "friction: coulomb_asymmetric");
    assert_eq!(rank(&linear), 34);
    assert_eq!(rank(&asymmetric), 37);
}

#[test]
fn gravity_along_the_axes_leaves_a_four_bar_4_base_parameters() {
    let text = file("robots/fourbar.yaml").replace("[0, 0, -9.81]", "[0, -9.81, 0]");
    assert_eq!(rank(&text), 4);
}

/// A serial arm from its rows (alpha, a, d), all joints revolute.
fn arm(rows: &[(&str, &str, &str)]) -> String {
    let mut text = String::from("name: arm\nlimbs:\n  - name: arm\n    joints:\n");
    for (k, (alpha, a, d)) in rows.iter().enumerate() {
        let k = k + 1;
        writeln!(
            text,
            "      - {{name: q{k}, type: revolute, \
             dh: {{alpha: {alpha}, a: {a}, d: {d}}}, body: {k}, actuated: true}}"
        )
        .unwrap();
    }
    text
}

#[test]
fn arms_have_their_known_ranks() {
    let seven = arm(&[
        ("0", "0", "0.333"),
        ("-pi/2", "0", "0"),
        ("pi/2", "0", "0.316"),
        ("pi/2", "0.0825", "0"),
        ("-pi/2", "-0.0825", "0.384"),
        ("pi/2", "0", "0"),
        ("pi/2", "0.088", "0"),
    ]);
    assert_eq!(rank(&seven), 43);
    let skew = arm(&[
        ("0", "0", "0.3"),
        ("0.7", "0.11", "0.05"),
        ("-0.4", "0.2", "0.13"),
        ("1.1", "0.17", "-0.07"),
        ("0.9", "0.05", "0.21"),
        ("-1.3", "0.08", "0.04"),
    ]);
    assert_eq!(rank(&skew), 36);
    let tilted = skew.replace("limbs:", "gravity: [1.1, 0.7, -9.6]\nlimbs:");
    assert_eq!(rank(&tilted), 38);
    // the rotors of the first two joints have the effect of inertias
    let rotors = seven.replace("actuated: true", "actuated: true, rotor_inertia: true");
    assert_eq!(rank(&rotors), 48);
}

/// A SCARA arm; `more` is added to the description of every joint.
fn scara(more: &str) -> String {
    format!(
        "name: scara
limbs:
  - name: arm
    joints:
      - {{name: q1, type: revolute, body: 1, actuated: true{more}}}
      - {{name: q2, type: revolute, dh: {{a: 0.325}}, body: 2, actuated: true{more}}}
      - {{name: q3, type: prismatic, dh: {{a: 0.275}}, body: 3, actuated: true{more}}}
      - {{name: q4, type: revolute, body: 4, actuated: true{more}}}
"
    )
}

#[test]
fn on_a_vertical_slide_weight_and_one_sided_friction_are_one() {
    assert_eq!(rank(&scara("")), 8);
    assert_eq!(rank(&scara(", rotor_inertia: true")), 11);
    let all = scara(", rotor_inertia: true, friction: asymmetric");
    assert_eq!(rank(&all), 11 + 16 - 1);
    let symmetric = scara(", friction: linear");
    assert_eq!(rank(&symmetric), 8 + 8);
}

#[test]
fn angles_that_add_up_to_a_constant_couple_their_one_sided_friction() {
    let rail = file("tests/fixtures/pairs/slider_crank/rail.yaml");
    let with = |kind: &str| rail.replace(", body:", &format!(", friction: {kind}, body:"));
    assert_eq!(rank(&with("viscous")), 6 + 3);
    // the three powers |qd| are independent only if the signs of the rates change
    assert_eq!(rank(&with("linear")), 6 + 6);
    // q1 + q2 + q3 is constant: equal offsets on all three do no work
    assert_eq!(rank(&with("coulomb_asymmetric")), 6 + 9 - 1);
}

/// Lengths from 1e-6 to 1e3 m, any gravity: the distinction between rounding and other numbers does
/// not depend on units.
#[test]
fn absurd_scales_do_not_change_a_rank() {
    let planar = |lengths: [&str; 2], gravity: &str| {
        let rows = [
            ("0", "0", "0"),
            ("0", lengths[0], "0"),
            ("0", lengths[1], "0"),
        ];
        let friction = "actuated: true, friction: coulomb_asymmetric";
        let text = arm(&rows).replace("actuated: true", friction);
        text.replace("limbs:", &format!("gravity: [{gravity}, 0, 0]\nlimbs:"))
    };
    // three bodies with Izz, mx and my each, and nine parameters of friction
    for lengths in [
        ["0.3", "0.2"],
        ["1e3", "1e-6"],
        ["1e-6", "1e3"],
        ["1e-6", "2e-6"],
    ] {
        for gravity in ["9.81", "1e200", "1e-200", "1e12"] {
            assert_eq!(
                rank(&planar(lengths, gravity)),
                9 + 9,
                "{lengths:?} {gravity}"
            );
        }
        // without gravity, the first moments of the first body have no effect
        assert_eq!(rank(&planar(lengths, "0")), 7 + 9, "{lengths:?}");
    }
    let loops = [
        ("robots/fourbar.yaml", 8),
        ("tests/fixtures/mechanisms/parallelogram_cut.yaml", 3),
    ];
    for (path, expected) in loops {
        let text = file(path);
        for gravity in ["1e200", "1e-200"] {
            let text = text.replace("limbs:", &format!("gravity: [0, 0, {gravity}]\nlimbs:"));
            let text = text.replacen("gravity: [0, 0, -9.81]\n", "", 1);
            assert_eq!(rank(&text), expected, "{path} {gravity}");
        }
    }
    for unit in ["1e-6", "1e3"] {
        let text = file("tests/fixtures/mechanisms/parallelogram_cut.yaml");
        let text = text.replace("l: 0.4, w: 0.25", &format!("l: 0.4*{unit}, w: 0.25*{unit}"));
        assert!(text.contains(unit));
        assert_eq!(rank(&text), 3, "{unit}");
    }
}

#[test]
fn a_platform_that_never_rotates_has_fewer_base_parameters_than_its_trees_yield() {
    assert_eq!(rank(&file("tests/fixtures/mechanisms/delta.yaml")), 34);
}

#[test]
fn combinations_are_right_at_states_that_they_were_not_computed_from() {
    let (model, home) = mechanism(&file("robots/3rps_friction.yaml"));
    let samples = certify(&model, &home, 1).unwrap();
    let fresh = certify(&model, &home, 2).unwrap();
    let column = |label: &str| {
        let found = model.parameters.iter().position(|p| p.label == label);
        found.unwrap()
    };
    // kept columns are chosen greedily; those that the chapter's Table 1 eliminates come last
    let last = ["my(3)", "m(3)", "m(2)"].map(column);
    let others = (0..model.parameters.len())
        .rev()
        .filter(|c| !last.contains(c));
    let order: Vec<usize> = others.chain(last).collect();
    let kept = samples.independent(&order);
    assert_eq!(samples.rank_of(&kept), kept.len());
    assert!(last.iter().all(|c| !kept.contains(c)));
    assert_eq!(kept.len(), samples.certificate().rank);
    let combinations = samples.combinations(&kept).unwrap();
    let mut null_directions = 0;
    for (c, coefficients) in combinations.iter().enumerate() {
        if kept.contains(&c) {
            continue;
        }
        let mut direction = vec![Float320::ZERO; model.parameters.len()];
        direction[c] = -Float320::ONE;
        for (k, x) in kept.iter().zip(coefficients) {
            direction[*k] = *x;
        }
        assert!(fresh.residual(&direction) < 1e-80);
        direction[kept[0]] = direction[kept[0]] + Float320::from_f64(1e-30);
        assert!(fresh.residual(&direction) > 1e-40);
        null_directions += 1;
    }
    assert_eq!(null_directions, model.parameters.len() - kept.len());

    // my(3) in m(5) is -2 sqrt(3)/(3 a)
    assert!(kept.contains(&column("m(5)")));
    let at = kept.iter().position(|k| *k == column("m(5)")).unwrap();
    let a = Number::parse_decimal("0.4563").unwrap();
    let root = Number::from_i64(3).sqrt().unwrap();
    let exact = root.mul(&Number::ratio(-2, 3).unwrap()).div(&a).unwrap();
    let found = combinations[column("my(3)")][at];
    assert!(
        (found - Float320::from_number(&exact)).log10() < -80.0,
        "{}",
        found.to_f64()
    );
}

#[test]
fn the_same_seed_gives_the_same_certificate() {
    let (model, home) = mechanism(&file("robots/fivebar.yaml"));
    let [one, again, other] = [7, 7, 8].map(|seed| certify(&model, &home, seed).unwrap());
    assert_eq!(one.certificate(), again.certificate());
    assert_ne!(one.certificate(), other.certificate());
    assert_eq!(one.certificate().rank, other.certificate().rank);
}

#[test]
fn a_closure_that_is_satisfied_only_to_rounding_is_refused() {
    // a quarter turn of 17 digits on one side of a planar loop, an exact one on the other
    let text = file("robots/fourbar.yaml");
    let rounded = text.replacen("rpy: [pi/2, 0, 0]", "rpy: [1.5707963267948966, 0, 0]", 1);
    assert_ne!(text, rounded);
    let (model, home) = mechanism(&rounded);
    assert_eq!(
        certify(&model, &home, 1).err(),
        Some(CertificateError::Inexact)
    );
}

#[test]
fn narrow_limits_of_a_dependent_joint_change_no_rank() {
    let text = file("robots/fourbar.yaml");
    let rocker = mechanism(&text).1[2];
    let (low, high) = (rocker - 1e-9, rocker + 1e-9);
    let narrow = text.replace(
        "body: 3}\n\ncuts",
        &format!("body: 3, limits: {{position: [{low}, {high}]}}}}\n\ncuts"),
    );
    assert_ne!(text, narrow);
    let rank = |text: &str| {
        let (model, home) = mechanism(text);
        certify(&model, &home, 1).unwrap().certificate().rank
    };
    assert_eq!(rank(&narrow), rank(&text));
}

#[test]
fn a_body_that_cannot_move_has_no_base_parameters() {
    let text = "name: still
limbs:
  - name: a
    joints:
      - {type: fixed, body: 1}
      - {name: q, type: revolute, actuated: true}
";
    let samples = samples(text).1;
    let certificate = samples.certificate();
    assert_eq!((certificate.columns, certificate.rank), (10, 0));
    assert!(certificate.is_certain());
    assert_eq!(samples.combinations(&[]), Some(vec![vec![]; 10]));
    assert_eq!(samples.residual(&[Float320::ONE; 10]).to_bits(), 0);
}

/// A trunk with four limbs of seven joints, no two axes in a row parallel.
fn trunk_with_limbs() -> String {
    let mut text = String::from(
        "name: trunk\nlimbs:\n  - name: trunk\n    joints:\n      \
         - {name: t, type: revolute, body: trunk, actuated: true}\n",
    );
    for limb in ["a", "b", "c", "d"] {
        writeln!(text, "  - name: {limb}\n    from: trunk\n    joints:").unwrap();
        for (k, axis) in (1..).zip(["y", "z", "x", "y", "z", "x", "z"]) {
            let xyz = format!(
                "[0.0{k}, {}, -0.1{k}]",
                if limb < "c" { "0.1" } else { "-0.2" }
            );
            writeln!(
                text,
                "      - {{name: {limb}{k}, type: revolute, origin: {{xyz: {xyz}}}, axis: {axis}, \
                 body: {limb}{k}, actuated: true}}"
            )
            .unwrap();
        }
    }
    text
}

/// Some parameters of such a robot act in one entry of the mass matrix alone.
#[test]
fn samples_of_many_coordinates_find_what_one_tree_derives() {
    let text = trunk_with_limbs();
    let spec = spec::parse(&Source::new("trunk.yaml", &*text)).unwrap();
    let (model, samples) = samples(&text);
    let derived = derive(&spec, &model, Some(0));
    let certificate = samples.certificate();
    assert_eq!(model.independent.len(), 29);
    assert_eq!(certificate.rank, derived.rank());
    assert!(certificate.is_certain(), "{certificate:?}");
}

#[test]
fn samples_join_and_raise_no_rank_that_is_complete() {
    let (model, home) = mechanism(&file("tests/fixtures/oracle/puma560.yaml"));
    let [mut one, other] = [1, 2].map(|seed| certify(&model, &home, seed).unwrap());
    let states = one.certificate().states + other.certificate().states;
    assert!(!one.join(other));
    assert_eq!(
        (one.certificate().rank, one.certificate().states),
        (36, states)
    );
}
