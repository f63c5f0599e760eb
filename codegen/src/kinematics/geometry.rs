//! How the constants of the description enter the expressions: as numbers, or as arguments of the functions.

use std::collections::BTreeMap;

use crate::spec::{Expr, Function, Quantity, Spec};
use crate::sym::{Angle, Ex, Graph, Number, SymbolId};

/// How lengths, angles and gravity enter the expressions.
#[derive(Clone, Debug, Default)]
pub enum Geometry {
    /// As their exact values.
    #[default]
    Values,
    /// Names that are adjustable, and what follows from them, as arguments of the functions; all else as its
    /// exact value.
    Arguments(Arguments),
}

/// The names of a description as expressions.
#[derive(Clone, Debug)]
pub struct Arguments {
    /// The symbols of the adjustable names, in their order.
    pub symbols: Vec<SymbolId>,
    names: BTreeMap<String, Term>,
}

/// An expression and, if it is linear in the symbols, the same as an angle.
#[derive(Clone, Debug)]
struct Term {
    ex: Ex,
    angle: Option<Angle>,
}

impl Arguments {
    /// The names of a description, some of which become symbols of the graph.
    ///
    /// - `adjustable`: these names.
    /// - `symbol`: the name of a name's symbol, which is that of no coordinate or parameter.
    pub fn new(
        g: &mut Graph,
        spec: &Spec,
        adjustable: &[&str],
        symbol: impl Fn(&str) -> String,
    ) -> Self {
        let symbols = adjustable.iter().map(|name| g.symbol_id(&symbol(name)));
        let mut out = Arguments {
            symbols: symbols.collect(),
            names: BTreeMap::new(),
        };
        for (name, quantity) in &spec.geometry {
            let own = adjustable.iter().position(|own| *own == name.value);
            let term = match own {
                Some(at) => Some(Term {
                    ex: g.symbol(&symbol(&name.value)),
                    angle: Some(Angle::symbol(out.symbols[at])),
                }),
                None => out
                    .term(g, &quantity.expr)
                    .filter(|term| g.value(term.ex).is_none()),
            };
            // what follows from no adjustable name keeps its exact value
            let term = term.unwrap_or_else(|| Term::constant(g, &quantity.value));
            out.names.insert(name.value.clone(), term);
        }
        out
    }

    /// An expression of the description; `None` if the graph has no such expression.
    fn term(&self, g: &mut Graph, expr: &Expr) -> Option<Term> {
        let pair = |g: &mut Graph, a: &Expr, b: &Expr| Some((self.term(g, a)?, self.term(g, b)?));
        let one = Number::one();
        Some(match expr {
            Expr::Number(n) => Term::constant(g, n),
            Expr::Pi => Term::constant(g, &Number::pi()),
            Expr::Name(name) => self.names.get(name)?.clone(),
            Expr::Neg(a) => {
                let a = self.term(g, a)?;
                Term {
                    ex: g.neg(a.ex),
                    angle: a.angle.map(|angle| angle.negated()),
                }
            }
            Expr::Add(a, b) => {
                let (a, b) = pair(g, a, b)?;
                Term {
                    ex: g.add(a.ex, b.ex),
                    angle: a.plus(&b, &one),
                }
            }
            Expr::Sub(a, b) => {
                let (a, b) = pair(g, a, b)?;
                Term {
                    ex: g.sub(a.ex, b.ex),
                    angle: a.plus(&b, &one.neg()),
                }
            }
            Expr::Mul(a, b) => {
                let (a, b) = pair(g, a, b)?;
                let angle = match (g.value(a.ex), g.value(b.ex)) {
                    (Some(factor), _) => b.times(&factor),
                    (_, Some(factor)) => a.times(&factor),
                    _ => None,
                };
                Term {
                    ex: g.mul(a.ex, b.ex),
                    angle,
                }
            }
            Expr::Div(a, b) => {
                let (a, b) = pair(g, a, b)?;
                let inverse = g.value(b.ex).and_then(|own| one.div(&own));
                Term {
                    ex: g.div(a.ex, b.ex)?,
                    angle: inverse.and_then(|factor| a.times(&factor)),
                }
            }
            Expr::Pow(a, b) => {
                let (a, b) = pair(g, a, b)?;
                let exponent = g.value(b.ex)?.as_i64()?;
                let mut product = Ex::ONE;
                for _ in 0..u8::try_from(exponent).ok()? {
                    product = g.mul(product, a.ex);
                }
                Term::nonlinear(g, product)
            }
            Expr::Call(function, a) => {
                let a = self.term(g, a)?;
                let degree = Number::pi().div(&Number::from_i64(180))?;
                let ex = match function {
                    Function::Sqrt => g.sqrt(a.ex),
                    Function::Sin => g.sin_cos_of(a.ex).0,
                    Function::Cos => g.sin_cos_of(a.ex).1,
                    Function::Tan => {
                        let (sin, cos) = g.sin_cos_of(a.ex);
                        g.div(sin, cos)?
                    }
                    Function::Deg => {
                        let factor = g.constant(degree.clone());
                        return Some(Term {
                            ex: g.mul(a.ex, factor),
                            angle: a.times(&degree),
                        });
                    }
                    Function::Sign | Function::Abs => return None,
                };
                Term::nonlinear(g, ex)
            }
        })
    }

