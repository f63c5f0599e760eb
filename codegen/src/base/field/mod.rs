//! The field of the geometry: each element is an exact number together with the expression in the
//! geometry's names from which it was computed.
//!
//! Every decision (is this zero, which pivot) is made on the value at the given geometry; the
//! expression is only carried along, so that the result can be printed as a person would write it.
//! If the value of a difference is zero and its expression is not, two names are equal only by
//! value: the equality is recorded, and the expression becomes zero too.

mod polynomial;
mod print;
mod ratio;
mod variables;

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

use dashu_ratio::RBig;

use crate::base::Coefficient;
use crate::sym::Number;

pub(crate) use polynomial::Polynomial;
pub(crate) use ratio::Ratio;
pub(crate) use variables::{Variable, Variables};

/// An element of the field. Cloning is cheap.
#[derive(Clone, Debug)]
pub struct Element {
    value: Number,
    form: Form,
}

/// The expression of an element.
#[derive(Clone, Debug)]
enum Form {
    /// The element equals its value. Most elements are constants.
    Constant,
    Expression(Arc<Ratio>),
    /// The expression was dropped, since it grew too long to be read, or is not known.
    TooLong,
}

/// The field: its variables, and the coincidences of values that decisions relied on.
#[derive(Debug, Default)]
pub struct Field {
    pub(crate) variables: Variables,
    coincidences: BTreeSet<String>,
}

impl Element {
    /// The number 0.
    pub fn zero() -> Self {
        Element::exact(Number::zero())
    }

    /// The number 1.
    pub fn one() -> Self {
        Element::exact(Number::one())
    }

    /// An integer.
    pub fn integer(value: i64) -> Self {
        Element::exact(match value {
            0 => Number::zero(),
            1 => Number::one(),
            other => Number::from_i64(other),
        })
    }

    /// An exact constant.
    pub fn exact(value: Number) -> Self {
        Element {
            value,
            form: Form::Constant,
        }
    }

    /// A value that depends on the names of the geometry in a way that is not known. No formula is made with it: one in
    /// these names would be wrong for other values of them.
    pub fn at_this_geometry(value: Number) -> Self {
        Self::new(value, None)
    }

    fn new(value: Number, expression: Option<Ratio>) -> Self {
        let Some(ratio) = expression else {
            let form = Form::TooLong;
            return Element { value, form };
        };
        // a simplified expression may be exact where the value was not
        match ratio.as_constant() {
            Some(constant) => Element::exact(constant),
            None => Element {
                value,
                form: Form::Expression(Arc::new(ratio)),
            },
        }
    }

    fn expression(&self) -> Option<Cow<'_, Ratio>> {
        match &self.form {
            Form::Constant => Some(Cow::Owned(Ratio::constant(self.value.clone()))),
            Form::Expression(ratio) => Some(Cow::Borrowed(ratio)),
            Form::TooLong => None,
        }
    }

    fn is_constant(&self) -> bool {
        matches!(self.form, Form::Constant)
    }

    /// The exact value at the given geometry.
    pub fn value(&self) -> &Number {
        &self.value
    }

    /// Whether the value is zero at the given geometry.
    pub fn is_zero(&self) -> bool {
        self.value.is_zero()
    }

    fn is_one(&self) -> bool {
        self.is_constant() && self.value.is_one()
    }

    /// The negative.
    #[must_use]
    pub fn neg(&self) -> Self {
        Element {
            value: self.value.neg(),
            form: match &self.form {
                Form::Expression(ratio) => Form::Expression(Arc::new(ratio.neg())),
                other => other.clone(),
            },
        }
    }

    /// A measure of the length of the printed expression; 0 for a constant, and the largest number
    /// if the expression was dropped as too long.
    pub fn weight(&self) -> usize {
        match &self.form {
            Form::Constant => 0,
            Form::Expression(ratio) => ratio.weight(),
            Form::TooLong => usize::MAX,
        }
    }

    /// Whether the expression is available, and was not dropped as too long.
    pub fn has_form(&self) -> bool {
        !matches!(self.form, Form::TooLong)
    }
}

impl Field {
    /// Equations between values that decisions relied on, such as `l1 = l2`.
    pub fn coincidences(&self) -> impl Iterator<Item = &str> {
        self.coincidences.iter().map(String::as_str)
    }

    /// An element that is a variable with the given value; 0 (recorded as a coincidence) if the
    /// value is 0.
    pub(crate) fn variable(&mut self, variable: Variable, value: Number) -> Element {
        let index = self.variables.index(variable, value.clone());
        if value.is_zero() {
            self.coincidences
                .insert(format!("{} = 0", self.variables.name(index)));
            return Element::zero();
        }
        Element::new(value, Some(Ratio::variable(index)))
    }

