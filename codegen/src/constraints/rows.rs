//! The closure equations of a cut, row by row.

use crate::kinematics::{Frames, Rates, Start, centripetal};
use crate::model::{Cut, Model};
use crate::spec::{Axis, CutKind, CutRow};
use crate::sym::{Ex, Graph, V3};

use super::screw::Screw;
use super::view::View;

/// For each row of a cut, whether it is a length; the others are cosines.
pub(super) fn lengths_of(kind: CutKind) -> impl Iterator<Item = bool> {
    kind.rows()
        .iter()
        .map(|row| !matches!(row, CutRow::Axes(..)))
}

/// The form in which the derivatives of the rows are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The exact derivatives of the rows, valid also off the closure.
    Exact,
    /// A simpler form, equal to the exact one on the closure: axes that the cut aligns are taken to
    /// coincide.
    OnClosure,
}

/// The closure equations of a mechanism.
#[derive(Clone, Debug, Default)]
pub struct Equations {
    /// f of Eq. 6.
    pub residual: Vec<Ex>,
    /// A of Eq. 7, over all coordinates.
    pub jacobian: Vec<Vec<Ex>>,
    /// b of Eq. 7; empty if no rates were given.
    pub bias: Vec<Ex>,
}

impl Equations {
    /// Appends the rows of another set.
    pub fn extend(&mut self, other: Equations) {
        self.residual.extend(other.residual);
        self.jacobian.extend(other.jacobian);
        self.bias.extend(other.bias);
    }
}

/// The rows of one cut from its two sides, both expressed in the same frame.
pub(super) fn cut_equations(
    g: &mut Graph,
    frames: &Frames,
    coordinates: usize,
    cut: &Cut,
    [a, b]: &[View; 2],
    form: Form,
    with_bias: bool,
) -> Equations {
    let kind = cut.kind;
    let mut equations = Equations::default();
    let gap = g.sub3(&b.point, &a.point);
    let screw = screw(g, frames, cut, [a, b]);
    for row in kind.rows() {
        let mut jacobian = vec![Ex::ZERO; coordinates];
        let sides = [(a, true), (b, false)];
        let residual = match *row {
            CutRow::Position(i) => gap[i.index()],
            CutRow::Axes(i, j) => g.dot3(&a.axes[i.index()], &b.axes[j.index()]),
            CutRow::Offset(i) => g.dot3(&a.axes[i.index()], &gap),
            CutRow::Screw => screw.as_ref().map_or(Ex::ZERO, |s| s.residual(g)),
        };
        for (side, negative) in sides {
            for (coordinate, column) in &side.columns {
                let entry = match *row {
                    CutRow::Position(i) => column.at(g, &side.point)[i.index()],
                    CutRow::Axes(i, j) => {
                        let normal = normal(g, kind, a, b, (i, j), form);
                        g.dot3(&normal, &column.angular())
                    }
                    // the velocity of the point of each side that coincides with pB
                    CutRow::Offset(i) => {
                        let velocity = column.at(g, &b.point);
                        g.dot3(&a.axes[i.index()], &velocity)
                    }
                    CutRow::Screw => {
                        let screw = screw.as_ref();
                        screw.map_or(Ex::ZERO, |s| s.entry(g, column, form))
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
                CutRow::Position(i) => g.sub(b.a[i.index()], a.a[i.index()]),
                CutRow::Offset(i) => {
                    let rates = (g.sub3(&b.v, &a.v), g.sub3(&b.vr, &a.vr));
                    let acceleration = g.sub3(&b.a, &a.a);
                    product_rule(g, a, i, &gap, &rates, &acceleration)
                }
                CutRow::Axes(i, j) if form == Form::Exact || !is_aligned(kind) => {
                    let v = b.axes[j.index()];
                    let rates = (g.cross(&b.w, &v), g.cross(&b.wr, &v));
                    let turned = centripetal(g, &b.w, &b.wr, &v);
                    let tangential = g.cross(&b.alpha, &v);
                    let acceleration = g.add3(&tangential, &turned);
                    product_rule(g, a, i, &v, &rates, &acceleration)
                }
                CutRow::Axes(i, j) => aligned_second(g, kind, a, b, (i, j)),
                CutRow::Screw => screw.as_ref().map_or(Ex::ZERO, |s| s.second(g, form)),
            };
            equations.bias.push(g.neg(second));
        }
    }
    equations
}

/// Cosines that are 1 where a cut is closed, and -1 where its rows vanish a half turn away from
/// that; empty for kinds of cut whose rows do not vanish at a half turn.
pub fn agreement(g: &mut Graph, frames: &Frames, model: &Model, cut: &Cut) -> Vec<Ex> {
    let [a, b] = world_views(g, frames, model, cut, None);
    match cut.kind {
        CutKind::Fixed | CutKind::Prismatic => {
            (0..3).map(|i| g.dot3(&a.axes[i], &b.axes[i])).collect()
        }
        CutKind::Helical => {
            let screw = screw(g, frames, cut, [&a, &b]);
            let turn = screw.iter().map(|s| s.agreement(g));
            let mut all: Vec<Ex> = turn.collect();
            all.push(g.dot3(&a.axes[2], &b.axes[2]));
            all
        }
        CutKind::Revolute | CutKind::Cylindrical => vec![g.dot3(&a.axes[2], &b.axes[2])],
        CutKind::Spherical | CutKind::Universal => Vec::new(),
    }
}

/// Rows beside those of the cuts: for each pair of axes that a cut aligns 1 less their cosine, which is 0 on the
/// closure and 2 a half turn away, where the rows of the cut vanish too. A search of closed states by least
/// squares over both has no half turns among its ends.
pub fn half_turns(g: &mut Graph, frames: &Frames, model: &Model) -> Equations {
    let mut equations = Equations::default();
    for cut in &model.cuts {
        let axes: &[Axis] = match cut.kind {
            CutKind::Fixed | CutKind::Prismatic => &[Axis::X, Axis::Y, Axis::Z],
            CutKind::Revolute | CutKind::Cylindrical | CutKind::Helical => &[Axis::Z],
            CutKind::Spherical | CutKind::Universal => continue,
        };
        let [a, b] = &world_views(g, frames, model, cut, None);
        for &axis in axes {
            let normal = normal(g, cut.kind, a, b, (axis, axis), Form::Exact);
            let mut jacobian = vec![Ex::ZERO; model.coordinates.len()];
            for (side, negative) in [(a, false), (b, true)] {
                for (coordinate, column) in &side.columns {
                    let entry = g.dot3(&normal, &column.angular());
                    let entry = if negative { g.neg(entry) } else { entry };
                    jacobian[*coordinate] = g.add(jacobian[*coordinate], entry);
                }
            }
            let cosine = g.dot3(&a.axes[axis.index()], &b.axes[axis.index()]);
            equations.residual.push(g.sub(Ex::ONE, cosine));
            equations.jacobian.push(jacobian);
        }
    }
    equations
}

/// The screw of a helical cut; `None` for the other kinds.
fn screw<'v>(g: &mut Graph, frames: &Frames, cut: &Cut, sides: [&'v View; 2]) -> Option<Screw<'v>> {
    let lead = frames.length(g, cut.lead.as_ref()?);
    Some(Screw::new(g, lead, sides))
}

