//! The mechanism at one state, over any numbers: frames, closure equations with their derivatives, and twists.
//! The state need not be closed, and frames on the ground may be moved.

use core::ops::{Add, Mul, Neg, Sub};

use crate::base::certificate::Float320;
use crate::model::{Model, MotionKind, Placement, Side, Step};
use crate::spec::{Axis, CutRow, Quantity};

/// Numbers with which states are computed.
pub(super) trait Scalar:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    const ZERO: Self;
    const ONE: Self;
}

impl Scalar for Float320 {
    const ZERO: Self = Float320::ZERO;
    const ONE: Self = Float320::ONE;
}

pub(super) type Vector<S> = [S; 3];

/// The values of quantities of the spec.
pub(super) trait Values<S> {
    /// A length, or another quantity whose sine is not taken.
    fn length(&self, quantity: &Quantity) -> Option<S>;
    /// Sine and cosine of an angle.
    fn sin_cos(&self, quantity: &Quantity) -> Option<[S; 2]>;
}

/// A state of the mechanism.
#[derive(Clone, Debug)]
pub(super) struct State<S> {
    /// Sine and cosine of each coordinate; those of coordinates that slide are not used.
    pub(super) turns: Vec<[S; 2]>,
    /// The value of each coordinate that slides, and 0 of the others.
    pub(super) slides: Vec<S>,
    /// By how much each frame on the ground is moved, in the world's axes; see [`ground_frames`].
    pub(super) shifts: Vec<Vector<S>>,
}

/// The number of frames on the ground: of the links that the world carries, then of sides of cuts there.
pub(super) fn ground_frames(model: &Model) -> usize {
    let links = model.links.iter().filter(|link| link.parent.is_none());
    let sides = model.cuts.iter().flat_map(|cut| &cut.sides);
    links.count() + sides.filter(|side| side.link.is_none()).count()
}

/// A frame in the world's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame<S> {
    /// The axes, one per entry, in the world's axes.
    pub(super) axes: [Vector<S>; 3],
    pub(super) origin: Vector<S>,
}

/// A joint that moves a link.
#[derive(Clone, Copy, Debug)]
struct Joint<S> {
    coordinate: usize,
    turns: bool,
    axis: Vector<S>,
    through: Vector<S>,
}

/// A link with the joints between the world and it.
#[derive(Clone, Debug)]
pub(super) struct LinkState<S> {
    pub(super) frame: Frame<S>,
    joints: Vec<Joint<S>>,
}

/// The closure equations at a state.
#[derive(Clone, Debug)]
pub(super) struct Closure<S> {
    /// The residual of each row.
    pub(super) residual: Vec<S>,
    /// Its derivatives by all coordinates.
    pub(super) jacobian: Vec<Vec<S>>,
    /// Whether the row is a length; the others are cosines, which depend on angles alone.
    pub(super) is_length: Vec<bool>,
}

pub(super) fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    let products = a.iter().zip(b).map(|(x, y)| *x * *y);
    products.fold(S::ZERO, |sum, x| sum + x)
}

