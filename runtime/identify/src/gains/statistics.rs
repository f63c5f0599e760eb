//! The statistics of a solved fit: residuals, deviations, shares.

use super::linear::{Column, Linear};
use super::problem::{GainKind, Point, Problem};
use super::rank::require_rank;
use super::result::Uncertainty;
use super::rows::{Rows, Sample};
use super::{GainError, GainFit, GainOptions, Plan, in_si};
use crate::data::DataError;
use crate::estimate::{
    Autoregression, Blocks, Estimate, EstimateError, ORDER, QrFactor, Residuals, Scores,
};
use crate::identify::Source;
use crate::qr_update::substitute;
use crate::session::describe;
use crate::status::EffortContributions;
use regen_runtime::BaseModel;

/// A solved fit, of which the deviations are computed.
pub(super) struct Solved<'a> {
    pub(super) problem: &'a Problem<'a>,
    pub(super) point: &'a Point,
    pub(super) weights: &'a [f64],
    /// Whether the search ended at the optimum.
    pub(super) converged: bool,
    /// The places of the robot's base parameters, also where they are known.
    pub(super) of_robot: &'a [usize],
    pub(super) plan: &'a Plan,
    pub(super) options: &'a GainOptions,
}

impl Solved<'_> {
    /// The rank at the solution, the deviations, and the result.
    pub(super) fn finish<M, S>(&self, rows: &mut Rows<'_, M, S>) -> Result<GainFit, GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let linear = self.linear();
        let (set, efforts) = (self.problem.set, rows.efforts.clone());
        let label = |column: &Column| linear.label(*column, set.labels(), &efforts);
        let labels: Vec<String> = linear.columns.iter().map(label).collect();
        let factor = linear.factor(&linear.columns, &labels)?;
        require_rank(&linear, &factor)?;
        if !self.converged {
            return Err(GainError::NotConverged);
        }
        let mut estimate = Estimate::of(&factor)?;
        let gains: Vec<f64> = (0..efforts.len())
            .map(|effort| 1.0 / linear.inverse_gain(effort))
            .collect();
        let (errors, noise) = self.residuals(&linear, rows, &gains)?;
        let blocks = self.scores(&linear, rows, &noise, &estimate.values)?;
        let all: Vec<usize> = (0..linear.columns.len()).collect();
        let mut deviations = blocks.deviations(&factor, &all, &estimate.values, 1.0)?;
        let of_robot = self.of_robot(&linear, &factor, &efforts)?;
        let is_robot_exact = self.plan.robot.is_some() && of_robot.is_none();
        if let Some(more) = of_robot {
            for matrix in [&mut deviations.covariance, &mut estimate.covariance] {
                for (sum, x) in matrix.iter_mut().zip(&more) {
                    *sum += x;
                }
            }
        }
        let sigmas = self.problem.sigmas(self.point);
        let fits = efforts.iter().zip(set.factors()).zip(&sigmas);
        estimate.efforts = fits
            .zip(&gains)
            .map(|(((name, factor), sigma), gain)| in_si(name, factor.rows(), *sigma, *gain))
            .collect();
        let uncertainty = Uncertainty {
            estimate: &estimate,
            deviations: &deviations,
            confidence: self.options.confidence,
        };
        let exact = if is_robot_exact {
            "; the robot's parameters taken as exact"
        } else {
            ""
        };
        let method = format!(
            "least squares in units of measurement, {}{exact}",
            describe(&deviations)
        );
        let model = self.model(&linear, &uncertainty, &efforts, method);
        #[allow(clippy::cast_sign_loss, reason = "it is at least 1")]
        let bandwidth = blocks.correlation_length().round() as usize;
        Ok(GainFit {
            model,
            shares: self.shares(&linear)?,
            relative_absolute: errors.relative_absolute(),
            errors: errors.efforts(),
            estimate,
            deviations,
            bandwidth,
            left_out: rows.left_out(),
            is_robot_exact,
        })
    }

    /// The residuals in SI, and the noise of each effort's weighted residuals.
    fn residuals<M, S>(
        &self,
        linear: &Linear<'_>,
        rows: &mut Rows<'_, M, S>,
        gains: &[f64],
    ) -> Result<(Residuals, Vec<Autoregression>), GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let names = rows.efforts.clone();
        let means = self.problem.set.means();
        let means: Vec<f64> = means.iter().zip(gains).map(|(m, k)| m * k).collect();
        let mut errors = Residuals::new(&names, &means, self.options.lags);
        let zeros = vec![0.0; names.len()];
        let mut noise = Residuals::new(&names, &zeros, ORDER);
        let (mut out, mut fitted) = (Vec::new(), Vec::new());
        rows.visit(&mut |sample| {
            if !sample.follows {
                errors.interrupt();
                noise.interrupt();
            }
            linear.rows(sample, &mut out, &mut fitted);
            let used: Vec<bool> = sample.weights.iter().map(|w| *w > 0.0).collect();
            let psi = self.psi(sample, &fitted);
            let si = |values: &[f64]| -> Vec<f64> {
                values.iter().zip(gains).map(|(x, k)| x * k).collect()
            };
            errors.push_used(&si(sample.measured), &si(&fitted), &used)?;
            noise.push_used(&psi, &zeros, &used)
        })?;
        let noise = noise.efforts();
        let fits = noise
            .iter()
            .map(|e| Autoregression::fit(e.rms * e.rms, &e.autocorrelation, e.samples));
        Ok((errors, fits.collect()))
    }

    /// The weighted residuals of a sample.
    fn psi(&self, sample: &Sample<'_>, fitted: &[f64]) -> Vec<f64> {
        let pairs = sample.measured.iter().zip(fitted);
        let factors = sample.weights.iter().zip(self.weights);
        pairs
            .zip(factors)
            .map(|((i, f), (own, effort))| (i - f) * own * effort)
            .collect()
    }

    /// The scores of the linearised equations.
    fn scores<M, S>(
        &self,
        linear: &Linear<'_>,
        rows: &mut Rows<'_, M, S>,
        noise: &[Autoregression],
        values: &[f64],
    ) -> Result<Blocks, GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let mut scores = Scores::new(linear.columns.len(), noise);
        let (mut out, mut fitted) = (Vec::new(), Vec::new());
        let slopes = vec![1.0; self.weights.len()];
        rows.visit(&mut |sample| {
            if !sample.follows {
                scores.interrupt();
            }
            linear.rows(sample, &mut out, &mut fitted);
            let psi = self.psi(sample, &fitted);
            let pairs = sample.weights.iter().zip(self.weights);
            let weights: Vec<f64> = pairs.map(|(own, effort)| own * effort).collect();
            scores.push(&out, &weights, &psi, &slopes)
        })?;
        Ok(scores.finish(values)?)
    }

    /// The covariance of the unknowns that comes from that of a known robot; `None` where it is not
    /// known or nothing of the robot is.
    fn of_robot(
        &self,
        linear: &Linear<'_>,
        factor: &QrFactor,
        efforts: &[String],
    ) -> Result<Option<Vec<f64>>, EstimateError> {
        let robot = self.plan.robot.as_ref();
        let Some(covariance) = robot.and_then(|robot| robot.covariance.as_ref()) else {
            return Ok(None);
        };
        let mut fixed: Vec<Column> = self.of_robot.iter().map(|k| Column::Robot(*k)).collect();
        let gains = self.problem.gains.iter().enumerate();
        let found = gains.filter(|(_, kind)| matches!(kind, GainKind::Found(_)));
        fixed.extend(found.map(|(effort, _)| Column::Gain(effort)));
        let set = self.problem.set;
        let label = |column: &Column| linear.label(*column, set.labels(), efforts);
        let columns: Vec<Column> = linear.columns.iter().chain(&fixed).copied().collect();
        let labels: Vec<String> = columns.iter().map(label).collect();
        let places: Vec<Option<usize>> = fixed
            .iter()
            .map(|column| covariance.place(&label(column)))
            .collect();
        let whole = linear.factor(&columns, &labels)?;
        // the first columns of the triangle are those of the unknowns alone
        let (n, m) = (factor.columns(), columns.len());
        let top = |column: usize| whole.r().get(column * m..column * m + n);
        let own: Vec<f64> = (0..n)
            .flat_map(|k| top(k).unwrap_or_default())
            .copied()
            .collect();
        let mut moved = Vec::with_capacity(fixed.len());
        for k in 0..fixed.len() {
            let step = substitute(&own, top(n + k).unwrap_or_default());
            moved.push(step.ok_or(EstimateError::NoConvergence)?);
        }
        let mut out = vec![0.0; n * n];
        for (a, first) in moved.iter().enumerate() {
            for (b, second) in moved.iter().enumerate() {
                let (Some(i), Some(j)) = (places[a], places[b]) else {
                    continue;
                };
                let own = covariance.entry(i, j);
                for (row, x) in out.chunks_exact_mut(n.max(1)).zip(first) {
                    for (sum, y) in row.iter_mut().zip(second) {
                        *sum += x * own * y;
                    }
                }
            }
        }
        Ok(Some(out))
    }

    /// The contributions of all base parameters to the measured efforts.
    fn shares(&self, linear: &Linear<'_>) -> Result<EffortContributions, EstimateError> {
        let set = self.problem.set;
        let mut whole = QrFactor::new(set.labels().to_vec());
        for (effort, factor) in set.factors().iter().enumerate() {
            let g = linear.inverse_gain(effort);
            // the sign of a gain does not matter, that of the diagonal is kept
            let r = factor.r().iter().map(|r| g.abs() * r).collect();
            let z = factor.z().iter().map(|z| g.signum() * z).collect();
            let (rss, rows) = (factor.rss(), factor.rows());
            let own = QrFactor::from_parts(set.labels().to_vec(), r, z, rss, rows)?;
            whole.merge(&own.scaled(self.weights[effort]))?;
        }
        Ok(EffortContributions::of(&whole))
    }
}
