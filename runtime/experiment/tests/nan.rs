//! NaN and infinite inputs must give an error, an outcome or NaN, never a plausible number.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "../../tests/models/pendulum.rs"]
#[allow(unreachable_pub, reason = "examples include the file too")]
mod pendulum;

use pendulum::Pendulum;
use regen_experiment::simulate::{
    ControllerInput, Drive, Forward, ForwardOutcome, Settings, Termination, simulate_controlled,
};
use regen_identify::observation::{Sample, observation_matrix};
use regen_runtime::Status;

const NON_FINITE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
const PHI: [f64; 2] = [0.02, 0.1];

#[test]
fn forward_dynamics_gives_no_finite_result_for_nan_or_infinity() {
    let accelerations = |phi: [f64; 2], [q, qd, effort]: [f64; 3]| {
        let mut out = [0.5];
        let outcome = Forward::new(&Pendulum, &phi)
            .unwrap()
            .accelerations(&[q], &[qd], &[effort], &mut out)
            .unwrap();
        match outcome {
            ForwardOutcome::Solved(condition) if condition.status() != Status::Singular => {
                Some(out[0])
            }
            _ => None,
        }
    };
    let state = [0.4, 0.2, 0.3];
    assert!(accelerations(PHI, state).unwrap().is_finite());
    for value in NON_FINITE {
        // not the velocity, on which a pendulum's acceleration does not depend
        for k in [0, 2] {
            let mut state = state;
            state[k] = value;
            let found = accelerations(PHI, state);
            assert!(
                found.is_none_or(|a| !a.is_finite()),
                "{k} {value}: {found:?}"
            );
        }
        let found = accelerations([0.02, value], state);
        assert!(
            found.is_none_or(|a| !a.is_finite()),
            "weight {value}: {found:?}"
        );
    }
    for inertia in [f64::NAN, f64::NEG_INFINITY, 0.0, -1.0] {
        assert_eq!(accelerations([inertia, 0.1], state), None, "{inertia}");
    }
}

/// A command that is NaN must not be replaced by the limit of the drive.
#[test]
fn a_command_that_is_nan_ends_the_run_with_or_without_limits() {
    let start = |_: f64, q: &mut [f64], _: &mut [f64], _: &mut [f64]| q[0] = 0.4;
    for limit in [None, Some([-1.0, 1.0])] {
        let settings = Settings {
            duration: 0.5,
            drives: vec![Drive {
                limit,
                ..Drive::default()
            }],
            ..Settings::default()
        };
        let run = |value: f64| {
            let mut controller = |now: &ControllerInput<'_>, efforts: &mut [f64]| {
                efforts[0] = if now.t < 0.2 { 0.0 } else { value }
            };
            simulate_controlled(&Pendulum, &PHI, &start, &mut controller, &settings).unwrap()
        };
        let log = run(f64::NAN);
        assert_eq!(log.ended, Termination::Diverged, "{limit:?}");
        assert!(
            log.t.last().is_some_and(|t| *t < 0.21),
            "{:?}",
            log.t.last()
        );
        assert_eq!(run(0.1).ended, Termination::Complete);
    }
    // an infinite command is reduced to the limit
    let settings = Settings {
        duration: 0.5,
        drives: vec![Drive {
            limit: Some([-0.01, 0.01]),
            ..Drive::default()
        }],
        ..Settings::default()
    };
    let mut all = |_: &ControllerInput<'_>, efforts: &mut [f64]| efforts[0] = f64::INFINITY;
    let log = simulate_controlled(&Pendulum, &PHI, &start, &mut all, &settings).unwrap();
    assert_eq!(log.ended, Termination::Complete);
}

#[test]
fn a_nan_sample_changes_only_its_own_rows_of_the_observation_matrix() {
    const GOOD: [[f64; 1]; 3] = [[0.4], [0.2], [0.3]];
    const SPOILT: [[f64; 1]; 3] = [[f64::NAN], [0.2], [f64::NAN]];
    let sample = |[q, qd, qdd]: &'static [[f64; 1]; 3]| Sample { q, qd, qdd };
    let clean =
        observation_matrix(&Pendulum, &[sample(&GOOD), sample(&GOOD), sample(&GOOD)]).unwrap();
    let mut spoilt =
        observation_matrix(&Pendulum, &[sample(&GOOD), sample(&SPOILT), sample(&GOOD)]).unwrap();
    for j in 0..clean.columns {
        let (clean, spoilt) = (clean.column(j), spoilt.column(j));
        assert!(spoilt[1].is_nan(), "column {j}");
        assert_eq!(
            [clean[0].to_bits(), clean[2].to_bits()],
            [spoilt[0].to_bits(), spoilt[2].to_bits()]
        );
    }
    let _ = spoilt.scale_columns();
    assert!((0..clean.columns).all(|j| spoilt.column(j)[1].is_nan()));
}

/// A robot without loops whose motion diverges is reported as diverged, not as having open loops.
#[test]
fn the_error_of_a_diverging_open_chain_does_not_mention_loops() {
    let start = |_: f64, q: &mut [f64], _: &mut [f64], _: &mut [f64]| q[0] = 0.4;
    let settings = Settings {
        duration: 20.0,
        ..Settings::default()
    };
    let mut pushed = |now: &ControllerInput<'_>, efforts: &mut [f64]| {
        efforts[0] = 1e5 * now.measured[0];
    };
    let log = simulate_controlled(&Pendulum, &PHI, &start, &mut pushed, &settings).unwrap();
    assert_eq!(log.ended, Termination::Diverged);
}
