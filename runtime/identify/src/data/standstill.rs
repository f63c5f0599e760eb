//! Finds the rows at which a joint is at rest, from the resolution and the noise of its encoder.

use std::collections::VecDeque;

/// The time for which a position must stay within its encoder's step or noise to count as resting,
/// s.
const MIN_REST_SECONDS: f64 = 0.2;
/// The least number of rows for which it must stay there.
const MIN_REST_ROWS: usize = 8;
/// The range of a resting position over that time, in standard deviations of the noise.
const REST_BAND_DEVIATIONS: f64 = 6.0;
/// A position that moves slower than this part of its rms speed also counts as resting: such creep
/// is elastic or an artefact of simulation, and sliding friction does not act. At this speed viscous
/// friction is a two hundredth of its usual value, so that leaving these equations out loses little.
const CREEP_PART: f64 = 5e-3;
/// The largest number of differences that are stored for each position, spread over the whole log.
const MAX_DIFFERENCES: usize = 8192;
/// Values closer than this part of the whole range count as equal.
const RELATIVE_TOLERANCE: f64 = 1e-9;
/// Only distances of neighbouring values up to this many times the smallest one are checked for
/// being whole numbers of steps.
const MAX_GAP_STEPS: f64 = 100.0;
/// The part of those distances that must be whole numbers of steps.
const MIN_WHOLE_PART: f64 = 0.9;
/// How far a distance may be from a whole number of steps, in steps, because decimals are rounded.
const WHOLE_STEP_TOLERANCE: f64 = 0.1;
/// The least number of distances that show a step: a few are always near multiples of something.
const MIN_DISTANCES: f64 = 8.0;
/// Standard deviation of the fourth difference of white noise over that of the noise: sqrt(70).
const FOURTH_DIFFERENCE_GAIN: f64 = 8.366_600_265_340_756;
/// The same for the difference of order 8: sqrt(12870).
const EIGHTH_DIFFERENCE_GAIN: f64 = 113.446_022_405_434_56;
/// Median of the absolute value of a standard normal variable.
const NORMAL_ABSOLUTE_MEDIAN: f64 = 0.674_489_750_196_082;
/// For second derivatives from 1, 2 and 3 neighbours on either side: their truncation error as a
/// part of the difference of order 4, 6 and 8, and their noise as a multiple of that of a sample,
/// both over the square of the step.
const STENCILS: [(f64, f64); 3] = [
    (1.0 / 12.0, 2.449_489_742_783_178),
    (1.0 / 90.0, 3.131_559_967_662_478),
    (1.0 / 560.0, 3.457_675_614_816_774),
];
/// The steps of its encoder between the readings of a position that does not move, at most: noise at
/// the border between two steps reaches both.
const STILL_STEPS: usize = 2;
/// The least number of readings that show this: a log of three rows has no more steps anyway.
const MIN_STILL_VALUES: usize = 50;
/// The range of a position that does not move, in standard deviations of its noise: of a million
/// values, the largest and the smallest are about ten apart, and of fifty about four. Of a motion that
/// is sampled too seldom, the differences are larger than the range.
const STILL_DEVIATIONS: core::ops::RangeInclusive<f64> = 2.0..=12.0;
/// By which part of itself the deviation of noise differs between differences of the orders 4 and 8 at
/// most: both are medians of thousands of values, and motion differs by its order.
const MAX_NOISE_DIFFERENCE: f64 = 0.2;
/// The number of samples that a difference of order 8 spans.
const DIFFERENCE_SAMPLES: usize = 9;

/// Resolution and noise of an encoder, estimated from a log.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Encoder {
    /// Its resolution, rad or m; 0 where the positions show no steps.
    pub step: f64,
    /// The standard deviation of its noise, including that of quantisation, rad or m.
    pub noise: f64,
    /// Whether the position never changes.
    pub constant: bool,
    /// Whether the position does not change by more than its noise and two steps of the encoder do.
    pub still: bool,
    /// The root mean square of its change from row to row, rad or m.
    pub travel: f64,
    /// How many neighbours on either side give the best second derivative, 1 to 3: more neighbours
    /// follow the motion better but pass more noise. 0 if the log is too short to tell.
    pub neighbours: usize,
}

