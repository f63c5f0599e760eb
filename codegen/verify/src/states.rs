//! Random closed states near home, the same on every machine.

use regen_interpreted::Interpreted;
use regen_reference::{Random, State};
use regen_runtime::{LoopClosure, Outcome};

use crate::error::VerifyError;

/// The seed of the random states of all checks. Other random numbers use the next seed, so that the
/// states do not depend on them.
pub(crate) const SEED: u64 = 1;

/// Largest number of attempts to find a closed state; each halves the distance from home.
const MAX_TRIES: usize = 8;

/// The initial distance of the independent coordinates from home, in rad, and for prismatic
/// coordinates as a multiple of the mechanism's length, for trees and for mechanisms with loops.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    tree: f64,
    loops: f64,
}

impl Reach {
    /// For comparisons with finite differences: trees close anywhere, a loop is about as large as
    /// its links, some tenths of a metre.
    pub(crate) const IDENTITIES: Self = Self {
        tree: 1.0,
        loops: 0.2,
    };
    /// For bounds computed from rounding, which do not depend on the distance in a tree.
    pub(crate) const INDEPENDENT: Self = Self {
        tree: 2.0,
        loops: 0.2,
    };
    /// For ranks: as far as states go without leaving the range for which mechanisms are built. The
    /// wider the states, the clearer the numeric rank.
    pub(crate) const RANKS: Self = Self {
        tree: 3.0,
        loops: 0.4,
    };
}

/// A random closed state with independent coordinates near home, closer if it does not close.
pub(crate) fn closed_state(
    model: &Interpreted<'_>,
    closure: &mut LoopClosure<'_, Interpreted<'_>>,
    random: &mut Random,
    reach: Reach,
) -> Result<State, VerifyError> {
    let info = model.info();
    let home: Vec<f64> = info
        .independent
        .iter()
        .filter_map(|&k| info.home.get(k).copied())
        .collect();
    // prismatic coordinates are scaled by the mechanism's size, drives by their ratio
    let units: Vec<f64> = info
        .independent
        .iter()
        .map(|&k| {
            let joint = info.joints.get(k);
            joint.map_or(1.0, |j| j.reach(1.0, closure.length_unit()))
        })
        .collect();
    let mut reach = if info.rows == 0 {
        reach.tree
    } else {
        reach.loops
    };
    let mut outcome = Outcome::Closed;
    for _ in 0..MAX_TRIES {
        let mut about = |middle: &[f64], reach: f64| -> Vec<f64> {
            let both = middle.iter().zip(&units);
            both.map(|(x, unit)| x + reach * unit * random.signed())
                .collect()
        };
        let still = vec![0.0; home.len()];
        let q = about(&home, reach);
        let qd = about(&still, 1.0);
        let qdd = about(&still, 1.0);
        let found = closure.solve_state(&q, &qd, &qdd)?;
        if found.outcome == Outcome::Closed {
            return Ok(State {
                q: found.q,
                qd: found.qd,
                qdd: found.qdd,
            });
        }
        outcome = found.outcome;
        reach /= 2.0;
    }
    Err(VerifyError::NotClosed {
        robot: info.name.to_owned(),
        outcome,
    })
}
