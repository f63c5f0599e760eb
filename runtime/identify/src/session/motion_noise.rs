//! What noise of the measured motion does to parameters: errors in variables.
//!
//! Least squares takes the regressor as exact. Noise of the positions makes its columns larger than
//! those of the motion and their parameters too small, which no residual reveals. Simulation and
//! extrapolation (Cook and Stefanski, 1994) show by how much: noise that is like the log's own is added
//! to the positions, and subtracted from them. The mean of both normal equations differs from those
//! without it by the part of the noise, which is proportional to its variance: without that part the
//! equations are those of the motion (Fuller, 1987, Measurement Error Models).

use nalgebra::linalg::SymmetricEigen;
use nalgebra::{DMatrix, DVector};
use regen_runtime::BaseModel;

use crate::data::{DataError, Logs, NoiseLevels};
use crate::estimate::{EstimateError, QrFactor};
use crate::friction::observe_linear_friction;
use crate::identify::observe_weighed;
use crate::signals::Method;
use crate::states::{Filtering, Source, StateSample};

use super::Session;

/// The added noise over that of the log.
const SCALE: f64 = 0.5;
/// Where noise is a larger part of what determines a combination of parameters, it counts as this part:
/// the size of the noise is known to a few percent.
const MAX_NOISE_PART: f64 = 0.95;
/// The same for the correction of the values: a larger one is not known well enough.
const MAX_CORRECTED_PART: f64 = 0.5;
/// Biases of combinations of parameters below this part of their deviations are not told apart.
const SMALL: f64 = 0.05;
/// A correction is at most as large as what it corrects, or its deviation: few equations give larger ones by
/// chance.
const FURTHEST: f64 = 1.0;

/// Logs to whose motion noise is added, with the rests of the motion without it: other equations that are
/// left out would move the parameters by more than the noise does.
pub(super) struct NoisyLogs<'m, M: ?Sized> {
    /// The logs without added noise.
    plain: Logs<'m, M>,
    logs: Logs<'m, M>,
    /// For each log, the standard deviations of the noise of its columns of motion.
    deviations: Vec<Vec<f64>>,
    /// For each state of a pass without noise its time, s, and whether each coordinate rests.
    rests: Vec<(f64, Vec<bool>)>,
    are_known: bool,
}

impl<'m, M: BaseModel<f64> + ?Sized> NoisyLogs<'m, M> {
    /// Logs in memory, without added noise as yet.
    ///
    /// - `levels`: the noise levels of the columns of motion of each log;
    /// - `cutoff`: the frequency up to which the equations keep noise, Hz.
    pub(super) fn new(logs: &Logs<'m, M>, levels: &[Vec<NoiseLevels>], cutoff: f64) -> Self {
        let durations = logs.durations();
        let deviations = durations.iter().zip(levels).map(|((step, _), levels)| {
            let deviation = |own: &NoiseLevels| (own.density(cutoff) / step).sqrt();
            levels.iter().map(deviation).collect()
        });
        Self {
            deviations: deviations.collect(),
            plain: logs.disturbed(0.0, &[]),
            logs: logs.disturbed(0.0, &[]),
            rests: Vec::new(),
            are_known: false,
        }
    }

    /// Logs as they are read, as far as they fit into memory, thinned as far as their filter allows; `None`
    /// where no motion is differentiated.
    ///
    /// - `decimates`: whether equations are thinned too.
    ///
    /// # Errors
    /// When a log cannot be read.
    fn of_read(logs: &Logs<'m, M>, decimates: bool) -> Result<Option<Self>, DataError> {
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
        let (cutoff, [every, mut decimation]) = match method {
            Method::Butterworth { cutoff, .. } => (cutoff, rates(1.0 / step, cutoff)),
            Method::Local { half_width } => (0.5 / half_width, [1, 1]),
            _ => (OF_DIFFERENCES / step, [1, 1]),
        };
        if !decimates {
            decimation = 1;
        }
        let thinned = kept.thinned(method, every, decimation)?;
        Ok(Some(Self::new(&thinned, &kept.noise_levels(), cutoff)))
    }

    /// Adds the noise times `scale` to the motion as it was logged.
    fn disturb(&mut self, scale: f64) {
        self.logs = self.plain.disturbed(scale, &self.deviations);
    }

