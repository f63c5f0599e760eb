//! Layer 3: null directions that no tree shows, completed from samples.
//!
//! With the columns that trees eliminate gone, every other column that the
//! samples do not keep is a combination of those they keep. Its factors are
//! found with 96 digits, recognised as exact numbers, and as functions of the
//! geometry names from samples at other values of these. Each direction is
//! verified at fresh states.

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
use fit::{Elsewhere, Fit, Observed};
pub use recognise::recognise;

/// A direction is null where it leaves at most this part of the largest
/// number sampled.
const NULL: f64 = 1e-60;

/// A sampled mechanism.
#[derive(Debug)]
pub(super) struct Sampled<'a> {
    samples: &'a Samples,
    home: &'a [f64],
    seed: u64,
}

/// Completed directions.
#[derive(Debug, Default)]
pub(super) struct Completed {
    /// With how well their factors are known.
    pub(super) directions: Vec<(Vector, Exactness)>,
    /// Factors that are numbers only, and why.
    pub(super) unrecognised: Vec<String>,
    /// Names that no factor was seen to depend on, since they were not varied, and
    /// why.
    pub(super) held: Vec<String>,
}

impl<'a> Sampled<'a> {
    pub(super) fn new(samples: &'a Samples, home: &'a [f64], seed: u64) -> Self {
        Sampled {
            samples,
            home,
            seed,
        }
    }

    /// How many directions are not null at the sampled states, which would be an
    /// error of what derived them.
    pub(super) fn refuted(&self, null: &[Vector]) -> usize {
        let columns = self.samples.certificate().columns;
        let part = |direction: &Vector| {
            let inside = direction.range(..columns);
            let inside: Vector = inside.map(|(c, e)| (*c, e.clone())).collect();
            self.samples.left_over(&values(&inside, columns))
        };
        null.iter()
            .filter(|direction| part(direction) > NULL)
            .count()
    }

