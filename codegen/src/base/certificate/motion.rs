//! The rows of the regressor W (Eq. 11) at random motions: the forces at the independent coordinates, of
//! inertia, weights, springs, terms and friction together.
//!
//! The rows of [`rows`](super::rows) are energies: they suffice for the rank, but a state at rest shows
//! less of the parameters than a motion does. For the condition of kept columns, forces in motion
//! are what an identification has.
//!
//! The forces of inertia of a body with the twist V = (w, v) in its own frame, at an independent
//! coordinate for whose unit rate the body has the twist t, are h(t, dV/dt) - h(V x t, V): the equations
//! of Newton and Euler in a moving frame, with the motion product V x t = (w x t_w, w x t_v + v x t_w)
//! (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 2.9).

use crate::model::{Model, Step};

use super::body::{BodyAt, Twist, polar};
use super::float320::Float320;
use super::rows::{Inertia, Rows, project};
use super::states::{Random, State, Walk};

/// Binary exponent of the time over which derivatives are taken, s: with 96 digits, differences over
/// 1e-30 s have some 30 digits.
const STEP_EXPONENT: i32 = -100;

/// How fast the independent coordinates of a mechanism move.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// The length by which rates of prismatic coordinates are multiplied, m.
    length: f64,
    /// The largest rate of other coordinates, rad/s; accelerations are up to its square.
    rate: f64,
}

impl Pace {
    /// The pace at which forces of inertia are as large as weights: rates up to sqrt(g / l), where l is
    /// the greatest length along the links; 1 rad/s without gravity or lengths.
    pub(super) fn of(model: &Model) -> Pace {
        let steps = model.links.iter().flat_map(|link| &link.placement);
        let offsets = steps.filter_map(|step| match step {
            Step::Translate(_, quantity) => Some(quantity.value.to_f64().abs()),
            Step::Rotate(..) => None,
        });
        let length = offsets.fold(0.0, f64::max);
        let gravity = model.gravity.iter().map(|g| g.value.to_f64());
        let gravity = libm::sqrt(gravity.map(|g| g * g).sum());
        let rate = libm::sqrt(gravity / length);
        let usable = |x: f64| if x.is_normal() { x } else { 1.0 };
        Pace {
            length: usable(length),
            rate: usable(rate),
        }
    }

    /// Random values for the independent coordinates, up to a power of the rate.
    fn draw(self, model: &Model, random: &mut Random, power: i32) -> Vec<Float320> {
        let independent = model.independent.iter();
        let values = independent.map(|c| {
            let length = if model.slides(*c) { self.length } else { 1.0 };
            let rates = (0..power).fold(1.0, |product, _| product * self.rate);
            Float320::from_f64(length * rates * random.next())
        });
        values.collect()
    }
}

impl Rows<'_> {
    /// Adds the rows of W at a state, at a random velocity and acceleration; `None` where the
    /// expressions have no value, or where the loops do not close beside the state.
    pub(super) fn sample_motion(
        &mut self,
        state: &State,
        walk: &mut Walk<'_>,
        pace: Pace,
    ) -> Option<()> {
        let rates = pace.draw(self.model(), walk.random(), 1);
        let accelerations = pace.draw(self.model(), walk.random(), 2);
        self.push_motion(state, walk, &rates, &accelerations)
    }

    /// Adds the rows of W at a state, where the independent coordinates have the given rates and
    /// accelerations.
    fn push_motion(
        &mut self,
        state: &State,
        walk: &Walk<'_>,
        rates: &[Float320],
        accelerations: &[Float320],
    ) -> Option<()> {
        let qd = project(&state.j, rates);
        let time = Float320::ONE.scaled(STEP_EXPONENT);
        let after = walk.after(state, &qd, time)?;
        let (bodies, _) = self.at(state)?;
        let (later, _) = self.at(&after)?;
        let derivative =
            |after: Float320, before: Float320| (after - before).scaled(-STEP_EXPONENT);
        // for each body its twist, and the derivative of the twist in the body's frame
        let moving = bodies.iter().zip(&later).map(|(body, later)| {
            let twist = body.moving(rates);
            let steady = later.moving(rates);
            let mut rate = body.moving(accelerations);
            for (k, sum) in rate.iter_mut().enumerate() {
                *sum = *sum + derivative(steady[k], twist[k]);
            }
            (twist, rate)
        });
        let moving: Vec<(Twist, Twist)> = moving.collect();
        let steady = project(&after.j, rates);
        let qdd = project(&state.j, accelerations);
        let qdd = qdd.iter().zip(steady.iter().zip(&qd));
        let qdd: Vec<Float320> = qdd
            .map(|(x, (after, before))| *x + derivative(*after, *before))
            .collect();

        let state = &self.with_unit_rates(state);
        let (bodies, mut forces) = self.at(state)?;
        self.push_forces(state, &bodies, &mut forces, &qd, |j| {
            let blocks = bodies.iter().zip(&moving);
            let rotors = state.j.iter().zip(&qdd);
            Some(Inertia {
                bodies: blocks
                    .map(|(body, (twist, rate))| of_inertia(body, j, twist, rate))
                    .collect(),
                rotors: rotors.map(|(row, qdd)| row[j] * *qdd).collect(),
            })
        })
    }
}

/// The forces of inertia of a body at an independent coordinate, for inertial parameters of 1.
fn of_inertia(body: &BodyAt, j: usize, twist: &Twist, rate: &Twist) -> [Float320; 10] {
    let unit = &body.twists[j];
    let moved = polar(unit, rate);
    let turned = polar(&motion_product(twist, unit), twist);
    core::array::from_fn(|k| moved[k] - turned[k])
}

/// V x t for two twists.
fn motion_product(a: &Twist, b: &Twist) -> Twist {
    let ([ax, ay, az, au, av, aw], [bx, by, bz, bu, bv, bw]) = (*a, *b);
    [
        ay * bz - az * by,
        az * bx - ax * bz,
        ax * by - ay * bx,
        (ay * bw - az * bv) + (av * bz - aw * by),
        (az * bu - ax * bw) + (aw * bx - au * bz),
        (ax * bv - ay * bu) + (au * by - av * bx),
    ]
}

#[cfg(test)]
mod tests;
