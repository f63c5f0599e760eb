//! The residuals of all poses, weighted by their noise, and their derivatives by what is unknown.

use nalgebra::{DMatrix, DVector};

use crate::closure::{Split, multipliers};
use crate::compliance::Efforts;
use crate::geometry::Geometry;
use crate::kinematics::{Amount, Kinematics};
use crate::placed::Placed;
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
    /// The efforts at rest to which joints yield; `None` where none does.
    pub efforts: Option<&'a dyn Efforts>,
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
    /// For each row, whether it has an entry.
    used: Vec<bool>,
    entries: Vec<(usize, usize, f64)>,
}

impl Sparse {
    pub(crate) fn new(matrix: &DMatrix<f64>) -> Self {
        let mut entries = Vec::new();
        let mut used = vec![false; matrix.nrows()];
        for column in 0..matrix.ncols() {
            for (row, value) in matrix.column(column).iter().enumerate() {
                if *value != 0.0 {
                    used[row] = true;
                    entries.push((row, column, *value));
                }
            }
        }
        Self {
            columns: matrix.ncols(),
            used,
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
    pub fn turns(&self, coordinate: usize) -> bool {
        let links = self.kinematics.links.iter();
        let steps = links.flat_map(|link| &link.steps);
        steps
            .filter(|step| matches!(step.amount, Amount::Coordinate(c, _) if c == coordinate))
            .any(|step| step.turns)
    }

    /// Whether a sensor observes a frame.
    pub(crate) fn is_seen(&self, frame: usize) -> bool {
        self.sensors.iter().any(|sensor| sensor.frame == frame)
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

    /// A point of the poses moved by steps of the mountings' freedoms and of the unknowns, its loops closed again;
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
        let placed = Placed::new(self.kinematics, &scalars);
        let states = point.states.iter().zip(self.poses);
        let states = states.map(|(q, pose)| self.state_of((&placed, split), pose, q));
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
        let placed = Placed::new(self.kinematics, &scalars);
        let sensors = self.mounted(&point.mountings);
        let poses = poses.iter().zip(&point.states);
        poses
            .map(|(pose, q)| self.block(split, (&placed, &slopes), &sensors, pose, q))
            .collect()
    }

    fn block(
        &self,
        split: &Split,
        (placed, by_unknown): (&Placed<'_>, &Sparse),
        sensors: &[Sensor],
        pose: &Pose,
        q: &[f64],
    ) -> Option<Block> {
        let kinematics = self.kinematics;
        let (coordinates, unknowns) = (kinematics.coordinates.len(), by_unknown.columns);
        let freedoms = self.freedoms();
        let mut state = placed.at(q, Some(&by_unknown.used));
        let frames = state.frames(|frame| self.is_seen(frame));
        let mut residual = Vec::new();
        let mut seen = Vec::new();
        let mut groups = Vec::new();
        let mut first = 0;
        for (index, (sensor, values)) in sensors.iter().zip(&pose.values).enumerate() {
            let own = sensor.freedoms();
            if let Some(values) = values {
                let size = (coordinates, kinematics.scalars);
                let rows = sensor.rows(&frames, &kinematics.gravity, values, size)?;
                residual.extend(rows.residual);
                groups.extend(rows.angles.iter().map(|angle| match angle {
                    true => Group::Angles(index),
                    false => Group::Lengths(index),
                }));
                seen.push((first, own, rows.slopes));
            }
            first += own;
        }
        // redundant readings against what follows from the loops
        let readings = self.measured.iter().zip(&pose.readings);
        let readings =
            readings.filter(|(c, reading)| !split.driving.contains(c) && reading.is_finite());
        let observed = residual.len();
        let redundant: Vec<usize> = readings.clone().map(|(c, _)| *c).collect();
        let expected = self.readings(placed.scalars, q)?;
        for (c, reading) in readings {
            let at = self.measured.iter().position(|own| own == c)?;
            residual.push(expected[at] - reading);
            groups.push(if self.turns(*c) {
                Group::ReadAngles
            } else {
                Group::ReadLengths
            });
        }
        let rows = residual.len();
        // below the residuals, how far driving joints yield
        let yielding = match self.efforts {
            Some(efforts) => Some(self.yielding(efforts, placed.scalars, q)?),
            None => None,
        };
        let below = yielding.as_ref().map_or(0, |_| split.driving.len());
        let mut by_coordinate = DMatrix::zeros(rows + below, coordinates);
        let mut by_scalar = DMatrix::zeros(rows + below, kinematics.scalars);
        let mut slopes = DMatrix::zeros(rows, freedoms + unknowns);
        let mut at = 0;
        for (first, own, part) in &seen {
            let n = part.nrows();
            let copy = |to: &mut DMatrix<f64>, column: usize, from: usize, count: usize| {
                to.view_mut((at, column), (n, count))
                    .copy_from(&part.columns(from, count));
            };
            copy(&mut by_coordinate, 0, 0, coordinates);
            copy(&mut by_scalar, 0, coordinates, kinematics.scalars);
            copy(&mut slopes, *first, coordinates + kinematics.scalars, *own);
            at += n;
        }
        for (k, c) in redundant.iter().enumerate() {
            by_coordinate[(observed + k, *c)] = 1.0;
        }
        if let Some(own) = &yielding {
            let redundant = redundant.iter().enumerate();
            let redundant = redundant.map(|(k, c)| (observed + k, *c));
            let driving = split.driving.iter().enumerate();
            for (row, c) in redundant.chain(driving.map(|(k, c)| (rows + k, *c))) {
                let mut slopes = by_coordinate.row_mut(row);
                slopes += own.slopes.row(c);
                if let Some(place) = kinematics.compliances.get(c).copied().flatten() {
                    by_scalar[(row, place)] += own.efforts[c];
                }
            }
        }
        let mut geometry = by_unknown.after(&by_scalar);
        // dependent coordinates follow by A_e dq_e = -f_x dx: multiples of the closure equations take
        // them out of the residuals
        if !split.dependent.is_empty() {
            let closure = state.closure();
            let dependent = by_coordinate.select_columns(&split.dependent);
            let multipliers = multipliers(&closure, split, &dependent)?;
            by_coordinate.gemm(-1.0, &multipliers, &closure.by_coordinate, 1.0);
            geometry.gemm(
                -1.0,
                &multipliers,
                &by_unknown.after(&closure.by_scalar),
                1.0,
            );
        }
        let mut by_reading = by_coordinate.select_columns(&split.driving);
        if below > 0 {
            // driving joints are behind their readings by what they yield, which follows them
            let own = DMatrix::identity(below, below) + by_reading.rows(rows, below);
            by_reading = by_reading.rows(0, rows) * own.try_inverse()?;
            geometry = geometry.rows(0, rows) - &by_reading * geometry.rows(rows, below);
        }
        slopes.columns_mut(freedoms, unknowns).copy_from(&geometry);
        Some(Block {
            residual: DVector::from_vec(residual),
            slopes,
            by_reading,
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
