//! The same mechanism with other values of its geometry names. Relations between the values are
//! preserved: names of equal magnitude are scaled together, and names defined by others follow
//! these.

use std::collections::BTreeSet;

use dashu_ratio::RBig;

use crate::base::certificate::{Samples, certify};
use crate::base::geometry::mentions_names;
use crate::constraints::{NumericLoops, close_home, world_equations};
use crate::kinematics::{Frames, Geometry};
use crate::model::{self, Model};
use crate::spec::{Expr, Function, Spec};
use crate::sym::{Graph, Number};

/// Geometry names that are scaled together.
#[derive(Clone, Debug)]
pub(in crate::base) struct Group {
    /// The name that represents the group in expressions.
    pub(in crate::base) name: String,
    /// The value of this name.
    pub(in crate::base) value: Number,
    /// Whether it is an angle, whose sine and cosine occur in factors.
    pub(in crate::base) is_angle: bool,
    members: Vec<String>,
}

/// The powers with which a group occurs in a product: of its name; of an angle, of its cosine and its
/// sine.
pub(super) type Powers = [i64; 2];

impl Group {
    /// The union of several groups, to be scaled in proportion; `None` for fewer than two groups.
    pub(super) fn merged<'a>(mut groups: impl Iterator<Item = &'a Group>) -> Option<Group> {
        let mut merged = groups.next()?.clone();
        let first = merged.members.len();
        for group in groups {
            merged.members.extend(group.members.iter().cloned());
        }
        (merged.members.len() > first).then_some(merged)
    }

    /// The product of the group's powers, with its name scaled if a scale is given.
    pub(super) fn product(&self, scale: Option<&Number>, powers: Powers) -> Option<Number> {
        let value = scale.map_or_else(|| self.value.clone(), |s| self.value.mul(s));
        if !self.is_angle {
            return value.powi(powers[0]);
        }
        let (sin, cos) = value.sin_cos();
        Some(cos.powi(powers[0])?.mul(&sin.powi(powers[1])?))
    }

    /// One name of the group alone.
    pub(super) fn only(&self, name: &str) -> Group {
        Group {
            members: vec![name.to_owned()],
            ..self.clone()
        }
    }

    /// The names of the group.
    pub(in crate::base) fn members(&self) -> impl Iterator<Item = &str> {
        self.members.iter().map(String::as_str)
    }
}

/// A note on the angles whose values are not varied; empty if there are none.
pub(super) fn fixed_angles(spec: &Spec, angles: &BTreeSet<String>) -> Vec<String> {
    let held = |is_angle: bool| {
        let names = spec.geometry.iter().filter(|(name, quantity)| {
            !quantity.value.is_zero()
                && !mentions_names(&quantity.expr)
                && angles.contains(&name.value) == is_angle
                && is_fixed(&quantity.value, is_angle)
        });
        let names: Vec<&str> = names.map(|(name, _)| name.value.as_str()).collect();
        names.join(", ")
    };
    let (right, others) = (held(true), held(false));
    let mut notes = Vec::new();
    if !right.is_empty() {
        notes.push(format!("{right} as given only: right angles are special"));
    }
    if !others.is_empty() {
        notes.push(format!(
            "{others} as given only: their sines are exact since they are fractions of pi, those of other angles are not"
        ));
    }
    notes
}

/// Whether a value is not varied: a fraction of pi, of an angle a multiple of pi/2.
fn is_fixed(value: &Number, is_angle: bool) -> bool {
    let Some(multiple) = value.pi_multiple() else {
        return false;
    };
    !is_angle || (multiple * RBig::from(2)).is_int()
}

/// The groups of a spec's geometry names. A multiple of pi is varied only if it is an angle, and no
/// right angle: the loops might not close with another one.
pub(in crate::base) fn groups(spec: &Spec, angles: &BTreeSet<String>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (name, quantity) in &spec.geometry {
        let value = &quantity.value;
        let is_angle = angles.contains(&name.value);
        if mentions_names(&quantity.expr) || value.is_zero() || is_fixed(value, is_angle) {
            continue;
        }
        let size = value.abs();
        let mut known = groups.iter_mut();
        match known.find(|g| g.value.abs() == size && g.is_angle == is_angle) {
            Some(group) => group.members.push(name.value.clone()),
            None => groups.push(Group {
                name: name.value.clone(),
                value: value.clone(),
                is_angle,
                members: vec![name.value.clone()],
            }),
        }
    }
    groups
}

