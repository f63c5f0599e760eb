//! The Coriolis matrix of the tree and the derivatives of its efforts (Echeandia and Wensing, 2021;
//! Singh, Russell and Wensing, 2022), with everything in the frames of the links.
//!
//! With the velocity field x' of a body's points x and a joint's unit twist s = (e, u), whose own
//! field is u + e x (x - O), the rate of that field at a point that moves along is (v x s) + e x x'.
//! So C_ij is the power on s_i of the forces that these rates require of all points that both joints
//! carry. The first part is inertial; the second needs of each body only the integrals P of x' dm
//! and G of x' (x - O)^T dm, which are added from the tips inward as inertias are.
//!
//! The derivative of the efforts by qd is 2 C, because C is symmetric in its two velocities. By q it
//! is, for a joint j that carries the joint i or is the same, with the turned twist t = v x s and
//! its rate t' = a x s + v x t:
//!
//! - d tau_i / dq_j = s_i . (2 B_i t_j + I_i t'_j)
//! - d tau_j / dq_i = s_j . (2 B_i t_i + I_i t'_i + s_i x* F_i)
//!
//! with the inertia I_i, the matrix B_i of P and G and the inertial wrench F_i of all that i carries.

use crate::kinematics::{Frames, LinkMotion, Rates, Twist};
use crate::model::{Model, ParameterKind};
use crate::sym::{Ex, Graph, M3, Number, SymbolId, V3, ZERO3, transposed};

use super::forces::{Inertial, Wrench, add_other_efforts, inertial_efforts};
use super::inertia::{accelerated, composite_inertias, sum};
use super::momentum::turned;

/// The derivatives of the tree's efforts, all over all coordinates, by row and column.
#[derive(Clone, Debug)]
pub struct TreeDerivatives {
    /// The efforts themselves, N m or N.
    pub efforts: Vec<Ex>,
    /// Their derivatives by the coordinates.
    pub by_q: Vec<Vec<Ex>>,
    /// Their derivatives by the velocities.
    pub by_qd: Vec<Vec<Ex>>,
    /// Their derivatives by the accelerations: the mass matrix.
    pub by_qdd: Vec<Vec<Ex>>,
}

/// The integrals over all that a link carries, in its frame about its origin.
#[derive(Clone, Copy, Debug)]
struct Flow {
    /// The integral of x' dm, kg m/s.
    momentum: V3,
    /// tr(G) 1 - G with the integral G of x' (x - O)^T dm, kg m^2/s: times e, the moment of e x x'.
    moment: M3,
}

impl Flow {
    const ZERO: Flow = Flow {
        momentum: ZERO3,
        moment: [ZERO3; 3],
    };

    /// The flow of a body with these parameters.
    fn of_body(g: &mut Graph, body: &Inertial, velocity: &LinkMotion) -> Self {
        let (w, v) = (&velocity.alpha, &velocity.a);
        let straight = g.scale3(body.mass, v);
        let swing = g.cross(w, &body.moment);
        let [xx, xy, xz, yy, yz, zz] = body.tensor;
        // G = v h^T + (w x)(tr(I)/2 - I), with the first moments h; (w x) and w x I have no trace
        let trace = g.add(xx, yy);
        let trace = g.add(trace, zz);
        let half = Number::ratio(1, 2).map_or(Ex::ONE, |half| g.constant(half));
        let trace = g.mul(half, trace);
        let columns = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let mut unit = [ZERO3; 3];
        for (axis, row) in unit.iter_mut().enumerate() {
            row[axis] = trace;
        }
        let mut moment = [ZERO3; 3];
        for (k, (column, unit)) in columns.iter().zip(&unit).enumerate() {
            let rest = g.sub3(column, unit);
            let column = g.cross(w, &rest);
            for (row, entry) in moment.iter_mut().zip(column) {
                row[k] = entry;
            }
        }
        let moment = less_outer(g, &moment, v, &body.moment);
        Flow {
            momentum: g.add3(&straight, &swing),
            moment,
        }
    }

