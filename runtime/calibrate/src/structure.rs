//! What the measurements of a mechanism can tell of its geometry in principle: at many states, without
//! noise.

use nalgebra::DMatrix;

use crate::closure::{Split, dependent_rates};
use crate::equations::{Block, Point, Pose, Problem, Sparse};
use crate::fit::{CalibrateError, Fixed};
use crate::geometry::Unknown;
use crate::identifiable::Selection;
use crate::placed::Placed;
use crate::sensor::Mounting;
use crate::simulate::Draws;

/// The number of states at which derivatives are compared.
const STATES: usize = 60;
/// How far coordinates without limits move from home, rad or m.
const REACH: f64 = 0.8;
/// The part of a column below which it is a rounding error.
const SILENT: f64 = 1e-9;

/// Why an unknown stays at its nominal value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// It changes nothing that is measured.
    Silent,
    /// Whatever it does to the measurements, others do as well.
    Absorbed,
    /// The loops have more equations than freedoms, and could not be assembled with another value.
    LoopsFixed,
    /// Other poses would show it; these do not.
    NotShown,
}

/// The states of the poses with the nominal geometry.
#[derive(Clone, Debug)]
pub(crate) struct Reached {
    pub(crate) split: Split,
    pub(crate) nominal: Vec<f64>,
    pub(crate) scalars: Vec<f64>,
    /// The poses that are reached, with their states.
    pub(crate) poses: Vec<Pose>,
    pub(crate) states: Vec<Vec<f64>>,
    pub(crate) unreachable: Vec<u64>,
}

/// The columns that the measurements determine in principle.
#[derive(Clone, Debug)]
pub(crate) struct Structure {
    pub(crate) selection: Selection,
    /// For each unknown, whether the loops hold it.
    pub(crate) held: Vec<bool>,
}

/// What measurements of a kind determine of a geometry, whatever poses are chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// The names of the unknowns that are found.
    pub kept: Vec<String>,
    /// Those that stay at their nominal values.
    pub fixed: Vec<Fixed>,
    /// The freedoms of instruments that are found with them.
    pub mountings: usize,
    /// The smallest part of a kept column that is not one of the others, relative to it.
    pub smallest_kept: f64,
    /// The largest part that was left of a column that is not kept.
    pub largest_absorbed: f64,
}