fn cross<S: Scalar>(a: &Vector<S>, b: &Vector<S>) -> Vector<S> {
    let ([ax, ay, az], [bx, by, bz]) = (*a, *b);
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

fn sum<S: Scalar>(a: &Vector<S>, b: &Vector<S>) -> Vector<S> {
    let ([ax, ay, az], [bx, by, bz]) = (*a, *b);
    [ax + bx, ay + by, az + bz]
}

fn difference<S: Scalar>(a: &Vector<S>, b: &Vector<S>) -> Vector<S> {
    sum(a, &b.map(|x| -x))
}

impl<S: Scalar> Frame<S> {
    fn world() -> Self {
        let (o, l) = (S::ZERO, S::ONE);
        Frame {
            axes: [[l, o, o], [o, l, o], [o, o, l]],
            origin: [o; 3],
        }
    }

    fn shift(&mut self, axis: Axis, length: S) {
        let step = self.axes[axis.index()].map(|x| x * length);
        self.origin = sum(&self.origin, &step);
    }

    fn turn(&mut self, axis: Axis, [sin, cos]: [S; 2]) {
        let i = axis.index();
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (y, z) = (self.axes[j], self.axes[k]);
        self.axes[j] = sum(&y.map(|x| x * cos), &z.map(|x| x * sin));
        self.axes[k] = difference(&z.map(|x| x * cos), &y.map(|x| x * sin));
    }

    fn placed(mut self, placement: &Placement, values: &impl Values<S>) -> Option<Self> {
        for step in placement {
            match step {
                Step::Translate(axis, length) => self.shift(*axis, values.length(length)?),
                Step::Rotate(axis, angle) => self.turn(*axis, values.sin_cos(angle)?),
            }
        }
        Some(self)
    }

    /// The components of a vector along the axes.
    pub(super) fn components(&self, vector: &Vector<S>) -> Vector<S> {
        self.axes.map(|axis| dot(&axis, vector))
    }
}

impl<S: Scalar> Joint<S> {
    /// Angular velocity, and velocity of a point, for a unit rate.
    fn velocities(&self, point: &Vector<S>) -> [Vector<S>; 2] {
        if self.turns {
            let arm = difference(point, &self.through);
            [self.axis, cross(&self.axis, &arm)]
        } else {
            [[S::ZERO; 3], self.axis]
        }
    }
}

/// All links at a state; `None` where a quantity has no value, or a joint's slide follows its turn.
pub(super) fn links<S: Scalar>(
    model: &Model,
    values: &impl Values<S>,
    state: &State<S>,
) -> Option<Vec<LinkState<S>>> {
    let mut all: Vec<LinkState<S>> = Vec::with_capacity(model.links.len());
    let mut shifts = state.shifts.iter();
    for link in &model.links {
        let (start, mut joints) = match link.parent {
            Some(parent) => {
                let parent = all.get(parent)?;
                (parent.frame, parent.joints.clone())
            }
            None => (Frame::world(), Vec::new()),
        };
        let mut frame = start.placed(&link.placement, values)?;
        if link.parent.is_none() {
            frame.origin = sum(&frame.origin, shifts.next()?);
        }
        if let Some(motion) = &link.motion {
            if motion.lead.is_some() {
                return None;
            }
            let turns = motion.kind == MotionKind::Rotation;
            joints.push(Joint {
                coordinate: motion.coordinate,
                turns,
                axis: frame.axes[motion.axis.index()],
                through: frame.origin,
            });
            if turns {
                frame.turn(motion.axis, *state.turns.get(motion.coordinate)?);
            } else {
                frame.shift(motion.axis, *state.slides.get(motion.coordinate)?);
            }
        }
        all.push(LinkState { frame, joints });
    }
    Some(all)
}

/// Where an open gap is observed: in the world, or on the last link that carries both sides of the cut. The equations
/// vanish for the same states; where they do not vanish, their derivatives differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Observer {
    World,
    Carrier,
}

