//! A controller without the standard library and without an allocator: the legs of a 3-RPS follow
//! a motion by computed torque, and a five-bar is watched. `.ci/run` compiles it for a Cortex-M4 where that target is installed.
#![no_std]

mod watch;

pub use watch::Watch;

use regen_control::{ClosureError, Outcome, closure};
use regen_generated::rps3::{self, Rps3};

/// Number of legs, and of base parameters.
const LEGS: usize = rps3::INDEPENDENT.len();
const BASE: usize = rps3::BASE.len();

/// Newton steps in a cycle: a motion that needs more than two is too fast for the cycle.
const STEPS: usize = 3;

/// A state of motion of the legs.
#[derive(Clone, Copy, Debug)]
pub struct Legs {
    /// Lengths, m.
    pub length: [f32; LEGS],
    /// Velocities, m/s.
    pub velocity: [f32; LEGS],
}

/// The controller with its memory.
#[derive(Debug)]
pub struct Controller {
    closure: closure!(rps3::Rps3, f32),
    /// Identified base parameters, SI.
    beta: [f32; BASE],
    /// Gains of the position in 1/s^2 and of the velocity in 1/s.
    gains: [f32; 2],
}

impl Controller {
    /// A controller for these base parameters; `regen identify --rust` writes them.
    ///
    /// # Errors
    /// When the home of the robot is not closed.
    pub fn new(beta: [f32; BASE], gains: [f32; 2]) -> Result<Self, ClosureError> {
        let closure = <closure!(rps3::Rps3, f32)>::new(&Rps3)?;
        Ok(Self {
            closure,
            beta,
            gains,
        })
    }

    /// One cycle: the forces of the legs, N, or why there are none.
    ///
    /// - `wanted`, `acceleration`: the motion to follow, m, m/s and m/s^2.
    /// - `measured`: what the encoders say.
    ///
    /// # Errors
    /// The outcome, where the loops could not be closed at the measured lengths in a cycle; let the
    /// brakes close then.
    pub fn cycle(
        &mut self,
        wanted: &Legs,
        acceleration: &[f32; LEGS],
        measured: &Legs,
    ) -> Result<[f32; LEGS], Outcome<f32>> {
        let outcome = self.closure.track(&measured.length, STEPS);
        if !outcome.is_closed() {
            return Err(outcome);
        }
        let mut qdd_i = *acceleration;
        for (leg, qdd) in qdd_i.iter_mut().enumerate() {
            *qdd += self.gains[0] * (wanted.length[leg] - measured.length[leg])
                + self.gains[1] * (wanted.velocity[leg] - measured.velocity[leg]);
        }
        let motion = self.closure.motion(&measured.velocity, &qdd_i);
        let q = self.closure.q();
        let (forces, _) = rps3::base_inverse_dynamics(q, &motion.qd, &motion.qdd, &self.beta);
        Ok(forces)
    }
}

#[cfg(test)]
mod tests {
    use super::{BASE, Controller, LEGS, Legs};

    #[test]
    fn the_robot_is_held_against_its_weight() {
        let mut phi = [0.0_f32; regen_generated::rps3::PARAMETERS.len()];
        for (phi, nominal) in phi.iter_mut().zip(regen_generated::rps3::NOMINAL) {
            #[allow(clippy::cast_possible_truncation, reason = "rounded to the nearest")]
            let nominal = nominal.unwrap_or(0.0) as f32;
            *phi = nominal;
        }
        let beta: [f32; BASE] = regen_generated::rps3::to_base(&phi);
        let mut controller = Controller::new(beta, [100.0, 20.0]).unwrap();
        let still = Legs {
            length: [0.62; LEGS],
            velocity: [0.0; LEGS],
        };
        let forces = controller.cycle(&still, &[0.0; LEGS], &still).unwrap();
        // three equal legs carry the weight of platform, sliders and parts of the lower legs
        let sum: f32 = forces.iter().sum();
        assert!(
            forces.iter().all(|f| (f - forces[0]).abs() < 1.0),
            "{forces:?}"
        );
        assert!(sum > 9.81 * 3.0 * 3.4 && sum < 9.81 * 50.0, "{forces:?}");
    }
}
