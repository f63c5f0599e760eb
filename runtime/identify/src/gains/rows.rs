//! The equations of runs with one row for each measured effort, in the unit in which it was
//! measured.

use std::rc::Rc;

use nalgebra::DMatrix;

use super::{CarriedRun, GainError};
use crate::data::DataError;
use crate::estimate::{EstimateError, FilteredNoise};
use crate::identify::{Columns, EquationKind, InstrumentRegressor, LeftOut, NoColumns, Replay};
use crate::states::{ChangedEfforts, MotionSeries, Source, StateSample};
use regen_runtime::{BaseModel, Status};

/// The equations of one sample.
pub(super) struct Sample<'a> {
    /// The regressor of all base parameters, efforts x r, column-major; the columns of payloads that
    /// are not carried are 0.
    pub(super) w: &'a [f64],
    /// The regressor at the motion of the instruments, in the same form; empty without instruments.
    pub(super) z: &'a [f64],
    /// The measured efforts: N m, N or A.
    pub(super) measured: &'a [f64],
    /// The factor on each equation; 0 for one that is left out.
    pub(super) weights: &'a [f64],
    /// The time of the sample, s.
    pub(super) time: f64,
    pub(super) follows: bool,
    /// Those of [`Equations::held`](crate::identify::Equations::held), in the unit of `measured`.
    pub(super) held: &'a [f64],
}

/// Receives the equations of each sample.
type Sink<'a> = dyn FnMut(&Sample<'_>) -> Result<(), EstimateError> + 'a;

/// Where the parts of a sample stand among the columns of a run's equations, counted in columns.
#[derive(Clone, Copy)]
struct Layout {
    /// The first column of the regressor, and the number of its columns.
    w: (usize, usize),
    /// The column of the measured efforts; `None` where they are the right-hand sides.
    measured: Option<usize>,
    /// The column of [`Sample::held`]; `None` where they are those of the equations.
    held: Option<usize>,
    /// The first column of the instruments.
    z: Option<usize>,
}

/// The runs, whose equations are computed once as long as there is memory.
pub(super) struct Rows<'a, M: ?Sized, S: ?Sized> {
    model: &'a M,
    runs: Vec<(Replay<'a, M, S>, Vec<usize>)>,
    /// The names of the efforts, one for each row of a sample.
    pub(super) efforts: Vec<String>,
    layout: Layout,
    /// Whether the efforts are those of other coordinates than the independent ones.
    by_drive: bool,
}

