//! The residuals of all poses, weighted by their noise, and their derivatives by what is unknown.

use nalgebra::{DMatrix, DVector};

use crate::closure::{Split, dependent_rates};
use crate::geometry::Geometry;
use crate::kinematics::{Amount, Kinematics};
use crate::sensor::{Mounting, Sensor};

/// What was measured at one pose of the mechanism.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// The row of the log, for messages.
    pub row: u64,
    /// The readings of the measured coordinates, rad or m.
    pub readings: Vec<f64>,
    /// The numbers of each sensor (see [`Kind`](crate::Kind)); `None` where it saw nothing.
    pub values: Vec<Option<Vec<f64>>>,
}

/// A mechanism, its unknown geometry and what was measured of it.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// The mechanism.
    pub kinematics: &'a Kinematics,
    /// What is unknown of its geometry.
    pub geometry: &'a dyn Geometry,
    /// The coordinates that are measured, as indices.
    pub measured: &'a [usize],
    /// The standard deviation of each reading, rad or m: 0 if there is none, `None` if it is
    /// estimated from redundant ones.
    pub noise_of_readings: &'a [Option<f64>],
    /// The sensors.
    pub sensors: &'a [Sensor],
    /// The standard deviation that errors of the geometry have as it was made, rad or m; `None` if
    /// nothing is known of it.
    pub tolerance: Option<f64>,
    /// The poses.
    pub poses: &'a [Pose],
}

/// A set of residuals with one standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Group {
    /// The lengths that a sensor measures, m.
    Lengths(usize),
    /// The angles that a sensor measures, rad.
    Angles(usize),
    /// Redundant readings of angles, rad.
    ReadAngles,
    /// Redundant readings of lengths, m.
    ReadLengths,
}

/// What is varied by a search: values of the unknowns, where instruments are, and the closed states.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    pub(crate) values: Vec<f64>,
    pub(crate) mountings: Vec<Mounting>,
    /// The coordinates of each pose.
    pub(crate) states: Vec<Vec<f64>>,
}

/// The residuals of one pose.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) residual: DVector<f64>,
    /// By the freedoms of all mountings, then by the unknowns of the geometry.
    pub(crate) slopes: DMatrix<f64>,
    /// By the driving readings, rad or m.
    by_reading: DMatrix<f64>,
    pub(crate) groups: Vec<Group>,
}

/// A matrix most of whose entries are zero: an error changes one scalar, a constant a few.
pub(crate) struct Sparse {
    columns: usize,
    entries: Vec<(usize, usize, f64)>,
}

impl Sparse {
    pub(crate) fn new(matrix: &DMatrix<f64>) -> Self {
        let mut entries = Vec::new();
        for column in 0..matrix.ncols() {
            for (row, value) in matrix.column(column).iter().enumerate() {
                if *value != 0.0 {
                    entries.push((row, column, *value));
                }
            }
        }
        Self {
            columns: matrix.ncols(),
            entries,
        }
    }

    /// The product of a matrix with this one.
    pub(crate) fn after(&self, left: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(left.nrows(), self.columns);
        for (row, column, value) in &self.entries {
            out.column_mut(*column)
                .axpy(*value, &left.column(*row), 1.0);
        }
        out
    }
}

