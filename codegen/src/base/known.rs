//! Prior knowledge about the parameters: linear forms that are zero (`base.zero`) and bodies that
//! are identical (`base.equal`). Each such relation removes one parameter from the analysis and
//! writes it as a combination of others.

use crate::model::Model;
use crate::spec::Spec;

use super::field::{Element, Field};
use super::geometry::Names;
use super::span::{Vector, add_scaled, dot};

/// A parameter written as a combination of others, with factors in the field.
#[derive(Clone, Debug)]
pub(super) struct FieldSubstitution {
    /// The column of the replaced parameter.
    pub(super) column: usize,
    /// The combination: columns with factors.
    pub(super) terms: Vec<(usize, Element)>,
}

/// The substitutions that `base.equal` and `base.zero` imply. No substitution uses a column that
/// another one removes.
pub(super) fn substitutions(
    field: &mut Field,
    spec: &Spec,
    model: &Model,
) -> Vec<FieldSubstitution> {
    let names = Names::new(field, spec);
    let find = |label: &str| model.parameters.iter().position(|p| p.label == label);
    let body = |label: &str| model.bodies.iter().position(|b| b.label == label);
    // each form, a sum of factors times columns, is zero; its preferred column is removed
    let mut forms: Vec<(Option<usize>, Vector)> = Vec::new();
    for group in &spec.base.equal {
        let bodies: Vec<usize> = group.iter().filter_map(|b| body(&b.value)).collect();
        let Some((first, others)) = bodies.split_first() else {
            continue;
        };
        for other in others {
            for entry in 0..10 {
                let form = Vector::from([
                    (10 * other + entry, Element::one()),
                    (10 * first + entry, Element::integer(-1)),
                ]);
                forms.push((Some(10 * other + entry), form));
            }
        }
    }
    for zero in &spec.base.zero {
        let mut form = Vector::new();
        let mut first = None;
        for (label, factor) in &zero.terms {
            let Some(column) = find(&label.value) else {
                continue;
            };
            let factor = names.element(field, factor);
            let term = Vector::from([(column, Element::one())]);
            add_scaled(field, &mut form, &factor, &term);
            first = first.or(Some(column));
        }
        forms.push((first, form));
    }
    let mut found: Vec<FieldSubstitution> = Vec::new();
    for (preferred, mut form) in forms {
        for earlier in &found {
            if let Some(factor) = form.remove(&earlier.column) {
                let terms: Vector = earlier.terms.iter().cloned().collect();
                add_scaled(field, &mut form, &factor, &terms);
            }
        }
        // a form that the earlier ones imply removes no parameter
        let column = preferred
            .filter(|c| form.contains_key(c))
            .or_else(|| form.keys().next().copied());
        let Some(column) = column else { continue };
        let Some(lead) = form.remove(&column) else {
            continue;
        };
        let Some(factor) = field.div(&Element::integer(-1), &lead) else {
            continue;
        };
        let mut terms = Vector::new();
        add_scaled(field, &mut terms, &factor, &form);
        // substitute the column in earlier combinations that use it
        for earlier in &mut found {
            let mut old: Vector = earlier.terms.iter().cloned().collect();
            if let Some(factor) = old.remove(&column) {
                add_scaled(field, &mut old, &factor, &terms);
                earlier.terms = old.into_iter().collect();
            }
        }
        found.push(FieldSubstitution {
            column,
            terms: terms.into_iter().collect(),
        });
    }
    found
}

/// The null directions that satisfy the relations of `known`, over the remaining columns.
pub(super) fn restricted(
    field: &mut Field,
    null: &[Vector],
    known: &[FieldSubstitution],
) -> Vec<Vector> {
    let mut rows = null.to_vec();
    for substitution in known {
        // the form: column - terms
        let mut form = Vector::from([(substitution.column, Element::one())]);
        for (column, factor) in &substitution.terms {
            let term = Vector::from([(*column, Element::one())]);
            add_scaled(field, &mut form, &factor.neg(), &term);
        }
        let values: Vec<Element> = rows.iter().map(|r| dot(field, &form, r)).collect();
        let pivot = values
            .iter()
            .enumerate()
            .filter(|(_, v)| !v.is_zero())
            .min_by_key(|(i, v)| (v.weight(), rows[*i].len(), *i))
            .map(|(i, _)| i);
        let Some(pivot) = pivot else { continue };
        let row = rows[pivot].clone();
        for (i, value) in values.iter().enumerate() {
            if i == pivot || value.is_zero() {
                continue;
            }
            if let Some(factor) = field.div(&value.neg(), &values[pivot]) {
                add_scaled(field, &mut rows[i], &factor, &row);
            }
        }
        rows.remove(pivot);
    }
    for row in &mut rows {
        for substitution in known {
            row.remove(&substitution.column);
        }
    }
    rows
}
