//! The mass matrix of the tree by composite inertias, accumulated from the tips inward.

use crate::kinematics::{Frames, Twist};
use crate::model::{Model, ParameterKind};
use crate::sym::{Ex, Graph, transposed};

use super::forces::{Inertial, Wrench};

/// The mass matrix M over all coordinates, with the rotor inertias on its diagonal; n by n.
pub fn mass_matrix(g: &mut Graph, frames: &Frames, model: &Model, phi: &[Ex]) -> Vec<Vec<Ex>> {
    let n = model.coordinates.len();
    let composite = composite_inertias(g, frames, model, phi);
    let mut matrix = vec![vec![Ex::ZERO; n]; n];
    for (start, inertia) in composite.iter().enumerate() {
        let Some(joint) = frames.links[start].joint else {
            continue;
        };
        let coordinate = joint.coordinate;
        let mut wrench = accelerated(g, inertia, &joint.twist);
        let mut link = start;
        loop {
            if let Some(other) = frames.links[link].joint {
                let entry = wrench.along(g, &other.twist);
                matrix[coordinate][other.coordinate] = entry;
                matrix[other.coordinate][coordinate] = entry;
            }
            let Some(parent) = frames.links[link].parent else {
                break;
            };
            wrench = wrench.on_parent(g, frames, link);
            link = parent;
        }
    }
    for (parameter, value) in model.parameters.iter().zip(phi) {
        if let ParameterKind::Rotor { coordinate } = parameter.kind {
            let entry = matrix[coordinate][coordinate];
            matrix[coordinate][coordinate] = g.add(entry, *value);
        }
    }
    matrix
}

/// By link, the parameters of the link and of all that it carries as one rigid body.
pub(super) fn composite_inertias(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    phi: &[Ex],
) -> Vec<Inertial> {
    let mut composite = vec![Inertial::ZERO; frames.links.len()];
    for (index, body) in model.bodies.iter().enumerate() {
        let own = Inertial::of_body(index, phi);
        composite[body.link] = sum(g, &composite[body.link], &own);
    }
    for link in (0..frames.links.len()).rev() {
        if let Some(parent) = frames.links[link].parent {
            let carried = on_parent(g, frames, link, &composite[link]);
            composite[parent] = sum(g, &composite[parent], &carried);
        }
    }
    composite
}

/// The wrench that gives the composite body the acceleration of a twist.
pub(super) fn accelerated(g: &mut Graph, inertia: &Inertial, Twist { e, u }: &Twist) -> Wrench {
    let turned = Wrench {
        moment: inertia.tensor_times(g, e),
        force: g.cross(e, &inertia.moment),
    };
    let slid = Wrench {
        moment: g.cross(&inertia.moment, u),
        force: g.scale3(inertia.mass, u),
    };
    turned.plus(g, &slid)
}

pub(super) fn sum(g: &mut Graph, a: &Inertial, b: &Inertial) -> Inertial {
    let mut tensor = a.tensor;
    for (x, y) in tensor.iter_mut().zip(&b.tensor) {
        *x = g.add(*x, *y);
    }
    Inertial {
        tensor,
        moment: g.add3(&a.moment, &b.moment),
        mass: g.add(a.mass, b.mass),
    }
}

/// The parameters about the parent's origin, in the parent's frame (parallel axis theorem).
fn on_parent(g: &mut Graph, frames: &Frames, link: usize, inertia: &Inertial) -> Inertial {
    let [xx, xy, xz, yy, yz, zz] = inertia.tensor;
    let columns = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    // R I R^T: rotate the columns first, then the rows
    let half = columns.map(|column| frames.into_parent(g, link, &column));
    let full = transposed(&half).map(|row| frames.into_parent(g, link, &row));
    let h = frames.into_parent(g, link, &inertia.moment);
    let p = frames.links[link].offset;
    // about the parent's origin: + (2 p.h + m p.p) 1 - (p h^T + h p^T + m p p^T)
    let shifted = g.add_scaled3(&h, inertia.mass, &p);
    let mut entry = |i: usize, j: usize| {
        let one = g.mul(p[i], shifted[j]);
        let two = g.mul(h[i], p[j]);
        let outer = g.add(one, two);
        g.sub(full[i][j], outer)
    };
    let mut tensor = [
        entry(0, 0),
        entry(0, 1),
        entry(0, 2),
        entry(1, 1),
        entry(1, 2),
        entry(2, 2),
    ];
    let one = g.dot3(&p, &shifted);
    let two = g.dot3(&p, &h);
    let trace = g.add(one, two);
    for diagonal in [0, 3, 5] {
        tensor[diagonal] = g.add(tensor[diagonal], trace);
    }
    Inertial {
        tensor,
        moment: shifted,
        mass: inertia.mass,
    }
}
