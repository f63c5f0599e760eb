//! The same mechanism with other values of its geometry names. Relations between the values are
//! preserved: names of equal magnitude are scaled together, and names defined by others follow
//! these.

use crate::base::certificate::{Samples, certify};
use crate::base::geometry::mentions_names;
use crate::constraints::{NumericLoops, close_home, world_equations};
use crate::kinematics::{Frames, Geometry};
use crate::model::{self, Model};
use crate::spec::{Expr, Function, Spec};
use crate::sym::{Graph, Number};

/// Geometry names that are scaled together.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// The name that represents the group in expressions.
    pub(super) name: String,
    /// The value of this name.
    pub(super) value: Number,
    members: Vec<String>,
}

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

    /// The names of the group.
    pub(super) fn members(&self) -> impl Iterator<Item = &str> {
        self.members.iter().map(String::as_str)
    }
}

/// A note on the angles whose values are not varied; empty if there are none.
pub(super) fn fixed_angles(spec: &Spec) -> Vec<String> {
    let names = spec.geometry.iter().filter(|(_, quantity)| {
        let value = &quantity.value;
        !value.is_zero() && value.pi_multiple().is_some() && !mentions_names(&quantity.expr)
    });
    let names: Vec<&str> = names.map(|(name, _)| name.value.as_str()).collect();
    if names.is_empty() {
        return Vec::new();
    }
    vec![format!(
        "{} as given only: their sines are exact since they are fractions of pi, those of other angles are not",
        names.join(", ")
    )]
}

/// The groups of a spec's geometry names. Angles that are fractions of pi are not varied, since
/// other angles have no exact sines.
pub(super) fn groups(spec: &Spec) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (name, quantity) in &spec.geometry {
        let value = &quantity.value;
        if mentions_names(&quantity.expr) || value.is_zero() || value.pi_multiple().is_some() {
            continue;
        }
        let size = value.abs();
        match groups.iter_mut().find(|g| g.value.abs() == size) {
            Some(group) => group.members.push(name.value.clone()),
            None => groups.push(Group {
                name: name.value.clone(),
                value: value.clone(),
                members: vec![name.value.clone()],
            }),
        }
    }
    groups
}

/// Samples the mechanism with each group scaled by a factor; `None` if it does not close or if its
/// rank is uncertain.
pub(super) fn sample(spec: &Spec, scales: &[(&Group, Number)], seed: u64) -> Option<Samples> {
    let spec = scaled(spec, scales)?;
    let model = model::build(&spec);
    let home = home(&model)?;
    let samples = certify(&model, &home, seed).ok()?;
    samples.certificate().is_certain().then_some(samples)
}

/// A home that satisfies the closure equations with the changed values.
fn home(model: &Model) -> Option<Vec<f64>> {
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
fn scaled(spec: &Spec, scales: &[(&Group, Number)]) -> Option<Spec> {
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
fn value(expr: &Expr, names: &[(String, Number)]) -> Option<Number> {
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
