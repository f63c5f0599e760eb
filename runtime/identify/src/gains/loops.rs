//! Unknown gains and payloads from the efforts of simulated loops.
//!
//! The simulated efforts take the place of the regressor times the parameters: near the base parameters
//! `x0` of a run with which it was simulated, they are `J x + (tau - J x0)`, with the derivatives J
//! of the whole loop. This is the regressor of one more parameter, whose value is 1.

use super::linear::{Column, Linear};
use super::optimum::Optimum;
use super::planned::Planned;
use super::problem::Problem;
use super::rank::require_rank;
use super::robust::reduce;
use super::rows::{ByDrive, Rows, absent, drives, efforts, is_by_drive, without};
use super::statistics::Solved;
use super::unknowns::Point;
use super::{GainError, GainFit, GainOptions, Plan, origin};
use crate::estimate::{EstimateError, Origin, QrFactor};
use crate::identify::Columns;
use crate::states::{Recorded, StateSample};
use regen_runtime::BaseModel;

/// The unknown gains and payloads of runs that are simulated. Lists of unknowns have the base parameters
/// of the robot (none if it is known), then parameters of the payloads, then gains, all in SI.
pub struct LoadedLoops<'a, M: ?Sized> {
    model: &'a M,
    plan: &'a Plan,
    options: GainOptions,
    /// The unknowns, with a known parameter of value 1 after the base parameters.
    planned: Planned,
    /// For each run, the base parameters of payloads that it does not carry.
    absent: Vec<Vec<usize>>,
    start: Point,
    columns: Vec<Column>,
    origin: Origin,
}

/// The least squares of a round of simulation and estimate.
#[derive(Clone, Debug)]
pub struct LoadedRound {
    /// The unknowns: base parameters of the robot, parameters of the payloads, gains (SI).
    pub values: Vec<f64>,
    /// The weighted QR factor of the equations linearised there.
    pub factor: QrFactor,
}

impl<'a, M: BaseModel<f64> + ?Sized> LoadedLoops<'a, M> {
    /// Prepares the unknowns of a plan.
    ///
    /// - `carried`: for each run the payload that it carries, as an index into [`Plan::payloads`];
    /// - `start`: base parameters to begin with, r, SI; those of the robot are replaced if the plan
    ///   has a known one.
    ///
    /// # Errors
    /// As [`fit`](super::fit) for a plan that does not fit the model; when `start` has another length.
    pub fn new(
        model: &'a M,
        options: &GainOptions,
        plan: &'a Plan,
        carried: &[Option<usize>],
        start: &[f64],
    ) -> Result<Self, GainError> {
        let mut planned = Planned::new(model, plan, carried)?;
        crate::estimate::require("start", planned.base, start.len())?;
        planned.unknowns.known.push(1.0);
        let own = |load: &super::payload::Load| -> Vec<f64> {
            let base: Vec<f64> = load.base.iter().map(|k| start[*k]).collect();
            let all: Vec<usize> = (0..load.unknown.len()).collect();
            load.closest(&base, &load.initial(), &all)
        };
        let unknowns = &planned.unknowns;
        let start = Point {
            robot: unknowns.robot.iter().map(|k| start[*k]).collect(),
            loads: unknowns.loads.iter().map(own).collect(),
            inverse_gains: vec![1.0; unknowns.unknown_gains()],
        };
        let mut origin = origin(model, &efforts(model)?);
        origin.labels.push(String::new());
        let of_run = |carried: &Option<usize>| absent(&planned.blocks, *carried);
        Ok(Self {
            model,
            plan,
            options: *options,
            absent: carried.iter().map(of_run).collect(),
            columns: Linear::new(unknowns, &start).columns,
            start,
            planned,
            origin,
        })
    }

    /// For each equation of a sample, its place among the model's actuated coordinates.
    pub fn drives(&self) -> Vec<usize> {
        drives(self.model)
    }