/// Samples the mechanism with each group scaled by a factor; `None` if it does not close or if its
/// rank is uncertain.
pub(super) fn sample(spec: &Spec, scales: &[(&Group, Number)], seed: u64) -> Option<Samples> {
    sample_of(&scaled(spec, scales)?, seed)
}

/// Samples a mechanism; `None` if it does not close or if its rank is uncertain.
pub(super) fn sample_of(spec: &Spec, seed: u64) -> Option<Samples> {
    let model = model::build(spec);
    let home = home(&model)?;
    let samples = certify(&model, &home, seed).ok()?;
    samples.certificate().is_certain().then_some(samples)
}

/// A home that satisfies the closure equations of a model.
pub(in crate::base) fn home(model: &Model) -> Option<Vec<f64>> {
    let mut g = Graph::new();
    for coordinate in &model.coordinates {
        g.symbol(&coordinate.name);
    }
    g.set_naming(false);
    let frames = Frames::new(&mut g, model, Geometry::Values);
    let equations = world_equations(&mut g, &frames, model, None);
    let loops = NumericLoops::new(&g, &equations, model);
    close_home(&loops, model).ok()
}

/// The spec with the groups scaled and all quantities evaluated anew.
pub(in crate::base) fn scaled(spec: &Spec, scales: &[(&Group, Number)]) -> Option<Spec> {
    let mut spec = spec.clone();
    let mut names: Vec<(String, Number)> = Vec::new();
    for (name, quantity) in &mut spec.geometry {
        let scale = scales.iter().find(|(g, _)| g.members.contains(&name.value));
        quantity.value = match scale {
            Some((_, scale)) => quantity.value.mul(scale),
            None => value(&quantity.expr, &names)?,
        };
        names.push((name.value.clone(), quantity.value.clone()));
    }
    for quantity in spec.quantities_mut() {
        quantity.value = value(&quantity.expr, &names)?;
    }
    Some(spec)
}

/// The value of an expression for the given values of names.
pub(in crate::base) fn value(expr: &Expr, names: &[(String, Number)]) -> Option<Number> {
    let of = |e: &Expr| value(e, names);
    Some(match expr {
        Expr::Number(n) => n.clone(),
        Expr::Pi => Number::pi(),
        Expr::Name(name) => names.iter().find(|(n, _)| n == name)?.1.clone(),
        Expr::Neg(a) => of(a)?.neg(),
        Expr::Add(a, b) => of(a)?.add(&of(b)?),
        Expr::Sub(a, b) => of(a)?.sub(&of(b)?),
        Expr::Mul(a, b) => of(a)?.mul(&of(b)?),
        Expr::Div(a, b) => of(a)?.div(&of(b)?)?,
        Expr::Pow(a, b) => {
            let (a, b) = (of(a)?, of(b)?);
            match b.as_i64() {
                Some(exponent) => a.powi(exponent)?,
                // the only other exponent that the grammar allows is 1/2
                None => a.sqrt()?,
            }
        }
        Expr::Call(function, a) => {
            let a = of(a)?;
            match function {
                Function::Sqrt => a.sqrt()?,
                Function::Sin => a.sin_cos().0,
                Function::Cos => a.sin_cos().1,
                Function::Tan => a.tan()?,
                // only effort terms call these, and none with constants alone
                Function::Sign | Function::Abs => return None,
                Function::Deg => a.mul(&Number::pi()).div(&Number::from_i64(180))?,
            }
        }
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn groups_are_merged_only_where_there_are_two() {
        let group = |name: &str| Group {
            name: name.to_owned(),
            value: Number::one(),
            is_angle: false,
            members: vec![name.to_owned(), format!("{name}_again")],
        };
        let all = [group("a"), group("b"), group("c")];
        assert!(Group::merged(all[..0].iter()).is_none());
        assert!(Group::merged(all[..1].iter()).is_none());
        let merged = Group::merged(all[1..].iter()).unwrap();
        let members: Vec<&str> = merged.members().collect();
        assert_eq!(members, ["b", "b_again", "c", "c_again"]);
    }
}
