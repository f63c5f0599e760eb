//! The model that was identified: one set of values, and the one prediction that all commands
//! make with it.

use regen_identify::data::DataError;
use regen_identify::estimate::{Estimate, EstimateError, Residuals};
use regen_identify::friction::{JointEfforts, JointFit};
use regen_identify::identify::{Kind, Observer, Source, equations};

use crate::exit::Failure;
use regen_interpreted::Interpreted;

/// What an estimator says of how uncertain its value is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    /// The standard deviation, in the value's unit.
    pub(crate) sigma: f64,
    /// The same as if the residuals were white; NaN where the estimator has none.
    pub(crate) sigma_white: f64,
    /// The confidence interval, of the level that was asked for.
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// The intervals of a model's values, each by the estimator that gave the value.
///
/// A list that is empty says that this estimator gives no intervals of these values.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Intervals {
    /// Of the r base parameters; `None` where a value was left out or has no interval.
    pub(crate) base: Vec<Option<Interval>>,
    /// Of all p parameters.
    pub(crate) physical: Vec<Option<Interval>>,
    /// Of the friction that has no columns: for each joint its coefficients.
    pub(crate) friction: Vec<Vec<Option<Interval>>>,
    /// How they were found, in words.
    pub(crate) method: String,
}

impl Intervals {
    /// The intervals of a least-squares estimate.
    ///
    /// - `white`, `used`: the estimate with the covariance for white residuals, and with the one
    ///   that counts.
    pub(crate) fn of(white: &Estimate, used: &Estimate, confidence: f64, method: String) -> Self {
        let one = |k: usize| {
            let (value, sigma) = (*used.values.get(k)?, used.sigma(k));
            let half = used.half_width(k, confidence);
            // without a spare equation nothing is known of the noise
            (sigma.is_finite() && half.is_finite()).then(|| Interval {
                sigma,
                sigma_white: white.sigma(k),
                low: value - half,
                high: value + half,
            })
        };
        Self {
            base: (0..used.values.len()).map(one).collect(),
            method,
            ..Self::default()
        }
    }
}

/// A model that was identified, whatever by.
#[derive(Clone, Debug, Default)]
pub(crate) struct IdentifiedModel {
    /// The method that found it: `least squares`, `feasible`, `reduced`, ...
    pub(crate) name: &'static str,
    /// Its r base parameters, SI.
    pub(crate) beta: Vec<f64>,
    /// All p parameters, SI, where it is physical; their base parameters are `beta`.
    pub(crate) phi: Option<Vec<f64>>,
    /// Friction that has no columns among the base parameters.
    pub(crate) friction: Vec<JointFit>,
    /// The places of base parameters that were left out of it on purpose; their values are zero.
    pub(crate) left_out: Vec<usize>,
    /// What is known of its feasibility.
    pub(crate) feasibility: String,
    /// By what part of itself the objective can be above the optimum at most, where it is physical.
    pub(crate) gap: Option<f64>,
    /// How uncertain its values are.
    pub(crate) intervals: Intervals,
}

/// A sample's equations with what a model predicts for them.
pub(crate) struct Predicted<'a> {
    /// Time, s.
    pub(crate) time: f64,
    /// Whether it follows the sample before it.
    pub(crate) follows: bool,
    /// The right side as measured, N or N m; J where energy is balanced.
    pub(crate) measured: &'a [f64],
    /// The same as the model predicts it.
    pub(crate) fitted: &'a [f64],
    /// Which of the equations count: those of joints at rest do not.
    pub(crate) used: &'a [bool],
}

impl IdentifiedModel {
    /// Takes over the intervals of another model that has the same base parameters: where no
    /// constraint is active, a feasible fit is least squares, and as uncertain.
    pub(crate) fn inherit(&mut self, other: &Self) {
        /// Values that differ by less than this part of a deviation are the same.
        const SAME: f64 = 1e-6;
        let same = self.beta.len() == other.beta.len()
            && self.friction.is_empty()
            && other.friction.is_empty()
            && self
                .beta
                .iter()
                .zip(&other.beta)
                .enumerate()
                .all(|(k, (a, b))| {
                    let interval = other.intervals.base.get(k).copied().flatten();
                    interval.is_some_and(|i| (a - b).abs() <= SAME * i.sigma)
                });
        if !(self.intervals.base.is_empty() && same) {
            return;
        }
        self.intervals = other.intervals.clone();
        // an interval lies around its own value, to the last digit
        let moved = self.beta.iter().zip(&other.beta).map(|(a, b)| a - b);
        for (interval, by) in self.intervals.base.iter_mut().zip(moved) {
            if let Some(interval) = interval {
                interval.low += by;
                interval.high += by;
            }
        }
    }

    /// Predicts the right side of every equation that a log gives.
    ///
    /// This is the only place where forces are predicted from what was identified: the tables of
    /// `identify`, the report and `validate` all come through here.
    pub(crate) fn predict<S: Source<Error = DataError>>(
        &self,
        model: &Interpreted<'_>,
        kind: Kind,
        log: &mut S,
        each: &mut dyn FnMut(&Predicted<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), Failure> {
        if !self.friction.is_empty() && kind != Kind::Forces {
            let text = "parameters with nonlinear friction predict forces: leave out --energy";
            return Err(Failure::Input(text.to_owned()));
        }
        let mut columns = JointEfforts::new(model, &self.friction)?;
        // the column of friction counts as it is
        let factors: Vec<f64> = self.beta.iter().copied().chain([1.0]).collect();
        let mut fitted = Vec::new();
        let mut used = Vec::new();
        equations(model, kind, log, &mut columns, &mut |found| {
            let count = found.tau.len();
            if count == 0 {
                return Ok(());
            }
            fitted.clear();
            fitted.resize(count, 0.0);
            for (column, value) in found.w.chunks_exact(count).zip(&factors) {
                add(&mut fitted, column, *value);
            }
            used.clear();
            used.extend(found.weights.iter().map(|w| *w > 0.0));
            each(&Predicted {
                time: found.time,
                follows: found.follows,
                measured: found.tau,
                fitted: &fitted,
                used: &used,
            })
        })?;
        Ok(())
    }

    /// What the prediction leaves of a log's efforts.
    ///
    /// - `means`: of the efforts on this log, for eps_RA (Eq. 33);
    /// - `lags`: how many autocorrelations are found.
    pub(crate) fn residuals<S: Source<Error = DataError>>(
        &self,
        model: &Interpreted<'_>,
        kind: Kind,
        log: &mut S,
        means: &[f64],
        lags: usize,
    ) -> Result<Residuals, Failure> {
        let names = Observer::new(model, kind).origin().efforts;
        let mut out = Residuals::new(&names, means, lags);
        self.predict(model, kind, log, &mut |predicted| {
            if !predicted.follows {
                out.interrupt();
            }
            out.push_used(predicted.measured, predicted.fitted, predicted.used)
        })?;
        Ok(out)
    }
}

/// Adds a column times a value.
fn add(sums: &mut [f64], column: &[f64], value: f64) {
    for (sum, entry) in sums.iter_mut().zip(column) {
        *sum += entry * value;
    }
}
