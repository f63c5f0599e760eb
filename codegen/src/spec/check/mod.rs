//! Checks names, labels and references, before any value is evaluated.

mod constants;
mod cycles;
mod drives;
mod joints;
mod limits;
mod payloads;
mod references;
mod springs;

pub(super) use references::canonical;

use std::collections::{BTreeMap, BTreeSet};

use super::labels::ParameterName;
use super::labels::{Inventory, JointFacts, SpringFacts};
use super::raw::{RawJoint, RawLimb, RawSpec};
use super::shape::Word;
use super::suggest::{did_you_mean, one_of};
use super::types::JointKind;
use crate::diag::{Diagnostic, Sink, Span};

/// Checks that everything that is named exists, exactly once, and may be used there.
pub(super) fn check(raw: &RawSpec, sink: &mut Sink) {
    let inventory = inventory(raw);
    let set = |labels: &[String]| labels.iter().cloned().collect();
    let geometry = raw.geometry.iter().flat_map(|geometry| &geometry.0);
    let mut checker = Checker {
        raw,
        geometry: geometry
            .enumerate()
            .map(|(index, (name, _))| (name.0.text.as_str(), index))
            .collect(),
        drives: raw
            .drives()
            .map(|(name, _)| (name.0.text.as_str(), name.0.span))
            .collect(),
        coordinates: set(&inventory.coordinates),
        bodies: set(&inventory.bodies),
        parameters: inventory
            .parameters
            .iter()
            .map(ParameterName::label)
            .collect(),
        inventory,
        sink,
    };
    if !checker.limits() {
        return;
    }
    checker.constants();
    checker.limbs();
    checker.payloads();
    checker.cuts();
    checker.springs();
    checker.frames();
    checker.drives();
    checker.independent();
    checker.couplings();
    checker.home();
    checker.bodies();
    checker.base();
}

struct Checker<'a> {
    raw: &'a RawSpec,
    /// For each geometry name, its index in the list.
    geometry: BTreeMap<&'a str, usize>,
    /// The drives with the places of their names.
    drives: BTreeMap<&'a str, Span>,
    coordinates: BTreeSet<String>,
    bodies: BTreeSet<String>,
    parameters: BTreeSet<String>,
    /// The same names in order.
    inventory: Inventory,
    sink: &'a mut Sink,
}

/// The names of a joint's effort terms, in order.
fn term_names(joint: &RawJoint) -> impl Iterator<Item = &Word> {
    let terms = joint.terms.iter().flat_map(|terms| &terms.0);
    terms.map(|(name, _)| &name.0)
}

fn joint_name(joint: &RawJoint) -> &str {
    joint.name.as_ref().map_or("", |name| name.0.text.as_str())
}

fn inventory(raw: &RawSpec) -> Inventory {
    let drives = raw.drive_joints();
    let joints = raw.limbs.iter().flat_map(|limb| &limb.joints);
    let springs = raw.springs.iter().flatten().map(|spring| SpringFacts {
        name: &spring.name.0.text,
        symbols: spring.symbols(),
    });
    let joints = joints.chain(&drives).map(|joint| JointFacts {
        name: joint_name(joint),
        kind: joint.kind.value,
        body: joint.body.as_ref().map(|body| body.0.text.as_str()),
        friction: joint.friction.value,
        offset: joint.offset.value,
        rotor: joint.rotor_inertia.value,
        spring: joint.spring.is_some(),
        terms: term_names(joint).map(|name| name.text.as_str()).collect(),
    });
    Inventory::of(joints, springs)
}

fn limb_path(limb: &RawLimb) -> String {
    format!("limb '{}'", limb.name.0.text)
}

fn joint_path(limb: &RawLimb, index: usize) -> String {
    let name = limb.joints.get(index).map_or("", joint_name);
    if name.is_empty() {
        format!("{}, joint number {}", limb_path(limb), index + 1)
    } else {
        format!("{}, joint '{name}'", limb_path(limb))
    }
}

/// Reports every word that equals an earlier one.
fn duplicates<'a>(what: &str, words: impl IntoIterator<Item = &'a Word>, sink: &mut Sink) {
    let mut seen = BTreeMap::<&str, Span>::new();
    for word in words {
        if let Some(first) = seen.get(word.text.as_str()) {
            let message = format!("duplicate {what} '{}'", word.text);
            sink.push(word.error(message).secondary(*first, "first defined here"));
        } else {
            seen.insert(&word.text, word.span);
        }
    }
}

/// An error about an unknown name, with the nearest known one or the list of all.
fn unknown(what: &str, word: &Word, known: &[String]) -> Diagnostic {
    let near = did_you_mean(&word.text, known.iter().map(String::as_str));
    let diagnostic = word.error(format!("unknown {what} '{}'{near}", word.text));
    if near.is_empty() {
        diagnostic.hint(listing(what, known))
    } else {
        diagnostic
    }
}

/// An error about an unknown body, where the world is allowed too; it names the joints that carry none,
/// since a forgotten `body:` makes the same mistake.
fn unknown_body(word: &Word, known: &[String], raw: &RawSpec) -> Diagnostic {
    let mut known = known.to_vec();
    known.push("world".to_owned());
    without_body(unknown("body", word, &known), word, raw)
}

/// Marks joints that could carry a body and carry none, where they are few.
fn without_body(mut diagnostic: Diagnostic, word: &Word, raw: &RawSpec) -> Diagnostic {
    // more joints without a body are meant to have none
    const FEW: usize = 2;
    let joints = raw.limbs.iter().flat_map(|limb| &limb.joints);
    let bare = joints.filter(|joint| joint.body.is_none() && joint.kind.value != JointKind::Fixed);
    let bare: Vec<Span> = bare
        .filter_map(|joint| joint.name.as_ref().map(|name| name.0.span))
        .collect();
    if bare.len() <= FEW {
        for span in bare {
            let label = format!("this joint has no `body`: is it `body: {}`?", word.text);
            diagnostic = diagnostic.secondary(span, label);
        }
    }
    diagnostic
}

/// The known names as a list, shortened if there are too many.
fn listing(what: &str, known: &[String]) -> String {
    // largest number of names in a message
    const MAX_LISTED: usize = 12;
    match known.len() {
        0 => format!("there is no {what}"),
        1 => format!("known is '{}'", known.concat()),
        2..=MAX_LISTED => {
            let all = one_of(known.iter().map(String::as_str));
            format!("known are {}", all.replace(" or ", " and "))
        }
        count => {
            let first: Vec<String> = known
                .iter()
                .take(MAX_LISTED)
                .map(|name| format!("'{name}'"))
                .collect();
            format!(
                "known are {}, and {} more",
                first.join(", "),
                count - MAX_LISTED
            )
        }
    }
}
