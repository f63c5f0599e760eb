//! The linear solve with complete pivoting, used where the fixed pivot order of generated code is
//! not accurate.

use crate::Scalar;

/// The divisor of a row or column is at least this fraction of the largest divisor: smaller rows
/// and columns may contain nothing but rounding errors and are not scaled up fully.
const MIN_SCALE_RATIO: f64 = 1.0 / 1024.0;

/// Solves A X = B with complete pivoting; returns X and the reciprocal pivot ratio.
///
/// - `a`: A, `R` rows of `N` coefficients, `R >= N`. Where there are more rows than unknowns
///   the system must be consistent; the rows that depend on others are not used.
/// - `b`: B, `R` rows, one column per right-hand side.
/// - returns X, `N` rows of `K`, and the ratio of the smallest to the largest pivot: 1 for a
///   multiple of a permutation, 0 for a singular A, where X is meaningless and may not be finite.
///   The ratio depends on the units of A: give lengths in units of the mechanism's size. A NaN or
///   an infinity anywhere in A or B gives NaN everywhere.
///
/// Pivots are chosen from rows and columns divided by their largest entries, so that the choice
/// does not depend on metres beside radians; but entries below a thousandth of the largest are not
/// scaled up fully, since dependent rows may contain nothing but rounding errors. The choice is
/// made by [`Scalar::select`]: every SIMD lane pivots separately.
///
/// `N = 0` and `R < N` do not compile.
///
/// ```
/// use regen_runtime::solve_pivoted;
///
/// // The third row is the sum of the others.
/// let a = [[0.0, 2.0], [1.0, 0.0], [1.0, 2.0]];
/// let b = [[6.0], [1.0], [7.0]];
/// let (x, ratio) = solve_pivoted(&a, &b);
/// assert_eq!(x, [[1.0], [3.0]]);
/// assert!(ratio > 0.4 && ratio <= 1.0);
///
/// let (_, ratio) = solve_pivoted(&[[1.0, 2.0], [2.0, 4.0]], &[[1.0], [2.0]]);
/// assert_eq!(ratio, 0.0);
/// ```
#[cold]
#[inline(never)]
pub fn solve_pivoted<T: Scalar, const R: usize, const N: usize, const K: usize>(
    a: &[[T; N]; R],
    b: &[[T; K]; R],
) -> ([[T; K]; N], T) {
    const {
        assert!(
            N > 0 && R >= N,
            "a solve needs unknowns, and a row for each"
        );
    };
    // in range by the assertion above, so that the compiler emits no bounds check
    let proto = a[0][0];
    let zero = proto.splat(0.0);
    let one = proto.splat(1.0);

    let mut a = *a;
    let mut b = *b;
    let poison = non_finite(&a, zero) + non_finite(&b, zero);
    let (mut row_scale, mut column_scale) = equilibrate(&mut a, &mut b, zero, one);

    // `order` follows the swaps of columns: entry k is the index of the unknown of column k
    let mut order = [zero; N];
    for (k, slot) in order.iter_mut().enumerate() {
        *slot = proto.splat(k as f64);
    }
    eliminate(
        &mut a,
        &mut b,
        &mut row_scale,
        &mut column_scale,
        &mut order,
    );
    let ratio = pivot_ratio(&a, &row_scale, &column_scale, zero);
    let solved = substitute(&a, &b, zero);

    let mut x = [[zero; K]; N];
    for (j, row) in x.iter_mut().enumerate() {
        let half_below = proto.splat(j as f64 - 0.5);
        let half_above = proto.splat(j as f64 + 0.5);
        for ((at, scale), value) in order.iter().zip(&column_scale).zip(&solved) {
            let above = half_below.less(*at);
            let below = at.less(half_above);
            for (out, v) in row.iter_mut().zip(value) {
                *out = T::select(above, T::select(below, *v / *scale, *out), *out);
            }
        }
        for out in row.iter_mut() {
            *out = *out + poison;
        }
    }
    (x, ratio + poison)
}

