//! The quadratic programme of one step: a primal-dual interior-point method on dense matrices.
//!
//! Mehrotra's predictor and corrector (On the implementation of a primal-dual interior point method,
//! 1992) with the structure of the programme: the matrix of the Newton steps has the size of the
//! step, whatever the number of limits. A sparse solver takes several times as long, as nothing in
//! these matrices is zero.

use super::dense::{Cholesky, Columns, add_rows, times};
use super::space::dot;

/// Minimises `g.d + d^T B d / 2 + penalty t` over the step d and the elastic variable t, subject to
/// `values_k + rows_k . d <= t` for all limits k, `t >= 0` and `|d_i| <= trust_radius`. At the
/// minimum t is the largest excess over a linearised limit.
pub(super) struct Quadratic<'a> {
    /// The gradient g of the objective, n entries.
    pub(super) gradient: &'a [f64],
    /// The matrix B, symmetric, positive definite, n x n.
    pub(super) hessian: &'a [f64],
    /// The gradient of each limit's value, n entries each.
    pub(super) rows: &'a [Vec<f64>],
    /// The value of each limit, relative to half its range; at most zero within the limit.
    pub(super) values: &'a [f64],
    pub(super) trust_radius: f64,
    /// The weight of the largest excess over a limit.
    pub(super) penalty: f64,
}

/// The solution of a [`Quadratic`].
#[derive(Debug)]
pub(super) struct Step {
    /// The change of the n variables.
    pub(super) d: Vec<f64>,
    /// The Lagrange multipliers of `rows`, not negative.
    pub(super) multipliers: Vec<f64>,
}

/// Largest number of iterations; usually about fifteen suffice.
const MAX_ITERATIONS: usize = 80;
/// The mean product of slack and multiplier, and the gradient of the Lagrangian, relative to their
/// sizes, below which the programme is solved.
const TOLERANCE: f64 = 1e-9;
/// The looser tolerance at which a solution is used if the iterations end without convergence: the
/// search computes the decrease anew, and so can use an inexact step.
const LOOSE_TOLERANCE: f64 = 1e-5;
/// The part of the way to the nearest bound that a step takes.
const BOUND_FRACTION: f64 = 0.995;

/// If a smaller part than this of the Newton step can be taken, the iterations end without
/// progress.
const MIN_STEP_PART: f64 = 1e-12;

/// One number for each constraint.
#[derive(Clone)]
struct Rows {
    limits: Vec<f64>,
    /// The number of the constraint `t >= 0`.
    elastic: f64,
    upper: Vec<f64>,
    lower: Vec<f64>,
}

impl Rows {
    fn all(&self) -> impl Iterator<Item = &f64> {
        let elastic = std::iter::once(&self.elastic);
        let bounds = self.upper.iter().chain(&self.lower);
        self.limits.iter().chain(elastic).chain(bounds)
    }

    /// Combines the entries of two lists, one by one.
    fn with(&self, other: &Self, function: impl Fn(f64, f64) -> f64) -> Self {
        let each = |a: &[f64], b: &[f64]| -> Vec<f64> {
            a.iter().zip(b).map(|(a, b)| function(*a, *b)).collect()
        };
        Self {
            limits: each(&self.limits, &other.limits),
            elastic: function(self.elastic, other.elastic),
            upper: each(&self.upper, &other.upper),
            lower: each(&self.lower, &other.lower),
        }
    }

    fn dot(&self, other: &Self) -> f64 {
        self.all().zip(other.all()).map(|(a, b)| a * b).sum()
    }

    fn count(&self) -> usize {
        self.limits.len() + 1 + self.upper.len() + self.lower.len()
    }

    /// The largest part of `step` that keeps all entries positive, at most 1.
    fn reach(&self, step: &Self) -> f64 {
        let pairs = self.all().zip(step.all()).filter(|(_, step)| **step < 0.0);
        pairs.fold(1.0, |m: f64, (x, step)| m.min(-x / step))
    }

    /// Adds a part of a step.
    fn advance(&mut self, step: &Self, part: f64) {
        *self = self.with(step, |x, step| x + part * step);
    }
}

/// The variables: the step d and the elastic variable t.
#[derive(Clone)]
struct Variables {
    d: Vec<f64>,
    t: f64,
}

