//! Kinematic functions: closure equations, dependent rates, poses, swing angles.

use crate::constraints::{View, world_equations};
use crate::kinematics::{Chain, Rates, Start};
use crate::model::Side;
use crate::sym::Ex;

use super::{Context, Groups, group};

/// Rates with zero accelerations of the coordinates and without gravity.
pub(super) fn rates_without_qdd(qd: Vec<Ex>, rd: Vec<Ex>) -> Rates {
    Rates {
        qdd: vec![Ex::ZERO; qd.len()],
        qd,
        rd,
        gravity: false,
    }
}

pub(super) fn constraints(cx: &mut Context<'_>) -> Groups {
    let f = world_equations(cx.g, cx.frames, cx.model, None).residual;
    vec![group("f (Eq. 6)", f)]
}

pub(super) fn jacobian(cx: &mut Context<'_>) -> Groups {
    let rows = world_equations(cx.g, cx.frames, cx.model, None).jacobian;
    let rows = rows.into_iter().enumerate();
    rows.map(|(i, row)| group(format!("row {}", i + 1), row))
        .collect()
}

pub(super) fn bias(cx: &mut Context<'_>) -> Groups {
    let qd = cx.symbols.qd_nodes(cx.g);
    let rates = rates_without_qdd(qd.clone(), qd);
    let b = world_equations(cx.g, cx.frames, cx.model, Some(&rates)).bias;
    vec![group("b (Eq. 7)", b)]
}

pub(super) fn newton_step(cx: &mut Context<'_>) -> Option<Groups> {
    let closure = cx.closed.closure.as_ref()?;
    let f = closure.residual(cx.g, cx.frames, cx.model);
    let rhs: Vec<Vec<Ex>> = f.iter().map(|e| vec![cx.g.neg(*e)]).collect();
    let step = closure.solve(cx.g, cx.model, &rhs);
    let step: Vec<Ex> = step.into_iter().flatten().collect();
    Some(vec![group("A_e dq_e = -f", step)])
}

pub(super) fn dependent_jacobian(cx: &mut Context<'_>) -> Option<Groups> {
    let closure = cx.closed.closure.as_ref()?;
    let rows = closure.dependent_jacobian(cx.model);
    let entries = rows.into_iter().flatten().collect();
    Some(vec![group("A_e (Eq. 8)", entries)])
}

/// All velocities from the independent ones: `A_e qd_e = -A_i qd_i`.
pub(super) fn all_velocities(cx: &mut Context<'_>, independent: &[Ex]) -> Vec<Ex> {
    let zero = vec![Ex::ZERO; cx.model.coordinates.len()];
    all_rates(cx, independent, &zero, None)
}

/// All accelerations from the independent ones: `A_e qdd_e = b - A_i qdd_i`, with the bias as a
/// symmetric bilinear form of both velocities of `rates`.
pub(super) fn all_accelerations(
    cx: &mut Context<'_>,
    independent: &[Ex],
    rates: &Rates,
) -> Vec<Ex> {
    let zero = vec![Ex::ZERO; cx.model.coordinates.len()];
    all_rates(cx, independent, &zero, Some(rates))
}

fn all_rates(
    cx: &mut Context<'_>,
    independent: &[Ex],
    start: &[Ex],
    rates: Option<&Rates>,
) -> Vec<Ex> {
    let mut all = start.to_vec();
    for (c, value) in cx.model.independent.iter().zip(independent) {
        all[*c] = *value;
    }
    let Some(closure) = &cx.closed.closure else {
        return all;
    };
    let mut rhs = closure.independent_part(cx.g, cx.model, independent);
    if let Some(rates) = rates {
        let bias = closure.bias(cx.g, cx.frames, cx.model, rates);
        for (entry, b) in rhs.iter_mut().zip(bias) {
            *entry = cx.g.add(*entry, b);
        }
    }
    let rhs: Vec<Vec<Ex>> = rhs.into_iter().map(|e| vec![e]).collect();
    let solution = closure.solve(cx.g, cx.model, &rhs);
    for (c, value) in cx.model.dependent.iter().zip(solution.iter().flatten()) {
        all[*c] = *value;
    }
    all
}

pub(super) fn velocities(cx: &mut Context<'_>) -> Groups {
    let qd = cx.symbols.qd_nodes(cx.g);
    let independent: Vec<Ex> = cx.model.independent.iter().map(|c| qd[*c]).collect();
    let all = all_velocities(cx, &independent);
    vec![group("A_e qd_e = -A_i qd_i (Eq. 8)", all)]
}

pub(super) fn accelerations(cx: &mut Context<'_>) -> Groups {
    let qd = cx.symbols.qd_nodes(cx.g);
    let qdd = cx.symbols.qdd_nodes(cx.g);
    let independent: Vec<Ex> = cx.model.independent.iter().map(|c| qdd[*c]).collect();
    let rates = rates_without_qdd(qd.clone(), qd);
    let all = all_accelerations(cx, &independent, &rates);
    vec![group("A_e qdd_e = b - A_i qdd_i (Eq. 8)", all)]
}

pub(super) fn poses(cx: &mut Context<'_>) -> Groups {
    let mut groups = Vec::new();
    for body in &cx.model.bodies {
        let path = cx.model.path(Some(body.link));
        let chain = Chain::follow(cx.g, cx.frames, &path, &Start::own(), None);
        let mut values: Vec<Ex> = chain.rotation.into_iter().flatten().collect();
        values.extend(chain.origin);
        groups.push(group(format!("body {}", body.label), values));
    }
    groups
}

/// The cosines of the swing angles that are limited.
pub(super) fn cones(cx: &mut Context<'_>) -> Groups {
    let mut groups = Vec::new();
    for cone in &cx.model.cones {
        let [a, b] = &cone.sides;
        let (path_a, path_b) = (cx.model.path(a.link), cx.model.path(b.link));
        // both axes are expressed in the frame of the last link that both sides are mounted on
        let shared = path_a.iter().zip(&path_b).take_while(|(x, y)| x == y);
        let shared = shared.count();
        let mut axis = |path: &[usize], side: &Side| {
            let own = &path[shared..];
            View::along(cx.g, cx.frames, own, side, &Start::own(), None).axes[2]
        };
        let (z_a, z_b) = (axis(&path_a, a), axis(&path_b, b));
        let cosine = cx.g.dot3(&z_a, &z_b);
        groups.push(group(format!("cone of {}", cone.name), vec![cosine]));
    }
    groups
}
