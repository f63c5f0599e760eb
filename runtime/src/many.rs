//! Functions at many states in one call.

use crate::{Arguments, BaseFunction, ControlFunction, Function, SizeError};

/// A model that computes many states faster than one after the other; see
/// [`Model::many`](crate::Model::many).
///
/// Arguments and outputs are stored entry by entry: the values of entry k at all `count` states are
/// consecutive, from index `k * count` on. Parameters (`phi`, `beta`, `free`) are the same at all
/// states and are given once. `pivots` receives the [`Condition`](crate::Condition) of each
/// state.
pub trait ManyStates {
    /// Computes a function at `count` states, as [`Model::eval`](crate::Model::eval) does at one.
    ///
    /// # Errors
    /// When a length does not fit: of the arguments in order, then of `out`, then of `pivots`.
    fn eval_many(
        &self,
        function: Function,
        count: usize,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
        pivots: &mut [f64],
    ) -> Result<(), SizeError>;

    /// Computes a function of base parameters at `count` states, as
    /// [`BaseModel::eval_base`](crate::BaseModel::eval_base) does at one.
    ///
    /// # Errors
    /// As [`eval_many`](Self::eval_many).
    fn eval_base_many(
        &self,
        function: BaseFunction,
        count: usize,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
        pivots: &mut [f64],
    ) -> Result<(), SizeError>;

    /// Computes a function for controllers at `count` states, as
    /// [`ControlModel::eval_control`](crate::ControlModel::eval_control) does at one.
    ///
    /// # Errors
    /// As [`eval_many`](Self::eval_many).
    fn eval_control_many(
        &self,
        function: ControlFunction,
        count: usize,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
        pivots: &mut [f64],
    ) -> Result<(), SizeError>;
}
