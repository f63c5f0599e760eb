//! Checks limbs and joints.

use super::super::raw::{RawJoint, RawLimb};
use super::super::shape::{Choice, Word};
use super::super::suggest::{did_you_mean, one_of};
use super::super::types::JointKind;
use super::cycles::cycles;
use super::{Checker, duplicates, joint_path, limb_path, term_names, unknown_body};
use crate::diag::{Diagnostic, Span};

impl Checker<'_> {
    pub(super) fn limbs(&mut self) {
        let raw = self.raw;
        duplicates(
            "limb name",
            raw.limbs.iter().map(|limb| &limb.name.0),
            self.sink,
        );
        let joints = || raw.limbs.iter().flat_map(|limb| &limb.joints);
        let names = joints().filter_map(|joint| joint.name.as_ref().map(|name| &name.0));
        duplicates("joint name", names, self.sink);
        let bodies = joints().filter_map(|joint| joint.body.as_ref().map(|body| &body.0));
        duplicates("body label", bodies, self.sink);
        for limb in &raw.limbs {
            if limb.joints.is_empty() {
                self.sink.push(
                    Diagnostic::new(limb.name.0.span, "a limb without joints")
                        .path(limb_path(limb))
                        .hint("remove it, or list its joints under `joints:`"),
                );
            }
            for (index, joint) in limb.joints.iter().enumerate() {
                self.joint(joint, &joint_path(limb, index));
            }
        }
        self.check_origins();
        self.check_not_empty();
    }

    /// Checks that the robot has bodies and coordinates.
    fn check_not_empty(&mut self) {
        let name = &self.raw.name.0;
        if self.inventory.coordinates.is_empty() {
            let message = "the robot has no coordinate: no joint of it moves";
            self.sink.push(Diagnostic::new(name.span, message));
        }
        if self.inventory.bodies.is_empty() {
            self.sink.push(
                Diagnostic::new(name.span, "the robot has no body: no joint carries one")
                    .hint("label the moving bodies with `body:` at the joints that carry them"),
            );
        }
    }

    /// Checks that limbs start from existing bodies, and that every chain of limbs ends at the
    /// world.
    fn check_origins(&mut self) {
        let limbs = &self.raw.limbs;
        // for each limb, the limb that it starts from
        let mut parents: Vec<Option<usize>> = Vec::new();
        for (index, limb) in limbs.iter().enumerate() {
            let from = &limb.from.0;
            let carrier = limbs.iter().position(|other| carries(other, &from.text));
            parents.push(carrier.filter(|carrier| *carrier != index));
            if from.text == "world" {
                continue;
            }
            match carrier {
                None => self
                    .sink
                    .push(unknown_body(from, &self.inventory.bodies, self.raw)),
                Some(carrier) if carrier == index => self.sink.push(
                    from.error(format!(
                        "limb '{}' starts from its own body '{}'",
                        limb.name.0.text, from.text
                    ))
                    .hint("it must start from the world or from a body of another limb"),
                ),
                Some(_) => {}
            }
        }
        let edges: Vec<Vec<usize>> = parents
            .iter()
            .map(|parent| parent.iter().copied().collect())
            .collect();
        for cycle in cycles(&edges) {
            let mut members = cycle.iter().filter_map(|limb| limbs.get(*limb));
            if let Some(first) = members.clone().next() {
                let names: Vec<&str> = members
                    .by_ref()
                    .map(|limb| limb.name.0.text.as_str())
                    .collect();
                let start = &first.name.0.text;
                let message = format!(
                    "limbs start from each other in a circle: {} <- {start}",
                    names.join(" <- ")
                );
                self.sink.push(
                    first
                        .from
                        .0
                        .error(message)
                        .hint("one of them must start from the world; loops are closed by `cuts`"),
                );
            }
        }
    }

    fn joint(&mut self, joint: &RawJoint, path: &str) {
        let kind = joint.kind.value;
        let word = kind.word();
        let mut refuse = |span: Span, message: String, hint: &str| {
            self.sink.push(
                Diagnostic::new(span, message)
                    .path(path)
                    .secondary(joint.kind.span, format!("the joint is {word}"))
                    .hint(hint),
            );
        };
        if let Some(axis) = joint.axis
            && !kind.takes_axis()
        {
            let message = format!("a {word} joint takes no axis");
            refuse(
                axis.span,
                message,
                "only revolute, prismatic and helical joints do; turn the frame with `dh` or `origin`",
            );
        }
        if kind == JointKind::Fixed {
            let hint = "it has no coordinate";
            if joint.actuated.value {
                refuse(
                    joint.actuated.span,
                    "a fixed joint cannot be actuated".into(),
                    hint,
                );
            }
            if !joint.friction.value.nominal().is_empty() {
                refuse(
                    joint.friction.span,
                    "a fixed joint has no friction".into(),
                    hint,
                );
            }
            if joint.offset.value {
                refuse(
                    joint.offset.span,
                    "a fixed joint has no effort, so no offset".into(),
                    hint,
                );
            }
            if joint.rotor_inertia.value {
                refuse(
                    joint.rotor_inertia.span,
                    "a fixed joint has no rotor".into(),
                    hint,
                );
            }
            if let Some(spring) = &joint.spring {
                refuse(spring.span, "a fixed joint has no spring".into(), hint);
            }
            if let Some(name) = term_names(joint).next() {
                let message = "a fixed joint has no effort, so no effort terms";
                refuse(name.span, message.into(), hint);
            }
            if let Some(limits) = &joint.limits {
                refuse(limits.span, "a fixed joint has no limits".into(), hint);
            }
        } else if let Some(cone) = joint
            .limits
            .as_ref()
            .and_then(|limits| limits.cone.as_ref())
            && !kind.takes_cone()
        {
            let message = format!("a {word} joint takes no cone");
            refuse(
                cone.ast.span,
                message,
                "only spherical and universal joints do; use `position`",
            );
        }
        self.effort_terms(joint);
        self.nominal(joint, "joint");
    }

    /// Checks that `nominal` names parameters that the joint or the drive has; `noun` is the word
    /// for it.
    pub(super) fn nominal(&mut self, joint: &RawJoint, noun: &str) {
        let Some(nominal) = &joint.nominal else {
            return;
        };
        let mut allowed = joint.friction.value.nominal().to_vec();
        if joint.offset.value {
            allowed.push("Fo");
        }
        if joint.rotor_inertia.value {
            allowed.push("J");
        }
        if joint.spring.is_some() {
            allowed.push("K");
        }
        allowed.extend(term_names(joint).map(|name| name.text.as_str()));
        for (symbol, _) in &nominal.0 {
            let symbol = &symbol.0;
            if !allowed.contains(&symbol.text.as_str()) {
                self.sink.push(misplaced(symbol, joint, &allowed, noun));
            }
            let general = symbol.text.strip_suffix(['+', '-']);
            let both = nominal
                .0
                .iter()
                .find(|(other, _)| Some(other.0.text.as_str()) == general);
            if let Some((both, _)) = both {
                let message = format!("'{}' already sets both signs", both.0.text);
                self.sink.push(
                    symbol
                        .error(message)
                        .secondary(both.0.span, "given here")
                        .hint("give either that or the two signs"),
                );
            }
        }
    }
}

