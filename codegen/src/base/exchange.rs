//! Exchange of kept and eliminated columns, so that no coefficient is out of proportion.
//!
//! Any choice of independent kept columns is correct. But if an eliminated parameter that acts as
//! strongly as a kept one has a coefficient of 1000 in the kept one's combination, the two columns
//! differ by little and the kept one is small: its estimate is poor, and the rows are badly
//! conditioned. Exchanging the two divides a row of the null space by the coefficient. It multiplies
//! the volume that the kept columns span, each scaled to length 1, by the coefficient times the
//! ratio of the columns' lengths, so that exchanges end (Goreinov, Tyrtyshnikov and Zamarashkin
//! 1997, maximal volume).

use std::collections::BTreeMap;

use crate::model::{Model, ParameterKind};

use super::field::Field;
use super::kept_columns::{Place, Reduced};
use super::span::Vector;

/// The largest coefficient that causes no exchange, in units in which all columns have length 1.
const MAX_COEFFICIENT: f64 = 4.0;
/// The condition of the kept columns above which exchanges go on with a smaller largest coefficient.
const POOR_CONDITION: f64 = 1000.0;
/// That largest coefficient: above 1, so that exchanges still end.
const MAX_COEFFICIENT_IF_POOR: f64 = 1.1;
/// The further exchanges are used if they reduce the condition to at most this part: a smaller gain
/// does not justify other kept parameters.
const MAX_REDUCED_CONDITION: f64 = 2.0 / 3.0;
/// The largest number of exchanges, which bounds the time.
const MAX_EXCHANGES: usize = 2000;

/// Which columns may be exchanged, and the measures that decide.
pub(super) struct Rules<'a> {
    pub(super) model: &'a Model,
    /// How strongly each parameter acts: the lengths of the sampled columns.
    pub(super) lengths: &'a [f64],
    /// The columns that the spec asks to eliminate.
    pub(super) requested: &'a [usize],
    /// Whether a row may be divided by a coefficient that is an expression, not a number.
    pub(super) divides_by_expressions: bool,
    /// The condition of the sampled rows where these columns are eliminated.
    pub(super) condition: &'a dyn Fn(&Reduced) -> f64,
}

/// A coefficient above the limit, and its kept column.
#[derive(Clone, Copy)]
struct Excess {
    size: f64,
    kept: usize,
}

/// Exchanges columns until no coefficient between inertial parameters is out of proportion.
pub(super) fn exchange(field: &mut Field, reduced: &mut Reduced, rules: &Rules<'_>) {
    rules.exchange_above(MAX_COEFFICIENT, field, reduced);
    let condition = (rules.condition)(reduced);
    if condition > POOR_CONDITION {
        let mut other = reduced.clone();
        rules.exchange_above(MAX_COEFFICIENT_IF_POOR, field, &mut other);
        if (rules.condition)(&other) <= MAX_REDUCED_CONDITION * condition {
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
        // the largest excess of each row; an exchange removes the entries of the rows it changes
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

    /// Whether a column may be exchanged: it belongs to an inertial parameter, which the spec does
    /// not ask to eliminate, of a body that is not fixed to another.
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

    /// The largest coefficient of a row above `limit`, if the row has one.
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
