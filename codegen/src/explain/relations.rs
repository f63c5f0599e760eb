//! Linear relations among the coordinates on the branch of home, inferred from sampled rates.

use core::fmt::Write as _;

use crate::base::certificate::{ClosedState, Float320, rates, relations};
use crate::base::{LinearForm, is_implied_by, recognise};
use crate::model::Model;
use crate::sym::Number;

use super::{Evidence, Fact};

/// A linear relation: `coordinate = sum of terms + constant`.
#[derive(Clone, Debug)]
pub(super) struct Relation {
    coordinate: usize,
    terms: LinearForm,
    /// The largest error at the sampled states, as a fraction of the largest rate.
    largest_error: f64,
}

/// The linear relations among the coordinates: first those between two coordinates, then those
/// among several.
pub(super) fn linear_relations(model: &Model, states: &[ClosedState]) -> Vec<Relation> {
    let rows = rates(states);
    let size = rows
        .iter()
        .flatten()
        .fold(Float320::ONE, |m, x| m.max(x.abs()));
    let order: Vec<usize> = model
        .independent
        .iter()
        .chain(&model.dependent)
        .copied()
        .collect();
    let mut all: Vec<Relation> = Vec::new();
    // one coordinate of each set of coordinates whose rates are multiples of each other
    let mut representatives: Vec<usize> = Vec::new();
    for &c in &order {
        let before = representatives.iter().map(|&a| relations(&rows, &[a, c]));
        let mut pairs = before.filter_map(|mut found| found.pop());
        let pair = pairs.find(|r| r.column == c && r.terms.len() < 2);
        match pair.and_then(|pair| Relation::recognised(&pair, &rows, size)) {
            Some(relation) => all.push(relation),
            None => representatives.push(c),
        }
    }
    let several = relations(&rows, &representatives);
    all.extend(
        several
            .into_iter()
            .filter_map(|r| Relation::recognised(&r, &rows, size)),
    );
    all
}

impl Relation {
    /// The relation with exact factors; `None` if a factor is not recognised as an exact number.
    fn recognised(
        found: &crate::base::certificate::Relation,
        rows: &[Vec<Float320>],
        size: Float320,
    ) -> Option<Relation> {
        let mut terms = Vec::new();
        for (c, factor) in &found.terms {
            terms.push((*c, recognise(factor)?));
        }
        let errors = rows.iter().map(|row| {
            let terms = terms.iter();
            let sum = terms.fold(Float320::ZERO, |sum, (c, k)| {
                sum + Float320::from_number(k) * row[*c]
            });
            (row[found.column] - sum).abs()
        });
        let worst = errors
            .fold(Float320::ZERO, Float320::max)
            .checked_div(size)?;
        let largest_error = worst.to_f64();
        (largest_error < super::RELATION_TOLERANCE).then_some(Relation {
            coordinate: found.column,
            terms,
            largest_error,
        })
    }

    /// The relation as a statement, with the constant computed at home.
    pub(super) fn fact(
        &self,
        model: &Model,
        states: &[ClosedState],
        velocity_constraints: &[LinearForm],
    ) -> Fact {
        let mut form = self.terms.clone();
        form.push((self.coordinate, Number::from_i64(-1)));
        let evidence = if is_implied_by(velocity_constraints, &form) {
            Evidence::Exact
        } else {
            Evidence::sampled(states.len(), self.largest_error)
        };
        let name = |c: usize| &model.coordinates[c].name;
        let mut text = String::new();
        for (k, (c, factor)) in self.terms.iter().enumerate() {
            let size = factor.abs();
            text += match (k, factor.is_negative()) {
                (0, false) => "",
                (0, true) => "-",
                (_, false) => " + ",
                (_, true) => " - ",
            };
            if !size.is_one() {
                let _ = write!(text, "{}*", factor_text(&size));
            }
            text += name(*c);
        }
        let coordinate = name(self.coordinate);
        if self.terms.is_empty() {
            return Fact::new(
                format!("{coordinate} does not change on this branch"),
                evidence,
            );
        }
        let constant = states.first().map_or(Float320::ZERO, |s| {
            let terms = self.terms.iter();
            terms.fold(s.q[self.coordinate], |rest, (c, k)| {
                rest - Float320::from_number(k) * s.q[*c]
            })
        });
        let turns = self.turns(model);
        Fact::new(
            format!(
                "{coordinate} = {text}{} on this branch",
                constant_text(constant, turns)
            ),
            evidence,
        )
    }

    /// Whether all coordinates of the relation are angles.
    fn turns(&self, model: &Model) -> bool {
        let all = self.terms.iter().map(|(c, _)| *c).chain([self.coordinate]);
        all.into_iter().all(|c| !model.slides(c))
    }
}

fn factor_text(factor: &Number) -> String {
    let text = factor.to_string();
    if text.contains(' ') {
        format!("({text})")
    } else {
        text
    }
}

/// The text ` + constant`, as a fraction of pi if it is one.
fn constant_text(constant: Float320, turns: bool) -> String {
    if constant.is_zero() || constant.log10() < -60.0 {
        return String::new();
    }
    let sign = if constant.is_negative() { '-' } else { '+' };
    let size = constant.abs();
    let pi = Float320::from_number(&Number::pi());
    let of_pi = size.checked_div(pi).filter(|_| turns);
    let text = match of_pi.and_then(|x| recognise(&x)) {
        Some(part) if part.as_rational().is_some() => part.mul(&Number::pi()).to_string(),
        _ => match recognise(&size).filter(Number::is_exact) {
            Some(exact) if exact.to_string().len() <= 12 => exact.to_string(),
            _ => format!("const ({:.6})", constant.to_f64()),
        },
    };
    if text.starts_with("const") {
        return format!(" + {text}");
    }
    format!(" {sign} {text}")
}
