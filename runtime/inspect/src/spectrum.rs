//! Power spectral densities by Welch's method, row by row, from which signal and noise follow.
//!
//! P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE
//! Transactions on Audio and Electroacoustics 15(2), 1967: means over blocks that overlap by half,
//! without their trends. The window is the third power of Hann's: an encoder's noise may be twelve
//! orders of magnitude below the motion, which other windows spread over all frequencies.

use serde::Serialize;

use crate::clock::median;
use crate::fft::Fft;

/// The band in which the noise floor is looked for, in parts of half the sampling rate.
const FLOOR_BAND: [f64; 2] = [0.75, 0.98];
/// A density above this many times the floor counts as signal.
const SIGNAL_OVER_FLOOR: f64 = 3.0;
/// The signal ends at a frequency if the density stays below [`SIGNAL_OVER_FLOOR`] from there up to
/// this many times the frequency.
const QUIET_BAND: f64 = 1.5;
/// A signal ends at the frequency below which it has this part of its power.
const SIGNAL_PART: f64 = 0.999;
/// If the densities at the two ends of [`FLOOR_BAND`] differ by more than this factor, there is no
/// noise floor.
const MAX_FLOOR_SLOPE: f64 = 10.0;
/// Before they are compared, densities are averaged over this part of their frequency.
const SMOOTHING: f64 = 0.05;
/// The length of a block, s, if the log is long enough.
const BLOCK_SECONDS: f64 = 20.0;
/// The smallest and largest number of rows in a block.
const BLOCK_ROWS: [usize; 2] = [64, 16_384];
/// A step of more than this many usual ones is a gap.
const GAP_STEPS: f64 = 1.5;
/// The largest number of points of a spectrum in a picture.
const PICTURE_POINTS: usize = 240;

/// The number of rows in a block, for a log with this number of rows and this time step (s).
pub(crate) fn block_rows(rows: usize, step: f64) -> usize {
    let most = (BLOCK_SECONDS / step).clamp(0.0, 1e9);
    #[allow(clippy::cast_sign_loss, reason = "clamped")]
    let wanted = (most as usize).min(rows / 3);
    let wanted = wanted.clamp(BLOCK_ROWS[0], BLOCK_ROWS[1]);
    // the power of two below
    1 << wanted.ilog2()
}

/// The square root of the power spectral density of samples, with few enough points for a picture:
/// pairs of frequency (Hz) and density (unit of the samples per sqrt(Hz)). A step of more than one
/// and a half usual steps is a gap, after which a new block begins; without a whole block of at least
/// 64 samples the result is empty.
///
/// - `times`: s, ascending; `values`: one for each.
///
/// ```
/// use regen_inspect::amplitude_density;
///
/// // 0.5 and -0.5 in turns: all of the power is at half of the rate, 50 Hz
/// let times: Vec<f64> = (0..512).map(|k| 0.01 * f64::from(k)).collect();
/// let values: Vec<f64> = (0..512).map(|k| 0.5 * f64::from(1 - 2 * (k % 2))).collect();
/// let found = amplitude_density(&times, &values);
/// let highest = found.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
/// assert!(highest.0 > 45.0);
/// assert!(amplitude_density(&times[..63], &values[..63]).is_empty());
/// ```
pub fn amplitude_density(times: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let step = median(&steps);
    if step.is_nan() || step <= 0.0 {
        return Vec::new();
    }
    let mut welch = Welch::new(block_rows(values.len(), step));
    for (k, value) in values.iter().enumerate() {
        let before = k.checked_sub(1).and_then(|before| steps.get(before));
        if before.is_some_and(|own| *own > GAP_STEPS * step) {
            welch.restart();
        }
        welch.push(*value);
    }
    welch
        .finish(1.0 / step)
        .map_or_else(Vec::new, |density| density.picture())
}

/// The density of one column, gathered row by row.
#[derive(Clone, Debug)]
pub(crate) struct Welch {
    fft: Fft,
    window: Vec<f64>,
    recent: Vec<f64>,
    sums: Vec<f64>,
    blocks: usize,
}

