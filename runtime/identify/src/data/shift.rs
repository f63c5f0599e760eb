//! Shifts sampled signals in time by interpolation.

use core::ops::Range;

/// Number of samples on either side of a time from which its value is interpolated.
pub(super) const NEIGHBOURS: usize = 2;

/// Replaces each value by the signal's value `delay` seconds later, by cubic interpolation
/// between the samples around that time; returns the range of samples whose interpolation had
/// all its neighbours.
///
/// - `times`: s, increasing; `values`: one for each time.
pub(super) fn later(times: &[f64], values: &mut [f64], delay: f64) -> Range<usize> {
    let n = times.len();
    let samples = values.to_vec();
    let mut valid: Option<Range<usize>> = None;
    let mut at = 0;
    for (k, (time, value)) in times.iter().zip(values).enumerate() {
        let t = time + delay;
        while at + 1 < n && times[at + 1] <= t {
            at += 1;
        }
        if at + 1 < NEIGHBOURS || at + NEIGHBOURS >= n || t < times[at] {
            continue;
        }
        let around = at + 1 - NEIGHBOURS..at + 1 + NEIGHBOURS;
        *value = lagrange(&times[around.clone()], &samples[around], t);
        valid = Some(valid.map_or(k..k + 1, |range| range.start..k + 1));
    }
    valid.unwrap_or(0..0)
}

/// Replaces the values before and behind a range by those on lines through its first and its last two.
pub(super) fn extend(times: &[f64], values: &mut [f64], inside: &Range<usize>) {
    let line = |values: &[f64], a: usize, b: usize| -> Option<[f64; 3]> {
        let (from, value) = (times.get(a)?, values.get(a)?);
        Some([
            *from,
            *value,
            (values.get(b)? - value) / (times.get(b)? - from),
        ])
    };
    if inside.len() < 2 {
        return;
    }
    let ends = [
        (
            0..inside.start,
            line(values, inside.start, inside.start + 1),
        ),
        (
            inside.end..values.len(),
            line(values, inside.end - 1, inside.end - 2),
        ),
    ];
    for (outside, line) in ends {
        let Some([from, value, slope]) = line else {
            continue;
        };
        for k in outside {
            if let (Some(own), Some(time)) = (values.get_mut(k), times.get(k)) {
                *own = value + slope * (time - from);
            }
        }
    }
}

/// The range that a result is valid in if it is known of the rows of another range only, as if these were all.
pub(super) fn within(valid: &Range<usize>, known: &Range<usize>, rows: usize) -> Range<usize> {
    let start = valid.start + known.start;
    start
        ..known
            .end
            .saturating_sub(rows.saturating_sub(valid.end))
            .max(start)
}

/// Evaluates at time `t` the polynomial through all points (Lagrange).
fn lagrange(times: &[f64], values: &[f64], t: f64) -> f64 {
    let mut sum = 0.0;
    for (i, (own, value)) in times.iter().zip(values).enumerate() {
        let mut part = *value;
        for (j, other) in times.iter().enumerate() {
            if i != j {
                part *= (t - other) / (own - other);
            }
        }
        sum += part;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_interpolated_exactly_between_its_samples() {
        let times: Vec<f64> = (0..50).map(|k| 0.01 * f64::from(k)).collect();
        let cubic = |t: f64| 2.0 - t + 3.0 * t * t - 5.0 * t * t * t;
        for delay in [0.0043, -0.0127, 0.03] {
            let mut values: Vec<f64> = times.iter().map(|t| cubic(*t)).collect();
            let valid = later(&times, &mut values, delay);
            assert!(valid.len() > 40);
            for k in valid {
                assert!((values[k] - cubic(times[k] + delay)).abs() < 1e-12);
            }
        }
    }
}
