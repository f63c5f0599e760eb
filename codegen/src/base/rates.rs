//! Null directions of friction alone: friction parameters of coordinates whose rates are always
//! proportional or linearly dependent are themselves dependent.
//!
//! Such velocity constraints come from couplings, and from loops whose revolute axes are all
//! parallel: the rotations around the loop sum to zero, unless the cut joint rotates too. By
//! homogeneity (see `BASE.md`, friction) each kind of friction is constrained by itself: offsets o
//! (Fo, and half of Fc+ minus Fc-) by any constraint, since their power is linear in the rates; v, c and e,
//! whose powers are v qd^2, c |qd|, e |qd| qd, only by constraints between two coordinates, or on
//! one, which then does not move at all.

use crate::model::{FrictionColumn, Model, MotionKind, ParameterKind};
use crate::spec::Spec;
use crate::sym::Number;

use super::field::{Element, Field};
use super::geometry::Placed;
use super::link_path::LinearForm;
use super::linkage::{Linkage, Stage};
use super::span::{Vector, add_scaled};
use super::trees::path;

/// The null directions of friction that follow from velocity constraints, over all columns.
pub(super) fn null_directions(field: &mut Field, linkage: &Linkage, model: &Model) -> Vec<Vector> {
    let velocity_constraints = velocity_constraint_vectors(field, linkage);
    let n = model.coordinates.len();
    let mut directions: Vec<Vector> = (0..n).filter_map(|c| same_offset(model, c)).collect();
    let offsets: Vec<Option<Vector>> = (0..n).map(|c| own_offset(model, c)).collect();
    let with_offset: Vec<usize> = (0..n).filter(|c| offsets[*c].is_some()).collect();
    for constraint in constraints_among(field, &velocity_constraints, &with_offset) {
        let mut direction = Vector::new();
        for (coordinate, factor) in &constraint {
            if let Some(offset) = &offsets[*coordinate] {
                add_scaled(field, &mut direction, factor, offset);
            }
        }
        directions.push(direction);
    }
    for a in 0..n {
        for b in a..n {
            let both = if a == b { vec![a] } else { vec![a, b] };
            for constraint in constraints_among(field, &velocity_constraints, &both) {
                // a coordinate that cannot move is handled by itself
                if constraint.len() < both.len() {
                    continue;
                }
                directions.extend(pair_directions(field, model, &constraint));
            }
        }
    }
    directions
}

/// The velocity constraints that hold by construction: each is a list of coordinates with factors,
/// and the sum of factors times rates is 0 at all times.
pub fn velocity_constraints(spec: &Spec, model: &Model) -> Vec<LinearForm> {
    let mut field = super::geometry::field(spec, model);
    let linkage = Linkage::new(&mut field, spec, model);
    all_velocity_constraints(&mut field, &linkage)
}

/// The velocity constraints of couplings and of planar loops.
pub(super) fn all_velocity_constraints(field: &mut Field, linkage: &Linkage) -> Vec<LinearForm> {
    let constraints = velocity_constraint_vectors(field, linkage);
    constraints.iter().map(to_form).collect()
}

/// The velocity constraints of couplings and of planar loops, with factors in the field.
pub(super) fn velocity_constraint_vectors(field: &mut Field, linkage: &Linkage) -> Vec<Vector> {
    let mut velocity_constraints = linkage.couplings.clone();
    velocity_constraints.extend(planar_loops(field, linkage));
    velocity_constraints
}

/// The velocity constraints of couplings alone.
pub(super) fn coupling_velocity_constraints(linkage: &Linkage) -> Vec<LinearForm> {
    linkage.couplings.iter().map(to_form).collect()
}

pub(super) fn to_form(constraint: &Vector) -> LinearForm {
    constraint
        .iter()
        .map(|(c, e)| (*c, e.value().clone()))
        .collect()
}

