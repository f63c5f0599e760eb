//! The loop closure of any robot, as a controller calls it.

use regen_runtime::{ClosureError, LoopClosure, Model, Solution, State};

/// See [`LoopClosure::new`].
///
/// # Errors
/// When the model's `Info` is inconsistent.
pub fn new(model: &dyn Model) -> Result<LoopClosure<'_, dyn Model + '_>, ClosureError> {
    LoopClosure::new(model)
}

/// See [`LoopClosure::solve`].
///
/// # Errors
/// When `q_i` does not fit.
pub fn solve(
    closure: &mut LoopClosure<'_, dyn Model>,
    q_i: &[f64],
) -> Result<Solution, ClosureError> {
    closure.solve(q_i)
}

/// See [`LoopClosure::track`].
///
/// # Errors
/// When `q_i` does not fit.
pub fn track(
    closure: &mut LoopClosure<'_, dyn Model>,
    q_i: &[f64],
) -> Result<Solution, ClosureError> {
    closure.track(q_i)
}

/// See [`LoopClosure::restart`].
pub fn restart(closure: &mut LoopClosure<'_, dyn Model>) {
    closure.restart();
}

/// See [`LoopClosure::solve_state`].
///
/// # Errors
/// When an argument does not fit.
pub fn solve_state(
    closure: &mut LoopClosure<'_, dyn Model>,
    q_i: &[f64],
    qd_i: &[f64],
    qdd_i: &[f64],
) -> Result<State, ClosureError> {
    closure.solve_state(q_i, qd_i, qdd_i)
}

/// See [`LoopClosure::track_state`].
///
/// # Errors
/// When an argument does not fit.
pub fn track_state(
    closure: &mut LoopClosure<'_, dyn Model>,
    q_i: &[f64],
    qd_i: &[f64],
    qdd_i: &[f64],
) -> Result<State, ClosureError> {
    closure.track_state(q_i, qd_i, qdd_i)
}
