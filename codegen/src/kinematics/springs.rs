//! The generalised forces of springs and effort terms: functions of the motion alone, which give no
//! inertia.

use crate::model::{
    EffortExpr, EffortTerm, Function, Model, ParameterKind, PointSpring, SpringEnd, SpringForce,
    SpringPart,
};
use crate::sym::{Ex, Graph, V3};

use super::{Frames, Rates};

/// The efforts in the joints of the tree for a value of 1 of the parameter of a spring or an effort
/// term, as pairs of coordinate and effort, N m or N; the other coordinates have no effort. Empty
/// for other parameters.
///
/// Springs count only if `rates.gravity` is set, since their forces remain at rest as gravity does.
/// If it is not set, an effort term has the part that vanishes at rest.
pub fn spring_column(
    g: &mut Graph,
    model: &Model,
    frames: &Frames,
    rates: &Rates,
    kind: ParameterKind,
) -> Vec<(usize, Ex)> {
    match kind {
        ParameterKind::JointSpring { spring, coordinate } if rates.gravity => {
            let q = g.symbol(&model.coordinates[coordinate].name);
            let rest = frames.length(g, &model.joint_springs[spring].rest);
            vec![(coordinate, g.sub(q, rest))]
        }
        ParameterKind::EffortTerm { term, coordinate } => {
            let factor = term_factor(g, (model, frames), rates, &model.effort_terms[term]);
            vec![(coordinate, factor)]
        }
        ParameterKind::PointSpring { spring, part } if rates.gravity => {
            point_spring(g, frames, &model.point_springs[spring], part)
        }
        _ => Vec::new(),
    }
}

/// The factor of an effort term; if `rates.gravity` is not set, minus its value at rest.
fn term_factor(
    g: &mut Graph,
    (model, frames): (&Model, &Frames),
    rates: &Rates,
    term: &EffortTerm,
) -> Ex {
    let q = g.symbol(&model.coordinates[term.coordinate].name);
    let qd = rates.qd[term.coordinate];
    let factor = expression(g, frames, &term.factor, (q, qd));
    if rates.gravity {
        return factor;
    }
    let at_rest = expression(g, frames, &term.factor, (q, Ex::ZERO));
    g.sub(factor, at_rest)
}

/// The expression of a factor at a coordinate and its rate. A quotient by 0 is 0 times its
/// numerator in the graph only if its divisor is the constant 0.
fn expression(g: &mut Graph, frames: &Frames, factor: &EffortExpr, at: (Ex, Ex)) -> Ex {
    let one = |g: &mut Graph, a: &EffortExpr| expression(g, frames, a, at);
    let pair = |g: &mut Graph, a: &EffortExpr, b: &EffortExpr| (one(g, a), one(g, b));
    match factor {
        EffortExpr::Constant(quantity) => frames.length(g, quantity),
        EffortExpr::Q => at.0,
        EffortExpr::Qd => at.1,
        EffortExpr::Neg(a) => {
            let a = one(g, a);
            g.neg(a)
        }
        EffortExpr::Add(a, b) => {
            let (a, b) = pair(g, a, b);
            g.add(a, b)
        }
        EffortExpr::Sub(a, b) => {
            let (a, b) = pair(g, a, b);
            g.sub(a, b)
        }
        EffortExpr::Mul(a, b) => {
            let (a, b) = pair(g, a, b);
            g.mul(a, b)
        }
        EffortExpr::Div(a, b) => {
            let (a, b) = pair(g, a, b);
            g.div(a, b).unwrap_or(Ex::ZERO)
        }
        EffortExpr::Pow(a, exponent) => {
            let a = one(g, a);
            power(g, a, *exponent)
        }
        EffortExpr::Call(function, a) => {
            let a = one(g, a);
            call(g, *function, a)
        }
    }
}

/// `a^exponent` by repeated squaring, for an exponent of at least 1.
fn power(g: &mut Graph, a: Ex, exponent: u32) -> Ex {
    let (mut square, mut product, mut left) = (a, Ex::ONE, exponent);
    loop {
        if left % 2 == 1 {
            product = g.mul(product, square);
        }
        left /= 2;
        if left == 0 {
            return product;
        }
        square = g.mul(square, square);
    }
}

fn call(g: &mut Graph, function: Function, a: Ex) -> Ex {
    match function {
        Function::Sqrt => g.sqrt(a),
        Function::Sin => g.sin_cos_of(a).0,
        Function::Cos => g.sin_cos_of(a).1,
        Function::Sign => g.sign(a),
        Function::Abs => {
            let sign = g.sign(a);
            g.mul(sign, a)
        }
        // the spec writes these two as a quotient and as a product
        Function::Tan => {
            let (sin, cos) = g.sin_cos_of(a);
            g.div(sin, cos).unwrap_or(Ex::ZERO)
        }
        Function::Deg => a,
    }
}

