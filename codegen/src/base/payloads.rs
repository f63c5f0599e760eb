//! Payloads: bodies that are carried in some runs only. Runs without and with a payload have the
//! rows `[W_r 0; W_r W_p]`, whose null space is the direct sum of those of `W_r` and of `W_p`: no
//! combination contains columns of both groups. The null space of each group is the part of that of
//! `[W_r W_p]` whose entries in the other group are 0.

use crate::model::Model;

use super::certificate::{Certificate, Samples};
use super::field::Field;
use super::kept_columns;
use super::span::Vector;

/// The null directions within the robot's parameters and within those of each payload, from a basis
/// of all null directions. Entries after the columns of the parameters are transformed with them.
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
        // the columns outside are eliminated first, so that a row with its pivot in the group has no
        // entry in them
        let reduced = kept_columns::reduce(field, &null, &order, requested);
        let rows = reduced.rows.into_iter();
        all.extend(rows.filter(|(c, _)| group.contains(c)).map(|(_, row)| row));
    }
    all
}

/// The certificate of all groups together: the sum of their ranks, the smallest singular value that
/// counts in any group, and the largest that does not.
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
        smallest_pivot: sum.smallest_pivot.min(part.smallest_pivot),
        largest_remainder: sum.largest_remainder.max(part.largest_remainder),
        ..whole
    })
}