/// The closure equations of all cuts, and one row for each coupling: a length if it couples slides, whose residual is
/// left 0 otherwise. `None` where one is not algebraic, or a quantity has no value.
///
/// - `number`: the value of a constant.
pub(super) fn closure<S: Scalar>(
    model: &Model,
    values: &impl Values<S>,
    (state, links): (&State<S>, &[LinkState<S>]),
    observer: Observer,
    number: impl Fn(&crate::sym::Number) -> Option<S>,
) -> Option<Closure<S>> {
    let on_links = model.links.iter().filter(|link| link.parent.is_none());
    let mut shifts = state.shifts.iter().skip(on_links.count());
    let mut side = |side: &Side| -> Option<(Frame<S>, &[Joint<S>])> {
        if let Some(link) = side.link {
            let link = links.get(link)?;
            let frame = link.frame.placed(&side.placement, values)?;
            Some((frame, &link.joints))
        } else {
            let mut frame = Frame::world().placed(&side.placement, values)?;
            frame.origin = sum(&frame.origin, shifts.next()?);
            Some((frame, &[]))
        }
    };
    let n = model.coordinates.len();
    let mut closure = Closure {
        residual: Vec::new(),
        jacobian: Vec::new(),
        is_length: Vec::new(),
    };
    for cut in &model.cuts {
        let [(a, joints_a), (b, joints_b)] = [side(&cut.sides[0])?, side(&cut.sides[1])?];
        let gap = difference(&b.origin, &a.origin);
        let pairs = joints_a.iter().zip(joints_b);
        let shared = match observer {
            Observer::World => 0,
            Observer::Carrier => pairs
                .take_while(|(a, b)| a.coordinate == b.coordinate)
                .count(),
        };
        let (joints_a, joints_b) = (joints_a.get(shared..)?, joints_b.get(shared..)?);
        for row in cut.kind.rows() {
            let (mut entries, mut is_length) = (vec![S::ZERO; n], true);
            let residual = match row {
                CutRow::Position(i) => gap[i.index()],
                CutRow::Offset(i) => dot(&a.axes[i.index()], &gap),
                CutRow::Axes(i, j) => {
                    is_length = false;
                    dot(&a.axes[i.index()], &b.axes[j.index()])
                }
                CutRow::Screw => return None,
            };
            for (joint, of_b) in joints_a
                .iter()
                .map(|joint| (joint, false))
                .chain(joints_b.iter().map(|joint| (joint, true)))
            {
                let entry = match row {
                    CutRow::Position(i) => {
                        let point = if of_b { &b.origin } else { &a.origin };
                        joint.velocities(point)[1][i.index()]
                    }
                    // the velocity of the point of each side that is at B's origin
                    CutRow::Offset(i) => dot(&a.axes[i.index()], &joint.velocities(&b.origin)[1]),
                    CutRow::Axes(i, j) => {
                        let normal = cross(&b.axes[j.index()], &a.axes[i.index()]);
                        dot(&normal, &joint.velocities(&b.origin)[0])
                    }
                    CutRow::Screw => return None,
                };
                let own = entries.get_mut(joint.coordinate)?;
                *own = if of_b { *own + entry } else { *own - entry };
            }
            closure.residual.push(residual);
            closure.jacobian.push(entries);
            closure.is_length.push(is_length);
        }
    }
    for form in &model.couplings {
        let mut entries = vec![S::ZERO; n];
        *entries.get_mut(form.key)? = S::ONE;
        let slides = |c: usize| model.slides(c) && !model.drives.contains(&form.key);
        let mut residual = *state.slides.get(form.key)? - number(&form.constant)?;
        for (coordinate, factor) in &form.terms {
            if slides(*coordinate) != slides(form.key) {
                return None;
            }
            let factor = number(factor)?;
            let own = entries.get_mut(*coordinate)?;
            *own = *own - factor;
            residual = residual - factor * *state.slides.get(*coordinate)?;
        }
        let is_length = slides(form.key);
        closure
            .residual
            .push(if is_length { residual } else { S::ZERO });
        closure.jacobian.push(entries);
        closure.is_length.push(is_length);
    }
    Some(closure)
}

impl<S: Scalar> LinkState<S> {
    /// The twist (w, v) of the link at its origin, in its axes, at these rates of the coordinates.
    pub(super) fn twist(&self, rates: &[S]) -> [S; 6] {
        let mut total = [[S::ZERO; 3]; 2];
        for joint in &self.joints {
            let rate = rates.get(joint.coordinate).copied().unwrap_or(S::ZERO);
            let velocities = joint.velocities(&self.frame.origin);
            total = [0, 1].map(|k: usize| sum(&total[k], &velocities[k].map(|x| x * rate)));
        }
        let [[p, q, r], [u, v, w]] = total.map(|vector| self.frame.components(&vector));
        [p, q, r, u, v, w]
    }
}
