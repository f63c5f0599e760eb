//! The result of an identification, and the prediction of efforts with it that all commands use.

use crate::choice::Choice;
use crate::data::DataError;
use crate::estimate::{Estimate, EstimateError, Residuals};
use crate::friction::{JointEfforts, JointFit};
use crate::identify::{EquationBuilder, EquationKind, equations};
use crate::intervals::Spread;
use crate::states::Source;
use regen_runtime::{BaseModel, Parameter, SizeError};

/// Standard deviation and confidence interval of an estimated value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The standard deviation, in the value's unit.
    pub sigma: f64,
    /// The standard deviation under the assumption of white residuals; NaN if the estimator does not
    /// compute it.
    pub sigma_white: f64,
    /// The lower end of the confidence interval, of the requested level.
    pub low: f64,
    /// The upper end of the confidence interval.
    pub high: f64,
}

impl Interval {
    /// The interval of a value from its draws; `None` if there are no draws.
    ///
    /// - `confidence`: its level, in (0, 1).
    pub(crate) fn drawn(spread: &Spread, confidence: f64) -> Option<Self> {
        let (low, high) = spread.interval(confidence);
        low.is_finite().then_some(Self {
            sigma: spread.sigma,
            sigma_white: f64::NAN,
            low,
            high,
        })
    }

    /// The interval with a bias, in the value's unit, that counts as one standard deviation more.
    #[must_use]
    pub(crate) fn with_bias(self, bias: f64) -> Self {
        let sigma = libm::hypot(self.sigma, bias);
        let growth = if self.sigma > 0.0 {
            sigma / self.sigma
        } else {
            1.0
        };
        let (middle, half) = (0.5 * (self.low + self.high), 0.5 * (self.high - self.low));
        Self {
            sigma,
            low: middle - growth * half,
            high: middle + growth * half,
            ..self
        }
    }
}

/// The confidence intervals of a model's values, each by the estimator that gave the value.
///
/// An empty list means that the estimator gives no intervals of these values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intervals {
    /// Intervals of the r base parameters; `None` where a value was left out or has no interval.
    pub base: Vec<Option<Interval>>,
    /// Intervals of all p parameters.
    pub physical: Vec<Option<Interval>>,
    /// Intervals of the coefficients of nonlinear friction, joint by joint.
    pub friction: Vec<Vec<Option<Interval>>>,
    /// By how much noise of the measured motion and delays that are not corrected may move each base
    /// parameter, which its deviation
    /// contains; empty where it is not known.
    pub bias: Vec<f64>,
    /// How the intervals were computed, in words.
    pub method: String,
}

impl Intervals {
    /// The intervals of base parameters with the bias of each as one standard deviation more; it becomes
    /// theirs.
    pub(crate) fn add_bias(&mut self, bias: Vec<f64>) {
        for (interval, bias) in self.base.iter_mut().zip(&bias) {
            if let Some(own) = interval {
                *own = own.with_bias(*bias);
            }
        }
        self.bias = bias;
    }

    /// The intervals of a least-squares estimate.
    ///
    /// - `white`, `used`: the estimate with the covariance for white residuals, and with the
    ///   covariance of the intervals;
    /// - `confidence`: the level of the intervals, in (0, 1).
    pub fn of(white: &Estimate, used: &Estimate, confidence: f64, method: String) -> Self {
        let one = |k: usize| {
            let (value, sigma) = (*used.values.get(k)?, used.sigma(k));
            let half = used.half_width(k, confidence);
            // without more equations than parameters the noise is not known
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

/// The gain of a drive whose effort was measured as a current.
#[derive(Clone, Debug, PartialEq)]
pub struct Gain {
    /// The coordinate of the effort.
    pub effort: String,
    /// The effort over the current, N m/A or N/A.
    pub value: f64,
    /// Its uncertainty; `None` if the gain was known.
    pub interval: Option<Interval>,
}

/// A value of a payload.
#[derive(Clone, Debug, PartialEq)]
pub struct PayloadValue {
    /// `m`, `cx`, `cy`, `cz`, or `Ixx` to `Izz` about the centre of mass.
    pub name: String,
    /// kg, m or kg m^2.
    pub unit: String,
    /// The value.
    pub value: f64,
    /// Whether it was given rather than identified.
    pub is_known: bool,
    /// Its uncertainty; `None` if it was given.
    pub interval: Option<Interval>,
}

/// A payload: the values that the runs determine, and those that were given.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifiedPayload {
    /// The label of its body.
    pub body: String,
    /// Mass, centre of mass and inertia about it, in the frame of the body.
    pub values: Vec<PayloadValue>,
}

/// A covariance of base parameters and gains.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Covariance {
    /// The labels of the base parameters, and `gain(NAME)` of a coordinate's gain.
    pub labels: Vec<String>,
    /// The covariance, n x n, symmetric, in the products of the units.
    pub values: Vec<f64>,
}

impl Covariance {
    /// The label of a gain.
    pub fn gain(effort: &str) -> String {
        format!("gain({effort})")
    }

    /// The index of a label.
    pub fn place(&self, label: &str) -> Option<usize> {
        self.labels.iter().position(|own| own == label)
    }

    /// The covariance of two labels, given by index; NaN if an index is out of range.
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        let entry = self.values.get(i * self.labels.len() + j);
        entry.copied().unwrap_or(f64::NAN)
    }
}

