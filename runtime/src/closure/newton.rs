//! Newton's method on the closure equations at fixed independent coordinates.

use alloc::vec;
use alloc::vec::Vec;

use super::lu::{Lu, entry, rows};
use super::scaled::Scaled;
use crate::{Condition, Model, SizeError};

/// Bound of |f| for a closed state, relative to the size of the terms of the constraint rows.
const RELATIVE_TOLERANCE: f64 = 1e-12;

/// A Newton step below this, relative to 1 + the size of the dependent coordinates, counts as
/// converged: the error that remains is of the order of its square.
const CONVERGED_STEP: f64 = 1e-9;

/// A model with the buffers of the Newton iterations. All states are in the units of [`Scaled`].
#[derive(Debug)]
pub(super) struct Newton<'m, M: ?Sized> {
    pub(super) model: Scaled<'m, M>,
    pub(super) independent: Vec<usize>,
    pub(super) dependent: Vec<usize>,
    f: Vec<f64>,
    step: Vec<f64>,
    jacobian: Vec<f64>,
}

/// Factor on the tolerance of a closed state within which redundant rows are accepted at
/// intermediate states of the path; only the last state is polished to the tolerance itself.
pub(super) const PATH_TOLERANCE_FACTOR: f64 = 1e6;

/// The constraint rows that a Newton step solves, where there are more rows than dependent
/// coordinates.
#[derive(Clone, Copy)]
enum SolvedRows {
    /// The rows that the model selects, as many as there are dependent coordinates.
    Chosen,
    /// All rows, by least squares: the selected rows may vanish at states where the other rows do
    /// not.
    All,
}

/// The result of the corrector.
pub(super) enum Correction {
    /// It converged to a solution near the start.
    Converged,
    /// It left the neighbourhood of the start or converged slowly; a shorter predictor step may
    /// help.
    Refused,
    /// It met a value that is not finite, or did not converge in the allowed number of steps.
    Failed,
}

impl<'m, M: Model<f64> + ?Sized> Newton<'m, M> {
    pub(super) fn new(model: &'m M) -> Result<Self, SizeError> {
        let info = model.info();
        Ok(Self {
            model: Scaled::new(model)?,
            independent: info.independent.to_vec(),
            dependent: info.dependent.to_vec(),
            f: vec![0.0; info.rows],
            step: vec![0.0; info.dependent.len()],
            jacobian: vec![0.0; info.rows * info.coordinates.len()],
        })
    }

    /// The largest |f| at a state in the model's own units (m, rad).
    pub(super) fn model_residual(&mut self, q: &[f64]) -> Result<f64, SizeError> {
        self.model.model.constraints(q, &mut self.f)?;
        Ok(largest(&self.f))
    }

    /// The largest |f| over all constraint rows, redundant ones included; NaN if any entry is NaN.
    pub(super) fn residual(&mut self, q: &[f64]) -> Result<f64, SizeError> {
        self.model.constraints(q, &mut self.f)?;
        Ok(largest(&self.f))
    }

    /// The largest residual of a state at `q` that counts as closed: [`RELATIVE_TOLERANCE`] times
    /// the size of the rows.
    ///
    /// The size of a row is the sum of the sizes of its terms, |A| max(1, |q|). The size of the
    /// largest row is used for all rows, since redundant rows may contain nothing but rounding
    /// errors.
    pub(super) fn tolerance(&mut self, q: &[f64]) -> Result<f64, SizeError> {
        self.model.jacobian(q, &mut self.jacobian)?;
        let size = rows(&self.jacobian, q.len())
            .map(|row| {
                row.iter()
                    .zip(q)
                    .map(|(a, q)| a.abs() * q.abs().max(1.0))
                    .sum()
            })
            .fold(0.0, f64::max);
        Ok(RELATIVE_TOLERANCE * size)
    }

    /// Fills `step` with the model's Newton step; returns its largest entry and the condition.
    fn newton_step(&mut self, q: &[f64]) -> Result<(f64, Condition<f64>), SizeError> {
        let condition = self.model.newton_step(q, &mut self.step)?;
        Ok((largest(&self.step), condition))
    }

    /// Fills `step` with the step that solves these rows; returns its largest entry.
    fn step_by(&mut self, solved: SolvedRows, q: &[f64]) -> Result<f64, SizeError> {
        match solved {
            SolvedRows::Chosen => {
                let _ = self.newton_step(q)?;
            }
            SolvedRows::All => self.gauss_newton_step(q)?,
        }
        Ok(largest(&self.step))
    }

    /// Whether there are more constraint rows than dependent coordinates.
    pub(super) fn redundant(&self) -> bool {
        self.f.len() > self.dependent.len()
    }

    /// The columns of A of the dependent coordinates at `q`, all rows, row-major.
    pub(super) fn dependent_columns(&mut self, q: &[f64]) -> Result<Vec<f64>, SizeError> {
        self.model.jacobian(q, &mut self.jacobian)?;
        let mut columns = Vec::with_capacity(self.f.len() * self.dependent.len());
        for row in rows(&self.jacobian, q.len()) {
            columns.extend(self.dependent.iter().map(|at| entry(row, *at)));
        }
        Ok(columns)
    }

