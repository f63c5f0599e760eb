//! The base parameters with their certificate.

use crate::model::Model;
use crate::spec::Spec;

use super::certificate::{Certificate, certify};
use super::{Base, derive};

/// Where the states of every certificate come from.
const SEED: u64 = 1;

/// Base parameters, and what is certain about them.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// The combinations.
    pub base: Base,
    /// The rank over all columns, sampled; or why there is none.
    pub certificate: Result<Certificate, String>,
    /// Whether the derived directions are all there are: their number and the
    /// certified rank add up to the number of columns. Derived directions bound
    /// the rank from above, samples from below.
    pub complete: bool,
}

/// Derives the base parameters of a mechanism that closes at `home`, and
/// certifies them.
pub fn analyse(spec: &Spec, model: &Model, home: &[f64]) -> Analysis {
    let certificate = certify(model, home, SEED)
        .map(|samples| samples.certificate())
        .map_err(|e| e.to_string());
    let certain = certificate.as_ref().ok().filter(|c| c.is_certain());
    let target = certain.map(|c| c.columns - c.rank);
    let base = derive(spec, model, target);
    Analysis {
        complete: target == Some(base.from_trees),
        base,
        certificate,
    }
}