/// Where an identified model came from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// The [`digest`](crate::identify::digest) of the robot's model; empty where it is not known.
    pub model: String,
    /// The names of the log files without folder and ending, in alphabetical order.
    pub logs: Vec<String>,
    /// The date of the identification, as the caller gives it.
    pub date: Option<String>,
    /// The filter that was chosen from the logs.
    pub filter: Option<Choice>,
}

/// The identified values of a model, by any of the estimators.
#[derive(Clone, Debug, Default)]
pub struct IdentifiedModel {
    /// The estimator: `least squares`, `feasible`, `reduced`, ...
    pub name: String,
    /// The r base parameters, SI.
    pub beta: Vec<f64>,
    /// All p parameters, SI, of a physically feasible model; their base parameters are `beta`.
    pub phi: Option<Vec<f64>>,
    /// Friction that has no columns among the base parameters.
    pub friction: Vec<JointFit>,
    /// The indices of base parameters that were left out on purpose; their values are zero.
    pub left_out: Vec<usize>,
    /// The verdict on the physical feasibility, in words.
    pub feasibility: String,
    /// The labels of masses that neither the data nor a meaningful limit bounds: they need bounds or
    /// nominal values.
    pub unbounded: Vec<String>,
    /// The relative amount by which the objective of a physically feasible model can at most be
    /// above the optimum.
    pub gap: Option<f64>,
    /// The confidence intervals of the values.
    pub intervals: Intervals,
    /// The gains of drives whose efforts were measured as currents of unknown gain.
    pub gains: Vec<Gain>,
    /// The payloads that runs carried, whose base parameters are among `beta`.
    pub payloads: Vec<IdentifiedPayload>,
    /// The covariance of base parameters and gains, if it was requested or is part of the fit.
    pub covariance: Option<Covariance>,
    /// The model and the logs that the values were identified from.
    pub provenance: Provenance,
}

/// The equations of one sample: their measured right-hand sides and the model's predictions.
pub struct Predicted<'a> {
    /// Time, s.
    pub time: f64,
    /// Whether the sample follows the one before it without a gap.
    pub follows: bool,
    /// The measured right-hand sides, N or N m; J for energy balances.
    pub measured: &'a [f64],
    /// The right-hand sides that the model predicts, in the same units.
    pub fitted: &'a [f64],
    /// Which of the equations are used: those with weight 0, such as of joints at rest, are not.
    pub used: &'a [bool],
}

impl IdentifiedModel {
    /// All p parameters, SI: the physical ones if a feasible fit found them, otherwise any that
    /// have these base parameters.
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

    /// The model of a run in which the robot carries one of these payloads, or none: the base
    /// parameters of the others are 0.
    ///
    /// - `bodies`: the labels of all payloads of the model; `carried`: the one that is carried.
    #[must_use]
    pub fn carrying<M: BaseModel<f64> + ?Sized>(
        &self,
        model: &M,
        bodies: &[String],
        carried: Option<&str>,
    ) -> Self {
        let info = model.info();
        let is_absent = |label: &str| {
            let parameter = Parameter::read(label);
            parameter.is_some_and(|own| {
                let absent = carried != Some(own.owner);
                own.is_inertial() && absent && bodies.iter().any(|body| body == own.owner)
            })
        };
        let mut out = self.clone();
        for (value, parameter) in out.beta.iter_mut().zip(model.base_info().base) {
            if is_absent(parameter.label) {
                *value = 0.0;
            }
        }
        if let Some(phi) = &mut out.phi {
            for (value, parameter) in phi.iter_mut().zip(info.parameters) {
                if is_absent(&parameter.label()) {
                    *value = 0.0;
                }
            }
        }
        out
    }

    /// Copies the intervals of another model if both have the same base parameters: where no
    /// constraint is active, a feasible fit equals least squares and has its intervals.
    pub fn copy_intervals_if_equal(&mut self, other: &Self) {
        /// Values that differ by less than this part of a standard deviation are the same.
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
        // shift the intervals by the rounding difference between the values
        let moved = self.beta.iter().zip(&other.beta).map(|(a, b)| a - b);
        for (interval, by) in self.intervals.base.iter_mut().zip(moved) {
            if let Some(interval) = interval {
                interval.low += by;
                interval.high += by;
            }
        }
    }

    /// Predicts the right-hand side of every equation of a log, and passes the predictions to
    /// `each`, sample by sample.
    ///
    /// Tables, reports and validation all use this prediction.
    ///
    /// # Errors
    /// [`DataError::NonlinearFrictionInEnergyBalance`] for nonlinear friction in an energy balance; errors of
    /// reading the log.
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
            return Err(DataError::NonlinearFrictionInEnergyBalance);
        }
        let mut columns = JointEfforts::new(model, &self.friction)?;
        // the column of nonlinear friction has the factor 1
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

    /// The statistics of the residuals of a log: measured minus predicted right-hand sides.
    ///
    /// - `means`: of the efforts on this log, for eps_RA (Eq. 33);
    /// - `lags`: the number of autocorrelations to compute.
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

/// Adds `value` times a column to the sums.
fn add(sums: &mut [f64], column: &[f64], value: f64) {
    for (sum, entry) in sums.iter_mut().zip(column) {
        *sum += entry * value;
    }
}
