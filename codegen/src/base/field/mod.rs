//! The field of the geometry: each element is an exact number together with the expression in the
//! geometry's names from which it was computed.
//!
//! Every decision (is this zero, which pivot) is made on the value at the given geometry; the
//! expression is only carried along, so that the result can be printed as a person would write it.
//! If the value of a difference is zero and its expression is not, two names are equal only by
//! value: the equality is recorded, and the expression becomes zero too.

mod angles;
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
pub(crate) use variables::{Argument, Variable, Variables};

use angles::Angles;

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
    TooLong {
        /// Whether it contained geometry names.
        of_names: bool,
    },
}

/// The field: its variables, and the coincidences of values that decisions relied on.
#[derive(Debug, Default)]
pub struct Field {
    pub(crate) variables: Variables,
    coincidences: BTreeSet<String>,
    /// Where angles have names: the polynomials of the coincidences, without common factors.
    zeros: Vec<(Polynomial, String)>,
    angles: Angles,
    /// Whether angles with names are noted only, so that units can be chosen for them.
    notes_angles: bool,
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

    fn new(value: Number, ratio: Ratio) -> Self {
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
            Form::TooLong { .. } => None,
        }
    }

    /// An element of which the value is known only, though it depends on geometry names: no formula is made with it,
    /// which would be wrong for other values of them.
    pub(crate) fn without_form(value: Number) -> Self {
        let form = Form::TooLong { of_names: true };
        Element { value, form }
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

    pub(super) fn is_one(&self) -> bool {
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
            Form::TooLong { .. } => usize::MAX,
        }
    }

    /// Whether the expression is available, and was not dropped as too long.
    pub fn has_form(&self) -> bool {
        !matches!(self.form, Form::TooLong { .. })
    }

    /// The value for other values of the field's variables; `None` if only a number is known, though it
    /// depends on names.
    pub(crate) fn value_at(&self, values: &[Number]) -> Option<Number> {
        match &self.form {
            Form::Constant | Form::TooLong { of_names: false } => Some(self.value.clone()),
            Form::Expression(ratio) => ratio.value(&|index| values.get(index)),
            Form::TooLong { of_names: true } => None,
        }
    }

    /// Whether the element depends on geometry names, and is known as a number only.
    pub(crate) fn hides_names(&self) -> bool {
        matches!(self.form, Form::TooLong { of_names: true })
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
        Element::new(value, Ratio::variable(index))
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
        self.variables_of(&Argument::Constant(angle.clone()), (sin, cos))
    }

    /// The variables for sine and cosine of an angle, with their values.
    fn variables_of(
        &mut self,
        angle: &Argument,
        (sin, cos): (Number, Number),
    ) -> (Element, Element) {
        let cos = self.variable(Variable::Cos(angle.clone()), cos);
        let sin = self.variable(Variable::Sin(angle.clone()), sin);
        (sin, cos)
    }

    /// A field in which the angles that `use_field` uses are multiples of common units.
    pub(crate) fn with_units_of(use_field: impl FnOnce(&mut Field)) -> Self {
        let mut notes = Field {
            notes_angles: true,
            ..Field::default()
        };
        use_field(&mut notes);
        Field {
            angles: notes.angles.settled(),
            ..Field::default()
        }
    }

    /// Whether sines of angles with names were asked for.
    pub(crate) fn has_named_angles(&self) -> bool {
        self.notes_angles || self.angles.count() > 0
    }

    /// Adds the sines and cosines of the units to the variables.
    pub(crate) fn add_units(&mut self) {
        for unit in 0..self.angles.count() {
            self.sin_cos_of_unit(unit);
        }
    }

    /// Sine and cosine of an angle in rad that may depend on names.
    pub(crate) fn sin_cos_of(&mut self, angle: &Element) -> (Element, Element) {
        let ratio = match &angle.form {
            Form::Expression(ratio) if self.has_names(angle) => Arc::clone(ratio),
            Form::TooLong { of_names: true } => {
                let (sin, cos) = angle.value.sin_cos();
                return (Element::without_form(sin), Element::without_form(cos));
            }
            _ => return self.sin_cos(&angle.value),
        };
        let (constant, parts) = angles::split(&ratio);
        let (sin, cos) = angle.value.sin_cos();
        if self.notes_angles {
            self.angles.note(parts);
            return (Element::without_form(sin), Element::without_form(cos));
        }
        if sin.is_zero() || cos.is_zero() {
            // axes at right angles or parallel: this value is a special one
            self.add(angle, &Element::exact(angle.value.neg()));
            return (Element::exact(sin), Element::exact(cos));
        }
        let mut sum = self.sin_cos(&constant);
        for (unit, times) in self.angles.in_units(&parts) {
            let (sin, cos) = self.sin_cos_of_unit(unit);
            let one = (if times < 0 { sin.neg() } else { sin }, cos);
            for _ in 0..times.unsigned_abs() {
                sum = self.turned(&sum, &one);
            }
        }
        sum
    }

    /// Sine and cosine of the sum of two angles, from their sines and cosines.
    fn turned(&mut self, a: &(Element, Element), b: &(Element, Element)) -> (Element, Element) {
        let ((sa, ca), (sb, cb)) = (a, b);
        let products = [(sa, cb), (ca, sb), (ca, cb), (sa, sb)].map(|(x, y)| self.mul(x, y));
        let [sc, cs, cc, ss] = products;
        (self.add(&sc, &cs), self.sub(&cc, &ss))
    }

    /// Sine and cosine of a unit of angles: variables, or numbers at a multiple of a right angle.
    fn sin_cos_of_unit(&mut self, unit: usize) -> (Element, Element) {
        let ratio = self.angles.unit(unit, &self.variables);
        let ratio = ratio.unwrap_or_else(Ratio::zero);
        let value = ratio.value(&|index| self.variables.value(index));
        let value = value.unwrap_or_else(Number::zero);
        let (sin, cos) = value.sin_cos();
        if sin.is_zero() || cos.is_zero() {
            let unit = Element::new(value.clone(), ratio);
            self.add(&unit, &Element::exact(value.neg()));
            return (Element::exact(sin), Element::exact(cos));
        }
        let argument = Argument::Named(print::ratio(&ratio, &self.variables), value);
        self.variables_of(&argument, (sin, cos))
    }

    /// The values of all variables, where `evaluate` gives the value of an expression.
    pub(crate) fn values_with(
        &self,
        evaluate: &dyn Fn(&str) -> Option<Number>,
    ) -> Option<Vec<Number>> {
        let all = 0..self.variables.count();
        all.map(|index| evaluate(&self.variables.name(index).to_string()))
            .collect()
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
        let sum = self.combined(value, [a, b], Ratio::add);
        if sum.value.is_zero() {
            if let Form::Expression(ratio) = &sum.form {
                self.record_coincidence(ratio);
            }
            return Element::zero();
        }
        sum
    }

    /// The element with this value and the expression that `operation` makes of those of two others.
    fn combined(
        &self,
        value: Number,
        [a, b]: [&Element; 2],
        operation: fn(&Ratio, &Ratio, &Variables) -> Option<Ratio>,
    ) -> Element {
        let form = match (a.expression(), b.expression()) {
            (Some(x), Some(y)) => operation(&x, &y, &self.variables),
            _ => None,
        };
        if let Some(ratio) = form {
            return Element::new(value, ratio);
        }
        let form = Form::TooLong {
            of_names: self.has_names(a) || self.has_names(b),
        };
        Element { value, form }
    }

    /// Whether an element depends on geometry names.
    fn has_names(&self, a: &Element) -> bool {
        match &a.form {
            Form::Constant => false,
            Form::Expression(ratio) => {
                let parts = [ratio.numerator(), ratio.denominator()];
                let mut used = parts.into_iter().flat_map(Polynomial::variables_used);
                used.any(|index| self.variables.is_named(index))
            }
            Form::TooLong { of_names } => *of_names,
        }
    }

    /// Records that an expression is zero at the given geometry, though not for every geometry.
    fn record_coincidence(&mut self, form: &Ratio) {
        let p = form.numerator();
        let equation = self.equality_of_angles(p);
        let equation = equation.unwrap_or_else(|| print::coincidence(p, &self.variables));
        if self.has_named_angles() {
            // an equation that follows from another one says nothing new
            let p = p.without(&p.common_monomial());
            if self.zeros.iter().any(|(zero, _)| p.divided(zero).is_some()) {
                return;
            }
            let (coincidences, zeros) = (&mut self.coincidences, &mut self.zeros);
            zeros.retain(|(zero, implied)| {
                let keeps = *implied == equation || zero.divided(&p).is_none();
                if !keeps {
                    coincidences.remove(implied);
                }
                keeps
            });
            self.zeros.push((p, equation.clone()));
        }
        self.coincidences.insert(equation);
    }

    /// The equality of two angles, or of an angle and a number, by which a polynomial is zero.
    fn equality_of_angles(&self, p: &Polynomial) -> Option<String> {
        let used = p.variables_used();
        let sines = self.variables.named_sines();
        let angles: Vec<(usize, usize)> = sines
            .filter(|(sin, cos)| used.contains(sin) || used.contains(cos))
            .collect();
        let value = |index: usize| self.variables.value(index);
        for (k, (sin, cos)) in angles.iter().enumerate() {
            for (other_sin, other_cos) in angles.iter().take(k) {
                let opposite = value(*sin) != value(*other_sin);
                let minus = value(*other_sin).map(Number::neg);
                if value(*cos) != value(*other_cos) || (opposite && value(*sin) != minus.as_ref()) {
                    continue;
                }
                let equal = |index: usize| {
                    if index == *sin {
                        let sine = Polynomial::variable(*other_sin);
                        Some(if opposite { sine.neg() } else { sine })
                    } else {
                        (index == *cos).then(|| Polynomial::variable(*other_cos))
                    }
                };
                if p.replaced(&equal, &self.variables).is_zero() {
                    let (angle, value) = self.variables.angle_of(*sin)?;
                    let (other, other_value) = self.variables.angle_of(*other_sin)?;
                    // equal but for whole turns
                    let (value, other_value) = (value?, other_value?);
                    let turns = if opposite {
                        value.add(other_value)
                    } else {
                        value.sub(other_value)
                    };
                    let mut terms = vec![(opposite, other)];
                    if !turns.is_zero() {
                        let turns = (false, Coefficient::from(&turns));
                        terms.insert(usize::from(!opposite), turns);
                    }
                    return Some(format!("{angle} = {}", Coefficient::sum(terms)));
                }
            }
        }
        let [(sin, cos)] = angles[..] else {
            return None;
        };
        let alone = used.iter().all(|index| [sin, cos].contains(index));
        let (angle, value) = self.variables.angle_of(sin).filter(|_| alone)?;
        Some(format!("{angle} = {}", value?))
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
        self.combined(value, [a, b], Ratio::mul)
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
        Some(self.combined(value, [a, b], Ratio::div))
    }

    /// The expression for printing; the value if the expression was dropped as too long.
    pub fn coefficient(&self, a: &Element) -> Coefficient {
        match &a.form {
            Form::Expression(ratio) => print::ratio(ratio, &self.variables),
            Form::Constant | Form::TooLong { .. } => (&a.value).into(),
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
