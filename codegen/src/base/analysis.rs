//! Derivation of the base parameters together with the certificate of their number.

use crate::model::Model;
use crate::spec::Spec;

use super::certificate::{Certificate, certify, condition_of_kept};
use super::null_completion::NullCompletion;
use super::{Base, derive_with_completion, meant, payloads};

/// Seed of the random states of every certificate, fixed so that results are reproducible.
const SEED: u64 = 1;
/// The seed of the last states that are sampled where those before may have been special.
const LAST_SEED: u64 = 7;
/// The seed of the random motions over which a poor condition is measured; none that a certificate
/// takes.
const FURTHER_SEED: u64 = 11;

/// The base parameters of a mechanism, with the evidence for their number.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// The base parameters and the null space.
    pub base: Base,
    /// The condition of the sampled rows in the kept columns, each column scaled to length 1: the
    /// largest singular value divided by the smallest; infinite above 1e7. Of several groups of
    /// columns (payloads) the largest. Above 1000 it is measured again with rows of the regressor
    /// at random motions. `None` where the base is not complete.
    pub condition: Option<f64>,
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
    let Some((restored, replaced)) = meant::restored(model) else {
        return analyse_as_given(spec, model, home);
    };
    let mut analysis = analyse_as_given(spec, &restored, home);
    analysis.base.coincidences.extend(replaced);
    analysis
}

fn analyse_as_given(spec: &Spec, model: &Model, home: &[f64]) -> Analysis {
    let mut samples = match certify(model, home, SEED) {
        Ok(samples) => samples,
        Err(e) => {
            return Analysis {
                base: derive_with_completion(spec, model, None, None),
                condition: None,
                certificate: Err(e.to_string()),
                complete: false,
            };
        }
    };
    let mut seed = SEED;
    loop {
        let certificate = samples.certificate();
        let target = certificate.columns - certificate.rank;
        let target = certificate.is_certain().then_some(target);
        let completion = NullCompletion::new(&samples, home, seed);
        let base = derive_with_completion(spec, model, target, Some(&completion));
        let null = base.from_trees + base.completed;
        // where both bounds meet, it suffices that what was kept is not rounding
        let met = certificate.has_sure_pivots() && certificate.columns == certificate.rank + null;
        let complete = (target == Some(null) || met) && base.refuted == 0;
        // before a gap between both bounds is reported, other states are sampled: samples that find
        // fewer than there are were special
        if !complete && seed < LAST_SEED {
            // the completion has compared with the seed that follows
            seed += 2;
            if certify(model, home, seed).is_ok_and(|other| samples.join(other)) {
                continue;
            }
        }
        return Analysis {
            complete,
            condition: complete.then(|| {
                let is_kept = |c: &usize| base.parameters.iter().any(|p| p.column == *c);
                let replaced = base.known.iter().flat_map(|k| {
                    let terms = k.terms.iter();
                    terms.map(|t| (k.column, t.column, t.value.to_f64()))
                });
                let replaced: Vec<(usize, usize, f64)> = replaced.collect();
                condition_of_kept(&samples, model, (home, FURTHER_SEED), &is_kept, &replaced)
            }),
            base,
            // of payloads too: their directions are part of those of all columns
            certificate: Ok(payloads::certificate(&samples, model)),
        };
    }
}
