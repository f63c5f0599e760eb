//! Efforts that a controller holds between the rows of a log.

use std::fmt::Write as _;
use std::path::PathBuf;

use regen_identify::data::Settings;
use regen_identify::identify::{InstrumentOptions, instrumental};
use regen_identify::session::{LeastSquaresStart, Session, from_logs};
use regen_identify::signals::Method;
use regen_identify::states::MotionSeries;

use crate::models::pendulum::Pendulum;

/// The time between the rows of a log, s.
const STEP: f64 = 0.02;
const ROWS: u32 = 1500;
/// Inertia and first moment.
const PHI: [f64; 2] = [0.5, 2.0];

/// Position, velocity and acceleration of the reference.
fn reference(t: f64) -> [f64; 3] {
    let (slow, fast) = (3.0 * t, 11.0 * t);
    [
        slow.sin() + 0.1 * fast.cos(),
        3.0 * slow.cos() - 1.1 * fast.sin(),
        -9.0 * slow.sin() - 12.1 * fast.cos(),
    ]
}

fn acceleration(q: f64, tau: f64) -> f64 {
    (tau - PHI[1] * 9.81 * q.sin()) / PHI[0]
}

/// Writes the log of a pendulum that a controller moves along the reference. It gives a new effort this
/// many times in a row's time, without noise; a row has the mean of the efforts and of the accelerations
/// before and after it.
///
/// - `columns`: those of the motion.
fn written(name: &str, commands: u32, columns: &str) -> PathBuf {
    let hold = STEP / f64::from(commands);
    let [mut q, mut qd, _] = reference(0.0);
    let mut before: Option<f64> = None;
    let mut text = format!("t,{columns},tau_q1\n");
    for k in 0..ROWS * commands {
        let [target, rate, feedforward] = reference(hold * f64::from(k));
        let own = PHI[0] * feedforward + PHI[1] * 9.81 * target.sin();
        let tau = own + 20.0 * (target - q) + 4.0 * (rate - qd);
        if k % commands == 0 {
            let t = STEP * f64::from(k / commands);
            let mean = f64::midpoint(before.unwrap_or(tau), tau);
            let motion = [q, qd, acceleration(q, mean)];
            let motion = motion.iter().take(columns.split(',').count());
            write!(text, "{t:.2}").unwrap();
            for x in motion.chain([&mean]) {
                write!(text, ",{x}").unwrap();
            }
            text.push('\n');
        }
        before = Some(tau);
        // Runge and Kutta's method, ten steps while the effort is held
        let h = hold / 10.0;
        for _ in 0..10 {
            let a = [qd, acceleration(q, tau)];
            let b = [qd + 0.5 * h * a[1], acceleration(q + 0.5 * h * a[0], tau)];
            let c = [qd + 0.5 * h * b[1], acceleration(q + 0.5 * h * b[0], tau)];
            let d = [qd + h * c[1], acceleration(q + h * c[0], tau)];
            q += h / 6.0 * (a[0] + 2.0 * (b[0] + c[0]) + d[0]);
            qd += h / 6.0 * (a[1] + 2.0 * (b[1] + c[1]) + d[1]);
        }
    }
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).unwrap();
    path
}

fn filter() -> Settings {
    Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 6.0,
        },
        ..Settings::default()
    }
}

fn session(reading: Settings) -> Session<'static, Pendulum> {
    Session::new(&Pendulum, reading)
}

/// The least-squares estimate, and by how much other derivatives would change it.
fn least_squares(logs: &[PathBuf], reading: Settings) -> (LeastSquaresStart, Vec<f64>) {
    let session = session(reading);
    let mut logs = session.open(logs).unwrap();
    let found = from_logs(&session, &mut logs).unwrap();
    let weights: Vec<f64> = found.estimate.efforts.iter().map(|e| e.weight).collect();
    let logs = logs.logs();
    let derivatives = logs.discretisation(&found.estimate.values, &weights, &found.factor);
    (found, derivatives.unwrap())
}

/// What a standard deviation holds beside another one.
fn beside(sigma: f64, other: f64) -> f64 {
    (sigma * sigma - other * other).sqrt()
}

