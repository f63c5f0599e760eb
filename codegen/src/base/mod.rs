//! The base parameters: the combinations of the dynamic parameters on which a mechanism's forces
//! depend, derived exactly (`codegen/BASE.md` explains the method).

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

/// A parameter with its factor in a linear combination.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The parameter's column in the regressor.
    pub column: usize,
    /// The factor as an expression in the geometry's names.
    pub coefficient: Coefficient,
    /// The factor's exact value at the given geometry.
    pub value: Number,
}

/// How a combination was obtained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Provenance {
    /// Derived exactly from spanning trees and velocity constraints, or a single parameter.
    Derived,
    /// Completed from samples in multiple precision.
    Completed,
}

/// How well the factors of a completed combination are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exactness {
    /// Functions of the geometry's names, derived, or verified at other values of the names (except
    /// for the names that [`Base::held`] lists).
    Symbolic,
    /// Exact numbers at the given geometry; how they depend on its names is not known.
    AtThisGeometry,
    /// Some of the factors are known by their digits only.
    Numeric,
}

/// A null direction: a change of the parameters that changes no force, whatever the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// The eliminated column.
    pub column: usize,
    /// The direction's nonzero entries; that of the eliminated column is 1.
    pub terms: Vec<Term>,
    /// How the direction was obtained.
    pub layer: Provenance,
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
    pub layer: Provenance,
    /// How well its factors are known.
    pub exactness: Exactness,
    /// Whether `base.drop` leaves it out.
    pub dropped: bool,
}

/// A parameter that `base.zero` or `base.equal` of the spec replaces by a combination of others.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// The column of the replaced parameter.
    pub column: usize,
    /// The combination that replaces it.
    pub terms: Vec<Term>,
}

/// The base parameters of a mechanism.
#[derive(Clone, Debug, PartialEq)]
pub struct Base {
    /// The base parameters, dropped ones among them, in the order of the parameters.
    pub parameters: Vec<BaseParameter>,
    /// A basis of the null space: one direction per eliminated column, in the order of the columns.
    pub null: Vec<Direction>,
    /// The parameters that `base.zero` and `base.equal` write as combinations of others.
    pub known: Vec<Known>,
    /// Dimension of the part of the null space that layers 1 and 2 derive, over all columns.
    pub from_trees: usize,
    /// How many spanning trees were analysed.
    pub trees: usize,
    /// How many further null directions were completed from samples.
    pub completed: usize,
    /// How many directions fail to be null at the sampled states: 0, unless the base is wrong.
    pub refuted: usize,
    /// Factors of completed directions that are known as numbers only, each with the reason.
    pub unrecognised: Vec<String>,
    /// Names that could not be varied, so that the completed factors hold for their given values
    /// only, each with the reason.
    pub held: Vec<String>,
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
    derive_all(spec, model, target, None)
}

/// Derives the base parameters by all layers: null directions that layers 1 and 2 do not find are
/// completed from the samples of `completion`, where it is given.
fn derive_all(
    spec: &Spec,
    model: &Model,
    target: Option<usize>,
    completion: Option<&null_completion::NullCompletion<'_>>,
) -> Base {
    let mut field = Field::default();
    let linkage = linkage::Linkage::new(&mut field, spec, model);
    let mut start = Span::default();
    for direction in rates::null_directions(&mut field, &linkage, model) {
        start.insert(&mut field, &direction);
    }
    for direction in coupled::null_directions(&mut field, &linkage, model) {
        start.insert(&mut field, &direction);
    }
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
    let mut held = Vec::new();
    let mut exactness = Vec::new();
    if let Some(completion) = completion {
        let found = completion.complete(&mut field, spec, model, &null, &order, requested.len());
        unrecognised = found.unrecognised;
        held = found.fixed_names;
        // an entry 1 behind the parameters' columns marks every row that uses this direction
        for (k, (mut direction, how)) in found.directions.into_iter().enumerate() {
            exactness.push(how);
            direction.insert(columns + k, Element::one());
            null.push(direction);
        }
    }
    let null_dimension = null.len();
    let refuted = completion.map_or(0, |completion| completion.refuted(&null));
    let known = known::substitutions(&mut field, spec, model);
    let restricted = known::restricted(&mut field, &null, &known);
    let reduced = kept_columns::reduce(&mut field, &restricted, &order, requested.len());
    let provenance = |row: &Vector| -> (Provenance, Exactness) {
        let completed = row.range(columns..);
        let of = completed.filter_map(|(k, _)| exactness.get(k - columns));
        of.max()
            .map_or((Provenance::Derived, Exactness::Symbolic), |e| {
                (Provenance::Completed, *e)
            })
    };
    let replaced: Vec<usize> = known.iter().map(|k| k.column).collect();
    let parameters = (0..model.parameters.len())
        .filter(|c| !reduced.rows.contains_key(c) && !replaced.contains(c))
        .map(|c| {
            let (mut layer, mut exactness) = (Provenance::Derived, Exactness::Symbolic);
            let combined = reduced.rows.iter().filter_map(|(eliminated, row)| {
                // forces do not change along the row, so the eliminated parameter enters with the
                // opposite sign
                let factor = row.get(&c)?.neg();
                if let (Provenance::Completed, how) = provenance(row) {
                    layer = Provenance::Completed;
                    exactness = exactness.max(how);
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
                layer,
                exactness,
                dropped: spec.base.drop.iter().any(|d| d.value == *label),
            }
        })
        .collect();
    let null = reduced.rows.iter().map(|(column, row)| {
        let entries = row.range(..columns);
        let (layer, exactness) = provenance(row);
        Direction {
            column: *column,
            terms: entries.map(|(c, e)| term(&field, *c, e)).collect(),
            layer,
            exactness,
        }
    });
    Base {
        parameters,
        null: null.collect(),
        known: known
            .iter()
            .map(|k| Known {
                column: k.column,
                terms: k.terms.iter().map(|(c, e)| term(&field, *c, e)).collect(),
            })
            .collect(),
        from_trees,
        trees: sum.trees,
        completed: null_dimension - from_trees,
        refuted,
        unrecognised,
        held,
        coincidences: field.coincidences().map(str::to_owned).collect(),
    }
}

fn column(model: &Model, label: &str) -> Option<usize> {
    model.parameters.iter().position(|p| p.label == label)
}

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