impl<'a, M, S> Rows<'a, M, S>
where
    M: BaseModel<f64> + ?Sized,
    S: Source + ?Sized,
    S::Error: Into<DataError>,
{
    /// Prepares the equations of the runs; they are computed by the first [`visit`](Self::visit).
    ///
    /// - `blocks`: the base parameters of each payload.
    pub(super) fn new(
        model: &'a M,
        runs: &'a mut [CarriedRun<'_, S>],
        blocks: &[Vec<usize>],
    ) -> Result<Self, GainError> {
        let by_drive = is_by_drive(model);
        let r = model.base_info().base.len();
        let layout = if by_drive {
            Layout {
                w: (r, r),
                measured: Some(2 * r),
                held: Some(2 * r + 1),
                z: None,
            }
        } else {
            Layout {
                w: (0, r),
                measured: None,
                held: None,
                z: None,
            }
        };
        let runs = runs.iter_mut().map(|run| {
            let columns: Box<dyn Columns + 'a> = if by_drive {
                Box::new(ByDrive::new(model))
            } else {
                Box::new(NoColumns)
            };
            (&mut *run.source, run.carried, columns)
        });
        Self::with_columns(model, runs.collect(), blocks, layout)
    }

    /// Prepares equations whose columns are those of [`LoadedLoops`](super::LoadedLoops): derivatives
    /// and a constant part of predicted efforts, then measured ones.
    pub(super) fn linearised(
        model: &'a M,
        source: &'a mut S,
        columns: Box<dyn Columns + 'a>,
    ) -> Result<Self, GainError> {
        let r = model.base_info().base.len();
        crate::estimate::require("columns", r + 2, columns.count())?;
        let layout = Layout {
            w: (r, r + 1),
            measured: Some(2 * r + 1),
            held: None,
            z: None,
        };
        Self::with_columns(model, vec![(source, None, columns)], &[], layout)
    }

    fn with_columns(
        model: &'a M,
        runs: Vec<(&'a mut S, Option<usize>, Box<dyn Columns + 'a>)>,
        blocks: &[Vec<usize>],
        layout: Layout,
    ) -> Result<Self, GainError> {
        let count = runs.len();
        let runs = runs.into_iter().map(|(source, carried, columns)| {
            let absent = absent(blocks, carried);
            let replay = Replay::with_columns(model, EquationKind::Forces, source, columns);
            (replay.shared(count), absent)
        });
        Ok(Self {
            model,
            efforts: efforts(model)?,
            layout,
            by_drive: is_by_drive(model),
            runs: runs.collect(),
        })
    }

    /// Adds instruments to the equations of the runs, or replaces those that they have.
    ///
    /// - `motions`: the motion of the instruments of each run.
    pub(super) fn set_instruments(
        &mut self,
        motions: &[Rc<MotionSeries>],
    ) -> Result<(), GainError> {
        crate::estimate::require("motions", self.runs.len(), motions.len())?;
        let r = self.model.base_info().base.len();
        for ((replay, _), motion) in self.runs.iter_mut().zip(motions) {
            let columns = InstrumentRegressor::new(self.model, motion.clone())?;
            replay.set_columns(if self.by_drive {
                Box::new(BothByDrive {
                    rows: ByDrive::new(self.model),
                    instruments: columns,
                })
            } else {
                Box::new(columns)
            });
        }
        self.layout.z = Some(if self.by_drive { 2 * r + 2 } else { r });
        Ok(())
    }

    /// Returns an error unless the equations have instruments.
    pub(super) fn require_instruments(&self) -> Result<(), GainError> {
        let motions = if self.layout.z.is_some() {
            self.runs.len()
        } else {
            0
        };
        Ok(crate::estimate::require(
            "motions",
            self.runs.len(),
            motions,
        )?)
    }

    /// The base parameters of each run: those of payloads that it does not carry are 0.
    ///
    /// - `x`: all base parameters.
    pub(super) fn base_of_runs(&self, x: &[f64]) -> Vec<Vec<f64>> {
        let of_run = |(_, absent): &(Replay<'a, M, S>, Vec<usize>)| without(x, absent);
        self.runs.iter().map(of_run).collect()
    }

    /// Passes the equations of all runs to `each`, run after run.
    pub(super) fn visit(&mut self, each: &mut Sink<'_>) -> Result<(), GainError> {
        let dof = self.efforts.len();
        let Layout {
            w: (first, count),
            measured,
            held,
            z,
        } = self.layout;
        let mut w = vec![0.0; dof * count];
        let mut instruments = vec![0.0; z.map_or(0, |_| dof * count)];
        let mut weights = vec![0.0; dof];
        let by_drive = self.by_drive;
        for (replay, absent) in &mut self.runs {
            let result = replay.visit(&mut |rows| {
                if rows.tau.is_empty() {
                    return Ok(());
                }
                let part = |first: usize, count: usize| {
                    let own = rows.w.get(dof * first..dof * (first + count));
                    own.unwrap_or_default()
                };
                w.copy_from_slice(part(first, count));
                if let Some(z) = z {
                    instruments.copy_from_slice(part(z, count));
                }
                for column in absent.iter() {
                    for all in [&mut w, &mut instruments] {
                        if let Some(own) = all.get_mut(column * dof..(column + 1) * dof) {
                            own.fill(0.0);
                        }
                    }
                }
                if by_drive {
                    // static friction in one equation affects the equations of all drives, because
                    // each of these is a combination of all equations
                    let least = rows.weights.iter().copied().fold(1.0, f64::min);
                    weights.fill(least);
                } else {
                    weights.copy_from_slice(rows.weights);
                }
                each(&Sample {
                    w: &w,
                    z: &instruments,
                    measured: measured.map_or(rows.tau, |column| part(column, 1)),
                    weights: &weights,
                    time: rows.time,
                    follows: rows.follows,
                    held: held.map_or(rows.held, |column| part(column, 1)),
                })
            });
            result.map_err(|why| GainError::Data(why.into()))?;
        }
        Ok(())
    }

    /// Passes states of all runs, each with the change of its efforts if the positions are
    /// differentiated in another way, SI; see [`Source::changed_efforts`].
    ///
    /// - `x`: all base parameters; `motions`: those of the instruments, one for each run.
    pub(super) fn changed_efforts(
        &mut self,
        x: &[f64],
        motions: Option<&[Rc<MotionSeries>]>,
        each: &mut dyn FnMut(&ChangedEfforts<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), GainError> {
        let (dof, r) = (self.efforts.len(), x.len());
        let mut by_drive = self.by_drive.then(|| ByDrive::new(self.model));
        for (run, (replay, absent)) in self.runs.iter_mut().enumerate() {
            let beta = without(x, absent);
            let motion = motions.and_then(|all| all.get(run)).map(AsRef::as_ref);
            let mut changed = |state: &ChangedEfforts<'_>| {
                crate::estimate::require("w", dof * r, state.w.len())?;
                crate::estimate::require("change", dof, state.change.len())?;
                let mut all = [state.w, state.change].concat();
                if let Some(by_drive) = &mut by_drive {
                    let own = all.clone();
                    if !by_drive.transform(state.q, &own, &mut all)? {
                        return Ok(());
                    }
                }
                for column in absent.iter() {
                    if let Some(own) = all.get_mut(column * dof..(column + 1) * dof) {
                        own.fill(0.0);
                    }
                }
                let (w, change) = all.split_at(dof * r);
                each(&ChangedEfforts {
                    w,
                    change,
                    ..*state
                })
            };
            let passed = replay.source().changed_efforts(&beta, motion, &mut changed);
            passed.map_err(|why| GainError::Data(why.into()))?;
        }
        Ok(())
    }

    /// What the filter makes of white noise of the efforts; where it differs between the runs it counts as unknown.
    pub(super) fn filtered_noise(&self) -> FilteredNoise {
        let mut all = self.runs.iter().map(|(replay, _)| replay.filtered_noise());
        let first = all.next().unwrap_or_else(FilteredNoise::unfiltered);
        if all.all(|own| own.is_as(&first)) {
            first
        } else {
            FilteredNoise::unfiltered()
        }
    }

    /// The numbers of rows and samples that the last pass left out.
    pub(super) fn left_out(&self) -> LeftOut {
        let mut out = LeftOut {
            resting: vec![0; self.efforts.len()],
            ..LeftOut::default()
        };
        for (replay, _) in &self.runs {
            let own = replay.left_out();
            out.samples += own.samples;
            out.singular += own.singular;
            out.unsettled += own.unsettled;
            out.bridged += own.bridged;
            for (sum, more) in out.resting.iter_mut().zip(&own.resting) {
                *sum += more;
            }
        }
        out
    }
}

