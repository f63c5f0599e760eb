//! Layer 3: null directions that the trees do not give, completed from samples.
//!
//! The columns that the derived directions eliminate are left out. Of the remaining columns the
//! samples need a part, and every other one is a linear combination of these. Its factors are
//! computed with 96 digits, recognised as exact numbers, and as functions of the geometry names
//! from samples at other values of these. Each direction is verified at fresh states.

mod elsewhere;
mod fit;
mod recognise;
mod relation;
mod shapes;

use crate::model::Model;
use crate::spec::Spec;
use crate::sym::Number;

use super::Exactness;
use super::certificate::{Float320, Samples, certify};
use super::field::{Element, Field};
use super::kept_columns;
use super::span::Vector;

use elsewhere::{Group, fixed_angles, groups, sample};
use fit::{Fit, SampledFactor, ScaledFactor};
pub use recognise::recognise;

/// The largest residual of a null direction, as a part of the largest number sampled.
const MAX_NULL_RESIDUAL: f64 = 1e-60;

/// The samples of a mechanism from which null directions are completed.
#[derive(Debug)]
pub(super) struct Sampled<'a> {
    samples: &'a Samples,
    home: &'a [f64],
    seed: u64,
}

/// The completed directions.
#[derive(Debug, Default)]
pub(super) struct Completed {
    /// The directions, each with how well its factors are known.
    pub(super) directions: Vec<(Vector, Exactness)>,
    /// Factors that are known as numbers only, each with the reason.
    pub(super) unrecognised: Vec<String>,
    /// Names that were not varied, so that a dependence of the factors on them is unknown, each
    /// with the reason.
    pub(super) unvaried_names: Vec<String>,
}

impl<'a> Sampled<'a> {
    pub(super) fn new(samples: &'a Samples, home: &'a [f64], seed: u64) -> Self {
        Sampled {
            samples,
            home,
            seed,
        }
    }

    /// The number of directions that are not null at the sampled states, which would be an error in
    /// their derivation.
    pub(super) fn refuted(&self, null: &[Vector]) -> usize {
        let columns = self.samples.certificate().columns;
        let part = |direction: &Vector| {
            let inside = direction.range(..columns);
            let inside: Vector = inside.map(|(c, e)| (*c, e.clone())).collect();
            self.samples.left_over(&values(&inside, columns))
        };
        null.iter()
            .filter(|direction| part(direction) > MAX_NULL_RESIDUAL)
            .count()
    }

    /// Completes the null space `null` by the directions that the samples have in addition.
    pub(super) fn complete(
        &self,
        field: &mut Field,
        spec: &Spec,
        model: &Model,
        null: &[Vector],
        order: &[usize],
        requested: usize,
    ) -> Completed {
        let mut completed = Completed::default();
        let certificate = self.samples.certificate();
        if null.len() + certificate.rank >= certificate.columns {
            return completed;
        }
        let derived = kept_columns::reduce(field, null, order, requested).rows;
        // columns eliminated last are kept first; columns that the derived directions eliminate
        // come at the end
        let (last, first): (Vec<usize>, Vec<usize>) =
            order.iter().rev().partition(|c| derived.contains_key(c));
        let all: Vec<usize> = first.iter().chain(&last).copied().collect();
        let kept = self.samples.independent(&all);
        let missing: Vec<usize> = first.into_iter().filter(|c| !kept.contains(c)).collect();
        let Some(combinations) = self.samples.combinations(&kept) else {
            return completed;
        };
        let Ok(fresh) = certify(model, self.home, self.seed + 1) else {
            return completed;
        };
        let scaled_samples = ScaledSamples::new(spec, certificate.rank, self.seed);
        completed
            .unvaried_names
            .clone_from(&scaled_samples.unvaried_names);
        for column in missing {
            let mut numeric = vec![Float320::ZERO; certificate.columns];
            numeric[column] = Float320::ONE;
            for (k, x) in kept.iter().zip(&combinations[column]) {
                numeric[*k] = -*x;
            }
            let forms = shapes::equivalent_supports(model, null, &numeric);
            let mut best: Option<Recognised> = None;
            for support in std::iter::once(shapes::support(&numeric)).chain(forms) {
                let Some(found) = self.recognise(&scaled_samples, support) else {
                    continue;
                };
                if best.as_ref().is_none_or(|b| found.doubt() < b.doubt()) {
                    best = Some(found);
                }
                if best.as_ref().is_some_and(|b| b.doubt() == 0) {
                    break;
                }
            }
            let Some(best) = best else { continue };
            let direction = best.direction(field, &scaled_samples.groups);
            if fresh.left_over(&values(&direction, certificate.columns)) < MAX_NULL_RESIDUAL {
                let exactness = best.exactness(!scaled_samples.unvaried_names.is_empty());
                completed.directions.push((direction, exactness));
                completed.unrecognised.extend(best.notes(model));
            }
        }
        completed
    }

