//! The objective and the cones of the physical fit, and a proven bound on the distance from the
//! optimum.

use super::symmetric::{self, Square, ZERO, inner, plus};

/// A constraint: a symmetric matrix, affine in the variables, is positive semidefinite.
#[derive(Clone, Debug)]
pub(super) struct Cone {
    /// The number of rows of the matrix, 1 to 4.
    pub(super) size: usize,
    pub(super) constant: Square,
    /// The matrix that multiplies each variable, for the variables that occur.
    pub(super) terms: Vec<(usize, Square)>,
    /// The factor of `-ln det` of the matrix in the objective; 0 without that term.
    pub(super) logarithm: f64,
}

impl Cone {
    /// The constraint that an affine expression is not negative.
    pub(super) fn line(expression: &super::program::Affine) -> Self {
        let entry = |x: f64| {
            let mut m = ZERO;
            m[0][0] = x;
            m
        };
        Self {
            size: 1,
            constant: entry(expression.constant),
            terms: expression
                .terms
                .iter()
                .map(|(v, f)| (*v, entry(*f)))
                .collect(),
            logarithm: 0.0,
        }
    }

    /// The matrix at a point.
    pub(super) fn at(&self, x: &[f64]) -> Square {
        plus(&self.along(x), &self.constant, 1.0)
    }

    /// The change of the matrix along a direction `d` of the variables.
    pub(super) fn along(&self, d: &[f64]) -> Square {
        let mut out = ZERO;
        for (v, m) in &self.terms {
            out = plus(&out, m, d[*v]);
        }
        out
    }
}

/// The objective `||A x - b||^2 + c . x`, minus `ln det` of the cones with a logarithm.
#[derive(Clone, Debug)]
pub(super) struct Objective {
    /// The rows of A, each followed by its entry of b.
    pub(super) rows: Vec<Vec<f64>>,
    pub(super) linear: Vec<f64>,
    /// A constant part of the objective: squares that no variable changes.
    pub(super) constant: f64,
    /// Objective values up to this count as zero: they are rounding errors of b.
    pub(super) floor: f64,
}

impl Objective {
    /// `A x - b`, in twice the working precision before the last rounding.
    pub(super) fn residuals(&self, x: &[f64]) -> Vec<f64> {
        let one = |row: &Vec<f64>| {
            let mut sum = Sum::default();
            for (a, v) in row.iter().zip(x) {
                sum.product(*a, *v);
            }
            sum.add(-row.get(x.len()).copied().unwrap_or(0.0));
            sum.value()
        };
        self.rows.iter().map(one).collect()
    }

    /// The objective without logarithms; not negative except for its linear part.
    pub(super) fn squares(&self, x: &[f64]) -> f64 {
        let squares: f64 = self.residuals(x).iter().map(|r| r * r).sum();
        let linear: f64 = self.linear.iter().zip(x).map(|(c, v)| c * v).sum();
        squares + linear + self.constant
    }
}

/// A sum in twice the working precision (Ogita, Rump and Oishi, 2005).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    high: f64,
    low: f64,
    /// The sum of the absolute values of all terms.
    size: f64,
    count: usize,
}

impl Sum {
    pub(super) fn add(&mut self, x: f64) {
        let next = self.high + x;
        let part = next - self.high;
        self.low += (self.high - (next - part)) + (x - part);
        self.high = next;
        self.size += x.abs();
        self.count += 1;
    }

    pub(super) fn product(&mut self, a: f64, b: f64) {
        let p = a * b;
        self.low += a.mul_add(b, -p);
        self.add(p);
    }

    pub(super) fn value(&self) -> f64 {
        self.high + self.low
    }

    /// An upper bound on the absolute value of the exact sum.
    pub(super) fn bound(&self) -> f64 {
        let n = self.count as f64 + 2.0;
        let rounding = n * n * f64::EPSILON * f64::EPSILON * self.size;
        self.value().abs() * (1.0 + 4.0 * f64::EPSILON) + rounding
    }
}

