//! Restores exact values of rounded numbers: angles that agree with a multiple of pi in many digits,
//! and offsets such as 4e-19 m that should be 0.
//!
//! A right angle written as 1.57079632679 has a cosine of 5e-12, whose powers occur in a chain of
//! such joints; axes at a distance of 4e-19 m do not intersect. Both add parameters to an exact
//! analysis that no measurement could show.

use crate::model::{Model, Placement, Step};
use crate::spec::{Expr, Quantity};
use crate::sym::Number;

use super::geometry::mentions_names;

/// The largest distance from a multiple of pi/12 that counts as rounding, rad.
const ROUNDING_RAD: f64 = 1e-10;
/// Multiples of pi divided by this are recognised.
const PARTS: i64 = 12;
/// Offsets below this part of the mechanism's longest one count as rounding.
const ROUNDING_OF_LENGTH: f64 = 1e-12;

/// The mechanism with multiples of pi in place of their rounded values and 0 in place of offsets
/// that are rounding, and a list of the replacements, such as `1.57079632679 = pi/2`. `None` if
/// there are none, or if the mechanism has cuts: its loops might then no longer close.
pub(super) fn restored(model: &Model) -> Option<(Model, Vec<String>)> {
    if !model.cuts.is_empty() {
        return None;
    }
    let mut model = model.clone();
    let mut replaced = Vec::new();
    let steps = model.links.iter().flat_map(|link| &link.placement);
    let offsets = steps.filter_map(|step| match step {
        Step::Translate(_, length) => Some(length.value.to_f64().abs()),
        Step::Rotate(..) => None,
    });
    let rounding = ROUNDING_OF_LENGTH * offsets.fold(0.0, f64::max);
    for link in &mut model.links {
        restore(&mut link.placement, rounding, &mut replaced);
    }
    replaced.sort();
    replaced.dedup();
    (!replaced.is_empty()).then_some((model, replaced))
}

fn restore(placement: &mut Placement, rounding: f64, replaced: &mut Vec<String>) {
    for step in placement {
        match step {
            Step::Rotate(_, angle) => {
                if let Some(meant) = meant(&angle.value) {
                    replaced.push(format!("{} = {meant}", angle.value.to_f64()));
                    angle.expr = Expr::Number(meant.clone());
                    angle.value = meant;
                }
            }
            Step::Translate(_, length) => {
                if is_rounding(length, rounding) {
                    replaced.push(format!("{:e} = 0", length.value.to_f64()));
                    length.expr = Expr::Number(Number::zero());
                    length.value = Number::zero();
                }
            }
        }
    }
}

/// Whether a length is written as a number, without names, is not 0, and is at most `bound`, m.
fn is_rounding(length: &Quantity, bound: f64) -> bool {
    let is_small = !length.value.is_zero() && length.value.to_f64().abs() <= bound;
    is_small && !mentions_names(&length.expr)
}

/// The multiple of pi/12 of which an angle is a rounded value; `None` if there is no such multiple,
/// or if the angle is exactly one.
fn meant(angle: &Number) -> Option<Number> {
    if angle.pi_multiple().is_some() {
        return None;
    }
    let parts = libm::round(angle.to_f64() * PARTS as f64 / core::f64::consts::PI);
    let meant = Number::pi().mul(&Number::ratio(parts as i64, PARTS)?);
    let distance = angle.sub(&meant).to_f64().abs();
    (distance > 0.0 && distance <= ROUNDING_RAD).then_some(meant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::Source;

    #[test]
    fn many_digits_of_a_right_angle_mean_it_and_few_do_not() -> Result<(), String> {
        for (text, expected) in [
            ("1.57079632679", Some("pi/2")),
            ("-0.523598775598", Some("-pi/6")),
            ("1e-12", Some("0")),
            ("1.5708", None),
            ("0.3", None),
            ("0", None),
        ] {
            let angle = Number::parse_decimal(text).ok_or("no decimal")?;
            let found = meant(&angle).map(|n| n.to_string());
            assert_eq!(found.as_deref(), expected, "{text}");
        }
        Ok(())
    }

    /// Four joints with axes that are parallel up to the digits printed: with the digits taken
    /// as they are, moments count that act by 5e-12.
    #[test]
    fn printed_digits_of_right_angles_do_not_add_parameters() -> Result<(), String> {
        let arm = |angle: &str| -> Result<_, String> {
            let joint = |k: usize| {
                format!(
                    "      - {{name: q{k}, type: revolute, origin: {{xyz: [0, 0, 0.{k}], rpy: \
                     [{angle}, 0, 0]}}, body: {k}, actuated: true}}\n"
                )
            };
            let joints: String = (1..5).map(joint).collect();
            let text = format!("name: arm\nlimbs:\n  - name: arm\n    joints:\n{joints}");
            let spec =
                crate::spec::parse(&Source::new("arm.yaml", text)).map_err(|e| e.to_string())?;
            let model = crate::model::build(&spec);
            Ok(crate::base::analyse(&spec, &model, &[0.0; 4]))
        };
        let (exact, printed) = (arm("pi/2")?, arm("1.57079632679")?);
        assert!(exact.complete && printed.complete);
        assert_eq!(exact.base.rank(), printed.base.rank());
        assert_eq!(printed.base.coincidences, ["1.57079632679 = pi/2"]);
        Ok(())
    }

    /// Two axes that would meet but for 4e-19 m; an offset that is small on purpose has a name, or is
    /// no rounding beside the others.
    #[test]
    fn offsets_that_are_rounding_do_not_add_parameters() -> Result<(), String> {
        let arm = |offset: &str| -> Result<_, String> {
            let text = format!(
                "name: arm\ngeometry: {{tiny: 4.33681e-19}}\nlimbs:\n  - name: arm\n    joints:\n      \
                 - {{name: q1, type: revolute, body: 1, actuated: true}}\n      \
                 - {{name: q2, type: revolute, origin: {{xyz: [{offset}, 0, 0.3]}}, body: 2, \
                 actuated: true}}\n"
            );
            let spec =
                crate::spec::parse(&Source::new("arm.yaml", text)).map_err(|e| e.to_string())?;
            let model = crate::model::build(&spec);
            Ok(crate::base::analyse(&spec, &model, &[0.0; 2]))
        };
        let (met, rounded) = (arm("0")?, arm("-4.33681e-19")?);
        assert!(met.complete && rounded.complete);
        assert_eq!(met.base.rank(), rounded.base.rank());
        assert_eq!(rounded.base.coincidences, ["-4.33681e-19 = 0"]);
        for meant in ["tiny", "1e-6"] {
            let other = arm(meant)?;
            assert!(other.base.rank() > met.base.rank(), "{meant}");
            assert!(other.base.coincidences.is_empty(), "{meant}");
        }
        Ok(())
    }
}