impl Encoder {
    /// The same encoder, for which creep does not count as rest.
    #[must_use]
    pub fn without_creep(self) -> Self {
        Self {
            travel: 0.0,
            ..self
        }
    }

    /// The root mean square of the position's speed without the noise, rad/s or m/s.
    ///
    /// - `step`: the time between rows, s.
    pub(super) fn speed(self, step: f64) -> f64 {
        let noise = 2.0 * self.noise * self.noise;
        (self.travel * self.travel - noise).max(0.0).sqrt() / step
    }

    /// The standard deviation of the noise of second differences over the number of neighbours that
    /// suits the encoder, rad/s^2 or m/s^2.
    ///
    /// - `step`: the time between rows, s.
    pub(super) fn acceleration_noise(self, step: f64) -> f64 {
        let place = self.neighbours.saturating_sub(1);
        let gain = STENCILS.get(place).map_or(0.0, |(_, gain)| *gain);
        gain * self.noise / (step * step)
    }

    /// The largest range of a position that is at rest over this many rows, rad or m.
    fn band(self, rows: f64) -> f64 {
        // rounding of decimals makes the steps slightly unequal
        ((1.0 + WHOLE_STEP_TOLERANCE) * self.step)
            .max(REST_BAND_DEVIATIONS * self.noise)
            .max(CREEP_PART * self.travel * rows)
    }
}

/// Values and differences of one position, gathered row by row through a log; memory does not grow
/// with its length.
///
/// ```
/// use regen_identify::data::{Differences, resting};
///
/// // a joint that turns for two seconds and then rests, on an encoder of 1 mrad
/// let times: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
/// let turned = |t: &f64| (t.min(2.0).sin() / 1e-3).round() * 1e-3;
/// let raw: Vec<f64> = times.iter().map(turned).collect();
/// let mut differences = Differences::default();
/// for (k, value) in raw.iter().enumerate() {
///     differences.push(*value, k > 0);
/// }
/// let encoder = differences.finish();
/// assert!((encoder.step - 1e-3).abs() < 1e-9);
/// let rests = resting(&times, &raw, encoder);
/// assert!(rests[210..].iter().all(|rest| *rest) && !rests[100]);
/// ```
#[derive(Clone, Debug)]
pub struct Differences {
    recent: VecDeque<f64>,
    values: Vec<f64>,
    /// Absolute values of the differences of order 4, 6 and 8.
    sizes: [Vec<f64>; 3],
    /// One of this many differences is stored.
    every: usize,
    count: usize,
    /// The number of changes from row to row, and the sum of their squares.
    changes: (f64, f64),
}

impl Default for Differences {
    fn default() -> Self {
        Self {
            recent: VecDeque::new(),
            values: vec![],
            sizes: [vec![], vec![], vec![]],
            every: 1,
            count: 0,
            changes: (0.0, 0.0),
        }
    }
}

impl Differences {
    /// Adds the next value; `follows` says whether it comes after the last one without a gap.
    pub fn push(&mut self, value: f64, follows: bool) {
        if !follows {
            self.recent.clear();
        }
        if let Some(last) = self.recent.back() {
            self.changes.0 += 1.0;
            self.changes.1 += (value - last).powi(2);
        }
        self.recent.push_back(value);
        if self.recent.len() < DIFFERENCE_SAMPLES {
            return;
        }
        let count = self.count;
        self.count += 1;
        if count.is_multiple_of(self.every) {
            self.values.extend(self.recent.back());
            let mut differences: Vec<f64> = self.recent.iter().copied().collect();
            for order in 1..DIFFERENCE_SAMPLES {
                for k in 0..DIFFERENCE_SAMPLES - order {
                    differences[k] = differences[k + 1] - differences[k];
                }
                // of the differences of each order, only the middle one is stored
                if let (true, Some(sizes)) = (
                    order >= 4 && order.is_multiple_of(2),
                    self.sizes.get_mut((order / 2).saturating_sub(2)),
                ) {
                    sizes.push(differences[(DIFFERENCE_SAMPLES - 1 - order) / 2].abs());
                }
            }
            if self.values.len() == MAX_DIFFERENCES {
                self.every *= 2;
                let [a, b, c] = &mut self.sizes;
                for list in [&mut self.values, a, b, c] {
                    let mut k = 0;
                    list.retain(|_| {
                        k += 1;
                        k % 2 == 1
                    });
                }
            }
        }
        self.recent.pop_front();
    }

