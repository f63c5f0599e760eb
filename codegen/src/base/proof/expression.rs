//! Values of the spec's expressions modulo a prime, with names of the geometry as free numbers.

use std::collections::{BTreeMap, BTreeSet};

use dashu_int::IBig;
use dashu_ratio::RBig;

use crate::base::Coefficient;
use crate::base::geometry::mentions_names;
use crate::base::null_completion::scaled_geometry::{Group, value};
use crate::spec::{Expr, Function, Quantity, Spec};
use crate::sym::Number;

use super::mechanism::Values;
use super::residue::{Constants, Residue};

/// The numbers given for names are images of these parts of the named angles' `exp(i angle)`.
const PARTS_OF_ANGLES: u64 = 5040;
/// The same for angles that are numbers in rad, which are multiples of this part.
const PARTS_OF_RADIANS: u64 = 1_000_000_000_000;

/// The names of the geometry, and what is free of them: equal values stay equal, as they are where factors are
/// recognised.
#[derive(Debug)]
pub(super) struct Names<'a> {
    spec: &'a Spec,
    pub(super) groups: Vec<Group>,
}

impl<'a> Names<'a> {
    pub(super) fn new(spec: &'a Spec, groups: Vec<Group>) -> Self {
        Names { spec, groups }
    }

    fn quantity(&self, name: &str) -> Option<&'a Quantity> {
        let found = self.spec.geometry.iter().find(|(n, _)| n.value == name);
        found.map(|(_, quantity)| quantity)
    }

    /// The group of a name, and whether its value is the negative of the group's.
    fn group(&self, name: &str) -> Option<(usize, bool)> {
        let has = |group: &Group| group.members().any(|member| member == name);
        let place = self.groups.iter().position(has)?;
        let own = &self.quantity(name)?.value;
        Some((place, *own != self.groups.get(place)?.value))
    }

    /// The groups of lengths in which all expressions of the spec are linear, with their places.
    pub(super) fn linear(&self, nonlinear: &[usize]) -> impl Iterator<Item = (usize, &Group)> {
        let all = self.groups.iter().enumerate();
        all.filter(|(place, group)| !group.is_angle && !nonlinear.contains(place))
    }

    /// The groups of lengths in which some expression of the spec is not linear, as places in `groups`.
    pub(super) fn nonlinear(&self, quantities: &[&Quantity]) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        for quantity in quantities {
            self.note_nonlinear(&quantity.expr, false, &mut found);
        }
        found
    }

    /// Adds the groups of an expression that are not linear in it; with `all`, every one.
    fn note_nonlinear(&self, expr: &Expr, all: bool, found: &mut BTreeSet<usize>) {
        match expr {
            Expr::Number(_) | Expr::Pi => {}
            Expr::Name(name) => match (self.group(name), self.quantity(name)) {
                (Some((place, _)), _) => {
                    if all {
                        found.insert(place);
                    }
                }
                (None, Some(quantity)) if mentions_names(&quantity.expr) => {
                    self.note_nonlinear(&quantity.expr, all, found);
                }
                _ => {}
            },
            Expr::Neg(a) => self.note_nonlinear(a, all, found),
            Expr::Add(a, b) | Expr::Sub(a, b) => {
                self.note_nonlinear(a, all, found);
                self.note_nonlinear(b, all, found);
            }
            Expr::Mul(a, b) => {
                let both = all || (mentions_names(a) && mentions_names(b));
                self.note_nonlinear(a, both, found);
                self.note_nonlinear(b, both, found);
            }
            Expr::Div(a, b) => {
                let inexact = all || mentions_names(b);
                self.note_nonlinear(a, inexact, found);
                self.note_nonlinear(b, true, found);
            }
            Expr::Pow(a, _) | Expr::Call(_, a) => self.note_nonlinear(a, true, found),
        }
    }
}

/// An angle: a multiple of pi, a number in rad, and multiples of groups of names.
#[derive(Clone, Debug, Default)]
struct Angle {
    pi: RBig,
    radians: RBig,
    groups: BTreeMap<usize, RBig>,
}

impl Angle {
    fn number(number: &Number) -> Option<Self> {
        let mut angle = Angle::default();
        for term in number.exact_terms()? {
            match term {
                (coefficient, 1, 0) => angle.radians = coefficient,
                (coefficient, 1, 1) => angle.pi = coefficient,
                _ => return None,
            }
        }
        Some(angle)
    }

