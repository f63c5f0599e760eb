//! The functions over base parameters against those over all parameters.

use regen_codegen::base::Base;
use regen_runtime::{BaseModel, Model, SizeError};

use crate::states::Motion;
use crate::verify::{ROUNDING, Random, Worst, fill, larger, product};
use regen_interpreted::Interpreted;

/// Every set of parameters with the same base parameters has the same forces, which the functions
/// over base parameters compute.
pub(crate) fn functions(
    model: &Interpreted<'_>,
    motion: &Motion,
    base: &Base,
    worst: &mut Worst,
    random: &mut Random,
) -> Result<(), SizeError> {
    let Motion { q, qd, qdd } = motion;
    let info = model.info();
    let dof = info.dof();
    let beta: Vec<f64> = (0..base.rank()).map(|_| random.signed()).collect();
    let free: Vec<f64> = base.null.iter().map(|_| random.signed()).collect();
    let phi = fill(info.parameters.len(), |out| {
        model.parameters_from_base(&beta, &free, out)
    })?;
    // the sums cancel: lengths of a thousand millimetres stand in them squared
    let terms = base.parameters.iter().flat_map(|p| &p.terms);
    let terms = terms.filter_map(|t| Some((t.value.to_f64() * phi.get(t.column)?).abs()));
    let scale = terms.fold(1.0, larger);
    worst.compare(
        "to_base(parameters_from_base) = beta",
        &fill(beta.len(), |out| model.to_base(&phi, out))?,
        &beta,
        scale,
        ROUNDING,
    );
    let mut compare = |name, a: &[f64], b: &[f64]| worst.compare(name, a, b, 1.0, ROUNDING);

    let w = fill(dof * phi.len(), |out| model.regressor(q, qd, qdd, out))?;
    let w_phi = product(&w, &phi, dof);
    let w_base = fill(dof * beta.len(), |out| {
        model.base_regressor(q, qd, qdd, out)
    })?;
    compare("W_red beta = W phi", &product(&w_base, &beta, dof), &w_phi);

    let tau = fill(dof, |out| {
        model.base_inverse_dynamics(q, qd, qdd, &beta, out)
    })?;
    compare("base inverse dynamics = W phi", &tau, &w_phi);
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