    /// Recognises the factors of the null direction within the given columns.
    fn recognise(&self, scaled_samples: &ScaledSamples, support: Vec<usize>) -> Option<Recognised> {
        let values = self.samples.circuit(&support)?;
        let elsewhere = scaled_samples.circuits(&support);
        let factors = values.into_iter().enumerate();
        let factors = factors.map(|(k, value)| elsewhere.factor(scaled_samples, value, k));
        Some(Recognised {
            factors: factors.collect(),
            support,
        })
    }
}

/// The form in which a factor was recognised.
#[derive(Clone, Debug)]
enum Factor {
    /// A function of the names.
    Function(Fit),
    /// An exact number, valid at the given values.
    Constant(Number),
    /// A number of which only the digits are known.
    Digits(Float320),
}

/// A null direction with its recognised factors.
#[derive(Clone, Debug)]
struct Recognised {
    support: Vec<usize>,
    factors: Vec<Factor>,
}

impl Recognised {
    /// A measure of how far the factors are from functions of the names: 0 if all of them are.
    fn doubt(&self) -> usize {
        let doubts = self.factors.iter().map(|factor| match factor {
            Factor::Function(_) => 0,
            Factor::Constant(_) => 1,
            Factor::Digits(_) => 1000,
        });
        doubts.sum()
    }

    /// How well the factors are known. If some names were `unvaried`, any factor might
    /// depend on them, except the 1 of a direction with a single parameter.
    fn exactness(&self, unvaried: bool) -> Exactness {
        let least = if unvaried && self.support.len() > 1 {
            Exactness::AtThisGeometry
        } else {
            Exactness::Symbolic
        };
        let factors = self.factors.iter().map(|factor| match factor {
            Factor::Function(_) => Exactness::Symbolic,
            // 0 and 1 are taken as independent of the names
            Factor::Constant(value) if value.is_zero() || value.is_one() => least,
            Factor::Constant(_) => Exactness::AtThisGeometry,
            Factor::Digits(_) => Exactness::Numeric,
        });
        factors.fold(least, Exactness::max)
    }

    fn direction(&self, field: &mut Field, groups: &[Group]) -> Vector {
        let mut direction = Vector::new();
        for (column, factor) in self.support.iter().zip(&self.factors) {
            let element = match factor {
                Factor::Function(fit) => fit.element(field, groups),
                Factor::Constant(value) => Element::exact(value.clone()),
                Factor::Digits(value) => {
                    let (negative, magnitude, exponent) = value.binary();
                    Element::exact(Number::from_binary(negative, magnitude, exponent))
                }
            };
            if !element.is_zero() {
                direction.insert(*column, element);
            }
        }
        direction
    }

    /// A note for each factor that is known by its digits only.
    fn notes(&self, model: &Model) -> Vec<String> {
        let label = |c: usize| &model.parameters[c].label;
        let digits = self.support.iter().zip(&self.factors);
        digits
            .filter(|(_, factor)| matches!(factor, Factor::Digits(_)))
            .map(|(column, _)| {
                format!(
                    "{} beside {}: no short expression has its digits",
                    label(*column),
                    label(self.support[0])
                )
            })
            .collect()
    }
}

fn values(direction: &Vector, columns: usize) -> Vec<Float320> {
    let mut values = vec![Float320::ZERO; columns];
    for (column, element) in direction {
        values[*column] = Float320::from_number(element.value());
    }
    values
}

/// Samples of the mechanism at other values of the names.
struct ScaledSamples {
    groups: Vec<Group>,
    /// The factor by which a single group is scaled.
    scale: Number,
    alone: Vec<Option<Samples>>,
    /// Samples with all groups scaled that can be, with the scales.
    together: Vec<(Vec<Number>, Samples)>,
    /// Names that were not varied, or only in proportion, each with the reason.
    unvaried_names: Vec<String>,
}