    /// Estimates the encoder's resolution and noise from the differences.
    pub fn finish(mut self) -> Encoder {
        if self.values.is_empty() {
            return Encoder::default();
        }
        // in order of size from here on
        let step = step(&mut self.values);
        // of a log of few rows, too few values are kept to tell
        let (count, squares) = self.changes;
        let constant = count > 0.0 && squares == 0.0;
        let [fourth, sixth, eighth] = self.sizes.map(median);
        let counted = step / 12.0_f64.sqrt();
        // low-order differences contain the motion; those of order 8 are mostly noise
        let noise = counted.max(eighth / (NORMAL_ABSOLUTE_MEDIAN * EIGHTH_DIFFERENCE_GAIN));
        let errors = [fourth, sixth, eighth].into_iter().zip(STENCILS);
        let error = |(of, (part, gain)): (f64, (f64, f64))| {
            (part * of / NORMAL_ABSOLUTE_MEDIAN).hypot(gain * noise)
        };
        // of noise without motion, differences of all orders tell the same
        let of_order = [
            fourth / FOURTH_DIFFERENCE_GAIN,
            eighth / EIGHTH_DIFFERENCE_GAIN,
        ];
        let [low, high] = of_order.map(|size| size / NORMAL_ABSOLUTE_MEDIAN);
        let is_noise = (low - high).abs() < MAX_NOISE_DIFFERENCE * high;
        let ends = self.values.first().zip(self.values.last());
        let range = ends.map_or(0.0, |(first, last)| last - first);
        let steps = self.values.windows(2).filter(|pair| pair[0] < pair[1]);
        let is_counted = self.values.len() >= MIN_STILL_VALUES && steps.count() <= STILL_STEPS;
        let still =
            constant || is_counted || is_noise && STILL_DEVIATIONS.contains(&(range / high));
        let mut best = (f64::INFINITY, 0);
        for (k, pair) in errors.enumerate() {
            let error = error(pair);
            if error < best.0 {
                best = (error, k + 1);
            }
        }
        Encoder {
            step,
            constant,
            still,
            travel: (self.changes.1 / self.changes.0.max(1.0)).sqrt(),
            noise: counted.max(fourth / (NORMAL_ABSOLUTE_MEDIAN * FOURTH_DIFFERENCE_GAIN)),
            neighbours: best.1,
        }
    }
}

fn median(mut sizes: Vec<f64>) -> f64 {
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or_default()
}

/// The smallest distance of neighbouring values, if nearly all others are whole multiples of it;
/// 0 otherwise.
fn step(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let range = values
        .last()
        .zip(values.first())
        .map_or(0.0, |(a, b)| a - b);
    let gaps = values.windows(2).map(|pair| pair[1] - pair[0]);
    let gaps: Vec<f64> = gaps
        .filter(|gap| *gap > RELATIVE_TOLERANCE * range)
        .collect();
    let smallest = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let near = gaps.iter().filter(|gap| **gap <= MAX_GAP_STEPS * smallest);
    let (mut all, mut whole) = (0.0, 0.0);
    for gap in near {
        let steps = gap / smallest;
        all += 1.0;
        whole += f64::from((steps - steps.round()).abs() <= WHOLE_STEP_TOLERANCE);
    }
    if all >= MIN_DISTANCES && whole >= MIN_WHOLE_PART * all {
        smallest
    } else {
        0.0
    }
}

