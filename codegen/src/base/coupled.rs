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
use crate::sym::Number;

use super::field::{Element, Field};
use super::link_path::{
    Freedom, LinearForm, LinkPath, in_rotated_frame, is_implied_by, link_paths,
};
use super::linkage::Linkage;
use super::rates;
use super::span::{Vector, add_scaled};

/// Index of the inertia tensor's entry at a row and column among the ten parameters.
const TENSOR_ENTRY: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
/// Index of the first moment mx among the ten parameters.
const FIRST_MOMENT: usize = 6;

type Matrix = [[Number; 3]; 3];

/// The null directions that follow from exact velocity constraints, over all columns.
pub(super) fn null_directions(field: &mut Field, linkage: &Linkage, model: &Model) -> Vec<Vector> {
    let velocity_constraints = rates::all_velocity_constraints(field, linkage);
    if velocity_constraints.is_empty() {
        return Vec::new();
    }
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
            if let Some(relative) = same_orientation(model, &couplings, i, j) {
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
                    &velocity_constraints,
                    [i, j],
                ));
            }
        }
    }
    all
}

/// The axes of body j in those of body i, if couplings keep this orientation constant.
fn same_orientation(model: &Model, couplings: &[LinearForm], i: usize, j: usize) -> Option<Matrix> {
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
    let (a, b) = (axes(model, a), axes(model, b));
    // both matrices have a link's axes as columns over the shared frame: Q = A^T B
    let entry =
        |r: usize, c: usize| (0..3).fold(Number::zero(), |sum, k| sum.add(&a[k][r].mul(&b[k][c])));
    Some([0, 1, 2].map(|r| [0, 1, 2].map(|c| entry(r, c))))
}

/// The axes of the last link as columns over the frame before the first, with all coordinates 0
/// except those that couplings determine.
fn axes(model: &Model, links: &[usize]) -> Matrix {
    // row k: axis k of the shared frame in the link's axes
    let mut rows = [0, 1, 2].map(|k| {
        [0, 1, 2].map(|c| {
            if c == k {
                Number::one()
            } else {
                Number::zero()
            }
        })
    });
    let mut turn = |axis: usize, angle: &Number| {
        for row in &mut rows {
            *row = in_rotated_frame(row, axis, angle);
        }
    };
    for &link in links {
        let link = &model.links[link];
        for step in &link.placement {
            if let Step::Rotate(axis, angle) = step {
                turn(axis.index(), angle);
            }
        }
        if let Some(motion) = &link.motion
            && motion.kind == MotionKind::Rotation
        {
            turn(motion.axis.index(), &value(model, motion.coordinate, 0));
        }
    }
    rows
}

/// The value of a coordinate (rad or m) with all coordinates 0 except those that couplings
/// determine.
fn value(model: &Model, coordinate: usize, depth: usize) -> Number {
    let coupling = model.couplings.iter().find(|c| c.key == coordinate);
    // couplings have no cycles
    let Some(coupling) = coupling.filter(|_| depth <= model.couplings.len()) else {
        return Number::zero();
    };
    coupling
        .terms
        .iter()
        .fold(coupling.constant.clone(), |sum, (c, factor)| {
            sum.add(&factor.mul(&value(model, *c, depth + 1)))
        })
}