impl Welch {
    pub(crate) fn new(size: usize) -> Self {
        let angle = |k: usize| core::f64::consts::TAU * k as f64 / size as f64;
        Self {
            fft: Fft::new(size),
            window: (0..size)
                .map(|k| (0.5 - 0.5 * libm::cos(angle(k))).powi(3))
                .collect(),
            recent: Vec::with_capacity(size),
            sums: vec![0.0; size / 2 + 1],
            blocks: 0,
        }
    }

    /// Begins a new block: the next row does not follow the last one.
    pub(crate) fn restart(&mut self) {
        self.recent.clear();
    }

    pub(crate) fn push(&mut self, value: f64) {
        let size = self.window.len();
        self.recent.push(value);
        if self.recent.len() < size {
            return;
        }
        let block = without_trend(&self.recent);
        let windowed = block.iter().zip(&self.window).map(|(x, w)| x * w);
        let windowed: Vec<f64> = windowed.collect();
        for (sum, power) in self.sums.iter_mut().zip(self.fft.power(&windowed)) {
            *sum += power;
        }
        self.blocks += 1;
        self.recent.drain(..size / 2);
    }

    /// The density of rows at this rate, Hz; `None` without a whole block.
    pub(crate) fn finish(self, rate: f64) -> Option<Density> {
        if self.blocks == 0 {
            return None;
        }
        let energy: f64 = self.window.iter().map(|w| w * w).sum();
        // a one-sided density is the sum of those at both signs of a frequency
        let scale = 2.0 / (rate * energy * self.blocks as f64);
        Some(Density {
            values: self.sums.iter().map(|x| x * scale).collect(),
            step: rate / self.window.len() as f64,
            blocks: self.blocks,
        })
    }
}

/// The values minus the straight line that fits them best.
fn without_trend(values: &[f64]) -> Vec<f64> {
    let n = values.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let mean = values.iter().sum::<f64>() / n;
    let (mut xy, mut xx) = (0.0, 0.0);
    for (k, value) in values.iter().enumerate() {
        let x = k as f64 - middle;
        xy += x * (value - mean);
        xx += x * x;
    }
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    let off = |(k, value): (usize, &f64)| value - mean - slope * (k as f64 - middle);
    values.iter().enumerate().map(off).collect()
}

/// A one-sided power spectral density.
#[derive(Clone, Debug)]
pub(crate) struct Density {
    /// The densities, unit^2/Hz, from frequency 0.
    values: Vec<f64>,
    /// The frequency step between the values, Hz.
    step: f64,
    blocks: usize,
}

/// The noise and the signal in a column's spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spectrum {
    /// The density of the noise at high frequencies, unit^2/Hz.
    pub floor: f64,
    /// The standard deviation of white noise of this density at the rate of the rows, in the
    /// column's unit.
    pub noise: f64,
    /// Whether the noise is about the same at all high frequencies; if not, the column passed a
    /// filter before it was logged, or is signal at all frequencies.
    pub flat: bool,
    /// The frequency from which on the signal cannot be told from the noise, Hz; `None` where it is
    /// above the noise at all frequencies.
    pub meets: Option<f64>,
    /// The frequency below which the signal has 99.9 % of its power, Hz; of a position that of its
    /// acceleration.
    pub ends: f64,
}

impl Density {
    /// The mean density of the noise in a band (in parts of half the rate), from the median of the
    /// densities.
    fn level(&self, band: [f64; 2]) -> f64 {
        let last = self.values.len().saturating_sub(1) as f64;
        #[allow(clippy::cast_sign_loss, reason = "parts are positive")]
        let [from, to] = band.map(|part| (part * last) as usize);
        let median = median(self.values.get(from..to).unwrap_or_default());
        // the median of a chi-squared variable by Wilson and Hilferty; blocks that overlap by half
        // are hardly dependent under the window
        let m = self.blocks as f64;
        median / (1.0 - 1.0 / (9.0 * m)).powi(3)
    }

