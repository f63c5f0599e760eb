//! Checks that every random mechanism must pass, whatever a test adds to it: the engine against the
//! second derivation, and the base against singular values.

use crate::base::{Agreement, Derivation, states_for};
use crate::derived::Derived;
use crate::engine::check_engine;
use crate::random_spec;
use crate::reference::Mechanism;

/// Random trees, then random loops, each with the seed of its random states.
///
/// # Errors
/// When a loop cannot be drawn.
pub fn trees_and_loops(trees: u64, loops: u64) -> Result<Vec<(u64, Random)>, String> {
    let trees = (0..trees).map(|seed| {
        Ok(Random {
            text: random_spec::tree(seed),
            is_tree: true,
        })
    });
    let loops = (0..loops).map(|seed| {
        let text = random_spec::closed_loop(seed)?;
        Ok(Random {
            text,
            is_tree: false,
        })
    });
    let all: Result<Vec<Random>, String> = trees.chain(loops).collect();
    Ok((0..).zip(all?).collect())
}

/// A random mechanism.
#[derive(Clone, Debug)]
pub struct Random {
    /// Its description.
    pub text: String,
    /// Whether it has no loop.
    pub is_tree: bool,
}

/// Compares every function of a mechanism with the second derivation at two random states.
///
/// # Errors
/// What differs, with the description.
pub fn agrees_with_reference(mechanism: &Mechanism, text: &str, seed: u64) -> Result<(), String> {
    let derived = Derived::without_base("random.yaml", text)?;
    check_engine(&derived, mechanism, seed, 2)
        .map(|_| ())
        .map_err(|e| format!("{e}\n{text}"))
}

/// Compares a derived base with the regressor of the second derivation at random states; `None` for
/// a mechanism that cannot move.
///
/// # Errors
/// When the mechanism cannot be read, or the combinations reproduce the regressor with a larger
/// relative error than `bound`.
pub fn agreement(
    derivation: &Derivation,
    text: &str,
    seed: u64,
    bound: f64,
) -> Result<Option<Agreement>, String> {
    let mechanism = Mechanism::from_yaml(text)?;
    if mechanism.dof() == 0 {
        return Ok(None);
    }
    let states = mechanism.random_states(seed, states_for(&mechanism))?;
    let found = derivation.agreement(&mechanism, &states, &Derivation::value)?;
    if found.error < bound {
        Ok(Some(found))
    } else {
        Err(format!("{found:?}\n{text}"))
    }
}

/// As [`agreement`], and the number of base parameters is the rank of the singular values.
///
/// # Errors
/// Those of [`agreement`], and another rank.
pub fn has_numeric_rank(
    derivation: &Derivation,
    random: &Random,
    seed: u64,
    bound: f64,
) -> Result<(), String> {
    let Some(found) = agreement(derivation, &random.text, seed, bound)? else {
        return Ok(());
    };
    // the singular values of a loop that hardly moves have no gap from which a rank follows
    let is_decisive = random.is_tree || found.gap > 1e3;
    let kept = derivation.kept().len();
    if is_decisive && kept != found.rank {
        return Err(format!("{kept} kept, {found:?}\n{}", random.text));
    }
    Ok(())
}
