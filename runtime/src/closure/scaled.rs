//! A model in units of its own size, so that the tolerances for closed states, short steps and
//! singularities do not depend on the unit of its lengths.

use alloc::vec;
use alloc::vec::Vec;

use super::lu::{rows, rows_mut};
use crate::{Condition, Joint, Model, Motion, SizeError};

/// The unit of length is within this factor of the mechanism's size.
const MAX_SIZE_RATIO: f64 = 16.0;
/// The ratio of two neighbouring units of length, 2^8.
const UNIT_STEP: f64 = 256.0;
/// Bound on the steps in the search for the unit: 256^120 is beyond every `f64`.
const MAX_UNIT_STEPS: usize = 120;
/// Rows smaller than this, relative to the largest row, count as rounding errors.
const ROUNDING_RATIO: f64 = 1e-9;

/// A model whose translations are in units of `length`, and so are its constraint rows that are
/// lengths. Drives are in units of about the distance that they cover where their joints move by
/// one unit, so that they do not count for more than the joints.
///
/// The unit is a power of 2^8 m, so that scaling is exact; mechanisms between a sixteenth and
/// sixteen metres are solved in metres.
#[derive(Debug)]
pub(super) struct Scaled<'m, M: ?Sized> {
    pub(super) model: &'m M,
    pub(super) length: f64,
    /// The unit of each coordinate: 1 rad, `length`, or that of a drive.
    coordinates: Vec<f64>,
    dependent: Vec<usize>,
    /// The unit of each row of f and A.
    rows: Vec<f64>,
    /// The unit of each row of the square A_e.
    square: Vec<f64>,
    /// Buffer for a state in the model's own units.
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
        let is_drive = |k: usize| info.joints.get(k).is_some_and(Joint::is_drive);
        let slides = (0..n)
            .filter(|k| shifts(*k) && !is_drive(*k))
            .filter_map(|k| info.home.get(k));
        let size = places.chain(slides).fold(0.0_f64, |m, x| m.max(x.abs()));
        scaled.length = length_unit_near(size);
        let mut drives = false;
        for (k, unit) in scaled.coordinates.iter_mut().enumerate() {
            match info.joints.get(k) {
                Some(joint) if joint.is_drive() => {
                    drives = true;
                    *unit = length_unit_near(joint.reach(1.0, scaled.length));
                }
                _ if shifts(k) => *unit = scaled.length,
                _ => {}
            }
        }
        // mechanisms of usual size stay in metres
        if info.rows == 0 || !drives && (scaled.length - 1.0).abs() < f64::EPSILON {
            return Ok(scaled);
        }
        let mut a = vec![0.0; info.rows * n];
        model.jacobian(info.home, &mut a)?;
        scaled.rows = scaled.units_of(&a, &scaled.coordinates, drives);
        let columns: Vec<f64> = info
            .dependent
            .iter()
            .map(|k| unit_at(&scaled.coordinates, *k))
            .collect();
        let mut a_e = vec![0.0; columns.len() * columns.len()];
        model.dependent_jacobian(info.home, &mut a_e)?;
        scaled.square = scaled.units_of(&a_e, &columns, drives);
        Ok(scaled)
    }

    /// The unit of each row: `length` for rows whose terms are nearer to it than to 1, else 1. With
    /// `drives`, the unit of larger rows is the one near their size: some of them are gears.
    fn units_of(&self, a: &[f64], columns: &[f64], drives: bool) -> Vec<f64> {
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
            if drives && size > MAX_SIZE_RATIO * self.length.max(1.0) {
                length_unit_near(size)
            } else if size <= ROUNDING_RATIO * largest {
                self.length.max(1.0)
            } else if size_ratio(size, self.length) < size_ratio(size, 1.0) {
                self.length
            } else {
                1.0
            }
        };
        sizes.into_iter().map(unit).collect()
    }

    /// The units of the coordinates and of the rows of f.
    pub(super) fn units(&self) -> (&[f64], &[f64]) {
        (&self.coordinates, &self.rows)
    }

    /// Converts a state or rates to the model's own units.
    pub(super) fn to_model_units(&self, scaled: &[f64]) -> Vec<f64> {
        let both = scaled.iter().zip(&self.coordinates);
        both.map(|(q, unit)| q * unit).collect()
    }

    /// Converts a state or rates from the model's own units to the scaled ones.
    pub(super) fn to_scaled(&self, given: &[f64]) -> Vec<f64> {
        let both = given.iter().zip(&self.coordinates);
        both.map(|(q, unit)| q / unit).collect()
    }

    /// Converts values of the coordinates `which` to the scaled units.
    pub(super) fn to_scaled_of(&self, which: &[usize], given: &[f64]) -> Vec<f64> {
        let both = given.iter().zip(which);
        both.map(|(q, k)| q / unit_at(&self.coordinates, *k))
            .collect()
    }

    /// Stores the scaled state `q` in the model's own units.
    fn set_state(&mut self, q: &[f64]) {
        for ((own, q), unit) in self.q.iter_mut().zip(q).zip(&self.coordinates) {
            *own = q * unit;
        }
    }

    pub(super) fn constraints(&mut self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.set_state(q);
        self.model.constraints(&self.q, out)?;
        for (f, unit) in out.iter_mut().zip(&self.rows) {
            *f /= unit;
        }
        Ok(())
    }

    pub(super) fn jacobian(&mut self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.set_state(q);
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
        self.set_state(q);
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
        self.set_state(q);
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
        self.set_state(q);
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

/// The factor, at least 1, by which two sizes differ.
fn size_ratio(a: f64, b: f64) -> f64 {
    (a / b).max(b / a)
}

/// The power of 2^8 near a size; 1 if the size is zero or not finite.
fn length_unit_near(size: f64) -> f64 {
    let mut unit = 1.0;
    if size > 0.0 && size.is_finite() {
        for _ in 0..MAX_UNIT_STEPS {
            if size > MAX_SIZE_RATIO * unit {
                unit *= UNIT_STEP;
            } else if size < unit / MAX_SIZE_RATIO {
                unit /= UNIT_STEP;
            }
        }
    }
    unit
}
