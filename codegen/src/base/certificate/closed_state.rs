//! Kinematics of a mechanism at closed states of its assembly branch, in multiple precision. The
//! explanation of a mechanism finds common properties of its motions from these.

use crate::kinematics::{Frames, Geometry, Twist, twists};
use crate::model::Model;
use crate::sym::{Ex, Graph, V3, ZERO3};

use super::CertificateError;
use super::evaluate::Evaluator;
use super::float320::Float320;
use super::states::Walk;
use super::units::Units;

/// A vector in the world's axes.
pub type Vector3 = [Float320; 3];

/// Kinematics of a link at one state.
#[derive(Clone, Debug)]
pub struct LinkMotion {
    /// The link's axes in the world's frame.
    pub axes: [Vector3; 3],
    /// Angular velocity of the link for the unit rate of each independent coordinate.
    pub angular_velocities: Vec<Vector3>,
    /// Velocity of the link's origin, likewise.
    pub origin_velocities: Vec<Vector3>,
    /// Velocity of the point of the link that coincides with the world's origin, likewise: the linear
    /// part of the link's twist about that origin.
    pub spatial_velocities: Vec<Vector3>,
    /// For each coordinate on the path to the link, its unit twist: angular velocity (0 for a
    /// prismatic joint) and velocity of the point at the world's origin.
    pub unit_twists: Vec<(usize, Vector3, Vector3)>,
}

/// A state that satisfies the closure equations.
#[derive(Clone, Debug)]
pub struct ClosedState {
    /// Values of all coordinates, rad or m.
    pub q: Vec<Float320>,
    /// The matrix J of qd = J qd_i: one row per coordinate, one column per independent coordinate.
    pub j: Vec<Vec<Float320>>,
    /// Kinematics of each link, in the order of the model's links.
    pub links: Vec<LinkMotion>,
}

/// The rates of all coordinates for the unit rate of each independent one, at each state: one row for each.
pub fn rates(states: &[ClosedState]) -> Vec<Vec<Float320>> {
    let of_state = |state: &ClosedState| -> Vec<Vec<Float320>> {
        let width = state.j.first().map_or(0, Vec::len);
        let rates = |k: usize| state.j.iter().map(|row| row[k]).collect();
        (0..width).map(rates).collect()
    };
    states.iter().flat_map(of_state).collect()
}

/// The expressions evaluated for a link: the world's origin and axes in the link's frame, and the
/// unit twists of coordinates.
struct LinkKinematics {
    origin: V3,
    axes: [V3; 3],
    twists: Vec<(usize, Twist)>,
}

impl LinkKinematics {
    fn roots(&self) -> impl Iterator<Item = Ex> {
        let twists = self
            .twists
            .iter()
            .flat_map(|(_, t)| t.e.into_iter().chain(t.u));
        let axes = self.axes.into_iter().flatten();
        self.origin.into_iter().chain(axes).chain(twists)
    }
}

/// The kinematics of a mechanism at `count` closed states: at `home`, which must close,
/// and at random others. The same seed gives the same states.
///
/// # Errors
/// If not enough closed states can be reached from home, or the mechanism is too large.
pub fn closed_states(
    model: &Model,
    home: &[f64],
    seed: u64,
    count: usize,
) -> Result<Vec<ClosedState>, CertificateError> {
    let mut g = Graph::new();
    for coordinate in &model.coordinates {
        g.symbol(&coordinate.name);
    }
    g.set_naming(false);
    let frames = Frames::new(&mut g, model, Geometry::Values);
    let equations = crate::constraints::world_equations(&mut g, &frames, model, None);
    let link_kinematics = link_kinematics(&mut g, &frames, model);
    if g.is_full() {
        return Err(CertificateError::TooLarge);
    }
    let evaluator = Evaluator::new(
        &g,
        link_kinematics
            .iter()
            .flat_map(LinkKinematics::roots)
            .collect(),
    );
    let units = Units::of(model, home);
    let mut walk = Walk::new(&g, &equations, model, home, seed, units)?;
    let mut found = Vec::new();
    let mut state = walk.at_home();
    while found.len() < count {
        let Some(closed) = state else {
            return Err(CertificateError::TooFewStates {
                found: found.len(),
                needed: count,
            });
        };
        if let Some(values) = evaluator.run(&closed.q) {
            let mut values = values.into_iter();
            let links = link_kinematics
                .iter()
                .map(|s| link_motion(s, &mut values, &closed.j));
            found.push(ClosedState {
                links: links.collect(),
                q: closed.q,
                j: closed.j,
            });
        }
        state = walk.next();
    }
    Ok(found)
}

fn link_kinematics(g: &mut Graph, frames: &Frames, model: &Model) -> Vec<LinkKinematics> {
    let world = [0, 1, 2].map(|k| {
        let mut axis = ZERO3;
        axis[k] = Ex::ONE;
        axis
    });
    let mut all: Vec<LinkKinematics> = Vec::new();
    let twists = twists(g, frames, model);
    for (link, twists) in twists.into_iter().enumerate() {
        let frame = &frames.links[link];
        let (origin, axes) = frame
            .parent
            .map_or((ZERO3, world), |p| (all[p].origin, all[p].axes));
        let offset = g.sub3(&origin, &frame.offset);
        all.push(LinkKinematics {
            origin: frames.into_link(g, link, &offset),
            axes: axes.map(|axis| frames.into_link(g, link, &axis)),
            twists,
        });
    }
    all
}

fn cross(a: &Vector3, b: &Vector3) -> Vector3 {
    let part = |i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
    [part(1, 2), part(2, 0), part(0, 1)]
}

fn link_motion(
    link_kinematics: &LinkKinematics,
    values: &mut impl Iterator<Item = Float320>,
    j: &[Vec<Float320>],
) -> LinkMotion {
    let mut three = || -> Vector3 { [(); 3].map(|()| values.next().unwrap_or(Float320::ZERO)) };
    let origin = three();
    let rows = [three(), three(), three()];
    let width = j.first().map_or(0, Vec::len);
    let zero = [Float320::ZERO; 3];
    let to_world =
        |v: &Vector3| -> Vector3 { rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]) };
    let (mut angular_velocities, mut origin_velocities, mut spatial_velocities) =
        (vec![zero; width], vec![zero; width], vec![zero; width]);
    let mut unit_twists = Vec::new();
    for (coordinate, _) in &link_kinematics.twists {
        let (e, u) = (three(), three());
        let lever = cross(&e, &origin);
        let (angular, at_origin) = (to_world(&e), to_world(&u));
        let lever = to_world(&lever);
        let spatial = [0, 1, 2].map(|i| at_origin[i] + lever[i]);
        unit_twists.push((*coordinate, angular, spatial));
        for (k, rate) in j[*coordinate].iter().enumerate() {
            for (to, from) in [
                (&mut angular_velocities[k], &angular),
                (&mut origin_velocities[k], &at_origin),
                (&mut spatial_velocities[k], &spatial),
            ] {
                for i in 0..3 {
                    to[i] = to[i] + *rate * from[i];
                }
            }
        }
    }
    LinkMotion {
        axes: [0, 1, 2].map(|k| rows.map(|row| row[k])),
        angular_velocities,
        origin_velocities,
        spatial_velocities,
        unit_twists,
    }
}