/// The efforts that balance a spring between two points, at the coordinates that change its length.
/// The spring pulls each point towards the other.
fn point_spring(
    g: &mut Graph,
    frames: &Frames,
    spring: &PointSpring,
    part: SpringPart,
) -> Vec<(usize, Ex)> {
    let [a, b] = &spring.ends;
    let meeting = common_link(frames, a.link, b.link);
    let [from, to] = [a, b].map(|end| {
        let point = end.point.each_ref().map(|q| frames.length(g, q));
        (point, position(g, frames, end, &point, meeting))
    });
    // from the second point to the first, in the axes of the link at which both paths meet
    let span = g.sub3(&from.1, &to.1);
    let scale = |g: &mut Graph, factor: Ex| g.scale3(factor, &span);
    let distance = |g: &mut Graph| {
        let square = g.dot3(&span, &span);
        g.sqrt(square)
    };
    // minus the force on the first point: the gradient of the spring's energy there
    let force = match (part, &spring.force) {
        (
            SpringPart::Stiffness,
            SpringForce::Elastic {
                length: Some(length),
            },
        ) => {
            let d = distance(g);
            let length = frames.length(g, length);
            let ratio = g.div(length, d).unwrap_or(Ex::ZERO);
            let factor = g.sub(Ex::ONE, ratio);
            scale(g, factor)
        }
        // without a length the stiffness is that of a spring of length 0
        (SpringPart::Stiffness, _) => span,
        (SpringPart::Preload | SpringPart::Pull, _) => {
            let d = distance(g);
            let inverse = g.div(Ex::ONE, d).unwrap_or(Ex::ZERO);
            let inverse = match part {
                SpringPart::Preload => g.neg(inverse),
                _ => inverse,
            };
            scale(g, inverse)
        }
    };
    let mut column = Vec::new();
    let opposite = g.neg3(&force);
    for (end, point, force) in [(a, from.0, force), (b, to.0, opposite)] {
        efforts_of(g, frames, end, &point, &force, meeting, &mut column);
    }
    column
}

/// The links on the path from `link` inward to the one before `meeting`.
fn links_to(frames: &Frames, link: Option<usize>, meeting: Option<usize>) -> Vec<usize> {
    let path = std::iter::successors(link, |at| frames.links[*at].parent);
    path.take_while(|at| Some(*at) != meeting).collect()
}

/// The outermost link that carries both links; `None` is the world.
fn common_link(frames: &Frames, a: Option<usize>, b: Option<usize>) -> Option<usize> {
    let of_a = links_to(frames, a, None);
    let of_b = links_to(frames, b, None);
    of_a.into_iter().find(|link| of_b.contains(link))
}

/// The position of a spring's end in the frame of `meeting`.
fn position(
    g: &mut Graph,
    frames: &Frames,
    end: &SpringEnd,
    point: &V3,
    meeting: Option<usize>,
) -> V3 {
    let path = links_to(frames, end.link, meeting);
    path.into_iter().fold(*point, |at, link| {
        let turned = frames.into_parent(g, link, &at);
        g.add3(&turned, &frames.links[link].offset)
    })
}

/// Adds the efforts at the coordinates between an end and `meeting` that a force on the end's point
/// causes. `force` is in the axes of `meeting`.
fn efforts_of(
    g: &mut Graph,
    frames: &Frames,
    end: &SpringEnd,
    point: &V3,
    force: &V3,
    meeting: Option<usize>,
    column: &mut Vec<(usize, Ex)>,
) {
    let path = links_to(frames, end.link, meeting);
    let inward = path.iter().rev();
    let force = inward.fold(*force, |force, link| frames.into_link(g, *link, &force));
    // the force and its moment about the link's origin, in the link's axes
    let (mut moment, mut force) = (g.cross(point, &force), force);
    for link in path {
        let frame = &frames.links[link];
        if let Some(joint) = frame.joint {
            let turning = g.dot3(&joint.twist.e, &moment);
            let sliding = g.dot3(&joint.twist.u, &force);
            column.push((joint.coordinate, g.add(turning, sliding)));
        }
        force = frames.into_parent(g, link, &force);
        moment = frames.into_parent(g, link, &moment);
        let lever = g.cross(&frame.offset, &force);
        moment = g.add3(&moment, &lever);
    }
}
