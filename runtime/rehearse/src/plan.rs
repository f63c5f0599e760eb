//! Durations and rates of simulated runs, from the runs of an experiment.

use regen_identify::data::{Checks, DataError, Policy, Run, Settings, tracks};
use regen_runtime::Info;

/// The duration and the time step of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Planned {
    /// The duration, s; `None` if it is unknown.
    pub duration: Option<f64>,
    /// The time between rows, s; `None` if it is unknown.
    pub step: Option<f64>,
}

/// A measured time step is rounded to a multiple of the inverse of this, s.
const DECIMALS: f64 = 1e9;

/// The duration and time step of a run: those of its log if that exists, or else those that follow
/// from its rows, its times and the rate of the settings.
///
/// - `settings`: how the run's log is read.
///
/// # Errors
/// When the log exists and cannot be read.
///
/// ```
/// use regen_identify::data::{Run, Settings};
/// use regen_rehearse::planned;
/// use regen_runtime::Info;
///
/// // a log that does not exist yet
/// let run = Run { files: vec!["absent.csv".into()], rows: Some((101, 601)), ..Run::default() };
/// let settings = Settings { rate: Some(250.0), ..Settings::default() };
/// let planned = planned(&run, &Info::EMPTY, &settings)?;
/// assert_eq!((planned.duration, planned.step), (Some(2.0), Some(0.004)));
/// # Ok::<(), regen_identify::data::DataError>(())
/// ```
pub fn planned(run: &Run, info: &Info<'_>, settings: &Settings) -> Result<Planned, DataError> {
    if run.files.iter().all(|file| file.exists()) {
        let mut lenient = Settings {
            policy: Policy::Keep,
            checks: Checks::default(),
            ..settings.clone()
        };
        // only the times are used, so that any gain will do for currents whose gains are unknown
        for column in &mut lenient.columns {
            if column.is_current() {
                column.gain.get_or_insert(1.0);
            }
        }
        let (all, report) = tracks(run, info, &lenient, &[])?;
        let times = || all.iter().flat_map(|track| &track.times);
        let span = times().last().zip(times().next()).map(|(b, a)| b - a);
        return Ok(Planned {
            duration: span.filter(|s| *s > 0.0),
            step: Some((report.step * DECIMALS).round() / DECIMALS).filter(|s| *s > 0.0),
        });
    }
    let step = settings.rate.map(|rate| 1.0 / rate);
    let by_rows = run.rows.zip(step);
    let by_rows = by_rows.map(|((first, last), step)| last.saturating_sub(first) as f64 * step);
    let by_times = run.times.map(|(first, last)| last - first);
    Ok(Planned {
        duration: by_rows.or(by_times).filter(|d| *d > 0.0),
        step,
    })
}
