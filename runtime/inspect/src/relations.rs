//! Finds the columns that are derivatives of others.

use serde::Serialize;

use crate::gather::Stretch;

/// The window, s, over which a column's change is compared with the integral of another.
const WINDOW_SECONDS: f64 = 0.05;
/// Bounds of the window in values.
const WINDOW_VALUES: [usize; 2] = [4, 64];
/// The least number of windows.
const MIN_WINDOWS: f64 = 20.0;
/// The least correlation of a column that is the derivative of another.
const MIN_CORRELATION: f64 = 0.97;

/// A column that is the derivative of another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Derivative {
    /// The number of the other column, from 1.
    pub of: usize,
    /// The change of that column over the integral of this one: 1 where units agree.
    pub factor: f64,
    /// The correlation of the two.
    pub correlation: f64,
}

/// Changes and integrals over windows, as sums of squares and products.
#[derive(Clone, Debug)]
pub(crate) struct Relations {
    count: usize,
    windows: f64,
    changes: Vec<f64>,
    integrals: Vec<f64>,
    /// `products[a * count + b]`: the sum of the products of the change of a and the integral of b.
    products: Vec<f64>,
}

impl Relations {
    /// Compares all columns of some stretches; linear in their length.
    ///
    /// - `step`: the time between values, s; `None` where nothing gives the time.
    pub(crate) fn new(stretches: &[Stretch], count: usize, step: Option<f64>) -> Self {
        let mut out = Self {
            count,
            windows: 0.0,
            changes: vec![0.0; count],
            integrals: vec![0.0; count],
            products: vec![0.0; count * count],
        };
        let [least, most] = WINDOW_VALUES;
        #[allow(clippy::cast_sign_loss, reason = "clamped")]
        let length = step.map_or(most, |step| {
            let wanted = (WINDOW_SECONDS / step).ceil();
            wanted.clamp(least as f64, most as f64) as usize
        });
        let (mut change, mut integral) = (vec![0.0; count], vec![0.0; count]);
        for stretch in stretches {
            let n = stretch.times.len();
            for start in (0..n.saturating_sub(length)).step_by(length) {
                let end = start + length;
                for (k, values) in stretch.columns.iter().enumerate() {
                    let ends = 0.5 * (values[start] + values[end]);
                    let inner: f64 = values[start + 1..end].iter().sum();
                    let span = stretch.times[end] - stretch.times[start];
                    change[k] = values[end] - values[start];
                    integral[k] = (ends + inner) * span / length as f64;
                }
                out.add(&change, &integral);
            }
        }
        out
    }

    fn add(&mut self, change: &[f64], integral: &[f64]) {
        self.windows += 1.0;
        for (a, own) in change.iter().enumerate() {
            self.changes[a] += own * own;
            self.integrals[a] += integral[a] * integral[a];
            for (b, other) in integral.iter().enumerate() {
                self.products[a * self.count + b] += own * other;
            }
        }
    }

    /// If column b is the derivative of column a, its factor and correlation, see [`Derivative`].
    pub(crate) fn derivative(&self, a: usize, b: usize) -> Option<(f64, f64)> {
        let product = self.products.get(a * self.count + b)?;
        let (change, integral) = (self.changes[a], self.integrals[b]);
        if a == b || self.windows < MIN_WINDOWS || change <= 0.0 || integral <= 0.0 {
            return None;
        }
        let correlation = product / (change * integral).sqrt();
        (correlation.abs() >= MIN_CORRELATION).then(|| (product / integral, correlation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_derivatives_are_found_and_with_their_factor() {
        let times: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let of = |f: &dyn Fn(f64) -> f64| times.iter().map(|t| f(*t)).collect::<Vec<f64>>();
        let stretch = Stretch {
            columns: vec![
                of(&|t| (1.3 * t).sin() + 0.4 * (2.9 * t).cos()),
                // its velocity in degrees per second
                of(&|t| (1.3 * (1.3 * t).cos() - 1.16 * (2.9 * t).sin()).to_degrees()),
                of(&|t| (2.1 * t).cos()),
                of(&|_| 1.0),
            ],
            times,
        };
        let found = Relations::new(&[stretch], 4, Some(0.01));
        let (factor, correlation) = found.derivative(0, 1).unwrap();
        assert!((factor.to_degrees() - 1.0).abs() < 1e-3 && correlation > 0.9999);
        for (a, b) in [(1, 0), (0, 2), (2, 0), (2, 1), (0, 3), (3, 0), (0, 0)] {
            assert_eq!(found.derivative(a, b), None, "{a} {b}");
        }
    }
}
