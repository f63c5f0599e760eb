//! The delays of efforts behind their motion, by the robot's own equations of motion.

use regen_identify::data::{Run, Settings};
use regen_identify::identify::identify;
use regen_identify::session::{Session, settled_delays};
use regen_identify::signals::Method;
use regen_runtime::BaseModel;

use crate::log::LogFacts;
use crate::words::late_sentence;

/// The part of the cutoff of the logs' filter with which delays are found a second time: noise of
/// positions that a controller answers seems to be a delay, which falls with a high power of the cutoff.
const CUTOFF_PART: f64 = 0.5;

/// The largest number of rows of each log that are used: all are read again for every correction.
const MAX_ROWS: usize = 100_000;

/// Finds the delays of efforts by least squares of the robot's equations of motion, which have all
/// couplings of its joints (see [`settled_delays`]), where [`inspect`](crate::inspect) stated none
/// without a model, and adds the sentence that tells them.
///
/// They are found twice, with a low-pass filter of half the cutoff too, at which noise that a
/// controller answers hardly seems to be a delay; the difference of both is in the standard
/// deviation. Of each log the first hundred thousand rows are used. Where least squares has no
/// solution, and of efforts that follow another joint than their own, no delay is stated.
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
/// use regen_identify::identify::{EquationKind, Options};
/// use regen_identify::session::{Session, Silent};
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
/// let session = Session {
///     model: &models::Pendulum,
///     reading: Settings::default(),
///     kind: EquationKind::Forces,
///     options: Options::default(),
///     confidence: 0.95,
///     watch: &Silent,
/// };
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
    let mut all = logs.iter().flat_map(|log| &log.efforts);
    if all.any(|effort| effort.delay.is_some()) {
        return;
    }
    let runs: Vec<Run> = runs.iter().zip(&*logs).map(beginning).collect();
    let [Some(fast), Some(slow)] = [1.0, CUTOFF_PART].map(|part| found(session, &runs, part))
    else {
        return;
    };
    for log in logs {
        for effort in &mut log.efforts {
            let joint = &effort.joint;
            let is_own = effort
                .follows
                .as_ref()
                .is_none_or(|follows| follows == joint);
            let of = |all: &[Found]| all.iter().find(|own| own.0 == *joint).map(|own| own.1);
            if let (true, Some([first, _]), Some([seconds, sigma])) = (is_own, of(&fast), of(&slow))
            {
                effort.delay = Some([seconds, sigma.hypot(seconds - first)]);
            }
        }
        log.notes.extend(late_sentence(log));
    }
}

/// The first rows of a run.
fn beginning((run, log): (&Run, &LogFacts)) -> Run {
    let mut run = run.clone();
    if log.rows > MAX_ROWS {
        let (first, last) = run.rows.unwrap_or((1, u64::MAX));
        run.rows = Some((first, last.min(first + MAX_ROWS as u64 - 1)));
    }
    run
}

/// The name of an effort, and its delay with the standard deviation, s.
type Found = (String, [f64; 2]);

/// The delays of the efforts, with a part of the cutoff of the session's low-pass filter.
fn found<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    runs: &[Run],
    part: f64,
) -> Option<Vec<Found>> {
    let with = |delays: Vec<(String, f64)>| Session {
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
    let settled = settled_delays(&with(session.reading.delays.clone()), runs).ok()?;
    // with these corrected, what is left is small, so that its standard deviation holds
    let corrected = with(settled);
    let mut opened = corrected.open(runs).ok()?;
    let left = identify(session.model, session.kind, &session.options, &mut opened).ok()?;
    let of_effort = left.delays.efforts.into_iter().map(|own| {
        let settled = corrected.reading.delays.iter();
        let settled = settled.filter(|(name, _)| *name == own.effort);
        let seconds = own.seconds + settled.map(|(_, seconds)| seconds).sum::<f64>();
        (own.effort, [seconds, own.sigma])
    });
    Some(of_effort.collect())
}