    /// The value of a form that is a fraction alone.
    fn as_fraction(&self) -> Option<&RBig> {
        (self.pi.is_zero() && self.groups.is_empty()).then_some(&self.radians)
    }

    fn scaled(mut self, factor: &RBig) -> Self {
        self.pi *= factor;
        self.radians *= factor;
        for own in self.groups.values_mut() {
            *own *= factor;
        }
        self
    }

    fn plus(mut self, other: Self) -> Self {
        self.pi += other.pi;
        self.radians += other.radians;
        for (group, factor) in other.groups {
            *self.groups.entry(group).or_default() += factor;
        }
        self.groups.retain(|_, factor| !factor.is_zero());
        self
    }

    fn read(names: &Names<'_>, expr: &Expr) -> Option<Self> {
        let read = |e: &Expr| Angle::read(names, e);
        let minus = -RBig::ONE;
        Some(match expr {
            Expr::Number(number) => Angle::number(number)?,
            Expr::Pi => Angle::number(&Number::pi())?,
            Expr::Name(name) => match names.group(name) {
                Some((group, negative)) if names.groups.get(group)?.is_angle => {
                    let factor = if negative { minus } else { RBig::ONE };
                    Angle {
                        groups: BTreeMap::from([(group, factor)]),
                        ..Angle::default()
                    }
                }
                _ => {
                    let quantity = names.quantity(name)?;
                    if mentions_names(&quantity.expr) {
                        read(&quantity.expr)?
                    } else {
                        Angle::number(&quantity.value)?
                    }
                }
            },
            Expr::Neg(a) => read(a)?.scaled(&minus),
            Expr::Add(a, b) => read(a)?.plus(read(b)?),
            Expr::Sub(a, b) => read(a)?.plus(read(b)?.scaled(&minus)),
            Expr::Mul(a, b) => {
                let (a, b) = (read(a)?, read(b)?);
                match (a.as_fraction().cloned(), b.as_fraction().cloned()) {
                    (Some(factor), _) => b.scaled(&factor),
                    (None, Some(factor)) => a.scaled(&factor),
                    (None, None) => return None,
                }
            }
            Expr::Div(a, b) => {
                let below = read(b)?.as_fraction().filter(|x| !x.is_zero())?.clone();
                read(a)?.scaled(&(RBig::ONE / below))
            }
            Expr::Call(Function::Deg, a) => {
                let degrees = read(a)?.as_fraction()?.clone();
                Angle {
                    pi: degrees / RBig::from(180),
                    ..Angle::default()
                }
            }
            Expr::Pow(..) | Expr::Call(..) => return None,
        })
    }
}

/// Values of names modulo a prime.
#[derive(Debug)]
pub(super) struct Point<'a, const P: u64> {
    pub(super) names: &'a Names<'a>,
    pub(super) constants: Constants<P>,
    /// For each group of names its length, or `exp(i angle)` of a part of its angle.
    pub(super) values: Vec<Residue<P>>,
    /// `exp(i angle)` of a part of 1 rad.
    pub(super) radian: Residue<P>,
}