    /// The unknowns to begin with.
    ///
    /// - `gains`: of all actuated coordinates; those that are known have no effect.
    pub fn start(&self, gains: &[f64]) -> Vec<f64> {
        let mut linear = self.linear(&[]);
        let places = self.drives();
        let values = self.columns.iter().zip(linear.values());
        let values = values.map(|(column, value)| match *column {
            Column::Gain(effort) => {
                let own = places.get(effort).and_then(|place| gains.get(*place));
                own.copied().unwrap_or(value)
            }
            _ => value,
        });
        linear = linear.moved(&values.collect::<Vec<f64>>());
        linear.values()
    }

    /// The base parameters of a run, r: those of payloads that it does not carry are 0.
    pub fn base(&self, values: &[f64], run: usize) -> Vec<f64> {
        let linear = self.linear(values);
        let x = linear.x.get(..self.planned.base).unwrap_or_default();
        without(x, self.absent(run))
    }

    /// The base parameters of the payloads that a run does not carry, whose derivatives are 0.
    pub fn absent(&self, run: usize) -> &[usize] {
        self.absent.get(run).map_or(&[], Vec::as_slice)
    }

    /// The gains of all actuated coordinates; 1 where efforts are measured in N m or N.
    pub fn gains(&self, values: &[f64]) -> Vec<f64> {
        let linear = self.linear(values);
        let mut out = vec![1.0; self.model.info().actuated.len()];
        for (effort, place) in self.drives().into_iter().enumerate() {
            if let Some(gain) = out.get_mut(place) {
                *gain = 1.0 / linear.inverse_gain(effort);
            }
        }
        out
    }

    /// The least squares of the measured efforts on those of the linearised simulation.
    ///
    /// - `log`: the measured efforts at the simulated motion;
    /// - `columns`: r + 2 columns, with a row for each drive, in the order of [`drives`](Self::drives):
    ///   the derivatives J of the simulated efforts (N m or N) by the base parameters, with 0 for
    ///   those of absent payloads; the simulated efforts minus J times the base parameters of the
    ///   run; the measured efforts, N m, N or A;
    /// - `values`: the unknowns of the simulation.
    ///
    /// # Errors
    /// [`GainError::Undetermined`], [`GainError::NoCurrent`] and [`GainError::NotConverged`]; when the
    /// columns are not those of the model.
    pub fn estimate(
        &self,
        log: &mut Recorded,
        columns: Box<dyn Columns + '_>,
        values: &[f64],
    ) -> Result<LoadedRound, GainError> {
        let mut rows = Rows::linearised(self.model, log, columns)?;
        let found = self.optimum(&mut rows, values)?;
        let set = found.problem(&self.planned.unknowns).set;
        let linear = self.linear(&self.values_at(found.point()));
        let labels = linear.labels(&self.origin.labels, &rows.efforts);
        let factor = linear.factor((set, found.weights()), &self.columns, &labels)?;
        require_rank(&linear, &factor)?;
        if !found.converged {
            return Err(GainError::NotConverged);
        }
        let values = factor.solve()?;
        Ok(LoadedRound { values, factor })
    }

    /// The fit of [`estimate`](Self::estimate) with its statistics.
    ///
    /// - `rows_of_runs`: the number of the log's rows of each run.
    ///
    /// # Errors
    /// As [`estimate`](Self::estimate).
    pub fn finish(
        &self,
        log: &mut Recorded,
        columns: &mut dyn Columns,
        rows_of_runs: &[usize],
        values: &[f64],
    ) -> Result<GainFit, GainError> {
        // contributions are those at the motion as it is
        let at_motion = AtMotion {
            by_drive: is_by_drive(self.model).then(|| ByDrive::new(self.model)),
            absent: &self.absent,
            ends: rows_of_runs
                .iter()
                .scan(0, |end, rows| {
                    *end += rows;
                    Some(*end)
                })
                .collect(),
            row: 0,
            efforts: &mut *columns,
        };
        let mut rows = Rows::linearised(self.model, log, Box::new(at_motion))?;
        let (set, _) = reduce(&mut rows, &self.origin, None)?;
        drop(rows);
        let mut rows = Rows::linearised(self.model, log, Box::new(columns))?;
        let found = self.optimum(&mut rows, values)?;
        let solved = Solved {
            name: "DIDIM",
            ..found.solved(&self.planned, self.plan, &self.options)
        };
        let mut fit = solved.finish(&mut rows)?;
        fit.model.left_out.clone_from(&self.planned.idle);
        let at_motion = Solved {
            problem: Problem {
                set: &set,
                ..solved.problem
            },
            ..solved
        };
        fit.shares = at_motion.shares(&at_motion.linear())?;
        Ok(fit)
    }

