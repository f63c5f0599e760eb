//! The explanation of mechanisms in words.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::PathBuf;

use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_codegen::explain::{Evidence, Explanation, Freedom};

fn file(path: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    std::fs::read_to_string(root.join(path)).unwrap()
}

fn explained(text: &str) -> Explanation {
    Mechanism::open(&Source::new("test.yaml", text))
        .and_then(|mechanism| mechanism.explanation())
        .unwrap_or_else(|e| panic!("{e}"))
}

fn freedom(explanation: &Explanation, body: &str) -> (Freedom, Evidence) {
    let found = explanation.bodies.iter().find(|b| b.body == body).unwrap();
    (found.freedom, found.evidence)
}

/// The evidence of the relation that begins with the given text.
fn relation(explanation: &Explanation, start: &str) -> Option<Evidence> {
    let mut all = explanation.relations.iter();
    all.find(|f| f.text.starts_with(start)).map(|f| f.evidence)
}

fn is_sampled(evidence: Evidence) -> bool {
    matches!(evidence, Evidence::Sampled { states, digits } if states >= 10 && digits >= 80)
}

/// The reason why a parameter has no effect.
fn reason<'a>(explanation: &'a Explanation, parameter: &str) -> Option<&'a str> {
    let has = |labels: &[String]| labels.iter().any(|l| l == parameter);
    let found = explanation
        .unidentifiable
        .iter()
        .find(|u| has(&u.parameters))?;
    found.reason.as_deref()
}

/// The reason why a parameter acts only together with others.
fn together<'a>(explanation: &'a Explanation, parameter: &str) -> Option<&'a str> {
    let found = explanation
        .grouped
        .iter()
        .find(|m| m.parameter == parameter)?;
    found.reason.as_deref()
}

#[test]
fn a_screw_is_described_as_moving_along_its_axis_in_proportion() {
    let found = explained(&file("tests/fixtures/mechanisms/screw_jack.yaml"));
    let screw = (Freedom::Screw, Evidence::Exact);
    assert_eq!(freedom(&found, "spindle"), screw);
    assert_eq!(freedom(&found, "block").0, Freedom::LinearTranslation);
    let found = explained(&file("tests/fixtures/pairs/screw/thread.yaml"));
    let loops: Vec<&str> = found.loops.iter().map(|f| f.text.as_str()).collect();
    let said = |part: &str| loops.iter().any(|text| text.contains(part));
    assert!(said("closed by a helical joint with 5 rows"), "{loops:?}");
    assert!(said("loop 'thread' keeps to one direction"), "{loops:?}");
    assert!(said("loop 'pin' is planar"), "{loops:?}");
}

#[test]
fn a_parallelogram_is_recognised_by_samples() {
    let found = explained(&file("tests/fixtures/mechanisms/parallelogram_cut.yaml"));
    let shape = found
        .loops
        .iter()
        .find(|f| f.text.contains("parallelogram of q1 q2 q3"));
    assert!(is_sampled(shape.unwrap().evidence));
    assert!(
        found
            .loops
            .iter()
            .any(|f| f.text.contains("is planar") && f.evidence == Evidence::Exact)
    );
    assert!(is_sampled(relation(&found, "q3 = q1 ").unwrap()));
    assert!(is_sampled(relation(&found, "q2 = -q1 ").unwrap()));
    let (coupler, evidence) = freedom(&found, "2");
    assert_eq!(coupler, Freedom::PlanarTranslation);
    assert!(is_sampled(evidence));
    assert_eq!(
        freedom(&found, "1"),
        (Freedom::FixedAxisRotation, Evidence::Exact)
    );
    assert_eq!(reason(&found, "Izz(2)"), Some("body 2 never rotates"));
    assert_eq!(
        together(&found, "mx(3)"),
        Some("bodies 1 3 always have the same orientation")
    );
}

#[test]
fn couplings_show_a_parallelogram_exactly() {
    let found = explained(&file("tests/fixtures/mechanisms/parallelogram.yaml"));
    assert_eq!(relation(&found, "q3 = q1 "), Some(Evidence::Exact));
    assert_eq!(
        freedom(&found, "2"),
        (Freedom::PlanarTranslation, Evidence::Exact)
    );
}

