//! Comparison of the functions over base parameters with those over all parameters.

use regen_codegen::base::Base;
use regen_reference::{Random, State};
use regen_runtime::{BaseModel, Model, Parameter, SizeError};

use crate::check::Identities;
use crate::identities::{CheckedState, ROUNDING_BOUND};
use crate::vector::{fill, larger, mul_column_major};

/// Checks that parameters computed from random base parameters have the same forces as the
/// functions over base parameters give.
pub(crate) fn check(
    at: &CheckedState<'_>,
    base: &Base,
    all: &mut Identities,
    random: &mut Random,
) -> Result<(), SizeError> {
    let State { q, qd, qdd } = at.state;
    let model = at.model;
    let info = model.info();
    let dof = info.dof();
    let beta: Vec<f64> = (0..base.rank()).map(|_| random.signed()).collect();
    let free: Vec<f64> = base.null.iter().map(|_| random.signed()).collect();
    let phi = fill(info.parameters.len(), |out| {
        model.parameters_from_base(&beta, &free, out)
    })?;
    // the sums cancel: in a spec in millimetres they contain squares of lengths of about a thousand
    let terms = base.parameters.iter().flat_map(|p| &p.terms);
    let terms = terms.filter_map(|t| Some((t.value.to_f64() * phi.get(t.column)?).abs()));
    let scale = terms.fold(1.0, larger);
    let again = fill(beta.len(), |out| model.to_base(&phi, out))?;
    at.compare(
        all,
        "to_base(parameters_from_base) = beta",
        [&again, &beta],
        scale,
        ROUNDING_BOUND,
    );
    let mut compare = |statement, a: &[f64], b: &[f64]| {
        at.compare(all, statement, [a, b], 1.0, ROUNDING_BOUND);
    };

    let w = fill(dof * phi.len(), |out| model.regressor(q, qd, qdd, out))?;
    let w_phi = mul_column_major(&w, &phi, dof);
    let w_base = fill(dof * beta.len(), |out| {
        model.base_regressor(q, qd, qdd, out)
    })?;
    compare(
        "W_red beta = W phi",
        &mul_column_major(&w_base, &beta, dof),
        &w_phi,
    );

    let tau = fill(dof, |out| {
        model.base_inverse_dynamics(q, qd, qdd, &beta, out)
    })?;
    compare("base inverse dynamics = W phi", &tau, &w_phi);
    // Gravity contains the forces at rest, offsets included, and the bias forces contain friction.
    // Where one null direction contains both (an offset beside asymmetric Coulomb friction), the
    // base parameters do not determine how much of their sum acts at rest: the functions over base
    // parameters take the eliminated parameter as zero.
    let mut free = free;
    let is_friction = |column: usize| info.parameters.get(column).map(Parameter::is_friction);
    for (value, row) in free.iter_mut().zip(&base.null) {
        let mixed = row.terms.iter().map(|t| is_friction(t.column));
        if mixed.clone().any(|x| x == Some(true)) && mixed.clone().any(|x| x == Some(false)) {
            *value = 0.0;
        }
    }
    let phi = fill(info.parameters.len(), |out| {
        model.parameters_from_base(&beta, &free, out)
    })?;
    let gravity = fill(dof, |out| model.base_gravity(q, &beta, out))?;
    let of_phi = fill(dof, |out| model.gravity(q, &phi, out))?;
    compare("base gravity = gravity of phi", &gravity, &of_phi);
    let rest = fill(dof, |out| model.base_bias_forces(q, qd, &beta, out))?;
    let of_phi = fill(dof, |out| model.bias_forces(q, qd, &phi, out))?;
    compare("base bias forces = those of phi", &rest, &of_phi);
    let mass = fill(dof * dof, |out| model.base_mass_matrix(q, &beta, out))?;
    let of_phi = fill(dof * dof, |out| model.mass_matrix(q, &phi, out))?;
    compare("base mass matrix = that of phi", &mass, &of_phi);
    Ok(())
}
