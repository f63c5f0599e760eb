//! The delays of efforts behind their motion, by the robot's own equations of motion.

use regen_identify::data::{Run, Settings};
use regen_identify::session::{Session, identified, settled_delays_within};
use regen_identify::signals::Method;
use regen_runtime::BaseModel;

use crate::follow::precedes;
use crate::log::LogFacts;
use crate::words::late_sentence;

/// The part of the cutoff of the logs' filter with which delays are found a second time: noise of
/// positions that a controller answers seems to be a delay, which falls with a high power of the cutoff.
const CUTOFF_PART: f64 = 0.5;

/// The largest number of rows of all logs together that are used, in equal parts: all are read again
/// for every correction.
const MAX_ROWS: usize = 30_000;
/// The least number of rows of each log that are used, if it has as many.
const MIN_ROWS: usize = 4_000;
/// The largest number of corrections. Usually three suffice; what is left is estimated at the end.
const ROUNDS: usize = 4;
/// The same with half of the cutoff, which begin with the delays that are corrected already.
const SLOW_ROUNDS: usize = 2;

/// Finds the delays of efforts by least squares of the robot's equations of motion, which have all
/// couplings of its joints (see [`settled_delays_within`]), in place of those that
/// [`inspect`](crate::inspect) stated without a model, and of the sentence that tells them. Where
/// least squares has no solution, those are left as they are.
///
/// They are found twice, with a low-pass filter of half the cutoff too, at which noise that a
/// controller answers hardly seems to be a delay; the difference of both is in the standard
/// deviation. Of all logs together thirty thousand rows are used, the first ones of each. Of efforts
/// that follow another joint than their own, no delay is stated, and of none if an effort seems to
/// precede its motion.
///
/// - `session`: the model, with the settings by which the logs are read;
/// - `runs`: all logs;
/// - `logs`: what was found in them.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// use regen_identify::data::{Run, Settings};
/// use regen_identify::session::Session;
/// use regen_inspect::{delays_by_model, inspect};
///
/// // the torque of a pendulum, 20 ms late, in a log
/// let swing = |t: f64| (3.0 * t).sin() + 0.4 * (7.0 * t).cos();
/// let rate = |t: f64| -9.0 * (3.0 * t).sin() - 19.6 * (7.0 * t).cos();
/// let mut text = "t,q1,tau_q1\n".to_owned();
/// for k in 0..2000 {
///     let t = 0.01 * f64::from(k);
///     let before = t - 0.02;
///     let tau = 0.5 * rate(before) + 2.0 * 9.81 * swing(before).sin();
///     text += &format!("{t},{},{tau}\n", swing(t));
/// }
/// let path = std::env::temp_dir().join(format!("late-{}.csv", std::process::id()));
/// std::fs::write(&path, text)?;
///
/// let runs = [Run::from(path.clone())];
/// let session = Session::new(&models::Pendulum, Settings::default());
/// let mut logs = [inspect(&runs[0], &session.reading, None)?];
/// delays_by_model(&session, &runs, &mut logs);
/// let [seconds, sigma] = logs[0].efforts[0].delay.unwrap_or_default();
/// assert!((seconds - 0.02).abs() < 3.0 * sigma && sigma < 1e-3, "{seconds} {sigma}");
/// std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn delays_by_model<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    runs: &[Run],
    logs: &mut [LogFacts],
) {
    let rows = (MAX_ROWS / logs.len().max(1)).max(MIN_ROWS);
    let runs: Vec<Run> = runs
        .iter()
        .zip(&*logs)
        .map(|(run, log)| beginning(run, log, rows))
        .collect();
    let given = session.reading.delays.clone();
    let Some((fast, settled)) = delays_at_cutoff(session, &runs, 1.0, given, ROUNDS) else {
        return;
    };
    let Some((slow, _)) = delays_at_cutoff(session, &runs, CUTOFF_PART, settled, SLOW_ROUNDS)
    else {
        return;
    };
    let together: Vec<Found> = slow
        .into_iter()
        .filter_map(|(name, [seconds, sigma])| {
            let first = fast.iter().find(|own| own.0 == name)?.1[0];
            Some((name, [seconds, sigma.hypot(seconds - first)]))
        })
        .collect();
    if together.is_empty() {
        return;
    }
    for log in logs {
        let before = late_sentence(log);
        log.notes.retain(|note| Some(note) != before.as_ref());
        let step = 1.0 / log.clock.rate;
        let none = together.iter().any(|(_, delay)| precedes(*delay, step));
        for effort in &mut log.efforts {
            let joint = &effort.joint;
            let is_own = effort
                .follows
                .as_ref()
                .is_none_or(|follows| follows == joint);
            let own = together.iter().find(|own| own.0 == *joint);
            effort.delay = own.filter(|_| is_own && !none).map(|own| own.1);
        }
        log.notes.extend(late_sentence(log));
    }
}

