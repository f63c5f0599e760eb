//! Identifies base parameters: sets up equations, solves for the
//! parameters in passes over the log.

mod delay;
mod equation_builder;
mod held;
mod huber;
mod instruments;
mod passes;
mod pending;
mod replay;
mod residual_passes;
mod rests;
mod sampling;
mod slower;
mod stored;
mod stream;

pub use delay::{Delay, Delays};
pub use equation_builder::{EquationBuilder, EquationKind, Equations};
pub(crate) use held::HeldEfforts;
pub use instruments::{Hausman, InstrumentOptions, Instrumental, MotionSource, instrumental};
pub(crate) use instruments::{InstrumentRegressor, InstrumentedEquations, instrumental_of};
pub use passes::{
    Identified, Options, errors_of_prediction, identify, identify_linearised, observe, residuals,
};
pub(crate) use passes::{
    identify_and_store, identify_with_columns, observe_weighed, observe_with_columns,
};
pub(crate) use replay::Replay;
pub(crate) use residual_passes::samples_per_independent_one;
pub(crate) use sampling::ChangedParameters;
pub(crate) use stored::Means;
pub use stored::StoredEquations;
pub(crate) use stream::normalise;
pub use stream::{Columns, LeftOut, NoColumns, equations};

use crate::states::Source;
use regen_runtime::{BaseModel, Status};

/// The base parameters, as indices, whose columns are 0 in all equations of motion of a log that have a
/// weight: nothing that is measured depends on them.
///
/// # Errors
/// When the log cannot be read or does not fit the model.
pub fn unseen<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    source: &mut S,
) -> Result<Vec<usize>, S::Error> {
    let (dof, columns) = (model.info().dof(), model.base_info().base.len());
    let mut seen = vec![false; columns];
    let mut w = vec![0.0; dof * columns];
    source.visit(&mut |state| {
        let condition = model.base_regressor(state.q, state.qd, state.qdd, &mut w)?;
        if condition.status() == Status::Singular || dof == 0 {
            return Ok(());
        }
        for (seen, column) in seen.iter_mut().zip(w.chunks_exact(dof)) {
            let mut entries = column.iter().zip(state.weights);
            *seen |= entries.any(|(w, weight)| *weight != 0.0 && *w != 0.0);
        }
        Ok(())
    })?;
    Ok((0..columns).filter(|k| !seen[*k]).collect())
}

/// Decimals of numbers that enter a digest: compiled and interpreted models agree in more.
const DIGEST_DECIMALS: usize = 9;

/// The digest of a model, by which files are matched with models: a hash (FNV-1a, 64 bits, in
/// hexadecimal) of the names, of the base combinations, and of the regressor at one state.
///
/// Two robots with the same names and different lengths have different digests; comments and
/// layout of the description have no effect.
pub fn digest<M: BaseModel<f64> + ?Sized>(model: &M) -> String {
    let info = model.info();
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    for name in info.coordinates {
        hash.text(name);
    }
    for parameter in info.parameters {
        hash.text(&parameter.label());
    }
    for list in [info.independent, info.dependent, info.actuated] {
        for k in list {
            hash.text(&format!("{k}"));
        }
    }
    for parameter in model.base_info().base {
        hash.text(parameter.label);
        for term in parameter.terms {
            hash.text(term.parameter);
            hash.number(term.value);
        }
    }
    // a state near home, so that lengths affect the regressor; its loops need not be closed
    let n = info.coordinates.len();
    let off = |k: usize, scale: f64| scale * (1.0 + 0.1 * k as f64);
    let q: Vec<f64> = info
        .home
        .iter()
        .enumerate()
        .map(|(k, x)| x + off(k, 0.01))
        .collect();
    let qd: Vec<f64> = (0..n).map(|k| off(k, 0.3)).collect();
    let qdd: Vec<f64> = (0..n).map(|k| off(k, -0.7)).collect();
    let mut w = vec![0.0; info.dof() * model.base_info().base.len()];
    if model.base_regressor(&q, &qd, &qdd, &mut w).is_ok() {
        for x in w {
            hash.number(x);
        }
    }
    format!("{:016x}", hash.0)
}

struct Hash(u64);

impl Hash {
    fn text(&mut self, text: &str) {
        for byte in text.bytes().chain([0]) {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn number(&mut self, value: f64) {
        // a zero with rounding errors may be exactly zero in the other kind of model
        let value = if value.abs() < 1e-12 { 0.0 } else { value };
        self.text(&format!("{value:.DIGEST_DECIMALS$e}"));
    }
}
