//! The equations of a cut, row by row.

use crate::kinematics::{Frames, Rates, Start, turned_twice};
use crate::model::{Cut, Model};
use crate::spec::CutKind;
use crate::sym::{Ex, Graph, V3};

use super::view::View;

/// One equation of a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Row {
    /// A component of pB - pA in the observing frame.
    Position(usize),
    /// An axis of A against an axis of B.
    Axes(usize, usize),
    /// An axis of A against pB - pA.
    Offset(usize),
}

/// The rows of a cut, in the spec's order.
fn rows_of(kind: CutKind) -> &'static [Row] {
    use Row::{Axes, Offset, Position};
    const X: usize = 0;
    const Y: usize = 1;
    const Z: usize = 2;
    match kind {
        CutKind::Spherical => &[Position(X), Position(Y), Position(Z)],
        CutKind::Universal => &[Position(X), Position(Y), Position(Z), Axes(X, Y)],
        CutKind::Revolute => &[
            Position(X),
            Position(Y),
            Position(Z),
            Axes(X, Z),
            Axes(Y, Z),
        ],
        CutKind::Cylindrical => &[Axes(X, Z), Axes(Y, Z), Offset(X), Offset(Y)],
        CutKind::Prismatic => &[Offset(X), Offset(Y), Axes(X, Y), Axes(X, Z), Axes(Y, Z)],
        CutKind::Fixed => &[
            Position(X),
            Position(Y),
            Position(Z),
            Axes(X, Y),
            Axes(X, Z),
            Axes(Y, Z),
        ],
    }
}

/// Which rows of a cut are lengths; the others are cosines.
pub(super) fn lengths_of(kind: CutKind) -> impl Iterator<Item = bool> {
    rows_of(kind)
        .iter()
        .map(|row| !matches!(row, Row::Axes(..)))
}

/// Which form of the rows is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The exact derivatives of the rows, also off the closure.
    Exact,
    /// Equal to them on the closure, and simpler: there the axes that a cut
    /// holds together are one.
    OnClosure,
}

/// The closure equations of a mechanism in some frame of observation.
#[derive(Clone, Debug, Default)]
pub struct Equations {
    /// f of Eq. 6.
    pub residual: Vec<Ex>,
    /// A of Eq. 7, over all coordinates.
    pub jacobian: Vec<Vec<Ex>>,
    /// b of Eq. 7; empty where no rates were given.
    pub bias: Vec<Ex>,
}

impl Equations {
    /// Adds the rows of another set.
    pub fn extend(&mut self, other: Equations) {
        self.residual.extend(other.residual);
        self.jacobian.extend(other.jacobian);
        self.bias.extend(other.bias);
    }
}

/// The rows of one cut from its two sides, both seen from the same frame.
pub(super) fn cut_equations(
    g: &mut Graph,
    coordinates: usize,
    kind: CutKind,
    a: &View,
    b: &View,
    form: Form,
    with_bias: bool,
) -> Equations {
    let mut equations = Equations::default();
    let gap = g.sub3(&b.point, &a.point);
    for row in rows_of(kind) {
        let mut jacobian = vec![Ex::ZERO; coordinates];
        let sides = [(a, true), (b, false)];
        let residual = match *row {
            Row::Position(i) => gap[i],
            Row::Axes(i, j) => g.dot3(&a.axes[i], &b.axes[j]),
            Row::Offset(i) => g.dot3(&a.axes[i], &gap),
        };
        for (side, negative) in sides {
            for (coordinate, column) in &side.columns {
                let entry = match *row {
                    Row::Position(i) => column.at(g, &side.point)[i],
                    Row::Axes(i, j) => {
                        let normal = normal(g, kind, a, b, (i, j), form);
                        g.dot3(&normal, &column.angular())
                    }
                    // the point of either side that is at pB just now
                    Row::Offset(i) => {
                        let velocity = column.at(g, &b.point);
                        g.dot3(&a.axes[i], &velocity)
                    }
                };
                let sum = if negative {
                    g.sub(jacobian[*coordinate], entry)
                } else {
                    g.add(jacobian[*coordinate], entry)
                };
                jacobian[*coordinate] = sum;
            }
        }
        equations.residual.push(residual);
        equations.jacobian.push(jacobian);
        if with_bias {
            let second = match *row {
                Row::Position(i) => g.sub(b.a[i], a.a[i]),
                Row::Offset(i) => {
                    let rates = (g.sub3(&b.v, &a.v), g.sub3(&b.vr, &a.vr));
                    let acceleration = g.sub3(&b.a, &a.a);
                    product_rule(g, a, i, &gap, &rates, &acceleration)
                }
                Row::Axes(i, j) if form == Form::Exact || !is_aligned(kind) => {
                    let v = b.axes[j];
                    let rates = (g.cross(&b.w, &v), g.cross(&b.wr, &v));
                    let turned = turned_twice(g, &b.w, &b.wr, &v);
                    let tangential = g.cross(&b.alpha, &v);
                    let acceleration = g.add3(&tangential, &turned);
                    product_rule(g, a, i, &v, &rates, &acceleration)
                }
                Row::Axes(i, j) => aligned_second(g, kind, a, b, (i, j)),
            };
            equations.bias.push(g.neg(second));
        }
    }
    equations
}

