//! Which parameters are kept: bodies that are fixed to others, axes, small offsets, names, and lists
//! of parameters to eliminate.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::Mechanism;
use regen_codegen::base::Analysis;
use regen_codegen::diag::Source;
use regen_codegen::sym::Number;

/// The base parameters of a description, and its parameters' labels.
fn analysed(text: &str) -> (Analysis, Vec<String>) {
    let mechanism = Mechanism::open(&Source::new("robot.yaml", text)).unwrap();
    let analysis = mechanism.analysis().unwrap().clone();
    assert!(analysis.complete);
    let robot = mechanism.robot(&[]).unwrap();
    let labels = robot.parameters.iter().map(|p| p.label.clone());
    (analysis, labels.collect())
}

fn largest(analysis: &Analysis) -> f64 {
    let terms = analysis.base.parameters.iter().flat_map(|p| &p.terms);
    terms.map(|t| t.value.to_f64().abs()).fold(0.0, f64::max)
}

fn kept<'a>(analysis: &Analysis, labels: &'a [String]) -> Vec<&'a str> {
    let parameters = analysis.base.parameters.iter();
    parameters.map(|p| labels[p.column].as_str()).collect()
}

/// A wrist of three joints, the second of which is 1 mm beside the first.
fn wrist(axis: &str, more: &str) -> String {
    format!(
        "name: wrist\ngravity: [1, 2, -9]\nlimbs:\n  - name: a\n    joints:\n      \
         - {{name: q1, type: revolute, axis: y, body: 1, actuated: true}}\n      \
         - {{name: q2, type: revolute, axis: {axis}, origin: {{xyz: [0.001, 0.3, 0.002]}}, body: 2, \
         actuated: true}}\n      \
         - {{name: q3, type: revolute, axis: y, origin: {{xyz: [0.001, 0, 0.4]}}, body: 3, \
         actuated: true}}\n{more}"
    )
}

#[test]
fn no_coefficient_is_the_inverse_of_a_small_offset() {
    for axis in ["x", "y", "z"] {
        let (analysis, _) = analysed(&wrist(axis, ""));
        let largest = largest(&analysis);
        assert!(largest <= 1.0, "{axis}: {largest}");
        let condition = analysis.condition.unwrap();
        assert!(condition < 100.0, "{axis}: {condition}");
    }
}

/// Fingers that slide by 2 cm determine their centres of mass badly; how badly depends on the
/// choice of the kept parameters.
#[test]
fn rows_that_stay_badly_conditioned_are_given_other_columns() {
    let (analysis, labels) = analysed(
        "name: hand\ngravity: [1, 2, -9]\nlimbs:\n  - name: a\n    joints:\n      \
         - {name: q1, type: revolute, body: 1, actuated: true}\n      \
         - {name: q2, type: revolute, axis: x, origin: {xyz: [0.1, 0, 0.3]}, body: 2, actuated: true}\n      \
         - {name: q3, type: revolute, axis: y, origin: {xyz: [0, 0.2, 0.3]}, body: 3, actuated: true}\n      \
         - {type: fixed, origin: {xyz: [0, 0, 0.1], rpy: [0, 0, -pi/4]}, body: palm}\n      \
         - {name: f1, type: prismatic, axis: y, origin: {xyz: [0, 0, 0.06]}, body: left, actuated: true, \
         limits: {position: [0, 0.02]}}\n  - name: b\n    from: palm\n    joints:\n      \
         - {name: f2, type: prismatic, axis: y, origin: {xyz: [0, 0, 0.06], rpy: [pi, 0, 0]}, body: right, \
         limits: {position: [0, 0.02]}}\ncouplings: {f2: f1}\n",
    );
    // 2200 with the columns that exchanges down to 4 leave
    let condition = analysis.condition.unwrap();
    assert!(
        condition < 1000.0,
        "{condition}: {:?}",
        kept(&analysis, &labels)
    );
    assert!(largest(&analysis) <= 4.0);
}

/// Users can eliminate a parameter that the choice would keep, which increases the condition
/// number.
#[test]
fn a_list_of_parameters_to_eliminate_is_followed() {
    let (free, labels) = analysed(&wrist("z", ""));
    let list = "base: {eliminate: [mx(1)]}\n";
    let (chosen, _) = analysed(&wrist("z", list));
    assert!(kept(&free, &labels).contains(&"mx(1)"));
    assert!(!kept(&chosen, &labels).contains(&"mx(1)"));
    assert!(
        chosen.condition > free.condition,
        "{:?} {:?}",
        chosen.condition,
        free.condition
    );
}

