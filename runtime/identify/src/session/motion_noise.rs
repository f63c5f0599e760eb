//! What noise of the measured motion does to parameters: errors in variables.
//!
//! Least squares takes the regressor as exact. Noise of the positions makes its columns larger than
//! those of the motion and their parameters too small, which no residual reveals. Simulation and
//! extrapolation (Cook and Stefanski, 1994) show by how much: noise that is like the log's own is added
//! to the positions, and subtracted from them; the mean of both fits differs from the fit without it by
//! what the added noise biases, and its own part is the same.

use regen_runtime::BaseModel;

use crate::data::{DataError, Logs, NoiseLevels};
use crate::estimate::EstimateError;
use crate::identify::{Filtering, Identified, Source, StateSample, observe};
use crate::signals::Method;

use super::Session;

/// The added noise over that of the log.
const SCALE: f64 = 0.5;

/// Logs to whose motion noise is added, with the rests of the motion without it: other equations that are
/// left out would move the parameters by more than the noise does.
pub(super) struct NoisyLogs<'m, M: ?Sized> {
    logs: Logs<'m, M>,
    /// For each state of a pass without noise its time, s, and whether each coordinate rests.
    rests: Vec<(f64, Vec<bool>)>,
    are_known: bool,
}

impl<'m, M: BaseModel<f64> + ?Sized> NoisyLogs<'m, M> {
    /// Logs in memory, without added noise.
    pub(super) fn new(logs: &Logs<'m, M>) -> Self {
        Self {
            logs: logs.disturbed(0.0, &[]),
            rests: Vec::new(),
            are_known: false,
        }
    }

    /// By how much the noise of the motion changes each least-squares parameter, SI: the values that are
    /// found less those without noise, to the first order of its variance.
    ///
    /// - `logs`: those that these were made from;
    /// - `levels`: the noise levels of the columns of motion of each log;
    /// - `cutoff`: the frequency up to which the equations keep noise, Hz;
    /// - `fit`: the least-squares parameters of logs.
    ///
    /// # Errors
    /// When `fit` gives one: the noisy logs do not determine the parameters, or cannot be read.
    pub(super) fn bias(
        mut self,
        logs: &Logs<'m, M>,
        levels: &[Vec<NoiseLevels>],
        cutoff: f64,
        mut fit: impl FnMut(&mut Self) -> Result<Vec<f64>, DataError>,
    ) -> Result<Vec<f64>, DataError> {
        let deviations: Vec<Vec<f64>> = (logs.durations().iter().zip(levels))
            .map(|((step, _), levels)| {
                let deviation = |own: &NoiseLevels| (own.density(cutoff) / step).sqrt();
                levels.iter().map(deviation).collect()
            })
            .collect();
        let without = fit(&mut self)?;
        self.logs = logs.disturbed(SCALE, &deviations);
        let added = fit(&mut self)?;
        self.logs = logs.disturbed(-SCALE, &deviations);
        let subtracted = fit(&mut self)?;
        let pairs = added.iter().zip(&subtracted).zip(&without);
        Ok(pairs
            .map(|((a, b), x)| (0.5 * (a + b) - x) / (SCALE * SCALE))
            .collect())
    }
}

impl<M: BaseModel<f64> + ?Sized> Source for NoisyLogs<'_, M> {
    type Error = DataError;

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError> {
        let Self {
            logs,
            rests,
            are_known,
        } = self;
        if !*are_known {
            logs.visit(&mut |row| {
                rests.push((row.time, row.at_standstill.to_vec()));
                each(row)
            })?;
            *are_known = true;
            return Ok(());
        }
        let mut known = rests.iter().peekable();
        logs.visit(&mut |row| {
            // loops that cannot be closed may be others with noise
            while known
                .peek()
                .is_some_and(|(time, _)| (*time - row.time).abs() > 0.0)
            {
                known.next();
            }
            match known.next() {
                Some((_, rests)) => each(&StateSample {
                    at_standstill: rests,
                    ..*row
                }),
                None => Ok(()),
            }
        })
    }

    fn filtering(&self) -> Filtering {
        self.logs.filtering()
    }
}

/// The least-squares parameters of logs with given weights of the efforts.
///
/// # Errors
/// When the logs do not determine the parameters.
pub(super) fn values<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    weights: &[f64],
    logs: &mut NoisyLogs<'_, M>,
) -> Result<Vec<f64>, DataError> {
    let (set, _) = observe(session.model, session.kind, logs)?;
    Ok(set.combined(weights)?.solve()?)
}

/// The largest number of rows of each log that noise is added to.
const MAX_ROWS: usize = 1 << 16;
/// The rate of rows behind a low-pass filter over its cutoff: those left out tell nothing more.
const ROWS_PER_CUTOFF: f64 = 16.0;
/// The same of equations, which have passed the filter.
const EQUATIONS_PER_CUTOFF: f64 = 5.0;
/// The frequency below which differences of neighbouring rows keep noise, over the rate of the rows.
const OF_DIFFERENCES: f64 = 0.35;

/// By how much noise of the motion biases the parameters of a fit to logs, as they are read; `None` where
/// no motion is differentiated, or the part of the logs that fits into memory does not determine them.
///
/// # Errors
/// When a log cannot be read.
pub(super) fn motion_bias<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &Logs<'_, M>,
    found: &Identified,
) -> Result<Option<Vec<f64>>, DataError> {
    if !logs.is_differentiated() {
        return Ok(None);
    }
    let kept = logs.in_memory(MAX_ROWS)?;
    let steps = kept.durations();
    let step = steps
        .iter()
        .map(|(step, _)| *step)
        .fold(f64::INFINITY, f64::min);
    let method = logs.settings().method;
    let (cutoff, [every, decimation]) = match method {
        Method::Butterworth { cutoff, .. } => (cutoff, rates(1.0 / step, cutoff)),
        Method::Local { half_width } => (0.5 / half_width, [1, 1]),
        _ => (OF_DIFFERENCES / step, [1, 1]),
    };
    let weights: Vec<f64> = found.estimate.efforts.iter().map(|e| e.weight).collect();
    let bias = kept.thinned(method, every, decimation).and_then(|thinned| {
        let levels = kept.noise_levels();
        let fit = |logs: &mut NoisyLogs<'_, M>| values(session, &weights, logs);
        NoisyLogs::new(&thinned).bias(&thinned, &levels, cutoff, fit)
    });
    match bias {
        Ok(bias) => Ok(Some(bias)),
        Err(error) if is_undetermined(&error) => Ok(None),
        Err(error) => Err(error),
    }
}

/// How many rows at a rate in Hz there are to one that a filter with this cutoff needs, and how many of
/// these to one of its equations.
pub(super) fn rates(rate: f64, cutoff: f64) -> [usize; 2] {
    let every = whole(rate / (ROWS_PER_CUTOFF * cutoff));
    [
        every,
        whole(rate / (every as f64 * EQUATIONS_PER_CUTOFF * cutoff)),
    ]
}

/// The whole number below a ratio, at least 1.
#[allow(clippy::cast_sign_loss, reason = "it is at least 1")]
pub(super) fn whole(ratio: f64) -> usize {
    ratio.floor().max(1.0) as usize
}

/// Whether an error says that logs do not determine the parameters as they are read, so that another
/// way of reading them may.
pub(super) fn is_undetermined(error: &DataError) -> bool {
    matches!(
        error,
        DataError::Signal { .. }
            | DataError::Estimate(
                EstimateError::Undetermined { .. }
                    | EstimateError::TooShort { .. }
                    | EstimateError::NoConvergence
                    | EstimateError::Signal(_)
            )
    )
}
