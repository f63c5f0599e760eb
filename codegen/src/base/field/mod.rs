//! The field of the geometry: numbers that keep, beside their exact value, the
//! expression in the geometry's names that they came from.
//!
//! Every decision (is this zero, which pivot) is made on the value at the given
//! geometry; the expression only follows along, so that the result can be
//! printed as a person would write it. Where the value of a difference is zero
//! and its expression is not, two names are equal only by value: that is noted
//! and the expression becomes zero too.

mod polynomial;
mod print;
mod ratio;
mod variables;

use std::collections::BTreeSet;

use crate::sym::Number;

pub(crate) use polynomial::Polynomial;
pub(crate) use ratio::Ratio;
pub(crate) use variables::{Variable, Variables};

/// An element of the field.
#[derive(Clone, Debug)]
pub struct Element {
    value: Number,
    /// The expression; `None` where it grew beyond what anyone would read.
    form: Option<Ratio>,
}

/// The field: its variables, and which coincidences of their values were used.
#[derive(Debug, Default)]
pub struct Field {
    pub(crate) variables: Variables,
    coincidences: BTreeSet<String>,
}

impl Element {
    /// 0.
    pub fn zero() -> Self {
        Element {
            value: Number::zero(),
            form: Some(Ratio::zero()),
        }
    }

    /// 1.
    pub fn one() -> Self {
        Element {
            value: Number::one(),
            form: Some(Ratio::one()),
        }
    }

    /// An integer.
    pub fn integer(value: i64) -> Self {
        Element::exact(Number::from_i64(value))
    }

    /// An exact constant.
    pub fn exact(value: Number) -> Self {
        Element {
            form: Some(Ratio::constant(value.clone())),
            value,
        }
    }

    /// The exact value at the given geometry.
    pub fn value(&self) -> &Number {
        &self.value
    }

    /// Whether the value is zero at the given geometry.
    pub fn is_zero(&self) -> bool {
        self.value.is_zero()
    }

    /// The negative.
    #[must_use]
    pub fn neg(&self) -> Self {
        Element {
            value: self.value.neg(),
            form: self.form.as_ref().map(Ratio::neg),
        }
    }

    /// How much there is to write: 0 for a constant.
    pub fn weight(&self) -> usize {
        self.form.as_ref().map_or(usize::MAX, Ratio::weight)
    }

    /// Whether the expression is known.
    pub fn has_form(&self) -> bool {
        self.form.is_some()
    }
}

impl Field {
    /// Coincidences of values that decided something, as equations.
    pub fn coincidences(&self) -> impl Iterator<Item = &str> {
        self.coincidences.iter().map(String::as_str)
    }

    /// An element that is a variable.
    pub(crate) fn variable(&mut self, variable: Variable, value: Number) -> Element {
        let index = self.variables.index(variable, value.clone());
        if value.is_zero() {
            self.coincidences
                .insert(format!("{} = 0", self.variables.name(index)));
            return Element::zero();
        }
        Element {
            value,
            form: Some(Ratio::variable(index)),
        }
    }

    /// Sine and cosine of a constant angle.
    pub fn sin_cos(&mut self, angle: &Number) -> (Element, Element) {
        let (sin, cos) = angle.sin_cos();
        if sin.is_exact() && cos.is_exact() {
            return (Element::exact(sin), Element::exact(cos));
        }
        if angle.is_negative() {
            let (sin, cos) = self.sin_cos(&angle.neg());
            return (sin.neg(), cos);
        }
        // the cosine first: the sine's square is written with it
        let cos = self.variable(Variable::Cos(angle.clone()), cos);
        let sin = self.variable(Variable::Sin(angle.clone()), sin);
        (sin, cos)
    }

    /// `a + b`.
    pub fn add(&mut self, a: &Element, b: &Element) -> Element {
        let value = a.value.add(&b.value);
        let form = match (&a.form, &b.form) {
            (Some(x), Some(y)) => x.add(y, &self.variables),
            _ => None,
        };
        if value.is_zero() {
            if let Some(form) = form.filter(|f| !f.is_zero()) {
                self.note(&form);
            }
            return Element::zero();
        }
        Element { value, form }
    }

    fn note(&mut self, form: &Ratio) {
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
        Element {
            value: a.value.mul(&b.value),
            form: match (&a.form, &b.form) {
                (Some(x), Some(y)) => x.mul(y, &self.variables),
                _ => None,
            },
        }
    }

    /// `a / b`; `None` where b is zero.
    pub fn div(&self, a: &Element, b: &Element) -> Option<Element> {
        if b.is_zero() {
            return None;
        }
        if a.is_zero() {
            return Some(Element::zero());
        }
        Some(Element {
            value: a.value.div(&b.value)?,
            form: match (&a.form, &b.form) {
                (Some(x), Some(y)) => x.div(y, &self.variables),
                _ => None,
            },
        })
    }

    /// The expression as text in the spec's grammar; the value where there is
    /// no expression short enough.
    pub fn text(&self, a: &Element) -> String {
        match &a.form {
            Some(form) => print::ratio(form, &self.variables),
            None => a.value.to_string(),
        }
    }
}

#[cfg(test)]
mod tests;
