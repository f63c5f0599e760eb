//! Functions of the frames that the description names: poses, Jacobians and their rates, in the
//! world.

use crate::constraints::View;
use crate::kinematics::{Rates, Start};
use crate::sym::{Ex, transposed};

use super::closure::{all_accelerations, rates_without_qdd};
use super::dynamics::reduction;
use super::{Context, Groups, group};

/// The frames with their names, seen from the world.
fn views(cx: &mut Context<'_>, rates: Option<&Rates>) -> Vec<(String, View)> {
    let frames = cx.model.frames.iter();
    frames
        .map(|frame| {
            let path = cx.model.path(frame.side.link);
            let start = Start::own();
            let view = View::along(cx.g, cx.frames, &path, &frame.side, &start, rates);
            (format!("frame {}", frame.name), view)
        })
        .collect()
}

pub(super) fn pose(cx: &mut Context<'_>) -> Groups {
    let views = views(cx, None).into_iter();
    views
        .map(|(title, view)| {
            let mut values = transposed(&view.axes).concat();
            values.extend(view.point);
            group(title, values)
        })
        .collect()
}

/// The velocity of the frame's origin and its angular velocity, by coordinate.
fn columns(cx: &mut Context<'_>, view: &View) -> Vec<(usize, [Ex; 6])> {
    let columns = view.columns.iter();
    columns
        .map(|(coordinate, column)| {
            let [x, y, z] = column.at(cx.g, &view.point);
            let [rx, ry, rz] = column.angular();
            (*coordinate, [x, y, z, rx, ry, rz])
        })
        .collect()
}

pub(super) fn jacobian(cx: &mut Context<'_>) -> Groups {
    let j = reduction(cx);
    let mut groups = Vec::new();
    for (title, view) in views(cx, None) {
        let columns = columns(cx, &view);
        let mut values = Vec::with_capacity(6 * j.width());
        for axis in 0..6 {
            for i in 0..j.width() {
                let mut sum = Ex::ZERO;
                for (coordinate, column) in &columns {
                    let term = cx.g.mul(j.at(*coordinate, i), column[axis]);
                    sum = cx.g.add(sum, term);
                }
                values.push(sum);
            }
        }
        groups.push(group(title, values));
    }
    groups
}

pub(super) fn jacobian_rate(cx: &mut Context<'_>) -> Groups {
    let qd = cx.symbols.qd_nodes(cx.g);
    let rates = rates_without_qdd(qd.clone(), qd);
    let still = vec![Ex::ZERO; cx.model.independent.len()];
    let qdd = all_accelerations(cx, &still, &rates);
    let mut groups = Vec::new();
    for (title, view) in views(cx, Some(&rates)) {
        let mut values = [view.a, view.alpha].concat();
        for (coordinate, column) in columns(cx, &view) {
            for (value, entry) in values.iter_mut().zip(column) {
                let term = cx.g.mul(qdd[coordinate], entry);
                *value = cx.g.add(*value, term);
            }
        }
        groups.push(group(title, values));
    }
    groups
}