#[test]
fn a_delta_has_a_platform_that_never_rotates() {
    let found = explained(&file("tests/fixtures/mechanisms/delta.yaml"));
    assert_eq!(found.mobility, 3);
    let (platform, evidence) = freedom(&found, "platform");
    assert_eq!(platform, Freedom::SpatialTranslation);
    assert!(is_sampled(evidence));
    assert_eq!(
        reason(&found, "mz(platform)"),
        Some("body platform never rotates")
    );
    assert!(is_sampled(relation(&found, "px = -q1 - u1.1 ").unwrap()));
}

#[test]
fn an_ordinary_planar_loop_has_the_one_relation_of_its_turns_and_it_is_exact() {
    // the angle of its pin is not a coordinate
    let found = explained(&file("robots/fourbar.yaml"));
    assert_eq!(found.relations, []);
    let crank = explained(&file("tests/fixtures/pairs/slider_crank/rail.yaml"));
    assert_eq!(crank.relations.len(), 1, "{:?}", crank.relations);
    assert_eq!(crank.relations[0].evidence, Evidence::Exact);
    assert!(!found.loops.iter().any(|f| f.text.contains("parallelogram")));
}

#[test]
fn gravity_along_the_axes_is_named() {
    let text = file("robots/fourbar.yaml").replace("[0, 0, -9.81]", "[0, -9.81, 0]");
    let found = explained(&text);
    let why = reason(&found, "my(1)").unwrap_or_else(|| panic!("{:?}", found.unidentifiable));
    assert!(why.contains("gravity is parallel"), "{why}");
    let none = explained(&text.replace("[0, -9.81, 0]", "[0, 0, 0]"));
    assert!(reason(&none, "my(1)").unwrap().contains("no gravity"));
}

#[test]
fn special_loops_are_distinguished() {
    let spherical = explained(&file("tests/fixtures/base/spherical_fourbar.yaml"));
    assert!(
        spherical
            .loops
            .iter()
            .any(|f| f.text.contains("is spherical"))
    );
    assert_eq!(freedom(&spherical, "2").0, Freedom::Spherical);
    let bennett = explained(&file("tests/fixtures/base/bennett.yaml"));
    assert!(
        bennett
            .loops
            .iter()
            .any(|f| f.text.contains("because of its lengths"))
    );
    assert!(
        bennett
            .geometry_facts
            .iter()
            .any(|f| f.text.contains("in proportion"))
    );
    let sarrus = explained(&file("tests/fixtures/base/sarrus.yaml"));
    assert_eq!(freedom(&sarrus, "plate").0, Freedom::LinearTranslation);
    assert!(is_sampled(relation(&sarrus, "q5 = -2*q1 - pi ").unwrap()));
    let scara = explained(&file("tests/fixtures/base/scara.yaml"));
    assert_eq!(
        freedom(&scara, "4"),
        (Freedom::Schoenflies, Evidence::Exact)
    );
}

#[test]
fn limits_and_cones_close_to_home_are_named() {
    let base = file("tests/fixtures/mechanisms/hexapod.yaml");
    let near = base
        .replacen(
            "name: p1, type: prismatic,",
            "name: p1, type: prismatic, limits: {position: [0.67, 0.9]},",
            1,
        )
        .replacen(
            "name: s1, type: spherical",
            "name: s1, type: spherical, limits: {cone: 0.48}",
            1,
        )
        .replacen(
            "name: s2, joint: spherical,",
            "name: s2, joint: spherical, limits: {cone: 0.2},",
            1,
        );
    let found = explained(&near);
    let trouble: Vec<&str> = found.warnings.iter().map(|f| f.text.as_str()).collect();
    let all = trouble.join("\n");
    assert!(
        all.contains("home of p1") && all.contains("near the end of its limits"),
        "{all}"
    );
    assert!(
        all.contains("joint 's1'") && all.contains("near its cone"),
        "{all}"
    );
    assert!(
        all.contains("cut 's2'") && all.contains("beyond its cone"),
        "{all}"
    );
    assert_eq!(explained(&base).warnings, []);
}

