//! Updates a QR factor by further rows with Householder reflections.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

mod pair;

use pair::Pair;
use pulp::{Arch, Simd, WithSimd};

/// Rows reduced at a time: with some 40 columns they fit the second-level cache.
pub(crate) const BLOCK: usize = 256;

/// A column whose squares add up to less than this is zero. Each column that depends on those before it
/// leaves rounding errors of those that came before, so that behind some twenty of them the squares
/// underflow, and a reflection would divide by zero.
pub(crate) const NOTHING: f64 = f64::MIN_POSITIVE / (f64::EPSILON * f64::EPSILON);

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
    Arch::new().dispatch(Reduce::new(r, z, block, side, rows))
}

/// As [`reduce`], with two reflections of the columns behind them at a time: many rows of many columns
/// take about half the time, and the factor differs by rounding.
pub(crate) fn reduce_by_pairs(
    r: &mut [f64],
    z: &mut [f64],
    block: &mut [f64],
    side: &mut [f64],
    rows: usize,
) -> f64 {
    Arch::new().dispatch(Reduce {
        by_pairs: true,
        ..Reduce::new(r, z, block, side, rows)
    })
}

/// The reflection of one column: `1 - u u^T / h` with u = (head, v), where v is what [`reduce`]
/// leaves of the column.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Reflection {
    head: f64,
    /// 0 if the column was zero and needed no reflection.
    h: f64,
    /// Whether the row of the triangle changes its sign afterwards.
    flipped: bool,
}

impl Reflection {
    /// The reflection that makes a column `v` below the entry `top` of the triangle zero; `top` becomes
    /// what it is afterwards, but for its sign.
    #[inline(always)]
    fn of(v: &[f64], top: &mut f64) -> Self {
        let tail = dot(v, v);
        let alpha = *top;
        if tail < NOTHING {
            return Self {
                flipped: alpha < 0.0,
                ..Self::default()
            };
        }
        let norm = alpha.mul_add(alpha, tail).sqrt();
        // of the sign opposite to alpha, so that nothing cancels; `flip` restores the sign
        let beta = if alpha > 0.0 { -norm } else { norm };
        *top = beta;
        let head = alpha - beta;
        Self {
            head,
            h: -beta * head,
            flipped: beta < 0.0,
        }
    }

    /// Reflects the entry `top` of a column whose scalar product with v is `product`; returns the
    /// multiple of v that the rest of the column loses.
    #[inline(always)]
    fn reflect(self, top: &mut f64, product: f64) -> f64 {
        let s = self.head.mul_add(*top, product) / self.h;
        *top -= s * self.head;
        s
    }

    /// Reflects columns of as many rows as `v` has.
    ///
    /// - `tops`: their entries in the row of the triangle, each `n` behind the one before.
    #[inline(always)]
    fn apply(self, v: &[f64], columns: &mut [f64], tops: &mut [f64], n: usize) {
        let mut at = 0;
        let mut pairs = columns.chunks_exact_mut(2 * v.len());
        for pair in &mut pairs {
            let (a, b) = pair.split_at_mut(v.len());
            let (pa, pb) = dots(v, a, b);
            let sa = self.reflect(&mut tops[at], pa);
            let sb = self.reflect(&mut tops[at + n], pb);
            subtract_two(v, a, sa, b, sb);
            at += 2 * n;
        }
        let last = pairs.into_remainder();
        if !last.is_empty() {
            let s = self.reflect(&mut tops[at], dot(v, last));
            subtract(v, last, s);
        }
    }
}

/// As [`reduce`], but returns the reflection of each column, for [`reflect`].
pub(crate) fn reduce_and_keep(
    r: &mut [f64],
    z: &mut [f64],
    block: &mut [f64],
    side: &mut [f64],
    rows: usize,
) -> Vec<Reflection> {
    let mut reflections = vec![Reflection::default(); z.len()];
    Arch::new().dispatch(Reduce {
        reflections: Some(&mut reflections),
        ..Reduce::new(r, z, block, side, rows)
    });
    reflections
}

/// Reflects further columns as [`reduce_and_keep`] did with its own: the result is that of
/// reducing all columns at once, up to the further columns' own reflections.
///
/// - `block`: what `reduce_and_keep` leaves of its columns, `rows` entries each;
/// - `tops`: for each further column, its entries in the rows of the triangle;
/// - `columns`: the further columns, `rows` entries each.
pub(crate) fn reflect(
    reflections: &[Reflection],
    block: &[f64],
    tops: &mut [f64],
    columns: &mut [f64],
    rows: usize,
) {
    if rows > 0 {
        Arch::new().dispatch(Reflect {
            reflections,
            block,
            tops,
            columns,
            rows,
        });
    }
}