    /// The mean density around the frequency of index k.
    fn around(&self, k: usize) -> f64 {
        #[allow(clippy::cast_sign_loss, reason = "positive")]
        let side = (SMOOTHING * k as f64) as usize + 1;
        let band = k.saturating_sub(side)..(k + side + 1).min(self.values.len());
        let count = band.len().max(1) as f64;
        self.values
            .get(band)
            .unwrap_or_default()
            .iter()
            .sum::<f64>()
            / count
    }

    /// Finds noise and signal.
    ///
    /// - `order`: the order of the derivative whose power decides where the signal ends.
    pub(crate) fn judge(&self, order: i32) -> Spectrum {
        let floor = self.level(FLOOR_BAND);
        let middle = 0.5 * (FLOOR_BAND[0] + FLOOR_BAND[1]);
        let low = self.level([FLOOR_BAND[0], middle]);
        let high = self.level([middle, FLOOR_BAND[1]]);
        let last = self.values.len().saturating_sub(1);
        let quiet: Vec<bool> = (0..=last)
            .map(|k| self.around(k) <= SIGNAL_OVER_FLOOR * floor)
            .collect();
        let stays = |k: &usize| {
            #[allow(clippy::cast_sign_loss, reason = "positive")]
            let end = ((QUIET_BAND * *k as f64) as usize + 2).min(last);
            *k < last
                && quiet
                    .get(*k..end)
                    .is_some_and(|band| band.iter().all(|q| *q))
        };
        let meets = (1..last).find(stays);
        let until = meets.unwrap_or(last);
        let power = |k: usize| {
            let own = (self.values.get(k).copied().unwrap_or(0.0) - floor).max(0.0);
            own * (k as f64).powi(2 * order)
        };
        let all: f64 = (1..=until).map(power).sum();
        let mut sum = 0.0;
        let end = (1..=until).find(|k| {
            sum += power(*k);
            sum >= SIGNAL_PART * all
        });
        Spectrum {
            floor,
            noise: (floor * self.step * last as f64).sqrt(),
            flat: low <= MAX_FLOOR_SLOPE * high,
            meets: meets.map(|k| k as f64 * self.step),
            ends: end.unwrap_or(until) as f64 * self.step,
        }
    }

