//! The least-squares estimate with its covariance.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

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
    /// The number of its equations (rows of W).
    pub rows: usize,
    /// The standard deviation of its residuals, N or N m, or J for energy balances; of the
    /// residuals of weighted rows in the result of [`Estimate::of`]. Infinite there with too few
    /// rows.
    pub sigma: f64,
    /// The factor by which its rows were multiplied; 1 without weighting.
    pub weight: f64,
}

/// Estimated parameters with their covariance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Labels of the n parameters.
    pub labels: Vec<String>,
    /// The values of the parameters, SI.
    pub values: Vec<f64>,
    /// The covariance of the parameters, n x n, symmetric, column-major; not finite where there are
    /// too few rows to estimate the noise, see [`Estimate::of`].
    pub covariance: Vec<f64>,
    /// The number of rows minus the number of parameters.
    pub degrees_of_freedom: usize,
    /// The degrees of freedom of Student's distribution for each parameter, n entries: rows minus
    /// parameters for white residuals, fewer for correlated residuals.
    #[serde(rename = "students")]
    pub parameter_degrees_of_freedom: Vec<f64>,
    /// The efforts with the standard deviations of their residuals.
    pub efforts: Vec<EffortFit>,
    /// The condition number of the weighted W (Eq. 24).
    pub condition: f64,
    /// The condition number of the weighted W with columns scaled to unit length (Eq. 27).
    pub scaled_condition: f64,
}

/// The largest number of reweighting passes; three or four usually suffice for convergence.
const MAX_REWEIGHTING_PASSES: usize = 50;
/// Reweighting ends when no weight changes by more than this relative amount.
const WEIGHT_TOLERANCE: f64 = 1e-12;
/// Lower bound on the standard deviation of an effort's residuals, relative to the root mean square
/// of the effort: smaller residuals are rounding errors.
const MIN_SIGMA_PART: f64 = 1e-14;
/// Lower bound on the relative standard deviation of an effort (residuals over the root mean square
/// of the effort), as a fraction of the largest one of all efforts: otherwise the weight of an
/// effort that is fitted exactly would be so large that the equations of the other efforts were
/// lost to rounding.
const MIN_RELATIVE_SIGMA: f64 = 1e-4;

/// The weights 1/sigma of the efforts, given the standard deviations `sigmas` of their residuals, N
/// or N m, or J, with the lower bound [`MIN_RELATIVE_SIGMA`]; an effort that is 0 throughout has the least
/// weight of the others.
pub(crate) fn weights_from(sigmas: &[f64], set: &FactorSet) -> Vec<f64> {
    let effort_rms: Vec<f64> = set.factors().iter().map(rms).collect();
    let efforts = sigmas
        .iter()
        .zip(&effort_rms)
        .filter(|(_, magnitude)| **magnitude > 0.0);
    let max_relative_sigma =
        efforts.fold(0.0, |m: f64, (sigma, magnitude)| m.max(sigma / magnitude));
    let largest = sigmas.iter().fold(0.0, |m: f64, sigma| m.max(*sigma));
    let least = [1.0 / largest, 1.0];
    let least = least.into_iter().find(|weight| weight.is_finite());
    let efforts = sigmas.iter().zip(&effort_rms);
    efforts
        .map(|(sigma, magnitude)| {
            let weight = 1.0 / sigma.max(MIN_RELATIVE_SIGMA * max_relative_sigma * magnitude);
            // without a size the residuals have no lower bound, and the weight would grow from round to round
            if weight.is_finite() && *magnitude > 0.0 {
                weight
            } else {
                least.unwrap_or(1.0)
            }
        })
        .collect()
}

/// The root mean square of the efforts of a factor.
fn rms(factor: &QrFactor) -> f64 {
    let squares: f64 = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
    (squares / factor.rows().max(1) as f64).sqrt()
}