/// [`reflect`] as a task for one instruction set.
struct Reflect<'a> {
    reflections: &'a [Reflection],
    block: &'a [f64],
    tops: &'a mut [f64],
    columns: &'a mut [f64],
    rows: usize,
}

impl WithSimd for Reflect<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        reflect_columns(
            self.reflections,
            self.block,
            self.tops,
            self.columns,
            self.rows,
        );
    }
}

#[inline(always)]
fn reflect_columns(
    reflections: &[Reflection],
    block: &[f64],
    tops: &mut [f64],
    columns: &mut [f64],
    rows: usize,
) {
    let n = reflections.len();
    for (k, (reflection, v)) in reflections.iter().zip(block.chunks_exact(rows)).enumerate() {
        if reflection.h != 0.0 {
            reflection.apply(v, columns, tops.get_mut(k..).unwrap_or_default(), n);
        }
        if reflection.flipped {
            tops.iter_mut()
                .skip(k)
                .step_by(n)
                .for_each(|top| *top = -*top);
        }
    }
}

/// [`reduce`] as a task for one instruction set. Each sum has eight partial sums in every
/// instruction set, so that all give the same bits.
struct Reduce<'a> {
    r: &'a mut [f64],
    z: &'a mut [f64],
    block: &'a mut [f64],
    side: &'a mut [f64],
    rows: usize,
    /// Where the reflection of each column is stored, if it is needed later.
    reflections: Option<&'a mut [Reflection]>,
    /// Whether two reflections are applied at a time.
    by_pairs: bool,
}

impl<'a> Reduce<'a> {
    /// One reflection at a time, none of which is stored.
    fn new(
        r: &'a mut [f64],
        z: &'a mut [f64],
        block: &'a mut [f64],
        side: &'a mut [f64],
        rows: usize,
    ) -> Self {
        Self {
            r,
            z,
            block,
            side,
            rows,
            reflections: None,
            by_pairs: false,
        }
    }
}

/// With fewer columns behind two of them, each of the two is reflected alone.
const LEAST_BEHIND_PAIR: usize = 4;

