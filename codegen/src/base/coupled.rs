//! Null directions of bodies whose rates are constrained: bodies that do not rotate, bodies with
//! constant relative orientation, and bodies that spin in a fixed proportion. The tree recursion
//! treats all coordinates as free, and does not find these directions.
//!
//! Moments of inertia act through the angular velocity alone, so for two bodies with the same
//! angular velocity only the sum of their moments in common axes counts. For a body that never
//! rotates, no moment of inertia counts, and no first moment either: it moves as one point does,
//! and the work of its weight is that of its mass. For two bodies that spin about axes at rest,
//! only the moments about these axes count, combined with the square of the ratio of their rates;
//! with equal rates, also the moments of their weights.

use crate::model::{Model, MotionKind, Step};

use super::field::{Element, Field};
use super::geometry::{Placed, Rotation};
use super::link_path::{Freedom, LinearForm, LinkPath, link_paths};
use super::linkage::Linkage;
use super::rates;
use super::span::{Vector, add_scaled};

/// Index of the inertia tensor's entry at a row and column among the ten parameters.
const TENSOR_ENTRY: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
/// Index of the first moment mx among the ten parameters.
const FIRST_MOMENT: usize = 6;

/// The null directions that follow from exact velocity constraints, over all columns.
pub(super) fn null_directions(field: &mut Field, linkage: &Linkage, model: &Model) -> Vec<Vector> {
    let constraint_vectors = rates::velocity_constraint_vectors(field, linkage);
    if constraint_vectors.is_empty() {
        return Vec::new();
    }
    let velocity_constraints: Vec<LinearForm> =
        constraint_vectors.iter().map(rates::to_form).collect();
    let couplings = rates::coupling_velocity_constraints(linkage);
    let link_paths = link_paths(model);
    let mut all = Vec::new();
    let free: Vec<Freedom> = model
        .bodies
        .iter()
        .map(|b| link_paths[b.link].freedom(&velocity_constraints))
        .collect();
    for (body, freedom) in free.iter().enumerate() {
        if freedom.has_constant_orientation() {
            all.extend((0..9).map(|k| Vector::from([(10 * body + k, Element::one())])));
        }
    }
    for j in 0..model.bodies.len() {
        for i in 0..j {
            if free[i].has_constant_orientation() || free[j].has_constant_orientation() {
                continue;
            }
            if let Some(relative) = same_orientation(field, linkage, model, &couplings, [i, j]) {
                let on_axis = |b: usize| {
                    free[b] == Freedom::FixedAxisRotation
                        && own_joint(model, &link_paths, b).is_some()
                };
                let spin_equally = on_axis(i) && on_axis(j);
                all.extend(summed_moments(field, i, j, &relative, spin_equally));
            } else if free[i] == Freedom::FixedAxisRotation && free[j] == Freedom::FixedAxisRotation
            {
                all.extend(in_proportion(
                    field,
                    model,
                    &link_paths,
                    &constraint_vectors,
                    [i, j],
                ));
            }
        }
    }
    all
}

/// The axes of body j in those of body i, if couplings keep this orientation constant.
fn same_orientation(
    field: &mut Field,
    linkage: &Linkage,
    model: &Model,
    couplings: &[LinearForm],
    [i, j]: [usize; 2],
) -> Option<Rotation> {
    let [a, b] = [i, j].map(|k| model.path(Some(model.bodies[k].link)));
    let shared = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    let (a, b) = (&a[shared..], &b[shared..]);
    let turns = |links: &[usize]| links.iter().any(|l| model.links[*l].motion.is_some());
    if !(turns(a) || turns(b)) {
        // rigidly connected: the tree recursion finds this
        return None;
    }
    if !LinkPath::along_links(model, a)
        .has_same_orientation(&LinkPath::along_links(model, b), couplings)
    {
        return None;
    }
    let [a, b] = [a, b].map(|links| axes(field, linkage, model, links));
    // both matrices have a link's axes as columns over the shared frame: Q = A^T B
    let column = |m: &Rotation, c: usize| [0, 1, 2].map(|k: usize| m[k][c].clone());
    Some([0, 1, 2].map(|r| [0, 1, 2].map(|c| field.dot(&column(&a, r), &column(&b, c)))))
}

/// The axes of the last link as columns over the frame before the first, with all coordinates 0
/// except those that couplings determine.
fn axes(field: &mut Field, linkage: &Linkage, model: &Model, links: &[usize]) -> Rotation {
    let mut placed = Placed::identity();
    for &link in links {
        let link = &model.links[link];
        for step in &link.placement {
            if let Step::Rotate(axis, angle) = step {
                let turn = linkage.names.sin_cos(field, angle);
                placed.turn(field, *axis, &turn);
            }
        }
        if let Some(motion) = &link.motion
            && motion.kind == MotionKind::Rotation
        {
            let angle = value(field, linkage, model, motion.coordinate, 0);
            let turn = field.sin_cos_of(&angle);
            placed.turn(field, motion.axis, &turn);
        }
    }
    placed.rotation
}

/// The value of a coordinate (rad or m) with all coordinates 0 except those that couplings
/// determine.
fn value(
    field: &mut Field,
    linkage: &Linkage,
    model: &Model,
    coordinate: usize,
    depth: usize,
) -> Element {
    let coupling = model.couplings.iter().position(|c| c.key == coordinate);
    // couplings have no cycles
    let Some(coupling) = coupling.filter(|_| depth <= model.couplings.len()) else {
        return Element::zero();
    };
    let mut sum = linkage.coupling_constants[coupling].clone();
    for (c, factor) in &linkage.couplings[coupling] {
        if *c != coordinate {
            let other = value(field, linkage, model, *c, depth + 1);
            let term = field.mul(&factor.neg(), &other);
            sum = field.add(&sum, &term);
        }
    }
    sum
}

