//! The normal equations of one step in the scaling of the cones.
//!
//! The products of the objective's rows are computed once for all steps. Each group of cones has few
//! variables; in the coordinates in which its own products are the identity, the matrix of all is
//! the identity plus a semidefinite one. Cholesky's factor of it costs a fifth of the reflections
//! of [`Triangle`], and loses digits only where the objective determines a direction far better
//! than the cones do; the refinement of each direction gives them back.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::Arch;

use super::scaled::ScaledRows;
use super::triangle::Triangle;

/// Rows that are subtracted together in [`factor`].
const TOGETHER: usize = 4;

/// The products of the columns of the objective's rows, each row times sqrt(2).
#[derive(Clone, Debug)]
pub(super) struct Products {
    n: usize,
    /// n x n, row by row.
    all: Vec<f64>,
}

impl Products {
    /// - `rows`: of at least n entries, of which the first n count.
    pub(super) fn of(rows: &[Vec<f64>], n: usize) -> Self {
        let mut all = vec![0.0; n * n];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                let (fours, rest) = rows.as_chunks::<TOGETHER>();
                for four in fours {
                    for i in 0..n {
                        let factors = [0, 1, 2, 3].map(|k: usize| 2.0 * four[k][i]);
                        let sources = [0, 1, 2, 3].map(|k: usize| &four[k][i..n]);
                        add_four(&mut all[i * n + i..(i + 1) * n], factors, sources);
                    }
                }
                for row in rest {
                    for i in 0..n {
                        let factor = 2.0 * row[i];
                        let out = &mut all[i * n + i..(i + 1) * n];
                        for (x, y) in out.iter_mut().zip(&row[i..n]) {
                            *x += factor * y;
                        }
                    }
                }
            },
        );
        mirror(&mut all, n);
        Self { n, all }
    }

    /// The factor of these products plus those of the cones' rows; `None` where groups of cones
    /// share variables, a variable is in no cone, or rounding hides that the matrix is positive
    /// definite.
    pub(super) fn with(&self, cones: &ScaledRows<'_>) -> Option<Normal> {
        let n = self.n;
        let mut groups = Vec::new();
        let mut is_taken = vec![false; n];
        for (variables, triangle) in cones.triangles() {
            for v in variables {
                if core::mem::replace(is_taken.get_mut(*v)?, true) {
                    return None;
                }
            }
            groups.push((variables.to_vec(), inverse(&triangle, variables.len())?));
        }
        if is_taken.contains(&false) {
            return None;
        }
        let mut once = vec![0.0; n * n];
        let mut all = vec![0.0; n * n];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                turn(&groups, &self.all, &mut once, n);
                transpose(&mut once, n);
                turn(&groups, &once, &mut all, n);
            },
        );
        for k in 0..n {
            all[k * n + k] += 1.0;
        }
        let positive = Arch::new().dispatch(
            #[inline(always)]
            || factor(&mut all, n),
        );
        positive.then(|| Normal {
            groups,
            triangle: Triangle::of_upper(all, n),
        })
    }
}

/// The factor of the normal equations of one step.
pub(super) struct Normal {
    /// For each group its variables, and the upper triangle T, row by row, of its coordinates: the
    /// variables are T times the coordinates.
    groups: Vec<(Vec<usize>, Vec<f64>)>,
    /// Cholesky's factor in these coordinates.
    triangle: Triangle,
}

impl Normal {
    /// Solves the normal equations for the right side `g`.
    pub(super) fn solve(&self, g: &[f64]) -> Option<Vec<f64>> {
        let mut side = vec![0.0; g.len()];
        for (variables, t) in &self.groups {
            let m = variables.len();
            for (i, v) in variables.iter().enumerate() {
                for (j, to) in variables.iter().enumerate().skip(i) {
                    side[*to] += t[i * m + j] * g[*v];
                }
            }
        }
        let y = self.triangle.solve(&side)?;
        let mut x = vec![0.0; g.len()];
        for (variables, t) in &self.groups {
            let m = variables.len();
            for (i, v) in variables.iter().enumerate() {
                let own = variables.iter().enumerate().skip(i);
                x[*v] = own.map(|(j, from)| t[i * m + j] * y[*from]).sum();
            }
        }
        Some(x)
    }
}

/// The inverse of an upper triangle with m rows, row by row.
fn inverse(triangle: &Triangle, m: usize) -> Option<Vec<f64>> {
    let mut out = vec![0.0; m * m];
    for i in (0..m).rev() {
        let row = triangle.row(i);
        let pivot = 1.0 / row[0];
        if !pivot.is_finite() {
            return None;
        }
        out[i * m + i] = pivot;
        for j in i + 1..m {
            let sum: f64 = (i + 1..=j).map(|k| row[k - i] * out[k * m + j]).sum();
            out[i * m + j] = -pivot * sum;
        }
    }
    Some(out)
}

/// Writes `T^T matrix`, group by group.
#[inline(always)]
fn turn(groups: &[(Vec<usize>, Vec<f64>)], matrix: &[f64], out: &mut [f64], n: usize) {
    for (variables, t) in groups {
        let m = variables.len();
        for (j, to) in variables.iter().enumerate() {
            let out = &mut out[to * n..(to + 1) * n];
            for (i, from) in variables.iter().enumerate().take(j + 1) {
                let factor = t[i * m + j];
                for (x, y) in out.iter_mut().zip(&matrix[from * n..(from + 1) * n]) {
                    *x += factor * y;
                }
            }
        }
    }
}

