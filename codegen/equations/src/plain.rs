//! Writes expressions on one line, as in programming languages.

use crate::constants::{Form, form};
use crate::graph::{Graph, Id, Node};
use crate::names::{Name, Names};

/// The precedence of the outermost operation of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    Sum,
    Product,
    Power,
    Atom,
}

/// The parts of the notation that differ between languages.
pub(crate) trait Spelling {
    /// A number that is not negative.
    fn number(&self, value: f64) -> String;
    /// An element of an argument.
    fn input(&self, argument: usize, element: usize) -> String;
    /// A named term.
    fn name(&self, name: &Name) -> String;
    /// A number that is expressed by a fraction or a root.
    fn form(&self, form: &Form) -> (String, Level);
    /// A function: `sin`, `cos`, `sqrt`, `sign`, `positive` or `negative`.
    fn call(&self, function: &str, operand: &str) -> String;
    /// A product.
    fn product(&self, a: &str, b: &str) -> String;
    /// A quotient; both operands come with their precedence.
    fn quotient(&self, above: (String, Level), below: (String, Level)) -> (String, Level);
    /// A square.
    fn square(&self, operand: &str) -> String;
    /// An expression in parentheses.
    fn group(&self, inner: &str) -> String;
}

/// Writes the expressions of a graph, with the names that its nodes have.
pub(crate) struct Writer<'w, S> {
    pub(crate) graph: &'w Graph,
    pub(crate) names: &'w Names,
    pub(crate) spelling: S,
}

impl<S: Spelling> Writer<'_, S> {
    /// An operand: its name if it has one.
    pub(crate) fn operand(&self, id: Id) -> (String, Level) {
        match self.names.of(id) {
            Some(name) => (self.spelling.name(name), Level::Atom),
            None => self.expression(id),
        }
    }

    /// An operand that binds at least as strongly as `level`.
    fn at(&self, id: Id, level: Level) -> String {
        self.grouped(self.operand(id), level)
    }

    fn grouped(&self, (text, own): (String, Level), level: Level) -> String {
        if own < level {
            self.spelling.group(&text)
        } else {
            text
        }
    }

    /// The expression that computes a node, even if the node has a name.
    pub(crate) fn expression(&self, id: Id) -> (String, Level) {
        let spelling = &self.spelling;
        let call = |function: &str, a: Id| {
            let text = spelling.call(function, &self.operand(a).0);
            (text, Level::Atom)
        };
        match self.graph.node(id) {
            Node::Number(bits) => {
                let value = f64::from_bits(bits);
                match form(value) {
                    Some(form) => spelling.form(&form),
                    None => (spelling.number(value), Level::Atom),
                }
            }
            Node::Input { argument, element } => (spelling.input(argument, element), Level::Atom),
            Node::Neg(a) => (format!("-{}", self.at(a, Level::Product)), Level::Sum),
            Node::Add(a, b) => {
                let (a, b) = (self.operand(a).0, self.operand(b).0);
                (format!("{a} + {b}"), Level::Sum)
            }
            Node::Sub(a, b) => {
                let (a, b) = (self.operand(a).0, self.at(b, Level::Product));
                (format!("{a} - {b}"), Level::Sum)
            }
            Node::Mul(a, b) if a == b => (spelling.square(&self.at(a, Level::Atom)), Level::Power),
            Node::Mul(a, b) => {
                let (a, b) = (self.at(a, Level::Product), self.at(b, Level::Product));
                (spelling.product(&a, &b), Level::Product)
            }
            Node::Div(a, b) => spelling.quotient(self.operand(a), self.operand(b)),
            Node::Sin(a) => call("sin", a),
            Node::Cos(a) => call("cos", a),
            Node::Sqrt(a) => call("sqrt", a),
            Node::Sign(a) => call("sign", a),
            Node::Positive(a) => call("positive", a),
            Node::Negative(a) => call("negative", a),
        }
    }
}

/// A number with as many digits as are needed to read the same double back.
pub(crate) fn digits(value: f64) -> String {
    if value.fract() == 0.0 && value < 1e15 {
        format!("{value:.0}")
    } else {
        format!("{value:?}")
    }
}
