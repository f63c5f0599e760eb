//! Estimates the delays of logged efforts relative to the motion that they belong to.

use nalgebra::DMatrix;
use nalgebra::linalg::SymmetricEigen;
use serde::{Deserialize, Serialize};

use super::equation_builder::Equations;
use super::passes::predictions;
use crate::estimate::{
    Autocorrelated, EffortNoise, EstimateError, QrFactor, RowBlock, bartlett_stretches,
    inverse_gram, quantile,
};

/// The delay of one effort.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Delay {
    /// The effort's name.
    pub effort: String,
    /// The time by which the effort is logged after the motion that it belongs to, s; negative if
    /// it is logged before.
    pub seconds: f64,
    /// The standard deviation of the delay, s; it accounts for the residuals' correlation in time.
    pub sigma: f64,
    /// The degrees of freedom of Student's distribution with this standard deviation: the number of
    /// independent stretches of the log that it is computed from.
    pub degrees_of_freedom: f64,
    /// The delay in slower motion, s, found with half the cutoff, or that away from reversals of friction, where it
    /// contradicts this one: it is less than half of it, or away from reversals another one, beyond their errors. An
    /// effort that is logged late is late at every frequency, and friction changes its sign at an instant that is not
    /// known to a fraction of a sample. One that only seems so, because a controller answers noise of the measured
    /// positions or the model does not explain the effort, is not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slower: Option<f64>,
}

/// How many standard deviations of both are between two delays that contradict each other.
const CONTRADICTION_DEVIATIONS: f64 = 2.0;

/// A delay differs from zero if one without it would be as large in one log of two thousand: a log has a
/// delay of each effort to be mistaken about.
const STATED_LEVEL: f64 = 0.9995;
/// The number of standard deviations from which on a delay is corrected where that is asked for. Who asks
/// expects one, so that the degrees of freedom of a short log do not count.
const CORRECTED_DEVIATIONS: f64 = 3.0;

/// Equations of less weight are beside a reversal or a gap.
const WHOLE_WEIGHT: f64 = 0.95;

impl Delay {
    /// Whether the delay differs from zero, see [`is_beyond_error`](Self::is_beyond_error), and slower
    /// motion does not contradict it.
    pub fn is_significant(&self) -> bool {
        self.is_beyond_error() && self.slower.is_none()
    }

    /// Whether the delay, as it was found, differs from zero by more than chance gives in one of two
    /// thousand: 3.5 standard deviations if many independent stretches of the log determine it.
    pub fn is_beyond_error(&self) -> bool {
        self.differs_from(0.0)
    }

    /// Whether the delay differs from this one (s) by more than chance gives in one of two thousand.
    pub fn differs_from(&self, seconds: f64) -> bool {
        let largest = quantile(self.degrees_of_freedom, STATED_LEVEL) * self.sigma;
        (self.seconds - seconds).abs() > largest
    }

    /// Whether the delay is corrected where that is asked for: it is beyond three standard deviations, and
    /// slower motion does not contradict it.
    pub fn is_worth_correcting(&self) -> bool {
        self.may_be_more_than_chance() && self.slower.is_none()
    }

    fn may_be_more_than_chance(&self) -> bool {
        self.seconds.abs() > CORRECTED_DEVIATIONS * self.sigma
    }

    /// Compares the delay with that of slower motion.
    fn compare(&mut self, slower: &Self) {
        let contradicts = self.is_contradicted_by(slower);
        self.slower = (self.may_be_more_than_chance() && contradicts).then_some(slower.seconds);
    }

    /// Compares the delay with that away from reversals.
    fn compare_away(&mut self, away: &Self) {
        let error = CONTRADICTION_DEVIATIONS * self.sigma.hypot(away.sigma);
        let apart = (self.seconds - away.seconds).abs();
        if self.is_worth_correcting() && apart > error.max(0.5 * self.seconds.abs()) {
            self.slower = Some(away.seconds);
        }
    }

    /// Whether another estimate of the delay is less than half as long, by more than both deviations explain.
    pub(crate) fn is_contradicted_by(&self, other: &Self) -> bool {
        let (all, left) = (self.seconds.abs(), other.seconds * self.seconds.signum());
        let error = self.sigma.hypot(other.sigma);
        left < 0.5 * all && all - left > CONTRADICTION_DEVIATIONS * error
    }
}

