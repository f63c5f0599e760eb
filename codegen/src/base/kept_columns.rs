//! Which columns are kept: row reduction of the null space with the columns in
//! order of preference. Values decide; expressions follow.

use std::collections::BTreeMap;

use crate::model::{Model, ParameterKind};

use super::field::{Element, Field};
use super::span::{Vector, add_scaled};

/// Columns in the order in which they are eliminated where they can be: first
/// the given ones, then whatever leaves tidy and cheap columns.
///
/// Masses, then first moments along z, then one diagonal moment go first, those
/// of bodies far from the base before those near it (the grouping of Khalil's
/// rules); friction and rotors are kept as long as possible.
pub(super) fn preference(model: &Model, first: &[usize]) -> Vec<usize> {
    const ORDER: [usize; 10] = [9, 8, 3, 5, 4, 2, 1, 7, 6, 0];
    let rank = |column: usize| -> (usize, usize) {
        match model.parameters[column].kind {
            ParameterKind::Inertial { body, entry } => {
                let class = ORDER.iter().position(|e| *e == entry).unwrap_or(0);
                (class, usize::MAX - body)
            }
            ParameterKind::Rotor { coordinate } => (20, coordinate),
            ParameterKind::Friction { .. } => (30, column),
        }
    };
    let mut rest: Vec<usize> = (0..model.parameters.len())
        .filter(|c| !first.contains(c))
        .collect();
    rest.sort_by_key(|c| (rank(*c), *c));
    first.iter().copied().chain(rest).collect()
}

/// The null space with a unit matrix at the eliminated columns.
#[derive(Debug, Default)]
pub(super) struct Reduced {
    /// The eliminated columns, in the order of the parameters, each with the
    /// row that is 1 there: what else stands in the row says on what the column
    /// depends.
    pub(super) rows: BTreeMap<usize, Vector>,
}

/// Reduces a null space. The first `asked` columns of the order are eliminated
/// where they can be, whatever that takes. Of the others those go first that go
/// without dividing by an expression, since that keeps every coefficient short;
/// then whatever is left.
pub(super) fn reduce(field: &mut Field, null: &[Vector], order: &[usize], asked: usize) -> Reduced {
    let mut open = null.to_vec();
    let mut reduced = Reduced::default();
    let (first, rest) = order.split_at(asked.min(order.len()));
    for column in first {
        reduced.eliminate(field, &mut open, *column, usize::MAX);
    }
    for most in [0, usize::MAX] {
        for column in rest {
            if !reduced.rows.contains_key(column) {
                reduced.eliminate(field, &mut open, *column, most);
            }
        }
    }
    reduced
}

impl Reduced {
    /// Eliminates a column, if some open row has an entry there that weighs at
    /// most `most`: the shortest such entry is the pivot.
    fn eliminate(&mut self, field: &mut Field, open: &mut Vec<Vector>, column: usize, most: usize) {
        let pivot = open
            .iter()
            .enumerate()
            .filter_map(|(r, row)| Some((row.get(&column)?.weight(), row.len(), r)))
            .min();
        let Some((weight, _, r)) = pivot else { return };
        if weight > most {
            return;
        }
        let row = open.swap_remove(r);
        let inverse = row.get(&column).and_then(|p| field.div(&Element::one(), p));
        let Some(inverse) = inverse else { return };
        let mut scaled = Vector::new();
        add_scaled(field, &mut scaled, &inverse, &row);
        scaled.insert(column, Element::one());
        for other in open.iter_mut().chain(self.rows.values_mut()) {
            if let Some(factor) = other.get(&column).map(Element::neg) {
                add_scaled(field, other, &factor, &scaled);
                other.remove(&column);
            }
        }
        self.rows.insert(column, scaled);
    }
}