/// Null directions of v, c, e and of rotors for two coordinates with proportional rates, or for one
/// that cannot move.
fn pair_directions(field: &mut Field, model: &Model, constraint: &Vector) -> Vec<Vector> {
    let mut entries = constraint.iter();
    let (Some((a, ra)), second) = (entries.next(), entries.next()) else {
        return Vec::new();
    };
    let kinds: [fn(&Model, usize) -> Option<Vector>; 4] =
        [viscous, coulomb, viscous_difference, own_rotor];
    let Some((b, rb)) = second else {
        return kinds.iter().filter_map(|kind| kind(model, *a)).collect();
    };
    // qd_a = k qd_b
    let Some(k) = field.div(&rb.neg(), ra) else {
        return Vec::new();
    };
    let size = if k.value().is_negative() {
        k.neg()
    } else {
        k.clone()
    };
    let square = field.mul(&k, &k);
    let factors = [square.clone(), size.clone(), field.mul(&k, &size), square];
    let mut directions = Vec::new();
    for (kind, factor) in kinds.iter().zip(factors) {
        if let (Some(on_a), Some(on_b)) = (kind(model, *a), kind(model, *b)) {
            let mut direction = on_a;
            add_scaled(field, &mut direction, &factor.neg(), &on_b);
            directions.push(direction);
        }
    }
    directions
}

fn column(model: &Model, coordinate: usize, column: FrictionColumn) -> Option<usize> {
    let wanted = ParameterKind::Friction { coordinate, column };
    model.parameters.iter().position(|p| p.kind == wanted)
}

fn pair(plus: Option<usize>, minus: Option<usize>, sign: i64) -> Option<Vector> {
    Some(Vector::from([
        (plus?, Element::one()),
        (minus?, Element::integer(sign)),
    ]))
}

/// The direction in which only the offset o of a joint grows: Fo, or else Fc+ less Fc-; without
/// these, that of the motor which drives it alone.
pub(super) fn offset(
    field: &Field,
    model: &Model,
    couplings: &[Vector],
    c: usize,
) -> Option<Vector> {
    own_offset(model, c).or_else(|| {
        let (drive, ratio) = own_drive(model, couplings, c)?;
        let own = own_offset(model, drive)?;
        Some(scaled(field, &own, &field.div(&Element::one(), &ratio)?))
    })
}

/// The direction in which only the rotor's inertia at a joint grows: J, or that of the motor which
/// drives it alone.
pub(super) fn rotor(
    field: &Field,
    model: &Model,
    couplings: &[Vector],
    c: usize,
) -> Option<Vector> {
    own_rotor(model, c).or_else(|| {
        let (drive, ratio) = own_drive(model, couplings, c)?;
        let square = field.mul(&ratio, &ratio);
        let own = own_rotor(model, drive)?;
        Some(scaled(field, &own, &field.div(&Element::one(), &square)?))
    })
}

/// The first drive that moves with this joint alone, and its ratio.
fn own_drive(model: &Model, couplings: &[Vector], c: usize) -> Option<(usize, Element)> {
    model.drives.iter().find_map(|drive| {
        let mut own = model.couplings.iter().zip(couplings);
        let (_, constraint) = own.find(|(coupling, _)| coupling.key == *drive)?;
        let joint = constraint.get(&c).filter(|_| constraint.len() == 2);
        joint.map(|factor| (*drive, factor.neg()))
    })
}

fn scaled(field: &Field, direction: &Vector, factor: &Element) -> Vector {
    let entries = direction.iter();
    entries
        .map(|(column, entry)| (*column, field.mul(factor, entry)))
        .collect()
}

fn own_offset(model: &Model, c: usize) -> Option<Vector> {
    match offset_column(model, c) {
        Some(at) => Some(Vector::from([(at, Element::one())])),
        None => coulomb_difference(model, c),
    }
}

fn own_rotor(model: &Model, coordinate: usize) -> Option<Vector> {
    let wanted = ParameterKind::Rotor { coordinate };
    let at = model.parameters.iter().position(|p| p.kind == wanted)?;
    Some(Vector::from([(at, Element::one())]))
}

/// Where a joint has both Fo and asymmetric Coulomb friction, the direction without effect: in
/// motion, Fc+ less Fc- is the constant effort that Fo is.
fn same_offset(model: &Model, c: usize) -> Option<Vector> {
    let at = offset_column(model, c)?;
    let mut direction = coulomb_difference(model, c)?;
    direction.insert(at, Element::integer(-1));
    Some(direction)
}