/// The delays of all efforts, one by one and in common.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Delays {
    /// The delay of each effort.
    pub efforts: Vec<Delay>,
    /// The common delay of all efforts that fits best; `None` if no effort determines a delay.
    pub common: Option<Delay>,
    /// By how much the errors of the delays move the parameters, SI: independent changes of all of them.
    #[serde(skip)]
    pub changes: Vec<Vec<f64>>,
    /// The same of the error of the common delay, where all efforts are as late.
    #[serde(skip)]
    pub common_change: Vec<f64>,
    /// By how much a second of the delay of each effort moves the parameters, SI.
    #[serde(skip)]
    pub slopes: Vec<Vec<f64>>,
}

impl Delays {
    /// Whether any delay may be more than chance.
    pub(super) fn may_be_more_than_chance(&self) -> bool {
        let mut all = self.efforts.iter().chain(&self.common);
        all.any(Delay::may_be_more_than_chance)
    }

    /// Whether any delay is more than chance.
    pub fn are_significant(&self) -> bool {
        let mut all = self.efforts.iter().chain(&self.common);
        all.any(Delay::is_significant)
    }

    /// By how much the delays that the equations still have move the parameters, SI: the significant ones of
    /// efforts, and of the others the common one, less what chance gives; none where delays are not known.
    ///
    /// - `each`: whether the delays of the others count as they are: where one was corrected, the others are no
    ///   less likely.
    pub fn left_change(&self, each: bool) -> Vec<f64> {
        let beyond = |own: &Delay| {
            let square = own.seconds * own.seconds - own.sigma * own.sigma;
            square.max(0.0).sqrt().copysign(own.seconds)
        };
        let common = self.common.as_ref().filter(|own| own.slower.is_none());
        let common = common.map_or(0.0, beyond);
        let mut change = Vec::new();
        for (own, slopes) in self.efforts.iter().zip(&self.slopes) {
            let seconds = if each || own.is_significant() {
                own.seconds
            } else {
                common
            };
            change.resize(slopes.len(), 0.0);
            for (sum, slope) in change.iter_mut().zip(slopes) {
                *sum += slope * seconds;
            }
        }
        change
    }

    /// Compares each delay with that of slower motion. Where the common one is contradicted, so is every
    /// effort's on the same side that shrinks too, for one cause acts on all.
    pub(super) fn compare(&mut self, slower: &Self) {
        if let (Some(own), Some(other)) = (&mut self.common, &slower.common) {
            own.compare(other);
        }
        let doubted = self.common.iter().filter(|common| common.slower.is_some());
        let doubted = doubted.map(|common| common.seconds.signum()).next();
        for own in &mut self.efforts {
            let same = |other: &&Delay| other.effort == own.effort;
            if let Some(other) = slower.efforts.iter().find(same) {
                own.compare(other);
                let side = own.seconds.signum();
                let shrinks = side * other.seconds < own.seconds.abs();
                if own.is_worth_correcting() && shrinks && doubted == Some(side) {
                    own.slower = Some(other.seconds);
                }
            }
        }
    }

    /// Compares each delay with that away from reversals. Where the common one is contradicted, so is every effort's,
    /// for one cause acts on all.
    pub(super) fn compare_away(&mut self, away: &Self) {
        if let (Some(own), Some(other)) = (&mut self.common, &away.common) {
            let before = own.slower;
            own.compare_away(other);
            if own.slower != before {
                for (own, other) in self.efforts.iter_mut().zip(&away.efforts) {
                    own.slower.get_or_insert(other.seconds);
                }
            }
        }
        for (own, other) in self.efforts.iter_mut().zip(&away.efforts) {
            own.compare_away(other);
        }
    }
}

/// Estimates the delays together with the parameters: an effort that is logged late by d is
/// `tau(t - d) = tau(t) - d dtau/dt` to first order, so minus the rate of the predicted effort is
/// an additional column of the regressor. The first pass over the equations reduces these columns.
pub(super) struct DelayFit<'a> {
    names: &'a [String],
    weights: &'a [f64],
    window: RateWindow<'a>,
    factor: QrFactor,
    block: RowBlock,
}

