//! The equations of runs with one row for each measured effort, in the unit in which it was
//! measured.

use nalgebra::DMatrix;

use super::{CarriedRun, GainError};
use crate::data::DataError;
use crate::estimate::EstimateError;
use crate::identify::{Columns, EquationKind, LeftOut, NoColumns, Replay, Source, StateSample};
use regen_runtime::{BaseModel, Status};

/// The equations of one sample.
pub(super) struct Sample<'a> {
    /// The regressor of all base parameters, efforts x r, column-major; the columns of payloads that
    /// are not carried are 0.
    pub(super) w: &'a [f64],
    /// The measured efforts: N m, N or A.
    pub(super) measured: &'a [f64],
    /// The factor on each equation; 0 for one that is left out.
    pub(super) weights: &'a [f64],
    pub(super) follows: bool,
}

/// Receives the equations of each sample.
type Sink<'a> = dyn FnMut(&Sample<'_>) -> Result<(), EstimateError> + 'a;

/// The runs, whose equations are computed once as long as there is memory.
pub(super) struct Rows<'a, M: ?Sized, S: ?Sized> {
    runs: Vec<(Replay<'a, M, S>, Vec<usize>)>,
    /// The names of the efforts, one for each row of a sample.
    pub(super) efforts: Vec<String>,
    /// The number of base parameters.
    base: usize,
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
        let info = model.info();
        let by_drive = !info.independent.iter().all(|c| info.actuated.contains(c));
        if info.actuated.len() != info.dof() {
            return Err(GainError::Drives {
                actuated: info.actuated.len(),
                dof: info.dof(),
            });
        }
        let rows = if by_drive {
            info.actuated
        } else {
            info.independent
        };
        let names = rows.iter().filter_map(|c| info.coordinates.get(*c));
        let base = model.base_info().base.len();
        let count = runs.len();
        let runs = runs.iter_mut().map(|run| {
            let columns: Box<dyn Columns + 'a> = if by_drive {
                Box::new(ByDrive::new(model, base))
            } else {
                Box::new(NoColumns)
            };
            let absent = blocks.iter().enumerate();
            let absent = absent.filter(|(k, _)| run.carried != Some(*k));
            let absent: Vec<usize> = absent.flat_map(|(_, block)| block.clone()).collect();
            let replay = Replay::with_columns(model, EquationKind::Forces, run.source, columns);
            (replay.shared(count), absent)
        });
        Ok(Self {
            runs: runs.collect(),
            efforts: names.map(|name| (*name).to_owned()).collect(),
            base,
            by_drive,
        })
    }

    /// Passes the equations of all runs to `each`, run after run.
    pub(super) fn visit(&mut self, each: &mut Sink<'_>) -> Result<(), GainError> {
        let dof = self.efforts.len();
        let size = dof * self.base;
        let mut w = vec![0.0; size];
        let mut weights = vec![0.0; dof];
        for (replay, absent) in &mut self.runs {
            let by_drive = self.by_drive;
            let result = replay.visit(&mut |rows| {
                if rows.tau.is_empty() {
                    return Ok(());
                }
                let own = rows.w.get(if by_drive { size..2 * size } else { 0..size });
                w.copy_from_slice(own.unwrap_or_default());
                for column in absent.iter() {
                    w[column * dof..(column + 1) * dof].fill(0.0);
                }
                let measured = if by_drive {
                    // static friction in one equation affects the equations of all drives, because
                    // each of these is a combination of all equations
                    let least = rows.weights.iter().copied().fold(1.0, f64::min);
                    weights.fill(least);
                    rows.w.get(2 * size..).unwrap_or_default()
                } else {
                    weights.copy_from_slice(rows.weights);
                    rows.tau
                };
                each(&Sample {
                    w: &w,
                    measured,
                    weights: &weights,
                    follows: rows.follows,
                })
            });
            result.map_err(|why| GainError::Data(why.into()))?;
        }
        Ok(())
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
            for (sum, more) in out.resting.iter_mut().zip(&own.resting) {
                *sum += more;
            }
        }
        out
    }
}

/// The regressor's rows, and the measured efforts, by drives: where a drive moves a dependent
/// coordinate, the generalized forces are combinations of the efforts.
struct ByDrive<'a, M: ?Sized> {
    model: &'a M,
    base: usize,
    /// A unit effort of one drive.
    unit: Vec<f64>,
    /// The generalized forces of a unit effort of each drive, dof x dof.
    forces: Vec<f64>,
}

impl<'a, M: BaseModel<f64> + ?Sized> ByDrive<'a, M> {
    fn new(model: &'a M, base: usize) -> Self {
        let dof = model.info().dof();
        Self {
            model,
            base,
            unit: vec![0.0; dof],
            forces: vec![0.0; dof * dof],
        }
    }
}

impl<M: BaseModel<f64> + ?Sized> Columns for ByDrive<'_, M> {
    fn count(&self) -> usize {
        self.base + 1
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
        for (k, column) in self.forces.chunks_exact_mut(dof.max(1)).enumerate() {
            self.unit.fill(0.0);
            self.unit[k] = 1.0;
            let condition = self.model.generalized_forces(row.q, &self.unit, column)?;
            if condition.status() == Status::Singular {
                return Ok(false);
            }
        }
        let forces = DMatrix::from_column_slice(dof, dof, &self.forces);
        let regressor = DMatrix::from_column_slice(dof, self.base, w);
        let Some(rows) = forces.lu().solve(&regressor) else {
            return Ok(false);
        };
        let (of_base, measured) = out.split_at_mut(dof * self.base);
        of_base.copy_from_slice(rows.as_slice());
        measured.copy_from_slice(row.efforts);
        Ok(true)
    }
}