/// Null directions of two bodies with constant relative orientation `q`: inertia of body j minus
/// the same inertia on body i. First moments too if both bodies spin about axes at rest.
fn summed_moments(
    field: &mut Field,
    i: usize,
    j: usize,
    q: &Matrix,
    spin_equally: bool,
) -> Vec<Vector> {
    let mut all = Vec::new();
    for r in 0..3 {
        for c in r..3 {
            let mut direction = Vector::from([(10 * j + TENSOR_ENTRY[r][c], Element::one())]);
            // Q E Q^T for the symmetric unit E
            for a in 0..3 {
                for b in a..3 {
                    let mut entry = q[a][r].mul(&q[b][c]);
                    if r != c {
                        entry = entry.add(&q[a][c].mul(&q[b][r]));
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

fn subtract(field: &mut Field, from: &mut Vector, column: usize, entry: &Number) {
    let unit = Vector::from([(column, Element::one())]);
    add_scaled(field, from, &Element::exact(entry.neg()), &unit);
}

/// Null direction of two bodies that spin in a fixed proportion: the moments about their axes.
fn in_proportion(
    field: &mut Field,
    model: &Model,
    link_paths: &[LinkPath],
    velocity_constraints: &[LinearForm],
    pair: [usize; 2],
) -> Option<Vector> {
    let [i, j] = pair;
    let [a, b] = pair.map(|body| own_joint(model, link_paths, body));
    let (a, b) = (a?, b?);
    // qd_b = k qd_a
    let k = ratio(velocity_constraints, a, b)?;
    let moment = |body: usize, coordinate: usize| -> Option<usize> {
        let axis = model.motion(coordinate)?.axis.index();
        Some(10 * body + TENSOR_ENTRY[axis][axis])
    };
    let mut direction = Vector::from([(moment(j, b)?, Element::one())]);
    subtract(field, &mut direction, moment(i, a)?, &k.mul(&k));
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
fn ratio(velocity_constraints: &[LinearForm], a: usize, b: usize) -> Option<Number> {
    // eliminate all other coordinates, which leaves the constraint between a and b alone
    let mut rows: Vec<LinearForm> = velocity_constraints.to_vec();
    while let Some((r, outside)) = rows.iter().enumerate().find_map(|(r, row)| {
        let outside = row.iter().find(|(c, k)| *c != a && *c != b && !k.is_zero());
        outside.map(|(c, _)| (r, *c))
    }) {
        let pivot = rows.swap_remove(r);
        let pivot_coefficient = pivot.iter().find(|(c, _)| *c == outside)?.1.clone();
        for row in &mut rows {
            let Some(at) = row.iter().position(|(c, _)| *c == outside) else {
                continue;
            };
            let factor = row[at].1.div(&pivot_coefficient)?;
            for (c, k) in &pivot {
                let change = k.mul(&factor).neg();
                match row.iter_mut().find(|(o, _)| o == c) {
                    Some((_, sum)) => *sum = sum.add(&change),
                    None => row.push((*c, change)),
                }
            }
            row.retain(|(_, k)| !k.is_zero());
        }
    }
    let of = |row: &LinearForm, coordinate: usize| {
        row.iter()
            .find(|(c, _)| *c == coordinate)
            .map(|(_, k)| k.clone())
    };
    let found = rows
        .iter()
        .find_map(|row| Some((of(row, a)?, of(row, b)?)))?;
    let k = found.0.div(&found.1)?.neg();
    is_implied_by(velocity_constraints, &[(b, Number::one()), (a, k.neg())]).then_some(k)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_ratio_of_rates_follows_from_a_chain_of_constraints() {
        let n = Number::from_i64;
        // b = -2 a, c = 3 b
        let velocity_constraints = vec![vec![(1, n(1)), (0, n(2))], vec![(2, n(1)), (1, n(-3))]];
        assert_eq!(ratio(&velocity_constraints, 0, 2), Some(n(-6)));
        assert_eq!(ratio(&velocity_constraints, 0, 1), Some(n(-2)));
        assert_eq!(ratio(&velocity_constraints, 0, 3), None);
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
        let at = |name: &str| {
            let place = model.coordinates.iter().position(|c| c.name == name);
            value(&model, place.unwrap(), 0)
        };
        assert_eq!(at("q1"), Number::zero());
        assert_eq!(at("q2"), Number::ratio(1, 2).unwrap());
        // 1/4 - 2 (1/2)
        assert_eq!(at("q3"), Number::ratio(-3, 4).unwrap());
    }
}