    fn plus(&self, g: &mut Graph, other: &Flow) -> Flow {
        let mut moment = self.moment;
        for (row, more) in moment.iter_mut().zip(&other.moment) {
            *row = g.add3(row, more);
        }
        Flow {
            momentum: g.add3(&self.momentum, &other.momentum),
            moment,
        }
    }

    /// The same about the parent's origin, in the parent's frame.
    fn on_parent(&self, g: &mut Graph, frames: &Frames, link: usize) -> Flow {
        let half = transposed(&self.moment);
        let half = half.map(|column| frames.into_parent(g, link, &column));
        let rotated = transposed(&half).map(|row| frames.into_parent(g, link, &row));
        let momentum = frames.into_parent(g, link, &self.momentum);
        let moment = less_outer(g, &rotated, &momentum, &frames.links[link].offset);
        Flow { momentum, moment }
    }

    /// The wrench of e x x' at all points.
    fn turned_by(&self, g: &mut Graph, e: &V3) -> Wrench {
        Wrench {
            moment: g.mul_mv(&self.moment, e),
            force: g.cross(e, &self.momentum),
        }
    }

    /// The vector whose product with any e is the power of [`Flow::turned_by`] e on a twist.
    fn power_on(&self, g: &mut Graph, twist: &Twist) -> V3 {
        let about = g.mul_mv(&transposed(&self.moment), &twist.e);
        let along = g.cross(&self.momentum, &twist.u);
        g.add3(&about, &along)
    }
}

/// `m + (a . b) 1 - a b^T`.
fn less_outer(g: &mut Graph, m: &M3, a: &V3, b: &V3) -> M3 {
    let mut out = *m;
    for (i, row) in out.iter_mut().enumerate() {
        for (k, entry) in row.iter_mut().enumerate() {
            if i == k {
                // the trace less the entry on the diagonal: the other two
                let (p, q) = ((i + 1) % 3, (i + 2) % 3);
                let first = g.mul(a[p], b[p]);
                let second = g.mul(a[q], b[q]);
                let both = g.add(first, second);
                *entry = g.add(*entry, both);
            } else {
                let product = g.mul(a[i], b[k]);
                *entry = g.sub(*entry, product);
            }
        }
    }
    out
}

/// By link, the inertias and flows of all that it carries.
fn composites(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    velocities: &[LinkMotion],
    phi: &[Ex],
) -> (Vec<Inertial>, Vec<Flow>) {
    let links = frames.links.len();
    let mut own = vec![None; links];
    for (index, body) in model.bodies.iter().enumerate() {
        let inertial = Inertial::of_body(index, phi);
        own[body.link] = Some(match &own[body.link] {
            Some(others) => sum(g, others, &inertial),
            None => inertial,
        });
    }
    let mut flows = vec![Flow::ZERO; links];
    for (link, inertial) in own.iter().enumerate() {
        if let Some(inertial) = inertial {
            flows[link] = Flow::of_body(g, inertial, &velocities[link]);
        }
    }
    for link in (0..links).rev() {
        if let Some(parent) = frames.links[link].parent {
            let carried = flows[link].on_parent(g, frames, link);
            flows[parent] = flows[parent].plus(g, &carried);
        }
    }
    (composite_inertias(g, frames, model, phi), flows)
}

/// Matrices over all coordinates, by row and column.
struct Sweep {
    coriolis: Vec<Vec<Ex>>,
    /// Without rotors.
    mass: Vec<Vec<Ex>>,
    /// The derivatives of the inertial efforts by the coordinates; zero if they are not wanted.
    by_q: Vec<Vec<Ex>>,
}

