//! Chooses how the positions of logs are differentiated, where no one says how.
//!
//! The choice is the cutoff of a low-pass filter. Below it least squares loses what the efforts tell,
//! above it noise of the positions biases the parameters and disturbs the equations. Each cutoff of a
//! geometric grid is tried on the log itself, at a rate that suits it: the covariance of its estimate
//! is what noise leaves unknown, and simulation and extrapolation give the bias (errors in variables).
//! Noise that neither knows of, such as that of a wandering clock, shows where an estimate differs from
//! those of lower cutoffs by more than the deviations of both (Lepskii, 1991). All three are errors of
//! efforts. Of the cutoffs whose mean square is nearly the smallest, the highest within two octaves is
//! chosen.

use regen_runtime::BaseModel;
use serde::{Deserialize, Serialize};

use super::motion_noise::{NoisyLogs, is_undetermined, rates, values, whole};
use super::{Session, SessionError};
use crate::data::{DataError, Logs, NoiseLevels, Policy, Run, Settings};
use crate::estimate::QrFactor;
use crate::friction::{nonlinear_joints, with_linear_friction};
use crate::identify::{self, EquationKind, Options};
use crate::signals::{Method, SignalError};

/// The order of the filters that are tried.
const ORDER: usize = 4;
/// Cutoffs of the grid between 1 and 10 Hz; the others are these times powers of ten.
const DECADE: [f64; 8] = [1.0, 1.3, 1.8, 2.4, 3.2, 4.2, 5.6, 7.5];
/// The lowest cutoff has so many periods in the logs.
const MIN_PERIODS: f64 = 10.0;
/// The highest cutoff over the rate of the rows.
const MAX_CUTOFF_RATIO: f64 = 0.3;
/// An effort with fewer equations than so many times the parameters is fitted with its noise, which then
/// seems smaller than it is.
const EQUATIONS_PER_PARAMETER: usize = 3;
/// From one cutoff to the next, the bias by noise of the motion grows by about this factor: noise of
/// accelerations has a power with the fifth power of the cutoff.
const GROWTH: f64 = 5.0;
/// A bias below this part of the deviation is not computed, but taken as grown.
const NEGLIGIBLE: f64 = 0.02;
/// The rate of the equations that the estimate is computed from, over the cutoff.
const EQUATION_RATE: f64 = 10.0;
/// The largest number of rows of each log on which cutoffs are tried.
const MAX_ROWS: usize = 1 << 17;
/// A bias counts as much as a variance if it is half as large as the deviation: an interval that is
/// moved by more does not hold the truth as often as it says.
const BIAS_WEIGHT: f64 = 4.0;
/// The square of a difference of two estimates is by chance at most this many times the sum of their
/// variances.
const CHANCE: f64 = 4.0;
/// A cutoff is better than a lower one if its mean square error is smaller by this part.
const BETTER: f64 = 0.03;
/// Cutoffs with at most this many times the smallest mean square error are as good: it is estimated
/// from few independent samples. The highest of them is chosen, with which fewer rows are lost at the
/// ends of the log and more independent samples remain.
const AS_GOOD: f64 = 1.7;
/// It is at most so many times the lowest of them: far above the motion a log has nothing more to tell.
const MOST_ABOVE: f64 = 4.0;
/// So many cutoffs in a row that are not better than the best one end the search.
const PATIENCE: usize = 8;

/// A cutoff that was tried.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Candidate {
    /// The cutoff, Hz.
    pub cutoff: f64,
    /// What noise leaves unknown of the predicted efforts, rms, percent of the efforts.
    pub deviation: f64,
    /// What the noise of the motion biases of them, rms, percent of the efforts.
    pub bias: f64,
    /// By how much they differ from those of a lower cutoff beyond what the deviations of both explain,
    /// rms, percent of the efforts.
    pub apart: f64,
}

/// How the positions of logs are differentiated: a zero-phase Butterworth filter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Choice {
    /// The filter's order.
    pub order: usize,
    /// The cutoff of the filter of the equations, Hz.
    pub cutoff: f64,
    /// One of so many filtered equations is used.
    pub decimation: usize,
    /// The rate of the even grid that rows with an uneven clock are interpolated onto, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resample: Option<f64>,
    /// All cutoffs that were tried, in rising order.
    #[serde(default)]
    pub candidates: Vec<Candidate>,
}

