//! Notes on the robot as a whole.

use crate::layout::Draft;
use crate::log::Log;
use crate::number::number;
use crate::tree::{Joint, Tree};

/// The note on meshes that are not read.
pub(crate) fn unread(meshes: usize) -> String {
    let are = if meshes == 1 { "mesh is" } else { "meshes are" };
    format!("{meshes} {are} not read: the dynamics do not need them")
}

/// Notes a file without any friction: with its spec, the friction in measured efforts falsifies all other
/// parameters.
///
/// - `remedy`: the option that adds friction.
pub(crate) fn without_friction(tree: &Tree, remedy: &str, log: &mut Log) {
    let joints = tree.links.iter().flat_map(|link| &link.joints);
    let of_joints = joints.map(|joint| joint.damping + joint.friction + joint.armature);
    let of_drives = tree.drives.iter();
    let of_drives = of_drives.map(|drive| drive.damping + drive.friction + drive.armature);
    if of_joints.chain(of_drives).all(|sum| sum == 0.0) {
        let text = format!(
            "no joint of this file has friction, but efforts that are measured at motors contain it: to identify \
             from such logs, import with {remedy}"
        );
        log.note(tree.place, text);
    }
}

/// Notes the values that the file has not of friction and rotors that are added to joints with motors.
///
/// - `actuated`: the joints with motors, by their names in the spec.
pub(crate) fn without_values(draft: &Draft, actuated: &[String], tree: &Tree, log: &mut Log) {
    for joint in draft.limbs.iter().flat_map(|limb| &limb.joints) {
        let (Some(name), Some(from)) = (&joint.name, &joint.from) else {
            continue;
        };
        if !actuated.contains(name) {
            continue;
        }
        let mut symbols = Vec::new();
        if from.damping == 0.0 && from.friction == 0.0 {
            symbols.extend(["Fv", "Fc"]);
        }
        if from.armature == 0.0 {
            symbols.push("J");
        }
        if symbols.is_empty() {
            continue;
        }
        let text = format!(
            "the file has no values of {} for {{}}: to simulate the robot or to limit its efforts, add them \
             to the joints of the spec, as in `nominal: {{Fv: 1.5, Fc: 2, J: 0.1}}`",
            symbols.join(", ")
        );
        log.note_of(tree.place, text, name);
    }
}

/// Notes joints that follow another one within limits that contradict the other's.
pub(crate) fn contradicting_limits(tree: &Tree, log: &mut Log) {
    /// The part of the narrower range that both must share at least.
    const MIN_SHARED_PART: f64 = 1e-3;
    let joint = |name: &str| -> Option<&Joint> {
        let mut joints = tree.links.iter().flat_map(|link| &link.joints);
        joints.find(|joint| joint.name == name)
    };
    for coupling in &tree.couplings {
        let [(leader, factor)] = coupling.terms.as_slice() else {
            continue;
        };
        let limits = |name: &str| joint(name).and_then(|joint| joint.position);
        let (Some(own), Some(led)) = (limits(&coupling.joint), limits(leader)) else {
            continue;
        };
        let ends = led.map(|x| coupling.constant + factor * x);
        let given = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let shared = own[1].min(given[1]) - own[0].max(given[0]);
        let narrow = (own[1] - own[0]).min(given[1] - given[0]);
        if narrow > 0.0 && shared < MIN_SHARED_PART * narrow {
            let range = |[low, high]: [f64; 2]| format!("[{}, {}]", number(low), number(high));
            let text = format!(
                "'{}' follows '{leader}', whose limits lead it to {}, and is limited to {}: the two \
                 contradict each other",
                coupling.joint,
                range(given),
                range(own)
            );
            log.note(coupling.place, text);
        }
    }
}
