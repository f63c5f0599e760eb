//! Sizes of numbers that are not exact: what is rounding, and what is too small to divide by.

use super::field::Element;
use super::span::Vector;

/// Entries that are not exact and below this part, 2^-200, of the largest number from which they
/// were computed are rounding. The certificate has the same bound.
const ROUNDING: f64 = 6.2e-61;

/// Entries that are not exact and below this part of the largest entry of their vector are pivots
/// only where there are no others: dividing by them would cost digits.
const SMALL: f64 = 1e-6;

/// The size below which an entry that is not exact does not count; 0 where all numbers are exact.
#[derive(Clone, Copy)]
pub(super) struct Bound(f64);

impl Bound {
    /// The rounding of `to + factor * row`.
    pub(super) fn of_sum(to: &Vector, factor: &Element, row: &Vector) -> Self {
        if factor.value().is_exact() && is_exact(to) && is_exact(row) {
            return Self(0.0);
        }
        Self(ROUNDING * largest(to).max(size(factor) * largest(row)))
    }

    /// The size of pivots that would cost digits.
    pub(super) fn of_pivots(vector: &Vector) -> Self {
        if is_exact(vector) {
            return Self(0.0);
        }
        Self(SMALL * largest(vector))
    }

    pub(super) fn exceeds(self, entry: &Element) -> bool {
        self.0 > 0.0 && !entry.value().is_exact() && size(entry) <= self.0
    }
}

fn size(entry: &Element) -> f64 {
    entry.value().to_f64().abs()
}

/// The magnitude of the largest entry.
fn largest(vector: &Vector) -> f64 {
    vector.values().map(size).fold(0.0, f64::max)
}

fn is_exact(vector: &Vector) -> bool {
    vector.values().all(|e| e.value().is_exact())
}