/// The second pass over the equations, which gives the standard deviations of the delays.
pub(super) struct DelayScores<'a> {
    names: &'a [String],
    weights: &'a [f64],
    window: RateWindow<'a>,
    fit: QrFactor,
    /// The parameters, then the delays.
    extended: Vec<f64>,
    /// The number of parameters.
    parameters: usize,
    scores: Autocorrelated,
    /// See [`EffortNoise::levels`].
    levels: Vec<f64>,
    /// The number of samples in which the residuals are correlated.
    bandwidth: usize,
    /// The number of samples with an equation that is used.
    samples: usize,
    score: Vec<f64>,
    fitted: Vec<f64>,
}

impl<'a> DelayFit<'a> {
    /// Starts the first pass.
    ///
    /// - `labels`, `values`: the base parameters, with which the efforts are predicted;
    /// - `names`, `weights`: those of the efforts.
    pub(super) fn new(
        labels: &[String],
        values: &'a [f64],
        names: &'a [String],
        weights: &'a [f64],
    ) -> Self {
        let mut all = labels.to_vec();
        all.extend(names.iter().map(|name| format!("delay {name}")));
        Self {
            names,
            weights,
            window: RateWindow::new(values),
            block: RowBlock::new(all.len()),
            factor: QrFactor::new(all),
        }
    }

    /// Leaves out equations of less weight, and those beside them.
    pub(super) fn away_from_reversals(mut self) -> Self {
        self.window.only_whole = true;
        self
    }

    /// Takes the equations of a sample.
    ///
    /// # Errors
    /// When a length does not fit.
    pub(super) fn push(&mut self, equations: &Equations<'_>) -> Result<(), EstimateError> {
        let efforts = self.names.len();
        let Some((found, rates)) = self.window.push(equations) else {
            return Ok(());
        };
        for (e, (tau, own)) in found.tau.iter().zip(found.weights).enumerate() {
            let weight = own * self.weights.get(e).copied().unwrap_or(1.0);
            if weight > 0.0 {
                let row = found
                    .w
                    .chunks(found.tau.len())
                    .map(|column| column[e] * weight);
                let delays = (0..efforts).map(|k| if k == e { -rates[e] * weight } else { 0.0 });
                self.block.push(row.chain(delays), tau * weight);
                if self.block.is_full() {
                    self.block.flush(&mut self.factor)?;
                }
            }
        }
        Ok(())
    }

    /// Ends the first pass; `None` where the data do not determine the delays.
    ///
    /// - `bandwidth`: the number of samples in which the residuals are correlated.
    ///
    /// # Errors
    /// When a length does not fit.
    pub(super) fn finish(
        mut self,
        bandwidth: usize,
    ) -> Result<Option<DelayScores<'a>>, EstimateError> {
        self.block.flush(&mut self.factor)?;
        let Ok(extended) = self.factor.solve() else {
            return Ok(None);
        };
        Ok(Some(DelayScores {
            names: self.names,
            weights: self.weights,
            window: RateWindow {
                only_whole: self.window.only_whole,
                ..RateWindow::new(self.window.values)
            },
            fit: self.factor,
            parameters: self.window.values.len(),
            scores: Autocorrelated::new(extended.len(), bandwidth),
            levels: Vec::new(),
            bandwidth,
            samples: 0,
            score: vec![0.0; extended.len()],
            fitted: Vec::new(),
            extended,
        }))
    }
}

