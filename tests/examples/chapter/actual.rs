//! A simulated stand-in for the actual robot: under control, with friction at its joints, encoders
//! and noise. Its measurements are averaged, filtered and decimated as in section 6.1.

use regen_experiment::simulate::{
    Pid, Sensors, Settings, Termination, perturb_parameters, simulate,
};
use regen_generated::rps3_friction::Rps3Friction;
use regen_identify::signals::{Butterworth, Fourier, FourierFit};
use regen_runtime::{Model, State};

use super::friction::stribeck;
use super::robot::{HARMONICS, POINTS, places, states};

/// The number of runs that are averaged; one more precedes them, in which the start-up decays.
const RUNS: usize = 4;

/// The measurements of one trajectory that identification uses.
pub(crate) struct Measured {
    /// The states at the sample points, from the refitted series.
    pub(crate) states: Vec<State>,
    /// The forces of the legs at these points, N, three for each.
    pub(crate) forces: Vec<f64>,
    /// The largest distance of a leg from its reference, m.
    pub(crate) tracking: f64,
}

/// Simulates a trajectory and processes the measurements.
///
/// - `seed`: seed of the sensors' noise; the parameters of each body differ from CAD by up to 5 %.
pub(crate) fn measure(reference: &Fourier, seed: u64) -> Measured {
    let info = Model::<f64>::info(&Rps3Friction);
    let nominal = info.nominal_parameters().expect("nominal values");
    let mut draws = regen_experiment::simulate::Noise::new(5);
    let mut phi = perturb_parameters(&info, &nominal, 0.05, &mut draws);
    for (parameter, (value, nominal)) in info.parameters.iter().zip(phi.iter_mut().zip(&nominal)) {
        if parameter.is_rotor() {
            *value = *nominal;
        }
    }
    let mut friction = vec![regen_runtime::JointFriction::NONE; info.coordinates.len()];
    for (place, law) in places().iter().zip(stribeck()) {
        friction[*place] = law;
    }
    let period = 1.0 / reference.frequency();
    let settings = Settings {
        duration: period * (RUNS + 1) as f64,
        period: 0.01,
        pid: vec![
            Pid {
                kp: 4e5,
                ki: 8e5,
                kd: 8e3,
                ..Pid::default()
            };
            3
        ],
        friction,
        friction_width: 2e-3,
        sensors: Sensors {
            position_step: 1e-5,
            position_noise: 0.0,
            effort_step: 1.0,
            effort_noise: 40.0,
        },
        seed,
        tolerance: 1e-6,
        ..Settings::default()
    };
    let follow = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
        for leg in 0..3 {
            [q[leg], qd[leg], qdd[leg]] = reference.at(leg, t);
        }
    };
    let log = simulate(&Rps3Friction, &phi, &follow, &settings).expect("settings that fit");
    assert_eq!(log.ended, Termination::Complete);
    #[allow(clippy::cast_sign_loss, reason = "both are positive")]
    let rows = (period / settings.period).round() as usize;
    let mean = |values: &[f64], k: usize, i: usize| {
        let runs = (1..=RUNS).map(|run| values[3 * (run * rows + k) + i]);
        runs.sum::<f64>() / RUNS as f64
    };
    let mut fit = FourierFit::new(reference.frequency(), HARMONICS, 3).expect("settings");
    let mut tracking = 0.0_f64;
    for k in 0..rows {
        let t = k as f64 * settings.period;
        let legs = [0, 1, 2].map(|i| mean(&log.measured_position, k, i));
        for (i, leg) in legs.iter().enumerate() {
            tracking = tracking.max((leg - reference.at(i, t)[0]).abs());
        }
        fit.push(t, &legs).expect("finite");
    }
    let series = fit.finish().expect("a whole period");
    // of second order, with a cutoff far above the eleventh harmonic; the period is repeated before
    // and after itself, so that the filter settles
    let filter = Butterworth::new(2, 8.0, settings.period).expect("a filter");
    let smooth = [0, 1, 2].map(|i| {
        let once: Vec<f64> = (0..rows)
            .map(|k| mean(&log.measured_effort, k, i))
            .collect();
        let thrice = [once.as_slice(), &once, &once].concat();
        filter.zero_phase(&thrice).expect("enough")[rows..2 * rows].to_vec()
    });
    let points = if rows.is_multiple_of(POINTS) {
        POINTS
    } else {
        rows
    };
    let forces = (0..points).flat_map(|p| [0, 1, 2].map(|i: usize| smooth[i][p * rows / points]));
    Measured {
        forces: forces.collect(),
        states: states(&series, points),
        tracking,
    }
}

/// The same trajectory at a quarter of its speed.
pub(crate) fn slow(reference: &Fourier) -> Fourier {
    let parts: Vec<_> = (0..3).map(|leg| reference.coefficients(leg)).collect();
    Fourier::of_positions(0.25 * reference.frequency(), &parts).expect("a frequency")
}