    /// Fills `step` with the solution of A^T A step = -A^T f. The step is repeated until f
    /// vanishes, so that the squared condition number costs steps but no accuracy.
    fn gauss_newton_step(&mut self, q: &[f64]) -> Result<(), SizeError> {
        let size = self.dependent.len();
        let a = self.dependent_columns(q)?;
        self.model.constraints(q, &mut self.f)?;
        let mut normal = vec![0.0; size * size];
        self.step.fill(0.0);
        for (row, f) in rows(&a, size).zip(&self.f) {
            for (step, x) in self.step.iter_mut().zip(row) {
                *step -= x * f;
            }
            let products = row.iter().flat_map(|x| row.iter().map(move |y| x * y));
            for (sum, product) in normal.iter_mut().zip(products) {
                *sum += product;
            }
        }
        Lu::new(&normal, size).solve(&mut self.step);
        Ok(())
    }

    pub(super) fn condition(&mut self, q: &[f64]) -> Result<Condition<f64>, SizeError> {
        Ok(self.newton_step(q)?.1)
    }

    /// Adds `part` times the step to the dependent coordinates.
    fn advance(&self, q: &mut [f64], part: f64) {
        for (at, step) in self.dependent.iter().zip(&self.step) {
            if let Some(q) = q.get_mut(*at) {
                *q += part * step;
            }
        }
    }

    /// The corrector: full Newton steps, each at most half as long as the one before, and in sum
    /// not longer than `reach`.
    ///
    /// If solving the model's selected rows does not converge, or converges to a state where
    /// redundant rows are not closed, all rows are solved by least squares.
    pub(super) fn correct(&mut self, q: &mut [f64], reach: f64) -> Result<Correction, SizeError> {
        let start = self.redundant().then(|| q.to_vec());
        let chosen = self.correct_by(SolvedRows::Chosen, q, reach)?;
        let Some(start) = start else {
            return Ok(chosen);
        };
        if matches!(chosen, Correction::Converged)
            && self.residual(q)? <= PATH_TOLERANCE_FACTOR * self.tolerance(q)?
        {
            return Ok(chosen);
        }
        copy(q, &start);
        self.correct_by(SolvedRows::All, q, reach)
    }

    fn correct_by(
        &mut self,
        solved: SolvedRows,
        q: &mut [f64],
        reach: f64,
    ) -> Result<Correction, SizeError> {
        let floor = CONVERGED_STEP * (1.0 + largest_at(q, &self.dependent));
        let mut moved = 0.0;
        let mut last = f64::INFINITY;
        for _ in 0..30 {
            let size = self.step_by(solved, q)?;
            if !size.is_finite() {
                return Ok(Correction::Failed);
            }
            moved += size;
            if moved > reach + floor || size > 0.5 * last {
                return Ok(Correction::Refused);
            }
            self.advance(q, 1.0);
            if size <= floor {
                return Ok(Correction::Converged);
            }
            last = size;
        }
        Ok(Correction::Failed)
    }

    /// Takes Newton steps as long as the residual falls; returns the residual.
    pub(super) fn polish(&mut self, q: &mut [f64]) -> Result<f64, SizeError> {
        let best = self.polish_by(SolvedRows::Chosen, q)?;
        if self.redundant() && best > self.tolerance(q)? {
            return self.polish_by(SolvedRows::All, q);
        }
        Ok(best)
    }

    fn polish_by(&mut self, solved: SolvedRows, q: &mut [f64]) -> Result<f64, SizeError> {
        let mut best = self.residual(q)?;
        for _ in 0..8 {
            let _ = self.step_by(solved, q)?;
            let mut trial = q.to_vec();
            self.advance(&mut trial, 1.0);
            let residual = self.residual(&trial)?;
            if residual < best {
                best = residual;
                copy(q, &trial);
            } else {
                break;
            }
        }
        Ok(best)
    }

    /// Newton's method far from a solution: each step is halved until the residual falls. Returns
    /// the number of steps.
    pub(super) fn close(&mut self, q: &mut [f64]) -> Result<usize, SizeError> {
        let mut residual = self.residual(q)?;
        for steps in 0..100 {
            if residual <= self.tolerance(q)? {
                return Ok(steps);
            }
            let _ = self.newton_step(q)?;
            let mut part = 1.0;
            loop {
                let mut trial = q.to_vec();
                self.advance(&mut trial, part);
                let reached = self.residual(&trial)?;
                if reached < (1.0 - 0.1 * part) * residual {
                    residual = reached;
                    copy(q, &trial);
                    break;
                }
                part *= 0.5;
                if part < 1e-6 {
                    return Ok(steps);
                }
            }
        }
        Ok(100)
    }
}

/// Copies the n coordinates of `from` to `q`.
fn copy(q: &mut [f64], from: &[f64]) {
    for (q, from) in q.iter_mut().zip(from) {
        *q = *from;
    }
}

/// The largest absolute value; NaN if any entry is NaN.
pub(super) fn largest(values: &[f64]) -> f64 {
    values
        .iter()
        .map(|x| x.abs())
        .fold(0.0, |m, x| if x <= m || m.is_nan() { m } else { x })
}

/// The largest absolute value of the coordinates at these indices.
fn largest_at(q: &[f64], places: &[usize]) -> f64 {
    places
        .iter()
        .map(|at| entry(q, *at).abs())
        .fold(0.0, f64::max)
}
