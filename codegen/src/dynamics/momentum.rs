//! The generalised momentum p = dT/dqd, with the kinetic energy T(q, qd), and the slopes dT/dq, from
//! which the rate of p follows without accelerations (De Luca and Mattone, 2005).
//!
//! A link whose joint has the unit twist s moves with the twist v = s qd + (the parent's). Where q
//! grows, the parent's twist seen from the link changes by v x s, and the motion beyond the joint
//! stays the same. So p is the power of the momentum of all that a joint carries on s, and dT/dq its
//! power on the *turned* twist v x s.

use crate::kinematics::{Frames, LinkMotion, Rates, Twist, carried_outward};
use crate::model::{Model, ParameterKind};
use crate::sym::{Ex, Graph, ZERO3};

use super::Reduction;
use super::forces::{add_other_efforts, inertial_efforts};
use super::regressor::{InertiaWrench, TreeKinematics, reduced_regressor};

/// The momentum of the tree over all coordinates.
#[derive(Clone, Debug)]
pub struct Momentum {
    /// p = M qd over all coordinates, kg m^2/s or kg m/s.
    pub p: Vec<Ex>,
    /// dT/dq less the efforts that no motion causes or that resist it: gravity, springs, offsets,
    /// friction and effort terms, N m or N.
    pub rate: Vec<Ex>,
}

/// The rates at which accelerations are velocities: a motion with these has the links' velocities as
/// `alpha` and `a`.
pub fn velocities_as_accelerations(qd: &[Ex]) -> Rates {
    let still = vec![Ex::ZERO; qd.len()];
    Rates {
        qd: still.clone(),
        rd: still,
        qdd: qd.to_vec(),
        gravity: false,
    }
}

/// The twist v x s of a link that moves with v, in the link's frame; s is its joint's unit twist.
pub(super) fn turned(g: &mut Graph, velocity: &LinkMotion, s: &Twist) -> Twist {
    let (w, v) = (&velocity.alpha, &velocity.a);
    let along = g.cross(w, &s.u);
    let about = g.cross(v, &s.e);
    Twist {
        e: g.cross(w, &s.e),
        u: g.add3(&along, &about),
    }
}

/// The momentum of the tree and its rate.
///
/// - `velocities`: the links' motions at [`velocities_as_accelerations`];
/// - `rest`: their motions at rest, with gravity;
/// - `rates`: the velocities with gravity, without accelerations.
pub fn momentum(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    [velocities, rest]: [&[LinkMotion]; 2],
    rates: &Rates,
    phi: &[Ex],
) -> Momentum {
    let (mut p, momenta) = inertial_efforts(g, frames, model, velocities, phi);
    let mut turned_power = vec![Ex::ZERO; p.len()];
    for ((frame, momentum), velocity) in frames.links.iter().zip(&momenta).zip(velocities) {
        if let Some(joint) = frame.joint {
            let turned = turned(g, velocity, &joint.twist);
            turned_power[joint.coordinate] = momentum.along(g, &turned);
        }
    }
    for (parameter, value) in model.parameters.iter().zip(phi) {
        if let ParameterKind::Rotor { coordinate } = parameter.kind {
            let own = g.mul(*value, rates.qd[coordinate]);
            p[coordinate] = g.add(p[coordinate], own);
        }
    }
    let (mut resisting, _) = inertial_efforts(g, frames, model, rest, phi);
    add_other_efforts(g, frames, model, rates, phi, &mut resisting);
    let pairs = turned_power.into_iter().zip(resisting);
    let rate = pairs.map(|(power, effort)| g.sub(power, effort)).collect();
    Momentum { p, rate }
}

/// The regressor of the momentum's rate, one column per parameter with one entry per independent
/// coordinate.
///
/// - `velocities`, `rest`, `rates`: as in [`momentum`];
/// - `j_rate`: the rate of J by coordinate and independent one.
pub fn momentum_rate_columns(
    g: &mut Graph,
    model: &Model,
    tree: &TreeKinematics<'_>,
    [velocities, rest]: [&[LinkMotion]; 2],
    rates: &Rates,
    (j, j_rate): (&Reduction, &[Vec<Ex>]),
) -> Vec<Vec<Ex>> {
    let width = j.width();
    let wanted = vec![true; model.parameters.len()];
    let resisting = reduced_regressor(g, model, rest, tree, rates, j, &wanted);
    let turned = carried_outward(g, tree.frames, |g, link, twist| {
        turned(g, &velocities[link], twist)
    });
    let by_independent: Vec<Vec<Ex>> = (0..width)
        .map(|i| j_rate.iter().map(|row| row[i]).collect())
        .collect();
    let mut kinetic = Vec::with_capacity(model.parameters.len());
    for body in &model.bodies {
        let wrench = InertiaWrench::new(g, &velocities[body.link]);
        let mut rows = Vec::with_capacity(width);
        for (i, j_rate) in by_independent.iter().enumerate() {
            // the rate of the body's twist per unit of the independent coordinate
            let mut sum = Twist { e: ZERO3, u: ZERO3 };
            let own = tree.twists[body.link].iter().zip(&turned[body.link]);
            for ((coordinate, twist), (_, turned)) in own {
                let parts = [(j.at(*coordinate, i), turned), (j_rate[*coordinate], twist)];
                for (weight, part) in parts {
                    sum.e = g.add_scaled3(&sum.e, weight, &part.e);
                    sum.u = g.add_scaled3(&sum.u, weight, &part.u);
                }
            }
            rows.push(wrench.row(g, &sum));
        }
        for entry in 0..10 {
            kinetic.push(rows.iter().map(|row| row[entry]).collect::<Vec<_>>());
        }
    }
    for parameter in model.parameters.iter().skip(kinetic.len()) {
        let column = (0..width).map(|i| match parameter.kind {
            ParameterKind::Rotor { coordinate } => {
                g.mul(rates.qd[coordinate], j_rate[coordinate][i])
            }
            _ => Ex::ZERO,
        });
        kinetic.push(column.collect());
    }
    let columns = kinetic.into_iter().zip(resisting);
    columns
        .map(|(kinetic, resisting)| {
            let entries = kinetic.into_iter().zip(resisting);
            entries.map(|(k, r)| g.sub(k, r)).collect()
        })
        .collect()
}