fn transpose(matrix: &mut [f64], n: usize) {
    for i in 0..n {
        for j in i + 1..n {
            matrix.swap(i * n + j, j * n + i);
        }
    }
}

/// Copies the upper triangle to the lower one.
fn mirror(matrix: &mut [f64], n: usize) {
    for i in 0..n {
        for j in i + 1..n {
            matrix[j * n + i] = matrix[i * n + j];
        }
    }
}

#[inline(always)]
fn add_four(out: &mut [f64], factors: [f64; TOGETHER], sources: [&[f64]; TOGETHER]) {
    let [a, b, c, d] = sources;
    let [fa, fb, fc, fd] = factors;
    for ((((x, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        *x += fa * a + fb * b + (fc * c + fd * d);
    }
}

/// Replaces the upper triangle of a symmetric matrix by U with `U^T U` = matrix; returns whether it
/// is positive definite.
#[inline(always)]
fn factor(matrix: &mut [f64], n: usize) -> bool {
    let mut first = 0;
    while first < n {
        let last = (first + TOGETHER).min(n);
        for k in first..last {
            let (before, rest) = matrix.split_at_mut(k * n);
            let row = &mut rest[k..n];
            for earlier in before.chunks_exact(n).skip(first) {
                let factor = earlier[k];
                for (x, y) in row.iter_mut().zip(&earlier[k..]) {
                    *x -= factor * y;
                }
            }
            let pivot = row[0];
            if pivot.is_nan() || pivot <= 0.0 || pivot.is_infinite() {
                return false;
            }
            let by = 1.0 / pivot.sqrt();
            for x in row {
                *x *= by;
            }
        }
        let (done, rest) = matrix.split_at_mut(last * n);
        let done = &done[first * n..];
        if last - first == TOGETHER {
            for (row, i) in rest.chunks_exact_mut(n).zip(last..) {
                let sources = [0, 1, 2, 3].map(|k: usize| &done[k * n + i..(k + 1) * n]);
                let factors = sources.map(|source| -source[0]);
                add_four(&mut row[i..], factors, sources);
            }
        }
        first = last;
    }
    true
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::cones::Cone;
    use super::super::scaled::{Groups, Scaled};
    use super::super::symmetric::{ONE, Square, ZERO, plus};
    use super::*;

    fn wave(i: usize, j: usize) -> f64 {
        ((3 * i + 1) as f64 * (j as f64 + 0.7)).sin()
    }

    /// A cone of three rows over these variables.
    fn cone(variables: &[usize]) -> Cone {
        let term = |v: usize| {
            let mut m = ZERO;
            for (r, c) in super::super::symmetric::upper(3) {
                m[r][c] = wave(v, r + 3 * c);
                m[c][r] = m[r][c];
            }
            (v, m)
        };
        Cone {
            size: 3,
            constant: plus(&ZERO, &ONE, 5.0),
            terms: variables.iter().map(|v| term(*v)).collect(),
            logarithm: 0.0,
        }
    }

    /// The solution by products is that by reflections, also where the cones determine some
    /// directions far better than others; with a variable in no cone there is none.
    #[test]
    fn solutions_are_those_by_reflections() {
        let n = 11;
        let rows: Vec<Vec<f64>> = (0..6)
            .map(|i| (0..=n).map(|j| wave(i, j + 2)).collect())
            .collect();
        let root = core::f64::consts::SQRT_2;
        let products = Products::of(&rows, n);
        let cones = [cone(&[0, 2, 3, 5]), cone(&[1, 4, 10]), cone(&[6, 8, 7, 9])];
        for thin in [1.0, 1e-4] {
            let mut at: Square = plus(&ZERO, &ONE, 1.0);
            at[1][1] = thin;
            let scaled: Vec<Scaled> = cones
                .iter()
                .map(|_| Scaled::new(&at, &ONE, 3).unwrap())
                .collect();
            let groups = Groups::of(&cones, n);
            let block = groups.rows(&cones, &scaled);
            let reflected = block.reduced(Triangle::of(&rows, n, root));
            let normal = products.with(&block).unwrap();
            let g: Vec<f64> = (0..n).map(|j| wave(j, 5)).collect();
            let (a, b) = (reflected.solve(&g).unwrap(), normal.solve(&g).unwrap());
            let largest = a.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            for (x, y) in a.iter().zip(&b) {
                // the scaling's condition of 1e4 is squared in the matrix
                assert!((x - y).abs() < 1e-9 * largest, "{thin}: {x} {y}");
            }
        }
        let shared = [cone(&[0, 2, 3, 5]), cone(&[1, 4]), cone(&[6, 8, 7, 9])];
        let scaled: Vec<Scaled> = shared
            .iter()
            .map(|_| Scaled::new(&ONE, &ONE, 3).unwrap())
            .collect();
        let groups = Groups::of(&shared, n);
        assert!(products.with(&groups.rows(&shared, &scaled)).is_none());
    }
}