    /// Sine and cosine of a constant angle in rad.
    pub fn sin_cos(&mut self, angle: &Number) -> (Element, Element) {
        let (sin, cos) = angle.sin_cos();
        if sin.is_exact() && cos.is_exact() {
            return (Element::exact(sin), Element::exact(cos));
        }
        if angle.is_negative() {
            let (sin, cos) = self.sin_cos(&angle.neg());
            return (sin.neg(), cos);
        }
        if let Some((turns, rest)) = quarter_turns(angle) {
            let (sin, cos) = self.sin_cos(&rest);
            return match turns.rem_euclid(4) {
                1 => (cos, sin.neg()),
                2 => (sin.neg(), cos.neg()),
                3 => (cos.neg(), sin),
                _ => (sin, cos),
            };
        }
        // the cosine comes first, since the square of the sine is written with it
        let cos = self.variable(Variable::Cos(angle.clone()), cos);
        let sin = self.variable(Variable::Sin(angle.clone()), sin);
        (sin, cos)
    }

    /// `a + b`.
    pub fn add(&mut self, a: &Element, b: &Element) -> Element {
        if a.is_zero() {
            return b.clone();
        }
        if b.is_zero() {
            return a.clone();
        }
        let value = a.value.add(&b.value);
        if a.is_constant() && b.is_constant() {
            return Element::exact(value);
        }
        let form = match (a.expression(), b.expression()) {
            (Some(x), Some(y)) => x.add(&y, &self.variables),
            _ => None,
        };
        if value.is_zero() {
            if let Some(form) = form.filter(|f| !f.is_zero()) {
                self.record_coincidence(&form);
            }
            return Element::zero();
        }
        Element::new(value, form)
    }

    /// Records that an expression is zero at the given geometry, though not for every geometry.
    fn record_coincidence(&mut self, form: &Ratio) {
        let equation = print::coincidence(form.numerator(), &self.variables);
        self.coincidences.insert(equation);
    }

    /// `a - b`.
    pub fn sub(&mut self, a: &Element, b: &Element) -> Element {
        self.add(a, &b.neg())
    }

    /// `a b`.
    pub fn mul(&self, a: &Element, b: &Element) -> Element {
        if a.is_zero() || b.is_zero() {
            return Element::zero();
        }
        if a.is_one() {
            return b.clone();
        }
        if b.is_one() {
            return a.clone();
        }
        let value = a.value.mul(&b.value);
        if a.is_constant() && b.is_constant() {
            return Element::exact(value);
        }
        let form = match (a.expression(), b.expression()) {
            (Some(x), Some(y)) => x.mul(&y, &self.variables),
            _ => None,
        };
        Element::new(value, form)
    }

    /// `a / b`; `None` if b is zero.
    pub fn div(&self, a: &Element, b: &Element) -> Option<Element> {
        if b.is_zero() {
            return None;
        }
        if a.is_zero() {
            return Some(Element::zero());
        }
        if b.is_one() {
            return Some(a.clone());
        }
        let value = a.value.div(&b.value)?;
        if a.is_constant() && b.is_constant() {
            return Some(Element::exact(value));
        }
        let form = match (a.expression(), b.expression()) {
            (Some(x), Some(y)) => x.div(&y, &self.variables),
            _ => None,
        };
        Some(Element::new(value, form))
    }

    /// The expression for printing; the value if the expression was dropped as too long.
    pub fn coefficient(&self, a: &Element) -> Coefficient {
        match &a.form {
            Form::Expression(ratio) => print::ratio(ratio, &self.variables),
            Form::Constant | Form::TooLong => (&a.value).into(),
        }
    }
}

/// Splits an angle into a number of quarter turns, not 0, and a remainder with simpler sines: one
/// without pi, or of at most an eighth turn.
fn quarter_turns(angle: &Number) -> Option<(i64, Number)> {
    let rest = |turns: i64| -> Option<Number> {
        let turned = Number::pi().mul(&Number::ratio(turns, 2)?);
        Some(angle.sub(&turned))
    };
    if let Some(halves) = angle.pi_multiple() {
        let turns = i64::try_from((halves * RBig::from(2)).round()).ok()?;
        return (turns != 0).then_some((turns, rest(turns)?));
    }
    let few = [1, 2, 3, -1, -2, -3].into_iter();
    few.filter_map(|turns| Some((turns, rest(turns)?)))
        .find(|(_, rest)| rest.as_rational().is_some())
}

#[cfg(test)]
mod tests;
