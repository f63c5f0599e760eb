//! The objective and the cones of the physical fit, and a proven bound on the distance from the
//! optimum.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::Arch;

use super::sums::{self, Sum, weighted_rows};
use super::symmetric::{self, Square, ZERO, inner, one, plus};
use crate::qr_update::dot;

/// A constraint: a symmetric matrix, affine in the variables, is positive semidefinite.
#[derive(Clone, Debug)]
pub(super) struct Cone {
    /// The number of rows of the matrix, 1 to 4.
    pub(super) size: usize,
    /// The matrix where all variables are 0.
    pub(super) constant: Square,
    /// The index of each variable that occurs, with the matrix that multiplies it.
    pub(super) terms: Vec<(usize, Square)>,
    /// The factor of `-ln det` of the matrix in the objective; 0 without that term.
    pub(super) logarithm: f64,
}

impl Cone {
    /// The constraint that an affine expression is not negative.
    pub(super) fn line(expression: &super::program::Affine) -> Self {
        let terms = expression.terms.iter();
        Self {
            size: 1,
            constant: one(expression.constant),
            terms: terms.map(|(v, f)| (*v, one(*f))).collect(),
            logarithm: 0.0,
        }
    }

    /// The matrix at a point.
    pub(super) fn at(&self, x: &[f64]) -> Square {
        plus(&self.along(x), &self.constant, 1.0)
    }

    /// The change of the matrix if the variables change by `d`.
    pub(super) fn along(&self, d: &[f64]) -> Square {
        if self.size == 1 {
            return one(self.terms.iter().map(|(v, m)| d[*v] * m[0][0]).sum());
        }
        let mut out = ZERO;
        for (v, m) in &self.terms {
            out = plus(&out, m, d[*v]);
        }
        out
    }
}

/// The objective `||A x - b||^2 + c . x + constant`, which is minimised. The cones with a logarithm
/// add `-logarithm ln det` to it.
#[derive(Clone, Debug)]
pub(super) struct Objective {
    /// The rows of A, each followed by its entry of b.
    pub(super) rows: Vec<Vec<f64>>,
    /// c.
    pub(super) linear: Vec<f64>,
    /// The sum of the squares that no variable changes.
    pub(super) constant: f64,
    /// When the gap is divided by the objective, a sum of squares below this is replaced with it:
    /// smaller sums consist of rounding errors of b.
    pub(super) floor: f64,
}

impl Objective {
    /// `A x - b`, each entry summed in twice the working precision and then rounded.
    pub(super) fn residuals(&self, x: &[f64]) -> Vec<f64> {
        sums::residuals(&self.rows, x)
    }

    /// The objective without logarithms. Only its linear part can be negative.
    pub(super) fn squares(&self, x: &[f64]) -> f64 {
        let squares: f64 = self.residuals(x).iter().map(|r| r * r).sum();
        let linear: f64 = self.linear.iter().zip(x).map(|(c, v)| c * v).sum();
        squares + linear + self.constant
    }
}

/// The duality gap: `complementarity + unbalanced` is an upper bound on how far the objective at a
/// point is above its minimum.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gap {
    /// The sum of the inner products of the cones' matrices and their duals.
    pub(super) complementarity: f64,
    /// The most by which the objective can fall within the constraints because of the part of the
    /// gradient that the duals do not balance.
    pub(super) unbalanced: f64,
    /// The squares of the objective, at least its floor. The linear part and the logarithms are not
    /// included, since they may be negative.
    pub(super) value: f64,
}

impl Gap {
    /// The bound as a fraction of `value`; infinite if it is not finite.
    pub(super) fn part(&self) -> f64 {
        let part = (self.complementarity + self.unbalanced) / self.value;
        if part.is_finite() {
            part.max(0.0)
        } else {
            f64::INFINITY
        }
    }
}

