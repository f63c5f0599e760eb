//! One step of the interior-point method: its least-squares problem and the directions.
#![allow(
    clippy::inline_always,
    reason = "what is left as a call is compiled without the token's instruction set"
)]

use core::f64::consts::SQRT_2;
use pulp::Arch;

use super::cones::Cone;
use super::symmetric::{
    self, Square, ZERO, cholesky, congruence, inverse, plus, product, transposed, upper,
};
use crate::qr_update::{LANES, dot, forward, reduce_from, substitute};

/// The number of rounds of iterative refinement of each direction.
const REFINEMENT_ROUNDS: usize = 3;
/// The number of entries of the upper triangle of the largest cone.
const MAX_ENTRIES: usize = 10;
/// A group of cones that is reduced together has at most this many rows, unless a cone alone has
/// more: as many as vector registers hold, for few columns.
const GROUP_ROWS: usize = 24;

/// The scaling of one cone at a point, in which its matrix and its dual are the same diagonal
/// matrix.
pub(super) struct Scaled {
    pub(super) inverse: Square,
    pub(super) lambda: [f64; 4],
}

impl Scaled {
    /// Computes G with `G^-1 X G^-T = G^T S G = diag(lambda)`; `None` unless both matrices are
    /// positive definite.
    pub(super) fn new(at: &Square, dual: &Square, size: usize) -> Option<Self> {
        let l = cholesky(at, size)?;
        cholesky(dual, size)?;
        let middle = congruence(&transposed(&l), dual);
        let (squares, q) = symmetric::eigen(&middle, size);
        let mut lambda = [0.0; 4];
        let mut inverse = product(&transposed(&q), &inverse(&l, size));
        for k in 0..size {
            if squares[k].is_nan() || squares[k] <= 0.0 {
                return None;
            }
            lambda[k] = squares[k].sqrt();
            let root = lambda[k].sqrt();
            inverse[k].iter_mut().for_each(|x| *x *= root);
        }
        Some(Self { inverse, lambda })
    }

    /// The largest step that keeps `diag(lambda) + step d` positive semidefinite.
    fn step(&self, d: &Square, size: usize) -> f64 {
        let mut scaled = ZERO;
        for r in 0..size {
            for c in 0..size {
                scaled[r][c] = d[r][c] / (self.lambda[r] * self.lambda[c]).sqrt();
            }
        }
        let least = symmetric::smallest(&scaled, size);
        if least < 0.0 {
            -1.0 / least
        } else {
            f64::INFINITY
        }
    }
}

/// The upper triangle of a symmetric matrix, its entries off the diagonal times sqrt(2): the sum of
/// the squares of all entries is that of the matrix.
type Entries = [f64; MAX_ENTRIES];

fn entries(m: &Square, size: usize) -> Entries {
    let mut out = [0.0; MAX_ENTRIES];
    for (slot, (r, c)) in out.iter_mut().zip(upper(size)) {
        *slot = if r == c { m[r][c] } else { SQRT_2 * m[r][c] };
    }
    out
}

/// The matrix of [`entries`].
fn matrix(entries: &Entries, size: usize) -> Square {
    let mut m = ZERO;
    for (x, (r, c)) in entries.iter().zip(upper(size)) {
        let x = if r == c { *x } else { x / SQRT_2 };
        m[r][c] = x;
        m[c][r] = x;
    }
    m
}

/// The order in which cones are reduced to a triangle: in groups that begin at the first of their
/// variables, as the rows of a group are zero before it.
pub(super) struct Groups(Vec<Group>);

/// Cones that are reduced together.
struct Group {
    /// The first variable of any of them.
    first: usize,
    /// Each cone with its number of rows.
    cones: Vec<(usize, usize)>,
    /// The number of rows of all of them.
    rows: usize,
}

