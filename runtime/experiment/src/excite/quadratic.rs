//! The quadratic programme of one step, solved by the interior-point solver clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT as Cone,
};

use super::ExciteError;

/// Minimises `g.d + d^T B d / 2 + penalty t` over the step d and the elastic variable t, subject to
/// `values_k + rows_k . d <= t` for all limits k, `t >= 0` and `|d_i| <= trust_radius`. At the
/// minimum t is the largest excess over a linearised limit.
pub(super) struct Quadratic<'a> {
    /// The gradient g of the objective, n entries.
    pub(super) gradient: &'a [f64],
    /// The matrix B, symmetric, n x n.
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
pub(super) struct Step {
    /// The change of the n variables.
    pub(super) d: Vec<f64>,
    /// The Lagrange multipliers of `rows`, not negative.
    pub(super) multipliers: Vec<f64>,
}

impl Quadratic<'_> {
    /// Solves the programme; `None` where the solver does not converge.
    pub(super) fn solve(&self) -> Result<Option<Step>, ExciteError> {
        let n = self.gradient.len();
        let m = self.rows.len() + 1 + 2 * n;
        // clarabel minimises x^T P x / 2 + q^T x with x = (d, t). The upper triangle of P in
        // compressed columns: that of B, then an empty column, as the cost of t is linear.
        let (mut pointers, mut indices, mut entries) = (vec![0], Vec::new(), Vec::new());
        for j in 0..n {
            for i in 0..=j {
                indices.push(i);
                entries.push(self.hessian[j * n + i]);
            }
            pointers.push(indices.len());
        }
        pointers.push(indices.len());
        let p = CscMatrix::new(n + 1, n + 1, pointers, indices, entries);
        let mut q = self.gradient.to_vec();
        q.push(self.penalty);
        // A x + s = b with slacks s >= 0. The rows are the limits, t >= 0, then the upper and the
        // lower bounds of d.
        let box_row = self.rows.len() + 1;
        let (mut pointers, mut indices, mut entries) = (vec![0], Vec::new(), Vec::new());
        for j in 0..n {
            for (k, row) in self.rows.iter().enumerate() {
                indices.push(k);
                entries.push(row[j]);
            }
            indices.extend([box_row + j, box_row + n + j]);
            entries.extend([1.0, -1.0]);
            pointers.push(indices.len());
        }
        for k in 0..=self.rows.len() {
            indices.push(k);
            entries.push(-1.0);
        }
        pointers.push(indices.len());
        let a = CscMatrix::new(m, n + 1, pointers, indices, entries);
        let mut b: Vec<f64> = self.values.iter().map(|v| -v).collect();
        b.push(0.0);
        b.extend(std::iter::repeat_n(self.trust_radius, 2 * n));
        let settings = DefaultSettings {
            verbose: false,
            max_iter: 100,
            // one thread and no time limit, so that the result is reproducible
            max_threads: 1,
            time_limit: f64::INFINITY,
            presolve_enable: false,
            chordal_decomposition_enable: false,
            ..DefaultSettings::default()
        };
        let cones = [Cone::NonnegativeConeT(m)];
        let mut solver = DefaultSolver::new(&p, &q, &a, &b, &cones, settings)
            .map_err(|error| ExciteError::Solver(format!("{error}")))?;
        solver.solve();
        let solution = solver.solution;
        let usable = matches!(
            solution.status,
            SolverStatus::Solved | SolverStatus::AlmostSolved
        );
        if !usable || solution.x.iter().any(|x| !x.is_finite()) {
            return Ok(None);
        }
        Ok(Some(Step {
            d: solution.x[..n].to_vec(),
            multipliers: solution.z[..self.rows.len()].to_vec(),
        }))
    }
}
