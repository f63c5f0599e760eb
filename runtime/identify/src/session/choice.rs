//! Chooses how logs are read and solved, where no one says how.
//!
//! The first choice is the cutoff of a low-pass filter, see [`cutoffs`](super::cutoffs).
//! With the filter, measured velocities and Huber's loss are compared with computed ones and squares by the same
//! errors, and delays of the efforts that are beyond chance are corrected.

use regen_runtime::BaseModel;

use super::alternatives::{
    HUBER_BOUND, Lateness, lateness, loss_choice, series_choice, velocity_choice,
};
use super::cutoffs::{MAX_ROWS, ORDER, Search, Trial, mean_square, percent_of, search};
use super::delays::{settled_common_delay, settled_delays};
use super::motion_noise::whole;
use super::{Session, SessionError};
use crate::choice::{Candidate, Choice, LossChoice, SeriesChoice};
use crate::data::{DataError, Logs, Policy, Run, Settings};
use crate::identify::{EquationKind, Options};
use crate::signals::{Method, SignalError};

/// The rate of the equations that the estimate is computed from, over the cutoff.
const EQUATION_RATE: f64 = 10.0;

/// What is chosen beside the filter and the velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OpenChoices {
    /// The delays of the efforts behind the motion.
    pub delays: bool,
    /// The loss of the residuals.
    pub loss: bool,
    /// The series of a motion that repeats itself, in place of the filter.
    pub series: bool,
}
/// Chooses how the logs are read and solved; `None` where no filter is to be chosen: where all derivatives are
/// measured, or no cutoff determines the parameters.
///
/// - `open`: what is chosen too.
///
/// # Errors
/// When a log cannot be read.
pub fn chosen<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    runs: &[Run],
    open: OpenChoices,
) -> Result<Option<Choice>, SessionError> {
    session.watch.phase("choosing a filter");
    let is_averaged = session.reading.period.is_some();
    // an energy balance is of the same motion as the forces, which tell more of it; so are single periods
    let forces = Session {
        kind: EquationKind::Forces,
        ..session.with_reading(Settings {
            period: None,
            ..session.reading.clone()
        })
    };
    let open = OpenChoices {
        loss: open.loss && session.kind == EquationKind::Forces && !is_averaged,
        ..open
    };
    let found = found(&forces, runs, open);
    session.watch.finished();
    let mut found = found?;
    if let Some(series) = found.as_mut().and_then(|own| own.series.as_mut()) {
        // a mean of periods is a series, however accurate filters of the whole log are
        series.is_used |= is_averaged;
    }
    Ok(found)
}

fn found<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    runs: &[Run],
    open: OpenChoices,
) -> Result<Option<Choice>, SessionError> {
    let reading = Settings {
        method: Method::Central,
        decimation: 1,
        ..session.reading.clone()
    };
    let Some(mut basis) = Basis::opened(session, runs, &reading)? else {
        return Ok(None);
    };
    let mut velocities = None;
    if reading.measured_rates.is_none()
        && let Some(without) = basis.logs.without_rates()
    {
        velocities = velocity_choice(session, &basis.search, &without)?;
        if velocities.is_some_and(|own| own.are_computed) {
            (basis.search, basis.logs) = (search(session, &without)?, without);
        }
    }
    let Some(mut choice) = basis.choice() else {
        return Ok(None);
    };
    choice.velocities = velocities;
    let series = |basis: &Basis<'_, M>, choice: &Choice, finds_delays| {
        if !open.series || basis.logs.has_gaps() || choice.resample.is_some() {
            return Ok((None, None));
        }
        let found = series_choice(session, runs, basis, choice, finds_delays)?;
        Ok::<_, SessionError>(found.map_or((None, None), |(own, delays)| (Some(own), delays)))
    };
    let finds_delays = open.delays && reading.delays.is_empty();
    let (found, of_series) = series(&basis, &choice, finds_delays)?;
    choice.series = found;
    let late = if finds_delays {
        lateness(session, &basis, of_series)?
    } else {
        Lateness::None
    };
    if late != Lateness::None {
        let filtered = session.with_reading(choice.applied(&session.reading));
        let read = choice.runs(runs);
        let delays = match late {
            Lateness::Common => settled_common_delay(&filtered, &read)?,
            _ => settled_delays(&filtered, &read)?,
        };
        // late efforts disturb the choice of a cutoff, which is made again without their delays
        let on_time = Settings {
            measured_rates: filtered.reading.measured_rates,
            delays: delays.clone(),
            ..reading.clone()
        };
        if delays.iter().any(|(_, seconds)| *seconds != 0.0)
            && let Some(again) = Basis::opened(session, runs, &on_time)?
            && let Some(other) = again.choice()
        {
            choice = Choice {
                velocities,
                delays,
                ..other
            };
            (choice.series, _) = series(&again, &choice, false)?;
            basis = again;
        }
    }
    if open.loss && session.options.huber.is_none() {
        let robust = Session {
            options: Options {
                huber: Some(HUBER_BOUND),
                ..session.options
            },
            ..session.with_reading(session.reading.clone())
        };
        let mut loss = loss_choice(&robust, &basis)?;
        loss = loss.filter(|own| is_better_than_series(own, choice.series.as_ref()));
        if loss.is_some_and(|own| own.huber.is_some()) {
            basis.search = search(&robust, &basis.logs)?;
            if let Some(other) = basis.choice() {
                choice = Choice {
                    velocities: choice.velocities,
                    delays: choice.delays,
                    ..other
                };
            }
        }
        choice.loss = loss;
    }
    Ok(Some(choice))
}