/// Whether the cut holds the axes of both sides together.
fn is_aligned(kind: CutKind) -> bool {
    !matches!(kind, CutKind::Universal | CutKind::Spherical)
}

/// n with d/dt (uA . vB) = n . (wB - wA): vB x uA, which on the closure of an
/// aligned cut is an axis of A.
fn normal(
    g: &mut Graph,
    kind: CutKind,
    a: &View,
    b: &View,
    (i, j): (usize, usize),
    form: Form,
) -> V3 {
    if form == Form::OnClosure && is_aligned(kind) {
        // vB is A's own axis j, and j x i is the third axis up to a sign
        let third = 3 - i - j;
        let axis = a.axes[third];
        return if (j + 1) % 3 == i {
            axis
        } else {
            g.neg3(&axis)
        };
    }
    g.cross(&b.axes[j], &a.axes[i])
}

/// Second derivative of n . (angle of B in A) on the closure, at zero
/// accelerations of the coordinates.
fn aligned_second(g: &mut Graph, kind: CutKind, a: &View, b: &View, axes: (usize, usize)) -> Ex {
    let n = normal(g, kind, a, b, axes, Form::OnClosure);
    let alpha = g.sub3(&b.alpha, &a.alpha);
    let direct = g.dot3(&n, &alpha);
    let (relative, relative_r) = (g.sub3(&b.w, &a.w), g.sub3(&b.wr, &a.wr));
    let (turning, turning_r) = (g.cross(&a.w, &n), g.cross(&a.wr, &n));
    let one = g.dot3(&turning, &relative_r);
    let two = g.dot3(&turning_r, &relative);
    let both = g.add(one, two);
    let half = crate::sym::Number::ratio(1, 2).map_or(Ex::ONE, |h| g.constant(h));
    let both = g.mul(half, both);
    g.add(direct, both)
}

/// Second derivative of uA . v at zero accelerations of the coordinates, polar
/// in the velocities.
fn product_rule(
    g: &mut Graph,
    a: &View,
    i: usize,
    v: &V3,
    (rate, rate_r): &(V3, V3),
    acceleration: &V3,
) -> Ex {
    let u = a.axes[i];
    let tangential = g.cross(&a.alpha, &u);
    let turned = turned_twice(g, &a.w, &a.wr, &u);
    let u_second = g.add3(&tangential, &turned);
    let (u_rate, u_rate_r) = (g.cross(&a.w, &u), g.cross(&a.wr, &u));
    let mut sum = g.dot3(&u_second, v);
    for (x, y) in [(&u_rate, rate_r), (&u_rate_r, rate), (&u, acceleration)] {
        let term = g.dot3(x, y);
        sum = g.add(sum, term);
    }
    sum
}

/// The equations as the spec states them: every row of every cut in the world
/// frame, then one row per coupling.
pub fn world_equations(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    rates: Option<&Rates>,
) -> Equations {
    let mut equations = Equations::default();
    for cut in &model.cuts {
        let [a, b] = world_views(g, frames, model, cut, rates);
        let n = model.coordinates.len();
        let rows = cut_equations(g, n, cut.kind, &a, &b, Form::Exact, rates.is_some());
        equations.extend(rows);
    }
    equations.extend(coupling_equations(g, model, rates.is_some()));
    equations
}

/// Both sides of a cut seen from the world.
pub fn world_views(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    cut: &Cut,
    rates: Option<&Rates>,
) -> [View; 2] {
    [0, 1].map(|side| {
        let side = &cut.sides[side];
        let path = model.path(side.link);
        View::along(g, frames, &path, side, &Start::own(), rates)
    })
}

/// `key - (expression)` of every coupling.
pub(super) fn coupling_equations(g: &mut Graph, model: &Model, with_bias: bool) -> Equations {
    let mut equations = Equations::default();
    for coupling in &model.couplings {
        let mut jacobian = vec![Ex::ZERO; model.coordinates.len()];
        let mut residual = g.symbol(&model.coordinates[coupling.key].name);
        jacobian[coupling.key] = Ex::ONE;
        for (coordinate, factor) in &coupling.terms {
            let factor = g.constant(factor.neg());
            let q = g.symbol(&model.coordinates[*coordinate].name);
            let term = g.mul(factor, q);
            residual = g.add(residual, term);
            jacobian[*coordinate] = g.add(jacobian[*coordinate], factor);
        }
        let constant = g.constant(coupling.constant.neg());
        equations.residual.push(g.add(residual, constant));
        equations.jacobian.push(jacobian);
        if with_bias {
            equations.bias.push(Ex::ZERO);
        }
    }
    equations
}
