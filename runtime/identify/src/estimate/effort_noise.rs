//! The noise of each effort's equations, from their residuals and from what the filter before them makes of white
//! noise.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Autoregression, EffortError, EstimateError, ORDER, Residuals, Scores};

/// What the filter makes of white noise of the efforts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FilteredNoise {
    /// One of so many consecutive equations says of the noise what all of them say: the others are as good as
    /// interpolated.
    every: usize,
    /// The white noise behind the filter at every so many equations, with variance 1.
    shape: Autoregression,
}

/// Filters whose noise has memories that differ by less than this part are the same.
const MAX_DIFFERENCE: f64 = 0.01;

impl FilteredNoise {
    /// Without a filter.
    pub(crate) fn unfiltered() -> Self {
        Self {
            every: 1,
            shape: Autoregression::white(1.0),
        }
    }

    /// - `autocorrelation`: of what the filter makes of white noise, at every so many equations, lags 1, 2, ...
    pub(crate) fn new(every: usize, autocorrelation: &[f64]) -> Self {
        Self {
            every: every.max(1),
            shape: Autoregression::of_filter(autocorrelation),
        }
    }

    /// The number of lags at which the autocorrelation of residuals is needed.
    fn lags(&self) -> usize {
        self.shape.coefficients.len() + ORDER
    }

    /// The number of equations that carry as much information as one independent one.
    pub(crate) fn memory(&self) -> f64 {
        self.every as f64 * self.shape.correlation_length()
    }

    /// Whether two filters do the same, but for rounding of the times between equations.
    pub(crate) fn is_as(&self, other: &Self) -> bool {
        let difference = (self.memory() / other.memory() - 1.0).abs();
        self.every == other.every && difference < MAX_DIFFERENCE
    }

    pub(crate) fn thinning(&self) -> Thinning {
        Thinning {
            every: self.every,
            count: 0,
        }
    }
}

/// Takes one of so many consecutive equations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thinning {
    every: usize,
    count: usize,
}

impl Thinning {
    /// Starts a new stretch: the next equation does not follow the last one in time.
    pub(crate) fn interrupt(&mut self) {
        self.count = 0;
    }

    /// Whether the next equation is taken.
    pub(crate) fn takes_next(&mut self) -> bool {
        let is_taken = self.count.is_multiple_of(self.every);
        self.count += 1;
        is_taken
    }

    /// The weight of an equation that is taken: its square is that of all equations for which it stands.
    pub(crate) fn weight(&self) -> f64 {
        (self.every as f64).sqrt()
    }

    pub(crate) fn every(&self) -> usize {
        self.every
    }
}

/// Collects the weighted residuals of all efforts in order of time.
#[derive(Clone, Debug)]
pub(crate) struct NoiseResiduals {
    filter: FilteredNoise,
    thinning: Thinning,
    residuals: Residuals,
    zeros: Vec<f64>,
}

impl NoiseResiduals {
    pub(crate) fn new(efforts: usize, filter: FilteredNoise) -> Self {
        let zeros = vec![0.0; efforts];
        let names = vec![String::new(); efforts];
        Self {
            residuals: Residuals::new(&names, &zeros, filter.lags()),
            thinning: filter.thinning(),
            filter,
            zeros,
        }
    }

    /// Starts a new run: the next sample does not follow the last one in time.
    pub(crate) fn interrupt(&mut self) {
        self.thinning.interrupt();
        self.residuals.interrupt();
    }

    /// Adds the weighted residuals of a sample, skipping the efforts whose entry in `used` is false.
    ///
    /// # Errors
    /// When a length does not fit.
    pub(crate) fn push(&mut self, psi: &[f64], used: &[bool]) -> Result<(), EstimateError> {
        if !self.thinning.takes_next() {
            return Ok(());
        }
        self.residuals.push_used(psi, &self.zeros, used)
    }

    /// The residuals that were taken.
    pub(crate) fn efforts(&self) -> Vec<EffortError> {
        self.residuals.efforts()
    }

    /// The noise as the residuals show it.
    pub(crate) fn noise(&self) -> EffortNoise {
        let efforts = self.efforts();
        self.noise_with(efforts.iter().map(|own| self.fit(own, &[])))
    }

