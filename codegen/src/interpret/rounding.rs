//! Numbers that carry a bound of their rounding error through a program.
//!
//! A running error analysis (Wilkinson; Higham, *Accuracy and Stability of Numerical Algorithms*,
//! section 3.3): each value carries a bound that the error of a computation in the given format
//! cannot exceed, whichever multiply-adds the compiler fuses, as long as nothing overflows or
//! underflows. The bound follows from the operations and the sizes of their operands at the given
//! state; it has no fitted constants.

use std::marker::PhantomData;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::Number;

/// A format of floating-point numbers.
pub trait Precision: Copy {
    /// The unit roundoff: half the distance from 1 to the next number.
    const UNIT: f64;

    /// Whether the format represents a number exactly.
    fn represents(value: f64) -> bool;
}

/// Single precision, `f32`.
#[derive(Clone, Copy, Debug)]
pub struct Single;

/// Double precision, `f64`.
#[derive(Clone, Copy, Debug)]
pub struct Double;

impl Precision for Single {
    const UNIT: f64 = f32::EPSILON as f64 / 2.0;

    fn represents(value: f64) -> bool {
        f64::from(value as f32).to_bits() == value.to_bits()
    }
}

impl Precision for Double {
    const UNIT: f64 = f64::EPSILON / 2.0;

    fn represents(value: f64) -> bool {
        // A constant of a program was rounded once from its exact value. A constant that single
        // precision represents is a small whole number or fraction, and was exact.
        Single::represents(value)
    }
}

/// Bound of the errors of sines and cosines, in units of roundoff: libraries, and the polynomials
/// of SIMD lanes, are within one unit in the last place of 1, which is two roundoffs.
const SINE_ERROR_ROUNDOFFS: f64 = 2.0;

/// A value, and a bound of the error that a computation in the format `P` has accumulated in it.
///
/// ```
/// use regen_codegen::interpret::{Rounded, Single};
///
/// // (1/3 + 1e-8) - 1/3: single precision loses most digits of 1e-8, and the bound shows it.
/// let third = Rounded::<Single>::nearest(1.0 / 3.0);
/// let rest = (third + Rounded::nearest(1e-8)) - third;
/// let single = ((1.0_f32 / 3.0 + 1e-8) - 1.0 / 3.0) as f64;
/// assert!((single - rest.value).abs() <= rest.error);
/// assert!(rest.error > 1e-8 && rest.error < 1e-6);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Rounded<P> {
    /// The value, in double precision.
    pub value: f64,
    /// The bound of the error; infinite if there is none.
    pub error: f64,
    precision: PhantomData<P>,
}

impl<P: Precision> Rounded<P> {
    fn new(value: f64, error: f64) -> Self {
        Self {
            value,
            // NaN: no bound exists
            error: if error.is_nan() { f64::INFINITY } else { error },
            precision: PhantomData,
        }
    }

    /// A number that the format represents exactly.
    pub fn exact(value: f64) -> Self {
        Self::new(value, 0.0)
    }

    /// A number that is known to this error.
    pub fn within(value: f64, error: f64) -> Self {
        Self::new(value, error)
    }

    /// A number that is rounded to the nearest one of the format.
    pub fn nearest(value: f64) -> Self {
        Self::new(value, value.abs() * P::UNIT)
    }

    /// The result of an operation: adds its own rounding error to the propagated `error`.
    fn after(value: f64, error: f64) -> Self {
        Self::new(value, error + (value.abs() + error) * P::UNIT)
    }
}

impl<P: Precision> Add for Rounded<P> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::after(self.value + other.value, self.error + other.error)
    }
}

impl<P: Precision> Sub for Rounded<P> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::after(self.value - other.value, self.error + other.error)
    }
}

impl<P: Precision> Mul for Rounded<P> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let error = self.value.abs() * other.error
            + other.value.abs() * self.error
            + self.error * other.error;
        Self::after(self.value * other.value, error)
    }
}

impl<P: Precision> Div for Rounded<P> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let least = other.value.abs() - other.error;
        // a divisor that may be zero, or NaN, leaves no bound
        let error = if least > 0.0 {
            (self.error + value.abs() * other.error) / least
        } else {
            f64::INFINITY
        };
        Self::after(value, error)
    }
}

impl<P: Precision> Neg for Rounded<P> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.value, self.error)
    }
}

impl<P: Precision> Number for Rounded<P> {
    fn constant(value: f64) -> Self {
        if P::represents(value) {
            Self::exact(value)
        } else {
            Self::nearest(value)
        }
    }

    fn value(self) -> f64 {
        self.value
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = (libm::sin(self.value), libm::cos(self.value));
        // sine and cosine change no faster than the angle, and by no more than 2 in all
        let error = self.error.min(2.0) + SINE_ERROR_ROUNDOFFS * P::UNIT;
        (Self::new(sin, error), Self::new(cos, error))
    }

    fn sqrt(self) -> Self {
        let root = libm::sqrt(self.value);
        // the error of the root is at most that of the value over twice the smallest root; near
        // zero, where this is infinite, it is at most the root of the error
        let smallest = libm::sqrt((self.value - self.error).max(0.0));
        let by_slope = self.error / (2.0 * smallest);
        let error = if by_slope.is_finite() {
            by_slope.min(libm::sqrt(self.error))
        } else {
            libm::sqrt(self.error)
        };
        Self::new(root, error + P::UNIT * root)
    }

