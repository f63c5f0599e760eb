//! Derivation of the base parameters together with the certificate of their number.

use crate::model::Model;
use crate::spec::Spec;

use super::certificate::{Certificate, Samples, certify};
use super::null_completion::NullCompletion;
use super::{Base, derive_with_completion, payloads};

/// Seed of the random states of every certificate, fixed so that results are reproducible.
const SEED: u64 = 1;

/// The base parameters of a mechanism, with the evidence for their number.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// The base parameters and the null space.
    pub base: Base,
    /// The rank over all columns from sampled states; or why it could not be sampled.
    pub certificate: Result<Certificate, String>,
    /// Whether the null space is proven complete: the number of derived and completed directions
    /// and the certified rank add up to the number of columns, and each direction is null at every
    /// sampled state. Derived directions bound the rank from above, samples from below.
    pub complete: bool,
}

/// Derives the base parameters of a mechanism and certifies their number.
///
/// `home` has one value per coordinate, in rad or m, and must satisfy the closure equations.
///
/// ```
/// use regen_codegen::{base, diag::Source, model, spec};
///
/// let text = "name: pendulum\nlimbs:\n  - name: arm\n    base: {rpy: [-pi/2, 0, 0]}\n    \
///             joints:\n      - {name: q1, type: revolute, body: 1, actuated: true}\n";
/// let spec = spec::parse(&Source::new("pendulum.yaml", text)).unwrap();
/// let model = model::build(&spec);
/// let analysis = base::analyse(&spec, &model, &[0.0]);
/// assert!(analysis.complete);
/// // Izz, mx and my: the moment of inertia about the axis, and the moments of the weight
/// assert_eq!(analysis.base.rank(), 3);
/// ```
pub fn analyse(spec: &Spec, model: &Model, home: &[f64]) -> Analysis {
    let samples = certify(model, home, SEED).map_err(|e| e.to_string());
    let certificate = samples.as_ref().map(Samples::certificate);
    let certificate = certificate.map_err(Clone::clone);
    let certain = certificate.as_ref().ok().filter(|c| c.is_certain());
    let target = certain.map(|c| c.columns - c.rank);
    let completion = samples.as_ref().ok().filter(|_| target.is_some());
    let completion = completion.map(|samples| NullCompletion::new(samples, home, SEED));
    let base = derive_with_completion(spec, model, target, completion.as_ref());
    // of payloads too: their directions are part of those of all columns
    let certificate = samples
        .as_ref()
        .map(|samples| payloads::certificate(samples, model))
        .map_err(Clone::clone);
    Analysis {
        complete: target == Some(base.from_trees + base.completed) && base.refuted == 0,
        base,
        certificate,
    }
}
