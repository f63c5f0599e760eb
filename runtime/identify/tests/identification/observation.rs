//! The observation matrix consists of the regressors of its samples.

use regen_identify::observation::{Sample, observation_matrix};
use regen_runtime::{LoopClosure, Model, SizeError, State};

use crate::models::slider_crank::SliderCrank;

const MODEL: SliderCrank = SliderCrank {
    crank: 1.0,
    rod: 1.6,
    offset: 0.3,
    home: [0.0, 0.19, 2.57],
};

fn state(angle: f64, qd: f64, qdd: f64) -> State {
    let state = LoopClosure::new(&MODEL)
        .unwrap()
        .solve_state(&[angle], &[qd], &[qdd])
        .unwrap();
    assert!(state.outcome.is_closed());
    state
}

#[test]
fn observations_are_stacked_sample_by_sample_with_their_conditions() {
    let states = [
        state(0.3, 1.0, 2.0),
        state(1.0, -1.0, 3.0),
        state(2.0, 0.5, -4.0),
    ];
    let samples: Vec<Sample<'_>> = states.iter().map(Sample::from).collect();
    let mut observed = observation_matrix(&MODEL, &samples).unwrap();
    assert_eq!((observed.rows, observed.columns, observed.dof), (3, 3, 1));
    for (k, state) in states.iter().enumerate() {
        let mut w = [0.0; 3];
        let condition = MODEL
            .regressor(&state.q, &state.qd, &state.qdd, &mut w)
            .unwrap();
        assert_eq!(observed.conditions[k], condition);
        assert_eq!(
            w.map(f64::to_bits),
            [0, 1, 2].map(|j| observed.column(j)[k].to_bits())
        );
    }
    assert_eq!(observed.column(3), &[] as &[f64]);

    let before = observed.clone();
    let divisors = observed.scale_columns();
    for (j, divisor) in divisors.iter().enumerate() {
        let largest = observed
            .column(j)
            .iter()
            .fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!((largest - 1.0).abs() < 1e-15);
        for (scaled, plain) in observed.column(j).iter().zip(before.column(j)) {
            assert!((scaled * divisor - plain).abs() <= 1e-15 * plain.abs());
        }
    }
    let mut empty = observation_matrix(&MODEL, &[]).unwrap();
    assert_eq!((empty.rows, empty.scale_columns().len()), (0, 3));
}

#[test]
fn a_sample_of_the_wrong_size_is_an_error() {
    let sample = Sample {
        q: &[0.0; 3],
        qd: &[0.0; 2],
        qdd: &[0.0; 3],
    };
    let error = SizeError {
        argument: "qd",
        expected: 3,
        got: 2,
    };
    assert_eq!(observation_matrix(&MODEL, &[sample]), Err(error));
}