    /// What is missing from a null space.
    pub(super) fn complete(
        &self,
        field: &mut Field,
        spec: &Spec,
        model: &Model,
        null: &[Vector],
        order: &[usize],
        asked: usize,
    ) -> Completed {
        let mut completed = Completed::default();
        let certificate = self.samples.certificate();
        if null.len() + certificate.rank >= certificate.columns {
            return completed;
        }
        let derived = kept_columns::reduce(field, null, order, asked).rows;
        // what is eliminated last is kept first; what trees eliminate is not kept
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
        let around = Around::new(spec, certificate.rank, self.seed);
        completed.held.clone_from(&around.held);
        for column in missing {
            let mut numeric = vec![Float320::ZERO; certificate.columns];
            numeric[column] = Float320::ONE;
            for (k, x) in kept.iter().zip(&combinations[column]) {
                numeric[*k] = -*x;
            }
            let forms = shapes::same(model, null, &numeric);
            let mut best: Option<Recognised> = None;
            for support in std::iter::once(shapes::support(&numeric)).chain(forms) {
                let Some(found) = self.recognise(&around, support) else {
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
            let direction = best.direction(field, &around.groups);
            if fresh.left_over(&values(&direction, certificate.columns)) < NULL {
                let exactness = best.exactness(!around.held.is_empty());
                completed.directions.push((direction, exactness));
                completed.unrecognised.extend(best.notes(model));
            }
        }
        completed
    }

    /// Recognises the one direction within some columns.
    fn recognise(&self, around: &Around, support: Vec<usize>) -> Option<Recognised> {
        let values = self.samples.circuit(&support)?;
        let elsewhere = around.circuits(&support);
        let factors = values.into_iter().enumerate();
        let factors = factors.map(|(k, value)| elsewhere.factor(around, value, k));
        Some(Recognised {
            factors: factors.collect(),
            support,
        })
    }
}

/// What a factor turned out to be.
#[derive(Clone, Debug)]
enum Factor {
    /// A function of the names.
    Function(Fit),
    /// Exact at the given values.
    Constant(Number),
    /// Its digits.
    Digits(Float320),
}

/// A direction with what its factors are.
#[derive(Clone, Debug)]
struct Recognised {
    support: Vec<usize>,
    factors: Vec<Factor>,
}

impl Recognised {
    /// How much of it is not a function of the names.
    fn doubt(&self) -> usize {
        let doubts = self.factors.iter().map(|factor| match factor {
            Factor::Function(_) => 0,
            Factor::Constant(_) => 1,
            Factor::Digits(_) => 1000,
        });
        doubts.sum()
    }

    /// How well the factors are known; with names that are `held`, these may hide in
    /// any factor but the 1 of a lone parameter.
    fn exactness(&self, held: bool) -> Exactness {
        let least = if held && self.support.len() > 1 {
            Exactness::AtThisGeometry
        } else {
            Exactness::Symbolic
        };
        let factors = self.factors.iter().map(|factor| match factor {
            Factor::Function(_) => Exactness::Symbolic,
            // 0 and 1 are what they are
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

    /// Why some factors are numbers.
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

/// Samples at other values of the names.
struct Around {
    groups: Vec<Group>,
    /// What a group is scaled by alone.
    scale: Number,
    alone: Vec<Option<Samples>>,
    /// All groups that can be scaled, with their scales.
    together: Vec<(Vec<Number>, Samples)>,
    /// Names that were not varied, or only in proportion, and why.
    held: Vec<String>,
}

impl Around {
    fn new(spec: &Spec, rank: usize, seed: u64) -> Around {
        let mut groups = groups(spec);
        let scale = Number::ratio(33, 32).unwrap_or_else(Number::one);
        let look = |scales: &[(&Group, Number)]| {
            sample(spec, scales, seed).filter(|s| s.certificate().rank == rank)
        };
        let mut alone: Vec<Option<Samples>> = groups
            .iter()
            .map(|group| look(&[(group, scale.clone())]))
            .collect();
        let mut held = fixed_angles(spec);
        // lengths that must keep their proportion still may grow together
        let stuck: Vec<usize> = (0..groups.len()).filter(|&k| alone[k].is_none()).collect();
        let merged = Group::merged(stuck.iter().map(|&k| &groups[k]));
        let grown = merged.and_then(|group| Some((look(&[(&group, scale.clone())])?, group)));
        let names: Vec<&str> = stuck.iter().flat_map(|&k| groups[k].members()).collect();
        if let Some((samples, group)) = grown {
            held.push(format!(
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
            held.push(format!(
                "{} as given only: with other values the loops do not close, or count otherwise",
                names.join(", ")
            ));
        }
        let mut together = Vec::new();
        // numerators and denominators with nothing in common
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
        Around {
            groups,
            scale,
            alone,
            together,
            held,
        }
    }

    /// The direction within the same columns, everywhere.
    fn circuits(&self, support: &[usize]) -> Circuits {
        let alone = self.alone.iter();
        let together = self.together.iter();
        Circuits {
            alone: alone.map(|s| s.as_ref()?.circuit(support)).collect(),
            together: together
                .filter_map(|(scales, s)| Some((scales.clone(), s.circuit(support)?)))
                .collect(),
        }
    }
}

/// A direction at other values of the names.
struct Circuits {
    alone: Vec<Option<Vec<Float320>>>,
    together: Vec<(Vec<Number>, Vec<Float320>)>,
}

impl Circuits {
    /// What a factor is: a function of the names, else an exact number.
    fn factor(&self, around: &Around, value: Float320, k: usize) -> Factor {
        let together = self.together.iter().map(|(scales, values)| Elsewhere {
            scales: scales.clone(),
            value: values[k],
        });
        let alone = self.alone.iter();
        let observed = Observed {
            value,
            alone: alone.map(|values| Some(values.as_ref()?[k])).collect(),
            together: together.collect(),
        };
        if let Some(fit) = Fit::find(&observed, &around.groups, &around.scale) {
            return Factor::Function(fit);
        }
        recognise(&value).map_or(Factor::Digits(value), Factor::Constant)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The mass of a pendulum's body has no effect, its moment about the axis has.
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