fn offset_column(model: &Model, coordinate: usize) -> Option<usize> {
    let wanted = ParameterKind::Offset { coordinate };
    model.parameters.iter().position(|p| p.kind == wanted)
}

fn coulomb_difference(model: &Model, c: usize) -> Option<Vector> {
    pair(
        column(model, c, FrictionColumn::CoulombPositive),
        column(model, c, FrictionColumn::CoulombNegative),
        -1,
    )
}

/// The direction in which only the Coulomb friction c grows.
fn coulomb(model: &Model, c: usize) -> Option<Vector> {
    match column(model, c, FrictionColumn::Coulomb) {
        Some(at) => Some(Vector::from([(at, Element::one())])),
        None => pair(
            column(model, c, FrictionColumn::CoulombPositive),
            column(model, c, FrictionColumn::CoulombNegative),
            1,
        ),
    }
}

/// The direction in which only the viscous friction v grows.
fn viscous(model: &Model, c: usize) -> Option<Vector> {
    match column(model, c, FrictionColumn::Viscous) {
        Some(at) => Some(Vector::from([(at, Element::one())])),
        None => pair(
            column(model, c, FrictionColumn::ViscousPositive),
            column(model, c, FrictionColumn::ViscousNegative),
            1,
        ),
    }
}

/// The direction in which only the viscous difference e grows.
fn viscous_difference(model: &Model, c: usize) -> Option<Vector> {
    pair(
        column(model, c, FrictionColumn::ViscousPositive),
        column(model, c, FrictionColumn::ViscousNegative),
        -1,
    )
}

/// A basis of the combinations of constraints that contain no other than the given coordinates.
pub(super) fn constraints_among(
    field: &mut Field,
    velocity_constraints: &[Vector],
    coordinates: &[usize],
) -> Vec<Vector> {
    let mut rows = velocity_constraints.to_vec();
    while let Some((r, outside)) = rows.iter().enumerate().find_map(|(r, row)| {
        let outside = row.keys().find(|c| !coordinates.contains(c));
        outside.map(|c| (r, *c))
    }) {
        let pivot = rows.swap_remove(r);
        let Some(lead) = pivot.get(&outside).cloned() else {
            continue;
        };
        for row in &mut rows {
            let factor = row.get(&outside).and_then(|e| field.div(&e.neg(), &lead));
            if let Some(factor) = factor {
                add_scaled(field, row, &factor, &pivot);
                row.remove(&outside);
            }
        }
    }
    // the remaining rows may be linearly dependent
    let mut span = super::span::Span::default();
    for row in &rows {
        span.insert(field, row);
    }
    span.vectors().cloned().collect()
}

/// The velocity constraints of loops in which all rotations are about one direction.
fn planar_loops(field: &mut Field, linkage: &Linkage) -> Vec<Vector> {
    let tree = (0..linkage.edges.len())
        .filter(|e| linkage.edges[*e].in_spec_tree)
        .collect();
    let cuts = linkage.edges.iter().filter(|e| !e.in_spec_tree);
    let mut velocity_constraints = Vec::new();
    for cut in cuts {
        // from one side of the cut along the tree to the other side, and back through the cut
        let (from, to) = cut.ends;
        let mut edges = path(linkage, &tree, from, to);
        edges.reverse();
        let mut at = from;
        let mut walk = LoopRotations::default();
        let mut planar = true;
        for edge in edges {
            let edge = &linkage.edges[edge];
            let Some(next) = edge.other(at) else { break };
            let outward = edge.ends.0 == at;
            let stages = edge.stages_from(field, at);
            planar &= walk.follow(field, &stages, outward);
            at = next;
        }
        let stages = cut.stages_from(field, to);
        planar &= walk.follow(field, &stages, false);
        if planar && !walk.free && !walk.constraint.is_empty() {
            velocity_constraints.push(walk.constraint);
        }
    }
    velocity_constraints
}

