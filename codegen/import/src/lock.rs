//! Joints that are taken as rigid, at given positions.

use crate::cut;
use crate::frames::{joint_frame, motion};
use crate::log::{Log, Place};
use crate::pose::{Pose, times, transposed};
use crate::tree::{Kind, Tree};
use regen_codegen::diag::{Source, Span};

/// Locks a joint, and those that follow it alone. `text` is `NAME` (at 0) or `NAME=VALUE`, in rad or
/// m, counted as in the file.
pub(crate) fn lock(option: &str, text: &str, tree: &mut Tree, log: &mut Log) {
    let (name, value) = text.split_once('=').unwrap_or((text, "0"));
    let name = name.trim();
    let locked = cut::value(value)
        .ok_or_else(|| format!("'{}' is not a number", value.trim()))
        .and_then(|value| lock_at(name, value, tree));
    if let Err(message) = locked {
        let file = log.add(Source::new(option, text));
        let hint = "write NAME or NAME=VALUE of hinges and slides, separated by commas";
        log.error(Place::new(file, Span::new(0, text.len())), message, hint);
    }
}

fn lock_at(name: &str, value: f64, tree: &mut Tree) -> Result<(), String> {
    if let Some(coupling) = tree.couplings.iter().find(|c| c.joint == name)
        && let Some((leader, _)) = coupling.terms.first()
    {
        return Err(format!("'{name}' follows '{leader}': lock that one"));
    }
    weld(name, value, tree)?;
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
        lock_at(&follower, value, tree)?;
    }
    Ok(())
}

/// Takes the joint out of its link, which stays where the value has it.
fn weld(name: &str, value: f64, tree: &mut Tree) -> Result<(), String> {
    let mut links = tree.links.iter_mut();
    let found = links.find_map(|link| {
        let at = link.joints.iter().position(|joint| joint.name == name)?;
        Some((link, at))
    });
    let Some((link, at)) = found else {
        return Err(format!("no joint is called '{name}'"));
    };
    if !matches!(link.joints[at].kind, Kind::Revolute | Kind::Prismatic) {
        return Err(format!("'{name}' has several coordinates"));
    }
    let joint = link.joints.remove(at);
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
    Ok(())
}
