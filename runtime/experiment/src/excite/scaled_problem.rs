//! The search's functions for whoever wants another method, or to check them.

use super::evaluate::{Number, Problem};
use super::run::problem;
use super::{ExciteError, Limit, Settings};
use regen_identify::signals::Fourier;
use regen_runtime::{BaseModel, LoopClosure};

/// Objective and limits as functions of scaled coefficients.
pub struct ScaledProblem<'m, M, D> {
    problem: Problem<'m, M, D>,
    closure: LoopClosure<'m, M>,
}

impl<M, D> core::fmt::Debug for ScaledProblem<'_, M, D> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let limits = &self.problem.limits;
        f.debug_struct("ScaledProblem")
            .field("limits", limits)
            .finish()
    }
}

/// What the search sees at one point.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaledEvaluation {
    /// What is minimised.
    pub objective: f64,
    /// Its derivatives by the variables.
    pub gradient: Vec<f64>,
    /// The limits' values at each point of the grid, grid point by grid point in the order of
    /// [`ScaledProblem::limits`]: at most zero where a limit is kept, in units of half its range.
    pub values: Vec<f64>,
    /// The derivatives of each of `values` by the variables.
    pub slopes: Vec<Vec<f64>>,
}

impl<'m, M, D> ScaledProblem<'m, M, D>
where
    M: BaseModel<f64>,
    D: BaseModel<Number>,
{
    /// Of a search by these settings.
    ///
    /// # Errors
    /// When settings do not fit the model, or a limit is no range.
    pub fn new(model: &'m M, derivatives: &'m D, settings: &Settings) -> Result<Self, ExciteError> {
        Ok(Self {
            problem: problem(model, derivatives, settings)?,
            closure: LoopClosure::new(model)?,
        })
    }

    /// The limits.
    pub fn limits(&self) -> &[Limit] {
        &self.problem.limits
    }

    /// The variables that stand still at a pose of the independent coordinates.
    pub fn still(&self, pose: &[f64]) -> Vec<f64> {
        self.problem.space.still(pose)
    }

    /// The series of these variables.
    ///
    /// # Errors
    /// Never for as many variables as [`still`](Self::still) gives.
    pub fn series(&self, variables: &[f64]) -> Result<Fourier, ExciteError> {
        self.problem.space.series(variables)
    }

    /// All functions at a point; nothing where the loops do not stay closed.
    ///
    /// - `sharpness`: the power by which singular values are smoothed where the criterion is not
    ///   smooth.
    ///
    /// # Errors
    /// When a variable is not finite.
    pub fn at(
        &mut self,
        variables: &[f64],
        sharpness: f64,
    ) -> Result<Option<ScaledEvaluation>, ExciteError> {
        let found = self
            .problem
            .evaluate(&mut self.closure, variables, sharpness)?;
        Ok(found.map(|found| ScaledEvaluation {
            slopes: (0..found.values.len())
                .map(|k| self.problem.slope(&found, k))
                .collect(),
            objective: found.objective,
            gradient: found.gradient,
            values: found.values,
        }))
    }
}