    /// A quantity that depends on adjustable names.
    fn quantity(&self, g: &mut Graph, quantity: &Quantity) -> Option<Term> {
        if !self.depends(g, &quantity.expr) {
            return None;
        }
        self.term(g, &quantity.expr)
    }

    fn depends(&self, g: &Graph, expr: &Expr) -> bool {
        match expr {
            Expr::Number(_) | Expr::Pi => false,
            Expr::Name(name) => {
                let own = self.names.get(name);
                own.is_some_and(|own| g.value(own.ex).is_none())
            }
            Expr::Neg(a) | Expr::Call(_, a) => self.depends(g, a),
            Expr::Add(a, b)
            | Expr::Sub(a, b)
            | Expr::Mul(a, b)
            | Expr::Div(a, b)
            | Expr::Pow(a, b) => self.depends(g, a) || self.depends(g, b),
        }
    }
}

impl Term {
    fn constant(g: &mut Graph, value: &Number) -> Self {
        Term {
            ex: g.constant(value.clone()),
            angle: Some(Angle::constant(value.clone())),
        }
    }

    /// An expression that is an angle only if it is constant.
    fn nonlinear(g: &Graph, ex: Ex) -> Self {
        Term {
            ex,
            angle: g.value(ex).map(Angle::constant),
        }
    }

    fn plus(&self, other: &Term, factor: &Number) -> Option<Angle> {
        Some(self.angle.as_ref()?.plus(other.angle.as_ref()?, factor))
    }

    fn times(&self, factor: &Number) -> Option<Angle> {
        Some(Angle::constant(Number::zero()).plus(self.angle.as_ref()?, factor))
    }
}

impl Geometry {
    /// A length, or a number of another unit, as an expression.
    pub fn length(&self, g: &mut Graph, quantity: &Quantity) -> Ex {
        let own = match self {
            Geometry::Values => None,
            Geometry::Arguments(arguments) => arguments.quantity(g, quantity),
        };
        match own {
            Some(own) => own.ex,
            None => g.constant(quantity.value.clone()),
        }
    }

    /// An angle of a placement. The description is checked to have no angle that is not linear.
    pub(super) fn angle(&self, g: &mut Graph, quantity: &Quantity) -> Angle {
        let own = match self {
            Geometry::Values => None,
            Geometry::Arguments(arguments) => arguments.quantity(g, quantity),
        };
        own.and_then(|own| own.angle)
            .unwrap_or_else(|| Angle::constant(quantity.value.clone()))
    }
}