impl WithSimd for Reduce<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Reduce {
            r,
            z,
            block,
            side,
            rows,
            mut reflections,
            by_pairs,
        } = self;
        let n = z.len();
        if rows == 0 {
            return 0.0;
        }
        let mut keep = |k: usize, reflection: Reflection| {
            if let Some(all) = &mut reflections {
                all[k] = reflection;
            }
        };
        let (mut rest, _) = block.split_at_mut(n * rows);
        let mut k = 0;
        while k < n {
            let (v, later) = rest.split_at_mut(rows);
            rest = later;
            let first = Reflection::of(v, &mut r[k * n + k]);
            keep(k, first);
            let is_paired = by_pairs && first.h != 0.0 && n - k >= 2 + LEAST_BEHIND_PAIR;
            if !is_paired {
                if first.h != 0.0 {
                    first.apply(v, rest, r.get_mut((k + 1) * n + k..).unwrap_or_default(), n);
                    first.apply(v, side, &mut z[k..], n);
                }
                if first.flipped {
                    flip(r, z, k);
                }
                k += 1;
                continue;
            }
            let (w, later) = rest.split_at_mut(rows);
            rest = later;
            first.apply(v, w, &mut r[(k + 1) * n + k..], n);
            let second = Reflection::of(w, &mut r[(k + 1) * n + k + 1]);
            keep(k + 1, second);
            let tops = &mut r[(k + 2) * n + k..];
            if second.h == 0.0 {
                first.apply(v, rest, tops, n);
                first.apply(v, side, &mut z[k..], n);
            } else {
                let pair = Pair::new(simd, [first, second], v, w);
                pair.apply(rest, tops, n);
                pair.apply(side, &mut z[k..], n);
            }
            for (at, reflection) in [(k, first), (k + 1, second)] {
                if reflection.flipped {
                    flip(r, z, at);
                }
            }
            k += 2;
        }
        dot(side, side)
    }
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
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns that are reflected later give the triangle of all columns reduced at once, over
    /// several blocks, with a column of zeros among them.
    #[test]
    fn later_columns_give_the_triangle_of_all_columns() {
        let (first, later, rows, blocks) = (5, 3, 20, 3);
        let n = first + later;
        let entry = |block: usize, row: usize, column: usize| match column {
            2 => 0.0,
            _ => {
                ((block * rows + row) as f64 * (0.37 + 0.21 * column as f64) + column as f64).sin()
            }
        };
        let (mut r, mut z, mut rss) = (vec![0.0; n * n], vec![0.0; n], 0.0);
        let (mut own, mut own_z) = (vec![0.0; first * first], vec![0.0; first]);
        let mut tops = vec![0.0; first * later];
        let (mut rest, mut rest_z, mut later_rss) =
            (vec![0.0; later * later], vec![0.0; later], 0.0);
        for block in 0..blocks {
            let fill = |columns: core::ops::Range<usize>| -> Vec<f64> {
                let column = |c| (0..rows).map(move |i| entry(block, i, c));
                columns.flat_map(column).collect()
            };
            let side = fill(20..21);
            rss += reduce(&mut r, &mut z, &mut fill(0..n), &mut side.clone(), rows);
            let (mut a, mut b, mut y) = (fill(0..first), fill(first..n), side);
            let reflections = reduce_and_keep(&mut own, &mut own_z, &mut a, &mut y, rows);
            reflect(&reflections, &a, &mut tops, &mut b, rows);
            later_rss += reduce(&mut rest, &mut rest_z, &mut b, &mut y, rows);
        }
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        for c in 0..n {
            for i in 0..=c {
                let found = match (i < first, c < first) {
                    (true, true) => own[c * first + i],
                    (true, false) => tops[(c - first) * first + i],
                    _ => rest[(c - first) * later + i - first],
                };
                close(r[c * n + i], found);
            }
        }
        z.iter()
            .zip(own_z.iter().chain(&rest_z))
            .for_each(|(a, b)| close(*a, *b));
        close(rss, later_rss);
        assert!(rss > 1.0 && r[n * n - 1] > 0.1);
    }

    #[test]
    fn a_column_without_later_ones_leaves_nothing_to_reflect() {
        let (mut columns, mut side) = block(8, 7, 0);
        let (mut r, mut z) = (vec![0.0; 49], vec![0.0; 7]);
        let reflections = reduce_and_keep(&mut r, &mut z, &mut columns, &mut side, 8);
        reflect(&reflections, &columns, &mut [], &mut [], 8);
    }

    /// Columns of `rows` entries and a side, among them one of zeros, and one that is twice the one
    /// before it.
    fn block(rows: usize, n: usize, number: usize) -> (Vec<f64>, Vec<f64>) {
        let entry = |row: usize, column: usize| match column {
            3 => 0.0,
            _ => ((number * rows + row) as f64 * (0.3 + 0.17 * column as f64)).sin(),
        };
        let column = |c: usize| {
            let (own, factor) = if c == 6 { (5, 2.0) } else { (c, 1.0) };
            (0..rows).map(move |row| factor * entry(row, own))
        };
        ((0..n).flat_map(column).collect(), column(n + 1).collect())
    }

    #[test]
    fn the_triangle_has_the_squares_of_all_rows_for_any_number_of_rows_and_columns() {
        for rows in [1, 3, 8, 20, 41] {
            for n in 1..=13 {
                let (mut r, mut z, mut rss) = (vec![0.0; n * n], vec![0.0; n], 0.0);
                let mut squares = vec![0.0; (n + 1) * (n + 1)];
                for number in 0..4 {
                    let (mut columns, mut side) = block(rows, n, number);
                    let all = [columns.clone(), side.clone()].concat();
                    for (i, a) in all.chunks_exact(rows).enumerate() {
                        for (j, b) in all.chunks_exact(rows).enumerate() {
                            squares[i * (n + 1) + j] += dot(a, b);
                        }
                    }
                    rss += reduce_by_pairs(&mut r, &mut z, &mut columns, &mut side, rows);
                }
                let column = |c: usize| if c < n { &r[c * n..(c + 1) * n] } else { &z };
                for i in 0..=n {
                    for j in 0..=n {
                        let more = if i == n && j == n { rss } else { 0.0 };
                        let found = dot(column(i), column(j)) + more;
                        let off = (found - squares[i * (n + 1) + j]).abs();
                        assert!(off < 1e-12 * (4 * rows) as f64, "{rows} {n} {i} {j}: {off}");
                    }
                }
                assert!((0..n).all(|c| r[c * n + c] >= 0.0), "{rows} {n}");
                let below = (0..n).flat_map(|c| &r[c * n + c + 1..(c + 1) * n]);
                assert!(below.into_iter().all(|x| *x == 0.0));
            }
        }
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        for (rows, n) in [(41, 13), (256, 25), (7, 9)] {
            let of = |run: fn(Reduce<'_>) -> f64| {
                let (mut r, mut z) = (vec![0.0; n * n], vec![0.0; n]);
                let mut rss = 0.0;
                for number in 0..3 {
                    let (mut columns, mut side) = block(rows, n, number);
                    rss += run(Reduce {
                        by_pairs: true,
                        ..Reduce::new(&mut r, &mut z, &mut columns, &mut side, rows)
                    });
                }
                let all = r.into_iter().chain(z).chain([rss]);
                all.map(f64::to_bits).collect::<Vec<_>>()
            };
            let widest = of(|task| Arch::new().dispatch(task));
            assert_eq!(widest, of(|task| task.with_simd(pulp::Scalar::new())));
        }
    }
}
