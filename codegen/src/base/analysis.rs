//! The base parameters with their certificate.

use crate::model::Model;
use crate::spec::Spec;

use super::certificate::{Certificate, Samples, certify};
use super::null_completion::Sampled;
use super::{Base, derive_all};

/// Where the states of every certificate come from.
const SEED: u64 = 1;

/// Base parameters, and what is certain about them.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// The combinations.
    pub base: Base,
    /// The rank over all columns, sampled; or why there is none.
    pub certificate: Result<Certificate, String>,
    /// Whether the directions derived and completed are all there are: their
    /// number and the certified rank add up to the number of columns, and each is
    /// null at every sampled state. Derived directions bound the rank from above,
    /// samples from below.
    pub complete: bool,
}

/// Derives the base parameters of a mechanism that closes at `home`, and
/// certifies them.
pub fn analyse(spec: &Spec, model: &Model, home: &[f64]) -> Analysis {
    let samples = certify(model, home, SEED).map_err(|e| e.to_string());
    let certificate = samples.as_ref().map(Samples::certificate);
    let certificate = certificate.map_err(Clone::clone);
    let certain = certificate.as_ref().ok().filter(|c| c.is_certain());
    let target = certain.map(|c| c.columns - c.rank);
    let sampled = samples.as_ref().ok().filter(|_| target.is_some());
    let sampled = sampled.map(|samples| Sampled::new(samples, home, SEED));
    let base = derive_all(spec, model, target, sampled.as_ref());
    Analysis {
        complete: target == Some(base.from_trees + base.completed) && base.refuted == 0,
        base,
        certificate,
    }
}
