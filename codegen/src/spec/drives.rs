//! Drives: motors whose coordinates are linear in those of joints. A drive is equivalent to a
//! massless joint on the world with a coupling, and is replaced by these two here, so that the model
//! has no drives.

use std::collections::BTreeMap;

use super::raw::{RawDrive, RawJoint, RawSpec};
use super::shape::{Chosen, Flag, Name};
use super::types::{LinearForm, Spec};
use crate::sym::Number;

impl RawSpec {
    /// The drives with their names, in the order of the file.
    pub(super) fn drives(&self) -> impl Iterator<Item = (&Name, &RawDrive)> {
        let all = self.drives.iter().flat_map(|drives| &drives.0);
        all.map(|(name, drive)| (name, drive))
    }

    /// The joints that represent the drives.
    pub(super) fn drive_joints(&self) -> Vec<RawJoint> {
        let all = self.drives();
        all.map(|(name, drive)| drive.joint(name)).collect()
    }
}

impl RawDrive {
    /// The massless joint that represents the drive, with its friction, offset, rotor, limits and
    /// nominal values.
    pub(super) fn joint(&self, name: &Name) -> RawJoint {
        RawJoint {
            name: Some(name.clone()),
            kind: Chosen {
                value: self.kind.value.joint(),
                // nominal values are written into the text after the end of the form
                span: self.of.span,
            },
            dh: None,
            origin: None,
            axis: None,
            pitch: None,
            body: None,
            payload: Flag {
                value: false,
                span: name.0.span,
            },
            actuated: Flag {
                value: true,
                span: name.0.span,
            },
            friction: self.friction,
            offset: self.offset,
            rotor_inertia: self.rotor_inertia,
            spring: self.spring.clone(),
            terms: self.terms.clone(),
            limits: self.limits.clone(),
            nominal: self.nominal.clone(),
            span: self.span,
        }
    }
}

/// The values of coordinates at home that have been computed; `None` for those that home does not
/// determine.
type Known<'a> = BTreeMap<&'a str, Option<Number>>;

impl Spec {
    /// The value of a form of a coupling or a drive at home, rad or m; `None` unless home states all
    /// of its coordinates, or others that determine them by couplings.
    pub(super) fn form_at_stated_home(&self, form: &LinearForm) -> Option<Number> {
        self.form_at_home(form, None, &mut Known::new())
    }

    /// A drive's coordinate at home, rad or m: the stated one, or the value of its linear form, with
    /// 0 for joints that home does not state.
    pub fn home_of_drive(&self, drive: &str) -> Option<Number> {
        self.home_of(drive, Some(&Number::zero()), &mut Known::new())
    }

    fn form_at_home<'a>(
        &'a self,
        form: &'a LinearForm,
        missing: Option<&Number>,
        known: &mut Known<'a>,
    ) -> Option<Number> {
        let mut sum = form.constant.value.clone();
        for (name, factor) in &form.terms {
            let value = self.home_of(&name.value, missing, known)?;
            sum = sum.add(&factor.value.mul(&value));
        }
        Some(sum)
    }

    fn home_of<'a>(
        &'a self,
        name: &'a str,
        missing: Option<&Number>,
        known: &mut Known<'a>,
    ) -> Option<Number> {
        if let Some(value) = known.get(name) {
            return value.clone();
        }
        let stated = self.home.iter().find(|(key, _)| key.value == name);
        let coupled = self.couplings.iter().find(|(key, _)| key.value == name);
        // couplings have no cycles
        let value = match (stated, coupled) {
            (Some((_, value)), _) => Some(value.value.clone()),
            (None, Some((_, form))) => self.form_at_home(form, missing, known),
            (None, None) => missing.cloned(),
        };
        known.insert(name, value.clone());
        value
    }
}
