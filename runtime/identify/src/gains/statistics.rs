//! The statistics of a solved fit: residuals, deviations, shares.

use nalgebra::DMatrix;

use super::linear::{Column, Linear};
use super::problem::Problem;
use super::rank::require_rank;
use super::result::Uncertainty;
use super::robust::Huber;
use super::rows::{Rows, Sample, add_product};
use super::unknowns::{GainKind, Point};
use super::{GainError, GainFit, GainOptions, Plan, in_si};
use crate::data::DataError;
use crate::estimate::huber::PsiSums;
use crate::estimate::{
    Blocks, Deviations, EffortNoise, Estimate, EstimateError, FactorSet, NoiseResiduals, QrFactor,
    Residuals,
};
use crate::identify::{ChangedParameters, HeldEfforts, Instrumental, LeftOut};
use crate::qr_update::substitute;
use crate::states::Source;
use crate::status::EffortContributions;
use regen_runtime::BaseModel;

/// A solved fit, of which the deviations are computed.
pub(super) struct Solved<'a> {
    pub(super) problem: Problem<'a>,
    /// The QR factors of the equations without Huber's weights.
    pub(super) plain: &'a FactorSet,
    pub(super) point: &'a Point,
    pub(super) weights: &'a [f64],
    /// The loss of residuals; `None` for least squares.
    pub(super) huber: Option<&'a Huber>,
    /// Whether the search ended at the optimum.
    pub(super) converged: bool,
    /// The places of the robot's base parameters, also where they are known.
    pub(super) of_robot: &'a [usize],
    pub(super) plan: &'a Plan,
    pub(super) options: &'a GainOptions,
    /// The number of base parameters, which come first among the places of the unknowns.
    pub(super) base: usize,
    /// The name of the estimator.
    pub(super) name: &'static str,
}