/// The sum of the rotations around a loop, as far as it has been followed.
#[derive(Default)]
struct LoopRotations {
    /// The common direction of the rotations, in the current frame.
    axis: Option<[Element; 3]>,
    /// The sign with which the rate of each coordinate enters the sum.
    constraint: Vector,
    /// Whether a joint without a coordinate rotates about this direction too.
    free: bool,
}

impl LoopRotations {
    /// Follows a connection; false if it has a rotation about another direction.
    fn follow(&mut self, field: &mut Field, stages: &[Stage], outward: bool) -> bool {
        for stage in stages {
            match stage {
                Stage::Fixed(placed) => {
                    let placed: &Placed = placed;
                    if let Some(axis) = &self.axis {
                        self.axis = Some(placed.direction_into(field, axis));
                    }
                }
                Stage::Moving {
                    kind: MotionKind::Rotation,
                    axis,
                    coordinate,
                    ..
                } => {
                    let direction = self.axis.get_or_insert_with(|| {
                        let mut unit = [Element::zero(), Element::zero(), Element::zero()];
                        unit[*axis] = Element::one();
                        unit
                    });
                    let along = direction[*axis].value().clone();
                    let parallel = along.is_one() || along.neg().is_one();
                    if !parallel {
                        return false;
                    }
                    let Some(coordinate) = coordinate else {
                        self.free = true;
                        continue;
                    };
                    let sign = if along.is_negative() == outward {
                        Number::from_i64(-1)
                    } else {
                        Number::one()
                    };
                    self.constraint.insert(*coordinate, Element::exact(sign));
                }
                Stage::Moving { .. } => {}
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use crate::diag::Source;
    use crate::pipeline::derive;

    fn combinations(text: &str) -> (bool, Vec<String>) {
        let robot = derive(&Source::new("test.yaml", text)).unwrap();
        let analysis = robot.analysis.unwrap();
        let written = analysis.base.parameters.iter().map(|p| {
            let terms = p.terms.iter();
            let terms =
                terms.map(|t| format!("{} {}", t.coefficient, robot.parameters[t.column].label));
            terms.collect::<Vec<_>>().join(" + ")
        });
        (analysis.complete, written.collect())
    }

    /// The rotations around the loop sum to zero, so a common part of the three offsets cannot be
    /// identified.
    #[test]
    fn a_slider_crank_cut_at_its_slider_has_one_coulomb_offset_less() {
        let (complete, base) = combinations(
            "name: crank
geometry: {l1: 0.15, l2: 0.40}
limbs:
  - name: driven
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, friction: coulomb_asymmetric}
      - {name: q2, type: revolute, dh: {a: l1}, body: 2, friction: coulomb_asymmetric}
      - {name: q3, type: revolute, dh: {a: l2}, body: 3, friction: coulomb_asymmetric}
cuts:
  - {name: rail, joint: prismatic, between: [{body: world, rpy: [pi/2, 0, pi/2]}, {body: 3, rpy: [0, pi/2, 0]}]}
home: {q1: 0.7, q2: -0.944, q3: 0.244}
",
        );
        assert!(complete);
        // 6 of the bodies, 9 of friction, less one
        assert_eq!(base.len(), 6 + 9 - 1);
        assert!(
            base.contains(&"1 Fc+(q2) + -1 Fc+(q1)".to_owned()),
            "{base:?}"
        );
    }

    /// q2 = -2 q1: friction of q1 and q2 acts only in combination.
    #[test]
    fn friction_of_coupled_joints_combines_by_their_ratio() {
        let (_, base) = combinations(
            "name: geared
limbs:
  - name: one
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, friction: linear}
  - name: two
    base: {xyz: [1, 0, 0]}
    joints:
      - {name: q2, type: revolute, body: 2, friction: linear}
couplings: {q2: -2*q1}
",
        );
        assert!(
            base.contains(&"1 Fc(q2) + 1/2 Fc(q1)".to_owned()),
            "{base:?}"
        );
        assert!(
            base.contains(&"1 Fv(q2) + 1/4 Fv(q1)".to_owned()),
            "{base:?}"
        );
    }
}