impl Problem<'_> {
    /// The values of the description, and which coordinates drive the mechanism.
    pub(crate) fn start(&self) -> Result<Reached, CalibrateError> {
        let unknowns = self.geometry.unknowns();
        let nominal: Vec<f64> = unknowns.iter().map(|unknown| unknown.nominal).collect();
        let scalars = self
            .geometry
            .scalars(&nominal)
            .ok_or(CalibrateError::NotClosed)?;
        let split = self.kinematics.split(&scalars, self.measured);
        Ok(Reached {
            split: split.ok_or(CalibrateError::NotDetermined)?,
            nominal,
            scalars,
            poses: Vec::new(),
            states: Vec::new(),
            unreachable: Vec::new(),
        })
    }

    /// Closes the loops at every pose.
    pub(crate) fn reach_all(&self) -> Result<Reached, CalibrateError> {
        let mut out = self.start()?;
        let home = &self.kinematics.home;
        let placed = Placed::new(self.kinematics, &out.scalars);
        for pose in self.poses {
            let places = out.split.driving.iter();
            let places = places.map(|c| self.measured.iter().position(|own| own == c));
            let target: Option<Vec<f64>> = places
                .map(|at| pose.readings.get(at?).copied().filter(|r| r.is_finite()))
                .collect();
            // each from home, so that no pose depends on the order of the others
            let found = target.and_then(|target| placed.reach(&out.split, home, &target));
            match found {
                Some(state) => {
                    out.states.push(state);
                    out.poses.push(pose.clone());
                }
                None => out.unreachable.push(pose.row),
            }
        }
        if out.poses.is_empty() {
            return Err(CalibrateError::NoPose);
        }
        Ok(out)
    }

    /// What such measurements determine of the geometry at any poses.
    ///
    /// # Errors
    /// When the readings do not determine states of the mechanism.
    pub fn known(&self) -> Result<Known, CalibrateError> {
        let start = self.start()?;
        let structure = Structure::new(self, &start)?;
        let freedoms = self.freedoms();
        let unknowns = self.geometry.unknowns();
        let selection = &structure.selection;
        let kept = selection.kept.iter();
        let kept = kept.filter_map(|c| unknowns.get(c.checked_sub(freedoms)?));
        Ok(Known {
            kept: kept.map(|unknown| unknown.name.clone()).collect(),
            fixed: structure.fixed(unknowns, freedoms, selection),
            mountings: selection.kept.iter().filter(|c| **c < freedoms).count(),
            smallest_kept: selection.smallest_kept,
            largest_absorbed: selection.largest_absorbed,
        })
    }

    /// How far a coordinate moves from home where nothing else is known.
    fn reach(&self, coordinate: usize) -> f64 {
        if self.turns(coordinate) {
            REACH
        } else {
            0.25 * REACH
        }
    }

    /// The limits of a coordinate, or where it moves without any.
    pub(crate) fn range(&self, coordinate: usize) -> [f64; 2] {
        let home = self.kinematics.home[coordinate];
        let limits = self.kinematics.limits.get(coordinate).copied().flatten();
        let reach = self.reach(coordinate);
        limits.unwrap_or([home - reach, home + reach])
    }

    /// What would be measured at states without noise.
    pub(crate) fn noiseless(&self, scalars: &[f64], states: &[Vec<f64>]) -> Vec<Pose> {
        let placed = Placed::new(self.kinematics, scalars);
        let poses = states.iter().map(|q| {
            let readings = self.readings(scalars, q);
            let frames = placed.at(q, None).frames(|frame| self.is_seen(frame));
            let sensors = self.sensors.iter();
            Pose {
                row: 0,
                // no joint of the description yields
                readings: readings.unwrap_or_default(),
                values: sensors
                    .map(|sensor| Some(sensor.predict(&frames, &self.kinematics.gravity)))
                    .collect(),
            }
        });
        poses.collect()
    }

    /// The inverse covariance of what is found before anything is measured, if there is a tolerance.
    pub(crate) fn prior(
        &self,
        structure: &Structure,
        found: &Selection,
    ) -> Result<Option<DMatrix<f64>>, CalibrateError> {
        let Some(tolerance) = self.tolerance else {
            return Ok(None);
        };
        let mut combined = structure.combinations(found, self.freedoms());
        for (unknown, mut column) in self
            .geometry
            .unknowns()
            .iter()
            .zip(combined.column_iter_mut())
        {
            // how stiff a joint is has nothing to do with how well it was made: 1 is next to nothing known
            if !unknown.unit.is_compliance() {
                column *= tolerance;
            }
        }
        let covariance = &combined * combined.transpose();
        let inverse = covariance.cholesky().map(|factor| factor.inverse());
        inverse.map(Some).ok_or(CalibrateError::NotClosed)
    }

    /// States that the mechanism reaches from home, at most this many.
    pub(crate) fn drawn_states(
        &self,
        reached: &Reached,
        count: usize,
        draws: &mut Draws,
    ) -> Vec<Vec<f64>> {
        let kinematics = self.kinematics;
        let placed = Placed::new(kinematics, &reached.scalars);
        let mut states = Vec::new();
        let mut reach = 1.0;
        for _ in 0..20 * count {
            if states.len() == count {
                break;
            }
            let target: Vec<f64> = reached
                .split
                .driving
                .iter()
                .map(|c| {
                    let home = kinematics.home[*c];
                    let sized = self.reach(*c);
                    let [low, high] = self.range(*c);
                    let (low, high) = (low.max(home - sized), high.min(home + sized));
                    home + reach * (low + draws.uniform() * (high - low) - home)
                })
                .collect();
            match placed.reach(&reached.split, &kinematics.home, &target) {
                Some(state) => states.push(state),
                None => reach *= 0.9,
            }
        }
        states
    }

    /// Which of the columns that are determined in principle these poses determine.
    pub(crate) fn shown(
        &self,
        reached: &Reached,
        structure: &Structure,
        blocks: &[Block],
        sigmas: &[(crate::equations::Group, f64)],
    ) -> Result<Selection, CalibrateError> {
        let lookup = |group| sigmas.iter().find(|(own, _)| *own == group).map(|s| s.1);
        let weighted: Option<Vec<Block>> = blocks
            .iter()
            .map(|block| self.whitened(&reached.split, block, &lookup))
            .collect();
        let weighted = weighted.ok_or(CalibrateError::NotClosed)?;
        let mut all = stacked(&weighted);
        for column in 0..all.ncols() {
            if !structure.selection.kept.contains(&column) {
                all.column_mut(column).fill(0.0);
            }
        }
        Ok(Selection::of_columns(&all, 0.0))
    }
}

fn stacked(blocks: &[Block]) -> DMatrix<f64> {
    let columns = blocks.first().map_or(0, |block| block.slopes.ncols());
    let rows = blocks.iter().map(|block| block.slopes.nrows()).sum();
    let mut out = DMatrix::zeros(rows, columns);
    let mut at = 0;
    for block in blocks {
        out.rows_mut(at, block.slopes.nrows())
            .copy_from(&block.slopes);
        at += block.slopes.nrows();
    }
    out
}

