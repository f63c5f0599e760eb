//! The base parameters: the combinations of the dynamic parameters on which a mechanism's forces
//! depend (`codegen/BASE.md` explains the method).
//!
//! They follow from the null space of the regressor W (Eq. 11, 23): the changes of the parameters
//! that change no force, in any motion. Three layers find its directions:
//!
//! - *layer 1* derives those of an open tree exactly, joint by joint;
//! - *layer 2* derives those of a mechanism with loops exactly: it adds the null spaces of many
//!   spanning trees, and the directions that velocity constraints imply (couplings, and the
//!   rotations around planar loops);
//! - *layer 3* completes the null space: it computes the directions that are still missing from
//!   samples in multiple precision, and recognises their factors as exact numbers and as functions
//!   of the named lengths.
//!
//! A column stands for a parameter everywhere here: its column in W, in the order of
//! `Model::parameters`. Row reduction of the null space then decides which columns are eliminated;
//! the others are kept, and each gives one base parameter.

mod analysis;
pub mod certificate;
mod coefficient;
mod coupled;
pub mod field;
mod geometry;
mod kept_columns;
mod known;
pub mod latex;
mod link_path;
mod linkage;
mod null_completion;
mod payloads;
mod rates;
mod span;
mod store;
mod tree;
mod trees;

pub use analysis::{Analysis, analyse};
pub use coefficient::Coefficient;
pub use link_path::{Freedom, LinearForm, LinkPath, is_implied_by, link_paths};
pub use null_completion::recognise;
pub use rates::velocity_constraints;
pub use store::{StoreProblem, is_slow_in_debug, restore, store};

use crate::model::Model;
use crate::spec::Spec;
use crate::sym::Number;

use field::{Element, Field};
use span::{Span, Vector};

/// A parameter with its factor in a linear combination of parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The parameter's column in the regressor.
    pub column: usize,
    /// The factor as an expression in the named lengths and angles of the spec.
    pub coefficient: Coefficient,
    /// The factor's exact value at the values of the names in the spec, SI.
    pub value: Number,
}

/// How a combination was obtained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Provenance {
    /// By layers 1 and 2: derived exactly from spanning trees and velocity constraints. Also for a
    /// base parameter that is a single parameter.
    Derived,
    /// By layer 3: completed from samples in multiple precision.
    Completed,
}

/// How well the factors of a completed combination are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exactness {
    /// Functions of the geometry's names, derived, or verified at other values of the names (except
    /// for the names that [`Base::unvaried_names`] lists).
    Symbolic,
    /// Exact numbers at the given geometry; how they depend on its names is not known.
    AtThisGeometry,
    /// Some of the factors are known by their digits only.
    Numeric,
}

/// A null direction: a change of the parameters that changes no force, whatever the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct NullDirection {
    /// The eliminated column, which no other direction of [`Base::null`] contains.
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
    /// The kept column.
    pub column: usize,
    /// The combination; the kept parameter first, with factor 1.
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
    /// The column of the replaced parameter.
    pub column: usize,
    /// The combination that replaces it.
    pub terms: Vec<Term>,
}

/// The base parameters of a mechanism.
#[derive(Clone, Debug, PartialEq)]
pub struct Base {
    /// The base parameters, dropped ones among them, in the order of the parameters: those of the
    /// robot, then those of each payload.
    pub parameters: Vec<BaseParameter>,
    /// A basis of the null space: one direction per eliminated column, in the order of the columns.
    pub null: Vec<NullDirection>,
    /// The parameters that `base.zero` and `base.equal` write as combinations of others.
    pub known: Vec<Substitution>,
    /// Dimension of the part of the null space that layers 1 and 2 derive, over all columns: from
    /// spanning trees and from velocity constraints.
    pub from_trees: usize,
    /// How many spanning trees were analysed.
    pub trees: usize,
    /// How many further null directions layer 3 completed from samples.
    pub completed: usize,
    /// How many directions fail to be null at the sampled states: 0, unless the base is wrong.
    pub refuted: usize,
    /// Factors of completed directions that are known as numbers only, each with the reason.
    pub unrecognised: Vec<String>,
    /// Names that layer 3 could not vary, or only in proportion to each other, so that the
    /// completed factors hold for their given values or ratios only; each entry with the reason.
    pub unvaried_names: Vec<String>,
    /// Equalities between values of different names that the result depends on, such as `l1 = l2`.
    pub coincidences: Vec<String>,
}

/// The largest number of parameters for which base parameters are derived. The certificate of a
/// chain of a hundred general joints, 1000 parameters, takes about a minute, its memory and time
/// grow with the square and the cube, and nobody has identified anything of that size.
pub const MAX_PARAMETERS: usize = 1500;