/// Whether no series is used that leaves less unknown than the loss behind a filter: what a filter makes of a
/// wandering clock looks like outliers, which a series does not have.
fn is_better_than_series(loss: &LossChoice, series: Option<&SeriesChoice>) -> bool {
    let used = series.filter(|own| own.is_used);
    used.is_none_or(|series| loss.bounded < series.series)
}

/// Logs in memory, and the cutoffs that were tried on them.
pub(super) struct Basis<'m, M: BaseModel<f64> + ?Sized> {
    pub(super) logs: Logs<'m, M>,
    /// See [`Choice::resample`].
    resample: Option<f64>,
    search: Search,
}

impl<'m, M: BaseModel<f64> + ?Sized> Basis<'m, M> {
    /// Reads logs and tries cutoffs on them; `None` where no derivatives are computed.
    fn opened(
        session: &Session<'m, M>,
        runs: &[Run],
        reading: &Settings,
    ) -> Result<Option<Self>, SessionError> {
        let (opened, mut resample) = opened(session.model, runs, reading)?;
        if !opened.is_differentiated() {
            return Ok(None);
        }
        let mut logs = opened.in_memory(MAX_ROWS)?;
        let mut found = search(session, &logs);
        if let (Err(error), None) = (&found, reading.resample.or(resample))
            && is_uneven(error)
        {
            // a filter needs rows at even times
            resample = Some(rate_of(&logs));
            let even = Settings {
                method: bridging(),
                resample,
                ..reading.clone()
            };
            logs = Logs::open(session.model, runs, &even)?.in_memory(MAX_ROWS)?;
            found = search(session, &logs);
        }
        Ok(Some(Self {
            logs,
            resample,
            search: found?,
        }))
    }

    /// The trial with the cutoff that is closest to the chosen one.
    pub(super) fn trial(&self) -> Option<&Trial> {
        let (_, place) = self.search.chosen?;
        self.search.trials.get(place)
    }

    /// The next cutoff above that of [`trial`](Self::trial), Hz, if one was tried.
    pub(super) fn higher_cutoff(&self) -> Option<f64> {
        let (_, place) = self.search.chosen?;
        Some(self.search.trials.get(place + 1)?.cutoff)
    }

    /// The chosen filter; `None` if no cutoff determines the parameters.
    fn choice(&self) -> Option<Choice> {
        let (cutoff, _) = self.search.chosen?;
        let efforts = mean_square(&self.trial()?.factor);
        let percent = |square: f64| percent_of(square, efforts);
        let pairs = self.search.trials.iter().zip(&self.search.errors);
        let finite = pairs.filter(|(_, own)| own.sum().is_finite());
        let candidates = finite.map(|(trial, own)| Candidate {
            cutoff: trial.cutoff,
            deviation: percent(own.variance),
            bias: percent(own.bias),
            apart: percent(own.apart),
        });
        Some(Choice {
            order: ORDER,
            cutoff,
            decimation: divisible(whole(self.rate() / (EQUATION_RATE * cutoff))),
            resample: self.resample,
            velocities: None,
            series: None,
            delays: Vec::new(),
            loss: None,
            candidates: candidates.collect(),
        })
    }

    /// The lowest rate of the rows of the logs, Hz.
    pub(super) fn rate(&self) -> f64 {
        let steps = self.logs.durations();
        (steps.iter().map(|(step, _)| 1.0 / step)).fold(f64::INFINITY, f64::min)
    }
}

