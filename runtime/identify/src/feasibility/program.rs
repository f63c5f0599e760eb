//! A quadratic programme over cones, built from affine expressions and solved by clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SupportedConeT as Cone};

use super::FeasibilityError;

/// A sum of multiples of variables and a constant.
#[derive(Clone, Debug, Default)]
pub(super) struct Affine {
    pub(super) terms: Vec<(usize, f64)>,
    pub(super) constant: f64,
}

/// A programme that minimises `1/2 sum of squares + linear` with affine expressions in cones.
#[derive(Debug, Default)]
pub(super) struct Program {
    variables: usize,
    /// The diagonal of the quadratic objective.
    squares: Vec<(usize, f64)>,
    linear: Vec<(usize, f64)>,
    /// The entries of A in A x + s = b, by row, column and value, and the right-hand side b; s is in
    /// the cones.
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    side: Vec<f64>,
    cones: Vec<Cone<f64>>,
}

/// The result of the solver.
#[derive(Debug)]
pub(super) struct ConicSolution {
    pub(super) x: Vec<f64>,
    /// The dual of each row, in the order in which rows were added.
    pub(super) z: Vec<f64>,
}

impl Program {
    /// Adds variables and returns the index of the first.
    pub(super) fn variables(&mut self, count: usize) -> usize {
        let first = self.variables;
        self.variables += count;
        first
    }

    /// Adds `factor` times a variable to the objective.
    pub(super) fn minimise(&mut self, variable: usize, factor: f64) {
        self.linear.push((variable, factor));
    }

    /// Adds half the square of an expression to the objective.
    ///
    /// The expression becomes a variable of its own: squaring it in the objective's matrix would
    /// square the condition number, and a second-order cone is slower to solve.
    pub(super) fn square(&mut self, expression: &Affine) {
        let residual = self.variables(1);
        self.squares.push((residual, 1.0));
        let mut equal = expression.clone();
        equal.terms.push((residual, -1.0));
        self.zero(&equal);
    }

    /// Requires that the expression is zero.
    pub(super) fn zero(&mut self, expression: &Affine) {
        self.cone(Cone::ZeroConeT(1), core::slice::from_ref(expression));
    }

    /// Requires that the expression is not negative; returns its row.
    pub(super) fn not_negative(&mut self, expression: &Affine) -> usize {
        self.cone(Cone::NonnegativeConeT(1), core::slice::from_ref(expression))
    }

    /// Requires that the symmetric matrix of this upper triangle, column by column, is positive
    /// semidefinite; returns its first row.
    pub(super) fn semidefinite(&mut self, size: usize, triangle: &[Affine]) -> usize {
        let mut scaled = triangle.to_vec();
        let mut entries = scaled.iter_mut();
        for column in 0..size {
            for row in 0..=column {
                if let Some(entry) = entries.next()
                    && row != column
                {
                    entry.constant *= core::f64::consts::SQRT_2;
                    for (_, factor) in &mut entry.terms {
                        *factor *= core::f64::consts::SQRT_2;
                    }
                }
            }
        }
        self.cone(Cone::PSDTriangleConeT(size), &scaled)
    }

    /// Requires that the vector of expressions is in a cone; returns its first row.
    fn cone(&mut self, cone: Cone<f64>, expressions: &[Affine]) -> usize {
        let first = self.side.len();
        for expression in expressions {
            let row = self.side.len();
            for &(variable, factor) in &expression.terms {
                if factor != 0.0 {
                    self.rows.push(row);
                    self.columns.push(variable);
                    self.values.push(-factor);
                }
            }
            self.side.push(expression.constant);
        }
        // consecutive cones of these kinds are one cone to the solver
        match (self.cones.last_mut(), &cone) {
            (Some(Cone::ZeroConeT(n)), Cone::ZeroConeT(more))
            | (Some(Cone::NonnegativeConeT(n)), Cone::NonnegativeConeT(more)) => *n += more,
            _ => self.cones.push(cone),
        }
        first
    }

    /// Solves the programme to the relative and absolute tolerance `accuracy`. The result may be
    /// less accurate: the solver's status is not examined, because callers check the point itself.
    pub(super) fn solve(&self, accuracy: f64) -> Result<ConicSolution, FeasibilityError> {
        let n = self.variables;
        let mut diagonal = vec![0.0; n];
        for (variable, value) in &self.squares {
            diagonal[*variable] += value;
        }
        let used: Vec<usize> = (0..n).filter(|k| diagonal[*k] != 0.0).collect();
        let values = used.iter().map(|k| diagonal[*k]).collect();
        let p = CscMatrix::new_from_triplets(n, n, used.clone(), used, values);
        let mut q = vec![0.0; n];
        for (variable, factor) in &self.linear {
            q[*variable] += factor;
        }
        let m = self.side.len();
        let a = CscMatrix::new_from_triplets(
            m,
            n,
            self.rows.clone(),
            self.columns.clone(),
            self.values.clone(),
        );
        let settings = DefaultSettings {
            verbose: false,
            max_iter: 200,
            // near the border of the cones, iterative refinement yields the last digits
            iterative_refinement_max_iter: 50,
            iterative_refinement_reltol: 1e-15,
            iterative_refinement_abstol: 1e-15,
            tol_gap_abs: accuracy,
            tol_gap_rel: accuracy,
            tol_feas: accuracy,
            tol_ktratio: accuracy,
            // one thread, so that every run gives the same numbers
            max_threads: 1,
            // the cones of bodies are already small
            chordal_decomposition_enable: false,
            presolve_enable: false,
            ..DefaultSettings::default()
        };
        let mut solver = DefaultSolver::new(&p, &q, &a, &self.side, &self.cones, settings)
            .map_err(|error| FeasibilityError::Solver(format!("{error}")))?;
        solver.solve();
        let solution = solver.solution;
        Ok(ConicSolution {
            x: solution.x,
            z: solution.z,
        })
    }
}
