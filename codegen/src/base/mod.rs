//! The base parameters: the combinations of the dynamic parameters on which a mechanism's forces
//! depend (`codegen/BASE.md` explains the method).
//!
//! They follow from the null space of the regressor W (Eq. 11, 23): the changes of the parameters
//! that change no force, in any motion. Three layers find the directions of this space:
//!
//! - *layer 1* derives those of an open tree exactly, joint by joint;
//! - *layer 2* derives those of a mechanism with loops exactly: it adds the null spaces of many
//!   spanning trees, and the directions that velocity constraints imply (couplings, and the
//!   rotations around planar loops);
//! - *layer 3* completes the null space: it computes the directions that are still missing from
//!   the regressor at sampled states in multiple precision, and recognises their coefficients
//!   (here called factors) as exact numbers and as functions of the named lengths.
//!
//! In this module a parameter is identified by the index of its column in W, in the order of
//! `Model::parameters`. Row reduction of the null space decides which columns are eliminated; the
//! others are kept, and each kept column gives one base parameter.

mod analysis;
pub mod certificate;
mod coefficient;
mod coupled;
mod exchange;
pub mod field;
mod geometry;
mod kept_columns;
mod known;
pub mod latex;
mod link_path;
mod linkage;
mod magnitude;
mod meant;
mod null_completion;
mod payloads;
mod proof;
mod rates;
mod span;
mod store;
mod tree;
mod trees;

pub use analysis::{Analysis, analyse};
pub use coefficient::Coefficient;
pub use geometry::angle_names;
pub use link_path::{Freedom, LinearForm, LinkPath, is_implied_by, link_paths};
pub use null_completion::recognise;
pub use rates::velocity_constraints;
pub use store::{StoreProblem, is_slow_in_debug, restore, store};

use crate::diag::counted;
use crate::model::Model;
use crate::spec::Spec;
use crate::sym::Number;

use field::{Element, Field};
use span::{Span, Vector};

/// A parameter with its factor in a linear combination of parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The index of the parameter's column in the regressor.
    pub column: usize,
    /// The factor as an expression in the named lengths and angles of the spec.
    pub coefficient: Coefficient,
    /// The factor's value in SI units at the spec's values of the names: approximate only where the
    /// combination is [`Exactness::Numeric`] or a [`Number`] cannot represent it exactly.
    pub value: Number,
}

/// How a combination of parameters (a null direction or a base parameter) was obtained, from best to worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Provenance {
    /// By layers 1 and 2: derived exactly from spanning trees and velocity constraints. Also for a
    /// base parameter that is a single parameter.
    Derived,
    /// By layer 3, and then proven: exact points of the mechanism with all values of the names, modulo primes,
    /// leave a chance below 2^-128 that it is wrong.
    Proven,
    /// By layer 3: completed from the regressor at sampled states, in multiple precision.
    Completed,
}

/// How well the factors of a combination are known, from best to worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exactness {
    /// All factors are known as functions of the geometry's names: derived, or completed and
    /// verified at other values of the names.
    Symbolic,
    /// All factors are known exactly at the given geometry, but not how all of them depend on its
    /// names. This includes completed factors if [`Base::unvaried_names`] is not empty, and derived
    /// ones whose expressions in the names have too many terms.
    AtThisGeometry,
    /// Some factors were not recognised: only their numeric values are known.
    Numeric,
}

/// A null direction: a change of the parameters that changes no force, whatever the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct NullDirection {
    /// The index of the eliminated column, in which all other directions of [`Base::null`] are
    /// zero.
    pub column: usize,
    /// The direction's nonzero entries; that of the eliminated column is 1.
    pub terms: Vec<Term>,
    /// How the direction was obtained.
    pub provenance: Provenance,
    /// How well its factors are known.
    pub exactness: Exactness,
}

/// A base parameter: a kept parameter plus multiples of eliminated ones.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameter {
    /// The index of the kept column.
    pub column: usize,
    /// The sum that makes up the base parameter: the kept parameter first, with factor 1.
    pub terms: Vec<Term>,
    /// How the combination was obtained.
    pub provenance: Provenance,
    /// How well its factors are known.
    pub exactness: Exactness,
    /// Whether `base.drop` of the spec leaves this base parameter out of the model.
    pub dropped: bool,
}

