//! Expressions as text, for snapshots that a person can check.

use std::fmt::Write as _;

use super::angle::Angle;
use super::graph::{Ex, Graph, Node};

/// How tightly an expression's outermost operator binds.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Sum,
    Negative,
    Product,
    Atom,
}

/// The whole expression, nothing abbreviated.
pub fn text(graph: &Graph, ex: Ex) -> String {
    render(graph, ex).0
}

fn wrap(inner: (String, Level), least: Level) -> String {
    if inner.1 < least {
        format!("({})", inner.0)
    } else {
        inner.0
    }
}

fn render(graph: &Graph, ex: Ex) -> (String, Level) {
    let sub = |e: Ex| render(graph, e);
    match graph.node(ex) {
        Node::Constant(id) => {
            let number = graph.number(id).to_string();
            let level = if number.contains(' ') {
                Level::Sum
            } else if number.contains(['*', '/']) {
                Level::Product
            } else {
                Level::Atom
            };
            (number, level)
        }
        Node::Symbol(id) => (graph.symbol_name(id).to_owned(), Level::Atom),
        Node::Neg(a) => (
            format!("-{}", wrap(sub(a), Level::Product)),
            Level::Negative,
        ),
        Node::Add(a, b) => (
            format!(
                "{} + {}",
                wrap(sub(a), Level::Sum),
                wrap(sub(b), Level::Negative)
            ),
            Level::Sum,
        ),
        Node::Sub(a, b) => (
            format!(
                "{} - {}",
                wrap(sub(a), Level::Sum),
                wrap(sub(b), Level::Product)
            ),
            Level::Sum,
        ),
        Node::Mul(a, b) => {
            let right = match graph.node(b) {
                // a constant in front of a product needs no parentheses
                Node::Mul(..) if matches!(graph.node(a), Node::Constant(_)) => sub(b).0,
                Node::Mul(..) => format!("({})", sub(b).0),
                _ => wrap(sub(b), Level::Product),
            };
            (
                format!("{}*{}", wrap(sub(a), Level::Product), right),
                Level::Product,
            )
        }
        Node::Div(a, b) => (
            format!(
                "{}/{}",
                wrap(sub(a), Level::Product),
                wrap(sub(b), Level::Atom)
            ),
            Level::Product,
        ),
        Node::Sin(id) => (
            format!("sin({})", angle_text(graph, graph.angle(id))),
            Level::Atom,
        ),
        Node::Cos(id) => (
            format!("cos({})", angle_text(graph, graph.angle(id))),
            Level::Atom,
        ),
        Node::Sign(a) => (format!("sgn({})", sub(a).0), Level::Atom),
        Node::Positive(a) => (format!("[{} > 0]", sub(a).0), Level::Atom),
        Node::Negative(a) => (format!("[{} < 0]", sub(a).0), Level::Atom),
        Node::Solved(system, row, column) => {
            let name = format!("Z{}[{row},{column}]", system.index());
            (name, Level::Atom)
        }
    }
}

/// A linear form as text: `a + b`, `2*a - pi/3`.
pub fn angle_text(graph: &Graph, angle: &Angle) -> String {
    let mut out = String::new();
    for (symbol, coefficient) in &angle.terms {
        let negative = coefficient.is_negative();
        let size = coefficient.abs();
        out.push_str(match (out.is_empty(), negative) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        });
        if !size.is_one() {
            let _ = write!(out, "{size}*");
        }
        out.push_str(graph.symbol_name(*symbol));
    }
    if !angle.constant.is_zero() || out.is_empty() {
        let negative = angle.constant.is_negative();
        out.push_str(match (out.is_empty(), negative) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        });
        let _ = write!(out, "{}", angle.constant.abs());
    }
    out
}