impl Groups {
    pub(super) fn new(cones: &[Cone]) -> Self {
        let first = |cone: &Cone| cone.terms.iter().map(|(v, _)| *v).min();
        let each = cones.iter().enumerate();
        let mut order: Vec<(usize, usize, usize)> = each
            .filter_map(|(k, cone)| Some((first(cone)?, k, cone.size * (cone.size + 1) / 2)))
            .collect();
        order.sort_unstable();
        let mut groups: Vec<Group> = Vec::new();
        for (first, cone, rows) in order {
            match groups.last_mut() {
                Some(group) if group.rows + rows <= GROUP_ROWS => {
                    group.cones.push((cone, rows));
                    group.rows += rows;
                }
                _ => groups.push(Group {
                    first,
                    cones: vec![(cone, rows)],
                    rows,
                }),
            }
        }
        Self(groups)
    }
}

/// The rows of the scaled cones: for each cone, its variables with the entries of its scaled matrix
/// that they multiply.
pub(super) struct Rows(Vec<Vec<(usize, Entries)>>);

impl Rows {
    pub(super) fn new(cones: &[Cone], scaled: &[Scaled]) -> Self {
        let each = cones.iter().zip(scaled).map(|(cone, scaled)| {
            let own = |m: &Square| entries(&congruence(&scaled.inverse, m), cone.size);
            cone.terms.iter().map(|(v, m)| (*v, own(m))).collect()
        });
        Self(each.collect())
    }

    /// Adds the rows to the triangle of other rows, n x n, column by column.
    pub(super) fn reduce(&self, groups: &Groups, triangle: &mut [f64], n: usize) {
        let mut none = vec![0.0; n];
        let mut block = Vec::new();
        for group in &groups.0 {
            // a multiple of the lanes leaves no rest
            let height = group.rows.next_multiple_of(LANES);
            block.clear();
            block.resize((n - group.first) * height, 0.0);
            let mut top = 0;
            for (cone, rows) in &group.cones {
                for (v, entries) in &self.0[*cone] {
                    let column = &mut block[(v - group.first) * height + top..];
                    for (slot, x) in column.iter_mut().zip(entries).take(*rows) {
                        *slot += x;
                    }
                }
                top += rows;
            }
            let side = &mut vec![0.0; height];
            reduce_from(group.first, triangle, &mut none, &mut block, side, height);
        }
    }

    /// The changes of the scaled matrices if the variables change by `d`.
    #[inline(always)]
    fn along(&self, d: &[f64]) -> Vec<Entries> {
        let one = |own: &Vec<(usize, Entries)>| {
            let mut sum = [0.0; MAX_ENTRIES];
            for (v, entries) in own {
                for (s, x) in sum.iter_mut().zip(entries) {
                    *s += x * d[*v];
                }
            }
            sum
        };
        self.0.iter().map(one).collect()
    }

    /// Adds the products of the variables' entries with `y` to `sums`.
    #[inline(always)]
    fn add_transposed(&self, y: &[Entries], sums: &mut [f64]) {
        for (own, y) in self.0.iter().zip(y) {
            for (v, entries) in own {
                sums[*v] += entries.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
            }
        }
    }

    /// The matrices that the variables `d` change the scaled cones by.
    pub(super) fn matrices(&self, cones: &[Cone], d: &[f64]) -> Vec<Square> {
        let each = self.along(d).into_iter().zip(cones);
        each.map(|(entries, cone)| matrix(&entries, cone.size))
            .collect()
    }
}

/// The directions of one step.
pub(super) struct Direction {
    pub(super) x: Vec<f64>,
    /// The scaled direction of each cone's matrix.
    matrices: Vec<Square>,
    /// The scaled direction of each cone's dual.
    pub(super) duals: Vec<Square>,
}

/// The linear system of one step.
pub(super) struct Step<'a> {
    pub(super) cones: &'a [Cone],
    pub(super) scaled: Vec<Scaled>,
    pub(super) block: Rows,
    /// The rows of the objective with their residuals, both times sqrt(2).
    pub(super) rows: &'a [Vec<f64>],
    pub(super) residuals: Vec<f64>,
    pub(super) linear: &'a [f64],
    /// The triangle of both kinds of rows, n x n, column by column.
    pub(super) triangle: Vec<f64>,
}

