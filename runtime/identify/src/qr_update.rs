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
    // a column of zeros in rows and triangle stays zero, as many do where an effort does not depend
    // on all parameters
    let present = |(k, column): &(usize, &mut [f64])| {
        let above = &r[k * n..=k * n + k];
        column.iter().chain(above).any(|x| *x != 0.0)
    };
    let mut rest: Vec<(usize, &mut [f64])> = (0..n)
        .zip(columns.chunks_exact_mut(rows))
        .filter(present)
        .collect();
    let mut rest = rest.as_mut_slice();
    while let Some(((k, v), later)) = rest.split_first_mut() {
        let (k, v) = (*k, &**v);
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
        let mut pairs = rest.chunks_exact_mut(2);
        for pair in &mut pairs {
            if let [(first, a), (second, b)] = pair {
                let (pa, pb) = dots(v, a, b);
                let (ra, rb) = (*first * n + k, *second * n + k);
                let sa = head.mul_add(r[ra], pa) / h;
                let sb = head.mul_add(r[rb], pb) / h;
                r[ra] -= sa * head;
                r[rb] -= sb * head;
                subtract_two(v, a, sa, b, sb);
            }
        }
        if let [(column, last)] = pairs.into_remainder() {
            let at = *column * n + k;
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
        let (above, _) = x.split_at_mut(k);
        for (x, r) in above.iter_mut().zip(&r[k * n..]) {
            *x -= r * value;
        }
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of zeros, in all rows or in those of one block, change nothing: the triangle's squares
    /// are those of the rows.
    #[test]
    fn rows_and_columns_of_zeros_are_left_out() {
        let (n, rows, first) = (6, 11, 2);
        let mut seed = 3_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / 2_f64.powi(30) - 1.0
        };
        // column 4 has no entries, and columns 0 and 1 have none in the second block
        let mut entry = |j: usize| if j == 4 { 0.0 } else { random() };
        let one: Vec<f64> = (0..n * rows).map(|k| entry(k / rows)).collect();
        let two: Vec<f64> = (0..n * rows)
            .map(|k| {
                if k / rows < first {
                    0.0
                } else {
                    entry(k / rows)
                }
            })
            .collect();
        let (mut r, mut z) = (vec![0.0; n * n], vec![0.0; n]);
        reduce(&mut r, &mut z, &mut one.clone(), &mut vec![1.0; rows], rows);
        let side = &mut vec![0.5; rows];
        reduce(&mut r, &mut z, &mut two.clone(), side, rows);
        let dot = |a: usize, b: usize| -> f64 {
            let of = |all: &[f64]| -> f64 {
                (0..rows)
                    .map(|i| all[a * rows + i] * all[b * rows + i])
                    .sum()
            };
            of(&one) + of(&two)
        };
        for a in 0..n {
            for b in 0..=a {
                let found: f64 = (0..=b).map(|k| r[a * n + k] * r[b * n + k]).sum();
                assert!((found - dot(a, b)).abs() < 1e-14, "{a} {b}");
            }
            assert!(r[a * n + a] >= 0.0);
            let sum = |all: &[f64]| all[a * rows..(a + 1) * rows].iter().sum::<f64>();
            let found: f64 = (0..=a).map(|k| r[a * n + k] * z[k]).sum();
            assert!((found - sum(&one) - 0.5 * sum(&two)).abs() < 1e-13);
        }
    }
}