/// The parameters of a tool that is fixed to a link are lumped into those of the link, whatever the
/// tool's pose.
#[test]
fn a_body_fixed_to_another_is_lumped_into_it() {
    for fixed in [
        "{type: fixed, origin: {xyz: [0.1, 0.2, 0.003]}, body: tip}",
        "{type: fixed, origin: {xyz: [0.1, 0.2, 0.003], rpy: [0.3, 0.2, 1]}, body: tip}",
    ] {
        let text = format!(
            "name: tool\nlimbs:\n  - name: a\n    joints:\n      \
             - {{name: q1, type: revolute, axis: y, body: link, actuated: true}}\n      \
             - {{name: q2, type: revolute, axis: x, origin: {{xyz: [0, 0.001, 0]}}, body: hand, \
             actuated: true}}\n      - {fixed}\n"
        );
        let (analysis, labels) = analysed(&text);
        for label in kept(&analysis, &labels) {
            assert!(!label.ends_with("(tip)"), "{label} is kept");
        }
        let lumped = analysis.base.parameters.iter().flat_map(|p| &p.terms);
        let of_tip = lumped.filter(|t| labels[t.column].ends_with("(tip)"));
        assert!(of_tip.count() > 10);
    }
}

/// The same arm with the names of the axes changed cyclically keeps the same parameters under the
/// names that they then have, up to which of two equal diagonal moments is kept.
#[test]
fn any_axis_is_treated_like_z() {
    let offsets = [["0.1", "0.2", "0.3"], ["0.25", "0.15", "0.35"]];
    let mut found: Vec<(usize, f64)> = Vec::new();
    for shift in 0..3 {
        // the old axis k is the new axis (k + shift) % 3
        let name = |k: usize| ["x", "y", "z"][(k + shift) % 3];
        let xyz = |v: &[&str; 3]| {
            let at = |k: usize| v[(k + 3 - shift) % 3];
            format!("[{}, {}, {}]", at(0), at(1), at(2))
        };
        let text = format!(
            "name: arm\ngravity: {}\nlimbs:\n  - name: a\n    joints:\n      \
             - {{name: q1, type: revolute, axis: {z}, body: 1, actuated: true}}\n      \
             - {{name: q2, type: revolute, axis: {x}, origin: {{xyz: {}}}, body: 2, actuated: true}}\n      \
             - {{name: q3, type: revolute, axis: {z}, origin: {{xyz: {}}}, body: 3, actuated: true}}\n",
            xyz(&["1", "2", "-9"]),
            xyz(&offsets[0]),
            xyz(&offsets[1]),
            z = name(2),
            x = name(0),
        );
        let (analysis, labels) = analysed(&text);
        let kept = kept(&analysis, &labels);
        for body in 1..4 {
            // of a body behind a joint about z: neither m, mz nor both of Ixx and Iyy
            let axis = name(if body == 2 { 0 } else { 2 });
            for eliminated in [format!("m({body})"), format!("m{axis}({body})")] {
                assert!(!kept.contains(&eliminated.as_str()), "{eliminated} is kept");
            }
        }
        found.push((kept.len(), analysis.condition.unwrap()));
    }
    let (count, condition) = found[0];
    for (other, theirs) in found {
        assert_eq!(count, other);
        let ratio = theirs / condition;
        assert!((0.5..2.0).contains(&ratio), "{theirs} beside {condition}");
    }
}

/// With names the choice must not depend on their values: the table is the same and valid at other
/// values.
#[test]
fn names_are_not_divided_by_where_their_value_is_small() {
    let text = |a: &str| {
        format!(
            "name: arm\ngeometry: {{a: {a}}}\nlimbs:\n  - name: a\n    joints:\n      \
             - {{name: q1, type: revolute, body: 1, actuated: true}}\n      \
             - {{name: q2, type: revolute, origin: {{xyz: [a, 0, 0]}}, body: 2, actuated: true}}\n"
        )
    };
    let (small, labels) = analysed(&text("0.0001"));
    let (usual, _) = analysed(&text("0.4"));
    assert_eq!(kept(&small, &labels), kept(&usual, &labels));
    let coefficients = |analysis: &Analysis| -> Vec<String> {
        let terms = analysis.base.parameters.iter().flat_map(|p| &p.terms);
        terms.map(|t| t.coefficient.to_string()).collect()
    };
    assert_eq!(coefficients(&small), coefficients(&usual));
    assert!(coefficients(&small).contains(&"a^2".to_owned()));
    let square = Number::ratio(1, 100_000_000).unwrap();
    let terms = small.base.parameters.iter().flat_map(|p| &p.terms);
    assert!(terms.map(|t| &t.value).any(|value| *value == square));
}