    /// Solves by elimination with complete pivoting as in the runtime, with the errors of each
    /// operation.
    fn solve(matrix: &[Vec<Self>], rhs: &[Vec<Self>]) -> (Vec<Vec<Self>>, f64) {
        let values = |rows: &[Vec<Self>]| -> Vec<Vec<f64>> {
            let rows = rows.iter();
            rows.map(|row| row.iter().map(|x| x.value).collect())
                .collect()
        };
        let (solution, ratio) = f64::solve(&values(matrix), &values(rhs));
        let bounds = eliminate(matrix.to_vec(), rhs.to_vec());
        let with = |row: Vec<f64>, bounds: Vec<f64>| -> Vec<Self> {
            let both = row.into_iter().zip(bounds);
            both.map(|(value, error)| Self::new(value, error)).collect()
        };
        let out = solution.into_iter().zip(bounds);
        (out.map(|(row, bounds)| with(row, bounds)).collect(), ratio)
    }
}

/// Bounds of the errors of a system's solution by elimination with complete pivoting.
fn eliminate<P: Precision>(
    mut a: Vec<Vec<Rounded<P>>>,
    mut b: Vec<Vec<Rounded<P>>>,
) -> Vec<Vec<f64>> {
    let (rows, unknowns) = (a.len(), a.first().map_or(0, Vec::len));
    let sides = b.first().map_or(0, Vec::len);
    let nothing = vec![vec![f64::INFINITY; sides]; unknowns];
    // rows are first divided by their largest entry: one rounding each
    for (row, side) in a.iter_mut().zip(&mut b) {
        let size = row.iter().fold(0.0_f64, |m, x| m.max(x.value.abs()));
        if size > 0.0 {
            for x in row.iter_mut().chain(side) {
                *x = *x / Rounded::exact(size);
            }
        }
    }
    let mut columns: Vec<usize> = (0..unknowns).collect();
    for k in 0..unknowns {
        let places = (k..rows).flat_map(|i| (k..unknowns).map(move |j| (i, j)));
        let largest = places.max_by(|x, y| {
            let size = |&(i, j): &(usize, usize)| a[i][j].value.abs();
            size(x).total_cmp(&size(y))
        });
        let Some((row, column)) = largest.filter(|&(i, j)| a[i][j].value != 0.0) else {
            return nothing;
        };
        a.swap(k, row);
        b.swap(k, row);
        for row in &mut a {
            row.swap(k, column);
        }
        columns.swap(k, column);
        let (pivot_a, pivot_b) = (a[k].clone(), b[k].clone());
        for i in k + 1..rows {
            let factor = a[i][k] / pivot_a[k];
            for (x, p) in a[i].iter_mut().zip(&pivot_a).skip(k + 1) {
                *x = *x - factor * *p;
            }
            for (x, p) in b[i].iter_mut().zip(&pivot_b) {
                *x = *x - factor * *p;
            }
        }
    }
    let mut solved = vec![vec![Rounded::exact(0.0); sides]; unknowns];
    for k in (0..unknowns).rev() {
        for side in 0..sides {
            let known = (k + 1..unknowns)
                .map(|j| a[k][j] * solved[columns[j]][side])
                .fold(Rounded::exact(0.0), |sum, x| sum + x);
            solved[columns[k]][side] = (b[k][side] - known) / a[k][k];
        }
    }
    let errors = solved.into_iter();
    errors
        .map(|row| row.into_iter().map(|x| x.error).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// A pseudorandom number in [-1, 1).
    fn random(state: &mut u64) -> f64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Chains of operations in single precision stay within their bounds, however much cancels.
    #[test]
    fn no_chain_of_operations_leaves_its_bound() {
        let mut state = 7;
        for _ in 0..2000 {
            let start = random(&mut state) as f32;
            let mut single = start;
            let mut bound = Rounded::<Single>::exact(f64::from(start));
            for _ in 0..30 {
                let other = random(&mut state) as f32;
                let tracked = Rounded::exact(f64::from(other));
                (single, bound) = match (random(&mut state) * 3.0) as i32 {
                    0 => (single + other, bound + tracked),
                    1 => (single * other, bound * tracked),
                    -1 => (single / other, bound / tracked),
                    2 => (single - other, bound - tracked),
                    _ => (single.sin(), bound.sin_cos().0),
                };
                let missed = (f64::from(single) - bound.value).abs();
                assert!(missed <= bound.error * (1.0 + 1e-9), "{missed:e} {bound:?}");
            }
        }
    }

    #[test]
    fn a_divisor_that_may_be_zero_leaves_no_bound() {
        let tiny = Rounded::<Single>::nearest(1.0) - Rounded::nearest(1.0 - 1e-8);
        let quotient = Rounded::exact(1.0) / tiny;
        assert!(quotient.error.is_infinite());
        assert!((quotient * Rounded::exact(2.0)).error.is_infinite());
        assert!((quotient * Rounded::exact(0.0)).error.is_infinite());
    }

    /// The bound of a solved system holds in single precision, and grows as the system becomes
    /// singular.
    #[test]
    fn a_solved_system_stays_within_its_bound() {
        let bound_at = |angle: f64| {
            let row = |x: f64, y: f64| vec![Rounded::<Single>::constant(x), Rounded::constant(y)];
            let a = [row(1.0, 1.0), row(1.0, 1.0 + angle)];
            let b = [vec![Rounded::constant(1.0)], vec![Rounded::constant(2.0)]];
            let (x, _) = Rounded::solve(&a, &b);
            (x[0][0].value, x[0][0].error)
        };
        for angle in [1.0, 0.1, 1e-2, 1e-3] {
            let (value, error) = bound_at(angle);
            let d = 1.0 + angle as f32;
            // Cramer's rule in single precision
            let single = (d - 2.0) / (d - 1.0);
            assert!((f64::from(single) - value).abs() <= 4.0 * error);
        }
        assert!(bound_at(1e-3).1 > 100.0 * bound_at(1.0).1);
        assert!(bound_at(1e-9).1.is_infinite());
    }
}