/// An estimate of the linearised unknowns.
struct Found {
    estimate: Estimate,
    deviations: Deviations,
    /// How the deviations were computed, in words.
    of: String,
    errors: Residuals,
    correlation_length: usize,
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
        let labels = linear.labels(set.labels(), &efforts);
        let factor = linear.factor((set, self.weights), &linear.columns, &labels)?;
        require_rank(&linear, &factor)?;
        if !self.converged {
            return Err(GainError::NotConverged);
        }
        let mut estimate = Estimate::of(&factor)?;
        let gains: Vec<f64> = (0..efforts.len())
            .map(|effort| 1.0 / linear.inverse_gain(effort))
            .collect();
        let (errors, noise) = self.residuals(&linear, rows, &gains)?;
        let (blocks, sums) = self.scores(&linear, rows, &noise, &estimate.values)?;
        let all: Vec<usize> = (0..linear.columns.len()).collect();
        let plain = linear.factor((self.plain, self.weights), &linear.columns, &labels)?;
        let mut inside = 1.0;
        if self.huber.is_some() {
            estimate.covariance = sums.covariance(&plain)?;
            inside = sums.fraction_within_bound();
        }
        let deviations = blocks.deviations(&plain, &all, &estimate.values, inside)?;
        let mut changed = ChangedParameters::new(labels);
        linear.changed(rows, None, self.weights, &mut changed)?;
        let mut held = HeldEfforts::new(linear.columns.len());
        linear.held(rows, false, self.weights, &mut held)?;
        let changes = [changed.finish(&factor), held.change(&factor)];
        let (deviations, sampling) = deviations.with_sampling(&changes);
        let sigmas = match self.huber {
            Some(huber) => huber.sigmas().to_vec(),
            None => self.problem.sigmas(self.point),
        };
        let fits = efforts.iter().zip(set.factors()).zip(&sigmas);
        estimate.efforts = fits
            .zip(&gains)
            .map(|(((name, factor), sigma), gain)| in_si(name, factor.rows(), *sigma, *gain))
            .collect();
        #[allow(clippy::cast_sign_loss, reason = "it is at least 1")]
        let correlation_length = blocks.correlation_length().round() as usize;
        let found = Found {
            of: deviations.in_words() + sampling,
            estimate,
            deviations,
            errors,
            correlation_length,
        };
        let fixed = self.fixed();
        let moved = self.moved_by_least_squares(&linear, &fixed, &efforts)?;
        let of_robot = self.of_robot(&linear, (&fixed, &moved), &efforts);
        Ok(GainFit {
            left_out: rows.left_out(),
            ..self.fit(&linear, found, of_robot, &efforts)?
        })
    }

    /// The result of an estimate by instrumental variables at this point, whose errors are computed in SI.
    pub(super) fn finish_instrumental<M, S>(
        &self,
        rows: &mut Rows<'_, M, S>,
        found: &mut Instrumental,
    ) -> Result<GainFit, GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let linear = self.linear();
        let efforts = rows.efforts.clone();
        let gains: Vec<f64> = (0..efforts.len())
            .map(|effort| 1.0 / linear.inverse_gain(effort))
            .collect();
        let (errors, _) = self.residuals(&linear, rows, &gains)?;
        let means = self.plain.means();
        let at = (linear.x.as_slice(), gains.as_slice());
        let smooth = residual_statistics(rows, at, &means, self.options, |sample| sample.z)?;
        found.at_instruments = smooth.relative_absolute();
        let mut estimate = found.estimate.clone();
        for (own, gain) in estimate.efforts.iter_mut().zip(&gains) {
            *own = in_si(&own.name, own.rows, own.sigma, *gain);
        }
        let own = Found {
            of: found.covariance_in_words(),
            estimate,
            deviations: found.deviations.clone(),
            errors,
            correlation_length: found.correlation_length(),
        };
        let fixed = self.fixed();
        let moved = self.moved_by_instruments(&linear, &fixed, rows)?;
        let of_robot = self.of_robot(&linear, (&fixed, &moved), &efforts);
        let fit = GainFit {
            left_out: rows.left_out(),
            ..self.fit(&linear, own, of_robot, &efforts)?
        };
        found.errors.clone_from(&fit.errors);
        found.left_out = fit.left_out.clone();
        found.relative_absolute = fit.relative_absolute;
        Ok(fit)
    }

    /// The result of an estimate, without what is left out of the logs.
    ///
    /// - `of_robot`: the covariance that that of a known robot causes.
    fn fit(
        &self,
        linear: &Linear<'_>,
        found: Found,
        of_robot: Option<Vec<f64>>,
        efforts: &[String],
    ) -> Result<GainFit, GainError> {
        let Found {
            mut estimate,
            mut deviations,
            errors,
            correlation_length,
            of,
        } = found;
        let is_robot_exact = self.plan.robot.is_some() && of_robot.is_none();
        if let Some(more) = of_robot {
            deviations = deviations.with_added(&more);
            for (sum, x) in estimate.covariance.iter_mut().zip(&more) {
                *sum += x;
            }
        }
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
        let method = format!("{} in units of measurement, {of}{exact}", self.name);
        Ok(GainFit {
            model: self.model(linear, &uncertainty, efforts, method),
            shares: self.shares(linear)?,
            relative_absolute: errors.relative_absolute(),
            errors: errors.efforts(),
            estimate,
            deviations,
            correlation_length,
            left_out: LeftOut::default(),
            is_robot_exact,
        })
    }

    /// The standard deviation of the weighted residuals.
    pub(super) fn noise(&self) -> f64 {
        let rows = self.problem.set.factors().iter().map(QrFactor::rows);
        let freedom = rows
            .sum::<usize>()
            .saturating_sub(self.problem.unknowns.count());
        (self.problem.cost(self.point, self.weights) / freedom.max(1) as f64).sqrt()
    }

    /// The residuals in SI, and the noise of each effort's weighted residuals.
    fn residuals<M, S>(
        &self,
        linear: &Linear<'_>,
        rows: &mut Rows<'_, M, S>,
        gains: &[f64],
    ) -> Result<(Residuals, EffortNoise), GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let names = rows.efforts.clone();
        let means = self.plain.means();
        let means: Vec<f64> = means.iter().zip(gains).map(|(m, k)| m * k).collect();
        let mut errors = Residuals::new(&names, &means, self.options.lags);
        let mut noise = NoiseResiduals::new(names.len(), rows.filtered_noise());
        let (mut out, mut fitted) = (Vec::new(), Vec::new());
        rows.visit(&mut |sample| {
            if !sample.follows {
                errors.interrupt();
                noise.interrupt();
            }
            linear.rows(sample, &mut out, &mut fitted);
            let used: Vec<bool> = sample.weights.iter().map(|w| *w > 0.0).collect();
            let (psi, _) = self.psi(sample, &fitted);
            let si = |values: &[f64]| -> Vec<f64> {
                values.iter().zip(gains).map(|(x, k)| x * k).collect()
            };
            errors.push_used(&si(sample.measured), &si(&fitted), &used)?;
            noise.push(&psi, &used)
        })?;
        Ok((errors, noise.noise()))
    }

    /// The weighted residuals of a sample, bounded by Huber's weight, and the derivatives of these by
    /// the residuals themselves: 1 within the bound, 0 beyond.
    fn psi(&self, sample: &Sample<'_>, fitted: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let pairs = sample.measured.iter().zip(fitted);
        let factors = sample.weights.iter().zip(self.weights);
        let rows = pairs.zip(factors).enumerate();
        rows.map(|(effort, ((i, f), (own, weight)))| {
            let residual = (i - f) * own;
            let bounded = self.huber.map_or(1.0, |h| h.weight(effort, residual));
            let slope = if bounded < 1.0 { 0.0 } else { 1.0 };
            (residual * weight * bounded, slope)
        })
        .unzip()
    }

    /// The scores of the linearised equations.
    fn scores<M, S>(
        &self,
        linear: &Linear<'_>,
        rows: &mut Rows<'_, M, S>,
        noise: &EffortNoise,
        values: &[f64],
    ) -> Result<(Blocks, PsiSums), GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let mut scores = noise.scores(linear.columns.len());
        let (mut out, mut fitted) = (Vec::new(), Vec::new());
        let mut sums = PsiSums::default();
        rows.visit(&mut |sample| {
            if !sample.follows {
                scores.interrupt();
            }
            linear.rows(sample, &mut out, &mut fitted);
            let (psi, slopes) = self.psi(sample, &fitted);
            let used = sample.weights.iter().map(|w| *w > 0.0);
            for (used, (psi, slope)) in used.zip(psi.iter().zip(&slopes)) {
                sums.squares += psi * psi;
                sums.within_bound += usize::from(used && *slope > 0.0);
                sums.equations += usize::from(used);
            }
            let pairs = sample.weights.iter().zip(self.weights);
            let weights: Vec<f64> = pairs.map(|(own, effort)| own * effort).collect();
            scores.push(&out, &weights, &psi, &slopes)
        })?;
        Ok((scores.finish(values)?, sums))
    }

    /// What is known of the robot with a covariance; empty without one.
    fn fixed(&self) -> Vec<Column> {
        let robot = self.plan.robot.as_ref();
        if robot.and_then(|robot| robot.covariance.as_ref()).is_none() {
            return Vec::new();
        }
        let mut fixed: Vec<Column> = self.of_robot.iter().map(|k| Column::Robot(*k)).collect();
        let gains = self.problem.unknowns.gains.iter().enumerate();
        let found = gains.filter(|(_, kind)| matches!(kind, GainKind::Found(_)));
        fixed.extend(found.map(|(effort, _)| Column::Gain(effort)));
        fixed
    }

    /// For each known quantity, how far least squares move the unknowns when it is greater by one.
    fn moved_by_least_squares(
        &self,
        linear: &Linear<'_>,
        fixed: &[Column],
        efforts: &[String],
    ) -> Result<Vec<Vec<f64>>, EstimateError> {
        let set = self.problem.set;
        let label = |column: &Column| linear.label(*column, set.labels(), efforts);
        let columns: Vec<Column> = linear.columns.iter().chain(fixed).copied().collect();
        let labels: Vec<String> = columns.iter().map(label).collect();
        let whole = linear.factor((set, self.weights), &columns, &labels)?;
        // the first columns of the QR factor are those of the unknowns alone
        let (n, m) = (linear.columns.len(), columns.len());
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
        Ok(moved)
    }

    /// The same for instrumental variables: `(Z^T W)^-1 Z^T W_f` with the columns W_f of what is known.
    fn moved_by_instruments<M, S>(
        &self,
        linear: &Linear<'_>,
        fixed: &[Column],
        rows: &mut Rows<'_, M, S>,
    ) -> Result<Vec<Vec<f64>>, GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let (n, m) = (linear.columns.len(), fixed.len());
        if m == 0 {
            return Ok(Vec::new());
        }
        let columns: Vec<Column> = linear.columns.iter().chain(fixed).copied().collect();
        let all = Linear::with_columns(self.problem.unknowns, self.point, &columns);
        let mut products = DMatrix::zeros(n, n + m);
        let (mut w, mut z, mut fitted) = (Vec::new(), Vec::new(), Vec::new());
        rows.visit(&mut |sample| {
            all.rows(sample, &mut w, &mut fitted);
            linear.rows(
                &Sample {
                    w: sample.z,
                    ..*sample
                },
                &mut z,
                &mut fitted,
            );
            let efforts = sample.measured.len();
            for (effort, (own, weight)) in sample.weights.iter().zip(self.weights).enumerate() {
                let weight = own * weight;
                for i in 0..n {
                    let z = weight * weight * z[i * efforts + effort];
                    for j in 0..n + m {
                        products[(i, j)] += z * w[j * efforts + effort];
                    }
                }
            }
            Ok(())
        })?;
        let (own, of_fixed) = (products.columns(0, n), products.columns(n, m));
        let moved = own.clone_owned().lu().solve(&of_fixed.clone_owned());
        let moved = moved.ok_or(EstimateError::NoConvergence)?;
        Ok(moved
            .column_iter()
            .map(|column| column.iter().copied().collect())
            .collect())
    }

    /// The part of the unknowns' covariance that the covariance of a known robot causes; `None` if
    /// no robot is known, or its covariance is not.
    ///
    /// - `moved`: for each of `fixed` how far the unknowns move when it is greater by one.
    fn of_robot(
        &self,
        linear: &Linear<'_>,
        (fixed, moved): (&[Column], &[Vec<f64>]),
        efforts: &[String],
    ) -> Option<Vec<f64>> {
        let covariance = self.plan.robot.as_ref()?.covariance.as_ref()?;
        let n = linear.columns.len();
        let labels = self.problem.set.labels();
        let places: Vec<Option<usize>> = fixed
            .iter()
            .map(|column| covariance.place(&linear.label(*column, labels, efforts)))
            .collect();
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
        Some(out)
    }

    /// The contributions of all base parameters to the measured efforts.
    pub(super) fn shares(&self, linear: &Linear<'_>) -> Result<EffortContributions, EstimateError> {
        let set = self.problem.set;
        let mut whole = QrFactor::new(set.labels().to_vec());
        for (effort, factor) in set.factors().iter().enumerate() {
            let g = linear.inverse_gain(effort);
            // only the squares of the rows count, so the sign of the gain is moved to z to keep the
            // diagonal positive
            let r = factor.r().iter().map(|r| g.abs() * r).collect();
            let z = factor.z().iter().map(|z| g.signum() * z).collect();
            let (rss, rows) = (factor.rss(), factor.rows());
            let own = QrFactor::from_parts(set.labels().to_vec(), r, z, rss, rows)?;
            whole.merge(&own.scaled(self.weights[effort]))?;
        }
        Ok(EffortContributions::of(&whole))
    }
}

