//! Delays of efforts: those that are there, and those that only seem so.

use regen_identify::identify::{Delays, EquationKind, Options, identify};
use regen_identify::signals::{Method, Smoothing};
use regen_identify::states::{Filtering, Recorded, Standstill};

use crate::models::pendulum::Pendulum;

/// Time between samples, s.
const STEP: f64 = 0.005;

/// The position of the swinging pendulum, rad.
fn swing(t: f64) -> f64 {
    (2.0 * t).sin() + 0.4 * (5.0 * t).cos()
}

/// Its effort: 0.5 kg m^2 and 2 kg m.
fn effort(t: f64) -> f64 {
    let qdd = -4.0 * (2.0 * t).sin() - 10.0 * (5.0 * t).cos();
    0.5 * qdd + 2.0 * 9.81 * swing(t).sin()
}

/// The delays found in a log of the swinging pendulum.
///
/// - `late`: by how many s the effort is logged late;
/// - `noise`: of the positions, rad, which the controller answers with 400 N m/rad and 20 N m s/rad;
/// - `smoothing`: the filter of the equations.
fn delays(late: f64, noise: f64, smoothing: Smoothing) -> Delays {
    let mut random = 7_u64;
    let mut uniform = move || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let count = 6000;
    let errors: Vec<f64> = (0..count).map(|_| noise * uniform()).collect();
    let times: Vec<f64> = (0..count).map(|k| STEP * f64::from(k)).collect();
    let found: Vec<f64> = times
        .iter()
        .zip(&errors)
        .map(|(t, e)| swing(*t) + e)
        .collect();
    let states = match smoothing {
        Smoothing::Butterworth { order, cutoff } => {
            Method::Butterworth { order, cutoff }.of_states(STEP)
        }
        _ => Method::Central,
    };
    let motion = states.differentiate(&times, &found).unwrap();
    let mut log = Recorded::new().filtered(Filtering {
        smoothing,
        decimation: 1,
        standstill: Standstill::Keep,
    });
    for k in motion.valid.clone() {
        let answer = 400.0 * errors[k] + 20.0 * (errors[k] - errors[k - 1]) / STEP;
        let tau = effort(times[k] - late) - answer + 0.05 * uniform();
        let state = [motion.value[k], motion.rate[k], motion.acceleration[k]].map(|x| [x]);
        log.push(times[k], &state[0], &state[1], &state[2], &[tau]);
    }
    identify(
        &Pendulum,
        EquationKind::Forces,
        &Options::default(),
        &mut log,
    )
    .unwrap()
    .delays
}

#[test]
fn a_controller_that_answers_noise_of_positions_gives_no_delay_and_late_efforts_give_one() {
    let filter = Smoothing::Butterworth {
        order: 4,
        cutoff: 20.0,
    };
    for smoothing in [Smoothing::None, filter] {
        let seeming = delays(0.0, 2e-4, smoothing);
        for own in seeming.efforts.iter().chain(&seeming.common) {
            // no standard deviation accounts for it, but half the cutoff does not confirm it
            assert!(own.is_beyond_error() && own.seconds < 0.0, "{own:?}");
            assert!(!own.is_significant(), "{own:?}");
        }
        let real = delays(0.004, 2e-5, smoothing);
        for own in real.efforts.iter().chain(&real.common) {
            assert!(own.is_significant() && own.seconds > 0.0, "{own:?}");
        }
    }
    let late = delays(0.004, 2e-5, filter).efforts[0].seconds;
    assert!((late - 0.004).abs() < 1e-4, "{late}");
}
