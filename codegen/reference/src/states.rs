//! Random closed states, reproducible for the same seed.

use crate::mechanism::Mechanism;
use crate::random::Random;

/// Positions, velocities and accelerations of all coordinates that satisfy the closure equations.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Positions, rad or m.
    pub q: Vec<f64>,
    /// Velocities, rad/s or m/s.
    pub qd: Vec<f64>,
    /// Accelerations, rad/s^2 or m/s^2.
    pub qdd: Vec<f64>,
}

/// Initial distance from home for revolute (rad) and prismatic (m) coordinates. It is larger for
/// trees, which have no assembly branch to leave.
const REACH_TREE: (f64, f64) = (2.5, 0.5);
const REACH_LOOP: (f64, f64) = (0.4, 0.08);

/// Least conditioning of A_e relative to home, since comparisons lose digits near a singularity.
const MIN_CONDITIONING_RATIO: f64 = 0.05;

impl Mechanism {
    /// A random state on the assembly branch of home, not near a singularity.
    ///
    /// # Errors
    /// If home does not close or no such state near it can be reached.
    pub fn random_state(&self, home: &[f64], random: &mut Random) -> Result<State, String> {
        let (turn, slide) = if self.rows() == 0 {
            REACH_TREE
        } else {
            REACH_LOOP
        };
        let bound = self.conditioning(home) * MIN_CONDITIONING_RATIO;
        let mut last = String::new();
        let mut reach = 1.0;
        while reach > 0.02 {
            let target: Vec<f64> = self
                .independent
                .iter()
                .map(|k| {
                    let size = self.travel(*k, turn, slide);
                    home[*k] + random.uniform(-size, size) * reach
                })
                .collect();
            match self.follow(home, &target) {
                Ok(q) if self.conditioning(&q) >= bound => return self.with_motion(q, random),
                Ok(_) => last = "ill-conditioned".into(),
                Err(error) => last = error,
            }
            reach *= 0.8;
        }
        Err(format!("{}: no state found: {last}", self.name))
    }

    /// The state at `q` with random velocities and accelerations.
    fn with_motion(&self, q: Vec<f64>, random: &mut Random) -> Result<State, String> {
        let qd = self.velocities(&q, &random.vector(self.dof(), 1.5))?;
        let qdd = self.accelerations(&q, &qd, &random.vector(self.dof(), 3.0))?;
        Ok(State { q, qd, qdd })
    }

    /// The given number of random states, from a seed.
    ///
    /// # Errors
    /// As [`Mechanism::random_state`].
    pub fn random_states(&self, seed: u64, count: usize) -> Result<Vec<State>, String> {
        let home = self.home()?;
        let mut random = Random::new(seed);
        (0..count)
            .map(|_| self.random_state(&home, &mut random))
            .collect()
    }
}