/// For each row, whether the position is at rest: whether the row is in a stretch of at least 0.2 s
/// and eight rows in which the raw values stay within the encoder's step or noise, or creep: they
/// change by less than 0.2 s at a two hundredth of the rms speed would change them.
///
/// - `times`: the times of the rows, s;
/// - `raw`: the unfiltered position at each, rad or m.
pub fn resting(times: &[f64], raw: &[f64], encoder: Encoder) -> Vec<bool> {
    let whole = times.last().zip(times.first()).map_or(0.0, |(b, a)| b - a);
    let step = whole / (times.len().max(2) - 1) as f64;
    let rows = if step > 0.0 {
        MIN_REST_SECONDS / step
    } else {
        0.0
    };
    let band = encoder.band(rows);
    let mut out = vec![false; raw.len()];
    let (mut highest, mut lowest) = (VecDeque::<usize>::new(), VecDeque::<usize>::new());
    let mut start = 0;
    let mut marked = 0;
    for (k, value) in raw.iter().enumerate() {
        while highest.back().is_some_and(|j| raw[*j] <= *value) {
            highest.pop_back();
        }
        highest.push_back(k);
        while lowest.back().is_some_and(|j| raw[*j] >= *value) {
            lowest.pop_back();
        }
        lowest.push_back(k);
        while let (Some(high), Some(low)) = (highest.front(), lowest.front())
            && raw[*high] - raw[*low] > band
        {
            start += 1;
            if *high < start {
                highest.pop_front();
            }
            if lowest.front().is_some_and(|low| *low < start) {
                lowest.pop_front();
            }
        }
        // half a row less, because times are rounded
        let long = k + 1 - start >= MIN_REST_ROWS
            && times[k] - times[start]
                >= MIN_REST_SECONDS * (1.0 - 1e-9) - 0.5 * (times[k] - times[k - 1]);
        if long {
            out[marked.max(start)..=k].fill(true);
            marked = k + 1;
        }
    }
    out
}

/// The largest number of rows of context on either side, however small the time step is.
const MAX_CONTEXT_ROWS: usize = 100_000;

