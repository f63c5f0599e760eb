//! The model that was identified: one set of values, and the one prediction that all commands
//! make with it.

use crate::data::DataError;
use crate::estimate::{Estimate, EstimateError, Residuals};
use crate::friction::{JointEfforts, JointFit};
use crate::identify::{EquationBuilder, EquationKind, Source, equations};
use regen_runtime::{BaseModel, SizeError};

/// What an estimator says of how uncertain its value is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The standard deviation, in the value's unit.
    pub sigma: f64,
    /// The same as if the residuals were white; NaN where the estimator has none.
    pub sigma_white: f64,
    /// The confidence interval, of the level that was asked for.
    pub low: f64,
    /// See `low`.
    pub high: f64,
}

/// The intervals of a model's values, each by the estimator that gave the value.
///
/// A list that is empty says that this estimator gives no intervals of these values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intervals {
    /// Of the r base parameters; `None` where a value was left out or has no interval.
    pub base: Vec<Option<Interval>>,
    /// Of all p parameters.
    pub physical: Vec<Option<Interval>>,
    /// Of the friction that has no columns: for each joint its coefficients.
    pub friction: Vec<Vec<Option<Interval>>>,
    /// How they were found, in words.
    pub method: String,
}

impl Intervals {
    /// The intervals of a least-squares estimate.
    ///
    /// - `white`, `used`: the estimate with the covariance for white residuals, and with the one
    ///   that counts.
    pub fn of(white: &Estimate, used: &Estimate, confidence: f64, method: String) -> Self {
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

/// Where an identified model came from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// The digest of the model that it belongs to, as [`digest`](crate::identify::digest) has it;
    /// empty where it is not known.
    pub model: String,
    /// The logs by the names of their files without folder and ending, in alphabetical order.
    pub logs: Vec<String>,
    /// When it was identified, as the caller states it.
    pub date: Option<String>,
}

/// A model that was identified, whatever by.
#[derive(Clone, Debug, Default)]
pub struct IdentifiedModel {
    /// The method that found it: `least squares`, `feasible`, `reduced`, ...
    pub name: String,
    /// Its r base parameters, SI.
    pub beta: Vec<f64>,
    /// All p parameters, SI, where it is physical; their base parameters are `beta`.
    pub phi: Option<Vec<f64>>,
    /// Friction that has no columns among the base parameters.
    pub friction: Vec<JointFit>,
    /// The places of base parameters that were left out of it on purpose; their values are zero.
    pub left_out: Vec<usize>,
    /// What is known of its feasibility.
    pub feasibility: String,
    /// The masses that only a limit far beyond this robot bounds, as labels: they want bounds of
    /// their own, or nominal values.
    pub unbounded: Vec<String>,
    /// By what part of itself the objective can be above the optimum at most, where it is physical.
    pub gap: Option<f64>,
    /// How uncertain its values are.
    pub intervals: Intervals,
    /// Where it came from.
    pub provenance: Provenance,
}

/// A sample's equations with what a model predicts for them.
pub struct Predicted<'a> {
    /// Time, s.
    pub time: f64,
    /// Whether it follows the sample before it.
    pub follows: bool,
    /// The right side as measured, N or N m; J where energy is balanced.
    pub measured: &'a [f64],
    /// The same as the model predicts it.
    pub fitted: &'a [f64],
    /// Which of the equations count: those of joints at rest do not.
    pub used: &'a [bool],
}

impl IdentifiedModel {
    /// All p parameters, SI: those that were found physical, or any that have these base
    /// parameters.
    ///
    /// # Errors
    /// When the number of base parameters is not the model's.
    pub fn parameters<M: BaseModel<f64> + ?Sized>(&self, model: &M) -> Result<Vec<f64>, SizeError> {
        if let Some(phi) = &self.phi {
            return Ok(phi.clone());
        }
        let mut phi = vec![0.0; model.info().parameters.len()];
        let free = vec![0.0; model.base_info().free.len()];
        model.parameters_from_base(&self.beta, &free, &mut phi)?;
        Ok(phi)
    }

    /// Takes over the intervals of another model that has the same base parameters: where no
    /// constraint is active, a feasible fit is least squares, and as uncertain.
    pub fn inherit(&mut self, other: &Self) {
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
    /// Every prediction from what was identified comes through here: tables, reports, validation.
    ///
    /// # Errors
    /// [`DataError::FrictionOfEnergy`] for nonlinear friction in a balance of energy; what reading
    /// the log finds.
    pub fn predict<M, S>(
        &self,
        model: &M,
        kind: EquationKind,
        log: &mut S,
        each: &mut dyn FnMut(&Predicted<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source<Error = DataError>,
    {
        if !self.friction.is_empty() && kind != EquationKind::Forces {
            return Err(DataError::FrictionOfEnergy);
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
    ///
    /// # Errors
    /// As [`predict`](Self::predict).
    pub fn residuals<M, S>(
        &self,
        model: &M,
        kind: EquationKind,
        log: &mut S,
        means: &[f64],
        lags: usize,
    ) -> Result<Residuals, DataError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source<Error = DataError>,
    {
        let names = EquationBuilder::new(model, kind).origin().efforts;
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
