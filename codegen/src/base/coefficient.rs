//! Coefficients of combinations as expression trees. Printers work on the tree; text is used only
//! in files and generated modules.

use core::fmt;

use crate::spec::{self, Ast, AstKind, Function, Operator};
use crate::sym::{Number, NumberFactor};

/// An expression in numbers and the geometry's names.
///
/// Signs are pulled outwards: factors, numerators and denominators carry none, and the sign of a
/// term is the flag next to it in the sum.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Coefficient {
    /// A number without a sign, as printed: `3`, `0.25`, `1.5e-3`.
    Number(String),
    /// A geometry name, or `pi`.
    Name(String),
    /// The negative of an expression.
    Neg(Box<Coefficient>),
    /// A sum of terms; the flag says whether the term is subtracted.
    Sum(Vec<(bool, Coefficient)>),
    /// A product of factors.
    Product(Vec<Coefficient>),
    /// Numerator and denominator.
    Quotient(Box<Coefficient>, Box<Coefficient>),
    /// A base and its exponent.
    Power(Box<Coefficient>, Box<Coefficient>),
    /// A function of one argument.
    Call(Function, Box<Coefficient>),
}

impl Coefficient {
    /// Parses an expression in the spec's grammar; `None` where the text is not one.
    ///
    /// Parsing the text of a printed coefficient gives the same tree again.
    pub fn parse(text: &str) -> Option<Self> {
        Some(Self::read(&spec::syntax(text)?, text))
    }

    /// Converts the spec parser's syntax tree of `text`. Numbers keep their digits.
    fn read(ast: &Ast, text: &str) -> Self {
        let of = |inner: &Ast| Self::read(inner, text);
        match &ast.kind {
            AstKind::Number(_) => {
                let digits = text.get(ast.span.start..ast.span.end).unwrap_or_default();
                let outside = |c: char| matches!(c, '(' | ')') || c.is_whitespace();
                Self::Number(digits.trim_matches(outside).to_owned())
            }
            AstKind::Pi => Self::pi(),
            AstKind::Name(name) | AstKind::Variable(name) => Self::Name(name.clone()),
            AstKind::Neg(a) => of(a).negated(),
            AstKind::Call(function, a) => Self::call(*function, of(a)),
            AstKind::Binary(Operator::Add, a, b) => of(a).joined(false, of(b)),
            AstKind::Binary(Operator::Sub, a, b) => of(a).joined(true, of(b)),
            AstKind::Binary(Operator::Mul, a, b) => of(a).times(of(b)),
            AstKind::Binary(Operator::Div, a, b) => of(a).over(of(b)),
            AstKind::Binary(Operator::Pow, a, b) => of(a).raised(of(b)),
        }
    }

    /// A non-negative integer.
    pub(super) fn integer(value: impl fmt::Display) -> Self {
        Self::Number(value.to_string())
    }

    fn pi() -> Self {
        Self::Name("pi".to_owned())
    }

    /// A function applied to an argument.
    pub(super) fn call(function: Function, argument: Self) -> Self {
        Self::Call(function, Box::new(argument))
    }

    /// `self^exponent`.
    pub(super) fn raised(self, exponent: Self) -> Self {
        Self::Power(Box::new(self), Box::new(exponent))
    }

    /// `self * factor`; the signs of both are pulled out of the product.
    pub(super) fn times(self, factor: Self) -> Self {
        let ((minus, left), (other, right)) = (self.split(), factor.split());
        let product = match left {
            Self::Product(mut factors) => {
                factors.push(right);
                Self::Product(factors)
            }
            _ => Self::Product(vec![left, right]),
        };
        product.signed(minus != other)
    }

    /// `self / below`; the signs of both are pulled out of the quotient.
    pub(super) fn over(self, below: Self) -> Self {
        let ((minus, above), (other, below)) = (self.split(), below.split());
        Self::Quotient(Box::new(above), Box::new(below)).signed(minus != other)
    }

