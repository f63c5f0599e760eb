//! Joints that are taken as rigid, at given positions.

use crate::cut;
use crate::frames::{joint_frame, motion};
use crate::log::{Log, Place};
use crate::number::number;
use crate::pose::{Pose, times, transposed};
use crate::tree::{Joint, Kind, Tree};
use regen_codegen::diag::{Source, Span};

/// Locks a joint, and those that follow it alone. `text` is `NAME` (at 0) or `NAME=VALUE`, in rad or
/// m, counted as in the file. In names, `*` stands for any part and `?` for any character.
pub(crate) fn lock(option: &str, text: &str, tree: &mut Tree, log: &mut Log) {
    let (name, value) = text.split_once('=').unwrap_or((text, "0"));
    let name = name.trim();
    let locked = cut::value(value)
        .ok_or_else(|| format!("'{}' is not a number", value.trim()))
        .and_then(|value| lock_all(name, value, tree, log));
    if let Err(message) = locked {
        let file = log.add(Source::new(option, text));
        let hint = "write NAME or NAME=VALUE of hinges and slides, separated by commas, with * for \
                    any part of a name. Joints with several coordinates are locked as a whole at 0, \
                    or by coordinate, as NAME_x; `--base fixed` leaves out a floating base";
        log.error(Place::new(file, Span::new(0, text.len())), message, hint);
    }
}

/// Locks all joints with a name or a pattern.
fn lock_all(name: &str, value: f64, tree: &mut Tree, log: &mut Log) -> Result<(), String> {
    if !name.contains(['*', '?']) {
        split(name, tree);
        return lock_at(name, value, tree, log);
    }
    let joints = tree.links.iter().flat_map(|link| &link.joints);
    let names = joints.map(|joint| joint.name.clone());
    let mut found: Vec<String> = names.filter(|own| matches(name, own)).collect();
    if found.is_empty() {
        return Err(format!("no joint has a name like '{name}'"));
    }
    // those that follow others are locked with them
    found.sort_by_key(|own| tree.couplings.iter().any(|c| c.joint == *own));
    for own in found {
        let mut joints = tree.links.iter().flat_map(|link| &link.joints);
        if joints.any(|joint| joint.name == own) {
            lock_at(&own, value, tree, log)?;
        }
    }
    Ok(())
}

/// Whether a name fits a pattern, in which `*` stands for any part and `?` for any character.
fn matches(pattern: &str, name: &str) -> bool {
    let mut rest = pattern.chars();
    match rest.next() {
        None => name.is_empty(),
        Some('*') => {
            let rest = rest.as_str();
            let mut tails = name.char_indices().map(|(at, _)| &name[at..]);
            tails.any(|tail| matches(rest, tail)) || matches(rest, "")
        }
        Some(first) => {
            let mut of_name = name.chars();
            let next = of_name.next();
            next.is_some_and(|next| first == '?' || first == next)
                && matches(rest.as_str(), of_name.as_str())
        }
    }
}

/// Divides the joint with several coordinates of which `name` is one into its coordinates.
fn split(name: &str, tree: &mut Tree) {
    for link in &mut tree.links {
        let has = |joint: &Joint| {
            joint.name != name && joint.parts().iter().any(|part| part.name == name)
        };
        if let Some(at) = link.joints.iter().position(has) {
            let parts = link.joints[at].parts();
            link.joints.splice(at..=at, parts);
            return;
        }
    }
}

fn lock_at(name: &str, value: f64, tree: &mut Tree, log: &mut Log) -> Result<(), String> {
    if let Some(coupling) = tree.couplings.iter().find(|c| c.joint == name)
        && let Some((leader, _)) = coupling.terms.first()
    {
        return Err(format!("'{name}' follows '{leader}': lock that one"));
    }
    let joint = weld(name, value, tree)?;
    if let Some([least, most]) = joint.position
        && !(least..=most).contains(&value)
    {
        let text = format!(
            "'{name}' is locked at {}, outside its limits [{}, {}]",
            number(value),
            number(least),
            number(most)
        );
        log.note(joint.place, text);
    }
    tree.couplings.retain(|c| c.joint != name);
    tree.actuated.retain(|joint| joint != name);
    for drive in &mut tree.drives {
        drive.terms.retain(|(joint, _)| joint != name);
    }
    tree.drives.retain(|drive| !drive.terms.is_empty());
    let mut still = Vec::new();
    for coupling in &mut tree.couplings {
        let Some(at) = coupling.terms.iter().position(|(joint, _)| joint == name) else {
            continue;
        };
        let (_, factor) = coupling.terms.remove(at);
        coupling.constant += factor * value;
        if coupling.terms.is_empty() {
            still.push((coupling.joint.clone(), coupling.constant));
        }
    }
    for (follower, value) in still {
        lock_at(&follower, value, tree, log)?;
    }
    Ok(())
}

/// Takes the joint out of its link, which stays where the value has it; returns the joint.
fn weld(name: &str, value: f64, tree: &mut Tree) -> Result<Joint, String> {
    let mut links = tree.links.iter_mut();
    let found = links.find_map(|link| {
        let at = link.joints.iter().position(|joint| joint.name == name)?;
        Some((link, at))
    });
    let Some((link, at)) = found else {
        return Err(format!("no joint is called '{name}'"));
    };
    let has_one = matches!(link.joints[at].kind, Kind::Revolute | Kind::Prismatic);
    if !has_one && value != 0.0 {
        return Err(format!(
            "'{name}' has several coordinates, and is locked as a whole at 0 only"
        ));
    }
    let joint = link.joints.remove(at);
    if !has_one {
        return Ok(joint);
    }
    let (frame, axis) = joint_frame(&joint);
    let moved = motion(joint.kind, axis, value - joint.reference);
    let moved: Pose = frame.then(&moved).then(&frame.inverse());
    // the joints before it are given in the link's frame, which moves
    let back = moved.inverse();
    for before in link.joints.iter_mut().take(at) {
        before.axis = times(&transposed(&moved.r), before.axis);
        before.anchor = back.point(before.anchor);
    }
    link.pose = link.pose.then(&moved);
    Ok(joint)
}