impl DelayScores<'_> {
    /// Takes the equations of a sample again.
    ///
    /// # Errors
    /// When a length does not fit.
    pub(super) fn push(&mut self, equations: &Equations<'_>) -> Result<(), EstimateError> {
        let n = self.parameters;
        let Some((found, rates)) = self.window.push(equations) else {
            return Ok(());
        };
        if !found.follows {
            self.scores.interrupt();
        }
        self.samples += usize::from(found.weights.iter().any(|weight| *weight > 0.0));
        self.score.fill(0.0);
        predictions(&found, &self.extended, &mut self.fitted);
        for (e, (tau, own)) in found.tau.iter().zip(found.weights).enumerate() {
            let weight = own * self.weights.get(e).copied().unwrap_or(1.0);
            let residual = tau - self.fitted[e] + rates[e] * self.extended[n + e];
            let psi = weight * weight * residual;
            let columns = found.w.chunks(found.tau.len());
            for (sum, column) in self.score[..n].iter_mut().zip(columns) {
                *sum += column[e] * psi;
            }
            self.score[n + e] -= rates[e] * psi;
        }
        self.scores.push(&self.score)
    }

    /// Makes no variance smaller than that of white noise of the level that the noise has: few independent equations
    /// tell less of it than of the noise.
    pub(super) fn in_noise(mut self, noise: &EffortNoise) -> Self {
        self.levels = noise.levels();
        self
    }

    /// The time between the samples whose equations came last, s.
    pub(super) fn step(&self) -> f64 {
        self.window.step
    }

    /// The delays; none where their covariance cannot be computed.
    pub(super) fn finish(self) -> Delays {
        let n = self.parameters;
        let extended = self.extended;
        let degrees_of_freedom = bartlett_stretches(self.samples, self.bandwidth);
        let fit = self.fit;
        let Ok(covariance) = self.scores.covariance(&fit) else {
            return Delays::default();
        };
        let size = extended.len();
        let place = |i: usize, j: usize| (n + j) * size + n + i;
        let white = inverse_gram(&fit).unwrap_or_default();
        let growth = |e: usize| {
            let level = self.levels.get(e).zip(white.get(place(e, e)));
            let least = level.map_or(0.0, |(level, own)| level * own);
            let ratio = least / covariance[place(e, e)];
            if ratio.is_finite() {
                ratio.max(1.0).sqrt()
            } else {
                1.0
            }
        };
        let growths: Vec<f64> = (0..self.names.len()).map(growth).collect();
        let entry = |i: usize, j: usize| growths[i] * growths[j] * covariance[place(i, j)];
        let one = |(e, name): (usize, &String)| Delay {
            effort: name.clone(),
            seconds: extended[n + e],
            sigma: entry(e, e).max(0.0).sqrt(),
            degrees_of_freedom,
            slower: None,
        };
        let found: Vec<Delay> = self.names.iter().enumerate().map(one).collect();
        let common = common(&found, &entry);
        let sigma = common.as_ref().map_or(0.0, |own| own.sigma);
        let moved = change_by_delays(&fit, n, &entry, sigma).unwrap_or_default();
        Delays {
            efforts: found,
            common,
            changes: moved.errors,
            common_change: moved.common,
            slopes: moved.slopes,
        }
    }
}

/// By how much delays move the parameters, see [`Delays`].
#[derive(Default)]
struct Moved {
    errors: Vec<Vec<f64>>,
    common: Vec<f64>,
    slopes: Vec<Vec<f64>>,
}

/// By how much the errors of delays move the n parameters: one change for each effort, independent of each
/// other, and that of a common delay with this deviation, s. Least squares without the columns of the delays
/// differs from that with them by `R_11^-1 R_12` times the delays. `None` where R is singular.
fn change_by_delays(
    fit: &QrFactor,
    n: usize,
    covariance: &dyn Fn(usize, usize) -> f64,
    common: f64,
) -> Option<Moved> {
    let size = fit.columns();
    let r = DMatrix::from_column_slice(size, size, fit.r());
    let efforts = size.checked_sub(n)?;
    let own = r.view((0, 0), (n, n)).into_owned();
    let with = r.view((0, n), (n, efforts)).into_owned();
    let slopes = own.solve_upper_triangular(&with)?;
    let errors = DMatrix::from_fn(efforts, efforts, |i, j| {
        0.5 * (covariance(i, j) + covariance(j, i))
    });
    let eigen = SymmetricEigen::new(errors);
    let pairs = eigen
        .eigenvectors
        .column_iter()
        .zip(eigen.eigenvalues.iter());
    let changes = pairs.map(|(direction, variance)| {
        let change = &slopes * direction * variance.max(0.0).sqrt();
        change.iter().copied().collect::<Vec<f64>>()
    });
    let changes: Vec<Vec<f64>> = changes.collect();
    let all = slopes.column_sum() * common;
    let is_finite = changes
        .iter()
        .flatten()
        .chain(all.iter())
        .all(|x| x.is_finite());
    let columns = slopes.column_iter();
    is_finite.then(|| Moved {
        errors: changes,
        common: all.iter().copied().collect(),
        slopes: columns.map(|own| own.iter().copied().collect()).collect(),
    })
}

