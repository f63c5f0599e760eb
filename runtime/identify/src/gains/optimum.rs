//! The search for the unknowns in the equations of all runs.

use super::planned::Planned;
use super::problem::Problem;
use super::robust::{Robust, reduce, reweighted};
use super::rows::Rows;
use super::statistics::Solved;
use super::unknowns::{Point, Unknowns};
use super::{GainError, GainOptions, Plan};
use crate::data::DataError;
use crate::estimate::{FactorSet, Origin};
use crate::states::Source;
use regen_runtime::BaseModel;

/// The unknowns for which the equations fit best.
pub(super) struct Optimum {
    /// The QR factors of the equations without Huber's weights.
    pub(super) set: FactorSet,
    /// Huber's estimate, if it was requested.
    robust: Option<Robust>,
    point: Point,
    weights: Vec<f64>,
    pub(super) converged: bool,
}

impl Optimum {
    /// - `start`: where the search begins; `None`: where linear equations without the gains lead it.
    pub(super) fn new<M, S>(
        rows: &mut Rows<'_, M, S>,
        origin: &Origin,
        planned: &Planned,
        options: &GainOptions,
        start: Option<Point>,
    ) -> Result<Self, GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let (set, _) = reduce(rows, origin, None)?;
        planned.require_currents(&set, &rows.efforts)?;
        let unknowns = &planned.unknowns;
        let problem = Problem {
            set: &set,
            unknowns,
        };
        let (point, weights, converged) = match start {
            None => problem.solve(options.weighting)?,
            Some(start) => problem.solve_from(start, options.weighting)?,
        };
        let robust = match options.huber {
            Some(bound) if converged => {
                let start = (point.clone(), options.weighting, bound);
                Some(reweighted(&problem, rows, origin, start)?)
            }
            _ => None,
        };
        Ok(Self {
            set,
            robust,
            point,
            weights,
            converged,
        })
    }

    pub(super) fn point(&self) -> &Point {
        self.robust.as_ref().map_or(&self.point, |own| &own.point)
    }

    /// The weights of the efforts.
    pub(super) fn weights(&self) -> &[f64] {
        self.robust
            .as_ref()
            .map_or(&self.weights, |own| &own.weights)
    }

    pub(super) fn problem<'a>(&'a self, unknowns: &'a Unknowns) -> Problem<'a> {
        Problem {
            set: self.robust.as_ref().map_or(&self.set, |own| &own.set),
            unknowns,
        }
    }

    /// The fit whose deviations are to be computed.
    pub(super) fn solved<'a>(
        &'a self,
        planned: &'a Planned,
        plan: &'a Plan,
        options: &'a GainOptions,
    ) -> Solved<'a> {
        Solved {
            problem: self.problem(&planned.unknowns),
            plain: &self.set,
            point: self.point(),
            weights: self.weights(),
            huber: self.robust.as_ref().map(|robust| &robust.huber),
            converged: self.converged,
            of_robot: &planned.of_robot,
            plan,
            options,
            base: planned.base,
            name: match self.robust {
                Some(_) => "Huber's estimate",
                None => "least squares",
            },
        }
    }
}
