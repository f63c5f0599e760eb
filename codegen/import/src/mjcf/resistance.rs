//! Reads what resists the motion of joints: damping, friction, armature and springs. What a spec
//! cannot express of them is noted.

use super::Reading;
use super::orientation::Classed;
use crate::tree::{Inertia, Joint, Kind};

impl Reading<'_, '_, '_> {
    /// Reads damping, friction, armature and stiffness of a joint.
    pub(super) fn resistance(&mut self, of: Classed<'_>, joint: &mut Joint) {
        joint.damping = self.coefficient(of, "damping", &joint.name);
        joint.friction = self.coefficient(of, "frictionloss", &joint.name);
        joint.armature = self.coefficient(of, "armature", &joint.name);
        if joint.kind != Kind::Free {
            joint.stiffness = self.coefficient(of, "stiffness", &joint.name);
        }
        let damper = self.attribute(of, "springdamper");
        let damper = damper.and_then(|a| self.fields.array::<2>(&a));
        if damper.is_some_and(|[time, ratio]| time > 0.0 && ratio > 0.0) {
            // MuJoCo replaces stiffness and damping by values that it computes from the mass matrix
            (joint.stiffness, joint.damping) = (0.0, 0.0);
            self.left_out.springdampers.push(joint.name.clone());
        }
    }

    /// A coefficient; a negative one is noted and replaced by 0, and those of higher powers are noted.
    pub(super) fn coefficient(&mut self, of: Classed<'_>, key: &str, owner: &str) -> f64 {
        let Some(attribute) = self.attribute(of, key) else {
            return 0.0;
        };
        let numbers = self.fields.numbers(&attribute).unwrap_or_default();
        let value = numbers.first().copied().unwrap_or(0.0);
        if value < 0.0 {
            let text = format!("{key} {value} of '{owner}' is negative: left out");
            self.fields.log.note(attribute.place, text);
        }
        if numbers.iter().skip(1).any(|n| *n != 0.0) {
            let text =
                format!("{key} of '{owner}' is a polynomial, of which the first number is read");
            self.fields.log.note(attribute.place, text);
        }
        value.max(0.0)
    }

    /// Counts a body with gravity compensation, which is left out.
    pub(super) fn gravity_compensation(&mut self, of: Classed<'_>) {
        let share = self.attribute(of, "gravcomp");
        let share = share.and_then(|a| self.fields.number(&a));
        if share.is_some_and(|share| share != 0.0) {
            self.left_out.compensated += 1;
        }
    }

    /// Converts the armature of ball joints. It resists the angular velocity in all directions; if
    /// the ball joint connects the body to the world, an inertia of the body does the same. Damping
    /// and friction have no counterpart: in a spec, friction and rotors of a ball joint resist the
    /// rates of its three angles, not its angular velocity.
    ///
    /// - `as_inertia`: whether the body's parent is the world, and the file states its inertia.
    pub(super) fn balls(
        &mut self,
        body: &str,
        as_inertia: bool,
        joints: &mut [Joint],
        inertia: &mut Option<Inertia>,
    ) {
        let first = joints.first().map(|joint| joint.name.clone());
        for joint in joints {
            if !matches!(joint.kind, Kind::Spherical | Kind::Free) {
                continue;
            }
            let mut lost = Vec::new();
            for (value, what) in [(joint.damping, "damping"), (joint.friction, "frictionloss")] {
                if value > 0.0 {
                    lost.push(what);
                }
            }
            if joint.armature > 0.0 {
                if as_inertia && first.as_ref() == Some(&joint.name) {
                    let inertia = inertia.get_or_insert(Inertia::NONE);
                    for k in [0, 3, 5] {
                        inertia.tensor[k] += joint.armature;
                    }
                    let text = format!(
                        "the armature of '{}' against rotations is part of the inertia of '{body}'",
                        joint.name
                    );
                    self.fields.log.note(joint.place, text);
                } else {
                    lost.push("armature");
                }
            }
            if !lost.is_empty() {
                let text = format!(
                    "{} of the ball of '{}' against rotations: left out, since a spec has none \
                     that acts on an angular velocity",
                    lost.join(" and "),
                    joint.name
                );
                self.fields.log.note(joint.place, text);
            }
            if joint.kind == Kind::Spherical {
                (joint.damping, joint.friction, joint.armature) = (0.0, 0.0, 0.0);
            }
        }
    }

    /// Notes the forces that a spec cannot express, each kind once.
    pub(super) fn note_forces_left_out(&mut self) {
        let place = self.root.place;
        let count = self.left_out.compensated;
        if count > 0 {
            let text = format!(
                "gravcomp of {count} bodies is left out: a force that carries their weight, which \
                 measured efforts of such a robot do not contain"
            );
            self.fields.log.note(place, text);
        }
        if let Some(first) = self.left_out.springdampers.first() {
            let more = match self.left_out.springdampers.len() - 1 {
                0 => String::new(),
                n => format!(" and {n} more"),
            };
            let text = format!(
                "springdamper of '{first}'{more}: left out, springs and damping that MuJoCo computes \
                 from the mass matrix (mj_saveLastXML writes their values)"
            );
            self.fields.log.note(place, text);
        }
    }
}
