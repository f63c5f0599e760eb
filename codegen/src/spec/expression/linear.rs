//! Reads expressions as linear forms: a constant plus constant multiples of variables.

use super::{Ast, AstKind, Fault, Operator, evaluate};
use crate::diag::Span;
use crate::spec::types::{LinearForm, Quantity, Spanned};
use crate::sym::Number;

/// Reads an expression as a linear form in the names for which `is_variable` is true; other names
/// are constants.
pub(in crate::spec) fn linear(
    ast: &Ast,
    is_variable: &impl Fn(&str) -> bool,
    lookup: &impl Fn(&str) -> Option<Number>,
) -> Result<LinearForm, Fault> {
    let form = expand(ast, is_variable)?;
    if form.terms.len() > super::MAX_HEIGHT {
        let message = format!("the expression has more than {} terms", super::MAX_HEIGHT);
        return Err(Fault::new(ast.span, message));
    }
    let mut terms: Vec<(Spanned<String>, Quantity)> = Vec::new();
    for term in form.terms {
        let value = evaluate(&term.factor, lookup)?;
        let (expr, span) = (term.factor.to_expr(), term.span);
        // a name that occurs twice has one coefficient, the sum
        match terms.iter_mut().find(|(name, _)| name.value == term.name) {
            Some((_, known)) => {
                known.expr =
                    crate::spec::types::Expr::Add(Box::new(known.expr.clone()), Box::new(expr));
                known.value = known.value.add(&value);
            }
            None => terms.push((
                Spanned {
                    value: term.name,
                    span,
                },
                Quantity {
                    expr,
                    value,
                    span: ast.span,
                },
            )),
        }
    }
    // drop terms that cancel
    terms.retain(|(_, factor)| !factor.value.is_zero());
    let constant = form
        .constant
        .unwrap_or_else(|| Ast::number(Number::zero(), ast.span));
    Ok(LinearForm {
        constant: super::quantity(&constant, lookup)?,
        terms,
        span: ast.span,
    })
}

struct Term {
    name: String,
    span: Span,
    factor: Ast,
}

/// A linear form whose coefficients are still expressions.
#[derive(Default)]
struct Form {
    constant: Option<Ast>,
    terms: Vec<Term>,
}

impl Form {
    fn constant(ast: &Ast) -> Self {
        Self {
            constant: Some(ast.clone()),
            terms: Vec::new(),
        }
    }

    fn map(self, change: impl Fn(Ast) -> Ast) -> Self {
        Self {
            constant: self.constant.map(&change),
            terms: self
                .terms
                .into_iter()
                .map(|term| Term {
                    factor: change(term.factor),
                    ..term
                })
                .collect(),
        }
    }
}

fn mentions(ast: &Ast, is_variable: &impl Fn(&str) -> bool) -> bool {
    let mut found = false;
    ast.names(&mut |_, name| found |= is_variable(name));
    found
}

fn negated(ast: Ast) -> Ast {
    let span = ast.span;
    match ast.kind {
        AstKind::Number(value) => Ast::number(value.neg(), span),
        AstKind::Neg(inner) => *inner,
        kind => Ast::new(AstKind::Neg(Box::new(Ast::new(kind, span))), span),
    }
}

fn binary(operator: Operator, a: Ast, b: Ast, span: Span) -> Ast {
    Ast::new(AstKind::Binary(operator, Box::new(a), Box::new(b)), span)
}

fn is_one(ast: &Ast) -> bool {
    matches!(&ast.kind, AstKind::Number(value) if value.is_one())
}

fn expand(ast: &Ast, is_variable: &impl Fn(&str) -> bool) -> Result<Form, Fault> {
    if !mentions(ast, is_variable) {
        return Ok(Form::constant(ast));
    }
    let nonlinear = |message: &str| {
        Fault::new(ast.span, message.to_owned())
            .hint("the expression must be a constant plus constant multiples of names")
    };
    match &ast.kind {
        AstKind::Name(name) | AstKind::Variable(name) => Ok(Form {
            constant: None,
            terms: vec![Term {
                name: name.clone(),
                span: ast.span,
                factor: Ast::number(Number::one(), ast.span),
            }],
        }),
        AstKind::Neg(a) => Ok(expand(a, is_variable)?.map(negated)),
        AstKind::Binary(operator @ (Operator::Add | Operator::Sub), a, b) => {
            let left = expand(a, is_variable)?;
            let right = expand(b, is_variable)?;
            let right = if *operator == Operator::Sub {
                right.map(negated)
            } else {
                right
            };
            let constant = match (left.constant, right.constant) {
                (Some(x), Some(y)) => Some(binary(Operator::Add, x, y, ast.span)),
                (x, y) => x.or(y),
            };
            let mut terms = left.terms;
            terms.extend(right.terms);
            Ok(Form { constant, terms })
        }
        AstKind::Binary(Operator::Mul, a, b) => {
            let (factor, form) = match (mentions(a, is_variable), mentions(b, is_variable)) {
                (true, true) => {
                    return Err(nonlinear("a product of two variable terms is not linear"));
                }
                (true, false) => (b, expand(a, is_variable)?),
                _ => (a, expand(b, is_variable)?),
            };
            Ok(form.map(|x| {
                if is_one(&x) {
                    (**factor).clone()
                } else {
                    let span = x.span;
                    binary(Operator::Mul, (**factor).clone(), x, span)
                }
            }))
        }
        AstKind::Binary(Operator::Div, a, b) => {
            if mentions(b, is_variable) {
                return Err(nonlinear("a variable in a denominator is not linear"));
            }
            let form = expand(a, is_variable)?;
            Ok(form.map(|x| {
                let span = x.span;
                binary(Operator::Div, x, (**b).clone(), span)
            }))
        }
        AstKind::Binary(Operator::Pow, ..) => Err(nonlinear("a power of a variable is not linear")),
        AstKind::Call(..) => Err(nonlinear("a function of a variable is not linear")),
        AstKind::Number(_) | AstKind::Pi => Ok(Form::constant(ast)),
    }
}
