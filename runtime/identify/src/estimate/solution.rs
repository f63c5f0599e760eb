//! The least-squares estimate with its covariance.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::{Deviations, EstimateError, FactorSet, QrFactor};
use crate::qr_update::substitute;

/// How the efforts are weighted against each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weighting {
    /// All efforts have weight 1: ordinary least squares.
    Equal,
    /// Each effort is divided by the standard deviation of its residuals, which is found by
    /// repeating the estimate until the weights converge.
    #[default]
    PerEffort,
}

/// Rows, noise and weight of one effort in an estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffortFit {
    /// The effort's name.
    pub name: String,
    /// The number of its rows.
    pub rows: usize,
    /// The standard deviation of its residuals, N or N m.
    pub sigma: f64,
    /// The weight that its rows were multiplied by.
    pub weight: f64,
}

/// Estimated parameters with their covariance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Labels of the n parameters.
    pub labels: Vec<String>,
    /// The values of the parameters, SI.
    pub values: Vec<f64>,
    /// The covariance of the parameters, n x n, symmetric, column-major.
    pub covariance: Vec<f64>,
    /// The number of rows minus the number of parameters.
    pub degrees_of_freedom: usize,
    /// The degrees of freedom of Student's distribution for each parameter, n entries: rows minus
    /// parameters for white residuals, fewer for correlated residuals.
    pub parameter_degrees_of_freedom: Vec<f64>,
    /// The efforts with the standard deviations of their residuals.
    pub efforts: Vec<EffortFit>,
    /// The condition number of the weighted W (Eq. 24).
    pub condition: f64,
    /// The condition number of the weighted W with columns scaled to unit length (Eq. 27).
    pub scaled_condition: f64,
}

/// The largest number of reweighting passes; three or four usually converge.
const MAX_REWEIGHTING_PASSES: usize = 50;
/// Reweighting ends when no weight changes by more than this relative amount.
const WEIGHT_TOLERANCE: f64 = 1e-12;
/// The standard deviation of an effort's residuals counts as at least this fraction of the effort's
/// root mean square: smaller residuals are rounding errors.
const MIN_SIGMA_PART: f64 = 1e-14;
/// The relative standard deviation of an effort (residuals over effort) counts as at least this
/// fraction of the worst effort's: the weight of an effort that is fitted exactly would otherwise
/// leave no digits to the other efforts.
const MIN_RELATIVE_SIGMA: f64 = 1e-4;

/// The weights 1/sigma of the efforts, given the standard deviations of their residuals, N or N m.
fn weights_from(sigmas: &[f64], set: &FactorSet) -> Vec<f64> {
    let rms = |factor: &QrFactor| {
        let squares: f64 = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
        (squares / factor.rows().max(1) as f64).sqrt()
    };
    let sizes: Vec<f64> = set.factors().iter().map(rms).collect();
    let parts = sigmas.iter().zip(&sizes).filter(|(_, size)| **size > 0.0);
    let worst = parts.fold(0.0, |m: f64, (sigma, size)| m.max(sigma / size));
    let pairs = sigmas.iter().zip(&sizes);
    pairs
        .map(|(sigma, size)| 1.0 / sigma.max(MIN_RELATIVE_SIGMA * worst * size))
        .collect()
}

impl Estimate {
    /// Estimates parameters from a set of factors.
    ///
    /// # Errors
    /// When there are fewer rows than parameters, or the data leave parameters undetermined:
    /// the error names them.
    pub fn new(set: &FactorSet, weighting: Weighting) -> Result<Self, EstimateError> {
        let mut weights = vec![1.0; set.factors().len()];
        let mut whole = set.combined(&weights)?;
        let mut values = whole.solve()?;
        let mut sigmas = residual_sigmas(set, &values)?;
        if weighting == Weighting::PerEffort && set.factors().len() > 1 && !whole.has_too_few_rows()
        {
            for _ in 0..MAX_REWEIGHTING_PASSES {
                let next = weights_from(&sigmas, set);
                let change = next
                    .iter()
                    .zip(&weights)
                    .fold(0.0, |m: f64, (a, b)| m.max((a / b - 1.0).abs()));
                weights = next;
                whole = set.combined(&weights)?;
                values = whole.solve()?;
                sigmas = residual_sigmas(set, &values)?;
                if change < WEIGHT_TOLERANCE {
                    break;
                }
            }
        }
        let efforts = set
            .efforts
            .iter()
            .zip(set.factors())
            .zip(sigmas.iter().zip(&weights));
        let efforts = efforts
            .map(|((name, factor), (sigma, weight))| EffortFit {
                name: name.clone(),
                rows: factor.rows(),
                sigma: *sigma,
                weight: *weight,
            })
            .collect();
        Ok(Self {
            efforts,
            ..Self::of(&whole)?
        })
    }