/// Whether the cut aligns axes of both sides.
fn is_aligned(kind: CutKind) -> bool {
    !matches!(kind, CutKind::Universal | CutKind::Spherical)
}

/// The vector n with d/dt (uA . vB) = n . (wB - wA), which is vB x uA; on the closure of an aligned
/// cut it is an axis of A.
fn normal(
    g: &mut Graph,
    kind: CutKind,
    a: &View,
    b: &View,
    (i, j): (Axis, Axis),
    form: Form,
) -> V3 {
    let (i, j) = (i.index(), j.index());
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

/// Second derivative of n . (angle of B in A) on the closure, at zero accelerations of the
/// coordinates.
fn aligned_second(g: &mut Graph, kind: CutKind, a: &View, b: &View, axes: (Axis, Axis)) -> Ex {
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

/// Second derivative of uA . v at zero accelerations of the coordinates, as the symmetric bilinear
/// form of the velocities and the reference velocities.
pub(super) fn product_rule(
    g: &mut Graph,
    a: &View,
    i: Axis,
    v: &V3,
    (rate, rate_r): &(V3, V3),
    acceleration: &V3,
) -> Ex {
    let u = a.axes[i.index()];
    let tangential = g.cross(&a.alpha, &u);
    let turned = centripetal(g, &a.w, &a.wr, &u);
    let u_second = g.add3(&tangential, &turned);
    let (u_rate, u_rate_r) = (g.cross(&a.w, &u), g.cross(&a.wr, &u));
    let mut sum = g.dot3(&u_second, v);
    for (x, y) in [(&u_rate, rate_r), (&u_rate_r, rate), (&u, acceleration)] {
        let term = g.dot3(x, y);
        sum = g.add(sum, term);
    }
    sum
}

/// The closure equations in the order of the spec: every row of every cut in the world frame, then
/// one row per coupling.
pub fn world_equations(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    rates: Option<&Rates>,
) -> Equations {
    let mut equations = Equations::default();
    for cut in &model.cuts {
        let views = world_views(g, frames, model, cut, rates);
        let n = model.coordinates.len();
        let rows = cut_equations(g, frames, n, cut, &views, Form::Exact, rates.is_some());
        equations.extend(rows);
    }
    equations.extend(coupling_equations(g, model, rates.is_some()));
    equations
}

/// Both sides of a cut in the world frame.
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

/// The row `key - (expression)` of every coupling.
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