impl Choice {
    /// The settings with this choice; a decimation or an even grid that is given stays.
    #[must_use]
    pub fn applied(&self, settings: &Settings) -> Settings {
        Settings {
            method: self.method(),
            decimation: match settings.decimation {
                1 => self.decimation,
                given => given,
            },
            resample: settings.resample.or(self.resample),
            ..settings.clone()
        }
    }

    /// The filter of the equations.
    pub fn method(&self) -> Method {
        Method::Butterworth {
            order: self.order,
            cutoff: self.cutoff,
        }
    }
}

/// The estimate with one cutoff.
struct Trial {
    cutoff: f64,
    values: Vec<f64>,
    covariance: Vec<f64>,
    bias: Vec<f64>,
    factor: QrFactor,
    /// How far the covariance can be trusted: 0 where an effort has too few equations, 1 where the log is
    /// too short for the memory of the residuals, else 2.
    trust: u8,
}

/// The mean squares of the errors of the predicted efforts with one cutoff, in weighted units.
#[derive(Clone, Copy, Default)]
struct Errors {
    variance: f64,
    bias: f64,
    apart: f64,
}

impl Errors {
    fn sum(self) -> f64 {
        self.variance + BIAS_WEIGHT * self.bias + self.apart
    }
}

/// Chooses how the positions of the logs are differentiated; `None` where there is nothing to choose: where
/// all derivatives are measured, repetitions are averaged, or no cutoff determines the parameters.
///
/// # Errors
/// When a log cannot be read.
pub fn chosen<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    runs: &[Run],
) -> Result<Option<Choice>, SessionError> {
    if session.reading.period.is_some() || session.kind != EquationKind::Forces {
        return Ok(None);
    }
    let reading = Settings {
        method: Method::Central,
        decimation: 1,
        ..session.reading.clone()
    };
    session.watch.phase("choosing a filter");
    let found = opened(session.model, runs, &reading).and_then(|(opened, mut resample)| {
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
        Ok(Some((found?, logs, resample)))
    });
    session.watch.finished();
    let Some(((trials, errors, best), logs, resample)) = found? else {
        return Ok(None);
    };
    let Some(trial) = trials.get(best) else {
        return Ok(None);
    };
    let efforts = mean_square(&trial.factor);
    let percent = |square: f64| 100.0 * (square / efforts).sqrt();
    let finite = trials
        .iter()
        .zip(&errors)
        .filter(|(_, own)| own.sum().is_finite());
    let candidates = finite.map(|(trial, own)| Candidate {
        cutoff: trial.cutoff,
        deviation: percent(own.variance),
        bias: percent(own.bias),
        apart: percent(own.apart),
    });
    let steps = logs.durations();
    let rate = (steps.iter().map(|(step, _)| 1.0 / step)).fold(f64::INFINITY, f64::min);
    Ok(Some(Choice {
        order: ORDER,
        cutoff: trial.cutoff,
        decimation: whole(rate / (EQUATION_RATE * trial.cutoff)),
        resample,
        candidates: candidates.collect(),
    }))
}

