//! Drives that cannot be the independent coordinates: they leave joints undetermined, or several of
//! them move the same joints.

use crate::constraints::Mismatch;
use crate::diag::{Diagnostic, Span};
use crate::model::Model;
use crate::spec::Spec;

/// The errors about drives, if drives and actuated joints are not valid independent coordinates;
/// none if the mismatch involves no drive.
pub(super) fn mismatch(spec: &Spec, model: &Model, mismatch: &Mismatch) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    if mismatch.tied.iter().any(|c| model.drives.contains(c)) {
        found.extend(contradiction(spec, model, &mismatch.tied));
    }
    if !model.drives.is_empty() && !mismatch.free.is_empty() {
        found.push(undetermined(spec, model, &mismatch.free));
    }
    found
}

/// The error about drives, and perhaps actuated joints, that cannot move independently of each
/// other.
fn contradiction(spec: &Spec, model: &Model, tied: &[usize]) -> Option<Diagnostic> {
    let mut drives = tied.iter().filter(|c| model.drives.contains(c));
    let first = *drives.next()?;
    let others: Vec<usize> = tied.iter().copied().filter(|c| *c != first).collect();
    let joints = others.iter().any(|c| !model.drives.contains(c));
    let what = if joints {
        "drives and actuated joints"
    } else {
        "drives"
    };
    let message = format!(
        "the {what} {} cannot move independently: their joints have fewer freedoms",
        names(model, tied)
    );
    let mut fault = Diagnostic::new(place(spec, model, first), message)
        .path(format!("drives '{}'", model.coordinates[first].name))
        .hint(
            "remove one of them; if the joints are driven redundantly, list as many as there are \
             freedoms under `independent:`",
        );
    for other in others {
        fault = fault.secondary(place(spec, model, other), "this one moves them too");
    }
    Some(fault)
}

/// The error about joints that can move while all drives are at rest.
fn undetermined(spec: &Spec, model: &Model, free: &[usize]) -> Diagnostic {
    let moved_by = |drive: &&usize| {
        let form = model.form_of_drive(**drive);
        form.is_some_and(|form| form.terms.iter().any(|(c, _)| free.contains(c)))
    };
    let near: Vec<usize> = model.drives.iter().filter(moved_by).copied().collect();
    let drives = if near.is_empty() {
        &model.drives
    } else {
        &near
    };
    let (noun, verb) = if drives.len() == 1 {
        ("drive", "does")
    } else {
        ("drives", "do")
    };
    let joints = if free.len() == 1 { "joint" } else { "joints" };
    let message = format!(
        "the {noun} {} {verb} not determine the {joints} {}",
        names(model, drives),
        names(model, free)
    );
    let first = drives.first().or(free.first()).copied().unwrap_or(0);
    let mut fault = Diagnostic::new(place(spec, model, first), message)
        .path(format!("drives '{}'", model.coordinates[first].name))
        .hint("add a drive or a coupling that moves them, or mark a joint `actuated: true`");
    for joint in free {
        fault = fault.secondary(place(spec, model, *joint), "free to move");
    }
    fault
}

/// The names of coordinates in quotes: `'m5', 'm6' and 'q1'`.
fn names(model: &Model, coordinates: &[usize]) -> String {
    let quoted: Vec<String> = coordinates
        .iter()
        .map(|c| format!("'{}'", model.coordinates[*c].name))
        .collect();
    match quoted.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => quoted.concat(),
    }
}

/// The place of the name of a coordinate's joint or drive.
fn place(spec: &Spec, model: &Model, coordinate: usize) -> Span {
    let joints = crate::model::joints_of_coordinates(spec);
    let joint = joints
        .get(coordinate)
        .filter(|_| coordinate < model.coordinates.len());
    let name = joint.and_then(|joint| joint.name.as_ref());
    name.map_or(spec.name.span, |name| name.span)
}