/// Whether a drive moves a dependent coordinate.
pub(super) fn is_by_drive<M: BaseModel<f64> + ?Sized>(model: &M) -> bool {
    let info = model.info();
    !info.independent.iter().all(|c| info.actuated.contains(c))
}

/// The names of the efforts that are measured, one for each equation of a sample.
pub(super) fn efforts<M: BaseModel<f64> + ?Sized>(model: &M) -> Result<Vec<String>, GainError> {
    let info = model.info();
    if info.actuated.len() != info.dof() {
        return Err(GainError::Drives {
            actuated: info.actuated.len(),
            dof: info.dof(),
        });
    }
    let rows = if is_by_drive(model) {
        info.actuated
    } else {
        info.independent
    };
    let names = rows.iter().filter_map(|c| info.coordinates.get(*c));
    Ok(names.map(|name| (*name).to_owned()).collect())
}

/// For each effort of [`efforts`], its place among the actuated coordinates.
pub(super) fn drives<M: BaseModel<f64> + ?Sized>(model: &M) -> Vec<usize> {
    let info = model.info();
    if is_by_drive(model) {
        return (0..info.actuated.len()).collect();
    }
    let place = |c: &usize| info.actuated.iter().position(|own| own == c);
    info.independent.iter().filter_map(place).collect()
}

/// The base parameters of the payloads that a run does not carry.
pub(super) fn absent(blocks: &[Vec<usize>], carried: Option<usize>) -> Vec<usize> {
    let absent = blocks.iter().enumerate();
    let absent = absent.filter(|(k, _)| carried != Some(*k));
    absent.flat_map(|(_, block)| block.clone()).collect()
}

