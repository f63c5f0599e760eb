//! Layer 3: completes the null space of the regressor by null directions that layer 1 (`tree.rs`,
//! the null directions of one tree) and layer 2 (`trees.rs`, the sum over spanning trees) do not
//! derive.
//!
//! The columns that the derived directions eliminate are left out. Among the remaining columns of
//! the sampled regressor, a maximal set of linearly independent columns is chosen; each other
//! column is a linear combination of these, which gives one null direction. The factors of the
//! combination are computed with 96 digits and recognised as exact numbers. From samples of the
//! mechanism with scaled geometry they are also recognised as functions of the geometry names. Each
//! direction is verified at fresh random states.
//!
//! The null direction with a given support (its nonzero columns) is called a circuit, as in matroid
//! theory: columns that are linearly dependent while each proper subset of them is independent have
//! a null direction that is unique up to scale.

mod fit;
mod lattice;
mod recognise;
mod relation;
pub(super) mod scaled_geometry;
mod shapes;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use crate::model::Model;
use crate::spec::Spec;
use crate::sym::Number;

use super::Exactness;
use super::certificate::{Float320, Samples, certify};
use super::field::{Element, Field};
use super::geometry::angle_names;
use super::kept_columns;
use super::span::Vector;

use fit::{Fit, SampledFactor, ScaledFactor};
pub use recognise::recognise;
use scaled_geometry::{Group, fixed_angles, groups, sample, sample_of, scaled};

/// The largest residual of a null direction, relative to the largest sampled entry times the
/// largest entry of the direction (see `Samples::scaled_residual`): the samples carry 96 digits, so the
/// residual of a true null direction is far smaller.
const MAX_NULL_RESIDUAL: f64 = 1e-60;

/// The largest number of parameters of a mechanism that is sampled at special angles.
const MAX_COLUMNS_FOR_SPECIAL: usize = 100;

/// The completion of a null space from samples of the regressor at random closed states.
#[derive(Debug)]
pub(super) struct NullCompletion<'a> {
    /// The regressor's rows at the sampled states.
    samples: &'a Samples,
    /// The home position, one value per coordinate, rad or m.
    home: &'a [f64],
    /// The seed of the samples' random states; the verification uses the next one.
    seed: u64,
}

/// The completed directions.
#[derive(Debug, Default)]
pub(super) struct Completed {
    /// The directions, each with the exactness of its factors.
    pub(super) directions: Vec<(Vector, Exactness)>,
    /// Notes on the factors that are known as decimal numbers only, each with the reason.
    pub(super) unrecognised: Vec<String>,
    /// Notes on the geometry names that could not be varied, or only in proportion, so that it is
    /// unknown whether the factors depend on them, each with the reason.
    pub(super) unvaried_names: Vec<String>,
}

/// How directions compare with the mechanism at other values of the names.
#[derive(Debug, Default)]
pub(super) struct Elsewhere {
    /// The eliminated columns of those that are not null there.
    pub(super) failing: BTreeSet<usize>,
    /// The names that had other values; those of equal size were varied together.
    pub(super) names: Vec<String>,
}

impl<'a> NullCompletion<'a> {
    pub(super) fn new(samples: &'a Samples, home: &'a [f64], seed: u64) -> Self {
        NullCompletion {
            samples,
            home,
            seed,
        }
    }

    /// The home position, and the seed of the random states.
    pub(super) fn home(&self) -> (&[f64], u64) {
        (self.home, self.seed)
    }

    /// How strongly each parameter acts at the sampled states, see [`Samples::lengths`].
    pub(super) fn lengths(&self) -> Vec<f64> {
        self.samples.lengths()
    }

    /// The regressor's rows at the sampled states.
    pub(super) fn samples(&self) -> &Samples {
        self.samples
    }

    /// The number of directions that are not null at the sampled states; above 0 only if their
    /// derivation is wrong.
    pub(super) fn refuted(&self, null: &[Vector]) -> usize {
        null.iter().filter(|row| !self.is_null(row)).count()
    }

    /// Whether a direction is null at the sampled states. Entries beyond the parameters' columns,
    /// which mark completed directions, are ignored.
    pub(super) fn is_null(&self, direction: &Vector) -> bool {
        let entries = direction.range(..self.samples.certificate().columns);
        let entries = entries.map(|(c, e)| (*c, Float320::from_number(e.value())));
        self.samples
            .scaled_residual_of(&entries.collect::<Vec<_>>())
            <= MAX_NULL_RESIDUAL
    }

