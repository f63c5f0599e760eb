//! Sizes of numbers that are not exact: which are rounding errors, and which are too small to divide
//! by.

use super::field::Element;
use super::span::Vector;

/// An entry that is not exact counts as a rounding error if it is below this part, 2^-200, of the
/// largest number from which it was computed. The certificate uses the same bound.
const ROUNDING: f64 = 6.2e-61;

/// An entry that is not exact and below this part of the largest entry of its vector becomes a pivot
/// only if there is no other: dividing by it would lose digits.
const SMALL: f64 = 1e-6;

/// The size up to which an entry that is not exact is negligible; 0 if all numbers are exact.
#[derive(Clone, Copy)]
pub(super) struct Bound(f64);

impl Bound {
    /// The bound on rounding errors of `to + factor * row`.
    pub(super) fn of_sum(to: &Vector, factor: &Element, row: &Vector) -> Self {
        if factor.value().is_exact() && is_exact(to) && is_exact(row) {
            return Self(0.0);
        }
        Self(ROUNDING * largest(to).max(size(factor) * largest(row)))
    }

    /// The bound on pivots that would lose digits.
    pub(super) fn of_pivots(vector: &Vector) -> Self {
        if is_exact(vector) {
            return Self(0.0);
        }
        Self(SMALL * largest(vector))
    }

    /// Whether the bound is at least the size of an entry that is not exact.
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