/// Opens logs as they are or, where gaps divide them or prevent that, as a filter would bridge them, on an
/// even grid if need be; returns them with the rate of the grid, Hz.
fn opened<'m, M: BaseModel<f64> + ?Sized>(
    model: &'m M,
    runs: &[Run],
    reading: &Settings,
) -> Result<(Logs<'m, M>, Option<f64>), DataError> {
    let plain = Logs::open(model, runs, reading);
    let is_divided = match &plain {
        Ok(logs) => logs.is_divided(),
        Err(error) => matches!(error, DataError::Problems { .. }),
    };
    if !is_divided {
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

fn is_uneven(error: &DataError) -> bool {
    matches!(
        error,
        DataError::Signal {
            why: SignalError::NotUniform { .. },
            ..
        }
    )
}

/// The lowest rate of the rows of logs, Hz, with three digits.
fn rate_of<M: BaseModel<f64> + ?Sized>(logs: &Logs<'_, M>) -> f64 {
    let steps = logs.durations();
    let rate = (steps.iter().map(|(step, _)| 1.0 / step)).fold(f64::INFINITY, f64::min);
    format!("{rate:.2e}").parse().unwrap_or(rate)
}

/// Tries cutoffs in rising order, until more of them are not better; returns all, their errors, and the
/// index of the best.
fn search<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &Logs<'_, M>,
) -> Result<(Vec<Trial>, Vec<Errors>, usize), DataError> {
    let levels = logs.noise_levels();
    let durations = logs.durations();
    let rate = durations
        .iter()
        .map(|(step, _)| 1.0 / step)
        .fold(f64::INFINITY, f64::min);
    let length: f64 = durations.iter().map(|(_, length)| length).sum();
    let mut trials: Vec<Trial> = Vec::new();
    let mut errors = Vec::new();
    let mut best = 0;
    for cutoff in cutoffs(MIN_PERIODS / length, MAX_CUTOFF_RATIO * rate) {
        match trial(session, logs, &levels, (cutoff, rate), trials.last()) {
            Ok(found) => trials.push(found),
            Err(error) if is_uneven(&error) => return Err(error),
            Err(error) if is_undetermined(&error) => continue,
            Err(error) => return Err(error),
        }
        // the errors of efforts are those in the data of the best cutoff
        for _ in 0..2 {
            errors = all_errors(&trials, best);
            best = lowest(&trials, &errors);
        }
        if trials.len() > best + PATIENCE {
            break;
        }
    }
    let best = highest(&trials, &errors);
    Ok((trials, errors, best))
}

/// The cutoffs of the grid within these bounds, Hz.
fn cutoffs(least: f64, most: f64) -> Vec<f64> {
    let decades = (-3..=5).flat_map(|power| {
        let unit = 10_f64.powi(power);
        DECADE.iter().map(move |x| x * unit)
    });
    let all = decades.filter(|c| (least..=most).contains(c));
    // decimals, as they are printed
    all.map(|c| format!("{c:.6}").parse().unwrap_or(c))
        .collect()
}

/// The estimate with a filter.
///
/// - `lower`: that of the next lower cutoff, whose bias is taken where noise of the motion is far too small
///   to matter with this one.
fn trial<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &Logs<'_, M>,
    levels: &[Vec<NoiseLevels>],
    (cutoff, rate): (f64, f64),
    lower: Option<&Trial>,
) -> Result<Trial, DataError> {
    let method = Method::Butterworth {
        order: ORDER,
        cutoff,
    };
    let [every, decimation] = rates(rate, cutoff);
    let thinned = logs.thinned(method, every, decimation)?;
    let mut noisy = NoisyLogs::new(&thinned);
    let options = Options {
        lags: 1,
        ..session.options
    };
    // friction that is not among the base parameters is linear here
    let is_linear = nonlinear_joints(session.model).is_empty();
    let found = if is_linear {
        identify::identify(session.model, session.kind, &options, &mut noisy)?
    } else {
        with_linear_friction(session.model, &options, &mut noisy)?
    };
    let weights: Vec<f64> = found.estimate.efforts.iter().map(|e| e.weight).collect();
    let least = EQUATIONS_PER_PARAMETER * found.estimate.values.len();
    let few = found
        .estimate
        .efforts
        .iter()
        .any(|effort| effort.rows < least);
    let negligible = lower.filter(|lower| {
        let mut pairs = lower.bias.iter().enumerate();
        pairs.all(|(k, bias)| GROWTH * bias.abs() < NEGLIGIBLE * found.deviations.sigma(k))
    });
    let bias = match negligible {
        Some(lower) => lower.bias.iter().map(|bias| GROWTH * bias).collect(),
        None => noisy.bias(&thinned, levels, cutoff, |logs| {
            if is_linear {
                values(session, &weights, logs)
            } else {
                let found = with_linear_friction(session.model, &options, logs)?;
                Ok(found.estimate.values)
            }
        })?,
    };
    let pairs = found.estimate.values.iter().zip(&bias);
    Ok(Trial {
        cutoff,
        values: pairs.map(|(x, bias)| x - bias).collect(),
        bias,
        trust: match (few, found.deviations.short()) {
            (true, _) => 0,
            (_, true) => 1,
            _ => 2,
        },
        covariance: found.deviations.covariance,
        factor: found.factor,
    })
}