/// Bounds how far the objective at `x` is above its minimum, by weak duality. The bound holds for
/// any dual matrices, however they were computed.
///
/// Let `X_i(x)` be the matrix of cone i, and S_i its dual matrix, of which negative eigenvalues are
/// first replaced by 0. The objective is convex, so at any point y it is at least its value at `x`
/// plus `g . (y - x)` with the gradient g at `x`. g is split into the gradient of the sum of the
/// `<S_i, X_i>` and a remainder. The first part can fall by at most the sum of the `<S_i, X_i(x)>`,
/// since `<S_i, X_i(y)>` is not negative if y satisfies the constraints. The second can fall by at
/// most the absolute remainder of each variable times its largest distance from `x`.
///
/// The gradient is summed in twice the working precision, from rounded residuals u of
/// `r = A x - b`. Since `||A y - b||^2 >= ||r||^2 + 2 u^T A (y - x) - ||u - r||^2`, their
/// rounding errors enter only by their squares, which are neglected.
///
/// - `reach`: an upper bound on the absolute value of each variable within the constraints;
/// - `x`: a point strictly inside the cones that have a logarithm; the gap is infinite otherwise;
/// - `duals`: one symmetric matrix for each cone.
pub(super) fn gap(
    objective: &Objective,
    cones: &[Cone],
    reach: &[f64],
    x: &[f64],
    duals: &[Square],
) -> Gap {
    let residuals = objective.residuals(x);
    let (left, complementarity) = remainder(objective, cones, x, &residuals, duals);
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

/// An estimate of [`gap`] in working precision, for points whose optimality need not be proven.
///
/// - `reach`: how far each variable may be from 0 at the minimum;
/// - `duals`: positive definite.
pub(super) fn estimated_gap(
    objective: &Objective,
    cones: &[Cone],
    reach: &[f64],
    x: &[f64],
    duals: &[Square],
) -> Gap {
    let n = x.len();
    let residuals = residuals(&objective.rows, x);
    let mut left = objective.linear.clone();
    add_gradient(&objective.rows, &residuals, 2.0, &mut left);
    let mut complementarity = 0.0;
    for (cone, dual) in cones.iter().zip(duals) {
        if cone.size == 1 {
            complementarity += cone.at(x)[0][0] * dual[0][0];
            for (v, m) in &cone.terms {
                left[*v] -= m[0][0] * dual[0][0];
            }
        } else {
            complementarity += inner(dual, &cone.at(x));
            for (v, m) in &cone.terms {
                left[*v] -= inner(m, dual);
            }
        }
        complementarity -= cone.logarithm * cone.size as f64;
    }
    let squares: f64 = residuals.iter().map(|r| r * r).sum();
    let pairs = left.iter().zip(x.iter().zip(reach)).take(n);
    Gap {
        complementarity: complementarity.max(0.0),
        unbalanced: pairs.map(|(g, (v, most))| g.abs() * (v.abs() + most)).sum(),
        value: (squares + objective.constant).max(objective.floor),
    }
}

/// `A x - b` in working precision.
pub(super) fn residuals(rows: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    let n = x.len();
    Arch::new().dispatch(
        #[inline(always)]
        || rows.iter().map(|row| dot(&row[..n], x) - row[n]).collect(),
    )
}

/// Adds `factor A^T r` to `out`.
pub(super) fn add_gradient(rows: &[Vec<f64>], r: &[f64], factor: f64, out: &mut [f64]) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (row, r) in rows.iter().zip(r) {
                for (g, a) in out.iter_mut().zip(row) {
                    *g += factor * a * r;
                }
            }
        },
    );
}

/// The part of the gradient that the duals do not balance, for each variable, and the sum of the
/// inner products of duals and matrices. For a cone with a logarithm, the dual includes the part
/// that balances the gradient of the logarithm; this part is not in the inner products.
///
/// - `residuals`: those of the objective at `x`.
pub(super) fn remainder(
    objective: &Objective,
    cones: &[Cone],
    x: &[f64],
    residuals: &[f64],
    duals: &[Square],
) -> (Vec<Sum>, f64) {
    let factors: Vec<f64> = residuals.iter().map(|r| 2.0 * r).collect();
    let mut left = weighted_rows(&objective.linear, &objective.rows, &factors);
    let mut complementarity = 0.0;
    for (cone, dual) in cones.iter().zip(duals) {
        let at = cone.at(x);
        let (own, more) = if cone.logarithm > 0.0 {
            // the gradient of -ln det X is -X^-1: this multiple of X^-1 in the dual balances it,
            // and only the rest of the dual is a multiplier of the constraint
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
            if cone.size == 1 {
                left[*v].product(-m[0][0], more[0][0]);
                continue;
            }
            for (a, b) in m.iter().flatten().zip(more.iter().flatten()) {
                if *a != 0.0 {
                    left[*v].product(-a, *b);
                }
            }
        }
    }
    (left, complementarity)
}