fn misplaced(symbol: &Word, joint: &RawJoint, allowed: &[&str], noun: &str) -> Diagnostic {
    let friction = joint.friction.value.word();
    if symbol.text == "J" {
        return symbol.error("'J' without a rotor").hint(format!(
            "write `rotor_inertia: true` at this {noun}, or remove the value"
        ));
    }
    if symbol.text == "K" {
        return symbol
            .error("'K' without a spring")
            .hint("write `spring: {rest: 0}` at this joint, or remove the value");
    }
    if symbol.text == "Fo" {
        return symbol.error("'Fo' without an offset").hint(format!(
            "write `offset: true` at this {noun}, or remove the value"
        ));
    }
    let near = did_you_mean(&symbol.text, allowed.iter().copied());
    let fault = symbol.error(format!(
        "'{}' is not a parameter of friction '{friction}'{near}",
        symbol.text
    ));
    if allowed.is_empty() {
        fault.hint(format!(
            "the {noun} has neither friction, offset, rotor, spring nor terms: choose a kind with \
             `friction:`"
        ))
    } else {
        fault.hint(format!(
            "this {noun} has {}",
            one_of(allowed.iter().copied()).replace(" or ", " and ")
        ))
    }
}

fn carries(limb: &RawLimb, label: &str) -> bool {
    let mut bodies = limb.joints.iter().filter_map(|joint| joint.body.as_ref());
    bodies.any(|body| body.0.text == label)
}