/// Zero, or NaN if any entry is NaN or infinite.
fn non_finite<T: Scalar, const C: usize>(rows: &[[T; C]], zero: T) -> T {
    rows.iter()
        .flatten()
        .fold(zero, |sum, entry| sum + *entry * zero)
}

/// Divides rows of A and B, then columns of A, by their largest entry; returns the divisors of
/// both.
fn equilibrate<T: Scalar, const R: usize, const N: usize, const K: usize>(
    a: &mut [[T; N]; R],
    b: &mut [[T; K]; R],
    zero: T,
    one: T,
) -> ([T; R], [T; N]) {
    let mut rows = [zero; R];
    for (largest, row) in rows.iter_mut().zip(a.iter()) {
        *largest = tail_max(row, 0, zero);
    }
    bound(&mut rows, zero, one);
    for ((row, side), divisor) in a.iter_mut().zip(b.iter_mut()).zip(&rows) {
        for entry in row.iter_mut().chain(side.iter_mut()) {
            *entry = *entry / *divisor;
        }
    }
    let mut columns = [zero; N];
    for row in a.iter() {
        for (m, entry) in columns.iter_mut().zip(row) {
            *m = larger(*m, entry.abs());
        }
    }
    bound(&mut columns, zero, one);
    for row in a.iter_mut() {
        for (entry, divisor) in row.iter_mut().zip(&columns) {
            *entry = *entry / *divisor;
        }
    }
    (rows, columns)
}

/// Turns the sizes of rows or columns into divisors: none below [`MIN_SCALE_RATIO`] of the largest,
/// and none zero.
fn bound<T: Scalar>(sizes: &mut [T], zero: T, one: T) {
    let largest = sizes.iter().fold(zero, |m, size| larger(m, *size));
    let floor = largest * zero.splat(MIN_SCALE_RATIO);
    for size in sizes {
        let divisor = larger(*size, floor);
        *size = T::select(zero.less(divisor), divisor, one);
    }
}

/// The ratio of the smallest to the largest pivot, in the units of A; 0 where all are zero.
fn pivot_ratio<T: Scalar, const R: usize, const N: usize>(
    a: &[[T; N]; R],
    row_scale: &[T; R],
    column_scale: &[T; N],
    zero: T,
) -> T {
    let mut extremes = None;
    for (((k, row), r), c) in a.iter().enumerate().zip(row_scale).zip(column_scale) {
        let Some(pivot) = row.get(k) else {
            break;
        };
        let size = (*pivot * *r * *c).abs();
        extremes = Some(match extremes {
            None => (size, size),
            Some((smallest, largest)) => (smaller(smallest, size), larger(largest, size)),
        });
    }
    let (smallest, largest) = extremes.unwrap_or((zero, zero));
    T::select(zero.less(largest), smallest / largest, zero)
}