/// The mean of the delays, each weighted by the inverse of its variance, with the standard
/// deviation that follows from their covariance.
fn common(delays: &[Delay], covariance: &dyn Fn(usize, usize) -> f64) -> Option<Delay> {
    let parts: Vec<f64> = delays
        .iter()
        .map(|d| {
            let part = 1.0 / (d.sigma * d.sigma);
            if part.is_finite() { part } else { 0.0 }
        })
        .collect();
    let whole: f64 = parts.iter().sum();
    if whole <= 0.0 {
        return None;
    }
    let pairs = delays.iter().zip(&parts);
    let seconds = pairs.map(|(d, part)| d.seconds * part).sum::<f64>() / whole;
    let mut variance = 0.0;
    for (i, a) in parts.iter().enumerate() {
        for (j, b) in parts.iter().enumerate() {
            variance += a * b * covariance(i, j);
        }
    }
    Some(Delay {
        effort: "all".to_owned(),
        seconds,
        sigma: variance.max(0.0).sqrt() / whole,
        degrees_of_freedom: delays.first()?.degrees_of_freedom,
        slower: None,
    })
}

/// A copy of a sample's equations, for differences with its neighbours.
#[derive(Default)]
struct BufferedEquations {
    time: f64,
    w: Vec<f64>,
    tau: Vec<f64>,
    weights: Vec<f64>,
    predicted: Vec<f64>,
}

/// Finds the time derivatives of the predicted efforts by central differences, at samples that have
/// neighbours on both sides.
struct RateWindow<'a> {
    /// The parameters with which the efforts are predicted.
    values: &'a [f64],
    before: BufferedEquations,
    at: BufferedEquations,
    /// The number of samples of the present run.
    run: usize,
    /// The predicted efforts two samples before the last one, and the weights of the equations there.
    oldest: Vec<f64>,
    oldest_weights: Vec<f64>,
    /// Whether equations of less weight, and those beside them, are left out.
    only_whole: bool,
    /// The weights of the equations.
    weights: Vec<f64>,
    rates: Vec<f64>,
    /// Half the time between the last neighbours, s.
    step: f64,
    /// Whether the next sample is the first of its run.
    first: bool,
}

impl<'a> RateWindow<'a> {
    fn new(values: &'a [f64]) -> Self {
        Self {
            values,
            before: BufferedEquations::default(),
            at: BufferedEquations::default(),
            run: 0,
            oldest: Vec::new(),
            oldest_weights: Vec::new(),
            only_whole: false,
            weights: Vec::new(),
            rates: Vec::new(),
            step: 0.0,
            first: true,
        }
    }

    /// Takes the next sample; returns the one before it with the rates, if it has neighbours.
    fn push(&mut self, found: &Equations<'_>) -> Option<(Equations<'_>, &[f64])> {
        if !found.follows {
            self.run = 0;
        }
        if found.tau.is_empty() {
            return None;
        }
        // the buffers go round: the oldest one takes the new sample
        let mut next = core::mem::take(&mut self.before);
        core::mem::swap(&mut self.before, &mut self.at);
        core::mem::swap(&mut self.oldest, &mut next.predicted);
        core::mem::swap(&mut self.oldest_weights, &mut next.weights);
        let start = next.time;
        next.fill(found, self.values);
        self.at = next;
        self.run += 1;
        if self.run < 3 {
            self.first = true;
            return None;
        }
        let span = found.time - start;
        self.step = 0.5 * span;
        self.rates.clear();
        let ends = self.at.predicted.iter().zip(&self.oldest);
        self.rates
            .extend(ends.map(|(after, before)| (after - before) / span));
        let own = &self.before;
        let around = self.oldest_weights.iter().zip(&self.at.weights);
        let weights = around.zip(&own.weights).map(|((before, after), weight)| {
            let is_whole = before.min(*after).min(*weight) >= WHOLE_WEIGHT;
            if is_whole || !self.only_whole {
                *weight
            } else {
                0.0
            }
        });
        self.weights.clear();
        self.weights.extend(weights);
        let equations = Equations {
            time: own.time,
            w: &own.w,
            tau: &own.tau,
            weights: &self.weights,
            follows: !core::mem::take(&mut self.first),
            held: &[],
        };
        Some((equations, &self.rates))
    }
}