/// An upper bound on how far the objective at a point is above its minimum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gap {
    /// The sum of the inner products of the cones' matrices and their duals.
    pub(super) complementarity: f64,
    /// The largest change of the objective over the set by the gradient that the duals do not
    /// balance.
    pub(super) unbalanced: f64,
    /// The value of the objective, at least its floor.
    pub(super) value: f64,
}

impl Gap {
    /// The bound as a fraction of the objective.
    pub(super) fn part(&self) -> f64 {
        let part = (self.complementarity + self.unbalanced) / self.value;
        if part.is_finite() {
            part.max(0.0)
        } else {
            f64::INFINITY
        }
    }
}

/// Bounds how far the objective at `x` is above its minimum, from dual matrices. The bound holds
/// for any dual matrices, however they were computed.
///
/// The objective is convex: at any other point it is at least its value at `x` plus the gradient
/// times the distance. With positive semidefinite S_i the gradient is the sum of the `E_i^*(S_i)`
/// and a remainder. `<S_i, X_i>` is nowhere negative, so the objective can fall by at most the sum
/// of the `<S_i, X_i(x)>` plus the remainder times the distance that a variable can be from `x`.
/// Negative eigenvalues of the S_i are cut off first. The gradient is summed in twice the working
/// precision, from the residuals of the squares as they were rounded: for `u` near `r = A x - b`,
/// `||A y - b||^2 >= ||r||^2 + 2 u^T A (y - x) - ||u - r||^2`, so that their rounding enters only
/// by its square.
///
/// - `x`: a point strictly inside the cones that have a logarithm;
/// - `reach`: the largest absolute value of each variable in the set.
pub(super) fn gap(
    objective: &Objective,
    cones: &[Cone],
    reach: &[f64],
    x: &[f64],
    duals: &[Square],
) -> Gap {
    let (left, complementarity) = remainder(objective, cones, x, duals);
    let residuals = objective.residuals(x);
    let squares: f64 = residuals.iter().map(|r| r * r).sum();
    let unbalanced = left
        .iter()
        .zip(x.iter().zip(reach))
        .map(|(sum, (v, most))| sum.bound() * (v.abs() + most))
        .sum();
    Gap {
        complementarity,
        unbalanced,
        value: (squares + objective.constant).max(objective.floor),
    }
}

/// The part of the gradient that the duals do not balance, and the sum of the inner products of
/// duals and matrices.
pub(super) fn remainder(
    objective: &Objective,
    cones: &[Cone],
    x: &[f64],
    duals: &[Square],
) -> (Vec<Sum>, f64) {
    let residuals = objective.residuals(x);
    let n = x.len();
    let mut left: Vec<Sum> = (0..n)
        .map(|v| {
            let mut sum = Sum::default();
            sum.add(objective.linear.get(v).copied().unwrap_or(0.0));
            for (row, r) in objective.rows.iter().zip(&residuals) {
                sum.product(row[v], 2.0 * r);
            }
            sum
        })
        .collect();
    let mut complementarity = 0.0;
    for (cone, dual) in cones.iter().zip(duals) {
        let at = cone.at(x);
        let (own, more) = if cone.logarithm > 0.0 {
            // the gradient of -ln det is -X^-1: a part of the dual matrix balances it
            let Some(l) = symmetric::cholesky(&at, cone.size) else {
                complementarity = f64::INFINITY;
                continue;
            };
            let l = symmetric::inverse(&l, cone.size);
            let inverse = symmetric::product(&symmetric::transposed(&l), &l);
            let rest = plus(dual, &inverse, -cone.logarithm);
            let own = symmetric::clipped(&rest, cone.size);
            (own, plus(&own, &inverse, cone.logarithm))
        } else {
            let own = symmetric::clipped(dual, cone.size);
            (own, own)
        };
        complementarity += inner(&own, &at).max(0.0);
        for (v, m) in &cone.terms {
            for (a, b) in m.iter().flatten().zip(more.iter().flatten()) {
                if *a != 0.0 {
                    left[*v].product(-a, *b);
                }
            }
        }
    }
    (left, complementarity)
}