impl Structure {
    pub(crate) fn new(problem: &Problem<'_>, reached: &Reached) -> Result<Self, CalibrateError> {
        let states = problem.drawn_states(reached, STATES, &mut Draws::new(0));
        if states.is_empty() {
            return Err(CalibrateError::NotClosed);
        }
        let slopes = Sparse::new(&problem.geometry.slopes(&reached.nominal));
        let mut held = vec![false; problem.geometry.unknowns().len()];
        // where there are as many equations as dependent coordinates these follow whatever is changed
        if problem.kinematics.rows() > reached.split.dependent.len() {
            let placed = Placed::new(problem.kinematics, &reached.scalars);
            let all = vec![true; problem.kinematics.scalars];
            for q in &states {
                let closure = placed.closure(q, Some(&all));
                let moved = slopes.after(&closure.by_scalar);
                let rates = dependent_rates(&closure, &reached.split, &moved)
                    .ok_or(CalibrateError::NotClosed)?;
                let a = closure
                    .by_coordinate
                    .select_columns(&reached.split.dependent);
                let left = &moved - a * rates;
                for (k, held) in held.iter_mut().enumerate() {
                    *held |= left.column(k).amax() > 1e-6 * moved.column(k).amax().max(1e-3);
                }
            }
        }
        // noiseless measurements at the states
        let mountings: Vec<Mounting> = problem.sensors.iter().map(|s| s.mounting).collect();
        let poses = problem.noiseless(&reached.scalars, &states);
        let at = Problem {
            poses: &poses,
            ..*problem
        };
        let point = Point {
            values: reached.nominal.clone(),
            mountings,
            states,
        };
        let blocks = at
            .blocks(&reached.split, &point, &poses)
            .ok_or(CalibrateError::NotClosed)?;
        let mut all = stacked(&blocks);
        let freedoms = problem.freedoms();
        for (k, held) in held.iter().enumerate() {
            if *held {
                all.column_mut(freedoms + k).fill(0.0);
            }
        }
        Ok(Self {
            selection: Selection::of_columns(&all, SILENT),
            held,
        })
    }

    /// What the found unknowns stand for: one row for each that is found, with what a unit error of each
    /// unknown changes it by (a column). Nothing of those that loops hold.
    pub(crate) fn combinations(&self, found: &Selection, freedoms: usize) -> DMatrix<f64> {
        let unknowns = self.held.len();
        let kept: Vec<usize> = found
            .kept
            .iter()
            .copied()
            .filter(|c| *c >= freedoms)
            .collect();
        let mut out = DMatrix::zeros(kept.len(), unknowns);
        let mut add = |column: usize, unknown: usize, factor: f64| {
            if let Some(row) = kept.iter().position(|own| *own == column) {
                out[(row, unknown)] += factor;
                return;
            }
            // determined in principle, but not by these poses
            let absorbed = found.absorbed.iter().find(|own| own.column == column);
            for (own, part) in absorbed.map(|own| own.by.as_slice()).unwrap_or_default() {
                if let Some(row) = kept.iter().position(|kept| kept == own) {
                    out[(row, unknown)] += factor * part;
                }
            }
        };
        for unknown in (0..unknowns).filter(|k| !self.held[*k]) {
            let column = freedoms + unknown;
            match self
                .selection
                .absorbed
                .iter()
                .find(|own| own.column == column)
            {
                None => add(column, unknown, 1.0),
                Some(own) => own.by.iter().for_each(|(c, part)| add(*c, unknown, *part)),
            }
        }
        out
    }

    /// The unknowns that stay at their nominal values, when these columns are found.
    pub(crate) fn fixed(
        &self,
        unknowns: &[Unknown],
        freedoms: usize,
        found: &Selection,
    ) -> Vec<Fixed> {
        let mut out = Vec::new();
        for (k, unknown) in unknowns.iter().enumerate() {
            let column = freedoms + k;
            if found.kept.contains(&column) {
                continue;
            }
            let in_principle = self.selection.kept.contains(&column);
            let from = if in_principle { found } else { &self.selection };
            let absorbed = from.absorbed.iter().find(|own| own.column == column);
            let by: Vec<(String, f64)> = absorbed
                .map(|own| own.by.as_slice())
                .unwrap_or_default()
                .iter()
                .filter_map(|(c, factor)| {
                    let other = unknowns.get(c.checked_sub(freedoms)?)?;
                    Some((other.name.clone(), *factor))
                })
                .collect();
            let why = if self.held.get(k).copied().unwrap_or(false) {
                Why::LoopsFixed
            } else if in_principle {
                Why::NotShown
            } else if absorbed.is_some_and(|own| own.by.is_empty()) {
                Why::Silent
            } else {
                Why::Absorbed
            };
            out.push(Fixed {
                name: unknown.name.clone(),
                why,
                by,
            });
        }
        out
    }
}