/// Null directions of two bodies with constant relative orientation `q`: inertia of body j minus
/// the same inertia on body i. First moments too if both bodies spin about axes at rest.
fn summed_moments(
    field: &mut Field,
    i: usize,
    j: usize,
    q: &Rotation,
    spin_equally: bool,
) -> Vec<Vector> {
    let mut all = Vec::new();
    for r in 0..3 {
        for c in r..3 {
            let mut direction = Vector::from([(10 * j + TENSOR_ENTRY[r][c], Element::one())]);
            // Q E Q^T for the symmetric unit E
            for a in 0..3 {
                for b in a..3 {
                    let mut entry = field.mul(&q[a][r], &q[b][c]);
                    if r != c {
                        let other = field.mul(&q[a][c], &q[b][r]);
                        entry = field.add(&entry, &other);
                    }
                    subtract(field, &mut direction, 10 * i + TENSOR_ENTRY[a][b], &entry);
                }
            }
            all.push(direction);
        }
    }
    for c in 0..if spin_equally { 3 } else { 0 } {
        let mut direction = Vector::from([(10 * j + FIRST_MOMENT + c, Element::one())]);
        for (a, row) in q.iter().enumerate() {
            subtract(field, &mut direction, 10 * i + FIRST_MOMENT + a, &row[c]);
        }
        all.push(direction);
    }
    all
}

fn subtract(field: &mut Field, from: &mut Vector, column: usize, entry: &Element) {
    let unit = Vector::from([(column, Element::one())]);
    add_scaled(field, from, &entry.neg(), &unit);
}

/// Null direction of two bodies that spin in a fixed proportion: the moments about their axes.
fn in_proportion(
    field: &mut Field,
    model: &Model,
    link_paths: &[LinkPath],
    velocity_constraints: &[Vector],
    pair: [usize; 2],
) -> Option<Vector> {
    let [i, j] = pair;
    let [a, b] = pair.map(|body| own_joint(model, link_paths, body));
    let (a, b) = (a?, b?);
    // qd_b = k qd_a
    let k = ratio(field, velocity_constraints, a, b)?;
    let moment = |body: usize, coordinate: usize| -> Option<usize> {
        let axis = model.motion(coordinate)?.axis.index();
        Some(10 * body + TENSOR_ENTRY[axis][axis])
    };
    let mut direction = Vector::from([(moment(j, b)?, Element::one())]);
    let square = field.mul(&k, &k);
    subtract(field, &mut direction, moment(i, a)?, &square);
    Some(direction)
}

/// The first revolute coordinate on the path to a body, if it belongs to the body's own link: the
/// body's origin is then on the axis, which is an axis of the body's frame.
fn own_joint(model: &Model, link_paths: &[LinkPath], body: usize) -> Option<usize> {
    let link = model.bodies[body].link;
    let coordinate = link_paths[link].rotation_angle.first()?.0;
    (model.coordinates[coordinate].link == link).then_some(coordinate)
}

/// The ratio k in qd_b = k qd_a, if the velocity constraints fix it.
fn ratio(field: &mut Field, constraints: &[Vector], a: usize, b: usize) -> Option<Element> {
    let between = rates::constraints_among(field, constraints, &[a, b]);
    // two constraints would not let them move
    let [constraint] = between.as_slice() else {
        return None;
    };
    let quotient = field.div(constraint.get(&a)?, constraint.get(&b)?)?;
    Some(quotient.neg())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::sym::Number;

    #[test]
    fn a_ratio_of_rates_follows_from_a_chain_of_constraints() {
        let n = Element::integer;
        // b = -2 a, c = 3 b
        let constraints = [
            Vector::from([(1, n(1)), (0, n(2))]),
            Vector::from([(2, n(1)), (1, n(-3))]),
        ];
        let mut field = Field::default();
        let mut found = |b: usize| {
            let ratio = ratio(&mut field, &constraints, 0, b);
            ratio.map(|k| k.value().clone())
        };
        assert_eq!(found(2), Some(Number::from_i64(-6)));
        assert_eq!(found(1), Some(Number::from_i64(-2)));
        assert_eq!(found(3), None);
    }

    #[test]
    fn coupled_coordinates_have_their_constants_where_the_others_are_zero() {
        let text = "\
name: chain
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
      - {name: q2, type: revolute, dh: {a: 0.3}, body: 2}
      - {name: q3, type: revolute, dh: {a: 0.3}, body: 3}
couplings: {q3: -2*q2 + 1/4, q2: 3*q1 + 1/2}
";
        let spec = crate::spec::parse(&crate::diag::Source::new("chain.yaml", text)).unwrap();
        let model = crate::model::build(&spec);
        let mut field = Field::default();
        let linkage = Linkage::new(&mut field, &spec, &model);
        let mut at = |name: &str| {
            let place = model.coordinates.iter().position(|c| c.name == name);
            let value = value(&mut field, &linkage, &model, place.unwrap(), 0);
            value.value().clone()
        };
        assert_eq!(at("q1"), Number::zero());
        assert_eq!(at("q2"), Number::ratio(1, 2).unwrap());
        // 1/4 - 2 (1/2)
        assert_eq!(at("q3"), Number::ratio(-3, 4).unwrap());
    }
}
