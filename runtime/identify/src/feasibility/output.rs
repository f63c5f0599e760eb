//! Identified parameters as text: the bodies of a spec, and constants for a controller.

use core::fmt::Write;

use super::error::{finite, size};
use super::{FeasibilityError, ParameterLayout, about_centre};
use crate::text::yaml_text;
use regen_runtime::{Info, Parameter};

/// The SI unit of a parameter, from its label; the unit of friction depends on whether the joint
/// rotates or slides.
///
/// ```
/// use regen_identify::feasibility::unit;
/// use regen_runtime::Info;
/// assert_eq!(unit("Ixy(3)", &Info::EMPTY), "kg m^2");
/// assert_eq!(unit("mx(3)", &Info::EMPTY), "kg m");
/// ```
pub fn unit(label: &str, info: &Info<'_>) -> &'static str {
    let own = info.parameters.iter().find(|p| **p == *label).copied();
    // a layout of the caller's may have labels that the model lacks
    let parameter = own.or_else(|| Parameter::read(label));
    parameter.map_or("SI", |p| p.unit(info.motion_of(p.owner)))
}

/// Writes a number that reads back to the same double, always with a point or exponent.
fn number(x: f64) -> String {
    format!("{x:?}")
}

fn list(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|x| number(*x)).collect();
    texts.join(", ")
}

/// Writes the `bodies:` of a spec: mass, centre of mass, and inertia about it in the body's axes.
///
/// - `phi`: p parameters of the layout, SI, about the origins of the bodies' frames.
///
/// The centre of mass of a body without mass is written as the origin.
///
/// # Errors
/// When the length does not fit or a value is not finite.
///
/// ```
/// use regen_identify::feasibility::{ParameterLayout, SYMBOLS, bodies_yaml};
///
/// let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
/// let layout = ParameterLayout::new(&labels)?;
/// // 2 kg around (0.5, 0, 0)
/// let phi = [0.1, 0.0, 0.0, 0.6, 0.0, 0.6, 1.0, 0.0, 0.0, 2.0];
/// assert_eq!(
///     bodies_yaml(&layout, &phi)?,
///     "bodies:\n  1: {mass: 2.0, com: [0.5, 0.0, 0.0], \
///      inertia: [0.1, 0.0, 0.0, 0.09999999999999998, 0.0, 0.09999999999999998]}\n"
/// );
/// # Ok::<(), regen_identify::feasibility::FeasibilityError>(())
/// ```
pub fn bodies_yaml(layout: &ParameterLayout, phi: &[f64]) -> Result<String, FeasibilityError> {
    size("phi", layout.len(), phi.len())?;
    finite("phi", phi)?;
    let mut out = String::from("bodies:\n");
    for body in layout.bodies() {
        let (mass, com, inertia) = about_centre(&body.columns.map(|c| phi[c]));
        // writing to a String cannot fail; adding 0.0 turns -0 into 0
        let _ = writeln!(
            out,
            "  {}: {{mass: {}, com: [{}], inertia: [{}]}}",
            yaml_text(&body.label),
            number(mass),
            list(&com.map(|v| v + 0.0)),
            list(&inertia.map(|v| v + 0.0)),
        );
    }
    Ok(out)
}

/// Writes the parameters as Rust source for a controller: `PHI` in the order of the model's
/// regressor, each with its label and unit.
///
/// # Errors
/// When the length does not fit or a value is not finite.
///
/// ```
/// use regen_identify::feasibility::{ParameterLayout, rust_constants};
/// use regen_runtime::Info;
/// let layout = ParameterLayout::new(&["Fv(q1)"])?;
/// assert_eq!(
///     rust_constants(&layout, &[3.5], &Info::EMPTY)?,
///     "/// Identified parameters, in the order of the regressor's columns.\n\
///      pub const PHI: [f64; 1] = [\n    3.5, // Fv(q1), SI\n];\n"
/// );
/// # Ok::<(), regen_identify::feasibility::FeasibilityError>(())
/// ```
pub fn rust_constants(
    layout: &ParameterLayout,
    phi: &[f64],
    info: &Info<'_>,
) -> Result<String, FeasibilityError> {
    size("phi", layout.len(), phi.len())?;
    finite("phi", phi)?;
    let of = if info.name.is_empty() {
        String::new()
    } else {
        format!(" of {}", info.name)
    };
    let mut out = format!(
        "/// Identified parameters{of}, in the order of the regressor's columns.\n\
         pub const PHI: [f64; {}] = [\n",
        phi.len()
    );
    for (label, value) in layout.labels().iter().zip(phi) {
        // the label must fit on the line of its comment
        let label = label.replace(['\n', '\r'], " ");
        let _ = writeln!(
            out,
            "    {}, // {label}, {}",
            number(*value),
            unit(&label, info)
        );
    }
    out += "];\n";
    Ok(out)
}