impl BufferedEquations {
    fn fill(&mut self, found: &Equations<'_>, values: &[f64]) {
        self.time = found.time;
        for (own, given) in [
            (&mut self.w, found.w),
            (&mut self.tau, found.tau),
            (&mut self.weights, found.weights),
        ] {
            own.clear();
            own.extend_from_slice(given);
        }
        predictions(found, values, &mut self.predicted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_independent_stretches_of_a_log_need_a_larger_delay_to_tell_it_from_chance() {
        let is_stated = |deviations: f64, degrees_of_freedom: f64| {
            let delay = Delay {
                effort: "q1".to_owned(),
                seconds: -1e-4 * deviations,
                sigma: 1e-4,
                degrees_of_freedom,
                slower: None,
            };
            delay.is_significant()
        };
        // quantiles of Student's distribution: 7.98 for 5 degrees of freedom, 3.49 for 1000
        assert!(!is_stated(7.9, 5.0) && is_stated(8.0, 5.0));
        assert!(!is_stated(3.4, 1000.0) && is_stated(3.6, 1000.0));
    }

    #[test]
    fn no_delay_is_known_better_than_its_noise_admits() {
        let labels = ["inertia".to_owned()];
        let names = ["q1".to_owned()];
        let rows: Vec<f64> = (0..400).map(|k| libm::sin(0.1 * f64::from(k))).collect();
        let found = |level: f64| {
            let mut fit = DelayFit::new(&labels, &[1.0], &names, &[1.0]);
            let equations = |k: usize| Equations {
                time: 0.01 * k as f64,
                w: &rows[k..=k],
                tau: &rows[k..=k],
                weights: &[1.0],
                follows: k > 0,
                held: &[],
            };
            for k in 0..rows.len() {
                fit.push(&equations(k)).unwrap();
            }
            let mut scores = fit.finish(5).unwrap().unwrap();
            let white = inverse_gram(&scores.fit).unwrap();
            scores.levels = vec![level];
            for k in 0..rows.len() {
                scores.push(&equations(k)).unwrap();
            }
            (scores.finish().efforts[0].sigma, white[3].sqrt())
        };
        // the effort is explained without an error
        let (without, _) = found(0.0);
        assert!(without < 1e-6, "{without}");
        let (with, white) = found(0.04);
        assert!((with / (0.2 * white) - 1.0).abs() < 1e-9, "{with} {white}");
    }

    #[test]
    fn the_common_delay_is_the_weighted_mean_with_the_deviation_of_their_covariance() {
        let one = |seconds: f64, sigma: f64| Delay {
            effort: String::new(),
            seconds,
            sigma,
            degrees_of_freedom: 9.0,
            slower: None,
        };
        let both = [one(1e-3, 1e-4), one(4e-3, 2e-4)];
        let covariance = |i: usize, j: usize| [[1e-8, 1e-8], [1e-8, 4e-8]][i][j];
        let found = common(&both, &covariance);
        // weights of 4 and 1
        let sigma = ((16.0 + 8.0 + 4.0) * 1e-8_f64).sqrt() / 5.0;
        assert!(found.is_some_and(|own| {
            (own.seconds - 1.6e-3).abs() < 1e-12 && (own.sigma - sigma).abs() < 1e-12
        }));
        assert!(common(&[one(1.0, f64::INFINITY)], &|_, _| 1.0).is_none());
    }

    #[test]
    fn a_delay_is_beyond_chance_by_its_deviations_and_beyond_error_where_it_matters() {
        let own = |deviations: f64| Delay {
            effort: String::new(),
            seconds: -1e-4 * deviations,
            sigma: 1e-4,
            degrees_of_freedom: 100.0,
            slower: None,
        };
        let most = CORRECTED_DEVIATIONS;
        assert!(own(1.01 * most).may_be_more_than_chance());
        assert!(!own(0.99 * most).may_be_more_than_chance());
    }

    #[test]
    fn slower_motion_contradicts_a_delay_of_which_it_has_less_than_half() {
        let own = |seconds: f64| Delay {
            effort: "q1".to_owned(),
            seconds,
            sigma: 1e-4,
            degrees_of_freedom: 100.0,
            slower: None,
        };
        let all = |seconds: f64| Delays {
            efforts: vec![own(seconds)],
            ..Delays::default()
        };
        let slower = |seconds: f64, of_slower: f64| {
            let mut fast = all(seconds);
            fast.compare(&all(of_slower));
            fast.efforts[0].slower
        };
        assert_eq!(slower(2e-3, 5e-4), Some(5e-4));
        assert_eq!(slower(-2e-3, 1e-3), Some(1e-3));
        assert_eq!(slower(2e-3, 1.5e-3), None);
        // less than its error is none that could be contradicted
        assert_eq!(slower(2e-4, -2e-3), None);
    }

    #[test]
    fn delays_away_from_reversals_are_those_of_equations_beside_no_lighter_one() {
        let told = |only_whole: bool| {
            let mut window = RateWindow {
                only_whole,
                ..RateWindow::new(&[1.0])
            };
            let mut told = Vec::new();
            for (time, weight) in [1.0, 1.0, 0.5, 1.0, 0.97, 1.0].into_iter().enumerate() {
                let equations = Equations {
                    time: time as f64,
                    w: &[1.0],
                    tau: &[0.0],
                    weights: &[weight],
                    follows: true,
                    held: &[],
                };
                told.extend(window.push(&equations).map(|own| own.0.weights[0]));
            }
            told
        };
        assert_eq!(told(true), [0.0, 0.0, 0.0, 0.97]);
        assert_eq!(told(false), [1.0, 0.5, 1.0, 0.97]);
    }

    #[test]
    fn a_delay_that_is_another_one_away_from_reversals_is_contradicted() {
        let own = |seconds: f64, sigma: f64| Delay {
            effort: "q1".to_owned(),
            seconds,
            sigma,
            degrees_of_freedom: 100.0,
            slower: None,
        };
        let contradicted = |seconds: f64, away: f64, sigma: f64| {
            let mut all = Delays {
                efforts: vec![own(seconds, 1e-4)],
                common: Some(own(seconds, 1e-4)),
                ..Delays::default()
            };
            all.compare_away(&Delays {
                efforts: vec![own(away, sigma)],
                common: Some(own(away, sigma)),
                ..Delays::default()
            });
            assert_eq!(all.efforts[0].slower, all.common.and_then(|own| own.slower));
            all.efforts[0].slower
        };
        assert_eq!(contradicted(-3e-3, -1e-3, 1e-4), Some(-1e-3));
        assert_eq!(contradicted(-3e-3, -2e-2, 2e-3), Some(-2e-2));
        assert_eq!(contradicted(-3e-3, -2e-3, 1e-4), None);
        // what is not known contradicts nothing
        assert_eq!(contradicted(-3e-3, -1e-3, 2e-3), None);
    }

    #[test]
    fn delays_move_parameters_by_what_is_shared_with_their_columns() {
        let rows: Vec<[f64; 2]> = (0..40)
            .map(|k| {
                let (s, c) = (0.3 * f64::from(k)).sin_cos();
                [s, c + 0.5 * s]
            })
            .collect();
        let delay = 0.3;
        let of = |columns: usize| {
            let labels = (0..columns).map(|k| k.to_string()).collect();
            let mut factor = QrFactor::new(labels);
            for row in &rows {
                let tau = 2.0 * row[0] + delay * row[1];
                assert!(factor.push_block(&row[..columns], &[tau]).is_ok());
            }
            factor
        };
        let without = of(1).solve().unwrap_or_default()[0];
        let found = change_by_delays(&of(2), 1, &|_, _| 0.04, 0.5).unwrap_or_default();
        let slope = (without - 2.0) / delay;
        assert!((found.slopes[0][0] - slope).abs() < 1e-9);
        assert!((found.errors[0][0].abs() - 0.2 * slope.abs()).abs() < 1e-9);
        assert!((found.common[0] - 0.5 * slope).abs() < 1e-9);
    }
}