/// Whether the mechanism has few enough parameters ([`MAX_PARAMETERS`]) to derive its base
/// parameters.
pub fn has_few_enough_parameters(model: &Model) -> bool {
    model.parameters.len() <= MAX_PARAMETERS
}

/// Derives the base parameters by layers 1 and 2 alone. The search over spanning trees ends early
/// when the null space over all columns has `target` dimensions.
pub fn derive(spec: &Spec, model: &Model, target: Option<usize>) -> Base {
    derive_with_completion(spec, model, target, None)
}

/// Derives the base parameters by layers 1 and 2, and by layer 3 if samples are given: null
/// directions that the first two layers do not find are completed from the samples of `completion`.
fn derive_with_completion(
    spec: &Spec,
    model: &Model,
    target: Option<usize>,
    completion: Option<&null_completion::NullCompletion<'_>>,
) -> Base {
    let mut field = Field::default();
    let linkage = linkage::Linkage::new(&mut field, spec, model);
    // layer 2, velocity constraints: directions of friction parameters, then of the bodies
    let mut start = Span::default();
    for direction in rates::null_directions(&mut field, &linkage, model) {
        start.insert(&mut field, &direction);
    }
    for direction in coupled::null_directions(&mut field, &linkage, model) {
        start.insert(&mut field, &direction);
    }
    // layers 1 and 2: the sum of the null spaces of spanning trees
    let sum = trees::sum(&mut field, &linkage, start, target);
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
        // Completed direction k gets an additional entry 1 in the tag column `columns + k`, behind
        // the columns of the parameters. The row operations of the reduction below carry it along:
        // a reduced row with an entry in that column is a combination that uses direction k.
        for (k, (mut direction, exactness)) in completed.directions.into_iter().enumerate() {
            completed_exactness.push(exactness);
            direction.insert(columns + k, Element::one());
            null.push(direction);
        }
    }
    let null_dimension = null.len();
    let refuted = completion.map_or(0, |completion| completion.refuted(&null));
    let null = payloads::apart(&mut field, null, model);
    let known = known::substitutions(&mut field, spec, model);
    let restricted = known::restricted(&mut field, &null, &known);
    let reduced = kept_columns::reduce(&mut field, &restricted, &order, requested.len());
    // how a reduced row was obtained, from its entries in the tag columns; the factors are known
    // as well as those of the worst completed direction in it
    let provenance_of = |row: &Vector| -> (Provenance, Exactness) {
        let tags = row.range(columns..);
        let used = tags.filter_map(|(tag, _)| completed_exactness.get(tag - columns));
        used.max()
            .map_or((Provenance::Derived, Exactness::Symbolic), |e| {
                (Provenance::Completed, *e)
            })
    };
    let substituted: Vec<usize> = known.iter().map(|k| k.column).collect();
    let groups = model.column_groups().into_iter().flatten();
    let parameters = groups
        .filter(|c| !reduced.rows.contains_key(c) && !substituted.contains(c))
        .map(|c| {
            let (mut provenance, mut exactness) = (Provenance::Derived, Exactness::Symbolic);
            let combined = reduced.rows.iter().filter_map(|(eliminated, row)| {
                // forces do not change along the row, so the eliminated parameter enters with the
                // opposite sign
                let factor = row.get(&c)?.neg();
                if let (Provenance::Completed, of_row) = provenance_of(row) {
                    provenance = Provenance::Completed;
                    exactness = exactness.max(of_row);
                }
                Some((*eliminated, factor))
            });
            let mut terms: Vec<(usize, Element)> = combined.collect();
            // short coefficients first, outer bodies first
            terms.sort_by_key(|(column, e)| (e.weight(), usize::MAX - column));
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
    let null = reduced.rows.iter().map(|(column, row)| {
        let entries = row.range(..columns);
        let (provenance, exactness) = provenance_of(row);
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
        coincidences: field.coincidences().map(str::to_owned).collect(),
    }
}

/// The column of the parameter with this label.
fn column(model: &Model, label: &str) -> Option<usize> {
    model.parameters.iter().position(|p| p.label == label)
}

/// A factor of the field as an expression in the names, with its value.
fn term(field: &Field, column: usize, element: &Element) -> Term {
    Term {
        column,
        coefficient: field.coefficient(element),
        value: element.value().clone(),
    }
}

impl Base {
    /// The number of base parameters without the dropped ones.
    pub fn rank(&self) -> usize {
        self.parameters.iter().filter(|p| !p.dropped).count()
    }
}
