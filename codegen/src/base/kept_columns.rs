//! Choice of the columns that are kept: row reduction of the null space with the columns in order
//! of preference. Decisions are made on exact values at the given geometry; the expressions are
//! carried along.

use std::collections::BTreeMap;

use crate::model::{Model, ParameterKind};

use super::field::{Element, Field};
use super::span::{Vector, add_scaled, clear};

/// Columns in the order in which elimination is tried: first those of `first`, then the others so
/// that the remaining base parameters are simple.
///
/// Masses, then first moments along z, then one diagonal moment are eliminated first, those of
/// bodies far from the base before those near it (the grouping of Khalil's rules); friction and
/// rotors are kept as long as possible, offsets as long as no friction has their effect: Fc+ and Fc-
/// then are the efforts in either direction.
pub(super) fn preference(model: &Model, first: &[usize]) -> Vec<usize> {
    const ORDER: [usize; 10] = [9, 8, 3, 5, 4, 2, 1, 7, 6, 0];
    let rank = |column: usize| -> (usize, usize) {
        match model.parameters[column].kind {
            ParameterKind::Inertial { body, entry } => {
                let class = ORDER.iter().position(|e| *e == entry).unwrap_or(0);
                (class, usize::MAX - body)
            }
            ParameterKind::Rotor { coordinate } => (20, coordinate),
            ParameterKind::Offset { coordinate } => (25, coordinate),
            ParameterKind::JointSpring { .. }
            | ParameterKind::EffortTerm { .. }
            | ParameterKind::PointSpring { .. } => (27, column),
            ParameterKind::Friction { .. } => (30, column),
        }
    };
    let mut rest: Vec<usize> = (0..model.parameters.len())
        .filter(|c| !first.contains(c))
        .collect();
    rest.sort_by_key(|c| (rank(*c), *c));
    first.iter().copied().chain(rest).collect()
}

/// A basis of the null space that is the unit matrix at the eliminated columns.
#[derive(Debug, Default)]
pub(super) struct Reduced {
    /// By eliminated column, the row that is 1 there and 0 at all other eliminated columns: its
    /// other entries express the eliminated parameter by kept ones.
    pub(super) rows: BTreeMap<usize, Vector>,
}

/// Row-reduces a null space. The first `requested` columns of `order` are eliminated wherever
/// possible, even by dividing by an expression. Of the others, first those are eliminated whose
/// pivot is a constant, since that keeps every coefficient short; then all that remain.
pub(super) fn reduce(
    field: &mut Field,
    null: &[Vector],
    order: &[usize],
    requested: usize,
) -> Reduced {
    let mut open = null.to_vec();
    let mut reduced = Reduced::default();
    let (first, rest) = order.split_at(requested.min(order.len()));
    for column in first {
        reduced.eliminate(field, &mut open, *column, usize::MAX);
    }
    for max_weight in [0, usize::MAX] {
        for column in rest {
            if !reduced.rows.contains_key(column) {
                reduced.eliminate(field, &mut open, *column, max_weight);
            }
        }
    }
    reduced
}

impl Reduced {
    /// Eliminates a column, if some row of `open` has an entry there with a weight of at most
    /// `max_weight`: the entry with the shortest expression is the pivot.
    fn eliminate(
        &mut self,
        field: &mut Field,
        open: &mut Vec<Vector>,
        column: usize,
        max_weight: usize,
    ) {
        let pivot = open
            .iter()
            .enumerate()
            .filter_map(|(r, row)| Some((row.get(&column)?.weight(), row.len(), r)))
            .min();
        let Some((weight, _, r)) = pivot else { return };
        if weight > max_weight {
            return;
        }
        let row = open.swap_remove(r);
        let inverse = row.get(&column).and_then(|p| field.div(&Element::one(), p));
        let Some(inverse) = inverse else { return };
        let mut scaled = Vector::new();
        add_scaled(field, &mut scaled, &inverse, &row);
        scaled.insert(column, Element::one());
        for other in open.iter_mut().chain(self.rows.values_mut()) {
            clear(field, other, column, &scaled);
        }
        self.rows.insert(column, scaled);
    }
}
