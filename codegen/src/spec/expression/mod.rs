//! Expressions: their syntax, their values, and linear forms.
//!
//! ```text
//! sum     = product (("+" | "-") product)*
//! product = sign (("*" | "/") sign)*
//! sign    = ("-" | "+") sign | power
//! power   = atom ("^" sign)?
//! atom    = number | name | "pi" | function "(" sum ")" | "(" sum ")"
//! ```
//! so that `-a^2 = -(a^2)` and `^` associates to the right.

mod effort;
mod evaluate;
mod lexer;
mod linear;
mod parser;
#[cfg(test)]
mod tests;

pub(super) use effort::{POSITION, RATE, effort_term};
pub(super) use evaluate::{evaluate, quantity};
pub(super) use lexer::INERTIAL;
pub(super) use linear::linear;
pub(super) use parser::parse;

use super::types::{Expr, Function};
use crate::diag::{Diagnostic, Span};
use crate::sym::Number;

/// Largest number of characters of an expression.
const MAX_LENGTH: usize = 10_000;
/// Largest depth of nested parentheses, calls, signs and powers.
const MAX_NESTING: usize = 100;
/// Largest height of the syntax tree, which long sums and products increase.
const MAX_HEIGHT: usize = 500;

/// The names that an expression may contain besides geometry names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vocabulary {
    /// No other names.
    Constants,
    /// Coordinates: `q2`, `s1.1`.
    Coordinates,
    /// Parameters: `Ixy(3)`, `Fc+(q2)`.
    Parameters,
    /// `q` and `qd` of the joint, and the functions of [`TERM_FUNCTIONS`].
    EffortTerms,
}

/// The syntax tree of an expression, with the place of each part.
#[derive(Clone, Debug)]
pub(crate) struct Ast {
    pub(crate) kind: AstKind,
    pub(crate) span: Span,
    height: usize,
}

/// The kinds of nodes of the syntax tree.
#[derive(Clone, Debug)]
pub(crate) enum AstKind {
    Number(Number),
    Pi,
    /// A geometry name, or a coordinate where these are allowed.
    Name(String),
    /// A name that can only be a coordinate (`s1.1`) or a parameter (`Ixy(3)`).
    Variable(String),
    Neg(Box<Ast>),
    Binary(Operator, Box<Ast>, Box<Ast>),
    Call(Function, Box<Ast>),
}

/// The binary operators.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operator {
    Add,
    Sub,
    Mul,
    Div,
    Pow,
}

/// An error in an expression: message, place and hint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Fault {
    pub(super) span: Span,
    pub(super) message: String,
    pub(super) hint: Option<String>,
}

impl Fault {
    fn new(span: Span, message: impl Into<String>) -> Self {
        Self {
            span,
            message: message.into(),
            hint: None,
        }
    }

    fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// The fault as an error in the file.
    pub(super) fn at(self, path: &str) -> Diagnostic {
        let diagnostic = Diagnostic::new(self.span, self.message).path(path);
        match self.hint {
            Some(hint) => diagnostic.hint(hint),
            None => diagnostic,
        }
    }
}

impl Ast {
    fn new(kind: AstKind, span: Span) -> Self {
        let height = match &kind {
            AstKind::Neg(a) | AstKind::Call(_, a) => 1 + a.height,
            AstKind::Binary(_, a, b) => 1 + a.height.max(b.height),
            _ => 0,
        };
        Self { kind, span, height }
    }

    /// A plain number.
    pub(super) fn number(value: Number, span: Span) -> Self {
        Self::new(AstKind::Number(value), span)
    }

    /// The expression without places.
    pub(super) fn to_expr(&self) -> Expr {
        let boxed = |ast: &Ast| Box::new(ast.to_expr());
        match &self.kind {
            AstKind::Number(value) => Expr::Number(value.clone()),
            AstKind::Pi => Expr::Pi,
            AstKind::Name(name) | AstKind::Variable(name) => Expr::Name(name.clone()),
            AstKind::Neg(a) => Expr::Neg(boxed(a)),
            AstKind::Binary(operator, a, b) => {
                let (a, b) = (boxed(a), boxed(b));
                match operator {
                    Operator::Add => Expr::Add(a, b),
                    Operator::Sub => Expr::Sub(a, b),
                    Operator::Mul => Expr::Mul(a, b),
                    Operator::Div => Expr::Div(a, b),
                    Operator::Pow => Expr::Pow(a, b),
                }
            }
            AstKind::Call(function, a) => Expr::Call(*function, boxed(a)),
        }
    }

    /// Calls `visit` with every name and variable, from left to right.
    pub(super) fn names<'a>(&'a self, visit: &mut impl FnMut(&'a Ast, &'a str)) {
        match &self.kind {
            AstKind::Number(_) | AstKind::Pi => {}
            AstKind::Name(name) | AstKind::Variable(name) => visit(self, name),
            AstKind::Neg(a) | AstKind::Call(_, a) => a.names(visit),
            AstKind::Binary(_, a, b) => {
                a.names(visit);
                b.names(visit);
            }
        }
    }
}

/// The functions with their names.
pub(super) const FUNCTIONS: [(&str, Function); 5] = [
    ("sqrt", Function::Sqrt),
    ("sin", Function::Sin),
    ("cos", Function::Cos),
    ("tan", Function::Tan),
    ("deg", Function::Deg),
];

/// The functions that only effort terms may call.
pub(super) const TERM_FUNCTIONS: [(&str, Function); 2] =
    [("sign", Function::Sign), ("abs", Function::Abs)];

impl Vocabulary {
    /// The functions that an expression may call, with their names.
    fn functions(self) -> impl Iterator<Item = &'static (&'static str, Function)> + Clone {
        let more: &[_] = match self {
            Vocabulary::EffortTerms => &TERM_FUNCTIONS,
            _ => &[],
        };
        FUNCTIONS.iter().chain(more)
    }
}

impl Function {
    /// The name of the function in expressions.
    pub(crate) fn name(self) -> &'static str {
        let mut all = FUNCTIONS.iter().chain(&TERM_FUNCTIONS);
        all.find(|(_, function)| *function == self)
            .map_or("", |(name, _)| name)
    }
}

/// Whether a name has another meaning in expressions.
pub(super) fn is_reserved(name: &str) -> bool {
    name == "pi" || FUNCTIONS.iter().any(|(function, _)| *function == name)
}
