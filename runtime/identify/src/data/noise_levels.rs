//! The noise of a measured signal at the frequencies beside those of its motion.

/// The number of consecutive means in one difference of the sixth order.
const POINTS: usize = 7;
/// The sum of the squared binomial coefficients of order 6: the variance of such a difference of white
/// noise over that of the noise.
const GAIN: f64 = 924.0;
/// The least number of differences from which a level is computed.
const MIN_DIFFERENCES: usize = 24;
/// Squared differences of more than so many times the one that nine in ten are below are steps of the
/// motion, and count as that many.
const CLIPPED: f64 = 16.0;
/// The density of noise grows by at most this factor from one octave to the next lower one: that of a
/// wandering clock grows by four at most, and the differences of a motion grow by thousands.
const MAX_GROWTH: f64 = 6.0;
/// The middle of the band that differences of means of n rows pass, times n, over the rate of the rows.
const MIDDLE: f64 = 0.35;

/// The variance of white noise that a signal's noise is like in each octave of frequency.
///
/// Differences of the sixth order of the means of 1, 2, 4, ... rows pass the octaves from half the rate
/// of the rows downwards; motion, of low frequency, hardly passes them, until in some octave it exceeds
/// the noise by far. From there on downwards the noise counts as white, as it cannot be seen.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct NoiseLevels {
    /// The time between rows, s.
    step: f64,
    /// For means of 1, 2, 4, ... rows: the density of the noise, unit^2 s: the variance of white noise
    /// times the step of its samples.
    octaves: Vec<f64>,
}

impl NoiseLevels {
    /// The levels of a signal that was sampled evenly, in stretches without gaps.
    pub(crate) fn new(step: f64, stretches: &[Vec<f64>]) -> Self {
        let mut octaves: Vec<f64> = Vec::new();
        let mut means: Vec<Vec<f64>> = stretches.to_vec();
        let mut length = 1.0;
        while let Some(variance) = variance(&means) {
            let density = variance * length * step;
            if octaves
                .last()
                .is_some_and(|last| density > MAX_GROWTH * last)
            {
                break;
            }
            octaves.push(density);
            for list in &mut means {
                *list = list.chunks_exact(2).map(|p| 0.5 * (p[0] + p[1])).collect();
            }
            length *= 2.0;
        }
        Self { step, octaves }
    }

    /// The density of the noise around a frequency in Hz, unit^2 s; that of the next octave with
    /// noise where it cannot be seen.
    pub(crate) fn density(&self, frequency: f64) -> f64 {
        let octave = libm::log2(MIDDLE / (frequency * self.step))
            .floor()
            .max(0.0);
        #[allow(clippy::cast_sign_loss, reason = "it is not negative")]
        let place = (octave as usize).min(self.octaves.len().saturating_sub(1));
        self.octaves.get(place).copied().unwrap_or(0.0)
    }
}

/// The variance of the noise of a sequence from its differences of the sixth order; `None` where there
/// are too few.
fn variance(stretches: &[Vec<f64>]) -> Option<f64> {
    let mut squares = Vec::new();
    for values in stretches {
        for window in values.windows(POINTS) {
            let [a, b, c, d, e, f, g] = *window else {
                continue;
            };
            let difference = a - 6.0 * b + 15.0 * c - 20.0 * d + 15.0 * e - 6.0 * f + g;
            squares.push(difference * difference);
        }
    }
    if squares.len() < MIN_DIFFERENCES {
        return None;
    }
    let place = squares.len() * 9 / 10;
    let (_, large, _) = squares.select_nth_unstable_by(place, f64::total_cmp);
    let bound = if *large > 0.0 {
        CLIPPED * *large
    } else {
        f64::INFINITY
    };
    let sum: f64 = squares.iter().map(|x| x.min(bound)).sum();
    Some(sum / (GAIN * squares.len() as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intervals::Random;

    /// A motion of up to 1 Hz at 1 kHz, with white noise of this deviation.
    fn moved(deviation: f64) -> Vec<f64> {
        let mut random = Random(7);
        let at = |k: u32| {
            let t = 1e-3 * f64::from(k);
            0.5 * (core::f64::consts::TAU * t).sin() + 0.2 * (2.5 * t).cos()
        };
        (0..20_000)
            .map(|k| at(k) + deviation * random.normal())
            .collect()
    }

    #[test]
    fn white_noise_has_the_same_density_in_all_octaves_and_motion_has_none() {
        for deviation in [1e-3, 1e-5] {
            let levels = NoiseLevels::new(1e-3, &[moved(deviation)]);
            let expected = deviation * deviation * 1e-3;
            for frequency in [300.0, 100.0, 30.0, 5.0, 1.0] {
                let part = levels.density(frequency) / expected;
                assert!(
                    (0.5..2.0).contains(&part),
                    "{deviation} {frequency}: {part}"
                );
            }
        }
    }

    #[test]
    fn noise_of_low_frequency_is_larger_there() {
        // correlated over 15 rows: 29 times the density of white noise at low frequencies
        let (mut random, mut last) = (Random(3), 0.0);
        let part: f64 = 1.0 - 1.0 / 15.0;
        let noisy = moved(0.0).into_iter().map(|x| {
            last = part * last + 1e-3 * (1.0 - part * part).sqrt() * random.normal();
            x + last
        });
        let levels = NoiseLevels::new(1e-3, &[noisy.collect()]);
        let [low, high] = [3.0, 300.0].map(|frequency| levels.density(frequency));
        assert!((1e-8..6e-8).contains(&low), "{low:e}");
        assert!(low > 50.0 * high, "{low:e} {high:e}");
    }

    #[test]
    fn a_signal_of_few_rows_has_no_noise() {
        let levels = NoiseLevels::new(1e-3, &[vec![1.0; 10]]);
        assert_eq!(
            levels,
            NoiseLevels {
                step: 1e-3,
                octaves: Vec::new()
            }
        );
        assert!(levels.density(10.0) <= 0.0);
    }

    #[test]
    fn a_signal_that_stands_still_most_of_the_time_has_the_noise_of_the_rest() {
        let still: Vec<f64> = (0..4000)
            .map(|k| if k % 400 == 399 { 1e-3 } else { 0.0 })
            .collect();
        // the tenth of the differences that are largest tells nothing of the others, which are 0
        let levels = NoiseLevels::new(1e-3, &[still]);
        let expected = 1e-6 / 400.0 * 1e-3;
        let part = levels.density(300.0) / expected;
        assert!((0.5..2.0).contains(&part), "{part}");
    }
}
