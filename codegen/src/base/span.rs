//! Linear spans over the field, as sparse vectors in echelon form.

use std::collections::BTreeMap;

use super::field::{Element, Field};

/// A sparse vector: entries by index, none of them zero.
pub(super) type Vector = BTreeMap<usize, Element>;

/// Adds `factor * from` to the vector `to`.
pub(super) fn add_scaled(field: &mut Field, to: &mut Vector, factor: &Element, from: &Vector) {
    for (index, entry) in from {
        let product = field.mul(factor, entry);
        let sum = match to.get(index) {
            Some(old) => field.add(old, &product),
            None => product,
        };
        if sum.is_zero() {
            to.remove(index);
        } else {
            to.insert(*index, sum);
        }
    }
}

/// A vector from dense entries.
pub(super) fn sparse(entries: impl IntoIterator<Item = Element>) -> Vector {
    let entries = entries.into_iter().enumerate();
    entries.filter(|(_, e)| !e.is_zero()).collect()
}

/// The scalar product.
pub(super) fn dot(field: &mut Field, a: &Vector, b: &Vector) -> Element {
    let mut sum = Element::zero();
    for (index, x) in a {
        if let Some(y) = b.get(index) {
            let product = field.mul(x, y);
            sum = field.add(&sum, &product);
        }
    }
    sum
}

/// A linear span: each basis row has a leading entry 1 at an index where no other row has an entry.
#[derive(Clone, Debug, Default)]
pub(super) struct Span {
    rows: Vec<(usize, Vector)>,
}

impl Span {
    pub(super) fn dimension(&self) -> usize {
        self.rows.len()
    }

    pub(super) fn vectors(&self) -> impl Iterator<Item = &Vector> {
        self.rows.iter().map(|r| &r.1)
    }

    /// Adds a vector to the span; false if the span contained it already.
    pub(super) fn insert(&mut self, field: &mut Field, vector: &Vector) -> bool {
        let mut rest = vector.clone();
        for (lead, row) in &self.rows {
            if let Some(factor) = rest.get(lead).map(Element::neg) {
                add_scaled(field, &mut rest, &factor, row);
            }
        }
        // the entry with the shortest expression becomes the leading one
        let Some(lead) = rest
            .iter()
            .min_by_key(|(i, e)| (e.weight(), **i))
            .map(|(i, _)| *i)
        else {
            return false;
        };
        let factor = rest.get(&lead).and_then(|e| field.div(&Element::one(), e));
        let Some(factor) = factor else { return false };
        let mut row = Vector::new();
        add_scaled(field, &mut row, &factor, &rest);
        row.insert(lead, Element::one());
        for (_, old) in &mut self.rows {
            if let Some(factor) = old.get(&lead).map(Element::neg) {
                add_scaled(field, old, &factor, &row);
            }
        }
        self.rows.push((lead, row));
        true
    }

    /// A basis of the vectors with `width` entries that are orthogonal to the whole span.
    pub(super) fn annihilator(&self, width: usize) -> Vec<Vector> {
        let leads: Vec<usize> = self.rows.iter().map(|r| r.0).collect();
        (0..width)
            .filter(|free| !leads.contains(free))
            .map(|free| {
                let mut vector = Vector::new();
                for (lead, row) in &self.rows {
                    if let Some(entry) = row.get(&free) {
                        vector.insert(*lead, entry.neg());
                    }
                }
                vector.insert(free, Element::one());
                vector
            })
            .collect()
    }
}
