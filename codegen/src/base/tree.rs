//! Layer 1: the null directions of a tree, by a recursion over spans from the ground outwards.
//!
//! Each body has two spans: L, of the twists it can have (with gravity's), and A, of the values
//! that the kinetic energy's coefficients h and gravity's power can take on it. A joint with the
//! unit twist S adds the generators h(S, S) and h(w, S) for w in L. Parameters of a body that are
//! orthogonal to all of these can be moved to its parent without any effect.

use crate::model::MotionKind;

use super::field::{Element, Field};
use super::linkage::{Linkage, Stage};
use super::span::{Span, Vector, add_scaled, dot, sparse};

/// Index of the weight of gravity's own twist, behind the six entries w, v of a twist.
const GRAVITY_WEIGHT: usize = 6;

/// The spans of a body of the tree: L in `twists`, A in `values`.
#[derive(Clone, Debug, Default)]
struct Reach {
    twists: Span,
    values: Span,
}

/// The null directions of one spanning tree, over all columns.
pub(super) fn null_directions(field: &mut Field, linkage: &Linkage, tree: &[usize]) -> Vec<Vector> {
    let mut reach: Vec<Option<Reach>> = vec![None; linkage.bodies + 1];
    let mut ground = Reach::default();
    let mut gravity: Vector =
        sparse(std::iter::repeat_n(Element::zero(), 3).chain(linkage.gravity.iter().cloned()));
    gravity.insert(GRAVITY_WEIGHT, Element::one());
    ground.twists.insert(field, &gravity);
    reach[0] = Some(ground);
    let mut directions = Vec::new();
    let mut waiting = tree.to_vec();
    while !waiting.is_empty() {
        let next = waiting.iter().position(|e| {
            let (a, b) = linkage.edges[*e].ends;
            reach[a].is_some() != reach[b].is_some()
        });
        let Some(next) = next else { break };
        let edge = &linkage.edges[waiting.remove(next)];
        let parent = if reach[edge.ends.0].is_some() {
            edge.ends.0
        } else {
            edge.ends.1
        };
        let (Some(child), Some(start)) = (edge.other(parent), reach[parent].clone()) else {
            continue;
        };
        let stages = edge.stages_from(field, parent);
        let (end, found) = pass(field, start, &stages);
        reach[child] = Some(end);
        directions.extend(found.into_iter().map(|d| d.placed(field, parent, child)));
    }
    directions
}

/// A null direction at a joint: parameters of the child, their image on the parent (to be
/// subtracted), and entries of the joint's own columns.
struct JointDirection {
    child: Vector,
    image: Vector,
    own: Vec<(usize, Element)>,
}

impl JointDirection {
    fn placed(self, field: &mut Field, parent: usize, child: usize) -> Vector {
        let mut vector = Vector::new();
        let minus = Element::integer(-1);
        let shifted = |v: &Vector, body: usize| -> Vector {
            let offset = 10 * (body - 1);
            v.iter().map(|(i, e)| (offset + i, e.clone())).collect()
        };
        add_scaled(
            field,
            &mut vector,
            &Element::one(),
            &shifted(&self.child, child),
        );
        if parent > 0 {
            add_scaled(field, &mut vector, &minus, &shifted(&self.image, parent));
        }
        for (column, entry) in self.own {
            let own = Vector::from([(column, entry)]);
            add_scaled(field, &mut vector, &Element::one(), &own);
        }
        vector
    }
}