/// Number of rows on either side that decide whether a row is at rest; `step`: the time between
/// rows, s.
///
/// ```
/// assert_eq!(regen_identify::data::rest_context(0.01), 21);
/// ```
pub fn context(step: f64) -> usize {
    #[allow(clippy::cast_sign_loss, reason = "steps are positive")]
    let rows = (MIN_REST_SECONDS / step).ceil() as usize;
    rows.clamp(MIN_REST_ROWS, MAX_CONTEXT_ROWS) + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(n: usize, step: f64) -> Vec<f64> {
        (0..n).map(|k| k as f64 * step).collect()
    }

    fn encoder(values: &[f64]) -> Encoder {
        let mut differences = Differences::default();
        for (k, value) in values.iter().enumerate() {
            differences.push(*value, k > 0);
        }
        differences.finish()
    }

    #[test]
    fn the_step_of_an_encoder_is_found() {
        for step in [1e-4, 3e-3] {
            let swing = |k: usize| ((k as f64 * 0.01).sin() / step).round() * step;
            let values: Vec<f64> = (0..20_000).map(swing).collect();
            let found = encoder(&values);
            assert!((found.step / step - 1.0).abs() < 1e-3, "{found:?}");
        }
        // a smooth signal has no step
        let smooth: Vec<f64> = (0..20_000).map(|k| (f64::from(k) * 0.01).sin()).collect();
        assert!(encoder(&smooth).step <= 0.0);
    }

    #[test]
    fn smooth_positions_are_differentiated_over_more_neighbours_than_noisy_ones() {
        let mut state = 7_u64;
        let mut noise = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as f64 / 2_f64.powi(31) - 0.5
        };
        let mut chosen = |size: f64| {
            let value = |k: u32| (0.05 * f64::from(k)).sin() + size * noise();
            encoder(&(0..4000).map(value).collect::<Vec<_>>()).neighbours
        };
        // differences of order 4 of this motion are of the size 6e-6, of order 6 1.5e-8
        assert_eq!(chosen(0.0), 3);
        assert_eq!(chosen(1e-8), 2);
        assert_eq!(chosen(1e-4), 1);
        assert_eq!(encoder(&[0.0, 1.0]).neighbours, 0);
    }

    #[test]
    fn a_position_of_noise_alone_is_still_and_the_smallest_motion_is_not() {
        let mut state = 7_u64;
        let mut noise = || {
            let mut sum = -6.0;
            for _ in 0..12 {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                sum += (state >> 33) as f64 / 2_f64.powi(31);
            }
            sum
        };
        let mut of = |motion: &dyn Fn(f64) -> f64, deviation: f64, step: f64| {
            let value = |k: u32| motion(f64::from(k)) + deviation * noise();
            let values = (0..6000).map(value);
            let rounded = values.map(|x| {
                if step > 0.0 {
                    (x / step).round() * step
                } else {
                    x
                }
            });
            encoder(&rounded.collect::<Vec<_>>()).still
        };
        let rest = |_: f64| 0.7;
        assert!(of(&rest, 0.0, 0.0) && of(&rest, 1e-4, 0.0));
        assert!(of(&rest, 2e-5, 1e-4) && of(&|_| 0.75e-4, 3e-5, 1e-4));
        // slow, fast and hardly sampled motions
        for speed in [1e-3, 0.05, 1.0, 2.0, 3.0] {
            let swing = |k: f64| 0.1 * (speed * k).sin();
            assert!(!of(&swing, 0.0, 0.0) && !of(&swing, 1e-4, 0.0), "{speed}");
            assert!(!of(&swing, 0.0, 1e-4), "{speed}");
        }
    }

    #[test]
    fn only_a_position_that_stays_rests() {
        let times = times(600, 0.01);
        // two seconds of swing, two of rest, two of swing again
        let value = |k: usize| match k {
            0..200 => (k as f64 * 0.05).sin(),
            200..400 => (200.0 * 0.05_f64).sin(),
            _ => ((k - 200) as f64 * 0.05).sin(),
        };
        let raw: Vec<f64> = (0..600).map(value).collect();
        let rests = resting(&times, &raw, encoder(&raw));
        assert!(rests[201..400].iter().all(|x| *x));
        assert!(rests[..195].iter().chain(&rests[405..]).all(|x| !x));
    }

    #[test]
    fn creep_rests_and_a_slow_motion_does_not() {
        let times = times(4000, 1e-3);
        // two seconds of swinging, then 4e-5 rad/s
        let creeping: Vec<f64> = times
            .iter()
            .map(|t| (3.0 * t.min(2.0)).sin() + 4e-5 * (t - 2.0).max(0.0))
            .collect();
        let rests = resting(&times, &creeping, encoder(&creeping));
        assert!(rests[2001..].iter().all(|rest| *rest));
        assert!(!rests[1..1900].iter().any(|rest| *rest));
        let slow: Vec<f64> = times.iter().map(|t| 4e-5 * t).collect();
        assert!(!resting(&times, &slow, encoder(&slow)).contains(&true));
    }

    #[test]
    fn turning_points_are_no_rest() {
        let times = times(2000, 0.0025);
        for step in [0.0, 1e-5] {
            let swing = |t: &f64| {
                let q = (2.0 * t).sin();
                if step > 0.0 {
                    (q / step).round() * step
                } else {
                    q
                }
            };
            let raw: Vec<f64> = times.iter().map(swing).collect();
            let rests = resting(&times, &raw, encoder(&raw));
            assert!(rests.iter().all(|x| !x), "{step}");
        }
    }

    #[test]
    fn the_chosen_neighbours_give_accelerations_of_nearly_the_least_error() {
        let step = 0.02;
        let times = times(1500, step);
        let mut worst: f64 = 0.0;
        // slow and fast motion, from hardly any noise to much
        for (w, k) in [7.0, 40.0]
            .into_iter()
            .flat_map(|w| (0..34).map(move |k| (w, k)))
        {
            let noise = 1e-8 * 1.6_f64.powi(k);
            let mut random = crate::intervals::Random(5);
            let values: Vec<f64> = times
                .iter()
                .map(|t| (w * t).sin() + noise * random.normal())
                .collect();
            let error = |neighbours: usize| {
                let found = crate::signals::differences(&times, &values, neighbours).unwrap();
                let rows = times.iter().zip(&found.acceleration).skip(10).take(1480);
                rows.map(|(t, a)| (a + w * w * (w * t).sin()).powi(2))
                    .sum::<f64>()
            };
            let errors = [1, 2, 3].map(error);
            let least = errors.iter().fold(f64::INFINITY, |m: f64, own| m.min(*own));
            let chosen = errors[encoder(&values).neighbours - 1];
            worst = worst.max((chosen / least).sqrt());
        }
        assert!(worst < 1.15, "{worst}");
    }
}
