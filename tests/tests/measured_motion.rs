//! States of the shipped robots with loops, completed from their measured coordinates.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_identify::states::{Completed, Completion};
use regen_robots::{
    delta::Delta, fivebar::Fivebar, palletiser::Palletiser, rps3::Rps3, stewart::Stewart,
};
use regen_runtime::{LoopClosure, Model, State};

const ROBOTS: [&dyn Model<f64>; 5] = [&Delta, &Fivebar, &Palletiser, &Rps3, &Stewart];

/// States along a small motion around home, in which all independent coordinates have different
/// phases.
fn states(model: &dyn Model<f64>) -> Vec<State> {
    let info = model.info();
    let mut closure = LoopClosure::new(model).unwrap();
    (0..12)
        .map(|k| {
            let along = |size: f64, lead: f64| -> Vec<f64> {
                let all = (0..info.dof()).map(|i| size * (0.4 * f64::from(k) + lead + i as f64));
                all.collect()
            };
            let sine = |lead: f64| along(1.0, lead).into_iter().map(f64::sin);
            let q: Vec<f64> = info
                .independent
                .iter()
                .zip(sine(0.0))
                .map(|(&c, s)| info.home[c] + 0.02 * s)
                .collect();
            let qd: Vec<f64> = sine(2.0).map(|s| 0.3 * s).collect();
            let qdd: Vec<f64> = sine(4.0).map(|s| 2.0 * s).collect();
            let state = closure.track_state(&q, &qd, &qdd).unwrap();
            assert!(state.outcome.is_closed(), "{}", info.name);
            state
        })
        .collect()
}

/// With encoders at all joints, exact values give the exact state for any standard deviations.
#[test]
fn exact_values_of_all_coordinates_give_the_exact_state() {
    for model in ROBOTS {
        let info = model.info();
        let n = info.coordinates.len();
        // not in the order of the model
        let measured: Vec<usize> = (0..n).rev().collect();
        let deviations: Vec<f64> = measured.iter().map(|m| 0.01 + 0.03 * *m as f64).collect();
        let mut completion = Completion::new(model, &measured, &deviations).unwrap();
        for exact in states(model) {
            let pick = |all: &[f64]| -> Vec<f64> { measured.iter().map(|&m| all[m]).collect() };
            let (q, qd, qdd) = (pick(&exact.q), pick(&exact.qd), pick(&exact.qdd));
            let Completed::State(found) = completion.complete(&q, &qd, &qdd).unwrap() else {
                panic!("{}: {:?}", info.name, completion.complete(&q, &qd, &qdd));
            };
            for (a, b) in [
                (&found.q, &exact.q),
                (&found.qd, &exact.qd),
                (&found.qdd, &exact.qdd),
            ] {
                for (a, b) in a.iter().zip(b) {
                    // rounding and the end of the Newton steps, times the ratios of the joints'
                    // rates
                    assert!((a - b).abs() < 1e-10 * (1.0 + b.abs()), "{}", info.name);
                }
            }
        }
    }
}

/// Fewer measured coordinates than degrees of freedom, and one coordinate twice.
#[test]
fn too_few_or_repeated_measured_coordinates_are_refused() {
    let info = Model::<f64>::info(&Stewart);
    let few = &info.independent[1..];
    assert!(Completion::new(&Stewart as &dyn Model<f64>, few, &vec![0.1; few.len()]).is_err());
    // one crank of a five-bar does not determine the other
    let model: &dyn Model<f64> = &Fivebar;
    let info = model.info();
    assert_eq!(info.dof(), 2);
    let twice = [info.independent[0]; 2];
    assert!(Completion::new(model, &twice, &[0.1; 2]).is_err());
}
