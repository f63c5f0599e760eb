//! Linear spans over the field, as sparse vectors in echelon form.

use std::collections::BTreeMap;

use super::field::{Element, Field};
use super::magnitude::Bound;

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

/// Subtracts the multiple of `row`, which has 1 at the index `lead`, that makes the entry of `to`
/// there 0. Entries that cancel up to rounding become 0 too.
pub(super) fn clear(field: &mut Field, to: &mut Vector, lead: usize, row: &Vector) {
    let Some(factor) = to.get(&lead).map(Element::neg) else {
        return;
    };
    let rounding = Bound::of_sum(to, &factor, row);
    add_scaled(field, to, &factor, row);
    to.remove(&lead);
    to.retain(|_, e| !rounding.exceeds(e));
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
        self.insert_if(field, vector, &|_| true)
    }

    /// As [`insert`](Self::insert), unless `accepts` rejects the new basis row.
    pub(super) fn insert_if(
        &mut self,
        field: &mut Field,
        vector: &Vector,
        accepts: &dyn Fn(&Vector) -> bool,
    ) -> bool {
        let mut rest = vector.clone();
        for (lead, row) in &self.rows {
            clear(field, &mut rest, *lead, row);
        }
        // the entry with the shortest expression becomes the leading one
        let small = Bound::of_pivots(&rest);
        let Some(lead) = rest
            .iter()
            .min_by_key(|(i, e)| (small.exceeds(e), e.weight(), **i))
            .map(|(i, _)| *i)
        else {
            return false;
        };
        let factor = rest.get(&lead).and_then(|e| field.div(&Element::one(), e));
        let Some(factor) = factor else { return false };
        let mut row = Vector::new();
        add_scaled(field, &mut row, &factor, &rest);
        row.insert(lead, Element::one());
        if !accepts(&row) {
            return false;
        }
        for (_, old) in &mut self.rows {
            clear(field, old, lead, &row);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sym::Number;

    fn vector(entries: impl IntoIterator<Item = Number>) -> Vector {
        sparse(entries.into_iter().map(Element::exact))
    }

    /// An angle of 1.57079632679 has a cosine of 5e-12. The second vector is the first one,
    /// computed in another order.
    #[test]
    fn a_remainder_of_rounding_does_not_extend_the_span() -> Result<(), String> {
        let angle = Number::parse_decimal("1.57079632679").ok_or("no decimal")?;
        let (sin, cos) = angle.sin_cos();
        let mut field = Field::default();
        let square = cos.mul(&cos);
        let others = Number::one().sub(&sin.mul(&sin));
        let first = vector([square.mul(&square), square.mul(&sin), cos.clone()]);
        let second = vector([others.mul(&others), others.mul(&sin), cos.clone()]);
        let mut span = Span::default();
        assert!(span.insert(&mut field, &first));
        assert!(!span.insert(&mut field, &second));
        // while a small entry is not rounding
        let third = vector([square.mul(&square), square.mul(&sin), cos.add(&square)]);
        assert!(span.insert(&mut field, &third));
        Ok(())
    }

    #[test]
    fn a_vector_that_is_not_accepted_leaves_the_span_as_it_is() {
        let mut field = Field::default();
        let mut span = Span::default();
        let unit = |i: usize| Vector::from([(i, Element::one())]);
        assert!(span.insert(&mut field, &unit(0)));
        let no = |row: &Vector| !row.contains_key(&1);
        let both = Vector::from([(0, Element::one()), (1, Element::one())]);
        assert!(!span.insert_if(&mut field, &both, &no));
        assert!(span.insert_if(&mut field, &unit(2), &no));
        assert_eq!(span.dimension(), 2);
    }
}