    /// The noise before a fit took a part of it. Few residuals may be smaller than the noise by chance: where they are,
    /// and chance explains it, the noise is that of the rows.
    ///
    /// - `taken`: for each effort, see [`fit`](Self::fit);
    /// - `white`: for each effort, the variance in one equation of white noise that is as dense, at low frequencies, as
    ///   that of the rows, weighted; none where it is not known.
    pub(crate) fn noise_before_fit(&self, taken: &[Vec<f64>], white: &[f64]) -> EffortNoise {
        let efforts = self.efforts();
        let mut is_raised = false;
        let pairs = efforts.iter().zip(taken).enumerate();
        let models: Vec<Autoregression> = pairs
            .map(|(k, (own, taken))| {
                let model = self.fit(own, taken);
                let independent = own.samples as f64 / model.correlation_length();
                let freedom = independent - taken.first().copied().unwrap_or(0.0);
                let white = white.get(k).copied().unwrap_or(0.0) / self.thinning.every as f64;
                let missing = white / model.level();
                if missing > 1.0 && chance_of_less(freedom, 1.0 / missing) > MIN_CHANCE_OF_LESS {
                    is_raised = true;
                    Autoregression {
                        variance: missing * model.variance,
                        innovation: missing * model.innovation,
                        ..model
                    }
                } else {
                    model
                }
            })
            .collect();
        EffortNoise {
            is_raised,
            ..self.noise_with(models.into_iter())
        }
    }

    fn noise_with(&self, models: impl Iterator<Item = Autoregression>) -> EffortNoise {
        let scale = self.thinning.every as f64;
        let weighted = models.map(|model| Autoregression {
            variance: scale * model.variance,
            innovation: scale * model.innovation,
            ..model
        });
        EffortNoise {
            models: weighted.collect(),
            is_raised: false,
            thinning: self.filter.thinning(),
        }
    }

    /// The noise of an effort, of which the fit took a part: residuals r = (I - H) e of noise with the autocovariance
    /// R have, summed over the equations t, `sum r(t) r(t + k) = N R(k) - sum_l H(l) R(l - k)`. That is exact for k = 0
    /// where all efforts have the same weighted noise, and for noise that is white at the frequencies of the motion.
    ///
    /// - `own`: the errors that are left; `taken`: H(l), l = 0, 1, ...: the sum over t of what the fit takes from the
    ///   residual at t + l for noise at t. None for a fit that takes nothing.
    fn fit(&self, own: &EffortError, taken: &[f64]) -> Autoregression {
        let samples = own.samples.max(1) as f64;
        let left = own.rms * own.rms;
        let fitted = |variance: f64, autocorrelation: &[f64]| {
            let shape = &self.filter.shape;
            shape.fit_behind(variance, autocorrelation, own.samples)
        };
        let mut noise = fitted(left, &own.autocorrelation);
        if taken.is_empty() {
            return noise;
        }
        let first = noise.level();
        let mut level = first;
        for _ in 0..MAX_ROUNDS {
            let lags = own.autocorrelation.len() + taken.len() + 1;
            let covariance = noise.autocovariance(lags);
            // what is more than the limit is not put back
            let limit = (MAX_GROWTH * first / level).min(1.0);
            let part = |lag: usize| {
                let at = |k: usize| covariance.get(k).copied().unwrap_or(0.0);
                let rest = taken.iter().enumerate().skip(1);
                let rest = rest.map(|(l, h)| h * (at(l + lag) + at(l.abs_diff(lag))));
                let own = taken.first().map_or(0.0, |h| h * at(lag));
                limit * (own + rest.sum::<f64>()) / samples
            };
            let variance = left + part(0);
            let correlations = own.autocorrelation.iter().zip(1..);
            let correlations: Vec<f64> = correlations
                .map(|(x, lag)| (x * left + part(lag)) / variance)
                .collect();
            noise = fitted(variance, &correlations);
            let next = noise.level();
            let change = (next - level).abs();
            level = next;
            if change.is_nan() || change <= SETTLED_PART * level {
                break;
            }
        }
        noise
    }
}

/// At most so many times the spectrum of the residuals is taken for that of the noise.
const MAX_GROWTH: f64 = 4.0;
/// The spectrum is known if it changes by less than this part.
const SETTLED_PART: f64 = 1e-3;
const MAX_ROUNDS: usize = 30;

/// The noise of the equations of all efforts.
#[derive(Clone, Debug)]
pub(crate) struct EffortNoise {
    /// One for each effort, of weighted residuals at every so many equations, which stand for all of them.
    models: Vec<Autoregression>,
    /// Whether that of an effort is larger than its residuals show.
    is_raised: bool,
    thinning: Thinning,
}

