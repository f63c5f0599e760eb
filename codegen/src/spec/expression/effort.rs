//! Reads expressions as factors of effort terms: functions of a joint's own `q` and `qd`.

use super::{Ast, AstKind, Fault, Operator, evaluate, quantity};
use crate::spec::types::{EffortExpr, Expr, Function, Quantity};
use crate::sym::Number;

/// The name of the joint's coordinate.
pub(in crate::spec) const POSITION: &str = "q";
/// The name of the coordinate's rate.
pub(in crate::spec) const RATE: &str = "qd";

/// Reads an expression in `q`, `qd` and constants; `lookup` gives the values of the other names.
pub(in crate::spec) fn effort_term(
    ast: &Ast,
    lookup: &impl Fn(&str) -> Option<Number>,
) -> Result<EffortExpr, Fault> {
    if !is_variable(ast) {
        return Ok(EffortExpr::Constant(quantity(ast, lookup)?));
    }
    let boxed = |a: &Ast| effort_term(a, lookup).map(Box::new);
    Ok(match &ast.kind {
        AstKind::Name(name) | AstKind::Variable(name) if name == RATE => EffortExpr::Qd,
        AstKind::Number(_) | AstKind::Pi | AstKind::Name(_) | AstKind::Variable(_) => EffortExpr::Q,
        AstKind::Neg(a) => EffortExpr::Neg(boxed(a)?),
        AstKind::Binary(Operator::Add, a, b) => EffortExpr::Add(boxed(a)?, boxed(b)?),
        AstKind::Binary(Operator::Sub, a, b) => EffortExpr::Sub(boxed(a)?, boxed(b)?),
        AstKind::Binary(Operator::Mul, a, b) => EffortExpr::Mul(boxed(a)?, boxed(b)?),
        AstKind::Binary(Operator::Div, a, b) => {
            let divisor = effort_term(b, lookup)?;
            if matches!(&divisor, EffortExpr::Constant(constant) if constant.value.is_zero()) {
                return Err(Fault::new(b.span, "division by zero"));
            }
            EffortExpr::Div(boxed(a)?, Box::new(divisor))
        }
        AstKind::Binary(Operator::Pow, a, b) => power(a, b, lookup)?,
        AstKind::Call(Function::Tan, a) => {
            // effort expressions have no tangent, so it becomes a quotient
            let part = |function| Ok(Box::new(EffortExpr::Call(function, boxed(a)?)));
            EffortExpr::Div(part(Function::Sin)?, part(Function::Cos)?)
        }
        AstKind::Call(Function::Deg, a) => {
            let whole = |value| number(Number::from_i64(value), ast);
            let turned = EffortExpr::Mul(boxed(a)?, Box::new(pi(ast)));
            EffortExpr::Div(Box::new(turned), Box::new(whole(180)))
        }
        AstKind::Call(function, a) => EffortExpr::Call(*function, boxed(a)?),
    })
}

/// A power of an expression that contains `q` or `qd`. The exponent is a whole number (a negative
/// one gives a quotient) or 1/2.
fn power(
    base: &Ast,
    exponent: &Ast,
    lookup: &impl Fn(&str) -> Option<Number>,
) -> Result<EffortExpr, Fault> {
    let refuse = |message: &str| Fault::new(exponent.span, message.to_owned());
    if is_variable(exponent) {
        return Err(refuse("the exponent must be constant"));
    }
    let value = evaluate(exponent, lookup)?;
    let inner = Box::new(effort_term(base, lookup)?);
    if Number::ratio(1, 2).as_ref() == Some(&value) {
        return Ok(EffortExpr::Call(Function::Sqrt, inner));
    }
    let Some(whole) = value.as_i64() else {
        return Err(refuse("the exponent must be a whole number or 1/2")
            .hint("roots are written 'sqrt(x)'"));
    };
    let count = u32::try_from(whole.unsigned_abs()).ok();
    let count = count.filter(|count| *count <= EffortExpr::MAX_EXPONENT);
    let Some(count) = count else {
        let message = format!("the exponent must be at most {}", EffortExpr::MAX_EXPONENT);
        return Err(refuse(&message));
    };
    if count == 0 {
        return Ok(number(Number::one(), exponent));
    }
    let product = EffortExpr::Pow(inner, count);
    Ok(if whole < 0 {
        EffortExpr::Div(Box::new(number(Number::one(), exponent)), Box::new(product))
    } else {
        product
    })
}

/// A constant with the place of `ast`, which it replaces.
fn number(value: Number, ast: &Ast) -> EffortExpr {
    EffortExpr::Constant(Quantity {
        expr: Expr::Number(value.clone()),
        value,
        span: ast.span,
    })
}

/// The constant pi at the place of `ast`.
fn pi(ast: &Ast) -> EffortExpr {
    EffortExpr::Constant(Quantity {
        expr: Expr::Pi,
        value: Number::pi(),
        span: ast.span,
    })
}

/// Whether the expression contains `q` or `qd`.
fn is_variable(ast: &Ast) -> bool {
    let mut found = false;
    ast.names(&mut |_, name| found |= name == POSITION || name == RATE);
    found
}