/// Carries what each joint's motion does to the links that it moves inward to the other joints.
///
/// - `of_slopes`: the rates of the turned twists and the inertial wrenches by link, for `by_q`.
fn sweep(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    velocities: &[LinkMotion],
    phi: &[Ex],
    of_slopes: Option<(&[LinkMotion], &[Wrench])>,
) -> Sweep {
    let n = model.coordinates.len();
    let (inertias, flows) = composites(g, frames, model, velocities, phi);
    let turned = by_joint(frames, |link, twist| turned(g, &velocities[link], twist));
    let turning = of_slopes.map(|(motions, _)| {
        by_joint(frames, |link, twist| {
            let moving = [&motions[link], &velocities[link]];
            rate_of_turned(g, moving, twist, &turned[link])
        })
    });
    let zero = vec![vec![Ex::ZERO; n]; n];
    let (mut coriolis, mut mass, mut by_q) = (zero.clone(), zero.clone(), zero);
    for (start, frame) in frames.links.iter().enumerate() {
        let Some(joint) = frame.joint else { continue };
        let (row, own) = (joint.coordinate, &joint.twist);
        let (inertia, flow) = (&inertias[start], &flows[start]);
        let mut pushed = accelerated(g, inertia, own);
        let mut swept = flow.power_on(g, own);
        // B s + I t
        let along = accelerated(g, inertia, &turned[start]);
        let mut rate = flow.turned_by(g, &own.e).plus(g, &along);
        // 2 B t + I t' + s x* F
        let mut slope = Wrench::ZERO;
        if let (Some(turning), Some((_, forces))) = (&turning, of_slopes) {
            let half = flow.turned_by(g, &turned[start].e);
            let along = accelerated(g, inertia, &turning[start]);
            let crossed = crossed(g, own, &forces[start]);
            slope = half.plus(g, &half).plus(g, &along).plus(g, &crossed);
        }
        let inward = std::iter::successors(Some(start), |at| frames.links[*at].parent);
        for link in inward {
            if let Some(other) = frames.links[link].joint {
                let column = other.coordinate;
                let entry = pushed.along(g, &other.twist);
                mass[row][column] = entry;
                mass[column][row] = entry;
                coriolis[column][row] = rate.along(g, &other.twist);
                by_q[column][row] = slope.along(g, &other.twist);
                if link != start {
                    let inertial = pushed.along(g, &turned[link]);
                    let carried = g.dot3(&swept, &other.twist.e);
                    coriolis[row][column] = g.add(inertial, carried);
                }
                if let (true, Some(turning)) = (link != start, &turning) {
                    let inertial = pushed.along(g, &turning[link]);
                    let carried = g.dot3(&swept, &turned[link].e);
                    let carried = g.add(carried, carried);
                    by_q[row][column] = g.add(inertial, carried);
                }
            }
            pushed = pushed.on_parent(g, frames, link);
            rate = rate.on_parent(g, frames, link);
            if turning.is_some() {
                slope = slope.on_parent(g, frames, link);
            }
            swept = frames.into_parent(g, link, &swept);
        }
    }
    Sweep {
        coriolis,
        mass,
        by_q,
    }
}

/// s x* F: how a wrench changes that moves along with a twist.
fn crossed(g: &mut Graph, s: &Twist, wrench: &Wrench) -> Wrench {
    let about = g.cross(&s.e, &wrench.moment);
    let lever = g.cross(&s.u, &wrench.force);
    Wrench {
        moment: g.add3(&about, &lever),
        force: g.cross(&s.e, &wrench.force),
    }
}

/// By link, a twist made of its joint's unit twist; zero without a joint.
fn by_joint(frames: &Frames, mut of: impl FnMut(usize, &Twist) -> Twist) -> Vec<Twist> {
    let links = frames.links.iter().enumerate();
    links
        .map(|(link, frame)| match &frame.joint {
            Some(joint) => of(link, &joint.twist),
            None => Twist { e: ZERO3, u: ZERO3 },
        })
        .collect()
}