#[test]
fn the_number_of_drives_is_compared_with_the_mobility() {
    let found = explained(&file("tests/fixtures/mechanisms/fivebar_redundant.yaml"));
    let all: Vec<&str> = found
        .coordinate_facts
        .iter()
        .map(|f| f.text.as_str())
        .collect();
    let all = all.join("\n");
    assert!(all.contains("actuated are q1 q3 q4"), "{all}");
    assert!(all.contains("3 drives for mobility 2"), "{all}");
}

#[test]
fn nominal_inertias_that_no_body_has_are_named() {
    let base = file("robots/fivebar.yaml");
    let all = |text: &str| -> Vec<String> {
        let trouble = explained(text).warnings.into_iter();
        trouble.map(|fact| fact.text).collect()
    };
    assert_eq!(all(&base), [""; 0]);
    let fat = base.replacen(
        "inertia: [1e-5, 0, 0, 1.8e-3, 0, 1.8e-3]",
        "inertia: [1e-5, 0, 0, 1.8e-3, 0, 1.9e-3]",
        1,
    );
    assert_ne!(fat, base);
    let told = all(&fat);
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("nominal inertia of '1'"), "{told:?}");
}

#[test]
fn rotors_explain_only_the_moments_that_they_took_over() {
    let base = file("robots/fivebar.yaml");
    let driven = base.replace("actuated: true", "actuated: true, rotor_inertia: true");
    let driven = explained(&driven);
    let alone = together(&driven, "Izz(1)").unwrap();
    assert!(alone.contains("the rotor of q1"), "{alone}");
    let outer = together(&driven, "m(2)").unwrap();
    assert!(
        outer.contains("inertia of body 2 that joint q2 leaves unchanged"),
        "{outer}"
    );
    for one in &driven.grouped {
        let rotors = one.reason.as_deref().unwrap().contains("rotor of");
        assert_eq!(rotors, one.parameter.starts_with("Izz("), "{one:?}");
    }
}

#[test]
fn offsets_that_act_like_friction_weights_or_other_offsets_are_explained() {
    let of = |joints: &str, more: &str| {
        explained(&format!(
            "name: r\nlimbs:\n  - name: a\n    joints:\n{joints}{more}"
        ))
    };
    let slide = "      - {name: z, type: prismatic, body: 1, actuated: true, rotor_inertia: true, offset: true, FRICTION}\n";
    let friction = slide.replace("FRICTION", "friction: asymmetric");
    let found = of(&friction, "");
    let reason = together(&found, "Fo(z)").unwrap();
    assert!(
        reason.contains("Fc+ less Fc- of z is a constant effort"),
        "{reason}"
    );
    let weight = slide.replace("FRICTION", "friction: none");
    let found = of(&weight, "");
    let reason = together(&found, "m(1)").unwrap();
    assert!(
        reason.contains("a weight is a constant force at z"),
        "{reason}"
    );
    let geared = "      - {name: p, type: revolute, body: 1, actuated: true, offset: true}\n      - {name: q, type: revolute, dh: {a: 1}, body: 2, offset: true}\ncouplings: {q: -2*p}\n";
    let found = of(geared, "");
    let reason = together(&found, "Fo(p)").unwrap();
    assert!(
        reason.contains("the rates of p and q are linearly dependent"),
        "{reason}"
    );
}

#[test]
fn springs_of_coupled_joints_are_explained_as_linearly_dependent() {
    let found = explained(
        "name: r\nlimbs:\n  - name: a\n    joints:\n      - {name: p, type: revolute, body: 1, actuated: true, spring: {rest: 0}}\n      - {name: q, type: revolute, dh: {a: 1}, body: 2, spring: {rest: 0}}\ncouplings: {q: -2*p}\n",
    );
    let reason = together(&found, "K(p)").unwrap();
    assert!(
        reason.contains("the forces of K(p), K(q) are linearly dependent"),
        "{reason}"
    );
}

#[test]
fn rows_of_a_cut_that_is_always_satisfied_are_counted_as_redundant() {
    let text = file("tests/fixtures/random/kept/cut_that_holds_by_itself.yaml");
    let found = explained(&text);
    let all = format!("{found:?}");
    assert!(all.contains("4 closure rows, 4 of them redundant"), "{all}");
}
