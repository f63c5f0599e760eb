#![allow(clippy::unwrap_used)]

use super::super::units::Units;
use super::*;
use crate::constraints::{close_home, world_equations};
use crate::diag::Source;
use crate::kinematics::{Frames, Geometry};

/// The model of a mechanism of the repository, and states of it.
fn states(path: &str, count: usize) -> (Model, Vec<State>) {
    let path = format!("{}/../{path}", env!("CARGO_MANIFEST_DIR"));
    states_of(
        &Source::new(&path, std::fs::read_to_string(&path).unwrap()),
        count,
    )
}

/// The model of a spec, and states of it.
fn states_of(source: &Source, count: usize) -> (Model, Vec<State>) {
    let model = crate::model::build(&crate::spec::parse(source).unwrap());
    let mut g = Graph::new();
    for coordinate in &model.coordinates {
        g.symbol(&coordinate.name);
    }
    let frames = Frames::new(&mut g, &model, Geometry::Values);
    let equations = world_equations(&mut g, &frames, &model, None);
    let loops = NumericLoops::new(&g, &equations, &model);
    let home = close_home(&loops, &model).unwrap();
    let mut walk = Walk::new(&g, &equations, &model, &home, 3, Units::default()).unwrap();
    let states = (0..count).map(|_| walk.next().unwrap()).collect();
    (model, states)
}

fn spread(states: &[State], c: usize) -> f64 {
    let values = states.iter().map(|s| s.q[c].to_f64());
    values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
}

#[test]
fn a_parallelogram_keeps_its_opposite_sides_parallel() {
    let (_, states) = states("tests/fixtures/mechanisms/parallelogram_cut.yaml", 40);
    for state in &states {
        assert!((state.q[0] + state.q[1]).log10() < -75.0);
        assert!((state.q[0] - state.q[2]).log10() < -75.0);
        assert!((state.j[1][0] + Float320::ONE).log10() < -70.0);
        // the flat positions, where the branches meet, are not crossed
        assert!((0.0..core::f64::consts::PI).contains(&state.q[0].to_f64()));
    }
    assert!(spread(&states, 0) > 1.5);
}

#[test]
fn a_crank_goes_all_the_way_round() {
    let (_, states) = states("robots/fourbar.yaml", 40);
    assert!(spread(&states, 0) > 5.0);
}

#[test]
fn limits_of_all_coordinates_are_kept() {
    let (model, states) = states("robots/3rps.yaml", 30);
    for (c, coordinate) in model.coordinates.iter().enumerate() {
        let Some([low, high]) = coordinate.position else {
            continue;
        };
        for state in &states {
            assert!((low..=high).contains(&state.q[c].to_f64()));
        }
        if model.independent.contains(&c) {
            assert!(spread(&states, c) > 0.5 * (high - low));
        }
    }
}

/// A drive that takes four joints along moves far in a step, and the joint that follows it has a narrow
/// range.
#[test]
fn a_joint_that_follows_a_drive_may_leave_its_limits_where_no_state_is_within_all() {
    let joint = |k: usize, lead: &str| {
        format!(
            "      - {{name: j{k}, type: revolute, axis: y, {lead}body: b{k}, limits: {{position: [-0.01, 0.01]}}}}\n"
        )
    };
    let away = "origin: {xyz: [0.1, 0, 0]}, ";
    let joints = [joint(1, ""), joint(2, away), joint(3, away), joint(4, away)].concat();
    let text = format!(
        "name: spine\nlimbs:\n  - name: back\n    joints:\n{joints}drives:\n  d: {{of: j1 + j2 + j3 + j4}}\n\
         independent: [d, j1, j2, j3]\n"
    );
    let (model, states) = states_of(&Source::new("spine.yaml", &text), 8);
    assert_eq!(states.len(), 8);
    for state in &states {
        for &c in &model.independent {
            let Some([low, high]) = model.coordinates[c].position else {
                continue;
            };
            assert!((low..=high).contains(&state.q[c].to_f64()));
        }
    }
}
