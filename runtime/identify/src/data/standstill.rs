//! Coordinates that rest, by what their encoders say.

use std::collections::VecDeque;

/// How long a position must stay within its encoder's step, or its noise, to rest, s.
const SPAN: f64 = 0.2;
/// Rows that it takes at least.
const ROWS: usize = 8;
/// Deviations of the noise within which a resting position stays over that many rows.
const SPREAD: f64 = 6.0;
/// Differences that are remembered of each position, spread over the whole log.
const REMEMBERED: usize = 8192;
/// Values whose distance is below this part of their range are the same.
const SAME: f64 = 1e-9;
/// Distances of neighbouring values up to this many steps tell whether there are steps: so many
/// of them must be whole numbers of steps, within a tenth of one.
const NEAR: f64 = 100.0;
const WHOLE: f64 = 0.9;
const ROUNDING: f64 = 0.1;
/// Differences of order 4 and 8 of white noise have sqrt(70) and sqrt(12870) times its deviation;
/// half of normal values are within 0.6745 of theirs.
const FOURTH: f64 = 8.366_600_265_340_756;
const EIGHTH: f64 = 113.446_022_405_434_56;
const HALF: f64 = 0.674_489_750_196_082;
/// For second derivatives from 1, 2 and 3 neighbours on either side: by what part of the difference
/// of order 4, 6 and 8 they are off, and how many times the noise of a sample they have, both over
/// the square of the step.
const STENCILS: [(f64, f64); 3] = [
    (1.0 / 12.0, 2.449_489_742_783_178),
    (1.0 / 90.0, 3.131_559_967_662_478),
    (1.0 / 560.0, 3.457_675_614_816_774),
];
/// Samples that differences of order 8 take.
const TAKEN: usize = 9;

/// What is known of an encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Encoder {
    /// Its step, rad or m; 0 where none shows.
    pub(super) step: f64,
    /// The standard deviation of its noise, steps included, rad or m.
    pub(super) noise: f64,
    /// Whether it never changes.
    pub(super) constant: bool,
    /// How many neighbours on either side give the best second derivative, 1 to 3: more follow
    /// the motion better but take up more noise. 0 where the log is too short to tell.
    pub(super) neighbours: usize,
}

impl Encoder {
    /// How far a resting position wanders.
    fn band(self) -> f64 {
        // rounding of decimals makes steps a little unequal
        ((1.0 + ROUNDING) * self.step).max(SPREAD * self.noise)
    }
}

/// Differences of one position on its way through a log.
#[derive(Clone, Debug)]
pub(super) struct Differences {
    recent: VecDeque<f64>,
    values: Vec<f64>,
    /// The sizes of differences of order 4, 6 and 8.
    sizes: [Vec<f64>; 3],
    /// Of the differences, each how many-th is remembered.
    every: usize,
    seen: usize,
}

impl Default for Differences {
    fn default() -> Self {
        Self {
            recent: VecDeque::new(),
            values: vec![],
            sizes: [vec![], vec![], vec![]],
            every: 1,
            seen: 0,
        }
    }
}

impl Differences {
    /// The next value, and whether it follows the last one.
    pub(super) fn push(&mut self, value: f64, follows: bool) {
        if !follows {
            self.recent.clear();
        }
        self.recent.push_back(value);
        if self.recent.len() < TAKEN {
            return;
        }
        let seen = self.seen;
        self.seen += 1;
        if seen.is_multiple_of(self.every) {
            self.values.extend(self.recent.back());
            let mut differences: Vec<f64> = self.recent.iter().copied().collect();
            for order in 1..TAKEN {
                for k in 0..TAKEN - order {
                    differences[k] = differences[k + 1] - differences[k];
                }
                // of the differences of each order, that in the middle
                if let (true, Some(sizes)) = (
                    order >= 4 && order.is_multiple_of(2),
                    self.sizes.get_mut((order / 2).saturating_sub(2)),
                ) {
                    sizes.push(differences[(TAKEN - 1 - order) / 2].abs());
                }
            }
            if self.values.len() == REMEMBERED {
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

    /// What they say of the encoder.
    pub(super) fn finish(mut self) -> Encoder {
        if self.values.is_empty() {
            return Encoder::default();
        }
        let step = step(&mut self.values);
        let constant = self.values.first() == self.values.last();
        let [fourth, sixth, eighth] = self.sizes.map(median);
        let counted = step / 12.0_f64.sqrt();
        // slow differences are of the motion, which only those of high order do not know
        let noise = counted.max(eighth / (HALF * EIGHTH));
        let errors = [fourth, sixth, eighth].into_iter().zip(STENCILS);
        let error = |(of, (part, gain)): (f64, (f64, f64))| (part * of / HALF).hypot(gain * noise);
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
            noise: counted.max(fourth / (HALF * FOURTH)),
            neighbours: best.1,
        }
    }
}

fn median(mut sizes: Vec<f64>) -> f64 {
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or_default()
}

/// The distance of neighbouring values of which all others are whole multiples; 0 where there is
/// none.
fn step(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let range = values
        .last()
        .zip(values.first())
        .map_or(0.0, |(a, b)| a - b);
    let gaps = values.windows(2).map(|pair| pair[1] - pair[0]);
    let gaps: Vec<f64> = gaps.filter(|gap| *gap > SAME * range).collect();
    let smallest = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let near = gaps.iter().filter(|gap| **gap <= NEAR * smallest);
    let (mut all, mut whole) = (0.0, 0.0);
    for gap in near {
        let steps = gap / smallest;
        all += 1.0;
        whole += f64::from((steps - steps.round()).abs() <= ROUNDING);
    }
    // two or three values always are multiples of something
    if all >= 8.0 && whole >= WHOLE * all {
        smallest
    } else {
        0.0
    }
}

/// Where a position rests: it is within a stretch of at least [`SPAN`] seconds and [`ROWS`] rows
/// in which the raw values stay within the encoder's step or noise.
pub(super) fn resting(times: &[f64], raw: &[f64], encoder: Encoder) -> Vec<bool> {
    let band = encoder.band();
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
        // half a row, as times are rounded
        let long = k + 1 - start >= ROWS
            && times[k] - times[start] >= SPAN * (1.0 - 1e-9) - 0.5 * (times[k] - times[k - 1]);
        if long {
            out[marked.max(start)..=k].fill(true);
            marked = k + 1;
        }
    }
    out
}

/// Rows on either side that are looked at most, however small steps are.
const WIDEST: usize = 100_000;

/// Rows on either side that tell whether a row is at rest.
pub(super) fn context(step: f64) -> usize {
    #[allow(clippy::cast_sign_loss, reason = "steps are positive")]
    let rows = (SPAN / step).ceil() as usize;
    rows.clamp(ROWS, WIDEST) + 1
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
        // what is not counted in steps has none
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
}
