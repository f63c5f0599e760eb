//! Payloads: bodies that are carried in some runs only. Rows with and without a payload are
//! `[W_r 0; W_r W_p]`, whose null space is that of `W_r` beside that of `W_p`: combinations across
//! the two groups of columns are told apart. Both are the part of the null space of `[W_r W_p]`
//! that is 0 in the other group.

use crate::model::Model;

use super::certificate::{Certificate, Samples};
use super::field::Field;
use super::kept_columns;
use super::span::Vector;

/// The null directions within the robot's parameters and within those of each payload, from a basis
/// of all null directions; entries behind the columns of the parameters are carried along.
pub(super) fn apart(field: &mut Field, null: Vec<Vector>, model: &Model) -> Vec<Vector> {
    if model.payloads.is_empty() {
        return null;
    }
    let mut all = Vec::new();
    for group in model.column_groups() {
        let outside = (0..model.parameters.len()).filter(|c| !group.contains(c));
        let mut order: Vec<usize> = outside.collect();
        let requested = order.len();
        order.extend(&group);
        // a row whose pivot is in the group has no entry in the columns that were eliminated before
        let reduced = kept_columns::reduce(field, &null, &order, requested);
        let rows = reduced.rows.into_iter();
        all.extend(rows.filter(|(c, _)| group.contains(c)).map(|(_, row)| row));
    }
    all
}

/// The evidence for the rank of the groups together: the sum of their ranks, with the smallest
/// number kept and the largest dropped in any of them.
pub(super) fn certificate(samples: &Samples, model: &Model) -> Certificate {
    let whole = samples.certificate();
    if model.payloads.is_empty() {
        return whole;
    }
    let groups = model.column_groups().into_iter();
    let mut parts = groups.map(|group| samples.certificate_of(&group));
    let first = parts.next().unwrap_or(whole);
    parts.fold(first, |sum, part| Certificate {
        columns: sum.columns + part.columns,
        rank: sum.rank + part.rank,
        smallest_kept: sum.smallest_kept.min(part.smallest_kept),
        largest_dropped: sum.largest_dropped.max(part.largest_dropped),
        ..whole
    })
}