/// Eliminates with complete pivoting: the first N rows become an upper triangle. The scales and the
/// order of the unknowns follow the swaps of rows and columns.
fn eliminate<T: Scalar, const R: usize, const N: usize, const K: usize>(
    a: &mut [[T; N]; R],
    b: &mut [[T; K]; R],
    row_scale: &mut [T; R],
    column_scale: &mut [T; N],
    order: &mut [T; N],
) {
    for k in 0..N {
        let Some((above, mut rows)) = a.split_at_mut_checked(k) else {
            break;
        };
        let (Some((_, mut sides)), Some((_, mut scales))) =
            (b.split_at_mut_checked(k), row_scale.split_at_mut_checked(k))
        else {
            break;
        };
        let (Some(top), Some(top_side), Some(top_scale)) = (
            rows.split_off_first_mut(),
            sides.split_off_first_mut(),
            scales.split_off_first_mut(),
        ) else {
            break;
        };

        // After this pass the top row holds the largest entry.
        let below = rows.iter_mut().zip(sides.iter_mut()).zip(scales);
        for ((row, side), scale) in below {
            let swap = tail_max(top, k, *scale).less(tail_max(row, k, *scale));
            for (p, q) in top.iter_mut().zip(row.iter_mut()) {
                exchange(swap, p, q);
            }
            for (p, q) in top_side.iter_mut().zip(side.iter_mut()) {
                exchange(swap, p, q);
            }
            exchange(swap, top_scale, scale);
        }
        // After this pass that entry is in column k.
        for j in k + 1..N {
            let (Some(at), Some(other)) = (top.get(k), top.get(j)) else {
                break;
            };
            let swap = at.abs().less(other.abs());
            exchange_columns(swap, order, k, j);
            exchange_columns(swap, column_scale, k, j);
            exchange_columns(swap, top, k, j);
            for row in rows.iter_mut().chain(above.iter_mut()) {
                exchange_columns(swap, row, k, j);
            }
        }

        let Some(pivot) = top.get(k).copied() else {
            break;
        };
        for (row, side) in rows.iter_mut().zip(sides.iter_mut()) {
            let Some(entry) = row.get(k).copied() else {
                break;
            };
            let factor = -(entry / pivot);
            for (q, p) in row.iter_mut().zip(top.iter()).skip(k) {
                *q = factor.mul_add(*p, *q);
            }
            for (q, p) in side.iter_mut().zip(top_side.iter()) {
                *q = factor.mul_add(*p, *q);
            }
        }
    }
}

/// Solves the upper triangle in the first N rows.
fn substitute<T: Scalar, const R: usize, const N: usize, const K: usize>(
    a: &[[T; N]; R],
    b: &[[T; K]; R],
    zero: T,
) -> [[T; K]; N] {
    let mut x = [[zero; K]; N];
    for k in (0..N).rev() {
        let (Some(row), Some(side)) = (a.get(k), b.get(k)) else {
            break;
        };
        let (Some(pivot), Some((head, known))) = (row.get(k), x.split_at_mut_checked(k + 1)) else {
            break;
        };
        let Some(unknown) = head.last_mut() else {
            break;
        };
        *unknown = *side;
        for (coefficient, values) in row.iter().skip(k + 1).zip(known.iter()) {
            for (u, v) in unknown.iter_mut().zip(values) {
                *u = (-*coefficient).mul_add(*v, *u);
            }
        }
        for u in unknown.iter_mut() {
            *u = *u / *pivot;
        }
    }
    x
}

/// The largest entry of a row from column `k` on.
fn tail_max<T: Scalar, const N: usize>(row: &[T; N], k: usize, proto: T) -> T {
    row.iter()
        .skip(k)
        .fold(proto.splat(0.0), |m, entry| larger(m, entry.abs()))
}

/// The larger of two values; NaN entries are handled once, by `non_finite`.
fn larger<T: Scalar>(a: T, b: T) -> T {
    T::select(a.less(b), b, a)
}

fn smaller<T: Scalar>(a: T, b: T) -> T {
    T::select(b.less(a), b, a)
}

fn exchange<T: Scalar>(swap: T::Mask, p: &mut T, q: &mut T) {
    let (old_p, old_q) = (*p, *q);
    *p = T::select(swap, old_q, old_p);
    *q = T::select(swap, old_p, old_q);
}

fn exchange_columns<T: Scalar, const N: usize>(
    swap: T::Mask,
    row: &mut [T; N],
    k: usize,
    j: usize,
) {
    let (Some(old_k), Some(old_j)) = (row.get(k).copied(), row.get(j).copied()) else {
        return;
    };
    if let Some(p) = row.get_mut(k) {
        *p = T::select(swap, old_j, old_k);
    }
    if let Some(q) = row.get_mut(j) {
        *q = T::select(swap, old_k, old_j);
    }
}
