//! A linear solve whose pivots were fixed when the code was generated, with a
//! second way for states where they are unfit.

use crate::{Scalar, solve_pivoted};

/// Below this part of their usual size the fixed pivots are not trusted: about
/// three of sixteen digits may be lost there, and not more.
pub const PIVOT_BOUND: f64 = 1e-3;

/// A solution and its condition.
///
/// - `fixed`: the solution by the fixed order of pivots.
/// - `margin`: the smallest of those pivots relative to its usual size.
/// - `system`: A and B of A X = B, all rows; asked for only where `margin` is
///   not above [`PIVOT_BOUND`] (or NaN) in some lane, and then solved with
///   pivoting in these lanes.
/// - returns X, and `margin` or, where X was solved anew, the pivot ratio of
///   [`solve_pivoted`]; never above 1.
///
/// ```
/// use regen_runtime::solve_guarded;
///
/// // The fixed pivot of x + y = 3, x - y = 1 is the 1 in front of x: fine here.
/// let system = || ([[1.0, 1.0], [1.0, -1.0]], [[3.0], [1.0]]);
/// let (x, condition) = solve_guarded([[2.0], [1.0]], 1.0, system);
/// assert_eq!((x, condition), ([[2.0], [1.0]], 1.0));
/// // In 0 x + y = 1, x + y = 3 it is gone.
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
