//! Checks against derivations that share no code with the robot's functions. The bound of each
//! error is computed from roundoff, operations and condition numbers.
//!
//! | file | what |
//! |---|---|
//! | `rounding` | how far two computations may differ at a state |
//! | `forces` | the regressor against other derivations: Newton-Euler, energy, vectors |
//! | `loops` | the drift of the loops along a motion |
//! | `base` | rank, span, certificate and the ways to base parameters and back |
//! | `vectors` | forces that another program found |

mod base;
mod forces;
mod loops;
pub(crate) mod rounding;
#[cfg(test)]
mod tests;
mod vectors;

use regen_codegen::robot::Robot;
use regen_interpreted::Interpreted;
use regen_reference::{Mechanism, Random, State};
use regen_runtime::LoopClosure;

use crate::check::{Check, Report, Statement};
use crate::error::VerifyError;
use crate::states::{Reach, SEED, closed_state};

pub use vectors::Vectors;

/// Number of closed states.
const STATES: usize = 8;
/// Least ratio of the conditioning of A_e at a state to that at home. The bounds grow near a
/// singularity, where large errors are not evidence against the model.
const MIN_CONDITIONING_RATIO: f64 = 0.1;
/// Largest number of random states drawn until one is well enough conditioned.
const MAX_TRIES: usize = 20;

/// The statements of the independent checks, in the order in which [`independent`] reports them.
pub const INDEPENDENT: [Statement; 9] = [
    SECOND, PEER, POWER, DRIFT, RANK, SPAN, GAP, WAY_BACK, SINGLE,
];
const SECOND: Statement = Statement {
    key: "second_derivation",
    heading: "second",
    statement: "regressor = Newton-Euler's, loops closed by an SVD",
};
const PEER: Statement = Statement {
    key: "peer",
    heading: "peer",
    statement: "forces = those of another program (vectors)",
};
const POWER: Statement = Statement {
    key: "power",
    heading: "power",
    statement: "power of the forces = d/dt of the bodies' energy",
};
const DRIFT: Statement = Statement {
    key: "drift",
    heading: "drift",
    statement: "loops stay closed along a motion, to order 4",
};
const RANK: Statement = Statement {
    key: "rank",
    heading: "rank",
    statement: "base parameters, singular values and certificate agree",
};
const SPAN: Statement = Statement {
    key: "span",
    heading: "span",
    statement: "angle between exact and numeric null space, rad",
};
const GAP: Statement = Statement {
    key: "gap",
    heading: "gap",
    statement: "certificate: largest remainder over smallest pivot",
};
const WAY_BACK: Statement = Statement {
    key: "way_back",
    heading: "back",
    statement: "to base parameters and back: same forces",
};
const SINGLE: Statement = Statement {
    key: "single_precision",
    heading: "f32",
    statement: "regressor in single precision",
};

/// Checks a robot with base parameters against the second derivation from the text of its spec, and
/// against the vectors of another program if given.
///
/// # Errors
/// If the robot has no base parameters, the second derivation finds other coordinates or parameters
/// in the text, or no closed state is found, or the singular values are not.
pub fn independent(
    robot: &Robot,
    text: &str,
    vectors: Option<&Vectors>,
) -> Result<Report, VerifyError> {
    let reference = Mechanism::from_yaml(text).map_err(VerifyError::UnreadableSpec)?;
    let subject = Subject {
        robot,
        reference: &reference,
        vectors,
    };
    Ok(Report {
        robot: robot.name.clone(),
        states: STATES,
        checks: subject.check()?,
    })
}

/// The data for the checks of one robot.
struct Subject<'a> {
    robot: &'a Robot,
    /// The second derivation, from the text of the same spec.
    reference: &'a Mechanism,
    vectors: Option<&'a Vectors>,
}

impl Subject<'_> {
    /// Makes all checks, in the order of [`INDEPENDENT`].
    fn check(&self) -> Result<Vec<Check>, VerifyError> {
        if self.robot.coordinates != self.reference.coordinates
            || self.robot.labels() != self.reference.labels()
            || self.robot.independent != self.reference.independent
        {
            return Err(VerifyError::DifferentNames {
                robot: self.robot.name.clone(),
            });
        }
        let states = self.states()?;
        let mut random = Random::new(SEED + 1);
        let mut checks = vec![
            self.compare_second_derivation(&states)?,
            self.compare_peer(),
            self.power(&states, &mut random)?,
            self.drift(&states),
        ];
        checks.extend(self.base(&states, &mut random)?);
        checks.push(self.single(&states));
        Ok(checks)
    }

    fn states(&self) -> Result<Vec<State>, VerifyError> {
        let model = Interpreted::new(self.robot);
        let mut closure = LoopClosure::new(&model)?;
        let mut random = Random::new(SEED);
        let home = self.reference.conditioning(&closure.home().q);
        let mut states = Vec::new();
        for _ in 0..STATES {
            let mut draw = || closed_state(&model, &mut closure, &mut random, Reach::INDEPENDENT);
            let mut state = draw()?;
            for _ in 0..MAX_TRIES {
                if self.reference.conditioning(&state.q) >= MIN_CONDITIONING_RATIO * home {
                    break;
                }
                state = draw()?;
            }
            states.push(state);
        }
        Ok(states)
    }
}