impl ScaledSamples {
    fn new(spec: &Spec, rank: usize, seed: u64) -> ScaledSamples {
        let mut groups = groups(spec);
        let scale = Number::ratio(33, 32).unwrap_or_else(Number::one);
        let look = |scales: &[(&Group, Number)]| {
            sample(spec, scales, seed).filter(|s| s.certificate().rank == rank)
        };
        let mut alone: Vec<Option<Samples>> = groups
            .iter()
            .map(|group| look(&[(group, scale.clone())]))
            .collect();
        let mut unvaried_names = fixed_angles(spec);
        // lengths that cannot be changed alone may still be scaled together
        let stuck: Vec<usize> = (0..groups.len()).filter(|&k| alone[k].is_none()).collect();
        let merged = Group::merged(stuck.iter().map(|&k| &groups[k]));
        let grown = merged.and_then(|group| Some((look(&[(&group, scale.clone())])?, group)));
        let names: Vec<&str> = stuck.iter().flat_map(|&k| groups[k].members()).collect();
        if let Some((samples, group)) = grown {
            unvaried_names.push(format!(
                "{} in proportion only: with other ratios the loops do not close, or count otherwise",
                names.join(", ")
            ));
            for &k in stuck.iter().rev() {
                groups.remove(k);
                alone.remove(k);
            }
            groups.push(group);
            alone.push(Some(samples));
        } else if !names.is_empty() {
            unvaried_names.push(format!(
                "{} as given only: with other values the loops do not close, or count otherwise",
                names.join(", ")
            ));
        }
        let mut together = Vec::new();
        // scales that are unrelated fractions
        for step in [37_717_i64, -29_483] {
            let scales: Vec<Number> = (1..)
                .zip(&alone)
                .map(|(k, samples)| {
                    let shift = if samples.is_some() {
                        step * k % 50_021
                    } else {
                        0
                    };
                    Number::ratio(1_000_003 + shift, 1_000_003).unwrap_or_else(Number::one)
                })
                .collect();
            let all: Vec<(&Group, Number)> = groups.iter().zip(scales.iter().cloned()).collect();
            if let Some(samples) = look(&all) {
                together.push((scales, samples));
            }
        }
        ScaledSamples {
            groups,
            scale,
            alone,
            together,
            unvaried_names,
        }
    }

    /// The null direction within the given columns, for all values of the names.
    fn circuits(&self, support: &[usize]) -> ScaledCircuits {
        let alone = self.alone.iter();
        let together = self.together.iter();
        ScaledCircuits {
            alone: alone.map(|s| s.as_ref()?.circuit(support)).collect(),
            together: together
                .filter_map(|(scales, s)| Some((scales.clone(), s.circuit(support)?)))
                .collect(),
        }
    }
}

/// The null direction at other values of the names.
struct ScaledCircuits {
    alone: Vec<Option<Vec<Float320>>>,
    together: Vec<(Vec<Number>, Vec<Float320>)>,
}

impl ScaledCircuits {
    /// Recognises a factor: as a function of the names, else as an exact number, else by its
    /// digits.
    fn factor(&self, scaled_samples: &ScaledSamples, value: Float320, k: usize) -> Factor {
        let together = self.together.iter().map(|(scales, values)| ScaledFactor {
            scales: scales.clone(),
            value: values[k],
        });
        let alone = self.alone.iter();
        let observed = SampledFactor {
            value,
            alone: alone.map(|values| Some(values.as_ref()?[k])).collect(),
            together: together.collect(),
        };
        if let Some(fit) = Fit::find(&observed, &scaled_samples.groups, &scaled_samples.scale) {
            return Factor::Function(fit);
        }
        recognise(&value).map_or(Factor::Digits(value), Factor::Constant)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The mass of a pendulum's body has no effect; its moment of inertia about the axis has.
    #[test]
    fn directions_that_move_what_is_sampled_are_refuted() {
        let text = "name: one\nlimbs: [{name: arm, joints: \
                    [{name: q1, type: revolute, body: 1, actuated: true}]}]\n";
        let source = crate::diag::Source::new("one.yaml", text);
        let model = crate::model::build(&crate::spec::parse(&source).unwrap());
        let samples = certify(&model, &[0.0], 1).unwrap();
        let sampled = Sampled::new(&samples, &[0.0], 1);
        let along = |label: &str| {
            let column = model.parameters.iter().position(|p| p.label == label);
            Vector::from([(column.unwrap(), Element::one())])
        };
        let (unseen, seen) = (along("m(1)"), along("Izz(1)"));
        assert_eq!(sampled.refuted(&[]), 0);
        assert_eq!(sampled.refuted(std::slice::from_ref(&unseen)), 0);
        assert_eq!(sampled.refuted(&[unseen, seen.clone(), seen]), 2);
    }
}
