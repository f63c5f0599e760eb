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

/// The largest number of parts of an angle.
const MAX_PARTS: u64 = 1_000_000;
/// The largest size of a name's expression with those of other names put in.
const MAX_SIZE: u64 = 10_000;

/// A named angle, and 1 rad, are so many equal parts: the numbers of a point are the `exp(i part)`, and all angles
/// multiples of the parts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts {
    named: u64,
    radian: u64,
}

/// The names of the geometry, and what is free of them: equal values stay equal, as they are where factors are
/// recognised.
#[derive(Debug)]
pub(super) struct Names<'a> {
    spec: &'a Spec,
    pub(super) groups: Vec<Group>,
}

impl<'a> Names<'a> {
    /// `None` if an expression is very long with those of other names put in.
    pub(super) fn new(spec: &'a Spec, groups: Vec<Group>) -> Option<Self> {
        let mut sizes: BTreeMap<&str, u64> = BTreeMap::new();
        for (name, quantity) in &spec.geometry {
            let size = size(&quantity.expr, &sizes);
            if size > MAX_SIZE {
                return None;
            }
            sizes.insert(&name.value, size);
        }
        Some(Names { spec, groups })
    }

    /// The parts of which all angles are multiples: those of placements, of the arguments of sines, of constants of
    /// the branch and of factors; `None` if one is too small.
    ///
    /// - `turns`: angles of the spec;
    /// - `constants`: in rad;
    /// - `others`: expressions in which sines may occur.
    pub(super) fn parts<'e>(
        &self,
        turns: impl Iterator<Item = &'e Expr>,
        constants: impl Iterator<Item = &'e RBig>,
        others: impl Iterator<Item = &'e Expr>,
    ) -> Option<Parts> {
        let mut angles = Vec::new();
        for turn in turns {
            angles.push(Angle::read(self, turn)?);
        }
        for expr in others {
            self.arguments(expr, &mut angles)?;
        }
        for (_, quantity) in &self.spec.geometry {
            self.arguments(&quantity.expr, &mut angles)?;
        }
        let of_groups = angles.iter().flat_map(|angle| angle.groups.values());
        let of_radians = angles.iter().map(|angle| angle.radians.clone());
        Some(Parts {
            named: common_parts(of_groups.cloned())?,
            radian: common_parts(of_radians.chain(constants.cloned()))?,
        })
    }

    /// Adds the arguments of the sines of an expression.
    fn arguments(&self, expr: &Expr, found: &mut Vec<Angle>) -> Option<()> {
        match expr {
            Expr::Number(_) | Expr::Pi | Expr::Name(_) => {}
            Expr::Call(Function::Sin | Function::Cos | Function::Tan, a) => {
                found.push(Angle::read(self, a)?);
            }
            Expr::Neg(a) | Expr::Call(_, a) => self.arguments(a, found)?,
            Expr::Add(a, b)
            | Expr::Sub(a, b)
            | Expr::Mul(a, b)
            | Expr::Div(a, b)
            | Expr::Pow(a, b) => {
                self.arguments(a, found)?;
                self.arguments(b, found)?;
            }
        }
        Some(())
    }

    /// A bound on the degrees of numerator and denominator of an expression in the numbers of a point.
    pub(super) fn degree(&self, expr: &Expr, parts: Parts) -> f64 {
        let of = |e: &Expr| self.degree(e, parts);
        match expr {
            Expr::Number(number) => {
                let terms = number.exact_terms().unwrap_or_default();
                let powers = terms.iter().map(|(_, _, power)| f64::from(power.abs()));
                powers.sum()
            }
            Expr::Pi => 1.0,
            Expr::Name(name) => match (self.group(name), self.quantity(name)) {
                (None, Some(quantity)) => of(&quantity.expr),
                _ => 1.0,
            },
            Expr::Add(a, b) | Expr::Sub(a, b) | Expr::Mul(a, b) | Expr::Div(a, b) => of(a) + of(b),
            Expr::Pow(a, b) => {
                let power = value(b, &[]).map_or(1.0, |power| power.to_f64().abs());
                of(a) * power.max(1.0)
            }
            Expr::Call(Function::Sin | Function::Cos | Function::Tan, a) => {
                4.0 * self.degree_of_angle(a, parts)
            }
            Expr::Neg(a) | Expr::Call(_, a) => of(a),
        }
    }

    /// The sum of the powers of a point's numbers in the `exp(i angle)` of an angle.
    pub(super) fn degree_of_angle(&self, angle: &Expr, parts: Parts) -> f64 {
        Angle::read(self, angle).map_or(f64::INFINITY, |angle| {
            let size = |x: &RBig| x.to_f64().value().abs();
            let groups = angle.groups.values().map(size).sum::<f64>();
            groups * parts.named as f64 + size(&angle.radians) * parts.radian as f64
        })
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
                (Some((place, _)), _) if all => {
                    found.insert(place);
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

impl Parts {
    /// The parts of 1 rad.
    pub(super) fn radian(self) -> f64 {
        self.radian as f64
    }
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
    /// For each group of names its length, or the `exp(i part)` of its angle.
    pub(super) values: Vec<Residue<P>>,
    /// The `exp(i part)` of 1 rad.
    pub(super) radian: Residue<P>,
    pub(super) parts: Parts,
}

impl<const P: u64> Point<'_, P> {
    /// The image of `exp(i angle)` of an angle that is these multiples of pi and of 1 rad.
    pub(super) fn unit(&self, pi: &RBig, radians: &RBig) -> Option<Residue<P>> {
        let parts = whole(radians, self.parts.radian)?;
        Some(self.constants.turned(pi)? * self.radian.signed_power(parts))
    }

    fn sin_cos_of(&self, expr: &Expr) -> Option<[Residue<P>; 2]> {
        let angle = Angle::read(self.names, expr)?;
        let mut unit = self.unit(&angle.pi, &angle.radians)?;
        for (group, factor) in &angle.groups {
            let part = self.values.get(*group)?;
            unit = unit * part.signed_power(whole(factor, self.parts.named)?);
        }
        self.constants.sin_cos(unit)
    }

    pub(super) fn value(&self, expr: &Expr) -> Option<Residue<P>> {
        Some(match expr {
            Expr::Number(number) => self.constants.number(number)?,
            Expr::Pi => self.constants.number(&Number::pi())?,
            Expr::Name(name) => {
                if let Some((group, negative)) = self.names.group(name) {
                    // the number given for an angle is no image of the angle itself
                    let is_length = !self.names.groups.get(group)?.is_angle;
                    let length = self.values.get(group).filter(|_| is_length)?;
                    if negative { -*length } else { *length }
                } else {
                    let quantity = self.names.quantity(name)?;
                    if mentions_names(&quantity.expr) {
                        self.value(&quantity.expr)?
                    } else {
                        self.constants.number(&quantity.value)?
                    }
                }
            }
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

/// The least number of parts of which all fractions are multiples; `None` if it is large.
fn common_parts(fractions: impl Iterator<Item = RBig>) -> Option<u64> {
    let mut parts = 1_u64;
    for fraction in fractions {
        let other = u64::try_from(fraction.denominator().clone()).ok()?;
        let (mut x, mut y) = (parts, other);
        while y != 0 {
            (x, y) = (y, x % y);
        }
        parts = (parts / x)
            .checked_mul(other)
            .filter(|parts| *parts <= MAX_PARTS)?;
    }
    Some(parts)
}

/// The number of parts of an expression with those of names put in.
fn size(expr: &Expr, sizes: &BTreeMap<&str, u64>) -> u64 {
    let of = |e: &Expr| size(e, sizes);
    let within = match expr {
        Expr::Number(_) | Expr::Pi => 0,
        Expr::Name(name) => sizes.get(name.as_str()).copied().unwrap_or(0),
        Expr::Neg(a) | Expr::Call(_, a) => of(a),
        Expr::Add(a, b) | Expr::Sub(a, b) | Expr::Mul(a, b) | Expr::Div(a, b) | Expr::Pow(a, b) => {
            of(a).saturating_add(of(b))
        }
    };
    within.saturating_add(1)
}

/// A factor as an expression of the spec's language.
pub(super) fn expression(coefficient: &Coefficient) -> Option<Expr> {
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