impl Estimate {
    /// Estimates parameters from the QR factors of all efforts. With less than three rows for two
    /// parameters, all weights are 1.
    ///
    /// # Errors
    /// When there are fewer rows than parameters, or the data leave parameters undetermined:
    /// the error names them; when all efforts are 0.
    pub fn new(set: &FactorSet, weighting: Weighting) -> Result<Self, EstimateError> {
        let has_rows = set.factors().iter().any(|factor| factor.rows() > 0);
        if has_rows && set.factors().iter().all(|factor| rms(factor) == 0.0) {
            return Err(EstimateError::NoEfforts);
        }
        let mut weights = vec![1.0; set.factors().len()];
        let mut combined = set.combined(&weights)?;
        let mut values = combined.solve()?;
        let mut sigmas = residual_sigmas(set, &values)?;
        if weighting == Weighting::PerEffort
            && set.factors().len() > 1
            && !combined.has_too_few_rows()
        {
            for _ in 0..MAX_REWEIGHTING_PASSES {
                let new_weights = weights_from(&sigmas, set);
                let change = new_weights
                    .iter()
                    .zip(&weights)
                    .fold(0.0, |m: f64, (a, b)| m.max((a / b - 1.0).abs()));
                weights = new_weights;
                combined = set.combined(&weights)?;
                values = combined.solve()?;
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
            ..Self::of(&combined)?
        })
    }

    /// Estimates parameters from one QR factor whose rows have the same standard deviation. With
    /// less than three rows for two parameters the residuals give no information on the noise, and
    /// the standard deviations are infinite.
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
        let degrees_of_freedom = self
            .parameter_degrees_of_freedom
            .get(parameter)
            .copied()
            .unwrap_or(f64::NAN);
        quantile(degrees_of_freedom, level) * self.sigma(parameter)
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

/// With so many degrees of freedom the next term of the expansion is below 1e-9.
const MANY: f64 = 1e5;

/// The quantile of Student's distribution for two-sided intervals of this confidence level: NaN for
/// a level outside of (0, 1), infinite without a degree of freedom, the normal distribution's with
/// infinitely many.
///
/// With very many degrees of freedom the expansion around the normal distribution is exact to 1e-9,
/// where the search for the quantile may not end: `t = z + (z^3 + z) / (4 n) + O(n^-2)`.
pub(crate) fn quantile(degrees_of_freedom: f64, level: f64) -> f64 {
    if !(level > 0.0 && level < 1.0) {
        return f64::NAN;
    }
    if degrees_of_freedom >= MANY {
        let z = Normal::standard().inverse_cdf(0.5 + 0.5 * level);
        return z + (z * z * z + z) / (4.0 * degrees_of_freedom);
    }
    StudentsT::new(0.0, 1.0, degrees_of_freedom)
        .map_or(f64::INFINITY, |t| t.inverse_cdf(0.5 + 0.5 * level))
}

/// The standard deviations of the efforts' residuals at these parameters, N or N m, or J. The
/// degrees of freedom of an effort are its rows minus its share of the parameters, in proportion to
/// the rows.
fn residual_sigmas(set: &FactorSet, values: &[f64]) -> Result<Vec<f64>, EstimateError> {
    let total_rows: usize = set.factors().iter().map(QrFactor::rows).sum();
    let free_fraction = 1.0 - values.len() as f64 / total_rows.max(1) as f64;
    let sigma = |factor: &QrFactor| {
        let rows = factor.rows().max(1) as f64;
        let sum_of_squares = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
        let min_sigma =
            (MIN_SIGMA_PART * (sum_of_squares / rows).sqrt()).max(f64::MIN_POSITIVE.sqrt());
        let residual_squares = factor.squared_residual(values)?;
        Ok(
            (residual_squares / (rows * free_fraction.max(f64::EPSILON)))
                .sqrt()
                .max(min_sigma),
        )
    };
    set.factors().iter().map(sigma).collect()
}

/// (W^T W)^-1 = R^-1 R^-T, n x n; `None` where R is singular.
pub(crate) fn inverse_gram(factor: &QrFactor) -> Option<Vec<f64>> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_very_many_degrees_of_freedom_are_those_of_a_few_less() {
        for level in [0.5, 0.95, 0.9999] {
            let before = quantile(0.999e5, level);
            // the search for the quantile is no more exact
            assert!((quantile(1.001e5, level) - before).abs() < 1e-4, "{level}");
            let least = quantile(f64::INFINITY, level);
            for many in [1.6e7, 3.2e8, 1e18] {
                assert!(
                    (quantile(many, level) - least).abs() < 1e-5,
                    "{level} {many}"
                );
            }
        }
    }
}