/// The next smaller number with many divisors, so that a state can stand for several rows.
fn divisible(decimation: usize) -> usize {
    let part = match decimation {
        16.. => 8,
        8.. => 4,
        4.. => 2,
        _ => 1,
    };
    decimation - decimation % part
}

/// Opens logs as they are or, where gaps divide them or prevent that or efforts have spikes, as a filter would bridge them, on an
/// even grid if need be; returns them with the rate of the grid, Hz.
fn opened<'m, M: BaseModel<f64> + ?Sized>(
    model: &'m M,
    runs: &[Run],
    reading: &Settings,
) -> Result<(Logs<'m, M>, Option<f64>), DataError> {
    let plain = Logs::open(model, runs, reading);
    let has_gaps = match &plain {
        Ok(logs) => logs.has_gaps(),
        Err(error) => matches!(error, DataError::Problems { .. }),
    };
    if !has_gaps {
        return Ok((plain?, None));
    }
    let bridged = Settings {
        method: bridging(),
        ..reading.clone()
    };
    let found = Logs::open(model, runs, &bridged);
    if found.is_ok() || reading.resample.is_some() {
        return Ok((found?, None));
    }
    // the first error is that of the logs as they are
    let lenient = Settings {
        policy: Policy::Drop,
        ..reading.clone()
    };
    let resample = Some(rate_of(&Logs::open(model, runs, &lenient)?.in_memory(0)?));
    let even = Settings {
        resample,
        ..bridged
    };
    match Logs::open(model, runs, &even) {
        Ok(logs) => Ok((logs, resample)),
        Err(_) => Ok((plain?, None)),
    }
}

/// A filter whose memory bridges gaps of a quarter of a second, with which logs are read until one is chosen.
fn bridging() -> Method {
    Method::Butterworth {
        order: ORDER,
        cutoff: 4.0,
    }
}

pub(super) fn is_uneven(error: &DataError) -> bool {
    matches!(
        error,
        DataError::Signal {
            why: SignalError::NotUniform { .. },
            ..
        }
    )
}

/// The lowest rate of the rows of logs, Hz, with three digits.
pub(super) fn rate_of<M: BaseModel<f64> + ?Sized>(logs: &Logs<'_, M>) -> f64 {
    let steps = logs.durations();
    let rate = (steps.iter().map(|(step, _)| 1.0 / step)).fold(f64::INFINITY, f64::min);
    format!("{rate:.2e}").parse().unwrap_or(rate)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::suspect::swings_for_tests::{swings, written};

    #[test]
    fn a_loss_is_weighed_against_a_series_that_is_used() {
        let loss = LossChoice {
            huber: Some(HUBER_BOUND),
            squares: 3.0,
            bounded: 2.0,
        };
        let series = |is_used: bool, series: f64| SeriesChoice {
            frequency: 1.0,
            harmonics: 3,
            parts: Vec::new(),
            is_used,
            filtered: None,
            series,
        };
        assert!(is_better_than_series(&loss, None));
        assert!(is_better_than_series(&loss, Some(&series(true, 2.5))));
        assert!(!is_better_than_series(&loss, Some(&series(true, 1.5))));
        assert!(is_better_than_series(&loss, Some(&series(false, 1.5))));
    }

    #[test]
    fn logs_are_read_as_they_are_unless_gaps_divide_them() {
        let model = swings(false);
        let whole = written("whole", 2000, 0.0, |_| true);
        let reading = Settings {
            method: Method::Central,
            ..Settings::default()
        };
        let method = |runs: &[Run]| {
            let (logs, rate) = opened(&model, runs, &reading).unwrap();
            assert_eq!(rate, None);
            logs.settings().method
        };
        assert_eq!(method(&[whole.0.clone().into()]), Method::Central);
        let divided = written("divided", 2000, 0.0, |k| !(900..910).contains(&k));
        assert_eq!(method(&[divided.0.clone().into()]), bridging());
    }

    #[test]
    fn the_next_cutoff_is_that_of_the_trial_above_the_chosen_one() {
        let model = swings(false);
        let run = written("cutoffs", 500, 0.0, |_| true);
        let logs = Logs::open(&model, std::slice::from_ref(&run.0), &Settings::default()).unwrap();
        let of = |place: usize| {
            let basis = Basis {
                logs: logs.in_memory(500).unwrap(),
                resample: None,
                search: Search::of_cutoffs([1.0, 3.2, 10.0], place),
            };
            (basis.trial().map(|own| own.cutoff), basis.higher_cutoff())
        };
        assert_eq!(of(1), (Some(3.2), Some(10.0)));
        assert_eq!(of(2), (Some(10.0), None));
    }
}
