//! Quotients of polynomials in lowest terms.

use crate::sym::Number;

use super::polynomial::{self, Monomial};
use super::{Polynomial, Variables};

/// A quotient of polynomials; the denominator's leading coefficient is 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Ratio {
    numerator: Polynomial,
    denominator: Polynomial,
}

impl Ratio {
    pub(super) fn zero() -> Self {
        Ratio::constant(Number::zero())
    }

    pub(super) fn constant(value: Number) -> Self {
        Ratio {
            numerator: Polynomial::constant(value),
            denominator: Polynomial::constant(Number::one()),
        }
    }

    pub(super) fn variable(index: usize) -> Self {
        Ratio {
            numerator: Polynomial::variable(index),
            denominator: Polynomial::constant(Number::one()),
        }
    }

    /// The quotient of two products of variables without common factors.
    pub(super) fn of_monomials(above: Monomial, below: Monomial) -> Self {
        Ratio {
            numerator: Polynomial::from_monomial(above),
            denominator: Polynomial::from_monomial(below),
        }
    }

    /// The products of variables above and below the line.
    pub(super) fn monomials(&self) -> [Vec<Monomial>; 2] {
        [&self.numerator, &self.denominator].map(|p| p.terms.keys().cloned().collect())
    }

    /// The value for these values of the variables.
    pub(super) fn value<'n>(&self, of: &dyn Fn(usize) -> Option<&'n Number>) -> Option<Number> {
        let value = |p: &Polynomial| -> Option<Number> {
            let mut sum = Number::zero();
            for (monomial, factor) in &p.terms {
                let mut term = factor.clone();
                for (index, power) in monomial.iter().enumerate().filter(|(_, power)| **power > 0) {
                    term = term.mul(&of(index)?.powi(i64::from(*power))?);
                }
                sum = sum.add(&term);
            }
            Some(sum)
        };
        value(&self.numerator)?.div(&value(&self.denominator)?)
    }

    /// The product with a number other than 0.
    pub(super) fn scaled(&self, factor: &Number) -> Self {
        Ratio {
            numerator: self.numerator.scaled(factor),
            denominator: self.denominator.clone(),
        }
    }

    /// The value, if the quotient is a constant.
    pub(super) fn as_constant(&self) -> Option<Number> {
        let denominator = self.denominator.as_constant()?;
        self.numerator.as_constant()?.div(&denominator)
    }

    pub(super) fn is_zero(&self) -> bool {
        self.numerator.is_zero()
    }

    pub(crate) fn numerator(&self) -> &Polynomial {
        &self.numerator
    }

    pub(crate) fn denominator(&self) -> &Polynomial {
        &self.denominator
    }

    /// A measure of the length of the expression; 0 for constants.
    pub(super) fn weight(&self) -> usize {
        let size = |p: &Polynomial| -> usize {
            p.terms
                .keys()
                .map(|m| m.iter().map(|e| *e as usize).sum::<usize>())
                .sum::<usize>()
                + p.terms.len().saturating_sub(1)
        };
        // denominators count more, since they make all further results longer
        size(&self.numerator) + 3 * size(&self.denominator)
    }

    pub(super) fn neg(&self) -> Self {
        Ratio {
            numerator: self.numerator.neg(),
            denominator: self.denominator.clone(),
        }
    }

    /// The quotient in lowest terms; `None` if it is too long.
    fn lowest(
        numerator: Polynomial,
        denominator: Polynomial,
        variables: &Variables,
    ) -> Option<Self> {
        if numerator.is_zero() {
            return Some(Ratio::zero());
        }
        if numerator.too_long(variables) || denominator.too_long(variables) {
            return None;
        }
        let (mut n, mut d) = (numerator, denominator);
        if d.as_constant().is_none() {
            let common = polynomial::shared(&n.common_monomial(), &d.common_monomial());
            if !common.is_empty() {
                (n, d) = (n.without(&common), d.without(&common));
            }
            // without remainder: no search for a common divisor is needed
            if let Some(whole) = n.divided(&d) {
                (n, d) = (whole, Polynomial::constant(Number::one()));
            }
        }
        if d.as_constant().is_none() {
            let common = n.common_divisor(&d);
            if common.as_constant().is_none()
                && let (Some(nn), Some(dd)) = (n.divided(&common), d.divided(&common))
            {
                (n, d) = (nn, dd);
            }
        }
        // common factors that are sines, hidden because their squares are written with cosines
        for sine in variables.sines() {
            // test the denominator first: it is short, and seldom divisible
            while d.as_constant().is_none()
                && let Some(dd) = d.divided_by_sine(sine, variables)
                && let Some(nn) = n.divided_by_sine(sine, variables)
            {
                (n, d) = (nn, dd);
            }
        }
        let lead = d.leading().map(|(_, c)| c.clone())?;
        if !lead.is_one() {
            let inverse = Number::one().div(&lead)?;
            n = n.scaled(&inverse);
            d = d.scaled(&inverse);
        }
        Some(Ratio {
            numerator: n,
            denominator: d,
        })
    }

    pub(super) fn add(&self, other: &Self, variables: &Variables) -> Option<Self> {
        if self.denominator == other.denominator {
            let sum = self.numerator.add(&other.numerator);
            return Ratio::lowest(sum, self.denominator.clone(), variables);
        }
        let left = self.numerator.mul(&other.denominator, variables);
        let right = other.numerator.mul(&self.denominator, variables);
        let bottom = self.denominator.mul(&other.denominator, variables);
        Ratio::lowest(left.add(&right), bottom, variables)
    }

    pub(super) fn mul(&self, other: &Self, variables: &Variables) -> Option<Self> {
        Ratio::lowest(
            self.numerator.mul(&other.numerator, variables),
            self.denominator.mul(&other.denominator, variables),
            variables,
        )
    }

    pub(super) fn div(&self, other: &Self, variables: &Variables) -> Option<Self> {
        if other.is_zero() {
            return None;
        }
        Ratio::lowest(
            self.numerator.mul(&other.denominator, variables),
            self.denominator.mul(&other.numerator, variables),
            variables,
        )
    }
}