    /// Compares directions with samples of the mechanism at other values of all names that can be
    /// varied, angles among them; `None` if no name is an angle, or if the mechanism does not close
    /// at other values or has another rank there.
    pub(super) fn compare_elsewhere<'r>(
        &self,
        field: &Field,
        spec: &Spec,
        model: &Model,
        directions: impl Iterator<Item = (usize, &'r Vector)>,
    ) -> Option<Elsewhere> {
        let angles = angle_names(spec, model);
        if angles.is_empty() {
            return None;
        }
        let groups = groups(spec, &angles);
        let scales = groups.iter().zip(1..).map(|(group, k)| {
            let shift = SCALE_SHIFT_STEPS[0] * k % SCALE_SHIFT_MODULUS;
            Number::ratio(SCALE_DENOMINATOR + shift, SCALE_DENOMINATOR).map(|scale| (group, scale))
        });
        let scales: Vec<(&Group, Number)> = scales.collect::<Option<_>>()?;
        let other = scaled(spec, &scales)?;
        let samples = sample_of(&other, self.seed)?;
        let certificate = samples.certificate();
        if certificate.rank != self.samples.certificate().rank {
            return None;
        }
        let values = field.values_with(&|text| other.evaluate(text))?;
        let holds = |direction: &Vector| {
            let entries = direction.range(..certificate.columns);
            let entries = entries.map(|(c, element)| {
                let value = element.value_at(&values)?;
                Some((*c, Float320::from_number(&value)))
            });
            let entries: Option<Vec<(usize, Float320)>> = entries.collect();
            entries.is_some_and(|e| samples.scaled_residual_of(&e) <= MAX_NULL_RESIDUAL)
        };
        let failing = directions.filter(|(_, direction)| {
            // a direction with a number in place of an expression cannot be compared
            let is_known = direction.values().all(|element| !element.hides_names());
            is_known && !holds(direction)
        });
        Some(Elsewhere {
            failing: failing.map(|(column, _)| column).collect(),
            names: groups
                .iter()
                .map(
                    |group| match group.members().collect::<Vec<_>>().as_slice() {
                        [name] => (*name).to_owned(),
                        names => format!("{} together", names.join(" and ")),
                    },
                )
                .collect(),
        })
    }

    /// The right angles, and straight ones, that lower the rank where a named angle has this value:
    /// each with the rank there, such as `12 at alpha = pi/2`. Loops that do not close there are left
    /// out.
    ///
    /// - `rank`: the rank at the given values.
    pub(super) fn special_angles(&self, spec: &Spec, model: &Model, rank: usize) -> Vec<String> {
        special_angles(spec, model, rank, self.seed)
    }

    /// Finds null directions of the sampled regressor in addition to the derived ones.
    ///
    /// - `null`: the derived null directions;
    /// - `order`: all columns, those to be eliminated first at the front;
    /// - `requested`: how many columns at the front of `order` the spec asks to eliminate.
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
        // an uncertain rank says nothing about directions that might be missing
        if !certificate.is_certain() || null.len() + certificate.rank >= certificate.columns {
            return completed;
        }
        let derived = kept_columns::reduce(field, null, order, requested).rows;
        // prefer as independent the columns at the end of `order`, and take the columns that the
        // derived directions eliminate only if no others are left
        let (eliminated, remaining): (Vec<usize>, Vec<usize>) =
            order.iter().rev().partition(|c| derived.contains_key(c));
        let column_order: Vec<usize> = remaining.iter().chain(&eliminated).copied().collect();
        let independent = self.samples.independent(&column_order);
        let dependent: Vec<usize> = remaining
            .into_iter()
            .filter(|c| !independent.contains(c))
            .collect();
        let Some(combinations) = self.samples.combinations_of(&independent, &dependent) else {
            return completed;
        };
        let Ok(fresh_samples) = certify(model, self.home, self.seed + 1) else {
            return completed;
        };
        let angles = angle_names(spec, model);
        let scaled_samples = ScaledSamples::new(spec, &angles, certificate.rank, self.seed);
        completed
            .unvaried_names
            .clone_from(&scaled_samples.unvaried_names);
        for (column, factors) in dependent.into_iter().zip(combinations) {
            let mut entries = vec![Float320::ZERO; certificate.columns];
            entries[column] = Float320::ONE;
            for (k, coefficient) in independent.iter().zip(&factors) {
                entries[*k] = -*coefficient;
            }
            let equivalent_supports = shapes::equivalent_supports(model, null, &entries);
            let mut best: Option<Recognised> = None;
            for support in std::iter::once(shapes::support(&entries)).chain(equivalent_supports) {
                let Some(recognised) = self.recognise(&scaled_samples, support) else {
                    continue;
                };
                if best
                    .as_ref()
                    .is_none_or(|b| recognised.inexactness_score() < b.inexactness_score())
                {
                    best = Some(recognised);
                }
                if best.as_ref().is_some_and(|b| b.inexactness_score() == 0) {
                    break;
                }
            }
            let Some(best) = best else { continue };
            let direction = best.direction(field, &scaled_samples.groups);
            if fresh_samples.scaled_residual(&values(&direction, certificate.columns))
                < MAX_NULL_RESIDUAL
            {
                let exactness = best.exactness(!scaled_samples.unvaried_names.is_empty());
                completed.directions.push((direction, exactness));
                completed.unrecognised.extend(best.notes(model));
            }
        }
        completed
    }

    /// Recognises the factors of the null direction with the given support, whose first entry is 1;
    /// `None` if the support has none or more than one.
    fn recognise(&self, scaled_samples: &ScaledSamples, support: Vec<usize>) -> Option<Recognised> {
        let values = self.samples.circuit(&support)?;
        let scaled_circuits = scaled_samples.circuits(&support);
        let factors = values.into_iter().enumerate();
        let factors = factors.map(|(k, value)| scaled_circuits.factor(scaled_samples, value, k));
        Some(Recognised {
            factors: factors.collect(),
            support,
        })
    }
}

