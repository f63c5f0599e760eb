//! Random closed states, the same for the same seed.

use crate::mechanism::Mechanism;
use crate::random::Random;

/// Positions, velocities and accelerations of all coordinates that satisfy the closure.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Positions.
    pub q: Vec<f64>,
    /// Velocities.
    pub qd: Vec<f64>,
    /// Accelerations.
    pub qdd: Vec<f64>,
}

/// How far from home, in rad or m, the first try goes: trees have no branch to lose.
const REACH_TREE: (f64, f64) = (2.5, 0.5);
const REACH_LOOP: (f64, f64) = (0.4, 0.08);

/// Singular values of A_e may spread this much more than at home: digits that comparisons lose.
const WORSE_THAN_HOME: f64 = 0.05;

impl Mechanism {
    /// A random state on the branch of home, not near a singularity.
    ///
    /// # Errors
    /// When home does not close or nothing near it can be reached.
    pub fn random_state(&self, home: &[f64], random: &mut Random) -> Result<State, String> {
        let (turn, slide) = if self.rows() == 0 {
            REACH_TREE
        } else {
            REACH_LOOP
        };
        let bound = self.conditioning(home) * WORSE_THAN_HOME;
        let mut last = String::new();
        let mut reach = 1.0;
        while reach > 0.02 {
            let target: Vec<f64> = self
                .independent
                .iter()
                .map(|k| {
                    let size = if self.slides(*k) { slide } else { turn };
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

    fn with_motion(&self, q: Vec<f64>, random: &mut Random) -> Result<State, String> {
        let qd = self.velocities(&q, &random.vector(self.dof(), 1.5))?;
        let qdd = self.accelerations(&q, &qd, &random.vector(self.dof(), 3.0))?;
        Ok(State { q, qd, qdd })
    }

    /// As many random states from a seed.
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
