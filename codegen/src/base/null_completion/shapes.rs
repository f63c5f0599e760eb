//! One direction may be written in many ways, since what trees show can be added
//! to it. Which way has short factors depends on the mechanism: a few are tried.

use crate::base::certificate::Float320;
use crate::base::span::Vector;
use crate::model::{Model, ParameterKind};

use super::recognise::is_rounding;

/// The columns where a direction is not zero.
pub(super) fn support(direction: &[Float320]) -> Vec<usize> {
    let columns = 0..direction.len();
    let mut support: Vec<usize> = columns.filter(|c| !is_rounding(&direction[*c])).collect();
    // with 1 where it is already
    if let Some(one) = support.iter().position(|c| direction[*c] == Float320::ONE) {
        support.swap(0, one);
    }
    support
}

/// Supports of a direction with others added, that are zero where they can be in
/// some order of the columns.
pub(super) fn same(model: &Model, null: &[Vector], direction: &[Float320]) -> Vec<Vec<usize>> {
    // which entries of a body stay longest
    const LAST: [&[usize]; 8] = [
        // products of inertia, all or one of them
        &[1, 2, 4],
        &[4],
        &[2],
        &[1],
        // moments of inertia, first moments
        &[0, 3, 5],
        &[6, 7, 8],
        &[6, 7, 8, 9],
        &[0, 1, 2, 3, 4, 5],
    ];
    let is_last = |c: usize, last: &[usize]| match model.parameters[c].kind {
        ParameterKind::Inertial { entry, .. } => last.contains(&entry),
        // friction is friction's own matter
        _ => true,
    };
    let columns = || 0..direction.len();
    // inner bodies' columns stay longer, or outer ones'
    let sorted = LAST.iter().flat_map(|last| {
        [columns().rev().collect(), columns().collect()].map(|mut order: Vec<usize>| {
            order.sort_by_key(|c| is_last(*c, last));
            order
        })
    });
    sorted
        .map(|order| support(&zeroed(null, direction, &order)))
        .collect()
}

/// The direction with zeros at as many of the first columns as can be.
fn zeroed(null: &[Vector], direction: &[Float320], order: &[usize]) -> Vec<Float320> {
    let mut rows: Vec<Vec<Float320>> = null
        .iter()
        .map(|row| {
            let mut values = vec![Float320::ZERO; direction.len()];
            for (column, element) in row {
                values[*column] = Float320::from_number(element.value());
            }
            values
        })
        .collect();
    let mut direction = direction.to_vec();
    for &c in order {
        let largest = (0..rows.len()).max_by(|&i, &j| rows[i][c].cmp_abs(&rows[j][c]));
        let Some(pivot) = largest.filter(|&i| !is_rounding(&rows[i][c])) else {
            continue;
        };
        let pivot = rows.swap_remove(pivot);
        for row in rows.iter_mut().chain([&mut direction]) {
            let Some(factor) = row[c].checked_div(pivot[c]).filter(|f| !f.is_zero()) else {
                continue;
            };
            for (x, p) in row.iter_mut().zip(&pivot) {
                if !p.is_zero() {
                    *x = *x - factor * *p;
                }
            }
            row[c] = Float320::ZERO;
        }
    }
    direction
}
