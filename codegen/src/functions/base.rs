//! Functions over base parameters. Forces do not see the eliminated parameters
//! but through the combinations, so any parameters with the right combinations
//! give the right forces: the kept ones at the base parameters' values, the
//! eliminated ones at zero.

use crate::base::{Base, Term};
use crate::optimize::{Argument, Request};
use crate::sym::{Ex, Graph, SymbolId};

use super::dynamics::{self, Motion};
use super::{Context, group, output};

fn symbols(g: &mut Graph, prefix: &str, labels: &[String]) -> (Vec<SymbolId>, Vec<Ex>) {
    let names: Vec<String> = labels.iter().map(|l| format!("{prefix}{l}")).collect();
    let ids = names.iter().map(|n| g.symbol_id(n)).collect();
    (ids, names.iter().map(|n| g.symbol(n)).collect())
}

fn labels(cx: &Context<'_>, columns: impl Iterator<Item = usize>) -> Vec<String> {
    columns
        .map(|c| cx.model.parameters[c].label.clone())
        .collect()
}

/// Columns of the base parameters that are not dropped.
fn kept(base: &Base) -> impl Iterator<Item = usize> + '_ {
    base.parameters
        .iter()
        .filter(|p| !p.dropped)
        .map(|p| p.column)
}

fn argument(name: &str, doc: &str, ids: Vec<SymbolId>) -> (Argument, Vec<SymbolId>) {
    let argument = Argument {
        name: name.to_owned(),
        len: ids.len(),
        doc: doc.to_owned(),
    };
    (argument, ids)
}

fn beta(cx: &mut Context<'_>, base: &Base) -> ((Argument, Vec<SymbolId>), Vec<Ex>) {
    let labels = labels(cx, kept(base));
    let (ids, nodes) = symbols(cx.g, "base:", &labels);
    (
        argument("beta", "base parameters, SI, in the order of `BASE`", ids),
        nodes,
    )
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

/// Parameters with these base parameters: eliminated ones are zero.
fn particular(cx: &mut Context<'_>, base: &Base, beta: &[Ex]) -> Vec<Ex> {
    let mut phi = vec![Ex::ZERO; cx.model.parameters.len()];
    for (column, value) in kept(base).zip(beta) {
        phi[column] = *value;
    }
    for known in &base.known {
        phi[known.column] = combination(cx.g, &known.terms, &phi);
    }
    phi
}

/// W at the kept columns; known parameters add theirs to those they are
/// written with.
pub(super) fn base_regressor(cx: &mut Context<'_>, base: &Base) -> Request {
    let mut wanted = vec![false; cx.model.parameters.len()];
    let known = base.known.iter().map(|known| known.column);
    for column in kept(base).chain(known) {
        wanted[column] = true;
    }
    let columns = dynamics::regressor_columns(cx, &wanted);
    let mut groups: Vec<(String, Vec<Ex>)> = Vec::new();
    for column in kept(base) {
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
            _ => "friction and rotors (Eq. 14-19)".to_owned(),
        };
        match groups.last_mut() {
            Some((last, values)) if *last == title => values.extend(entries),
            _ => groups.push(group(title, entries)),
        }
    }
    let shape = [base.rank(), cx.model.independent.len()];
    Request {
        arguments: vec![cx.symbols.q(), cx.symbols.qd(), cx.symbols.qdd()],
        output: output(
            "w",
            &shape,
            "W_red (Eq. 23), column by column: `w[c][r]` multiplies `BASE[c]` in the equation of `INDEPENDENT[r]`",
        ),
        groups,
    }
}

pub(super) fn to_base(cx: &mut Context<'_>, base: &Base) -> Request {
    let phi = cx.symbols.phi_nodes(cx.g);
    let values = base
        .parameters
        .iter()
        .filter(|p| !p.dropped)
        .map(|p| combination(cx.g, &p.terms, &phi))
        .collect();
    Request {
        arguments: vec![cx.symbols.phi()],
        output: output(
            "beta",
            &[base.rank()],
            "base parameters, in the order of `BASE`",
        ),
        groups: vec![group("combinations", values)],
    }
}

/// Every set of parameters with these base parameters: `free` are the values of
/// the eliminated ones.
pub(super) fn parameters_from_base(cx: &mut Context<'_>, base: &Base) -> Request {
    let (beta_argument, beta) = beta(cx, base);
    let eliminated: Vec<usize> = base.null.iter().map(|n| n.column).collect();
    let names = labels(cx, eliminated.iter().copied());
    let (ids, free) = symbols(cx.g, "free:", &names);
    let mut phi = particular(cx, base, &beta);
    for (column, value) in eliminated.iter().zip(&free) {
        phi[*column] = *value;
    }
    for parameter in &base.parameters {
        // along the null space the kept parameter makes up for the eliminated
        let others = combination(cx.g, &parameter.terms[1..], &phi);
        let column = parameter.column;
        phi[column] = cx.g.sub(phi[column], others);
    }
    for known in &base.known {
        phi[known.column] = combination(cx.g, &known.terms, &phi);
    }
    let free = argument(
        "free",
        "values of the eliminated parameters, in the order of `FREE`",
        ids,
    );
    Request {
        arguments: vec![beta_argument, free],
        output: output(
            "phi",
            &[phi.len()],
            "dynamic parameters, in the order of `PARAMETERS`",
        ),
        groups: vec![group("phi", phi)],
    }
}

/// Forces of a motion from base parameters.
pub(super) fn forces(cx: &mut Context<'_>, base: &Base, motion: Motion) -> Request {
    let (argument, beta) = beta(cx, base);
    let phi = particular(cx, base, &beta);
    let mut request = dynamics::forces(cx, motion, &phi);
    request.arguments.pop();
    request.arguments.push(argument);
    request
}

/// The mass matrix from base parameters.
pub(super) fn mass_matrix(cx: &mut Context<'_>, base: &Base) -> Request {
    let (argument, beta) = beta(cx, base);
    let phi = particular(cx, base, &beta);
    let mut request = dynamics::mass_matrix_of(cx, &phi);
    request.arguments.pop();
    request.arguments.push(argument);
    request
}