/// A parameter that `base.zero` or `base.equal` of the spec replaces by a combination of others.
#[derive(Clone, Debug, PartialEq)]
pub struct Substitution {
    /// The index of the replaced parameter's column.
    pub column: usize,
    /// The sum that replaces it; empty if the parameter is zero.
    pub terms: Vec<Term>,
}

/// The base parameters of a mechanism.
#[derive(Clone, Debug, PartialEq)]
pub struct Base {
    /// The base parameters, including dropped ones, in the order of their kept columns: those of the
    /// robot, then those of each payload.
    pub parameters: Vec<BaseParameter>,
    /// A basis of the null space: one direction per eliminated column, in the order of the columns.
    /// The parameters that `known` replaces are not among the columns.
    pub null: Vec<NullDirection>,
    /// The parameters that `base.zero` and `base.equal` of the spec replace by others.
    pub known: Vec<Substitution>,
    /// How many independent null directions layers 1 and 2 derived, from spanning trees and from
    /// velocity constraints; counted before `known` replaces parameters.
    pub from_trees: usize,
    /// How many spanning trees were analysed.
    pub trees: usize,
    /// How many further null directions layer 3 completed from samples; counted likewise.
    pub completed: usize,
    /// How many of these directions change a force at the sampled states. This must be 0; otherwise
    /// the derivation is wrong. Also 0 if there are no samples.
    pub refuted: usize,
    /// Factors of which only numeric values are known, each with the reason: those of completed
    /// directions, and how many expressions in the names have too many terms.
    pub unrecognised: Vec<String>,
    /// Names that layer 3 could not vary, or only in proportion to each other. Completed factors
    /// are verified only at the given values or ratios of these names. Each entry has the reason.
    pub unvaried_names: Vec<String>,
    /// Where angles have names: the names at other values of which every row was compared with the
    /// mechanism, except rows that are [`Exactness::AtThisGeometry`]. Empty if it was not sampled
    /// there, or does not close.
    pub varied_names: Vec<String>,
    /// Where angles have names: values of these at which the rank is lower, with the rank there, such
    /// as `12 at alpha = pi/2`.
    pub special_angles: Vec<String>,
    /// Equalities of names that hold by their given values only and that the derivation relied on,
    /// such as `l1 = l2`. At other values the base parameters may differ.
    pub coincidences: Vec<String>,
}

/// The largest number of parameters for which base parameters are derived. The certificate of a
/// chain of a hundred general joints, which has 1000 parameters, takes about a minute. Its memory
/// grows with the square of the number of parameters and its time with the cube.
pub const MAX_PARAMETERS: usize = 1500;

/// Whether the mechanism has few enough parameters ([`MAX_PARAMETERS`]) to derive its base
/// parameters.
pub fn has_few_enough_parameters(model: &Model) -> bool {
    model.parameters.len() <= MAX_PARAMETERS
}

/// Derives the base parameters by layers 1 and 2 alone.
///
/// - `target`: the dimension of the null space, if known (columns minus rank). The search over
///   spanning trees ends early when it is reached.
pub fn derive(spec: &Spec, model: &Model, target: Option<usize>) -> Base {
    derive_with_completion(spec, model, target, None)
}

