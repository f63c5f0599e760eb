//! Alternative forms of a null direction. Derived null directions can be added to it, and the
//! mechanism decides in which form the factors are short, so several forms are tried.

use crate::base::certificate::Float320;
use crate::base::span::Vector;
use crate::model::{Model, ParameterKind};

use super::recognise::is_rounding;

/// The columns where a direction is not zero.
pub(super) fn support(direction: &[Float320]) -> Vec<usize> {
    let columns = 0..direction.len();
    let mut support: Vec<usize> = columns.filter(|c| !is_rounding(&direction[*c])).collect();
    // a column whose entry is 1 already comes first
    if let Some(one) = support.iter().position(|c| direction[*c] == Float320::ONE) {
        support.swap(0, one);
    }
    support
}

/// The supports of several forms of a direction. Each form results from adding multiples of the
/// derived null directions, such that as many as possible of the first columns of some order are 0.
pub(super) fn equivalent_supports(
    model: &Model,
    null: &[Vector],
    direction: &[Float320],
) -> Vec<Vec<usize>> {
    // entries of a body that are eliminated last
    const ELIMINATED_LAST: [&[usize]; 8] = [
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
        // columns of friction are eliminated last, as they combine with each other only
        _ => true,
    };
    let columns = || 0..direction.len();
    // each once with outer bodies before inner ones, and once in the opposite order
    let sorted = ELIMINATED_LAST.iter().flat_map(|last| {
        [columns().rev().collect(), columns().collect()].map(|mut order: Vec<usize>| {
            order.sort_by_key(|c| is_last(*c, last));
            order
        })
    });
    let rows = null.iter().map(|row| {
        let mut values = vec![Float320::ZERO; direction.len()];
        for (column, element) in row {
            values[*column] = Float320::from_number(element.value());
        }
        values
    });
    let rows: Vec<Vec<Float320>> = rows.collect();
    sorted
        .map(|order| support(&with_zeros(rows.clone(), direction, &order)))
        .collect()
}

/// The direction plus multiples of the null directions `rows`, with zeros at as many of the first
/// columns of `order` as possible.
fn with_zeros(
    mut rows: Vec<Vec<Float320>>,
    direction: &[Float320],
    order: &[usize],
) -> Vec<Float320> {
    let mut direction = direction.to_vec();
    for &c in order {
        let largest = (0..rows.len()).max_by(|&i, &j| rows[i][c].cmp_abs(&rows[j][c]));
        let Some(pivot) = largest.filter(|&i| !is_rounding(&rows[i][c])) else {
            continue;
        };
        let pivot = rows.swap_remove(pivot);
        for row in rows.iter_mut().chain([&mut direction]) {
            if row[c].is_zero() {
                continue;
            }
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