/// See [`NullCompletion::special_angles`].
fn special_angles(spec: &Spec, model: &Model, rank: usize, seed: u64) -> Vec<String> {
    let angles = angle_names(spec, model);
    let columns = model.parameters.len();
    if columns > MAX_COLUMNS_FOR_SPECIAL {
        return Vec::new();
    }
    let rank_of = |spec: &Spec| Some(sample_of(spec, seed)?.certificate().rank);
    let mut found = Vec::new();
    for group in groups(spec, &angles).iter().filter(|group| group.is_angle) {
        for name in group.members() {
            for quarters in [0, 1, -1, 2] {
                let own = spec.geometry.iter().find(|(n, _)| n.value == name);
                let value = Number::ratio(quarters, 2).map(|half| half.mul(&Number::pi()));
                let (Some((_, own)), Some(value)) = (own, value) else {
                    continue;
                };
                let scale = value.div(&own.value);
                let Some(other) = scale.and_then(|s| scaled(spec, &[(&group.only(name), s)]))
                else {
                    continue;
                };
                if let Some(lower) = rank_of(&other).filter(|other| *other < rank) {
                    found.push(format!("{lower} at {name} = {value}"));
                }
            }
        }
    }
    found
}

/// A factor of a null direction, in the most general form in which it was recognised.
#[derive(Clone, Debug)]
enum Factor {
    /// A function of the geometry names.
    Function(Fit),
    /// An exact number, valid at the given values of the names.
    Constant(Number),
    /// A number known to 96 digits for which no exact expression was found.
    Digits(Float320),
}

/// A null direction with its recognised factors.
#[derive(Clone, Debug)]
struct Recognised {
    /// The columns of the factors.
    support: Vec<usize>,
    /// The entries of the direction at these columns; the first is 1.
    factors: Vec<Factor>,
}

/// Score of a factor that is known by its digits only: it outweighs the constants of a direction,
/// so that a form with fewer such factors is preferred.
const DIGITS_SCORE: usize = 1000;

impl Recognised {
    /// A score by which forms of a direction are compared: 0 if all factors are functions of the
    /// geometry names, and larger the more factors are mere constants or digits.
    fn inexactness_score(&self) -> usize {
        let scores = self.factors.iter().map(|factor| match factor {
            Factor::Function(_) => 0,
            Factor::Constant(_) => 1,
            Factor::Digits(_) => DIGITS_SCORE,
        });
        scores.sum()
    }

    /// The exactness of the least exactly known factor. If some geometry names could not be varied,
    /// any factor might depend on them, and whether the direction is null.
    fn exactness(&self, has_unvaried_names: bool) -> Exactness {
        let exactness_if_invariant = if has_unvaried_names {
            Exactness::AtThisGeometry
        } else {
            Exactness::Symbolic
        };
        let factors = self.factors.iter().map(|factor| match factor {
            Factor::Function(_) => Exactness::Symbolic,
            // 0 and 1 are taken as independent of the names
            Factor::Constant(value) if value.is_zero() || value.is_one() => exactness_if_invariant,
            Factor::Constant(_) => Exactness::AtThisGeometry,
            Factor::Digits(_) => Exactness::Numeric,
        });
        factors.fold(exactness_if_invariant, Exactness::max)
    }