/// Larger noise than that of the residuals explains them if they are as small as that in more than one of so many cases.
const MIN_CHANCE_OF_LESS: f64 = 0.01;

/// The probability that a variance with these degrees of freedom is less than this part of its expectation.
fn chance_of_less(freedom: f64, part: f64) -> f64 {
    let freedom = freedom.max(1.0);
    ChiSquared::new(freedom).map_or(0.0, |chi| chi.cdf(part * freedom))
}

impl EffortNoise {
    /// Starts to collect the scores of n parameters in this noise.
    pub(crate) fn scores(&self, parameters: usize) -> Scores {
        Scores::new(parameters, &self.models).of_noise(self.thinning, self.is_raised)
    }

    /// For each effort whose noise is white behind the filter, the variance of noise that is white in each of its
    /// weighted equations and as large at the frequencies of the motion; 0 for other noise, of which few coefficients
    /// do not tell what is there: that of a controller that answers differences of positions is far smaller.
    pub(crate) fn levels(&self) -> Vec<f64> {
        let level = |own: &Autoregression| if own.fitted == 0 { own.level() } else { 0.0 };
        self.models.iter().map(level).collect()
    }

    /// The largest number of equations that carry as much information as one independent one.
    pub(crate) fn memory(&self) -> f64 {
        let memory = self.models.iter().map(Autoregression::correlation_length);
        self.thinning.every as f64 * memory.fold(1.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intervals::Random;

    #[test]
    fn noise_is_as_large_at_the_frequencies_of_the_motion_as_before_the_fit() {
        // of white noise of deviation 2, a fit with slow columns takes a tenth, and what is left of it is fast
        let samples = 1000;
        let shape = [1.0, 0.95, 0.85, 0.7, 0.5, 0.3, 0.1];
        let taken: Vec<f64> = shape.iter().map(|x| 100.0 * x).collect();
        let left = 4.0 * (1.0 - 0.1);
        let lags = taken.iter().skip(1);
        let own = EffortError {
            name: String::new(),
            samples,
            relative_absolute: 0.0,
            rms: f64::sqrt(left),
            relative_rms: 0.0,
            largest: 0.0,
            autocorrelation: lags.map(|x| -4.0 * x / 1000.0 / left).collect(),
            whiteness_p_value: 0.0,
        };
        let of_residuals = Autoregression::fit(left, &own.autocorrelation, samples);
        assert!(of_residuals.level() < 2.5, "{of_residuals:?}");
        let residuals = NoiseResiduals::new(1, FilteredNoise::unfiltered());
        let found = residuals.fit(&own, &taken);
        assert!((found.level() - 4.0).abs() < 0.4, "{found:?}");
        assert!((found.variance - 4.0).abs() < 0.2, "{found:?}");
        // a fit that takes nothing changes nothing
        let same = residuals.fit(&own, &[0.0; 7]);
        assert!((same.level() / of_residuals.level() - 1.0).abs() < 1e-9);
    }

    /// White residuals of deviation 1 of so many equations.
    fn residuals(samples: usize) -> NoiseResiduals {
        let mut random = Random(2);
        let mut out = NoiseResiduals::new(1, FilteredNoise::unfiltered());
        let values: Vec<f64> = (0..samples).map(|_| random.normal()).collect();
        let rms = (values.iter().map(|x| x * x).sum::<f64>() / samples as f64).sqrt();
        for value in values {
            out.push(&[value / rms], &[true]).unwrap();
        }
        out
    }

    #[test]
    fn residuals_that_are_small_by_chance_have_the_noise_of_the_rows() {
        let raised = |samples: usize, white: f64| {
            let noise = residuals(samples).noise_before_fit(&[Vec::new()], &[white]);
            (noise.is_raised, noise.levels()[0])
        };
        // with 20 degrees of freedom one variance in a hundred is below 0.41
        let (is_raised, level) = raised(20, 2.0);
        assert!(is_raised && (level - 2.0).abs() < 1e-9, "{level}");
        // residuals contradict larger noise, and smaller noise is not all that is in them
        for (samples, white) in [(20, 3.0), (2000, 2.0), (20, 0.5)] {
            let (is_raised, level) = raised(samples, white);
            assert!(!is_raised && level < 1.5, "{samples} {white} {level}");
        }
        let unknown = residuals(20).noise_before_fit(&[Vec::new()], &[]);
        assert!(!unknown.is_raised);
    }
}
