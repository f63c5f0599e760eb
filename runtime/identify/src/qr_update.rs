//! Updates a QR factor by further rows with Householder reflections.
#![allow(
    clippy::inline_always,
    reason = "what is left as a call is compiled without the token's instruction set"
)]

use pulp::{Arch, Simd, WithSimd};

/// Rows reduced at a time: with some 40 columns they fit the second-level cache.
pub(crate) const BLOCK: usize = 256;

/// Reduces the rows of `[block | side]` into the triangle `[r | z]`; returns the residual sum of
/// squares that these rows add.
///
/// - `r`: n x n, upper triangular, column-major; its diagonal becomes non-negative.
/// - `block`: n columns of `rows` entries each, column-major; `side`: one column; both are
///   overwritten.
///
/// The reflection for column k changes only row k of the triangle and the block, so the zeros of
/// the triangle cost nothing.
pub(crate) fn reduce(
    r: &mut [f64],
    z: &mut [f64],
    block: &mut [f64],
    side: &mut [f64],
    rows: usize,
) -> f64 {
    Arch::new().dispatch(Reduce {
        r,
        z,
        block,
        side,
        rows,
    })
}

/// [`reduce`] as a task for one instruction set: sums have eight parts in all of them, so that they
/// do not depend on it.
struct Reduce<'a> {
    r: &'a mut [f64],
    z: &'a mut [f64],
    block: &'a mut [f64],
    side: &'a mut [f64],
    rows: usize,
}

impl WithSimd for Reduce<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        reduce_rows(self.r, self.z, self.block, self.side, self.rows)
    }
}

#[inline(always)]
fn reduce_rows(
    r: &mut [f64],
    z: &mut [f64],
    block: &mut [f64],
    side: &mut [f64],
    rows: usize,
) -> f64 {
    let n = z.len();
    if rows == 0 {
        return 0.0;
    }
    let (columns, _) = block.split_at_mut(n * rows);
    let mut rest = columns;
    for k in 0..n {
        let (v, later) = rest.split_at_mut(rows);
        rest = later;
        let tail = dot(v, v);
        let alpha = r[k * n + k];
        if tail == 0.0 {
            if alpha < 0.0 {
                flip(r, z, k);
            }
            continue;
        }
        let norm = alpha.mul_add(alpha, tail).sqrt();
        // of the sign opposite to alpha, so that nothing cancels; `flip` restores the sign below
        let beta = if alpha > 0.0 { -norm } else { norm };
        // the reflection is 1 - u u^T / h with u = (alpha - beta, v)
        let head = alpha - beta;
        let h = -beta * head;
        r[k * n + k] = beta;
        let mut column = k + 1;
        let mut pairs = rest.chunks_exact_mut(2 * rows);
        for pair in &mut pairs {
            let (a, b) = pair.split_at_mut(rows);
            let (pa, pb) = dots(v, a, b);
            let (ra, rb) = (column * n + k, (column + 1) * n + k);
            let sa = head.mul_add(r[ra], pa) / h;
            let sb = head.mul_add(r[rb], pb) / h;
            r[ra] -= sa * head;
            r[rb] -= sb * head;
            subtract_two(v, a, sa, b, sb);
            column += 2;
        }
        let last = pairs.into_remainder();
        if !last.is_empty() {
            let at = column * n + k;
            let s = head.mul_add(r[at], dot(v, last)) / h;
            r[at] -= s * head;
            subtract(v, last, s);
        }
        let s = head.mul_add(z[k], dot(v, side)) / h;
        z[k] -= s * head;
        subtract(v, side, s);
        if beta < 0.0 {
            flip(r, z, k);
        }
    }
    dot(side, side)
}

/// Changes the sign of row k of the triangle.
fn flip(r: &mut [f64], z: &mut [f64], k: usize) {
    let n = z.len();
    for column in k..n {
        r[column * n + k] = -r[column * n + k];
    }
    z[k] = -z[k];
}

/// Number of independent sums, which the compiler keeps in vector registers.
const LANES: usize = 8;

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (x, y) in a.iter().zip(b) {
        for l in 0..LANES {
            sums[l] += x[l] * y[l];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + rest
}

/// The dot products of `v` with two columns, reading `v` once.
#[inline(always)]
fn dots(v: &[f64], a: &[f64], b: &[f64]) -> (f64, f64) {
    let (v, v_rest) = v.as_chunks::<LANES>();
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    let mut first = [0.0; LANES];
    let mut second = [0.0; LANES];
    for ((x, y), z) in v.iter().zip(a).zip(b) {
        for l in 0..LANES {
            first[l] += x[l] * y[l];
            second[l] += x[l] * z[l];
        }
    }
    let mut sums = (first.iter().sum::<f64>(), second.iter().sum::<f64>());
    for ((x, y), z) in v_rest.iter().zip(a_rest).zip(b_rest) {
        sums.0 += x * y;
        sums.1 += x * z;
    }
    sums
}

#[inline(always)]
fn subtract(v: &[f64], a: &mut [f64], s: f64) {
    for (x, y) in v.iter().zip(a) {
        *y -= s * x;
    }
}

#[inline(always)]
fn subtract_two(v: &[f64], a: &mut [f64], sa: f64, b: &mut [f64], sb: f64) {
    for ((x, y), z) in v.iter().zip(a).zip(b) {
        *y -= sa * x;
        *z -= sb * x;
    }
}

/// Solves R x = z by back substitution; `None` if a diagonal entry is zero.
pub(crate) fn substitute(r: &[f64], z: &[f64]) -> Option<Vec<f64>> {
    let n = z.len();
    let mut x = z.to_vec();
    for k in (0..n).rev() {
        let pivot = r[k * n + k];
        if pivot == 0.0 {
            return None;
        }
        x[k] /= pivot;
        let value = x[k];
        for i in 0..k {
            x[i] -= r[k * n + i] * value;
        }
    }
    Some(x)
}
