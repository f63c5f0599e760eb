//! Evaluates drives, and replaces them by massless joints and couplings.

use super::super::raw::RawDrive;
use super::super::shape::Name;
use super::super::types::{Joint, Limb, LinearForm, Placement, Quantity, Spanned, Spec};
use super::{Resolver, spanned, zero_quantity};
use crate::diag::{Diagnostic, Span};

/// Largest difference between a drive's value at home and that of its linear form, relative to the
/// largest of both and 1: values of home may be printed with seven digits.
const HOME_TOLERANCE: f64 = 1e-6;

/// A drive, represented by a massless joint and the linear form that couples it to other joints.
pub(super) struct ResolvedDrive {
    name: Spanned<String>,
    joint: Joint,
    form: LinearForm,
}

impl Resolver<'_> {
    /// Evaluates a drive; `None` after reporting an error.
    pub(super) fn drive(&mut self, name: &Name, raw: &RawDrive) -> Option<ResolvedDrive> {
        let joint = self.joint(&raw.joint(name));
        let scalar = &raw.of.value.0;
        let form = self.linear(scalar)?;
        if form.terms.is_empty() {
            let message = format!("the drive '{}' follows no joint", name.0.text);
            self.sink.push(
                Diagnostic::new(scalar.ast.span, message)
                    .path(&*scalar.path)
                    .hint("write a multiple of at least one joint's coordinate, such as 45*q5"),
            );
            return None;
        }
        Some(ResolvedDrive {
            name: spanned(&name.0),
            joint: joint?,
            form,
        })
    }

    /// Reports a drive whose value at home contradicts those of its joints, if home states both.
    pub(super) fn check_home_of_drives(&mut self, spec: &Spec) {
        for (key, given) in &spec.home {
            let is_drive = spec.drives.iter().any(|drive| drive.value == key.value);
            let form = spec.couplings.iter().find(|(of, _)| of.value == key.value);
            let Some((_, form)) = form.filter(|_| is_drive) else {
                continue;
            };
            let Some(follows) = spec.form_at_stated_home(form) else {
                continue;
            };
            let (given_value, follows) = (given.value.to_f64(), follows.to_f64());
            let size = given_value.abs().max(follows.abs()).max(1.0);
            // the comparison also reports NaN
            if (given_value - follows).abs() <= HOME_TOLERANCE * size {
                continue;
            }
            let name = &key.value;
            let message = format!(
                "home contradicts itself: drive '{name}' is {given_value}, but {follows} where its \
                 joints are"
            );
            self.sink.push(
                Diagnostic::new(given.span, message)
                    .path(format!("home, '{name}'"))
                    .secondary(form.span, "it follows the joints here")
                    .hint("give the joints or the drive; the other one is computed"),
            );
        }
    }
}

/// Adds the limbs and couplings that represent the drives.
pub(super) fn add(drives: Vec<ResolvedDrive>, spec: &mut Spec) {
    for ResolvedDrive { name, joint, form } in drives {
        spec.limbs.push(Limb {
            name: name.clone(),
            from: None,
            base: no_shift(name.span),
            span: joint.span,
            joints: vec![joint],
        });
        spec.couplings.push((name.clone(), form));
        spec.drives.push(name);
    }
}

fn no_shift(span: Span) -> Placement {
    let zero = || -> [Quantity; 3] { std::array::from_fn(|_| zero_quantity(span)) };
    Placement {
        xyz: zero(),
        rpy: zero(),
    }
}