    /// The values of the columns for which the base parameters are those of a point, where other
    /// unknowns of payloads are as at the start.
    fn values_at(&self, point: &Point) -> Vec<f64> {
        let mut out = point.clone();
        let loads = self.planned.unknowns.loads.iter().zip(&self.start.loads);
        for (k, ((load, start), own)) in loads.zip(&mut out.loads).enumerate() {
            let moved = self.columns.iter().filter_map(|column| match *column {
                Column::Load(of, unknown) if of == k => Some(unknown),
                _ => None,
            });
            let moved: Vec<usize> = moved.collect();
            let mut from = start.clone();
            for unknown in &moved {
                from[*unknown] = own[*unknown];
            }
            *own = load.closest(&load.values(own), &from, &moved);
        }
        Linear::with_columns(&self.planned.unknowns, &out, &self.columns).values()
    }

    fn optimum(
        &self,
        rows: &mut Rows<'_, M, Recorded>,
        values: &[f64],
    ) -> Result<Optimum, GainError> {
        let start = self.linear(values).point;
        Optimum::new(
            rows,
            &self.origin,
            &self.planned,
            &self.options,
            Some(start),
        )
    }

    /// The unknowns linearised at these values, or at the start.
    fn linear(&self, values: &[f64]) -> Linear<'_> {
        let start = Linear::with_columns(&self.planned.unknowns, &self.start, &self.columns);
        if values.is_empty() {
            return start;
        }
        start.moved(values)
    }
}

/// The columns of [`LoadedLoops::estimate`] where the motion does not depend on the parameters: the
/// derivatives are the base regressor, and there is no constant part.
struct AtMotion<'a, M: ?Sized> {
    by_drive: Option<ByDrive<'a, M>>,
    /// For each run, the base parameters of payloads that it does not carry.
    absent: &'a [Vec<usize>],
    /// For each run, the number of rows up to its end.
    ends: Vec<usize>,
    row: usize,
    /// Columns of which the last one is the measured efforts.
    efforts: &'a mut dyn Columns,
}

impl<M: BaseModel<f64> + ?Sized> Columns for AtMotion<'_, M> {
    fn count(&self) -> usize {
        self.efforts.count()
    }

    fn fill(
        &mut self,
        row: &StateSample<'_>,
        w: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        let run = self.ends.partition_point(|end| *end <= self.row);
        self.row += 1;
        if !self.efforts.fill(row, w, out)? {
            return Ok(false);
        }
        let dof = out.len() / self.efforts.count().max(1);
        let (own, rest) = out.split_at_mut(w.len().min(out.len()));
        if let Some(constant) = rest.get_mut(..dof) {
            constant.fill(0.0);
        }
        match &mut self.by_drive {
            None => own.copy_from_slice(w),
            Some(by_drive) => {
                if !by_drive.transform(row.q, w, own)? {
                    return Ok(false);
                }
            }
        }
        for column in self.absent.get(run).into_iter().flatten() {
            if let Some(own) = own.get_mut(column * dof..(column + 1) * dof) {
                own.fill(0.0);
            }
        }
        Ok(true)
    }

    fn restart(&mut self) {
        self.row = 0;
        self.efforts.restart();
    }

    fn skip(&mut self) {
        self.row += 1;
        self.efforts.skip();
    }
}