/// Derives the base parameters as `derive` does. If `completion` is given, layer 3 completes the
/// null directions that the first two layers do not find, from its samples.
fn derive_with_completion(
    spec: &Spec,
    model: &Model,
    target: Option<usize>,
    completion: Option<&null_completion::NullCompletion<'_>>,
) -> Base {
    let mut field = geometry::field(spec, model);
    let linkage = linkage::Linkage::new(&mut field, spec, model);
    // layer 2, velocity constraints: directions of friction parameters, then of the bodies
    let mut start = Span::default();
    // a direction that changes a force at the samples is rejected; layer 3 then finds the correct one
    let accepts = |row: &Vector| completion.is_none_or(|completion| completion.is_null(row));
    for direction in rates::null_directions(&mut field, &linkage, model) {
        start.insert_if(&mut field, &direction, &accepts);
    }
    for direction in coupled::null_directions(&mut field, &linkage, model) {
        start.insert_if(&mut field, &direction, &accepts);
    }
    // layers 1 and 2: the sum of the null spaces of spanning trees
    let sum = trees::sum(&mut field, &linkage, start, target, &accepts);
    let mut null: Vec<Vector> = sum.span.vectors().cloned().collect();
    let from_trees = null.len();
    let requested: Vec<usize> = spec
        .base
        .eliminate
        .iter()
        .filter_map(|label| column(model, &label.value))
        .collect();
    let order = kept_columns::preference(model, &requested);
    let columns = model.parameters.len();
    let mut unrecognised = Vec::new();
    let mut unvaried_names = Vec::new();
    let mut completed_exactness = Vec::new();
    if let Some(completion) = completion {
        // layer 3
        let completed =
            completion.complete(&mut field, spec, model, &null, &order, requested.len());
        unrecognised = completed.unrecognised;
        unvaried_names = completed.unvaried_names;
        // Completed direction k gets an additional entry 1 in the tag column `columns + k`, after
        // the columns of the parameters. The row operations of the reduction below also apply to
        // it: a reduced row with an entry in that column is a combination that uses direction k.
        let proven = proven(&field, spec, model, completion, &completed.directions);
        let directions = completed.directions.into_iter().zip(proven);
        for (k, ((mut direction, exactness), proven)) in directions.enumerate() {
            let provenance = if proven {
                Provenance::Proven
            } else {
                Provenance::Completed
            };
            completed_exactness.push((provenance, exactness));
            direction.insert(columns + k, Element::one());
            null.push(direction);
        }
    }
    let null_dimension = null.len();
    let refuted = completion.map_or(0, |completion| completion.refuted(&null));
    let null = payloads::apart(&mut field, null, model);
    let known = known::substitutions(&mut field, spec, model);
    let restricted = known::restricted(&mut field, &null, &known);
    let mut reduced = kept_columns::reduce(&mut field, &restricted, &order, requested.len());
    if let Some(completion) = completion {
        let replaced: Vec<(usize, usize, f64)> = known
            .iter()
            .flat_map(|k| {
                let terms = k.terms.iter();
                terms.map(|(c, e)| (k.column, *c, e.value().to_f64()))
            })
            .collect();
        let rules = exchange::Rules {
            model,
            lengths: &completion.lengths(),
            requested: &requested,
            divides_by_expressions: spec.geometry.is_empty(),
            condition: &|reduced| {
                let is_kept = |c: &usize| {
                    !reduced.rows.contains_key(c) && known.iter().all(|k| k.column != *c)
                };
                let samples = completion.samples();
                samples.condition_of_groups(model, &is_kept, &replaced)
            },
        };
        exchange::exchange(&mut field, &mut reduced, &rules);
    }
    let elsewhere = completion.and_then(|completion| {
        let rows = reduced.rows.iter().map(|(column, row)| (*column, row));
        completion.compare_elsewhere(&field, spec, model, rows)
    });
    let holds_elsewhere = |column: &usize| {
        let elsewhere = elsewhere.as_ref();
        elsewhere.is_none_or(|elsewhere| !elsewhere.failing.contains(column))
    };
    // A reduced row is completed if it has an entry in a tag column. Its factors are known as well
    // as those of the least exact completed direction that it uses.
    let provenance_of = |row: &Vector| -> (Provenance, Exactness) {
        let tags = row.range(columns..);
        let used = tags.filter_map(|(tag, _)| completed_exactness.get(tag - columns));
        used.max()
            .copied()
            .unwrap_or((Provenance::Derived, Exactness::Symbolic))
    };
    // factors of rows that are completed with digits are told apart
    let mut hidden = 0_usize;
    let mut exactness_of = |element: &Element, row: Exactness| {
        if element.hides_names() {
            hidden += usize::from(row != Exactness::Numeric);
            Exactness::AtThisGeometry
        } else {
            Exactness::Symbolic
        }
    };
    let substituted: Vec<usize> = known.iter().map(|k| k.column).collect();
    let groups = model.column_groups().into_iter().flatten();
    let parameters = groups
        .filter(|c| !reduced.rows.contains_key(c) && !substituted.contains(c))
        .map(|c| {
            let (mut provenance, mut exactness) = (Provenance::Derived, Exactness::Symbolic);
            let combined = reduced.rows.iter().filter_map(|(eliminated, row)| {
                // The row r of an eliminated column e says that W_e + sum_c r_c W_c = 0. Thus phi_e
                // acts as -r_c phi_e does at each kept column c.
                let factor = row.get(&c)?.neg();
                let (own, of_row) = provenance_of(row);
                provenance = provenance.max(own);
                exactness = exactness.max(of_row);
                if !holds_elsewhere(eliminated) {
                    exactness = exactness.max(Exactness::AtThisGeometry);
                }
                Some((*eliminated, factor))
            });
            let mut terms: Vec<(usize, Element)> = combined.collect();
            // short coefficients first; among these, bodies far from the ground first
            terms.sort_by_key(|(column, e)| (e.weight(), usize::MAX - column));
            for (_, element) in &terms {
                exactness = exactness.max(exactness_of(element, exactness));
            }
            let label = &model.parameters[c].label;
            BaseParameter {
                column: c,
                terms: std::iter::once((c, Element::one()))
                    .chain(terms)
                    .map(|(column, e)| term(&field, column, &e))
                    .collect(),
                provenance,
                exactness,
                dropped: spec.base.drop.iter().any(|d| d.value == *label),
            }
        })
        .collect();
    if hidden > 0 {
        unrecognised.push(format!(
            "{} of too many terms in names of the geometry, written as numbers",
            counted(hidden, "factor", "factors")
        ));
    }
    let null = reduced.rows.iter().map(|(column, row)| {
        let entries = row.range(..columns);
        let (provenance, mut exactness) = provenance_of(row);
        if entries.clone().any(|(_, e)| e.hides_names()) || !holds_elsewhere(column) {
            exactness = exactness.max(Exactness::AtThisGeometry);
        }
        NullDirection {
            column: *column,
            terms: entries.map(|(c, e)| term(&field, *c, e)).collect(),
            provenance,
            exactness,
        }
    });
    Base {
        parameters,
        null: null.collect(),
        known: known
            .iter()
            .map(|k| Substitution {
                column: k.column,
                terms: k.terms.iter().map(|(c, e)| term(&field, *c, e)).collect(),
            })
            .collect(),
        from_trees,
        trees: sum.trees,
        completed: null_dimension - from_trees,
        refuted,
        unrecognised,
        unvaried_names,
        special_angles: completion.map_or_else(Vec::new, |completion| {
            completion.special_angles(spec, model, model.parameters.len() - null_dimension)
        }),
        varied_names: elsewhere.map_or_else(Vec::new, |elsewhere| elsewhere.names),
        coincidences: field.coincidences().map(str::to_owned).collect(),
    }
}

