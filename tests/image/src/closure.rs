//! The loop closure of any robot, as a controller calls it.

use regen_runtime::{Closure, Misuse, Model, Solution, State};

/// See [`Closure::new`].
///
/// # Errors
/// When the model's `Info` is inconsistent.
pub fn new(model: &dyn Model) -> Result<Closure<'_, dyn Model + '_>, Misuse> {
    Closure::new(model)
}

/// See [`Closure::solve`].
///
/// # Errors
/// When `q_i` does not fit.
pub fn solve(closure: &mut Closure<'_, dyn Model>, q_i: &[f64]) -> Result<Solution, Misuse> {
    closure.solve(q_i)
}

/// See [`Closure::track`].
///
/// # Errors
/// When `q_i` does not fit.
pub fn track(closure: &mut Closure<'_, dyn Model>, q_i: &[f64]) -> Result<Solution, Misuse> {
    closure.track(q_i)
}

/// See [`Closure::restart`].
pub fn restart(closure: &mut Closure<'_, dyn Model>) {
    closure.restart();
}

/// See [`Closure::solve_state`].
///
/// # Errors
/// When an argument does not fit.
pub fn solve_state(
    closure: &mut Closure<'_, dyn Model>,
    q_i: &[f64],
    qd_i: &[f64],
    qdd_i: &[f64],
) -> Result<State, Misuse> {
    closure.solve_state(q_i, qd_i, qdd_i)
}

/// See [`Closure::track_state`].
///
/// # Errors
/// When an argument does not fit.
pub fn track_state(
    closure: &mut Closure<'_, dyn Model>,
    q_i: &[f64],
    qd_i: &[f64],
    qdd_i: &[f64],
) -> Result<State, Misuse> {
    closure.track_state(q_i, qd_i, qdd_i)
}
