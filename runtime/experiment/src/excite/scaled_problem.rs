//! The optimisation problem of the search, for use with other optimisers and for tests.

use super::evaluate::{Number, Problem};
use super::run::problem;
use super::{ExciteError, Limit, Settings};
use regen_batch::TrajectoryClosure;
use regen_identify::signals::Fourier;
use regen_runtime::BaseModel;

/// The optimisation problem of a search: objective and limits as functions of scaled Fourier
/// coefficients.
pub struct ScaledProblem<'m, M, D> {
    problem: Problem<'m, M, D>,
    closure: TrajectoryClosure<'m, M>,
}

impl<M, D> core::fmt::Debug for ScaledProblem<'_, M, D> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let limits = &self.problem.limits;
        f.debug_struct("ScaledProblem")
            .field("limits", limits)
            .finish()
    }
}

/// Objective, limits and their derivatives at one point.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaledEvaluation {
    /// The objective, which the search minimises.
    pub objective: f64,
    /// The derivatives of the objective by the variables.
    pub gradient: Vec<f64>,
    /// The values of all limits, grid point by grid point in the order of
    /// [`ScaledProblem::limits`]: at most zero within the limit, in units of half its range.
    pub values: Vec<f64>,
    /// The derivatives of each of `values` by the variables.
    pub slopes: Vec<Vec<f64>>,
}

impl<'m, M, D> ScaledProblem<'m, M, D>
where
    M: BaseModel<f64>,
    D: BaseModel<Number>,
{
    /// The problem of a search with these settings.
    ///
    /// # Errors
    /// When settings do not fit the model, or the ends of a limit are in the wrong order.
    pub fn new(model: &'m M, derivatives: &'m D, settings: &Settings) -> Result<Self, ExciteError> {
        Ok(Self {
            problem: problem(model, derivatives, settings)?,
            closure: TrajectoryClosure::new(model)?,
        })
    }

    /// The limits, in the order in which each grid point has them in [`ScaledEvaluation::values`].
    pub fn limits(&self) -> &[Limit] {
        &self.problem.limits
    }

    /// The variables of standing still at a pose of the independent coordinates (dof, rad or m).
    pub fn stationary(&self, pose: &[f64]) -> Vec<f64> {
        self.problem.space.stationary(pose)
    }

    /// The Fourier series of the independent coordinates for these variables.
    ///
    /// # Errors
    /// None for as many variables as [`stationary`](Self::stationary) returns.
    pub fn series(&self, variables: &[f64]) -> Result<Fourier, ExciteError> {
        self.problem.space.series(variables)
    }

    /// Evaluates objective and limits at a point; `None` where the loops do not stay closed.
    ///
    /// - `sharpness`: the power p of the means that replace the largest and smallest singular
    ///   values, where the criterion is not smooth.
    ///
    /// # Errors
    /// When a variable is not finite.
    pub fn at(
        &mut self,
        variables: &[f64],
        sharpness: f64,
    ) -> Result<Option<ScaledEvaluation>, ExciteError> {
        let evaluation =
            self.problem
                .evaluate(&mut self.closure, variables, sharpness, f64::INFINITY, None)?;
        Ok(evaluation.map(|evaluation| ScaledEvaluation {
            slopes: (0..evaluation.values.len())
                .map(|k| self.problem.slope(&evaluation, k))
                .collect(),
            objective: evaluation.objective,
            gradient: evaluation.gradient,
            values: evaluation.values,
        }))
    }
}