    /// Estimates parameters from one factor whose rows have the same standard deviation. With less
    /// than three rows for two parameters the residuals give no information on the noise, and the
    /// standard deviations are infinite.
    ///
    /// # Errors
    /// As [`new`](Estimate::new).
    ///
    /// ```
    /// use regen_identify::estimate::{Estimate, QrFactor};
    ///
    /// let mut factor = QrFactor::new(vec!["a".to_owned()]);
    /// factor.push_block(&[1.0, 1.0, 1.0], &[1.0, 2.0, 3.0])?;
    /// let estimate = Estimate::of(&factor)?;
    /// assert!((estimate.values[0] - 2.0).abs() < 1e-15);
    /// // the mean's variance: residuals' variance 1 over 3 rows
    /// assert!((estimate.sigma(0) - (1.0_f64 / 3.0).sqrt()).abs() < 1e-15);
    /// # Ok::<(), regen_identify::estimate::EstimateError>(())
    /// ```
    pub fn of(factor: &QrFactor) -> Result<Self, EstimateError> {
        let spectrum = factor.spectrum()?;
        spectrum.require_full_rank(factor)?;
        let values = substitute(factor.r(), factor.z()).ok_or(EstimateError::NoConvergence)?;
        let n = values.len();
        let degrees_of_freedom = factor.rows() - n;
        // with so few rows the residuals give no information on the noise
        let variance = if factor.has_too_few_rows() {
            f64::INFINITY
        } else {
            factor.squared_residual(&values)? / degrees_of_freedom as f64
        };
        Ok(Self {
            labels: factor.labels().to_vec(),
            covariance: inverse_gram(factor)
                .ok_or(EstimateError::NoConvergence)?
                .into_iter()
                .map(|c| c * variance)
                .collect(),
            parameter_degrees_of_freedom: vec![degrees_of_freedom as f64; values.len()],
            values,
            degrees_of_freedom,
            efforts: vec![EffortFit {
                name: String::new(),
                rows: factor.rows(),
                sigma: variance.sqrt(),
                weight: 1.0,
            }],
            condition: spectrum.condition(),
            scaled_condition: spectrum.scaled_condition(),
        })
    }

    /// The standard deviation of a parameter; NaN if there is none of that index.
    pub fn sigma(&self, parameter: usize) -> f64 {
        let n = self.values.len();
        let variance = self.covariance.get(parameter * n + parameter);
        variance.map_or(f64::NAN, |v| v.sqrt())
    }

    /// The standard deviation in percent of the parameter's absolute value (Khalil and Dombre,
    /// 2002): below 15 a parameter counts as well identified.
    pub fn sigma_percent(&self, parameter: usize) -> f64 {
        let value = self.values.get(parameter).copied().unwrap_or(f64::NAN);
        100.0 * self.sigma(parameter) / value.abs()
    }

    /// Half the width of the confidence interval around a value, by Student's distribution, in the
    /// unit of the parameter.
    ///
    /// - `level`: the confidence level, such as 0.95; outside of (0, 1) the result is NaN.
    pub fn half_width(&self, parameter: usize, level: f64) -> f64 {
        let freedom = self
            .parameter_degrees_of_freedom
            .get(parameter)
            .copied()
            .unwrap_or(f64::NAN);
        quantile(freedom, level) * self.sigma(parameter)
    }

    /// The same estimate with another covariance, n x n.
    ///
    /// # Errors
    /// When the size does not fit.
    pub fn with_covariance(&self, covariance: Vec<f64>) -> Result<Self, EstimateError> {
        super::factor::size("covariance", self.covariance.len(), covariance.len())?;
        Ok(Self {
            covariance,
            ..self.clone()
        })
    }

    /// The same estimate with the covariance and degrees of freedom that account for the
    /// correlation of the residuals.
    #[must_use]
    pub fn with_deviations(&self, deviations: &Deviations) -> Self {
        Self {
            covariance: deviations.covariance.clone(),
            parameter_degrees_of_freedom: deviations.degrees_of_freedom.clone(),
            ..self.clone()
        }
    }
}

/// The quantile of Student's distribution for two-sided intervals of this confidence level: NaN for
/// a level outside of (0, 1), infinite without a degree of freedom.
fn quantile(freedom: f64, level: f64) -> f64 {
    if !(level > 0.0 && level < 1.0) {
        return f64::NAN;
    }
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |t| t.inverse_cdf(0.5 + 0.5 * level))
}

/// The standard deviations of the efforts' residuals, N or N m: each effort's rows count as reduced
/// by its share of the parameters.
fn residual_sigmas(set: &FactorSet, values: &[f64]) -> Result<Vec<f64>, EstimateError> {
    let all: usize = set.factors().iter().map(QrFactor::rows).sum();
    let free = 1.0 - values.len() as f64 / all.max(1) as f64;
    let one = |factor: &QrFactor| {
        let rows = factor.rows().max(1) as f64;
        let size = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
        let floor = (MIN_SIGMA_PART * (size / rows).sqrt()).max(f64::MIN_POSITIVE.sqrt());
        let squares = factor.squared_residual(values)?;
        Ok((squares / (rows * free.max(f64::EPSILON)))
            .sqrt()
            .max(floor))
    };
    set.factors().iter().map(one).collect()
}

/// (W^T W)^-1 = R^-1 R^-T, n x n; `None` where R is singular.
pub(super) fn inverse_gram(factor: &QrFactor) -> Option<Vec<f64>> {
    let n = factor.columns();
    let mut inverse = Vec::with_capacity(n * n);
    for k in 0..n {
        let mut unit = vec![0.0; n];
        unit[k] = 1.0;
        inverse.extend(substitute(factor.r(), &unit)?);
    }
    let mut out = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            // column k of R^-1 ends at row k
            let value = (i..n)
                .map(|k| inverse[k * n + i] * inverse[k * n + j])
                .sum();
            out[i * n + j] = value;
            out[j * n + i] = value;
        }
    }
    Some(out)
}