    /// What noise of the motion biases of the least-squares parameters.
    ///
    /// - `without`: the weighted factor of the logs without added noise, where it is known;
    /// - `covariance`: that of the parameters, n x n;
    /// - `factor`: the factor of logs with the same weights.
    ///
    /// # Errors
    /// When `factor` gives one: the noisy logs cannot be read.
    pub(super) fn bias(
        mut self,
        without: Option<&QrFactor>,
        covariance: &[f64],
        mut factor: impl FnMut(&mut Self) -> Result<QrFactor, DataError>,
    ) -> Result<MotionBias, DataError> {
        let without = match without {
            Some(known) => known.clone(),
            None => factor(&mut self)?,
        };
        self.disturb(SCALE);
        let added = factor(&mut self)?;
        self.disturb(-SCALE);
        let subtracted = factor(&mut self)?;
        MotionBias::new(&without, [&added, &subtracted], covariance)
    }
}

/// By how much noise of the motion biases the values of any fit to logs, to the first order of its
/// variance; `None` where no motion is differentiated.
///
/// - `fit`: the values of the fit to all of them.
///
/// # Errors
/// When a log cannot be read, and those of `fit`.
pub(super) fn bias_of_fit<'m, M: BaseModel<f64> + ?Sized, E: From<DataError>>(
    logs: &[&Logs<'m, M>],
    mut fit: impl FnMut(&mut [NoisyLogs<'m, M>]) -> Result<Vec<f64>, E>,
) -> Result<Option<Vec<f64>>, E> {
    let mut noisy = Vec::new();
    for own in logs {
        match NoisyLogs::of_read(own, true)? {
            Some(found) => noisy.push(found),
            None => return Ok(None),
        }
    }
    let mut with = |scale: f64| {
        for own in &mut noisy {
            own.disturb(scale);
        }
        fit(&mut noisy)
    };
    let (without, added, subtracted) = (with(0.0)?, with(SCALE)?, with(-SCALE)?);
    let pairs = added.iter().zip(&subtracted).zip(&without);
    let bias = pairs.map(|((a, b), x)| (0.5 * (a + b) - x) / (SCALE * SCALE));
    Ok(Some(bias.collect()))
}

/// What noise of the motion biases of least-squares parameters.
pub(super) struct MotionBias {
    /// By how much it may have moved them, SI: independent changes of all of them, n values each.
    pub(super) changes: Vec<Vec<f64>>,
    /// What is to be subtracted from them, SI: as much, but less where most of what determines a
    /// combination of them is noise.
    pub(super) correction: Vec<f64>,
    /// R without the part of noise: a matrix S with `S^T S = W^T W` less that part, n x n, column-major.
    pub(super) signal: Vec<f64>,
}

/// By how much independent changes may have moved each of n parameters together.
pub(super) fn size_of(changes: &[Vec<f64>], n: usize) -> Vec<f64> {
    let size = |k: usize| {
        let parts = changes.iter().filter_map(|change| change.get(k));
        parts.map(|x| x * x).sum::<f64>().sqrt()
    };
    (0..n).map(size).collect()
}

impl MotionBias {
    /// From the weighted factor of a log, those with noise that was added and subtracted, and the covariance
    /// of the parameters.
    ///
    /// Where most of what determines a combination of parameters is noise, its value is by chance: the value
    /// without noise is that over the rest of the part, and its deviation grows with it.
    fn new(
        without: &QrFactor,
        noisy: [&QrFactor; 2],
        covariance: &[f64],
    ) -> Result<Self, DataError> {
        // the part of a log that noise is added to may determine less than all of it
        without.solve()?;
        let n = without.columns();
        let square = |own: &QrFactor| DMatrix::from_column_slice(n, n, own.r());
        let right = |own: &QrFactor| DVector::from_column_slice(own.z());
        let r = square(without);
        let (gram, moment) = (r.tr_mul(&r), r.tr_mul(&right(without)));
        let mut noise = (-&gram, -&moment);
        for own in noisy {
            let r = square(own);
            noise.0 += 0.5 * r.tr_mul(&r);
            noise.1 += 0.5 * r.tr_mul(&right(own));
        }
        // with R^T R = W^T W: the part of noise in R^-T W^T W R^-1 = 1 and in R^-T W^T tau = z
        let undetermined = || EstimateError::NoConvergence;
        let transposed = r.transpose();
        let solve = |own: &DMatrix<f64>| transposed.solve_lower_triangular(own);
        let half = solve(&noise.0).ok_or_else(undetermined)?.transpose();
        let part = solve(&half).ok_or_else(undetermined)? / (SCALE * SCALE);
        let moment = transposed.solve_lower_triangular(&noise.1);
        let moment = moment.ok_or_else(undetermined)? / (SCALE * SCALE);
        let part = 0.5 * (&part + part.transpose());
        if part.iter().chain(moment.iter()).any(|x| !x.is_finite()) {
            return Err(undetermined().into());
        }
        let eigen = SymmetricEigen::new(part);
        let z = right(without);
        let along = eigen.eigenvectors.tr_mul(&(&z - moment));
        let measured = eigen.eigenvectors.tr_mul(&z);
        let known = DMatrix::from_iterator(
            n,
            n,
            covariance
                .iter()
                .copied()
                .chain(core::iter::repeat(0.0))
                .take(n * n),
        );
        let turned = eigen.eigenvectors.tr_mul(&r);
        let deviations = &turned * known * turned.transpose();
        // the parameters for a right side along the eigenvectors
        let moved = |along: &DVector<f64>| -> Result<Vec<f64>, DataError> {
            let right = &eigen.eigenvectors * along;
            let moved = r.solve_upper_triangular(&right).ok_or_else(undetermined)?;
            Ok(moved.iter().copied().collect())
        };
        let mut correction = DVector::zeros(n);
        let mut small = DVector::zeros(n);
        let mut changes = Vec::new();
        for (k, part) in eigen.eigenvalues.iter().enumerate() {
            let (x, measured) = (along[k], measured[k]);
            let without_noise = |most: f64| measured - x / (1.0 - part.min(most));
            // a variance that is not known is that of white residuals
            let variance = Some(deviations[(k, k)]).filter(|own| own.is_finite() && *own > 0.0);
            let deviation = variance.unwrap_or(1.0).sqrt();
            let bound = FURTHEST * measured.abs().max(deviation);
            correction[k] = without_noise(MAX_CORRECTED_PART).clamp(-bound, bound);
            let bias = without_noise(MAX_NOISE_PART);
            let most = part.abs().min(MAX_NOISE_PART);
            let size = libm::hypot(bias, deviation * most / (1.0 - most));
            if size < SMALL * deviation {
                small[k] = bias;
            } else {
                let mut own = DVector::zeros(n);
                own[k] = size;
                changes.push(moved(&own)?);
            }
        }
        changes.push(moved(&small)?);
        let correction = moved(&correction)?;
        let mut signal = eigen.eigenvectors.tr_mul(&r);
        for (mut row, part) in signal.row_iter_mut().zip(eigen.eigenvalues.iter()) {
            row *= (1.0 - part).max(0.0).sqrt();
        }
        Ok(Self {
            changes,
            correction,
            signal: signal.as_slice().to_vec(),
        })
    }
}

impl<M: BaseModel<f64> + ?Sized> Source for NoisyLogs<'_, M> {
    type Error = DataError;

    fn effort_densities(&self) -> Result<Vec<f64>, DataError> {
        self.logs.effort_densities()
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError> {
        let Self {
            logs,
            rests,
            are_known,
            ..
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

/// The factor of logs with given weights of the efforts.
///
/// - `static_friction`: see [`Identified::static_friction`](crate::identify::Identified), that of the estimate;
/// - `with_friction`: whether joints with nonlinear friction have columns of linear friction, behind the
///   base parameters.
///
/// # Errors
/// When the logs cannot be read.
pub(super) fn weighted<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    (weights, static_friction): (&[f64], &[f64]),
    with_friction: bool,
    logs: &mut NoisyLogs<'_, M>,
) -> Result<QrFactor, DataError> {
    let set = if with_friction {
        observe_linear_friction(session.model, logs, static_friction)?
    } else {
        observe_weighed(session.model, session.kind, logs, static_friction)?
    };
    Ok(set.combined(weights)?)
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
/// - `weights`, `static_friction`: those of the efforts, see [`weighted`]; `covariance`: that of the parameters, n x n;
/// - `with_friction`: whether joints with nonlinear friction have linear friction in the fit.
///
/// # Errors
/// When a log cannot be read.
pub(super) fn motion_bias<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &Logs<'_, M>,
    (weights, static_friction): (&[f64], &[f64]),
    covariance: &[f64],
    with_friction: bool,
) -> Result<Option<MotionBias>, DataError> {
    let given = (weights, static_friction);
    let factor = |logs: &mut NoisyLogs<'_, M>| weighted(session, given, with_friction, logs);
    // few equations determine the parameters only with all of them
    for decimates in [true, false] {
        let noisy = NoisyLogs::of_read(logs, decimates);
        match noisy.and_then(|own| {
            own.map(|own| own.bias(None, covariance, factor))
                .transpose()
        }) {
            Err(error) if is_undetermined(&error) => {}
            other => return other,
        }
    }
    Ok(None)
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
                    | EstimateError::NoEfforts
                    | EstimateError::Signal(_)
            )
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// The factor of rows `[x, y]` with efforts `2 x + y`, both columns with these standard deviations.
    fn factor(deviations: [f64; 2]) -> QrFactor {
        let labels = ["a", "b"].map(str::to_owned).to_vec();
        let mut factor = QrFactor::new(labels);
        for k in 0..400 {
            let (x, y) = if k % 2 == 0 { (1.0, 1.0) } else { (1.0, -1.0) };
            // the efforts are those of the motion, whose deviations are 1 and 0
            let row = [x * deviations[0], y * deviations[1]];
            factor.push_block(&row, &[2.0 * x]).unwrap();
        }
        factor
    }

    #[test]
    fn a_combination_that_noise_determines_has_the_deviation_that_noise_leaves() {
        // the second column is noise alone, and its value is zero by chance
        let without = factor([1.0, 0.1]);
        let noisy = factor([1.0, 0.1 * (1.0 + SCALE * SCALE).sqrt()]);
        let covariance = [1e-6, 0.0, 0.0, 0.04];
        let found = MotionBias::new(&without, [&noisy, &noisy], &covariance).unwrap();
        let size = size_of(&found.changes, 2);
        assert!(size[0] < 1e-9, "{size:?}");
        let expected = 0.2 * MAX_NOISE_PART / (1.0 - MAX_NOISE_PART);
        assert!(
            (size[1] / expected - 1.0).abs() < 1e-6,
            "{size:?} {expected}"
        );
        assert!(found.correction.iter().all(|x| x.abs() < 1e-9));
    }

    #[test]
    fn a_known_part_of_noise_is_taken_out_of_the_value() {
        // a third of the first column's square is noise
        let without = factor([1.5_f64.sqrt(), 1.0]);
        let noisy = factor([(1.5 + 0.5 * SCALE * SCALE).sqrt(), 1.0]);
        let covariance = [1e-6, 0.0, 0.0, 1e-6];
        let found = MotionBias::new(&without, [&noisy, &noisy], &covariance).unwrap();
        let biased = without.solve().unwrap();
        let scale = 1.5_f64.sqrt();
        // the efforts do not grow with the noise: the moment is that of the motion
        let part = 1.0 / 3.0;
        let moment = 1.0 - ((1.5 + 0.5 * SCALE * SCALE).sqrt() / scale - 1.0) / (SCALE * SCALE);
        let expected = biased[0] - biased[0] * moment / (1.0 - part);
        assert!(
            (found.correction[0] - expected).abs() < 1e-9,
            "{:?} {expected}",
            found.correction
        );
        assert!(found.correction[1].abs() < 1e-9);
    }

    #[test]
    fn the_noise_that_is_added_is_subtracted_too() {
        use crate::suspect::swings_for_tests::{swings, written};
        let model = swings(false);
        let run = written("noise", 300, 0.0, |_| true);
        let logs = Logs::open(
            &model,
            std::slice::from_ref(&run.0),
            &crate::data::Settings::default(),
        );
        let logs = logs.and_then(|own| own.in_memory(300)).unwrap();
        let mut noisy = NoisyLogs::new(&logs, &[Vec::new()], 10.0);
        noisy.deviations = vec![vec![1e-2; 3]];
        let positions = |own: &Logs<'_, _>| own.positions().unwrap()[0].signals.concat();
        let plain = positions(&logs);
        let mut seen = Vec::new();
        let known = factor([1.0, 1.0]);
        let found = noisy.bias(Some(&known), &[0.0; 4], |own| {
            seen.push(positions(&own.logs));
            Ok(known.clone())
        });
        assert!(found.is_ok() && seen.len() == 2);
        let mut largest: f64 = 0.0;
        for (k, x) in plain.iter().enumerate() {
            assert!((0.5 * (seen[0][k] + seen[1][k]) - x).abs() < 1e-12);
            largest = largest.max((seen[0][k] - x).abs());
        }
        assert!(
            (0.5 * SCALE * 1e-2..5.0 * SCALE * 1e-2).contains(&largest),
            "{largest}"
        );
    }
}
