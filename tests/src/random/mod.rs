//! Specs of random mechanisms; the same seed gives the same spec.
//!
//! A tree is drawn with a home configuration; the second frame of each cut is computed so that the
//! loop closes there. Mobility and a choice of independent coordinates follow from ranks of the
//! second derivation. Draws that are singular, immobile or without mass are rejected and counted,
//! and the seed draws again.
//!
//! ```
//! use regen_tests::random;
//!
//! let drawn = random::sample(7);
//! assert!(drawn.sample.is_some_and(|s| s.text.contains("limbs:")));
//! ```

mod check;
mod complete;
mod draft;
mod draw;
mod elsewhere;
mod invalid;
mod shrink;
mod topology;

use std::collections::BTreeMap;

pub use check::{check_sample, check_text, closure, differences};
pub use complete::{Reject, Sample, complete};
pub use draft::{
    Actuation, Coupling, Cut, Draft, Frame, Joint, Kind, Limb, Placement, Side, cut_word,
};
pub use elsewhere::opened_elsewhere;
pub use invalid::check_invalid_variants;
pub use shrink::shrink;
pub use topology::TOPOLOGIES;

/// The result of drawing with one seed.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The first draw that makes a valid spec.
    pub sample: Option<Sample>,
    /// The number of rejected draws before it, by reason.
    pub rejects: BTreeMap<Reject, usize>,
}

/// The largest number of draws for a seed.
const ATTEMPTS: u64 = 60;

/// Draws the spec of a seed.
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