/// Adds the rotors' inertias to the diagonal of a mass matrix.
fn add_rotors(g: &mut Graph, model: &Model, phi: &[Ex], mass: &mut [Vec<Ex>]) {
    for (parameter, value) in model.parameters.iter().zip(phi) {
        if let ParameterKind::Rotor { coordinate } = parameter.kind {
            let entry = mass[coordinate][coordinate];
            mass[coordinate][coordinate] = g.add(entry, *value);
        }
    }
}

/// The Coriolis matrix C and the mass matrix M of the tree over all coordinates: C qd are the
/// Coriolis and centrifugal efforts, and dM/dt - 2 C is skew-symmetric.
///
/// - `velocities`: the links' motions at [`velocities_as_accelerations`](super::velocities_as_accelerations).
pub fn coriolis_and_mass(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    velocities: &[LinkMotion],
    phi: &[Ex],
) -> [Vec<Vec<Ex>>; 2] {
    let Sweep {
        coriolis, mut mass, ..
    } = sweep(g, frames, model, velocities, phi, None);
    add_rotors(g, model, phi, &mut mass);
    [coriolis, mass]
}

/// The rate of a joint's turned twist: (eta e, eta u + a x e + 2 v x (w x e)) with eta tilde and the
/// acceleration a of the link's origin less gravity.
fn rate_of_turned(
    g: &mut Graph,
    [motion, velocity]: [&LinkMotion; 2],
    s: &Twist,
    turned: &Twist,
) -> Twist {
    let e = g.mul_mv(&motion.eta, &s.e);
    let along = g.mul_mv(&motion.eta, &s.u);
    let lever = g.cross(&motion.a, &s.e);
    let swing = g.cross(&velocity.a, &turned.e);
    let sum = g.add3(&along, &lever);
    let twice = g.add3(&swing, &swing);
    Twist {
        e,
        u: g.add3(&sum, &twice),
    }
}

/// The efforts of the tree and their derivatives; friction, offsets, rotors, springs and effort
/// terms included. Where friction jumps, its derivative by the velocity is that on both sides.
///
/// - `motions`: the links' motions, with gravity; `velocities`: those at
///   [`velocities_as_accelerations`](super::velocities_as_accelerations);
/// - `rates`: the rates of `motions`; `symbols`: the symbols of q and qd by coordinate.
pub fn tree_derivatives(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    [motions, velocities]: [&[LinkMotion]; 2],
    rates: &Rates,
    symbols: [&[SymbolId]; 2],
    phi: &[Ex],
) -> TreeDerivatives {
    let (mut efforts, forces) = inertial_efforts(g, frames, model, motions, phi);
    let Sweep {
        coriolis,
        mass: mut by_qdd,
        mut by_q,
    } = sweep(g, frames, model, velocities, phi, Some((motions, &forces)));
    add_rotors(g, model, phi, &mut by_qdd);
    let rows = coriolis.into_iter();
    let mut by_qd: Vec<Vec<Ex>> = rows
        .map(|row| row.into_iter().map(|entry| g.add(entry, entry)).collect())
        .collect();
    // of these efforts only the rotors' depend on accelerations, and on nothing else
    let still = Rates {
        qdd: vec![Ex::ZERO; efforts.len()],
        ..rates.clone()
    };
    let mut others = vec![Ex::ZERO; efforts.len()];
    add_other_efforts(g, frames, model, &still, phi, &mut others);
    for (symbols, slopes) in symbols.into_iter().zip([&mut by_q, &mut by_qd]) {
        for (column, symbol) in symbols.iter().enumerate() {
            let own = g.directional(&others, &[(*symbol, Ex::ONE)]);
            for (row, slope) in slopes.iter_mut().zip(own) {
                row[column] = g.add(row[column], slope);
            }
        }
    }
    add_other_efforts(g, frames, model, rates, phi, &mut efforts);
    TreeDerivatives {
        efforts,
        by_q,
        by_qd,
        by_qdd,
    }
}