impl<const P: u64> Point<'_, P> {
    /// The image of `exp(i angle)` of an angle that is these multiples of pi and of 1 rad.
    pub(super) fn unit(&self, pi: &RBig, radians: &RBig) -> Option<Residue<P>> {
        let parts = whole(radians, PARTS_OF_RADIANS)?;
        Some(self.constants.turned(pi)? * self.radian.signed_power(parts))
    }

    fn sin_cos_of(&self, expr: &Expr) -> Option<[Residue<P>; 2]> {
        let angle = Angle::read(self.names, expr)?;
        let mut unit = self.unit(&angle.pi, &angle.radians)?;
        for (group, factor) in &angle.groups {
            let part = self.values.get(*group)?;
            unit = unit * part.signed_power(whole(factor, PARTS_OF_ANGLES)?);
        }
        self.constants.sin_cos(unit)
    }

    /// The value of a factor of a direction.
    pub(super) fn coefficient(&self, coefficient: &Coefficient) -> Option<Residue<P>> {
        self.value(&expression(coefficient)?)
    }

    fn value(&self, expr: &Expr) -> Option<Residue<P>> {
        Some(match expr {
            Expr::Number(number) => self.constants.number(number)?,
            Expr::Pi => self.constants.number(&Number::pi())?,
            Expr::Name(name) => match self.names.group(name) {
                Some((group, negative)) => {
                    // the number given for an angle is no image of the angle itself
                    let is_length = !self.names.groups.get(group)?.is_angle;
                    let length = self.values.get(group).filter(|_| is_length)?;
                    if negative { -*length } else { *length }
                }
                None => {
                    let quantity = self.names.quantity(name)?;
                    if mentions_names(&quantity.expr) {
                        self.value(&quantity.expr)?
                    } else {
                        self.constants.number(&quantity.value)?
                    }
                }
            },
            Expr::Neg(a) => -self.value(a)?,
            Expr::Add(a, b) => self.value(a)? + self.value(b)?,
            Expr::Sub(a, b) => self.value(a)? - self.value(b)?,
            Expr::Mul(a, b) => self.value(a)? * self.value(b)?,
            Expr::Div(a, b) => self.value(a)? * self.value(b)?.inverse()?,
            Expr::Pow(a, b) => {
                let exponent = value(b, &[])?.as_i64();
                match exponent {
                    Some(exponent) => {
                        let base = self.value(a)?;
                        if exponent < 0 {
                            base.inverse()?.signed_power(-exponent)
                        } else {
                            base.signed_power(exponent)
                        }
                    }
                    None => self.root(a)?,
                }
            }
            Expr::Call(Function::Sqrt, a) => self.root(a)?,
            Expr::Call(Function::Sin, a) => self.sin_cos_of(a)?[0],
            Expr::Call(Function::Cos, a) => self.sin_cos_of(a)?[1],
            Expr::Call(Function::Tan, a) => {
                let [sin, cos] = self.sin_cos_of(a)?;
                sin * cos.inverse()?
            }
            Expr::Call(..) => return None,
        })
    }

    /// The square root of a constant: that of an expression in names has two images, of which none is the right one.
    fn root(&self, expr: &Expr) -> Option<Residue<P>> {
        if mentions_names(expr) {
            return None;
        }
        self.constants.number(&value(expr, &[])?.sqrt()?)
    }
}

impl<const P: u64> Values<Residue<P>> for Point<'_, P> {
    fn length(&self, quantity: &Quantity) -> Option<Residue<P>> {
        self.value(&quantity.expr)
    }

    fn sin_cos(&self, quantity: &Quantity) -> Option<[Residue<P>; 2]> {
        self.sin_cos_of(&quantity.expr)
    }
}

/// A fraction times a number of parts, if that is whole.
fn whole(fraction: &RBig, parts: u64) -> Option<i64> {
    let product = fraction * RBig::from(parts);
    let product: IBig = product.is_int().then(|| product.numerator().clone())?;
    i64::try_from(product).ok()
}

/// A factor as an expression of the spec's language.
fn expression(coefficient: &Coefficient) -> Option<Expr> {
    let boxed = |c: &Coefficient| expression(c).map(Box::new);
    Some(match coefficient {
        Coefficient::Number(digits) => Expr::Number(Number::parse_decimal(digits)?),
        Coefficient::Name(name) if name == "pi" => Expr::Pi,
        Coefficient::Name(name) => Expr::Name(name.clone()),
        Coefficient::Neg(a) => Expr::Neg(boxed(a)?),
        Coefficient::Sum(terms) => {
            let mut sum = Expr::Number(Number::zero());
            for (minus, term) in terms {
                let (left, right) = (Box::new(sum), boxed(term)?);
                sum = if *minus {
                    Expr::Sub(left, right)
                } else {
                    Expr::Add(left, right)
                };
            }
            sum
        }
        Coefficient::Product(factors) => {
            let mut product = Expr::Number(Number::one());
            for factor in factors {
                product = Expr::Mul(Box::new(product), boxed(factor)?);
            }
            product
        }
        Coefficient::Quotient(a, b) => Expr::Div(boxed(a)?, boxed(b)?),
        Coefficient::Power(a, b) => Expr::Pow(boxed(a)?, boxed(b)?),
        Coefficient::Call(function, a) => Expr::Call(*function, boxed(a)?),
    })
}