    /// Frequencies and square roots of the densities, averaged to at most [`PICTURE_POINTS`] points.
    pub(crate) fn picture(&self) -> Vec<(f64, f64)> {
        let last = self.values.len().saturating_sub(1);
        let ratio = libm::pow((last.max(2)) as f64, 1.0 / PICTURE_POINTS as f64);
        let mut out = Vec::new();
        let mut from = 1;
        while from <= last {
            #[allow(clippy::cast_sign_loss, reason = "positive")]
            let to = ((from as f64 * ratio) as usize).max(from + 1).min(last + 1);
            let band = self.values.get(from..to).unwrap_or_default();
            let mean = band.iter().sum::<f64>() / band.len().max(1) as f64;
            let middle = 0.5 * (from + to - 1) as f64;
            out.push((middle * self.step, mean.sqrt()));
            from = to;
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Noise;

    /// The spectrum of a signal at 200 Hz.
    fn spectrum(order: i32, signal: impl Fn(f64) -> f64, sigma: f64) -> Spectrum {
        let rows = 12_000;
        let mut welch = Welch::new(block_rows(rows, 5e-3));
        let mut noise = Noise::new(3);
        for k in 0..rows {
            welch.push(signal(5e-3 * k as f64) + sigma * noise.normal());
        }
        welch.finish(200.0).unwrap().judge(order)
    }

    #[test]
    fn noise_is_measured_beside_a_signal_and_both_meet_where_they_are_equal() {
        // decays of 1/f^4 in density, and no signal above 12 Hz
        let signal = |t: f64| {
            let harmonics = (1..=60).map(|k| f64::from(k) * 0.2);
            let one = |f: f64| (core::f64::consts::TAU * f * t + f * f).sin() / (f * f);
            harmonics.map(one).sum::<f64>()
        };
        let found = spectrum(2, signal, 1e-4);
        assert!((found.noise / 1e-4 - 1.0).abs() < 0.05, "{found:?}");
        assert!(found.flat);
        let meets = found.meets.unwrap();
        // averages over a twentieth of the frequency, and the window, widen it
        assert!((11.5..13.6).contains(&meets), "{found:?}");
        assert!((11.0..=meets).contains(&found.ends), "{found:?}");
        // stronger noise covers the end of the signal
        let noisy = spectrum(2, signal, 1.0);
        assert!((2.0..5.0).contains(&noisy.meets.unwrap()), "{noisy:?}");
        assert!((noisy.noise - 1.0).abs() < 0.05, "{noisy:?}");
    }

    #[test]
    fn a_strong_slow_motion_does_not_hide_the_noise_of_a_fine_encoder() {
        let slow = |t: f64| 0.7 * (core::f64::consts::TAU * 0.31 * t).sin();
        let found = spectrum(2, slow, 1e-7);
        assert!((found.noise / 1e-7 - 1.0).abs() < 0.05, "{found:?}");
        assert!(found.meets.unwrap() < 2.5 && found.ends < 1.0, "{found:?}");
    }

    #[test]
    fn a_signal_does_not_end_at_a_gap_below_a_faster_part_of_it() {
        let tones = |t: f64| {
            let one = |f: f64| (core::f64::consts::TAU * f * t).sin();
            let slow: f64 = (1..=50).map(|k| one(0.2 * f64::from(k))).sum();
            slow + one(14.5)
        };
        let found = spectrum(0, tones, 0.05);
        // averages over a twentieth of the frequency, and the window, widen it
        let meets = found.meets.unwrap();
        assert!((14.5..16.5).contains(&meets), "{found:?}");
        assert!((14.4..=meets).contains(&found.ends), "{found:?}");
    }

    #[test]
    fn the_density_of_noise_is_its_deviation_over_the_root_of_the_band() {
        let mut noise = Noise::new(7);
        let times: Vec<f64> = (0..8192).map(|k| 0.005 * f64::from(k)).collect();
        let values: Vec<f64> = times.iter().map(|_| 3.0 * noise.normal()).collect();
        let found = amplitude_density(&times, &values);
        // a variance of 9 over 100 Hz; averages over many frequencies scatter by a few percent
        let high = found.iter().filter(|(f, _)| *f > 10.0);
        let (sum, count) = high.fold((0.0, 0.0), |(s, n), (_, d)| (s + d * d, n + 1.0));
        assert!((sum / count / 0.09 - 1.0).abs() < 0.1, "{}", sum / count);
        // the second half an hour later: two logs, and no step between them
        let apart: Vec<f64> = times
            .iter()
            .map(|t| t + if *t > 20.0 { 3600.0 } else { 0.0 })
            .collect();
        let shifted: Vec<f64> = apart
            .iter()
            .zip(&values)
            .map(|(t, v)| v + if *t > 20.0 { 1e3 } else { 0.0 })
            .collect();
        let low =
            |points: &[(f64, f64)]| points.iter().find(|(f, _)| *f > 1.0).map_or(0.0, |p| p.1);
        assert!(low(&amplitude_density(&apart, &shifted)) < 3.0 * low(&found));
        assert!(low(&amplitude_density(&times, &shifted)) > 3.0 * low(&found));
    }

    #[test]
    fn a_block_is_a_power_of_two_within_its_bounds() {
        assert_eq!(block_rows(12_000, 5e-3), 2048);
        assert_eq!(block_rows(100, 5e-3), 64);
        assert_eq!(block_rows(10_000_000, 1e-5), 16_384);
        assert_eq!(block_rows(5000, f64::NAN), 64);
    }

    #[test]
    fn a_straight_line_without_its_trend_is_zero() {
        let line: Vec<f64> = (0..50).map(|k| 3.0 - 0.7 * f64::from(k)).collect();
        assert!(without_trend(&line).iter().all(|x| x.abs() < 1e-12));
    }
}