impl Problem<'_> {
    /// The number of freedoms of all mountings.
    pub(crate) fn freedoms(&self) -> usize {
        self.sensors.iter().map(Sensor::freedoms).sum()
    }

    /// Whether a coordinate is an angle.
    pub(crate) fn turns(&self, coordinate: usize) -> bool {
        let links = self.kinematics.links.iter();
        let steps = links.flat_map(|link| &link.steps);
        steps
            .filter(|step| matches!(step.amount, Amount::Coordinate(c, _) if c == coordinate))
            .any(|step| step.turns)
    }

    /// The sensors as they are mounted at a point of the search.
    pub(crate) fn mounted(&self, mountings: &[Mounting]) -> Vec<Sensor> {
        let sensors = self.sensors.iter().zip(mountings);
        sensors
            .map(|(sensor, mounting)| Sensor {
                mounting: *mounting,
                ..sensor.clone()
            })
            .collect()
    }

    /// A point moved by steps of the mountings' freedoms and of the unknowns, its loops closed again;
    /// `None` where they cannot be.
    pub(crate) fn moved(&self, split: &Split, point: &Point, step: &[f64]) -> Option<Point> {
        let mut rest = step;
        let mut mountings = point.mountings.clone();
        for (sensor, mounting) in self.sensors.iter().zip(&mut mountings) {
            let (own, other) = rest.split_at(sensor.freedoms());
            *mounting = mounting.moved(own, sensor.kind);
            rest = other;
        }
        let values: Vec<f64> = point.values.iter().zip(rest).map(|(a, b)| a + b).collect();
        let scalars = self.geometry.scalars(&values)?;
        let states = point.states.iter();
        let states = states.map(|q| self.kinematics.close(&scalars, split, q.clone()));
        Some(Point {
            states: states.collect::<Option<_>>()?,
            values,
            mountings,
        })
    }

    /// The residuals of every pose at a point.
    pub(crate) fn blocks(
        &self,
        split: &Split,
        point: &Point,
        poses: &[Pose],
    ) -> Option<Vec<Block>> {
        let scalars = self.geometry.scalars(&point.values)?;
        let slopes = Sparse::new(&self.geometry.slopes(&point.values));
        let sensors = self.mounted(&point.mountings);
        let poses = poses.iter().zip(&point.states);
        poses
            .map(|(pose, q)| self.block(split, (&scalars, &slopes), &sensors, pose, q))
            .collect()
    }

    fn block(
        &self,
        split: &Split,
        (scalars, by_unknown): (&[f64], &Sparse),
        sensors: &[Sensor],
        pose: &Pose,
        q: &[f64],
    ) -> Option<Block> {
        let kinematics = self.kinematics;
        let (coordinates, unknowns) = (kinematics.coordinates.len(), by_unknown.columns);
        // how all coordinates follow the unknowns and the driving readings
        let mut q_by_unknown = DMatrix::zeros(coordinates, unknowns);
        let mut q_by_reading = DMatrix::zeros(coordinates, split.driving.len());
        for (k, c) in split.driving.iter().enumerate() {
            q_by_reading[(*c, k)] = 1.0;
        }
        if !split.dependent.is_empty() {
            let closure = kinematics.closure(scalars, q);
            let mut right = DMatrix::zeros(closure.residual.len(), unknowns + split.driving.len());
            let moved = -by_unknown.after(&closure.by_scalar);
            right.columns_mut(0, unknowns).copy_from(&moved);
            let driven = -closure.by_coordinate.select_columns(&split.driving);
            right
                .columns_mut(unknowns, split.driving.len())
                .copy_from(&driven);
            let rates = dependent_rates(&closure, split, &right)?;
            for (row, c) in split.dependent.iter().enumerate() {
                for k in 0..unknowns {
                    q_by_unknown[(*c, k)] = rates[(row, k)];
                }
                for k in 0..split.driving.len() {
                    q_by_reading[(*c, k)] = rates[(row, unknowns + k)];
                }
            }
        }
        let is_seen = |frame: usize| sensors.iter().any(|sensor| sensor.frame == frame);
        let frames = kinematics.frames_of(scalars, q, is_seen);
        let freedoms = self.freedoms();
        let mut residual = Vec::new();
        let mut slopes: Vec<DMatrix<f64>> = Vec::new();
        let mut by_reading: Vec<DMatrix<f64>> = Vec::new();
        let mut groups = Vec::new();
        let mut first = 0;
        for (index, (sensor, values)) in sensors.iter().zip(&pose.values).enumerate() {
            let own = sensor.freedoms();
            if let Some(values) = values {
                let size = (coordinates, kinematics.scalars);
                let rows = sensor.rows(&frames, &kinematics.gravity, values, size)?;
                let by_q = rows.slopes.columns(0, coordinates);
                let by_scalar = rows.slopes.columns(coordinates, kinematics.scalars);
                let by_scalar = by_unknown.after(&by_scalar.into_owned());
                let mut all = DMatrix::zeros(rows.residual.len(), freedoms + unknowns);
                let mounted = rows.slopes.columns(coordinates + kinematics.scalars, own);
                all.columns_mut(first, own).copy_from(&mounted);
                let geometry = by_scalar + by_q * &q_by_unknown;
                all.columns_mut(freedoms, unknowns).copy_from(&geometry);
                slopes.push(all);
                by_reading.push(by_q * &q_by_reading);
                residual.extend(rows.residual);
                groups.extend(rows.angles.iter().map(|angle| match angle {
                    true => Group::Angles(index),
                    false => Group::Lengths(index),
                }));
            }
            first += own;
        }
        for (c, reading) in self.measured.iter().zip(&pose.readings) {
            if split.driving.contains(c) || !reading.is_finite() {
                continue;
            }
            residual.push(q[*c] - reading);
            let mut all = DMatrix::zeros(1, freedoms + unknowns);
            all.columns_mut(freedoms, unknowns)
                .copy_from(&q_by_unknown.rows(*c, 1));
            slopes.push(all);
            by_reading.push(q_by_reading.rows(*c, 1).into_owned());
            groups.push(if self.turns(*c) {
                Group::ReadAngles
            } else {
                Group::ReadLengths
            });
        }
        Some(Block {
            residual: DVector::from_vec(residual),
            slopes: stacked(&slopes, freedoms + unknowns),
            by_reading: stacked(&by_reading, split.driving.len()),
            groups,
        })
    }

    /// The standard deviation that is stated for a group, if one is.
    pub(crate) fn stated(&self, group: Group) -> Option<f64> {
        match group {
            Group::Lengths(k) => self.sensors.get(k)?.noise,
            Group::Angles(k) => self.sensors.get(k)?.noise_of_angles,
            Group::ReadAngles | Group::ReadLengths => {
                let measured = self.measured.iter().zip(self.noise_of_readings);
                let own = measured.filter(|(c, _)| self.turns(**c) == (group == Group::ReadAngles));
                let stated: Option<Vec<f64>> = own.map(|(_, noise)| *noise).collect();
                stated?.into_iter().reduce(f64::max).filter(|s| *s > 0.0)
            }
        }
    }

    /// A block whose rows are divided by their noise: that of the sensor and what noise of the driving
    /// readings does. `sigma` gives the standard deviation of a group, and of driving readings
    /// that are not stated.
    pub(crate) fn whitened(
        &self,
        split: &Split,
        block: &Block,
        sigma: &dyn Fn(Group) -> Option<f64>,
    ) -> Option<Block> {
        let rows = block.residual.len();
        let mut covariance = DMatrix::zeros(rows, rows);
        for (k, group) in block.groups.iter().enumerate() {
            let own = sigma(*group)?;
            covariance[(k, k)] = own * own;
        }
        for (k, c) in split.driving.iter().enumerate() {
            let at = self.measured.iter().position(|own| own == c);
            let stated = at.and_then(|at| self.noise_of_readings.get(at).copied().flatten());
            let group = if self.turns(*c) {
                Group::ReadAngles
            } else {
                Group::ReadLengths
            };
            let noise = stated.or_else(|| sigma(group)).unwrap_or(0.0);
            if noise > 0.0 {
                let column = block.by_reading.column(k) * noise;
                covariance += &column * column.transpose();
            }
        }
        let factor = covariance.cholesky()?.unpack();
        Some(Block {
            residual: factor.solve_lower_triangular(&block.residual)?,
            slopes: factor.solve_lower_triangular(&block.slopes)?,
            by_reading: block.by_reading.clone(),
            groups: block.groups.clone(),
        })
    }
}

/// Matrices of the same width, one below the other.
fn stacked(parts: &[DMatrix<f64>], columns: usize) -> DMatrix<f64> {
    let rows = parts.iter().map(DMatrix::nrows).sum();
    let mut out = DMatrix::zeros(rows, columns);
    let mut at = 0;
    for part in parts {
        out.rows_mut(at, part.nrows()).copy_from(part);
        at += part.nrows();
    }
    out
}
