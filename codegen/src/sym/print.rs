//! Expressions as text, for snapshots that a person can check.

use std::fmt::Write as _;

use super::angle::Angle;
use super::graph::{Ex, Graph, Node};

/// The precedence of an expression's outermost operator.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Sum,
    Product,
    Quotient,
    Power,
    Atom,
}

/// The whole expression as text, without abbreviations.
///
/// Sums and products are written flat, with the factors in the order numbers, symbols, functions,
/// sums: the text has the expression's value, but not its order of operations.
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
        Node::Neg(_) | Node::Add(..) | Node::Sub(..) => (sum(graph, ex), Level::Sum),
        Node::Mul(..) => product(graph, ex),
        Node::Div(a, b) => (
            format!(
                "{}/{}",
                wrap(sub(a), Level::Product),
                wrap(sub(b), Level::Power)
            ),
            Level::Quotient,
        ),
        Node::Sin(id) => (
            format!("sin({})", angle_text(graph, graph.angle(id))),
            Level::Atom,
        ),
        Node::Cos(id) => (
            format!("cos({})", angle_text(graph, graph.angle(id))),
            Level::Atom,
        ),
        Node::SinOf(a) => (format!("sin({})", sub(a).0), Level::Atom),
        Node::CosOf(a) => (format!("cos({})", sub(a).0), Level::Atom),
        Node::Sign(a) => (format!("sgn({})", sub(a).0), Level::Atom),
        Node::Sqrt(a) => (format!("sqrt({})", sub(a).0), Level::Atom),
        Node::Positive(a) => (format!("[{} > 0]", sub(a).0), Level::Atom),
        Node::Negative(a) => (format!("[{} < 0]", sub(a).0), Level::Atom),
        Node::Solved(system, row, column) => {
            let name = format!("Z{}[{row},{column}]", system.index());
            (name, Level::Atom)
        }
    }
}

/// The terms of a sum with their signs, starting with a positive term if there is one.
fn sum(graph: &Graph, ex: Ex) -> String {
    let mut terms = Vec::new();
    let mut stack = vec![(ex, false)];
    while let Some((ex, negative)) = stack.pop() {
        match graph.node(ex) {
            Node::Neg(a) => stack.push((a, !negative)),
            // pushed last, so that the left operand is handled first
            Node::Add(a, b) => stack.extend([(b, negative), (a, negative)]),
            Node::Sub(a, b) => stack.extend([(b, !negative), (a, negative)]),
            _ => terms.push((ex, negative)),
        }
    }
    if let Some(first) = terms.iter().position(|(_, negative)| !negative) {
        let first = terms.remove(first);
        terms.insert(0, first);
    }
    let mut out = String::new();
    for (ex, negative) in terms {
        out.push_str(sign(out.is_empty(), negative));
        out.push_str(&wrap(render(graph, ex), Level::Product));
    }
    out
}

/// The sign before a term of a sum.
pub(crate) fn sign(is_first: bool, is_negative: bool) -> &'static str {
    match (is_first, is_negative) {
        (true, true) => "-",
        (true, false) => "",
        (false, true) => " - ",
        (false, false) => " + ",
    }
}

/// The factors of a product, with repeated ones as powers.
fn product(graph: &Graph, ex: Ex) -> (String, Level) {
    let mut factors: Vec<(Ex, usize)> = Vec::new();
    let mut stack = vec![ex];
    while let Some(ex) = stack.pop() {
        match graph.node(ex) {
            Node::Mul(a, b) => stack.extend([b, a]),
            _ => match factors.iter_mut().find(|(factor, _)| *factor == ex) {
                Some((_, power)) => *power += 1,
                None => factors.push((ex, 1)),
            },
        }
    }
    factors.sort_by_key(|(factor, _)| match graph.node(*factor) {
        Node::Constant(_) => 0,
        Node::Symbol(_) => 1,
        Node::Neg(_) | Node::Add(..) | Node::Sub(..) => 3,
        _ => 2,
    });
    let level = match factors.as_slice() {
        [(_, 2..)] => Level::Power,
        _ => Level::Product,
    };
    let mut texts = Vec::new();
    for (factor, power) in factors {
        let inner = render(graph, factor);
        texts.push(match power {
            // only the first factor may be a quotient without parentheses
            1 if texts.is_empty() => wrap(inner, Level::Product),
            1 => wrap(inner, Level::Power),
            _ => format!("{}^{power}", wrap(inner, Level::Atom)),
        });
    }
    (texts.join("*"), level)
}

/// A linear form as text: `a + b`, `2*a - pi/3`.
pub fn angle_text(graph: &Graph, angle: &Angle) -> String {
    let mut out = String::new();
    for (symbol, coefficient) in &angle.terms {
        let negative = coefficient.is_negative();
        let size = coefficient.abs();
        out.push_str(sign(out.is_empty(), negative));
        if !size.is_one() {
            let _ = write!(out, "{size}*");
        }
        out.push_str(graph.symbol_name(*symbol));
    }
    if !angle.constant.is_zero() || out.is_empty() {
        let negative = angle.constant.is_negative();
        out.push_str(sign(out.is_empty(), negative));
        let _ = write!(out, "{}", angle.constant.abs());
    }
    out
}
