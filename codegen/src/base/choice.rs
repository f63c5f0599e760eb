//! Which columns are kept: row reduction of the null space with the columns in
//! order of preference. Values decide; expressions follow.

use std::collections::BTreeSet;

use crate::model::{Model, ParameterKind};
use crate::sym::Number;

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

/// The columns that are eliminated: the first independent ones of the null
/// space, by value.
pub(super) fn eliminated(null: &[Vector], order: &[usize]) -> Vec<usize> {
    let mut rows: Vec<std::collections::BTreeMap<usize, Number>> = null
        .iter()
        .map(|v| v.iter().map(|(i, e)| (*i, e.value().clone())).collect())
        .collect();
    let mut chosen = Vec::new();
    for &column in order {
        let at = rows.iter().position(|r| r.contains_key(&column));
        let Some(at) = at else { continue };
        let pivot = rows.swap_remove(at);
        let Some(inverse) = pivot.get(&column).and_then(|p| Number::one().div(p)) else {
            continue;
        };
        for row in &mut rows {
            let Some(entry) = row.get(&column) else { continue };
            let factor = entry.mul(&inverse).neg();
            for (i, p) in &pivot {
                let sum = match row.get(i) {
                    Some(old) => old.add(&factor.mul(p)),
                    None => factor.mul(p),
                };
                if sum.is_zero() {
                    row.remove(i);
                } else {
                    row.insert(*i, sum);
                }
            }
            row.remove(&column);
        }
        chosen.push(column);
        if rows.is_empty() {
            break;
        }
    }
    chosen
}

/// The null space with a unit matrix at the eliminated columns, row by row in
/// their order: what is left in a row says on what else the column depends.
pub(super) fn reduced(field: &mut Field, null: &[Vector], eliminated: &[usize]) -> Vec<Vector> {
    let mut rows = null.to_vec();
    let mut open_rows: BTreeSet<usize> = (0..rows.len()).collect();
    let mut open_columns: BTreeSet<usize> = eliminated.iter().copied().collect();
    let mut row_of = std::collections::BTreeMap::new();
    while !open_columns.is_empty() {
        // the shortest expression, in the row that disturbs least
        let best = open_rows
            .iter()
            .flat_map(|r| rows[*r].iter().map(move |(c, e)| (*r, *c, e)))
            .filter(|(_, c, _)| open_columns.contains(c))
            .min_by_key(|(r, c, e)| (e.weight(), rows[*r].len(), *c, *r))
            .map(|(r, c, _)| (r, c));
        let Some((r, c)) = best else { break };
        open_rows.remove(&r);
        open_columns.remove(&c);
        row_of.insert(c, r);
        let pivot = rows[r].get(&c).cloned().unwrap_or_else(Element::one);
        let Some(inverse) = field.div(&Element::one(), &pivot) else { break };
        let mut scaled = Vector::new();
        add_scaled(field, &mut scaled, &inverse, &rows[r]);
        scaled.insert(c, Element::one());
        for (i, row) in rows.iter_mut().enumerate() {
            if i == r {
                continue;
            }
            if let Some(factor) = row.get(&c).map(Element::neg) {
                add_scaled(field, row, &factor, &scaled);
                row.remove(&c);
            }
        }
        rows[r] = scaled;
    }
    eliminated
        .iter()
        .filter_map(|c| row_of.get(c).map(|r| rows[*r].clone()))
        .collect()
}
