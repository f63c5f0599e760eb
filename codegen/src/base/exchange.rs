//! Exchange of kept and eliminated columns, so that no coefficient is out of proportion.
//!
//! Any choice of kept columns that leaves independent ones is right. Where a kept parameter has a
//! coefficient of 1000 for an eliminated one that acts as strongly, the kept one barely tells what
//! the eliminated one tells well: its estimate is poor, and the rows are badly conditioned.
//! Exchanging the two divides a row of the null space by the coefficient. It multiplies the volume
//! that the kept columns span, each of length 1, by the coefficient's size beside the columns'
//! lengths, so that exchanges end (Goreinov, Tyrtyshnikov and Zamarashkin 1997, maximal volume).

use std::collections::BTreeMap;

use crate::model::{Model, ParameterKind};

use super::field::Field;
use super::kept_columns::{Place, Reduced};
use super::span::Vector;

/// Coefficients up to this size stay, in units in which all columns have length 1.
const LARGEST: f64 = 4.0;
/// Where the condition of the kept columns is above `POOR` then, coefficients up to `LARGEST_IF_POOR`
/// stay, if that lowers it to at most `BETTER` of what it was.
const POOR: f64 = 1000.0;
const LARGEST_IF_POOR: f64 = 1.1;
const BETTER: f64 = 2.0 / 3.0;
/// The largest number of exchanges.
const MAX_EXCHANGES: usize = 2000;

/// What may be exchanged.
pub(super) struct Rules<'a> {
    pub(super) model: &'a Model,
    /// How strongly each parameter acts: the lengths of the sampled columns.
    pub(super) lengths: &'a [f64],
    /// The columns that the spec asks to eliminate.
    pub(super) requested: &'a [usize],
    /// Whether coefficients with an expression may be divided by: only where no name occurs in them.
    pub(super) divides_by_expressions: bool,
    /// The condition of the sampled rows where these columns are eliminated.
    pub(super) condition: &'a dyn Fn(&Reduced) -> f64,
}

/// A coefficient that is too large.
#[derive(Clone, Copy)]
struct Excess {
    size: f64,
    kept: usize,
}

/// Exchanges columns until no coefficient between inertial parameters is out of proportion.
pub(super) fn exchange(field: &mut Field, reduced: &mut Reduced, rules: &Rules<'_>) {
    rules.exchange_above(LARGEST, field, reduced);
    let condition = (rules.condition)(reduced);
    if condition > POOR {
        let mut other = reduced.clone();
        rules.exchange_above(LARGEST_IF_POOR, field, &mut other);
        if (rules.condition)(&other) <= BETTER * condition {
            *reduced = other;
        }
    }
}

impl Rules<'_> {
    /// Exchanges columns while a coefficient is above `limit`; the largest first.
    fn exchange_above(&self, limit: f64, field: &mut Field, reduced: &mut Reduced) {
        let movable: Vec<bool> = (0..self.lengths.len())
            .map(|column| self.may_move(column))
            .collect();
        // the worst coefficient of each row; a row that changes is looked at again
        let mut worst: BTreeMap<usize, Option<Excess>> = BTreeMap::new();
        for _ in 0..MAX_EXCHANGES {
            for (eliminated, row) in &reduced.rows {
                worst
                    .entry(*eliminated)
                    .or_insert_with(|| self.worst(*eliminated, row, limit, &movable));
            }
            let found = worst
                .iter()
                .filter_map(|(eliminated, excess)| Some((*eliminated, (*excess)?)))
                .reduce(|a, b| if b.1.size > a.1.size { b } else { a });
            let Some((eliminated, Excess { kept, .. })) = found else {
                return;
            };
            worst.retain(|column, _| {
                let row = reduced.rows.get(column);
                row.is_some_and(|row| !row.contains_key(&kept))
            });
            let Some(row) = reduced.rows.remove(&eliminated) else {
                return;
            };
            reduced.eliminate(field, &mut vec![row], kept, usize::MAX);
        }
    }

    /// Whether a column may change from kept to eliminated and back: those of inertial parameters,
    /// but not of bodies that are fixed to others.
    fn may_move(&self, column: usize) -> bool {
        let Some(parameter) = self.model.parameters.get(column) else {
            return false;
        };
        match parameter.kind {
            ParameterKind::Inertial { body, .. } => {
                !self.requested.contains(&column) && Place::of(self.model, body) != Place::Fixed
            }
            _ => false,
        }
    }

    /// The largest coefficient of a row above `limit`.
    fn worst(
        &self,
        eliminated: usize,
        row: &Vector,
        limit: f64,
        movable: &[bool],
    ) -> Option<Excess> {
        let own = self
            .lengths
            .get(eliminated)
            .filter(|length| **length > 0.0)?;
        if !*movable.get(eliminated)? {
            return None;
        }
        let mut worst = None;
        let mut largest = limit;
        for (kept, factor) in row.range(..movable.len()) {
            let may_divide = factor.weight() == 0 || self.divides_by_expressions;
            if *kept == eliminated || !movable[*kept] || !may_divide {
                continue;
            }
            let size = factor.value().to_f64().abs() * self.lengths[*kept] / own;
            if size > largest {
                largest = size;
                worst = Some(Excess { size, kept: *kept });
            }
        }
        worst
    }
}