    /// `self + term`, or `self - term` with `minus`; the term is appended where `self` is a sum.
    fn joined(self, minus: bool, term: Self) -> Self {
        let mut terms = match self {
            Self::Sum(terms) => terms,
            other => vec![other.split()],
        };
        let (negative, term) = term.split();
        terms.push((negative != minus, term));
        Self::Sum(terms)
    }

    /// The sum of terms, each with a flag whether it is subtracted. A sum that is added is replaced
    /// by its terms.
    pub(super) fn sum(parts: impl IntoIterator<Item = (bool, Self)>) -> Self {
        let mut terms = Vec::new();
        for (minus, term) in parts {
            let (negative, term) = term.split();
            match (negative != minus, term) {
                (false, Self::Sum(inner)) => terms.extend(inner),
                signed => terms.push(signed),
            }
        }
        match terms.pop() {
            None => Self::integer(0),
            Some((negative, only)) if terms.is_empty() => only.signed(negative),
            Some(last) => {
                terms.push(last);
                Self::Sum(terms)
            }
        }
    }

    /// The negative.
    #[must_use]
    pub fn negated(self) -> Self {
        match self {
            Self::Neg(inner) => *inner,
            other => Self::Neg(Box::new(other)),
        }
    }

    fn signed(self, negative: bool) -> Self {
        if negative { self.negated() } else { self }
    }

    /// The expression without its leading minus sign, and whether it had one.
    fn split(self) -> (bool, Self) {
        match self {
            Self::Neg(inner) => (true, *inner),
            other => (false, other),
        }
    }

    /// Twice the expression: `2*a`, and `a` of `a/2`.
    #[must_use]
    pub(super) fn doubled(&self) -> Self {
        let whole = |digits: &str| digits.parse::<u64>().ok();
        match self {
            Self::Neg(inner) => inner.doubled().negated(),
            Self::Sum(terms) => {
                let terms = terms.iter();
                Self::Sum(
                    terms
                        .map(|(minus, term)| (*minus, term.doubled()))
                        .collect(),
                )
            }
            Self::Quotient(above, below) => match &**below {
                Self::Number(digits) => match whole(digits) {
                    Some(2) => (**above).clone(),
                    Some(n) if n % 2 == 0 => (**above).clone().over(Self::integer(n / 2)),
                    _ => above.doubled().over((**below).clone()),
                },
                _ => above.doubled().over((**below).clone()),
            },
            Self::Product(factors) => match factors.split_first() {
                Some((Self::Number(digits), rest)) if whole(digits).is_some() => {
                    let twice = whole(digits).unwrap_or(1).saturating_mul(2);
                    let rest = rest.iter().cloned();
                    Self::Product(std::iter::once(Self::integer(twice)).chain(rest).collect())
                }
                _ => {
                    let factors = factors.iter().cloned();
                    Self::Product(std::iter::once(Self::integer(2)).chain(factors).collect())
                }
            },
            _ => Self::integer(2).times(self.clone()),
        }
    }

    /// Whether it contains a geometry name.
    pub(crate) fn mentions_names(&self) -> bool {
        match self {
            Self::Number(_) => false,
            Self::Name(_) => *self != Self::pi(),
            Self::Neg(inner) | Self::Call(_, inner) => inner.mentions_names(),
            Self::Sum(terms) => terms.iter().any(|(_, term)| term.mentions_names()),
            Self::Product(factors) => factors.iter().any(Self::mentions_names),
            Self::Quotient(a, b) | Self::Power(a, b) => a.mentions_names() || b.mentions_names(),
        }
    }

    /// Whether it is the number 1.
    pub fn is_one(&self) -> bool {
        matches!(self, Self::Number(digits) if digits == "1")
    }

    /// Whether it is a sum, which needs parentheses as a factor.
    pub fn is_sum(&self) -> bool {
        matches!(self, Self::Sum(_))
    }