/// The errors of all trials in the data of the best one.
fn all_errors(trials: &[Trial], best: usize) -> Vec<Errors> {
    let Some(factor) = trials.get(best).map(|own| &own.factor) else {
        return Vec::new();
    };
    let rows = factor.rows().max(1) as f64;
    let square = |x: &[f64]| factor.times_r(x).iter().map(|x| x * x).sum::<f64>() / rows;
    let n = factor.columns();
    let variance = |covariance: &[f64]| {
        // the trace of R C R^T: R times the columns of C, then times the rows of that
        let columns = covariance.chunks_exact(n.max(1)).map(|c| factor.times_r(c));
        let columns: Vec<Vec<f64>> = columns.collect();
        let mut sum = 0.0;
        for k in 0..n {
            let row: Vec<f64> = columns
                .iter()
                .map(|c| c.get(k).copied().unwrap_or(0.0))
                .collect();
            sum += factor.times_r(&row).get(k).copied().unwrap_or(0.0);
        }
        sum / rows
    };
    let mut all: Vec<Errors> = Vec::with_capacity(trials.len());
    for trial in trials {
        let mut own = Errors {
            variance: variance(&trial.covariance),
            bias: square(&trial.bias),
            apart: 0.0,
        };
        for (lower, errors) in trials.iter().zip(&all).filter(|(t, _)| t.trust > 0) {
            let difference: Vec<f64> = (trial.values.iter().zip(&lower.values))
                .map(|(a, b)| a - b)
                .collect();
            let explained = own.variance + own.bias + errors.variance + errors.bias;
            own.apart = own.apart.max(square(&difference) - CHANCE * explained);
        }
        all.push(own);
    }
    all
}

/// The index of the trial with the smallest error; of those that are nearly as good the first.
fn lowest(trials: &[Trial], errors: &[Errors]) -> usize {
    let mut best: Option<(usize, f64)> = None;
    for (k, own) in usable(trials, errors) {
        if best.is_none_or(|(_, least)| own < (1.0 - BETTER) * least) {
            best = Some((k, own));
        }
    }
    best.map_or(0, |(k, _)| k)
}

/// The index of the highest cutoff that is as good as the best, at most two octaves above the lowest.
fn highest(trials: &[Trial], errors: &[Errors]) -> usize {
    let least = usable(trials, errors)
        .map(|(_, own)| own)
        .fold(f64::INFINITY, f64::min);
    let most = trials.iter().map(|own| own.trust).max();
    let pairs = trials.iter().zip(errors).enumerate();
    // of a short log the lower cutoffs count too: the memory of its residuals is that of the model's errors
    let good = pairs.filter(|(_, (trial, own))| {
        trial.trust >= most.unwrap_or(0).min(1) && own.sum() <= AS_GOOD * least
    });
    let good: Vec<usize> = good.map(|(k, _)| k).collect();
    let cutoff = |k: usize| trials.get(k).map_or(f64::NAN, |own| own.cutoff);
    let most = good.first().map_or(f64::NAN, |k| MOST_ABOVE * cutoff(*k));
    let chosen = good.into_iter().rfind(|k| cutoff(*k) <= most);
    chosen.unwrap_or(0)
}

/// The indices and the errors of the trials whose covariance can be trusted most.
fn usable<'t>(
    trials: &'t [Trial],
    errors: &'t [Errors],
) -> impl Iterator<Item = (usize, f64)> + 't {
    let most = trials.iter().map(|own| own.trust).max();
    let pairs = trials.iter().zip(errors).enumerate();
    pairs
        .filter(move |(_, (trial, own))| Some(trial.trust) == most && own.sum().is_finite())
        .map(|(k, (_, own))| (k, own.sum()))
}

/// The mean square of the weighted efforts of a factor.
fn mean_square(factor: &QrFactor) -> f64 {
    let squares: f64 = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
    squares / factor.rows().max(1) as f64
}