/// Adds to each effort its entries in the columns times their values.
///
/// - `columns`: efforts x columns, column-major.
pub(super) fn add_product(efforts: &mut [f64], columns: &[f64], values: &[f64]) {
    for (column, value) in columns.chunks_exact(efforts.len().max(1)).zip(values) {
        for (sum, entry) in efforts.iter_mut().zip(column) {
            *sum += entry * value;
        }
    }
}

/// Base parameters with those at some places as 0.
pub(super) fn without(x: &[f64], absent: &[usize]) -> Vec<f64> {
    let mut out = x.to_vec();
    for place in absent {
        out[*place] = 0.0;
    }
    out
}

/// The regressor's rows, and the measured efforts, by drives: where a drive moves a dependent
/// coordinate, the generalized forces are combinations of the efforts.
pub(super) struct ByDrive<'a, M: ?Sized> {
    model: &'a M,
    base: usize,
    /// A unit effort of one drive.
    unit: Vec<f64>,
    /// The generalized forces of a unit effort of each drive, dof x dof.
    forces: Vec<f64>,
}

impl<'a, M: BaseModel<f64> + ?Sized> ByDrive<'a, M> {
    pub(super) fn new(model: &'a M) -> Self {
        let dof = model.info().dof();
        Self {
            model,
            base: model.base_info().base.len(),
            unit: vec![0.0; dof],
            forces: vec![0.0; dof * dof],
        }
    }

    /// Rows by drives at positions `q`; false where they are singular.
    ///
    /// - `w`: rows of the equations of motion, such as the base regressor, dof x any number,
    ///   column-major; `out`: as large.
    pub(super) fn transform(
        &mut self,
        q: &[f64],
        w: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        let dof = self.unit.len();
        for (k, column) in self.forces.chunks_exact_mut(dof.max(1)).enumerate() {
            self.unit.fill(0.0);
            self.unit[k] = 1.0;
            let condition = self.model.generalized_forces(q, &self.unit, column)?;
            if condition.status() == Status::Singular {
                return Ok(false);
            }
        }
        let forces = DMatrix::from_column_slice(dof, dof, &self.forces);
        let rows = DMatrix::from_column_slice(dof, w.len() / dof.max(1), w);
        let Some(rows) = forces.lu().solve(&rows) else {
            return Ok(false);
        };
        out.copy_from_slice(rows.as_slice());
        Ok(true)
    }
}

impl<M: BaseModel<f64> + ?Sized> Columns for ByDrive<'_, M> {
    fn count(&self) -> usize {
        self.base + 2
    }

    fn fill(
        &mut self,
        row: &StateSample<'_>,
        w: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        let dof = self.unit.len();
        if row.efforts.len() != dof {
            return Err(EstimateError::Size {
                what: "efforts",
                expected: dof,
                got: row.efforts.len(),
            });
        }
        let (of_base, own) = out.split_at_mut(dof * self.base);
        let (measured, held) = own.split_at_mut(dof);
        measured.copy_from_slice(row.efforts);
        if row.held.len() == dof {
            held.copy_from_slice(row.held);
        } else {
            held.fill(0.0);
        }
        self.transform(row.q, w, of_base)
    }
}

/// The columns of [`ByDrive`], and then the instruments by drives.
struct BothByDrive<'a, M: ?Sized> {
    rows: ByDrive<'a, M>,
    instruments: InstrumentRegressor<'a, M>,
}

impl<M: BaseModel<f64> + ?Sized> Columns for BothByDrive<'_, M> {
    fn count(&self) -> usize {
        self.rows.count() + self.instruments.count()
    }

    fn fill(
        &mut self,
        row: &StateSample<'_>,
        w: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        let (own, z) = out.split_at_mut(self.rows.count() * self.rows.unit.len());
        let mut there = vec![0.0; z.len()];
        // both, so that the instruments keep up with the rows
        let is_regular = self.instruments.fill(row, &[], &mut there)?;
        if !self.rows.fill(row, w, own)? || !is_regular {
            return Ok(false);
        }
        let q = self.instruments.positions().to_vec();
        self.rows.transform(&q, &there, z)
    }

    fn restart(&mut self) {
        self.instruments.restart();
    }
}