    /// The expression without a minus sign that can be factored out, and whether there was one. A
    /// sum has one if all its terms are negative.
    #[must_use]
    pub fn unsigned(&self) -> (bool, Self) {
        match self {
            Self::Sum(terms) if terms.iter().all(|(negative, _)| *negative) => {
                let turned = terms.iter().map(|(_, term)| (false, term.clone()));
                (true, Self::Sum(turned.collect()))
            }
            other => other.clone().split(),
        }
    }

    /// How tightly the outermost operator binds.
    fn level(&self) -> Level {
        match self {
            Self::Sum(_) | Self::Neg(_) => Level::Sum,
            Self::Product(_) | Self::Quotient(..) => Level::Product,
            Self::Power(..) => Level::Power,
            Self::Number(_) | Self::Name(_) | Self::Call(..) => Level::Atom,
        }
    }
}

/// How tightly an expression's outermost operator binds.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Sum,
    Product,
    Power,
    Atom,
}

/// A subexpression: printed in parentheses if it binds less tightly than the given level.
struct Part<'a>(&'a Coefficient, Level);

impl fmt::Display for Part<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(part, least) = self;
        if part.level() < *least {
            write!(f, "({part})")
        } else {
            write!(f, "{part}")
        }
    }
}

/// Prints in the spec's grammar, as a person writes it: `-2*sqrt(3)/(3*a)`.
impl fmt::Display for Coefficient {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(text) | Self::Name(text) => f.write_str(text),
            Self::Neg(inner) => write!(f, "-{}", Part(inner, Level::Product)),
            Self::Sum(terms) => {
                for (k, (negative, term)) in terms.iter().enumerate() {
                    f.write_str(match (k, negative) {
                        (0, true) => "-",
                        (0, false) => "",
                        (_, true) => " - ",
                        (_, false) => " + ",
                    })?;
                    Part(term, Level::Product).fmt(f)?;
                }
                Ok(())
            }
            Self::Product(factors) => {
                for (k, factor) in factors.iter().enumerate() {
                    // only a quotient as the first factor keeps its meaning without parentheses
                    let (joint, least) = match (k, factor) {
                        (0, Self::Product(_)) => ("", Level::Power),
                        (0, _) => ("", Level::Product),
                        _ => ("*", Level::Power),
                    };
                    f.write_str(joint)?;
                    Part(factor, least).fmt(f)?;
                }
                Ok(())
            }
            Self::Quotient(above, below) => {
                let (above, below) = (Part(above, Level::Product), Part(below, Level::Power));
                write!(f, "{above}/{below}")
            }
            Self::Power(base, exponent) => {
                let base = Part(base, Level::Atom);
                match &**exponent {
                    // in an exponent, a minus sign binds more tightly than the power
                    Self::Neg(inner) => write!(f, "{base}^-{}", Part(inner, Level::Power)),
                    other => write!(f, "{base}^{}", Part(other, Level::Power)),
                }
            }
            Self::Call(function, argument) => write!(f, "{}({argument})", function.name()),
        }
    }
}

