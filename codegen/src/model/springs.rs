//! Springs and effort terms of the mechanism: forces other than those of inertia, gravity and
//! friction, each linear in its parameters.

use crate::spec::{EffortExpr, Quantity, Spec, SpringForce};

use super::{Body, Coordinate, joints_of_coordinates};

/// A spring at a coordinate: the joint needs the effort K (q - rest) more.
#[derive(Clone, Debug)]
pub struct JointSpring {
    /// Index of the coordinate.
    pub coordinate: usize,
    /// The coordinate at which the spring is relaxed, rad or m.
    pub rest: Quantity,
}

/// An effort term: the joint needs the effort `parameter * factor` more.
#[derive(Clone, Debug)]
pub struct EffortTerm {
    /// Index of the coordinate.
    pub coordinate: usize,
    /// The name of the term, with which the label of its parameter begins.
    pub name: String,
    /// The factor, as an expression in the coordinate and its rate.
    pub factor: EffortExpr,
}

/// An end of a spring: a point of a link.
#[derive(Clone, Debug)]
pub struct SpringEnd {
    /// The link that carries the point; `None` is the world.
    pub link: Option<usize>,
    /// The point in the link's frame, m.
    pub point: [Quantity; 3],
}

/// A spring or a constant pull between points of two links.
#[derive(Clone, Debug)]
pub struct PointSpring {
    /// Its name, which owns its parameters.
    pub name: String,
    /// The two points.
    pub ends: [SpringEnd; 2],
    /// Its force.
    pub force: SpringForce,
}

/// The part of a point spring's force to which a parameter belongs. With the distance d of the
/// points, the effort at each coordinate q is the sum over the spring's parameters of the parameter
/// times the factor given for its part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpringPart {
    /// `k`, the stiffness, N/m: (d - length) dd/dq; without a length, d dd/dq.
    Stiffness,
    /// `kl`, stiffness times relaxed length, N: -dd/dq.
    Preload,
    /// `f`, a constant pull, N: dd/dq.
    Pull,
}

impl SpringPart {
    /// The parts of a force, in the order of [`SpringForce::symbols`].
    pub fn of(force: &SpringForce) -> &'static [SpringPart] {
        match force {
            SpringForce::Elastic { length: Some(_) } => &[SpringPart::Stiffness],
            SpringForce::Elastic { length: None } => &[SpringPart::Stiffness, SpringPart::Preload],
            SpringForce::Constant => &[SpringPart::Pull],
        }
    }

    /// The symbol that labels begin with.
    pub fn symbol(self) -> &'static str {
        match self {
            SpringPart::Stiffness => "k",
            SpringPart::Preload => "kl",
            SpringPart::Pull => "f",
        }
    }
}

/// The springs at coordinates, in the order of coordinates.
pub(super) fn joint_springs(spec: &Spec) -> Vec<JointSpring> {
    let joints = joints_of_coordinates(spec).into_iter().enumerate();
    let springs = joints.filter_map(|(coordinate, joint)| {
        let rest = joint.spring.as_ref()?.rest.clone();
        Some(JointSpring { coordinate, rest })
    });
    springs.collect()
}

/// The effort terms, coordinate by coordinate.
pub(super) fn effort_terms(spec: &Spec) -> Vec<EffortTerm> {
    let joints = joints_of_coordinates(spec).into_iter().enumerate();
    let terms = joints.flat_map(|(coordinate, joint)| {
        let terms = joint.terms.iter();
        terms.map(move |(name, factor)| EffortTerm {
            coordinate,
            name: name.value.clone(),
            factor: factor.clone(),
        })
    });
    terms.collect()
}

/// The springs between points, in the spec's order.
pub(super) fn point_springs(spec: &Spec, bodies: &[Body]) -> Vec<PointSpring> {
    let link = |end: &crate::spec::SpringEnd| {
        let label = &end.body.as_ref()?.value;
        let body = bodies.iter().find(|body| body.label == *label);
        body.map(|body| body.link)
    };
    let springs = spec.springs.iter().map(|spring| PointSpring {
        name: spring.name.value.clone(),
        ends: spring.ends.each_ref().map(|end| SpringEnd {
            link: link(end),
            point: end.xyz.clone(),
        }),
        force: spring.force.clone(),
    });
    springs.collect()
}

/// The name of a coordinate, which owns the parameters of its springs and terms.
pub(super) fn owner(coordinates: &[Coordinate], coordinate: usize) -> &str {
    coordinates.get(coordinate).map_or("", |c| c.name.as_str())
}
