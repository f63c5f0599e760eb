#![allow(clippy::unwrap_used)]

use super::super::rows::{Expressions, rate_names, states_needed};
use super::super::sparse::Row;
use super::super::units::Units;
use super::*;
use crate::constraints::{NumericLoops, close_home, world_equations};
use crate::diag::Source;
use crate::kinematics::{Frames, Geometry};
use crate::model::ParameterKind;
use crate::sym::Graph;

/// Calls a function with what samples the rows of a mechanism of the repository.
fn with_rows(path: &str, check: impl FnOnce(&Model, &mut Rows<'_>, &mut Walk<'_>)) {
    let path = format!("{}/../{path}", env!("CARGO_MANIFEST_DIR"));
    let source = Source::new(&path, std::fs::read_to_string(&path).unwrap());
    let model = crate::model::build(&crate::spec::parse(&source).unwrap());
    let mut g = Graph::new();
    for coordinate in &model.coordinates {
        g.symbol(&coordinate.name);
    }
    for name in rate_names(&model) {
        g.symbol(&name);
    }
    let frames = Frames::new(&mut g, &model, Geometry::Values);
    let equations = world_equations(&mut g, &frames, &model, None);
    let expressions = Expressions::new(&mut g, &frames, &model);
    let home = close_home(&NumericLoops::new(&g, &equations, &model), &model).unwrap();
    let units = Units::of(&model, &home);
    let mut walk = Walk::new(&g, &equations, &model, &home, 3, units).unwrap();
    let mut rows = Rows::new(&g, &model, &expressions, states_needed(&model), units);
    check(&model, &mut rows, &mut walk);
}

/// h(V, V) / 2 of a body, and h(t_j, V) for each independent coordinate.
fn energy_and_momenta(body: &BodyAt, rates: &[Float320]) -> ([Float320; 10], Vec<[Float320; 10]>) {
    let twist = body.moving(rates);
    let momenta = body.twists.iter().map(|unit| polar(unit, &twist));
    (
        polar(&twist, &twist).map(|x| x.scaled(-1)),
        momenta.collect(),
    )
}

/// Lagrange's equations: the rows of forces of inertia are the differences of the energies' rows,
/// d/dt (dT/dqd_j) - dT/dq_j, which know nothing of moving frames; with them the rows at rest.
fn assert_rows_are_those_of_lagrange(path: &str) {
    with_rows(path, |model, rows, walk| {
        let state = walk.next().unwrap();
        let width = model.independent.len();
        let pace = Pace::of(model);
        let rates = pace.draw(model, walk.random(), 1);
        let accelerations = pace.draw(model, walk.random(), 2);
        let none = vec![Float320::ZERO; width];
        rows.push_motion(&state, walk, &rates, &accelerations)
            .unwrap();
        let moving = rows.take();
        rows.push_motion(&state, walk, &none, &none).unwrap();
        let resting = rows.take();
        assert_eq!((moving.len(), resting.len()), (width, width));

        let time = Float320::ONE.scaled(STEP_EXPONENT);
        let difference = |a: Float320, b: Float320| (a - b).scaled(-STEP_EXPONENT);
        let (bodies, _) = rows.at(&state).unwrap();
        let along = |rates: &[Float320]| {
            let after = walk.after(&state, &project(&state.j, rates), time).unwrap();
            rows.at(&after).unwrap().0
        };
        let later = along(&rates);
        let later_rates: Vec<Float320> = (rates.iter().zip(&accelerations))
            .map(|(r, a)| *r + *a * time)
            .collect();
        let mut compared = 0;
        for j in 0..width {
            let mut unit = none.clone();
            unit[j] = Float320::ONE;
            let beside = along(&unit);
            let entry = |row: &Row, column: usize| {
                let mut entries = row.entries();
                let found = entries.find(|(c, _)| *c == column);
                found.map_or(0.0, |(_, x)| x.to_f64())
            };
            for (column, parameter) in model.parameters.iter().enumerate() {
                let ParameterKind::Inertial { body, entry: e } = parameter.kind else {
                    continue;
                };
                let (energy, momenta) = energy_and_momenta(&bodies[body], &rates);
                let (_, momenta_later) = energy_and_momenta(&later[body], &later_rates);
                let (energy_beside, _) = energy_and_momenta(&beside[body], &rates);
                let expected = difference(momenta_later[j][e], momenta[j][e])
                    - difference(energy_beside[e], energy[e]);
                let expected = expected.to_f64();
                let found = entry(&moving[j], column) - entry(&resting[j], column);
                assert!(
                    (found - expected).abs() < 1e-12 * (1.0 + expected.abs()),
                    "{path} {j} {}: {found} {expected}",
                    parameter.symbol()
                );
                compared += usize::from(expected.abs() > 1e-3);
            }
        }
        assert!(compared > 10, "{path}: {compared}");
    });
}

#[test]
fn forces_of_inertia_are_those_of_lagranges_equations() {
    for path in [
        "robots/puma560.yaml",
        "robots/3rps.yaml",
        "robots/fivebar.yaml",
    ] {
        assert_rows_are_those_of_lagrange(path);
    }
}

#[test]
fn rates_are_those_at_which_inertia_is_as_large_as_weight() {
    with_rows("robots/puma560.yaml", |model, _, _| {
        let pace = Pace::of(model);
        assert!(
            (pace.rate * pace.rate * pace.length - 9.81).abs() < 1e-9,
            "{pace:?}"
        );
    });
}
