//! A model in units of its own size, so that what counts as closed, as a short step or as near a
//! singularity does not depend on the unit in which its lengths are given.

use alloc::vec;
use alloc::vec::Vec;

use super::lu::{rows, rows_mut};
use crate::{Condition, Model, Motion, SizeError};

/// Sizes up to this times the unit, or one over it, keep the unit.
const USUAL: f64 = 16.0;
const STEP: f64 = 256.0;
/// What is beyond so many steps is no length.
const MOST: usize = 120;
/// Rows smaller than this beside the largest hold nothing but rounding.
const ROUNDING: f64 = 1e-9;

/// A model whose shifts are in `length`, and so are its length rows.
///
/// Units are powers of 2^8: they change no digit, and mechanisms between a sixteenth and sixteen
/// metres are solved in metres.
#[derive(Debug)]
pub(super) struct Scaled<'m, M: ?Sized> {
    pub(super) model: &'m M,
    pub(super) length: f64,
    /// By coordinate.
    coordinates: Vec<f64>,
    dependent: Vec<usize>,
    /// By row of f and A.
    rows: Vec<f64>,
    /// By row of the square A_e.
    square: Vec<f64>,
    /// A state in the model's own units.
    q: Vec<f64>,
}

impl<'m, M: Model<f64> + ?Sized> Scaled<'m, M> {
    pub(super) fn new(model: &'m M) -> Result<Self, SizeError> {
        let info = model.info();
        let n = info.coordinates.len();
        let mut scaled = Self {
            model,
            length: 1.0,
            coordinates: vec![1.0; n],
            dependent: info.dependent.to_vec(),
            rows: vec![1.0; info.rows],
            square: vec![1.0; info.dependent.len()],
            q: info.home.to_vec(),
        };
        let shifts = |k: usize| {
            info.joints
                .get(k)
                .is_some_and(|j| j.motion == Motion::Translation)
        };
        let mut poses = vec![0.0; 12 * info.bodies.len()];
        model.poses(info.home, &mut poses)?;
        let places = poses
            .as_chunks::<12>()
            .0
            .iter()
            .flat_map(|pose| pose.iter().skip(9));
        let slides = (0..n)
            .filter(|k| shifts(*k))
            .filter_map(|k| info.home.get(k));
        let size = places.chain(slides).fold(0.0_f64, |m, x| m.max(x.abs()));
        scaled.length = coarse(size);
        for (k, unit) in scaled.coordinates.iter_mut().enumerate() {
            if shifts(k) {
                *unit = scaled.length;
            }
        }
        // mechanisms of usual size stay in metres, row by row
        if info.rows == 0 || (scaled.length - 1.0).abs() < f64::EPSILON {
            return Ok(scaled);
        }
        let mut a = vec![0.0; info.rows * n];
        model.jacobian(info.home, &mut a)?;
        scaled.rows = scaled.units_of(&a, &scaled.coordinates);
        let columns: Vec<f64> = info
            .dependent
            .iter()
            .map(|k| unit_at(&scaled.coordinates, *k))
            .collect();
        let mut a_e = vec![0.0; columns.len() * columns.len()];
        model.dependent_jacobian(info.home, &mut a_e)?;
        scaled.square = scaled.units_of(&a_e, &columns);
        Ok(scaled)
    }

    /// Which rows are lengths: those whose terms are nearer to the unit of length than to 1.
    fn units_of(&self, a: &[f64], columns: &[f64]) -> Vec<f64> {
        let sizes: Vec<f64> = rows(a, columns.len())
            .map(|row| {
                row.iter()
                    .zip(columns)
                    .map(|(a, unit)| (a * unit).abs())
                    .sum()
            })
            .collect();
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        let unit = |size: f64| {
            if size <= ROUNDING * largest {
                self.length.max(1.0)
            } else if apart(size, self.length) < apart(size, 1.0) {
                self.length
            } else {
                1.0
            }
        };
        sizes.into_iter().map(unit).collect()
    }

    /// A state or rates in the model's own units.
    pub(super) fn given(&self, scaled: &[f64]) -> Vec<f64> {
        let both = scaled.iter().zip(&self.coordinates);
        both.map(|(q, unit)| q * unit).collect()
    }

    /// The same in these units.
    pub(super) fn own(&self, given: &[f64]) -> Vec<f64> {
        let both = given.iter().zip(&self.coordinates);
        both.map(|(q, unit)| q / unit).collect()
    }

    /// Values of some coordinates in these units.
    pub(super) fn own_of(&self, which: &[usize], given: &[f64]) -> Vec<f64> {
        let both = given.iter().zip(which);
        both.map(|(q, k)| q / unit_at(&self.coordinates, *k))
            .collect()
    }

    fn take(&mut self, q: &[f64]) {
        for ((own, q), unit) in self.q.iter_mut().zip(q).zip(&self.coordinates) {
            *own = q * unit;
        }
    }

    pub(super) fn constraints(&mut self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.take(q);
        self.model.constraints(&self.q, out)?;
        for (f, unit) in out.iter_mut().zip(&self.rows) {
            *f /= unit;
        }
        Ok(())
    }

    pub(super) fn jacobian(&mut self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.take(q);
        self.model.jacobian(&self.q, out)?;
        for (row, unit) in rows_mut(out, q.len()).zip(&self.rows) {
            for (a, coordinate) in row.iter_mut().zip(&self.coordinates) {
                *a *= coordinate / unit;
            }
        }
        Ok(())
    }

    pub(super) fn newton_step(
        &mut self,
        q: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.take(q);
        let condition = self.model.newton_step(&self.q, out)?;
        for (step, at) in out.iter_mut().zip(&self.dependent) {
            *step /= unit_at(&self.coordinates, *at);
        }
        Ok(condition)
    }

    pub(super) fn dependent_jacobian(
        &mut self,
        q: &[f64],
        out: &mut [f64],
    ) -> Result<(), SizeError> {
        self.take(q);
        self.model.dependent_jacobian(&self.q, out)?;
        let rows = rows_mut(out, self.dependent.len());
        for (row, unit) in rows.zip(&self.square) {
            for (a, at) in row.iter_mut().zip(&self.dependent) {
                *a *= unit_at(&self.coordinates, *at) / unit;
            }
        }
        Ok(())
    }

    pub(super) fn velocities(
        &mut self,
        q: &[f64],
        independent: &[usize],
        qd_i: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.take(q);
        let rates: Vec<f64> = qd_i
            .iter()
            .zip(independent)
            .map(|(rate, at)| rate * unit_at(&self.coordinates, *at))
            .collect();
        let condition = self.model.velocities(&self.q, &rates, out)?;
        for (rate, unit) in out.iter_mut().zip(&self.coordinates) {
            *rate /= unit;
        }
        Ok(condition)
    }
}

/// The unit of a coordinate; 1 where there is none.
fn unit_at(units: &[f64], at: usize) -> f64 {
    units.get(at).copied().unwrap_or(1.0)
}

/// By what factor two sizes differ.
fn apart(a: f64, b: f64) -> f64 {
    (a / b).max(b / a)
}

/// The coarse power of two near a size; 1 for nothing.
fn coarse(size: f64) -> f64 {
    let mut unit = 1.0;
    if size > 0.0 && size.is_finite() {
        for _ in 0..MOST {
            if size > USUAL * unit {
                unit *= STEP;
            } else if size < unit / USUAL {
                unit /= STEP;
            }
        }
    }
    unit
}