/// The statistics of the residuals of base parameters and gains, in SI.
///
/// - `means`: those of the measured efforts, in their own units;
/// - `regressor`: which of a sample's regressors predicts the efforts.
pub(super) fn residual_statistics<M, S>(
    rows: &mut Rows<'_, M, S>,
    (x, gains): (&[f64], &[f64]),
    means: &[f64],
    options: &GainOptions,
    regressor: for<'s> fn(&Sample<'s>) -> &'s [f64],
) -> Result<Residuals, GainError>
where
    M: BaseModel<f64> + ?Sized,
    S: Source + ?Sized,
    S::Error: Into<DataError>,
{
    let means: Vec<f64> = means.iter().zip(gains).map(|(m, k)| m * k).collect();
    let mut errors = Residuals::new(&rows.efforts, &means, options.lags);
    let mut fitted = vec![0.0; gains.len()];
    rows.visit(&mut |sample| {
        if !sample.follows {
            errors.interrupt();
        }
        fitted.fill(0.0);
        add_product(&mut fitted, regressor(sample), x);
        let used: Vec<bool> = sample.weights.iter().map(|w| *w > 0.0).collect();
        let pairs = sample.measured.iter().zip(gains);
        let measured: Vec<f64> = pairs.map(|(i, k)| i * k).collect();
        errors.push_used(&measured, &fitted, &used)
    })?;
    Ok(errors)
}