/// The first rows of a run.
fn beginning(run: &Run, log: &LogFacts, most: usize) -> Run {
    let mut run = run.clone();
    // of times that are asked for, the first rows of the file may have none
    if log.rows > most && run.times.is_none() {
        let (first, last) = run.rows.unwrap_or((1, u64::MAX));
        run.rows = Some((first, last.min(first + most as u64 - 1)));
    }
    run
}

/// The name of an effort, and its delay with the standard deviation, s.
type Found = (String, [f64; 2]);

/// The efforts that were corrected by a delay, each with that delay, s.
type Corrected = Vec<(String, f64)>;

/// The delays of the efforts, with a part of the cutoff of the session's low-pass filter, and those
/// that were corrected.
///
/// - `given`: the delays to begin with; `rounds`: the largest number of corrections.
fn delays_at_cutoff<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    runs: &[Run],
    part: f64,
    given: Corrected,
    rounds: usize,
) -> Option<(Vec<Found>, Corrected)> {
    let with = |delays: Corrected| Session {
        reading: Settings {
            method: match session.reading.method {
                Method::Butterworth { order, cutoff } => Method::Butterworth {
                    order,
                    cutoff: part * cutoff,
                },
                other => other,
            },
            delays,
            ..session.reading.clone()
        },
        ..*session
    };
    let settled = settled_delays_within(&with(given), runs, rounds).ok()?;
    // with these corrected, what is left is small, so that its standard deviation holds
    let corrected = with(settled);
    let mut opened = corrected.open(runs).ok()?;
    let left = identified(&corrected, &session.options, &mut opened).ok()?;
    let of_effort = left.delays.efforts.into_iter().map(|own| {
        let settled = corrected.reading.delays.iter();
        let settled = settled.filter(|(name, _)| *name == own.effort);
        let seconds = own.seconds + settled.map(|(_, seconds)| seconds).sum::<f64>();
        (own.effort, [seconds, own.sigma])
    });
    Some((of_effort.collect(), corrected.reading.delays.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effort_precedes_its_motion_by_two_deviations_that_are_no_rounding() {
        // 3.7 ms early, as precise as 1.7 ms, at steps of 4 ms
        assert!(precedes([-3.7e-3, 1.7e-3], 4e-3));
        assert!(!precedes([-3.0e-3, 1.7e-3], 4e-3));
        // a twentieth of a step, however precise
        assert!(!precedes([-2e-4, 1e-5], 4e-3));
        assert!(!precedes([8e-3, 1e-3], 4e-3));
    }

    #[test]
    fn of_each_log_only_the_first_rows_are_read_again() {
        let mut log = LogFacts {
            rows: 50_000,
            ..LogFacts::default()
        };
        let run = Run::from(std::path::PathBuf::from("a.csv"));
        assert_eq!(beginning(&run, &log, 4000).rows, Some((1, 4000)));
        let part = Run {
            rows: Some((10, 60_000)),
            ..run.clone()
        };
        assert_eq!(beginning(&part, &log, 4000).rows, Some((10, 4009)));
        log.rows = 4000;
        assert_eq!(beginning(&run, &log, 4000).rows, None);
    }
}