/// Carries a body's spans over a joint, and finds the null directions at the joint.
fn pass(field: &mut Field, start: Reach, stages: &[Stage]) -> (Reach, Vec<JointDirection>) {
    let mut reach = start;
    // the functionals to which a direction must be orthogonal, in the current frame: ten entries of
    // the body, then one per joint column
    let mut functionals: Vec<Vector> = Vec::new();
    // the joint columns: the directions in the parameters in which only a rotor's inertia at a joint
    // grows (J), or only its constant effort (Fo, or Fc+ less Fc-)
    let mut own: Vec<Vector> = Vec::new();
    // the transformation of parameters from the current frame to the parent's, column by column
    let mut back: Vec<Vector> = (0..10)
        .map(|i| Vector::from([(i, Element::one())]))
        .collect();
    for stage in stages {
        match stage {
            Stage::Fixed(placed) => {
                let columns: Vec<Vector> = placed
                    .parameters_out(field)
                    .into_iter()
                    .map(sparse)
                    .collect();
                let mut twists = Span::default();
                for twist in reach.twists.vectors() {
                    let e = |i: usize| twist.get(&i).cloned().unwrap_or_else(Element::zero);
                    let (w, v) = placed.twist_into(field, &[e(0), e(1), e(2)], &[e(3), e(4), e(5)]);
                    let moved = sparse(w.into_iter().chain(v).chain([e(GRAVITY_WEIGHT)]));
                    twists.insert(field, &moved);
                }
                let mut values = Span::default();
                for value in reach.values.vectors() {
                    let moved = h_on_child(field, value, &columns);
                    values.insert(field, &moved);
                }
                reach = Reach { twists, values };
                functionals = functionals
                    .iter()
                    .map(|f| h_on_child(field, f, &columns))
                    .collect();
                back = columns
                    .iter()
                    .map(|column| {
                        let mut image = Vector::new();
                        for (i, entry) in column {
                            add_scaled(field, &mut image, entry, &back[*i]);
                        }
                        image
                    })
                    .collect();
            }
            Stage::Moving {
                kind,
                axis,
                lead,
                backward,
                coordinate: _,
                rotor,
                offset,
            } => {
                let joint = Joint::new(field, *kind, *axis, lead.as_ref());
                let mut place = |direction: &Vector| {
                    own.push(direction.clone());
                    9 + own.len()
                };
                let rotor_at = rotor.as_ref().map(&mut place);
                let offset_at = offset.as_ref().map(&mut place);
                let (next, found) =
                    joint.extend(field, &reach, rotor_at, offset_at.map(|at| (at, *backward)));
                reach = next;
                functionals.extend(found);
            }
        }
    }
    let mut span = Span::default();
    for functional in &functionals {
        span.insert(field, functional);
    }
    let passing = span
        .annihilator(10 + own.len())
        .into_iter()
        .map(|direction| {
            let child: Vector = direction
                .range(..10)
                .map(|(i, e)| (*i, e.clone()))
                .collect();
            let mut image = Vector::new();
            for (i, entry) in &child {
                add_scaled(field, &mut image, entry, &back[*i]);
            }
            let mut columns = Vec::new();
            for (at, entry) in direction.range(10..) {
                for (column, factor) in &own[at - 10] {
                    columns.push((*column, field.mul(entry, factor)));
                }
            }
            JointDirection {
                child,
                image,
                own: columns,
            }
        });
    let passing = passing.collect();
    (reach, passing)
}

/// Transforms h from the parent to the child, where `columns` transform parameters from child to
/// parent; entries behind the ten stay unchanged.
fn h_on_child(field: &mut Field, h: &Vector, columns: &[Vector]) -> Vector {
    let mut moved = Vector::new();
    for (i, column) in columns.iter().enumerate() {
        let entry = dot(field, column, h);
        if !entry.is_zero() {
            moved.insert(i, entry);
        }
    }
    moved.extend(h.range(10..).map(|(i, e)| (*i, e.clone())));
    moved
}

/// A motion about or along a coordinate axis through the frame's origin, or both in proportion.
struct Joint {
    twist: [Element; 6],
    /// The action D of the motion on h, column by column.
    action: Vec<Vector>,
}

impl Joint {
    fn new(field: &mut Field, kind: MotionKind, axis: usize, lead: Option<&Element>) -> Self {
        let slide = 3 + axis;
        let first = match kind {
            MotionKind::Rotation => axis,
            MotionKind::Translation => slide,
        };
        let mut joint = Joint {
            twist: [(); 6].map(|()| Element::zero()),
            action: Joint::action_on_h(first),
        };
        joint.twist[first] = Element::one();
        if let Some(lead) = lead {
            joint.twist[slide] = lead.clone();
            // the action is linear in the twist
            for (column, slid) in joint.action.iter_mut().zip(Joint::action_on_h(slide)) {
                add_scaled(field, column, lead, &slid);
            }
        }
        joint
    }

