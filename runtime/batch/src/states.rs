//! Functions of any model at many states in one call.

use regen_runtime::function::{Argument, Signature};
use regen_runtime::{
    Arguments, BaseFunction, BaseModel, Condition, ControlFunction, ControlModel, Function, Model,
    SizeError,
};

/// Computes a function at `count` states: at once if the model can
/// ([`Model::many`]), else one after the other. Arguments and output are stored as
/// [`ManyStates`](regen_runtime::ManyStates) states it: entry by entry.
///
/// - `out`: `count` times the output's length; `pivots`: `count`, the pivot of each state's
///   [`Condition`].
///
/// # Errors
/// When a length does not fit.
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/slider_crank.rs")); }
/// # use models::SliderCrank;
/// use regen_batch::eval_many;
/// use regen_runtime::{Arguments, Function, Model};
///
/// // two states: the angles of the crank, those of the rod, the positions of the slider
/// let q = [0.0, 0.3, 0.1, -0.2, 3.0, 2.9];
/// let model = SliderCrank::default();
/// let (mut f, mut pivots) = ([0.0; 4], [0.0; 2]);
/// let arguments = Arguments { q: &q, ..Arguments::EMPTY };
/// eval_many(&model, Function::Constraints, 2, arguments, &mut f, &mut pivots)?;
/// let mut second = [0.0; 2];
/// model.constraints(&[0.3, -0.2, 2.9], &mut second)?;
/// assert_eq!(second, [f[1], f[3]]);
/// # Ok::<(), regen_runtime::SizeError>(())
/// ```
pub fn eval_many<M: Model<f64> + ?Sized>(
    model: &M,
    function: Function,
    count: usize,
    arguments: Arguments<'_, f64>,
    out: &mut [f64],
    pivots: &mut [f64],
) -> Result<(), SizeError> {
    if let Some(many) = model.many() {
        return many.eval_many(function, count, arguments, out, pivots);
    }
    let each =
        |arguments: Arguments<'_, f64>, out: &mut [f64]| model.eval(function, arguments, out);
    one_by_one(function.signature(), count, arguments, out, pivots, each)
}

/// As [`eval_many`] for a function of base parameters.
///
/// # Errors
/// When a length does not fit.
pub fn eval_base_many<M: BaseModel<f64> + ?Sized>(
    model: &M,
    function: BaseFunction,
    count: usize,
    arguments: Arguments<'_, f64>,
    out: &mut [f64],
    pivots: &mut [f64],
) -> Result<(), SizeError> {
    if let Some(many) = model.many() {
        return many.eval_base_many(function, count, arguments, out, pivots);
    }
    let each =
        |arguments: Arguments<'_, f64>, out: &mut [f64]| model.eval_base(function, arguments, out);
    one_by_one(function.signature(), count, arguments, out, pivots, each)
}

/// As [`eval_many`] for a function for controllers.
///
/// # Errors
/// When a length does not fit.
pub fn eval_control_many<M: ControlModel<f64> + ?Sized>(
    model: &M,
    function: ControlFunction,
    count: usize,
    arguments: Arguments<'_, f64>,
    out: &mut [f64],
    pivots: &mut [f64],
) -> Result<(), SizeError> {
    if let Some(many) = model.many() {
        return many.eval_control_many(function, count, arguments, out, pivots);
    }
    let each = |arguments: Arguments<'_, f64>, out: &mut [f64]| {
        model.eval_control(function, arguments, out)
    };
    one_by_one(function.signature(), count, arguments, out, pivots, each)
}

/// Computes state by state.
fn one_by_one(
    signature: &Signature,
    count: usize,
    arguments: Arguments<'_, f64>,
    out: &mut [f64],
    pivots: &mut [f64],
    each: impl Fn(Arguments<'_, f64>, &mut [f64]) -> Result<Condition<f64>, SizeError>,
) -> Result<(), SizeError> {
    if count == 0 {
        return Ok(());
    }
    if pivots.len() != count {
        return Err(SizeError {
            argument: "pivots",
            expected: count,
            got: pivots.len(),
        });
    }
    if !out.len().is_multiple_of(count) {
        return Err(SizeError {
            argument: "out",
            expected: out.len().next_multiple_of(count),
            got: out.len(),
        });
    }
    let mut own: [Vec<f64>; Argument::ALL.len()] = core::array::from_fn(|_| Vec::new());
    let mut row = vec![0.0; out.len() / count];
    for (state, pivot) in pivots.iter_mut().enumerate() {
        for argument in signature.arguments.iter().filter(|a| !a.is_parameter()) {
            let entries = arguments.get(*argument).iter().skip(state).step_by(count);
            let buffer = &mut own[*argument as usize];
            buffer.clear();
            buffer.extend(entries);
        }
        let mut at = arguments;
        for argument in signature.arguments.iter().filter(|a| !a.is_parameter()) {
            at = at.with(*argument, &own[*argument as usize]);
        }
        *pivot = each(at, &mut row)?.pivot;
        for (slot, value) in out.iter_mut().skip(state).step_by(count).zip(&row) {
            *slot = *value;
        }
    }
    Ok(())
}
