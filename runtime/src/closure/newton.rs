//! Newton's method on the closure equations at fixed independent coordinates.

use alloc::vec;
use alloc::vec::Vec;

use super::lu::{Lu, entry, rows};
use super::scaled::Scaled;
use crate::{Condition, Model, SizeError};

/// The residual of a closed state, in units of what the constraint rows are made of.
const TOLERANCE: f64 = 1e-12;

/// Newton steps below this, relative to the coordinates, have converged: the next would be
/// the square of it.
const CONVERGED: f64 = 1e-9;

/// A model with the memory that the iterations need. All states are in the model's units.
#[derive(Debug)]
pub(super) struct Newton<'m, M: ?Sized> {
    pub(super) model: Scaled<'m, M>,
    pub(super) independent: Vec<usize>,
    pub(super) dependent: Vec<usize>,
    f: Vec<f64>,
    step: Vec<f64>,
    jacobian: Vec<f64>,
}

/// Residuals of redundant rows up to this many times what counts as closed are taken on the way:
/// the last of them is polished.
pub(super) const NEARLY: f64 = 1e6;

/// Which rows a step solves, where there are more than dependent coordinates.
#[derive(Clone, Copy)]
enum SolvedRows {
    /// As many as there are dependent coordinates: the model's choice.
    Chosen,
    /// All of them, in the sense of least squares: the chosen ones may meet at states where the
    /// others are open.
    All,
}

/// How a correction ended.
pub(super) enum Correction {
    /// At a solution near the start.
    Converged,
    /// It left the neighbourhood of the start or was slow; a shorter step may do better.
    Refused,
    /// It met a value that is not finite, or did not end.
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

    /// The largest |f| at a state as the model has it, in the model's own units.
    pub(super) fn open(&mut self, given: &[f64]) -> Result<f64, SizeError> {
        self.model.model.constraints(given, &mut self.f)?;
        Ok(largest(&self.f))
    }

    /// The largest |f| over all constraint rows, redundant ones included; NaN if any is.
    pub(super) fn residual(&mut self, q: &[f64]) -> Result<f64, SizeError> {
        self.model.constraints(q, &mut self.f)?;
        Ok(largest(&self.f))
    }

    /// The residual that counts as closed at `q`: [`TOLERANCE`] of the lengths in the rows.
    ///
    /// A row's size is what its terms add up to, |A| max(1, |q|); the largest row's is taken
    /// for all, since redundant rows may have nothing but rounding in them.
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
        Ok(TOLERANCE * size)
    }

    /// Fills `step` with the model's Newton step; returns its largest entry and the condition.
    fn newton_step(&mut self, q: &[f64]) -> Result<(f64, Condition<f64>), SizeError> {
        let condition = self.model.newton_step(q, &mut self.step)?;
        Ok((largest(&self.step), condition))
    }

    /// Fills `step` by this way; returns its largest entry.
    fn step_by(&mut self, way: SolvedRows, q: &[f64]) -> Result<f64, SizeError> {
        match way {
            SolvedRows::Chosen => {
                let _ = self.newton_step(q)?;
            }
            SolvedRows::All => self.gauss_newton_step(q)?,
        }
        Ok(largest(&self.step))
    }

    /// Are there more constraint rows than dependent coordinates?
    pub(super) fn redundant(&self) -> bool {
        self.f.len() > self.dependent.len()
    }

    /// The rows of A in the dependent coordinates' columns, row-major, at `q`.
    pub(super) fn dependent_columns(&mut self, q: &[f64]) -> Result<Vec<f64>, SizeError> {
        self.model.jacobian(q, &mut self.jacobian)?;
        let mut columns = Vec::with_capacity(self.f.len() * self.dependent.len());
        for row in rows(&self.jacobian, q.len()) {
            columns.extend(self.dependent.iter().map(|at| entry(row, *at)));
        }
        Ok(columns)
    }

    /// Fills `step` with the solution of A^T A step = -A^T f: it is repeated until f vanishes, so
    /// that the squared condition costs steps and no accuracy.
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

    /// Adds a part of the step to the dependent coordinates.
    fn advance(&self, q: &mut [f64], part: f64) {
        for (at, step) in self.dependent.iter().zip(&self.step) {
            if let Some(q) = q.get_mut(*at) {
                *q += part * step;
            }
        }
    }

    /// Full Newton steps that must halve at least each time and stay within `reach` together.
    ///
    /// Where the rows that the model solves lead away, or to a place where redundant ones are
    /// open, all rows are tried.
    pub(super) fn correct(&mut self, q: &mut [f64], reach: f64) -> Result<Correction, SizeError> {
        let start = self.redundant().then(|| q.to_vec());
        let chosen = self.correct_by(SolvedRows::Chosen, q, reach)?;
        let Some(start) = start else {
            return Ok(chosen);
        };
        if matches!(chosen, Correction::Converged)
            && self.residual(q)? <= NEARLY * self.tolerance(q)?
        {
            return Ok(chosen);
        }
        copy(q, &start);
        self.correct_by(SolvedRows::All, q, reach)
    }

    fn correct_by(
        &mut self,
        way: SolvedRows,
        q: &mut [f64],
        reach: f64,
    ) -> Result<Correction, SizeError> {
        let floor = CONVERGED * (1.0 + largest_at(q, &self.dependent));
        let mut moved = 0.0;
        let mut last = f64::INFINITY;
        for _ in 0..30 {
            let size = self.step_by(way, q)?;
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

    /// Newton steps as long as the residual falls; returns it.
    pub(super) fn polish(&mut self, q: &mut [f64]) -> Result<f64, SizeError> {
        let best = self.polish_by(SolvedRows::Chosen, q)?;
        if self.redundant() && best > self.tolerance(q)? {
            return self.polish_by(SolvedRows::All, q);
        }
        Ok(best)
    }

    fn polish_by(&mut self, way: SolvedRows, q: &mut [f64]) -> Result<f64, SizeError> {
        let mut best = self.residual(q)?;
        for _ in 0..8 {
            let _ = self.step_by(way, q)?;
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

    /// Newton's method from far away: each step is halved until the residual falls.
    /// Returns the number of steps.
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

/// Both are all coordinates.
fn copy(q: &mut [f64], from: &[f64]) {
    for (q, from) in q.iter_mut().zip(from) {
        *q = *from;
    }
}

/// The largest absolute value; NaN if any is.
pub(super) fn largest(values: &[f64]) -> f64 {
    values
        .iter()
        .map(|x| x.abs())
        .fold(0.0, |m, x| if x <= m { m } else { x })
}

fn largest_at(q: &[f64], places: &[usize]) -> f64 {
    places
        .iter()
        .map(|at| entry(q, *at).abs())
        .fold(0.0, f64::max)
}