/// The error of each parameter.
fn errors(values: &[f64]) -> [f64; 2] {
    [values[0] - PHI[0], values[1] - PHI[1]]
}

/// Checks that the deviations hold the errors, beside the change by other derivatives.
#[track_caller]
fn check(logs: &[PathBuf], reading: Settings, tolerance: f64) {
    let (found, derivatives) = least_squares(logs, reading);
    let errors = errors(&found.estimate.values);
    for (k, error) in errors.iter().enumerate() {
        let own = beside(found.deviations.sigma(k), derivatives[k]);
        assert!(error.abs() > 1e-3, "{errors:?}");
        assert!(
            (error.abs() / own - 1.0).abs() < tolerance,
            "{errors:?} {own}"
        );
    }
}

#[test]
fn deviations_hold_what_held_efforts_do_to_least_squares() {
    let log = [written("held.csv", 1, "q1")];
    check(&log, filter(), 0.05);
    check(&[log[0].clone(), log[0].clone()], filter(), 0.05);
    check(&log, Settings::default(), 0.05);
}

#[test]
fn decimated_equations_have_the_second_derivative_of_all_rows() {
    let log = [written("held_decimated.csv", 1, "q1")];
    let decimated = Settings {
        decimation: 5,
        ..filter()
    };
    check(&log, decimated, 0.05);
}

#[test]
fn efforts_are_held_over_the_rows_of_a_resampled_log() {
    let log = [written("held_resampled.csv", 1, "q1")];
    let resampled = Settings {
        resample: Some(2.0 / STEP),
        ..filter()
    };
    check(&log, resampled, 0.25);
}

#[test]
fn held_efforts_do_twice_as_much_to_derivatives_of_velocities() {
    check(&[written("held_qd.csv", 1, "q1,qd_q1")], filter(), 0.1);
}

#[test]
fn measured_accelerations_are_those_of_held_efforts() {
    let log = written("held_qdd.csv", 1, "q1,qd_q1,qdd_q1");
    let (found, _) = least_squares(&[log], filter());
    for (k, error) in errors(&found.estimate.values).into_iter().enumerate() {
        assert!(
            error.abs() < 1e-6 && found.deviations.sigma(k) < 1e-6,
            "{error}"
        );
    }
}

#[test]
fn a_fast_controller_holds_nothing_and_has_the_same_deviations() {
    let (held, _) = least_squares(&[written("held_slow.csv", 1, "q1")], filter());
    let (fast, _) = least_squares(&[written("held_fast.csv", 40, "q1")], filter());
    for k in 0..2 {
        let [slow, fast_error] = [&held, &fast].map(|f| errors(&f.estimate.values)[k].abs());
        assert!(fast_error < 0.01 * slow, "{fast_error} {slow}");
        let ratio = fast.deviations.sigma(k) / held.deviations.sigma(k);
        assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    }
}

#[test]
fn deviations_hold_what_held_efforts_do_to_instrumental_variables() {
    let session = session(filter());
    let log = [written("held_instruments.csv", 1, "q1")];
    // nearly the same along the motion of the instruments
    let (_, derivatives) = least_squares(&log, filter());
    let mut logs = session.open(&log).unwrap();
    let mut motion = MotionSeries::new(1);
    for k in 0..ROWS {
        let t: f64 = format!("{:.2}", STEP * f64::from(k)).parse().unwrap();
        let [q, qd, qdd] = reference(t);
        motion.push(t, [&[q], &[qd], &[qdd]], k > 0).unwrap();
    }
    let mut motion = Some(motion);
    let found = instrumental(
        &Pendulum,
        &InstrumentOptions::default(),
        &mut logs,
        &PHI,
        &mut |_| Ok(motion.take()),
    )
    .unwrap();
    let errors = errors(&found.estimate.values);
    for (k, error) in errors.iter().enumerate() {
        let own = beside(found.deviations.sigma(k), derivatives[k]);
        assert!((error.abs() / own - 1.0).abs() < 0.2, "{errors:?} {own}");
    }
}
