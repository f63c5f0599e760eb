#![allow(clippy::unwrap_used)]
use super::*;
use crate::base::null_completion::scaled_geometry::home;
use crate::diag::Source;

/// A parallelogram of a crank and a rocker with the same length, on one branch of the two.
fn parallelogram(home: &str) -> String {
    format!(
        "name: parallelogram
geometry: {{l: 0.4, w: 0.25}}
limbs:
  - name: driven
    base: {{rpy: [pi/2, 0, 0]}}
    joints:
      - {{name: q1, type: revolute, body: 1, actuated: true}}
      - {{name: q2, type: revolute, dh: {{a: l}}, body: 2}}
  - name: following
    base: {{xyz: [w, 0, 0], rpy: [pi/2, 0, 0]}}
    joints:
      - {{name: q3, type: revolute, body: 3}}
cuts:
  - {{name: pin, joint: revolute, between: [{{body: 2, xyz: [w, 0, 0]}}, {{body: 3, xyz: [l, 0, 0]}}]}}
home: {home}
"
    )
}

/// For each direction, as factors with labels, whether it is proven.
fn proven_of(text: &str, directions: &[&[(&str, &str)]]) -> Vec<bool> {
    let spec = crate::spec::parse(&Source::new("test.yaml", text)).unwrap();
    let model = crate::model::build(&spec);
    let home = home(&model).unwrap();
    let column = |label: &str| model.parameters.iter().position(|p| p.label == label);
    let directions: Vec<Vec<(usize, Coefficient)>> = directions
        .iter()
        .map(|terms| {
            let terms = terms.iter();
            terms
                .map(|(factor, label)| {
                    (column(label).unwrap(), Coefficient::parse(factor).unwrap())
                })
                .collect()
        })
        .collect();
    proven(&spec, &model, (&home, 1), &directions)
}

const PARALLEL: &str = "{q1: 1.1, q2: -1.1, q3: 1.1}";

#[test]
fn true_directions_of_a_parallelogram_are_proven_and_false_ones_are_not() {
    let directions: [&[(&str, &str)]; 7] = [
        // the coupler does not turn: its moments have no effect
        &[("1", "Izz(2)")],
        // crank and rocker turn alike
        &[("1", "Izz(1)"), ("-1", "Izz(3)")],
        // a mass on the coupler is one on the crank's end
        &[("1", "m(2)"), ("-l^2", "Izz(3)"), ("-l", "mx(3)")],
        &[("1", "m(2)"), ("-l^2", "Izz(3)"), ("-w", "mx(3)")],
        &[("1", "m(2)"), ("-0.16", "Izz(3)"), ("-l", "mx(3)")],
        &[("1", "Izz(1)")],
        // the same number modulo one of the primes
        &[("2305843008749280002", "Izz(1)"), ("-1", "Izz(3)")],
    ];
    assert_eq!(
        proven_of(&parallelogram(PARALLEL), &directions),
        [true, true, true, false, false, false, false]
    );
}

#[test]
fn what_holds_on_one_branch_is_not_proven_on_the_other() {
    let crossed = parallelogram("{q1: 1.1, q2: -3.862, q3: 2.422}");
    let directions: [&[(&str, &str)]; 2] = [
        &[("1", "Izz(2)")],
        // of any loop in this plane
        &[("1", "Ixx(2)")],
    ];
    assert_eq!(proven_of(&crossed, &directions), [false, true]);
}

/// A scissor and a kite upon it, with one degree of freedom: on this branch angles are related, and in the world's
/// frame one equation of the kite holds by the relations alone.
#[test]
fn relations_that_angles_have_on_the_branch_are_part_of_the_proof() {
    let text = "name: scissors
geometry: {a: 0.3, b: 0.35}
limbs:
  - name: one
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
      - {name: p1, type: revolute, origin: {xyz: [a, 0, 0]}, body: 2}
      - {name: q3, type: revolute, origin: {xyz: [b, 0, 0]}, body: 3}
      - {name: p2, type: revolute, origin: {xyz: [a, 0, 0]}, body: 4}
  - name: slider
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: x, type: prismatic, axis: x, body: slide}
cuts:
  - {name: foot, joint: revolute, between: [{body: slide}, {body: 2, xyz: [-a, 0, 0]}]}
  - {name: knee, joint: revolute, between: [{body: 1, xyz: [a + b, 0, 0]}, {body: 4, xyz: [-a, 0, 0]}]}
home: {q1: 0.6, p1: 1.94, q3: -1.94, p2: 1.94, x: 0.5}
";
    let directions: [&[(&str, &str)]; 2] = [
        // the two bars of the scissor turn alike
        &[("1", "Izz(1)"), ("-1", "Izz(2)")],
        &[("1", "Izz(1)"), ("-1", "Izz(3)")],
    ];
    assert_eq!(proven_of(text, &directions), [true, false]);
}
