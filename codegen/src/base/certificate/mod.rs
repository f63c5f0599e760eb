//! The certificate: the rank of rows sampled at random closed states of the mechanism, on the
//! assembly branch of home, in multiple precision.
//!
//! The rows are energies, not forces. A combination of inertial and rotor parameters is without
//! effect exactly when the kinetic energy is 0 and the potential energy constant whatever the
//! motion, and both need neither accelerations nor the derivatives of X. With 96 digits, rounding
//! lies tens of orders of magnitude below everything else, so that no tolerance has to be chosen.
//! Samples bound the rank from below; directions derived exactly bound it from above: where the two
//! meet, the base is proven.

mod body;
mod closed_state;
mod condition;
mod evaluate;
mod float320;
mod linear;
mod motion;
mod rank;
mod rows;
mod sparse;
mod states;
mod units;

use core::fmt;

use crate::kinematics::{Frames, Geometry};
use crate::model::Model;
use crate::sym::Graph;

pub(in crate::base) use body::polar;
pub(in crate::base) use condition::condition_of_kept;
pub(in crate::base) use states::Random;

pub use closed_state::{ClosedState, LinkMotion, Vector3, closed_states, rates};
pub use float320::{DIGITS, Float320};
pub use linear::{Relation, rank_of, relations};
pub use rank::{Certificate, Samples};

use motion::Pace;
use rows::Rows;
use states::{State, Walk};
use units::Units;

/// Number of additional states, sampled at the end, that must not raise the rank.
const FRESH_STATES: usize = 2;

/// Why there is no certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CertificateError {
    /// Home does not close in multiple precision. If a closure holds only to the digits of the
    /// lengths and angles given, its redundant equations contradict each other beyond these digits.
    Inexact,
    /// Too few closed states could be reached from home.
    TooFewStates {
        /// How many closed states were reached.
        found: usize,
        /// How many closed states are needed.
        needed: usize,
    },
    /// The mechanism needs more expressions than a graph can hold.
    TooLarge,
}

impl fmt::Display for CertificateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CertificateError::Inexact => write!(
                f,
                "the closure holds only to the digits given for lengths and angles; \
                 write them as exact expressions"
            ),
            CertificateError::TooFewStates { found, needed } => write!(
                f,
                "only {found} of {needed} closed states could be reached from home"
            ),
            CertificateError::TooLarge => {
                write!(
                    f,
                    "the mechanism takes more expressions than can be told apart"
                )
            }
        }
    }
}

impl core::error::Error for CertificateError {}

/// Samples a mechanism that closes at `home` (one value per coordinate, rad or m) at random closed
/// states. The same seed gives the same states.
///
/// # Errors
/// If home does not close in multiple precision, if not enough closed states can be reached from
/// it, or if the mechanism is too large.
pub fn certify(model: &Model, home: &[f64], seed: u64) -> Result<Samples, CertificateError> {
    let needed = rows::states_needed(model);
    let energies = |rows: &mut Rows<'_>, state: &State, walk: &mut Walk<'_>| {
        rows.sample(state, walk.random()).is_some()
    };
    sampled(model, home, seed, energies, |sample, units| {
        let (first, states) = sample(needed)?;
        let mut samples = Samples::new(first, rows::column_units(model, units), states);
        // No number of rows is a proof, as each state might raise the rank by one only. But energies
        // are analytic on the branch: as long as a direction passes for null that is not, almost
        // every fresh state reveals it.
        if needed == 0 {
            return Ok(samples);
        }
        loop {
            let (fresh, states) = sample(FRESH_STATES)?;
            if !samples.extend(fresh, states) {
                return Ok(samples);
            }
        }
    })
}

/// The rows of the regressor at random motions through a number of states.
fn rows_in_motion(
    model: &Model,
    home: &[f64],
    seed: u64,
    states: usize,
) -> Result<Vec<sparse::Row>, CertificateError> {
    let pace = Pace::of(model);
    let forces = |rows: &mut Rows<'_>, state: &State, walk: &mut Walk<'_>| {
        rows.sample_motion(state, walk, pace).is_some()
    };
    sampled(model, home, seed, forces, |sample, _| Ok(sample(states)?.0))
}

/// Gives the function that samples further states, and returns their rows and the number of all
/// states so far. `add_rows` adds the rows of a state; it returns false if the state has none.
fn sampled<T>(
    model: &Model,
    home: &[f64],
    seed: u64,
    add_rows: impl Fn(&mut Rows<'_>, &State, &mut Walk<'_>) -> bool,
    use_samples: impl FnOnce(&mut Sampler<'_>, Units) -> Result<T, CertificateError>,
) -> Result<T, CertificateError> {
    // a separate graph, with only the expressions to be sampled; its first symbols are the
    // coordinates
    let mut g = Graph::new();
    for coordinate in &model.coordinates {
        g.symbol(&coordinate.name);
    }
    // their rates follow, for effort terms
    for name in rows::rate_names(model) {
        g.symbol(&name);
    }
    g.set_naming(false);
    let frames = Frames::new(&mut g, model, Geometry::Values);
    let equations = crate::constraints::world_equations(&mut g, &frames, model, None);
    let expressions = rows::Expressions::new(&mut g, &frames, model);
    if g.is_full() {
        return Err(CertificateError::TooLarge);
    }

    let units = Units::of(model, home);
    let mut walk = Walk::new(&g, &equations, model, home, seed, units)?;
    let mut rows = Rows::new(&g, model, &expressions, rows::states_needed(model), units);
    let mut found = 0;
    let mut sample = |count: usize| {
        let needed = found + count;
        while found < needed {
            let state = walk
                .next()
                .ok_or(CertificateError::TooFewStates { found, needed })?;
            if add_rows(&mut rows, &state, &mut walk) {
                found += 1;
            }
        }
        Ok((rows.take(), found))
    };
    use_samples(&mut sample, units)
}

/// Samples a number of further states.
type Sampler<'s> = dyn FnMut(usize) -> Result<(Vec<sparse::Row>, usize), CertificateError> + 's;