    /// The direction as a sparse vector over the columns, with entries in the field.
    fn direction(&self, field: &mut Field, groups: &[Group]) -> Vector {
        let mut direction = Vector::new();
        for (column, factor) in self.support.iter().zip(&self.factors) {
            let element = match factor {
                Factor::Function(fit) => fit.element(field, groups),
                Factor::Constant(value) => Element::exact(value.clone()),
                Factor::Digits(value) => {
                    let (negative, magnitude, exponent) = value.binary();
                    Element::without_form(Number::from_binary(negative, magnitude, exponent))
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
        let factors = self.support.iter().zip(&self.factors);
        factors
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

/// The numeric entries of a sparse direction, one for each column.
fn values(direction: &Vector, columns: usize) -> Vec<Float320> {
    let mut values = vec![Float320::ZERO; columns];
    for (column, element) in direction {
        values[*column] = Float320::from_number(element.value());
    }
    values
}

/// The note on names that cannot be varied.
fn as_given(names: &[&str]) -> String {
    format!(
        "{} as given only: with other values the loops do not close, or the rank is another",
        names.join(", ")
    )
}

/// The denominator of the scales with which all groups are scaled, and the modulus of their
/// numerators' distances from it. Both are primes, so that the scales of different groups are
/// unrelated fractions; the scales differ from 1 by at most 5 percent.
const SCALE_DENOMINATOR: i64 = 1_000_003;
const SCALE_SHIFT_MODULUS: i64 = 50_021;
/// The numerators' distances from the denominator are multiples of these primes, modulo
/// [`SCALE_SHIFT_MODULUS`]: one set of scales for each.
const SCALE_SHIFT_STEPS: [i64; 2] = [37_717, -29_483];

/// Samples of the mechanism with scaled geometry: values of names multiplied by scales near 1.
struct ScaledSamples {
    /// The groups of geometry names that are scaled together.
    groups: Vec<Group>,
    /// The factor by which a single group is scaled.
    scale: Number,
    /// For each group, the samples with this group alone scaled by `scale`; `None` if the loops do
    /// not close then, or the rank differs.
    one_scaled: Vec<Option<Samples>>,
    /// Sets of scales, one for each group (1 for groups that cannot be scaled alone), and the
    /// samples with all groups scaled by them.
    all_scaled: Vec<(Vec<Number>, Rc<Samples>)>,
    /// Notes on the names that were not varied, or only in proportion, each with the reason.
    unvaried_names: Vec<String>,
    /// The results of earlier recognitions, by the leading digits of all samples of the factor:
    /// many directions have the same factors.
    recognised: RefCell<BTreeMap<Vec<u64>, Factor>>,
}

impl ScaledSamples {
    fn new(spec: &Spec, angles: &BTreeSet<String>, rank: usize, seed: u64) -> ScaledSamples {
        let mut groups = groups(spec, angles);
        let scale = Number::ratio(33, 32).unwrap_or_else(Number::one);
        let sample_with_same_rank = |scales: &[(&Group, Number)]| {
            sample(spec, scales, seed).filter(|s| s.certificate().rank == rank)
        };
        let mut one_scaled: Vec<Option<Samples>> = groups
            .iter()
            .map(|group| sample_with_same_rank(&[(group, scale.clone())]))
            .collect();
        let mut unvaried_names = fixed_angles(spec, angles);
        let not_scalable = |is_angle: bool| -> Vec<usize> {
            (0..groups.len())
                .filter(|&k| one_scaled[k].is_none() && groups[k].is_angle == is_angle)
                .collect()
        };
        let held: Vec<&str> = not_scalable(true)
            .iter()
            .flat_map(|&k| groups[k].members())
            .collect();
        if !held.is_empty() {
            unvaried_names.push(as_given(&held));
        }
        // lengths that cannot be changed alone may still be scaled together
        let not_scalable_alone = not_scalable(false);
        let merged = Group::merged(not_scalable_alone.iter().map(|&k| &groups[k]));
        let scaled_as_one = merged
            .and_then(|group| Some((sample_with_same_rank(&[(&group, scale.clone())])?, group)));
        let names: Vec<&str> = not_scalable_alone
            .iter()
            .flat_map(|&k| groups[k].members())
            .collect();
        if let Some((samples, group)) = scaled_as_one {
            unvaried_names.push(format!(
                "{} in proportion only: with other ratios the loops do not close, or the rank is another",
                names.join(", ")
            ));
            for &k in not_scalable_alone.iter().rev() {
                groups.remove(k);
                one_scaled.remove(k);
            }
            groups.push(group);
            one_scaled.push(Some(samples));
        } else if !names.is_empty() {
            unvaried_names.push(as_given(&names));
        }
        let mut all_scaled: Vec<(Vec<Number>, Rc<Samples>)> = Vec::new();
        for step in SCALE_SHIFT_STEPS {
            let scales: Vec<Number> = (1..)
                .zip(&one_scaled)
                .map(|(k, samples)| {
                    let shift = if samples.is_some() {
                        step * k % SCALE_SHIFT_MODULUS
                    } else {
                        0
                    };
                    Number::ratio(SCALE_DENOMINATOR + shift, SCALE_DENOMINATOR)
                        .unwrap_or_else(Number::one)
                })
                .collect();
            let all: Vec<(&Group, Number)> = groups.iter().zip(scales.iter().cloned()).collect();
            // without groups to scale, all sets of scales are equal
            let equal = all_scaled.iter().find(|(others, _)| *others == scales);
            let known = equal.map(|(_, samples)| Rc::clone(samples));
            if let Some(samples) = known.or_else(|| sample_with_same_rank(&all).map(Rc::new)) {
                all_scaled.push((scales, samples));
            }
        }
        ScaledSamples {
            groups,
            scale,
            one_scaled,
            all_scaled,
            unvaried_names,
            recognised: RefCell::default(),
        }
    }

    /// The null direction with the given support at each scaled set of values of the names.
    fn circuits(&self, support: &[usize]) -> ScaledCircuits {
        let one_scaled = self.one_scaled.iter();
        let all_scaled = self.all_scaled.iter();
        ScaledCircuits {
            one_scaled: one_scaled.map(|s| s.as_ref()?.circuit(support)).collect(),
            all_scaled: all_scaled
                .filter_map(|(scales, s)| Some((scales.clone(), s.circuit(support)?)))
                .collect(),
        }
    }
}

/// The null direction with one support at each scaled set of values of the names, as entries in the
/// order of the support.
struct ScaledCircuits {
    /// For each group, the direction with this group alone scaled; `None` where there are no
    /// samples or no unique direction.
    one_scaled: Vec<Option<Vec<Float320>>>,
    /// Sets of scales, one for each group, and the directions with all groups scaled by them.
    all_scaled: Vec<(Vec<Number>, Vec<Float320>)>,
}

impl ScaledCircuits {
    /// Recognises the `k`-th factor of a direction, which is `value` at the given geometry: as a
    /// function of the names, else as an exact number, else by its digits.
    fn factor(&self, scaled_samples: &ScaledSamples, value: Float320, k: usize) -> Factor {
        let all_scaled = self.all_scaled.iter().map(|(scales, values)| ScaledFactor {
            scales: scales.clone(),
            value: values[k],
        });
        let one_scaled = self.one_scaled.iter();
        let observed = SampledFactor {
            value,
            one_scaled: one_scaled.map(|values| Some(values.as_ref()?[k])).collect(),
            all_scaled: all_scaled.collect(),
        };
        let leading_digits = observed.leading_digits();
        if let Some(known) = scaled_samples.recognised.borrow().get(&leading_digits) {
            return known.clone();
        }
        let fit = Fit::find(&observed, &scaled_samples.groups, &scaled_samples.scale);
        let factor = fit.map_or_else(
            || recognise(&value).map_or(Factor::Digits(value), Factor::Constant),
            Factor::Function,
        );
        let mut recognised = scaled_samples.recognised.borrow_mut();
        recognised.insert(leading_digits, factor.clone());
        factor
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The mass of a pendulum's body has no effect; its moment of inertia about the axis has.
    #[test]
    fn directions_that_change_sampled_energies_are_refuted() {
        let text = "name: one\nlimbs: [{name: arm, joints: \
                    [{name: q1, type: revolute, body: 1, actuated: true}]}]\n";
        let source = crate::diag::Source::new("one.yaml", text);
        let model = crate::model::build(&crate::spec::parse(&source).unwrap());
        let samples = certify(&model, &[0.0], 1).unwrap();
        let completion = NullCompletion::new(&samples, &[0.0], 1);
        let unit_direction = |label: &str| {
            let column = model.parameters.iter().position(|p| p.label == label);
            Vector::from([(column.unwrap(), Element::one())])
        };
        let (without_effect, with_effect) = (unit_direction("m(1)"), unit_direction("Izz(1)"));
        assert_eq!(completion.refuted(&[]), 0);
        assert_eq!(completion.refuted(std::slice::from_ref(&without_effect)), 0);
        assert_eq!(
            completion.refuted(&[without_effect, with_effect.clone(), with_effect]),
            2
        );
    }
}
