//! Evaluates expressions exactly.

use super::{Ast, AstKind, Fault, Operator};
use crate::spec::types::{Function, Quantity};
use crate::sym::Number;

/// The value of an expression; `lookup` gives the values of names.
pub(in crate::spec) fn evaluate(
    ast: &Ast,
    lookup: &impl Fn(&str) -> Option<Number>,
) -> Result<Number, Fault> {
    let value = match &ast.kind {
        AstKind::Number(value) => value.clone(),
        AstKind::Pi => Number::pi(),
        AstKind::Name(name) | AstKind::Variable(name) => match lookup(name) {
            Some(value) => value,
            None => {
                return Err(Fault::new(
                    ast.span,
                    format!("'{name}' has no constant value"),
                ));
            }
        },
        AstKind::Neg(a) => evaluate(a, lookup)?.neg(),
        AstKind::Binary(operator, a, b) => {
            let (x, y) = (evaluate(a, lookup)?, evaluate(b, lookup)?);
            match operator {
                Operator::Add => x.add(&y),
                Operator::Sub => x.sub(&y),
                Operator::Mul => x.mul(&y),
                Operator::Div => x
                    .div(&y)
                    .ok_or_else(|| Fault::new(b.span, "division by zero"))?,
                Operator::Pow => power(ast, b, &x, &y)?,
            }
        }
        AstKind::Call(function, a) => {
            let x = evaluate(a, lookup)?;
            call(*function, &x, ast, a)?
        }
    };
    // check every step, so that no intermediate value grows without bound
    if !value.is_finite_f64() {
        return Err(Fault::new(ast.span, "the value is too large")
            .hint("every value must be finite as a double"));
    }
    if value.to_f64() == 0.0 && !value.is_zero() {
        return Err(
            Fault::new(ast.span, "the value is too small").hint("as a double it would be zero")
        );
    }
    Ok(value)
}

/// The value together with the expression.
pub(in crate::spec) fn quantity(
    ast: &Ast,
    lookup: &impl Fn(&str) -> Option<Number>,
) -> Result<Quantity, Fault> {
    Ok(Quantity {
        expr: ast.to_expr(),
        value: evaluate(ast, lookup)?,
        span: ast.span,
    })
}

fn power(ast: &Ast, at: &Ast, base: &Number, exponent: &Number) -> Result<Number, Fault> {
    let half = Number::ratio(1, 2);
    if half.as_ref() == Some(exponent) {
        return root(ast, base);
    }
    match exponent.as_i64() {
        Some(exponent) if exponent < 0 && base.is_zero() => {
            Err(Fault::new(ast.span, "division by zero").hint("zero has no negative powers"))
        }
        Some(exponent) => base
            .powi(exponent)
            .ok_or_else(|| Fault::new(at.span, "the exponent is too large")),
        None => Err(
            Fault::new(at.span, "the exponent must be an integer or 1/2")
                .hint("roots are written 'sqrt(x)' or 'x^(1/2)'"),
        ),
    }
}

fn root(at: &Ast, x: &Number) -> Result<Number, Fault> {
    x.sqrt().ok_or_else(|| {
        Fault::new(at.span, "square root of a negative number")
            .hint(format!("its argument is {}", x.to_f64()))
    })
}

fn call(function: Function, x: &Number, whole: &Ast, argument: &Ast) -> Result<Number, Fault> {
    match function {
        Function::Sqrt => root(argument, x),
        Function::Sin => Ok(x.sin_cos().0),
        Function::Cos => Ok(x.sin_cos().1),
        Function::Tan => x.tan().ok_or_else(|| {
            Fault::new(whole.span, "the tangent is infinite here")
                .hint("its argument is an odd multiple of pi/2")
        }),
        Function::Sign if x.is_zero() => Ok(Number::zero()),
        Function::Sign if x.is_negative() => Ok(Number::one().neg()),
        Function::Sign => Ok(Number::one()),
        Function::Abs if x.is_negative() => Ok(x.neg()),
        Function::Abs => Ok(x.clone()),
        Function::Deg => x
            .mul(&Number::pi())
            .div(&Number::from_i64(180))
            .ok_or_else(|| Fault::new(whole.span, "division by zero")),
    }
}