/// For each completed direction whose factors are known as functions of the names, whether it is proven.
fn proven(
    field: &Field,
    spec: &Spec,
    model: &Model,
    completion: &null_completion::NullCompletion<'_>,
    directions: &[(Vector, Exactness)],
) -> Vec<bool> {
    let is_known = |(direction, exactness): &(Vector, Exactness)| {
        *exactness == Exactness::Symbolic && direction.values().all(|e| !e.hides_names())
    };
    if !directions.iter().any(is_known) {
        return vec![false; directions.len()];
    }
    let factors: Vec<Vec<(usize, Coefficient)>> = directions
        .iter()
        .map(|(direction, _)| {
            let entries = direction.iter();
            entries.map(|(c, e)| (*c, field.coefficient(e))).collect()
        })
        .collect();
    let found = proof::proven(spec, model, completion.home(), &factors);
    let both = directions.iter().zip(found);
    both.map(|(direction, proven)| proven && is_known(direction))
        .collect()
}

/// The column of the parameter with this label.
fn column(model: &Model, label: &str) -> Option<usize> {
    model.parameters.iter().position(|p| p.label == label)
}

/// The term of a column whose factor is `element`, as an expression in the names and as a value.
fn term(field: &Field, column: usize, element: &Element) -> Term {
    Term {
        column,
        coefficient: field.coefficient(element),
        value: element.value().clone(),
    }
}

impl Base {
    /// The number of base parameters in the model, which excludes dropped ones: the number of
    /// columns of the base regressor.
    pub fn rank(&self) -> usize {
        self.parameters.iter().filter(|p| !p.dropped).count()
    }
}