impl Step<'_> {
    /// Solves for the direction with these right-hand sides in the scaled cones.
    pub(super) fn direction(&self, sides: &[Square]) -> Option<Direction> {
        let each = self.cones.iter().zip(&self.scaled).zip(sides);
        let target: Vec<Entries> = each
            .map(|((cone, scaled), side)| {
                let mut target = entries(side, cone.size);
                let diagonal = upper(cone.size).enumerate().filter(|(_, (r, c))| r == c);
                for (at, (r, _)) in diagonal {
                    target[at] += scaled.lambda[r];
                }
                target
            })
            .collect();
        let x = Arch::new().dispatch(
            #[inline(always)]
            || self.solve(&target),
        )?;
        let matrices = self.block.matrices(self.cones, &x);
        let duals = sides
            .iter()
            .zip(&matrices)
            .map(|(side, m)| plus(side, m, -1.0))
            .collect();
        x.iter()
            .all(|d| d.is_finite())
            .then_some(Direction { x, matrices, duals })
    }

    /// Solves the least squares of the objective's rows and of the cones' rows with these targets, by
    /// the triangle and iterative refinement.
    #[inline(always)]
    fn solve(&self, target: &[Entries]) -> Option<Vec<f64>> {
        let n = self.linear.len();
        let mut x = vec![0.0; n];
        let mut left = target.to_vec();
        for _ in 0..REFINEMENT_ROUNDS {
            // the gradient of the least squares over both kinds of rows, and of the linear part
            let mut gradient: Vec<f64> = self.linear.iter().map(|c| -c).collect();
            for (row, r) in self.rows.iter().zip(&self.residuals) {
                let (row, _) = row.split_at(n);
                let over = -r - SQRT_2 * dot(row, &x);
                let factor = SQRT_2 * over;
                for (g, a) in gradient.iter_mut().zip(row) {
                    *g += a * factor;
                }
            }
            self.block.add_transposed(&left, &mut gradient);
            let half = forward(&self.triangle, &gradient);
            let more = substitute(&self.triangle, &half)?;
            for (v, d) in x.iter_mut().zip(&more) {
                *v += d;
            }
            left = self.block.along(&x);
            for (left, target) in left.iter_mut().zip(target) {
                for (s, t) in left.iter_mut().zip(target) {
                    *s = t - *s;
                }
            }
        }
        Some(x)
    }

    /// The largest step along a direction that keeps matrices and duals in their cones.
    pub(super) fn longest(&self, direction: &Direction) -> f64 {
        let each = self.cones.iter().zip(&self.scaled);
        let moves = direction.matrices.iter().zip(&direction.duals);
        each.zip(moves)
            .fold(f64::INFINITY, |most, ((cone, scaled), (m, s))| {
                most.min(scaled.step(m, cone.size))
                    .min(scaled.step(s, cone.size))
            })
    }

    /// The right-hand sides: the difference of the scaled complementarity to its target `mu`, with
    /// the second-order correction of a predicted direction.
    pub(super) fn sides(&self, mu: f64, predicted: Option<&Direction>) -> Vec<Square> {
        let each = self.cones.iter().zip(&self.scaled).enumerate();
        each.map(|(k, (cone, scaled))| {
            let mut side = ZERO;
            let second = predicted.map_or(ZERO, |d| {
                let one = product(&d.matrices[k], &d.duals[k]);
                let both = plus(&one, &transposed(&one), 1.0);
                plus(&ZERO, &both, 0.5)
            });
            let l = &scaled.lambda;
            for r in 0..cone.size {
                for c in 0..cone.size {
                    let mut rest = -second[r][c];
                    if r == c {
                        rest += mu + cone.logarithm - l[r] * l[r];
                    }
                    side[r][c] = 2.0 * rest / (l[r] + l[c]);
                }
            }
            side
        })
        .collect()
    }
}
