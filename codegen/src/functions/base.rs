//! Functions of base parameters. Forces depend on all parameters only through the base combinations,
//! so that any parameters with these combinations give the same forces. Here the kept parameters
//! have the values of the base parameters, and the eliminated ones are zero.

use crate::base::{Base, Term};
use crate::sym::{Ex, Graph, SymbolId};

use super::dynamics::{self, Motion};
use super::{Context, Groups, Symbols, group};

/// The symbols of base or eliminated parameters, added to the graph if it does not have them yet.
fn symbols(cx: &mut Context<'_>, prefix: &str, columns: &[usize]) -> Vec<SymbolId> {
    let labels = labels(cx, columns.iter().copied());
    let ids = labels
        .iter()
        .map(|l| cx.g.symbol_id(&format!("{prefix}{l}")));
    ids.collect()
}

fn labels(cx: &Context<'_>, columns: impl Iterator<Item = usize>) -> Vec<String> {
    columns
        .map(|c| cx.model.parameters[c].label.clone())
        .collect()
}

/// The columns of the kept parameters, without those that are dropped.
fn kept_columns(base: &Base) -> impl Iterator<Item = usize> + '_ {
    base.parameters
        .iter()
        .filter(|p| !p.dropped)
        .map(|p| p.column)
}

/// The symbols of the base parameters.
pub(super) fn beta(cx: &mut Context<'_>, base: &Base) -> Vec<SymbolId> {
    let columns: Vec<usize> = kept_columns(base).collect();
    symbols(cx, "base:", &columns)
}

/// The symbols of the eliminated parameters.
pub(super) fn free(cx: &mut Context<'_>, base: &Base) -> Vec<SymbolId> {
    let columns: Vec<usize> = base.null.iter().map(|n| n.column).collect();
    symbols(cx, "free:", &columns)
}

fn beta_nodes(cx: &mut Context<'_>, base: &Base) -> Vec<Ex> {
    let ids = beta(cx, base);
    Symbols::nodes(cx.g, &ids)
}

fn combination(g: &mut Graph, terms: &[Term], phi: &[Ex]) -> Ex {
    let mut sum = Ex::ZERO;
    for term in terms {
        let factor = g.constant(term.value.clone());
        let product = g.mul(factor, phi[term.column]);
        sum = g.add(sum, product);
    }
    sum
}

/// Parameters that have the given base parameters: the eliminated ones are zero.
fn particular_solution(cx: &mut Context<'_>, base: &Base, beta: &[Ex]) -> Vec<Ex> {
    let mut phi = vec![Ex::ZERO; cx.model.parameters.len()];
    for (column, value) in kept_columns(base).zip(beta) {
        phi[column] = *value;
    }
    for known in &base.known {
        phi[known.column] = combination(cx.g, &known.terms, &phi);
    }
    phi
}

/// The reduced regressor: the columns of W at the kept parameters. The column of a parameter that
/// is a known combination of others is added to theirs.
pub(super) fn base_regressor(cx: &mut Context<'_>, base: &Base) -> Groups {
    let mut wanted = vec![false; cx.model.parameters.len()];
    let known = base.known.iter().map(|known| known.column);
    for column in kept_columns(base).chain(known) {
        wanted[column] = true;
    }
    let columns = dynamics::regressor_columns(cx, &wanted);
    let mut groups: Groups = Vec::new();
    for column in kept_columns(base) {
        let mut entries = columns[column].clone();
        for known in &base.known {
            for term in known.terms.iter().filter(|t| t.column == column) {
                let factor = cx.g.constant(term.value.clone());
                for (entry, other) in entries.iter_mut().zip(&columns[known.column]) {
                    let product = cx.g.mul(factor, *other);
                    *entry = cx.g.add(*entry, product);
                }
            }
        }
        let title = match column / 10 {
            body if body < cx.model.bodies.len() => format!("body {}", cx.model.bodies[body].label),
            _ => dynamics::remaining_columns(cx.model).to_owned(),
        };
        match groups.last_mut() {
            Some((last, values)) if *last == title => values.extend(entries),
            _ => groups.push(group(title, entries)),
        }
    }
    groups
}

pub(super) fn to_base(cx: &mut Context<'_>, base: &Base) -> Groups {
    let phi = cx.symbols.phi_nodes(cx.g);
    let values = base
        .parameters
        .iter()
        .filter(|p| !p.dropped)
        .map(|p| combination(cx.g, &p.terms, &phi))
        .collect();
    vec![group("combinations", values)]
}

/// All parameters that have given base parameters: the eliminated ones take the values of `free`.
pub(super) fn parameters_from_base(cx: &mut Context<'_>, base: &Base) -> Groups {
    let beta = beta_nodes(cx, base);
    let free = free(cx, base);
    let free = Symbols::nodes(cx.g, &free);
    let mut phi = particular_solution(cx, base, &beta);
    for (eliminated, value) in base.null.iter().zip(&free) {
        phi[eliminated.column] = *value;
    }
    for parameter in &base.parameters {
        // along the null space the kept parameter compensates the eliminated ones
        let others = combination(cx.g, &parameter.terms[1..], &phi);
        let column = parameter.column;
        phi[column] = cx.g.sub(phi[column], others);
    }
    for known in &base.known {
        phi[known.column] = combination(cx.g, &known.terms, &phi);
    }
    vec![group("phi", phi)]
}

/// The forces of a motion, computed from base parameters.
pub(super) fn forces(cx: &mut Context<'_>, base: &Base, motion: Motion) -> Groups {
    let beta = beta_nodes(cx, base);
    let phi = particular_solution(cx, base, &beta);
    dynamics::forces(cx, motion, &phi)
}

/// The mass matrix, computed from base parameters.
pub(super) fn mass_matrix(cx: &mut Context<'_>, base: &Base) -> Groups {
    let beta = beta_nodes(cx, base);
    let phi = particular_solution(cx, base, &beta);
    dynamics::mass_matrix_of(cx, &phi)
}