    /// The action on h of the unit twist with a 1 at `entry`: the transpose of the action on the
    /// parameters.
    fn action_on_h(entry: usize) -> Vec<Vector> {
        let [wx, wy, wz, vx, vy, vz] = std::array::from_fn(|k| i64::from(k == entry));
        let cross = [[0, -wz, wy], [wz, 0, -wx], [-wy, wx, 0]];
        let v = [vx, vy, vz];
        let place = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
        // rate[i][j]: derivative of the parent's parameter i with respect to the child's parameter
        // j
        let mut rate = [[0_i64; 10]; 10];
        #[expect(
            clippy::needless_range_loop,
            reason = "j names a parameter, and goes through columns"
        )]
        for j in 0..10 {
            let mut tensor = [[0; 3]; 3];
            for a in 0..3 {
                for b in 0..3 {
                    tensor[a][b] = i64::from(place[a][b] == j);
                }
            }
            let h: [i64; 3] = [0, 1, 2].map(|a| i64::from(j == 6 + a));
            let mass = i64::from(j == 9);
            let along: i64 = (0..3).map(|a| v[a] * h[a]).sum();
            for a in 0..3 {
                for b in a..3 {
                    let turned: i64 = (0..3)
                        .map(|c| cross[a][c] * tensor[c][b] - tensor[a][c] * cross[c][b])
                        .sum();
                    let moved = if a == b { 2 * along } else { 0 } - v[a] * h[b] - h[a] * v[b];
                    rate[place[a][b]][j] = turned + moved;
                }
                let turned: i64 = (0..3).map(|c| cross[a][c] * h[c]).sum();
                rate[6 + a][j] = turned + mass * v[a];
            }
        }
        // the action takes h to rate^T h: its column i is row i of rate
        rate.iter()
            .map(|row| sparse(row.iter().map(|e| Element::integer(*e))))
            .collect()
    }

    fn act(&self, field: &mut Field, h: &Vector) -> Vector {
        let mut result = Vector::new();
        for (i, entry) in h.range(..10) {
            add_scaled(field, &mut result, entry, &self.action[*i]);
        }
        result
    }

    /// `ad_S` applied to a twist; the entry for gravity's weight becomes 0.
    fn ad(&self, field: &mut Field, twist: &Vector) -> Vector {
        let e = |i: usize| twist.get(&i).cloned().unwrap_or_else(Element::zero);
        let s = &self.twist;
        let [sw, sv] = [
            [s[0].clone(), s[1].clone(), s[2].clone()],
            [s[3].clone(), s[4].clone(), s[5].clone()],
        ];
        let (w, v) = ([e(0), e(1), e(2)], [e(3), e(4), e(5)]);
        let turned = field.cross(&sw, &w);
        let one = field.cross(&sw, &v);
        let two = field.cross(&sv, &w);
        let moved = field.add3(&one, &two);
        sparse(turned.into_iter().chain(moved))
    }

    /// The ten entries of h(w, S) for a twist w.
    fn value(&self, field: &mut Field, twist: &Vector) -> Vector {
        let e = |i: usize| twist.get(&i).cloned().unwrap_or_else(Element::zero);
        let s = &self.twist;
        let (w1, v1) = ([e(0), e(1), e(2)], [e(3), e(4), e(5)]);
        let (w2, v2) = (
            [s[0].clone(), s[1].clone(), s[2].clone()],
            [s[3].clone(), s[4].clone(), s[5].clone()],
        );
        let mut entries = Vec::with_capacity(10);
        for i in 0..3 {
            for j in i..3 {
                let one = field.mul(&w1[i], &w2[j]);
                let entry = if i == j {
                    one
                } else {
                    let two = field.mul(&w1[j], &w2[i]);
                    field.add(&one, &two)
                };
                entries.push(entry);
            }
        }
        let (one, two) = (field.cross(&v1, &w2), field.cross(&v2, &w1));
        entries.extend(field.add3(&one, &two));
        entries.push(field.dot(&v1, &v2));
        sparse(entries)
    }

    fn unit(&self) -> Vector {
        sparse(self.twist.clone())
    }

    /// The spans behind the joint, and the functionals to which a null direction at the joint must
    /// be orthogonal. They have ten entries for the body, one for the rotor (1 in the generator
    /// h(S, S) alone) and one for the joint's offset (in the generators with gravity, with the
    /// opposite sign if the joint is passed backward).
    fn extend(
        &self,
        field: &mut Field,
        before: &Reach,
        rotor: Option<usize>,
        offset: Option<(usize, bool)>,
    ) -> (Reach, Vec<Vector>) {
        let mut twists = before.twists.clone();
        close(field, &mut twists, |f, t| self.ad(f, t));
        // inherited values count only as far as the joint changes them
        let mut changes = Span::default();
        for value in before.values.vectors() {
            let change = self.act(field, value);
            if !change.is_empty() {
                changes.insert(field, &change);
            }
        }
        close(field, &mut changes, |f, h| self.act(f, h));
        let mut functionals: Vec<Vector> = changes.vectors().cloned().collect();
        let mut values = before.values.clone();
        for change in changes.vectors() {
            values.insert(field, change);
        }
        let own = self.value(field, &self.unit());
        values.insert(field, &own);
        let mut generator = own;
        if let Some(at) = rotor {
            generator.insert(at, Element::one());
        }
        functionals.push(generator);
        let reached: Vec<Vector> = twists.vectors().cloned().collect();
        for twist in reached {
            let h = self.value(field, &twist);
            values.insert(field, &h);
            let mut generator = h;
            if let (Some((at, backward)), Some(weight)) = (offset, twist.get(&GRAVITY_WEIGHT)) {
                let weight = if backward {
                    weight.clone()
                } else {
                    weight.neg()
                };
                generator.insert(at, weight);
            }
            functionals.push(generator);
        }
        // the generators are closed under the action already: it takes h(w, S) to h(-ad w, S), and
        // the span of w is closed
        let unit = self.unit();
        twists.insert(field, &unit);
        (Reach { twists, values }, functionals)
    }
}

/// Closes a span under a linear action.
fn close(field: &mut Field, span: &mut Span, act: impl Fn(&mut Field, &Vector) -> Vector) {
    let mut waiting: Vec<Vector> = span.vectors().cloned().collect();
    while let Some(vector) = waiting.pop() {
        let moved = act(field, &vector);
        if !moved.is_empty() && span.insert(field, &moved) {
            waiting.push(moved);
        }
    }
}
