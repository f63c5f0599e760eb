//! Reasons why parameters cannot be identified, or only in combination with others.

use crate::base::{Base, NullDirection, Provenance};
use crate::model::{Model, ParameterKind};

use super::motion::{Motions, ObservedMotion};
use super::{Freedom, Grouped, Unidentifiable, predicate};

/// Index of the mass among a body's ten parameters.
const MASS_ENTRY: usize = 9;

/// The bodies with their observed motions.
pub(super) struct Bodies<'a> {
    pub(super) model: &'a Model,
    pub(super) motions: &'a Motions<'a>,
    /// Observed motion of each body.
    pub(super) observed: &'a [ObservedMotion],
    /// Gravity in the world frame, m/s^2.
    pub(super) gravity: [f64; 3],
}

impl Bodies<'_> {
    fn label(&self, body: usize) -> &str {
        self.model
            .bodies
            .get(body)
            .map_or("?", |b| b.label.as_str())
    }

    /// The index of the frame axis (x, y, z) about which the body rotates; `None` if its axis of
    /// rotation is not one of them.
    fn own_axis(&self, body: usize) -> Option<usize> {
        let parts = self.observed.get(body)?.in_link?;
        (0..3).find(|&k| parts[k].abs() > 1.0 - 1e-12)
    }

    /// Whether gravity is parallel to the body's axis of rotation.
    fn gravity_is_along(&self, body: usize) -> bool {
        let Some(n) = self.observed.get(body).and_then(|s| s.direction) else {
            return false;
        };
        let g = self.gravity;
        let dot: f64 = (0..3).map(|k| n[k] * g[k]).sum();
        let across: f64 = (0..3).map(|k| libm::pow(g[k] - dot * n[k], 2.0)).sum();
        let size: f64 = g.iter().map(|x| x * x).sum();
        size > 0.0 && across < 1e-20 * size
    }

    /// The reason why an inertial parameter of a body has no effect on the forces.
    fn reason(&self, body: usize, entry: usize) -> Option<String> {
        let observed = self.observed.get(body)?;
        let name = self.label(body);
        if observed.freedom == Freedom::Fixed {
            return Some(format!("body {name} never moves"));
        }
        if entry == MASS_ENTRY {
            return observed
                .origin_rests
                .then(|| format!("the origin of body {name}, where its mass counts, never moves"));
        }
        if observed.freedom.has_constant_orientation() {
            return Some(format!("body {name} never rotates"));
        }
        let axis = self.own_axis(body)?;
        let letter = ["x", "y", "z"][axis];
        if entry < 6 {
            return Some(format!("body {name} turns about its {letter} axis alone"));
        }
        if entry - 6 == axis {
            return Some(format!(
                "a shift of the centre of mass of body {name} along {letter}, the axis that it turns about, \
                 changes neither its energy nor its weight's work"
            ));
        }
        if !observed.origin_rests {
            return None;
        }
        if self.gravity.iter().all(|g| *g == 0.0) {
            return Some(format!(
                "the axis of body {name} is at rest, and there is no gravity"
            ));
        }
        self.gravity_is_along(body)
            .then(|| format!("gravity is parallel to the axis of body {name}, which is at rest"))
    }

    /// Parameters without any effect on the forces, grouped by reason.
    pub(super) fn without_effect(&self, base: &Base) -> Vec<Unidentifiable> {
        let mut all: Vec<Unidentifiable> = Vec::new();
        for row in base.null.iter().filter(|row| row.terms.len() == 1) {
            let parameter = &self.model.parameters[row.column];
            let (reason, body) = match parameter.kind {
                ParameterKind::Inertial { body, entry } => (self.reason(body, entry), Some(body)),
                ParameterKind::Rotor { coordinate }
                | ParameterKind::Offset { coordinate }
                | ParameterKind::JointSpring { coordinate, .. }
                | ParameterKind::EffortTerm { coordinate, .. }
                | ParameterKind::Friction { coordinate, .. } => {
                    let name = &self.model.coordinates[coordinate].name;
                    (Some(format!("{name} never moves")), None)
                }
                ParameterKind::PointSpring { spring, .. } => {
                    let name = &self.model.point_springs[spring].name;
                    let reason = format!("the length of spring {name} never changes");
                    (Some(reason), None)
                }
            };
            let provenance = row.provenance;
            let same = |u: &&mut Unidentifiable| {
                u.reason == reason
                    && u.provenance == provenance
                    && (reason.is_some() || u.body == body)
            };
            let label = parameter.label.clone();
            match all.iter_mut().find(same) {
                Some(found) => found.parameters.push(label),
                None => all.push(Unidentifiable {
                    parameters: vec![label],
                    reason,
                    provenance,
                    body,
                }),
            }
        }
        all
    }

    /// Parameters that can be identified only in combination with others.
    pub(super) fn grouped(&self, base: &Base) -> Vec<Grouped> {
        let label = |c: usize| self.model.parameters[c].label.clone();
        let rows = base.null.iter().filter(|row| row.terms.len() > 1);
        rows.map(|row| {
            let others = row.terms.iter().map(|t| t.column);
            Grouped {
                parameter: label(row.column),
                with: others.filter(|c| *c != row.column).map(label).collect(),
                reason: self.reason_of_combination(row),
                provenance: row.provenance,
            }
        })
        .collect()
    }

    /// Why springs and effort terms act in combination only.
    fn reason_of_springs(&self, row: &NullDirection) -> String {
        let columns = row.terms.iter().map(|term| term.column);
        let labels = columns.map(|column| self.model.parameters[column].label.as_str());
        format!(
            "at every state, the forces of {} are linearly dependent",
            labels.collect::<Vec<_>>().join(", ")
        )
    }

    fn reason_of_combination(&self, row: &NullDirection) -> Option<String> {
        let (mut bodies, mut rotors) = (Vec::new(), Vec::new());
        let (mut friction, mut offsets) = (Vec::new(), Vec::new());
        for term in &row.terms {
            let (to, at) = match self.model.parameters[term.column].kind {
                ParameterKind::Inertial { body, .. } => (&mut bodies, body),
                ParameterKind::Rotor { coordinate } => (&mut rotors, coordinate),
                ParameterKind::Offset { coordinate } => (&mut offsets, coordinate),
                ParameterKind::Friction { coordinate, .. } => (&mut friction, coordinate),
                ParameterKind::JointSpring { .. }
                | ParameterKind::EffortTerm { .. }
                | ParameterKind::PointSpring { .. } => {
                    return Some(self.reason_of_springs(row));
                }
            };
            if !to.contains(&at) {
                to.push(at);
            }
        }
        bodies.sort_unstable();
        let coordinates = |of: &[usize]| -> String {
            let names = of.iter().map(|c| self.model.coordinates[*c].name.as_str());
            names.collect::<Vec<_>>().join(" and ")
        };
        if !offsets.is_empty() {
            let mut at = offsets.clone();
            at.extend(friction.iter().filter(|c| !offsets.contains(c)));
            return Some(if !bodies.is_empty() {
                format!(
                    "a weight is a constant force at {}, as an offset of the effort is",
                    coordinates(&at)
                )
            } else if at.len() == 1 {
                format!(
                    "in motion, Fc+ less Fc- of {} is a constant effort, as its offset is",
                    coordinates(&at)
                )
            } else {
                format!("the rates of {} are linearly dependent", coordinates(&at))
            });
        }
        if !friction.is_empty() {
            return Some(if bodies.is_empty() {
                format!("{} move in a fixed proportion", coordinates(&friction))
            } else {
                format!(
                    "a weight is a constant force at {}, as one-sided friction is",
                    coordinates(&friction)
                )
            });
        }
        if let [body] = bodies[..]
            && rotors.is_empty()
        {
            return Some(self.reason_within_body(body));
        }
        if row.provenance != Provenance::Derived {
            return self.reason_beyond_tree(&bodies, &rotors);
        }
        // in a combination of several bodies, a rotor only replaces the moment of inertia that it
        // absorbed
        if !rotors.is_empty() && bodies.is_empty() {
            return Some(format!(
                "{} move in a fixed proportion",
                coordinates(&rotors)
            ));
        }
        if !rotors.is_empty() && bodies.len() < 2 {
            let is_geared = rotors.iter().any(|c| self.model.drives.contains(c));
            return Some(format!(
                "the rotor of {} turns {} what it moves",
                coordinates(&rotors),
                if is_geared {
                    "in proportion to"
                } else {
                    "as fast as"
                }
            ));
        }
        let parts: Vec<&str> = bodies.iter().map(|b| self.label(*b)).collect();
        if let Some(joint) = self.joint_between(&bodies) {
            let (outer, inner) = (parts.last()?, parts.first()?);
            if joint.is_empty() {
                return Some(format!("body {outer} is fixed to body {inner}"));
            }
            let (word, leaves) = if joint.contains(' ') {
                ("joints", "leave")
            } else {
                ("joint", "leaves")
            };
            return Some(format!(
                "inertia of body {outer} that {word} {joint} {leaves} unchanged acts as inertia of body {inner}"
            ));
        }
        Some(match self.in_one_limb(&bodies) {
            Some(outer) => format!(
                "inertia of body {} that its inner joints leave unchanged acts as inertia of the bodies \
                 inward of it",
                self.label(outer)
            ),
            None => format!(
                "mass on a joint's axis may be assigned to either body there, around the loop of bodies {}",
                parts.join(" ")
            ),
        })
    }

    fn reason_within_body(&self, body: usize) -> String {
        let name = self.label(body);
        match self.observed.get(body).map(|s| s.freedom) {
            Some(freedom) if freedom != Freedom::General => {
                format!("body {name} {}", predicate(freedom))
            }
            _ => format!("the motion of body {name} determines them only in combination"),
        }
    }

    /// The names of the coordinates between a body and another that carries it; `None` if no chain
    /// without a third body joins them.
    fn joint_between(&self, bodies: &[usize]) -> Option<String> {
        let &[a, b] = bodies else { return None };
        let (inner, outer) = (self.model.bodies.get(a)?, self.model.bodies.get(b)?);
        let mut at = Some(outer.link);
        let mut names: Vec<&str> = Vec::new();
        while let Some(link) = at {
            if link == inner.link {
                names.reverse();
                let joined = names.join(" ");
                return Some(joined);
            }
            let is_other_body =
                link != outer.link && self.model.bodies.iter().any(|b| b.link == link);
            if is_other_body {
                return None;
            }
            let motion = self.model.links[link].motion.as_ref();
            let name = motion.map(|m| self.model.coordinates[m.coordinate].name.as_str());
            // the coordinates of one joint are its name and a number
            names.extend(name.map(|name| name.split('.').next().unwrap_or(name)));
            names.dedup();
            at = self.model.links[link].parent;
        }
        None
    }

    /// The outermost of some bodies, if all others are on the path that carries it.
    fn in_one_limb(&self, bodies: &[usize]) -> Option<usize> {
        let link = |b: usize| self.model.bodies.get(b).map(|b| b.link);
        let mut all = bodies.iter().copied();
        all.find(|&outer| {
            let path = self.model.path(link(outer));
            bodies
                .iter()
                .all(|b| link(*b).is_some_and(|l| path.contains(&l)))
        })
    }

    /// The reason for a combination of bodies that the tree of joints does not explain: it comes
    /// from the loops.
    fn reason_beyond_tree(&self, bodies: &[usize], rotors: &[usize]) -> Option<String> {
        let link = |b: usize| self.model.bodies.get(b).map(|b| b.link);
        let turning = bodies.iter().copied();
        let turning: Vec<usize> = turning
            .filter(|b| {
                self.observed
                    .get(*b)
                    .is_some_and(|s| !s.freedom.has_constant_orientation())
            })
            .collect();
        let mut reasons = Vec::new();
        for &body in bodies {
            if !turning.contains(&body) {
                reasons.push(format!("body {} never rotates", self.label(body)));
            }
        }
        // group the bodies with the same orientation
        let mut classes: Vec<Vec<usize>> = Vec::new();
        for &body in &turning {
            let with = classes
                .iter_mut()
                .find(|class| self.motions.same_orientation(link(class[0]), link(body)).0);
            match with {
                Some(class) => class.push(body),
                None => classes.push(vec![body]),
            }
        }
        for class in classes.iter().filter(|class| class.len() > 1) {
            let names: Vec<&str> = class.iter().map(|b| self.label(*b)).collect();
            reasons.push(format!(
                "bodies {} always have the same orientation",
                names.join(" ")
            ));
        }
        if !rotors.is_empty() {
            let names = rotors
                .iter()
                .map(|c| self.model.coordinates[*c].name.as_str());
            let names: Vec<&str> = names.collect();
            reasons.push(format!(
                "the rotor of {} turns at a rate in proportion to theirs",
                names.join(" ")
            ));
        }
        let all_planar = !turning.is_empty()
            && turning
                .iter()
                .all(|b| self.observed.get(*b).is_some_and(|s| s.freedom.is_planar()));
        if reasons.is_empty() && all_planar {
            let names: Vec<&str> = bodies.iter().map(|b| self.label(*b)).collect();
            reasons.push(format!(
                "the rotations of bodies {} depend on each other",
                names.join(" ")
            ));
        }
        if reasons.is_empty() {
            let carried = self.observed.iter().enumerate();
            let carried = carried.filter(|(_, s)| {
                s.freedom.has_constant_orientation() && s.freedom != Freedom::Fixed
            });
            let names: Vec<&str> = carried.map(|(b, _)| self.label(b)).collect();
            if !names.is_empty() {
                let plural = if names.len() == 1 { "body" } else { "bodies" };
                reasons.push(format!(
                    "around loops in which {plural} {} never rotate{}",
                    names.join(" "),
                    if names.len() == 1 { "s" } else { "" }
                ));
            }
        }
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }
}