/// The tree of an exact number, as it is printed.
impl From<&Number> for Coefficient {
    fn from(number: &Number) -> Self {
        let factor = |factor: NumberFactor| match factor {
            NumberFactor::Numeric(digits) => Self::Number(digits),
            NumberFactor::Root(radicand) => Self::call(Function::Sqrt, Self::integer(radicand)),
            NumberFactor::Pi(1) => Self::pi(),
            NumberFactor::Pi(power) => Self::pi().raised(Self::integer(power)),
            NumberFactor::Two(exponent) => {
                let size = Self::integer(exponent.unsigned_abs());
                Self::integer(2).raised(size.signed(exponent < 0))
            }
        };
        let product =
            |factors: Vec<NumberFactor>| factors.into_iter().map(factor).reduce(Self::times);
        Self::sum(number.written().into_iter().map(|term| {
            let above = product(term.above).unwrap_or_else(|| Self::integer(1));
            let whole = match product(term.below) {
                Some(below) => above.over(below),
                None => above,
            };
            (term.negative, whole)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(text: &str) -> Coefficient {
        Coefficient::parse(text).unwrap()
    }

    #[test]
    fn printing_a_parsed_expression_gives_its_text() {
        for text in [
            "0",
            "-1",
            "2*sqrt(3)/(3*a)",
            "-2*sqrt(3)/(3*a)",
            "a - (sqrt(6) - sqrt(2))",
            "-(sqrt(6) - sqrt(2))*a",
            "(a + b)/(a^2 + b^2)",
            "a/(3*(b + c))",
            "63233704/3/b",
            "63233704/3*b",
            "a/b^2",
            "cos(3/5)^2*tan(l/2)",
            "(a + b)^2",
            "(-a)^2",
            "2^-1",
            "2^-(a/b)",
            "2^(a*b)",
            "a^b^c",
            "(a^b)^c",
            "a/(b/c)",
            "a*(b/c)",
            "a*(b*c)",
            "a - (b + c)",
            "a + (b - c)",
            "9007199254740993*2^-70*a",
            "1.5000000000000000e-7*a",
            "0.50000000000000001*a",
            "5*pi^2/6 + 1/(3*pi)",
            "deg(30)",
            "-a - b",
            "-a + b",
        ] {
            assert_eq!(tree(text).to_string(), text);
        }
        for (text, printed) in [
            ("1 - -a", "1 + a"),
            ("a*-b", "-a*b"),
            ("-a/-b", "a/b"),
            ("((2))*( a )", "2*a"),
            ("(a*b)*c", "a*b*c"),
            ("+a", "a"),
        ] {
            assert_eq!(tree(text).to_string(), printed);
        }
    }

    #[test]
    fn text_that_is_no_expression_does_not_parse() {
        for text in ["?", "a +", "(a", "a b", "", "2 $ 3", "50%"] {
            assert_eq!(Coefficient::parse(text), None, "{text}");
        }
    }

    #[test]
    fn numbers_have_the_tree_of_their_text() {
        let ratio = |a, b| Number::ratio(a, b).unwrap();
        let root = |n| Number::from_i64(n).sqrt().unwrap();
        let third = Number::one().div(&Number::pi().mul(&ratio(3, 1))).unwrap();
        for number in [
            Number::zero(),
            Number::from_i64(-7),
            ratio(-1, 2),
            ratio(4563, 10_000),
            ratio(632_337_041, 115_162_534),
            root(3).mul(&ratio(-2, 3)),
            root(6).sub(&root(2)),
            root(2).neg().sub(&root(6)),
            third,
            Number::pi().powi(2).unwrap().mul(&ratio(5, 6)),
            Number::from_i64(1).sin_cos().0.neg(),
            ratio(1, 1_000_000_000).sin_cos().0,
            Number::pi().powi(1000).unwrap().sin_cos().1,
            Number::from_i64(3)
                .sin_cos()
                .0
                .powi(1000)
                .unwrap()
                .powi(1000)
                .unwrap(),
        ] {
            let text = number.to_string();
            let tree = Coefficient::from(&number);
            assert_eq!(tree.to_string(), text);
            assert_eq!(Coefficient::parse(&text), Some(tree), "{text}");
        }
    }

    #[test]
    fn signs_are_taken_out_where_all_terms_have_them() {
        for (text, expected) in [
            ("a", (false, "a", false)),
            ("-a", (true, "a", false)),
            ("-a*(b - c)", (true, "a*(b - c)", false)),
            ("a - b", (false, "a - b", true)),
            ("-a - b", (true, "a + b", true)),
            ("-a - b*(c - d)", (true, "a + b*(c - d)", true)),
            ("-a - (b - c)", (true, "a + (b - c)", true)),
            ("-a + b", (false, "-a + b", true)),
            ("2^-1", (false, "2^-1", false)),
        ] {
            let (negative, rest) = tree(text).unsigned();
            assert_eq!(
                (negative, rest.to_string().as_str(), rest.is_sum()),
                expected,
                "{text}"
            );
        }
    }
}
