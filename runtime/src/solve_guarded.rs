//! A linear solve in the pivot order that was fixed when the code was generated, replaced by a
//! solve with complete pivoting at states where that order is unfit.

use crate::{Scalar, solve_pivoted};

/// The least pivot, relative to its usual size, for which the fixed pivot order is used: about
/// three of sixteen digits may be lost at this bound, and not more above it.
pub const PIVOT_BOUND: f64 = 1e-3;

/// Returns the solution with the fixed pivot order or, where its pivots are too small, solves again
/// with complete pivoting; returns the pivot ratio too.
///
/// - `fixed`: the solution with the fixed pivot order.
/// - `margin`: the smallest pivot of that order relative to its usual size.
/// - `system`: computes A and B of A X = B, all rows. It is called only if `margin` is not above
///   [`PIVOT_BOUND`] (or NaN) in some lane; these lanes are then solved with complete pivoting.
/// - returns X, and `margin` or, where X was solved again, the pivot ratio of [`solve_pivoted`];
///   never above 1.
///
/// ```
/// use regen_runtime::solve_guarded;
///
/// // The fixed pivot of x + y = 3, x - y = 1 is the 1 in front of x: fine here.
/// let system = || ([[1.0, 1.0], [1.0, -1.0]], [[3.0], [1.0]]);
/// let (x, condition) = solve_guarded([[2.0], [1.0]], 1.0, system);
/// assert_eq!((x, condition), ([[2.0], [1.0]], 1.0));
/// // In 0 x + y = 1, x + y = 3 this pivot is 0: the system is solved again.
/// let system = || ([[0.0, 1.0], [1.0, 1.0]], [[1.0], [3.0]]);
/// let (x, condition) = solve_guarded([[f64::NAN]; 2], 0.0, system);
/// assert_eq!(x, [[2.0], [1.0]]);
/// assert!(condition > 0.5);
/// ```
#[inline(always)]
#[allow(
    clippy::inline_always,
    reason = "a SIMD lane needs every step inlined into the dispatched function"
)]
pub fn solve_guarded<T: Scalar, const R: usize, const N: usize, const K: usize>(
    fixed: [[T; K]; N],
    margin: T,
    system: impl FnOnce() -> ([[T; N]; R], [[T; K]; R]),
) -> ([[T; K]; N], T) {
    let trusted = margin.splat(PIVOT_BOUND).less(margin);
    let one = margin.splat(1.0);
    if T::all(trusted) {
        return (fixed, margin.min(one));
    }
    let (a, b) = system();
    let (anew, ratio) = solve_pivoted(&a, &b);
    let mut x = fixed;
    for (row, anew) in x.iter_mut().zip(anew) {
        for (entry, anew) in row.iter_mut().zip(anew) {
            *entry = T::select(trusted, *entry, anew);
        }
    }
    (x, T::select(trusted, margin, ratio).min(one))
}
