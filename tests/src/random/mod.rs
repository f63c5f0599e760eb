//! Specs of mechanisms that nobody thought of: the same for the same seed.
//!
//! A tree is drawn with a home configuration; each cut's second frame is then written so that it
//! closes there. Mobility and a choice of independent coordinates come from ranks of the second
//! derivation. What is singular, immobile or without mass is drawn again, and counted.
//!
//! ```
//! use regen_tests::random;
//!
//! let drawn = random::sample(7);
//! assert!(drawn.sample.is_some_and(|s| s.text.contains("limbs:")));
//! ```

mod complete;
mod draft;
mod draw;
mod elsewhere;
mod judge;
mod shrink;
mod spoil;
mod topology;

use std::collections::BTreeMap;

pub use complete::{Reject, Sample, complete};
pub use draft::{
    Actuation, Coupling, Cut, Draft, Frame, Joint, Kind, Limb, Placement, Side, cut_word,
};
pub use elsewhere::opened_elsewhere;
pub use judge::{closure, differences, judge, judge_text};
pub use shrink::shrink;
pub use spoil::spoil;
pub use topology::TOPOLOGIES;

/// What a seed gave.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The first of its draws that is a spec.
    pub sample: Option<Sample>,
    /// How many draws before it were none, and why.
    pub rejects: BTreeMap<Reject, usize>,
}

/// So many draws are made for a seed.
const ATTEMPTS: u64 = 60;

/// The spec of a seed.
pub fn sample(seed: u64) -> Drawn {
    let mut rejects = BTreeMap::new();
    for attempt in 0..ATTEMPTS {
        match complete(&topology::draft(seed, attempt)) {
            Ok(sample) => {
                let sample = Some(sample);
                return Drawn { sample, rejects };
            }
            Err(reject) => *rejects.entry(reject).or_default() += 1,
        }
    }
    Drawn {
        sample: None,
        rejects,
    }
}