impl Quadratic<'_> {
    /// Solves the programme; `None` where the iterations do not converge.
    pub(super) fn solve(&self) -> Option<Step> {
        let n = self.gradient.len();
        let largest_value = self.values.iter().fold(0.0, |m: f64, v| m.max(*v));
        let mut x = Variables {
            d: vec![0.0; n],
            t: largest_value + 1.0,
        };
        // the slacks of a point inside all constraints, so that only the multipliers are to be found
        let mut s = Rows {
            limits: self.values.iter().map(|v| x.t - v).collect(),
            elastic: x.t,
            upper: vec![self.trust_radius; n],
            lower: vec![self.trust_radius; n],
        };
        let mean = self.penalty.max(1.0) * x.t / s.count() as f64;
        let mut z = s.with(&s, |s, _| mean / s);
        let size = self
            .gradient
            .iter()
            .fold(self.penalty, |m, g| m.max(g.abs()));
        if !size.is_finite() {
            return None;
        }
        let columns = Columns::of_rows(self.rows, n);
        // the limits' rows with their entry of t, and that of the constraint t >= 0
        let bordered = self.rows.iter();
        let mut bordered: Vec<Vec<f64>> = bordered
            .map(|row| row.iter().copied().chain([-1.0]).collect())
            .collect();
        bordered.push((0..=n).map(|k| if k < n { 0.0 } else { 1.0 }).collect());
        let mut accuracy = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            // the matrix is symmetric, so its rows are its columns
            let curved = times(self.hessian, n, &x.d);
            let residual = self.lagrangian_gradient(&curved, &z);
            let off = residual
                .d
                .iter()
                .fold(residual.t.abs(), |m, r| m.max(r.abs()));
            let gap = s.dot(&z) / s.count() as f64;
            accuracy = (off / (1.0 + size)).max(gap / (1.0 + self.objective(&x, &curved).abs()));
            if accuracy <= TOLERANCE {
                break;
            }
            let weights = z.with(&s, |z, s| z / s);
            let Some(factor) = self.factor(&weights, &bordered) else {
                break;
            };
            // predictor: towards the solution itself
            let products = s.with(&z, |s, z| s * z);
            let (_, ds, dz) = self.direction(&factor, &columns, &weights, &residual, &products, &s);
            let part = s.reach(&ds).min(z.reach(&dz));
            let reached = s.with(&ds, |s, d| s + part * d);
            let reached = reached.dot(&z.with(&dz, |z, d| z + part * d)) / s.count() as f64;
            let centring = (reached / gap).powi(3) * gap;
            // corrector: towards the central path, with the products of the predictor
            let second = ds.with(&dz, |s, z| s * z);
            let products = products.with(&second, |a, b| a + b - centring);
            let (dx, ds, dz) =
                self.direction(&factor, &columns, &weights, &residual, &products, &s);
            let part = (BOUND_FRACTION * s.reach(&ds).min(z.reach(&dz))).min(1.0);
            if part.is_nan() || part <= MIN_STEP_PART {
                break;
            }
            for (x, step) in x.d.iter_mut().zip(&dx.d) {
                *x += part * step;
            }
            x.t += part * dx.t;
            s.advance(&ds, part);
            z.advance(&dz, part);
        }
        let finite = x.d.iter().all(|x| x.is_finite());
        (accuracy <= LOOSE_TOLERANCE && finite).then_some(Step {
            d: x.d,
            multipliers: z.limits,
        })
    }

    /// The objective; `curved`: the matrix times the step.
    fn objective(&self, x: &Variables, curved: &[f64]) -> f64 {
        let curvature: f64 = curved.iter().zip(&x.d).map(|(b, d)| d * b).sum();
        dot(self.gradient, &x.d) + 0.5 * curvature + self.penalty * x.t
    }

    /// The gradient of the Lagrangian by d and t; `curved`: the matrix times the step.
    fn lagrangian_gradient(&self, curved: &[f64], z: &Rows) -> Variables {
        let mut out = self.transposed(z);
        for ((out, curved), g) in out.d.iter_mut().zip(curved).zip(self.gradient) {
            *out += curved + g;
        }
        out.t += self.penalty;
        out
    }

    /// The constraints' matrix, transposed, times a number for each of them.
    fn transposed(&self, y: &Rows) -> Variables {
        let mut d: Vec<f64> = y.upper.iter().zip(&y.lower).map(|(u, l)| u - l).collect();
        add_rows(&mut d, self.rows, &y.limits);
        let t = -y.limits.iter().sum::<f64>() - y.elastic;
        Variables { d, t }
    }

    /// The Cholesky factor of the matrix of the Newton steps, (n + 1) x (n + 1), its last row that of
    /// t; `None` where it is not positive definite.
    fn factor(&self, weights: &Rows, bordered: &[Vec<f64>]) -> Option<Cholesky> {
        let n = self.gradient.len();
        let size = n + 1;
        let mut m = vec![0.0; size * size];
        let columns = m.chunks_exact_mut(size);
        for (own, row) in columns.zip(self.hessian.chunks_exact(n.max(1))) {
            own[..n].copy_from_slice(row);
        }
        for (i, (upper, lower)) in weights.upper.iter().zip(&weights.lower).enumerate() {
            m[i * size + i] += upper + lower;
        }
        let all: Vec<f64> = weights
            .limits
            .iter()
            .copied()
            .chain([weights.elastic])
            .collect();
        Cholesky::new(m, size, bordered, &all)
    }

    /// The Newton step of variables, slacks and multipliers for which the products of slack and
    /// multiplier change by minus `products` to first order.
    fn direction(
        &self,
        factor: &Cholesky,
        columns: &Columns,
        weights: &Rows,
        residual: &Variables,
        products: &Rows,
        s: &Rows,
    ) -> (Variables, Rows, Rows) {
        let quotients = products.with(s, |p, s| p / s);
        let by_constraints = self.transposed(&quotients);
        let mut side: Vec<f64> = by_constraints
            .d
            .iter()
            .zip(&residual.d)
            .map(|(a, r)| a - r)
            .collect();
        side.push(by_constraints.t - residual.t);
        factor.solve(&mut side);
        let t = side.pop().unwrap_or(0.0);
        let dx = Variables { d: side, t };
        // the slacks change by minus the constraints' matrix times the step
        let ds = Rows {
            limits: columns.times(&dx.d).iter().map(|along| t - along).collect(),
            elastic: t,
            upper: dx.d.iter().map(|d| -d).collect(),
            lower: dx.d.clone(),
        };
        let dz = ds.with(weights, |ds, w| -w * ds);
        let dz = dz.with(&quotients, |a, q| a - q);
        (dx, ds, dz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1 and 1.
    fn random(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (*seed >> 33) as f64 / 2_f64.powi(30) - 1.0
    }

    #[test]
    fn the_mean_of_ones_over_all_constraints_is_one() {
        let ones = Rows {
            limits: vec![1.0; 5],
            elastic: 1.0,
            upper: vec![1.0; 3],
            lower: vec![1.0; 3],
        };
        let mean = ones.dot(&ones) / ones.count() as f64;
        assert!((mean - 1.0).abs() < 1e-15, "{mean}");
    }

    /// The slope of the objective is the gradient of the Lagrangian without multipliers.
    #[test]
    fn the_objective_rises_as_the_gradient_of_the_lagrangian_says() {
        let problem = Quadratic {
            gradient: &[1.0, -2.0],
            hessian: &[3.0, 0.5, 0.5, 1.0],
            rows: &[],
            values: &[],
            trust_radius: 1.0,
            penalty: 7.0,
        };
        let none = Rows {
            limits: Vec::new(),
            elastic: 0.0,
            upper: vec![0.0; 2],
            lower: vec![0.0; 2],
        };
        let at = |d: [f64; 2], t: f64| {
            let curved = times(problem.hessian, 2, &d);
            let x = Variables { d: d.to_vec(), t };
            let value = problem.objective(&x, &curved);
            (value, problem.lagrangian_gradient(&curved, &none))
        };
        let (_, slope) = at([0.2, -0.4], 0.3);
        // central differences of a quadratic are exact up to rounding
        let h = 0.125;
        for (k, wanted) in [slope.d[0], slope.d[1], slope.t].into_iter().enumerate() {
            let moved = |by: f64| {
                let mut x = [0.2, -0.4, 0.3];
                x[k] += by;
                at([x[0], x[1]], x[2]).0
            };
            let found = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((found - wanted).abs() < 1e-13, "{k}: {found} {wanted}");
        }
    }

    /// The conditions of Karush, Kuhn and Tucker hold at the solutions of random programmes.
    #[test]
    fn solutions_are_optimal() {
        let mut seed = 3;
        for case in 0..60 {
            let (n, k) = (1 + case % 7, case % 23);
            let root: Vec<f64> = (0..n * n).map(|_| random(&mut seed)).collect();
            let mut hessian = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..n {
                    hessian[i * n + j] = (0..n).map(|l| root[i * n + l] * root[j * n + l]).sum();
                }
                hessian[i * n + i] += 1e-3;
            }
            let gradient: Vec<f64> = (0..n).map(|_| 10.0 * random(&mut seed)).collect();
            let rows: Vec<Vec<f64>> = (0..k)
                .map(|_| (0..n).map(|_| 3.0 * random(&mut seed)).collect())
                .collect();
            let values: Vec<f64> = (0..k).map(|_| random(&mut seed) - 0.3).collect();
            let problem = Quadratic {
                gradient: &gradient,
                hessian: &hessian,
                rows: &rows,
                values: &values,
                trust_radius: 0.3,
                penalty: 50.0,
            };
            let step = problem.solve().unwrap();
            let excess = |k: usize| values[k] + dot(&rows[k], &step.d);
            let t = (0..k).map(excess).fold(0.0, f64::max);
            let sum: f64 = step.multipliers.iter().sum();
            // the elastic variable costs what its limits' multipliers sum up to, or is zero
            assert!(
                sum <= 50.0 + 1e-5 && (t < 1e-6 || (sum - 50.0).abs() < 1e-4),
                "{case}: {sum} {t}"
            );
            for (at, z) in step.multipliers.iter().enumerate() {
                assert!(
                    *z >= 0.0 && z * (t - excess(at)).abs() < 1e-5,
                    "{case}: {z}"
                );
            }
            for i in 0..n {
                let along: f64 = (0..k).map(|k| step.multipliers[k] * rows[k][i]).sum();
                let slope = gradient[i] + dot(&hessian[i * n..(i + 1) * n], &step.d) + along;
                let d = step.d[i];
                assert!(d.abs() <= 0.3 + 1e-9);
                // where the step is within its box, the gradient of the Lagrangian vanishes
                let inside = d.abs() < 0.3 - 1e-5;
                assert!(!inside || slope.abs() < 1e-4, "{case}: {slope} at {d}");
                assert!(
                    slope.abs() < 1e-4 || slope * d < 0.0,
                    "{case}: {slope} at {d}"
                );
            }
        }
    }
}
