//! Exact constants: sums of `rational * sqrt(squarefree integer) * pi^k`.
//!
//! Square roots of distinct squarefree integers are linearly independent over the rationals and pi
//! is transcendental, so such a sum is zero only if it has no terms: the zero test is exact.

mod integers;

use core::cmp::Ordering;

use dashu_int::ops::{BitTest, SquareRoot, UnsignedAbs};
use dashu_int::{IBig, Sign, UBig};
use dashu_ratio::RBig;

use integers::{coprime_atoms, gcd, square_part};

use super::big_float::{BigFloat, PRECISION, nearest_f64, pi_fixed, shifted, signed};

/// Largest number of terms of an exact sum; larger sums become inexact numbers.
const MAX_TERMS: usize = 64;
/// Largest number of bits of a coefficient's numerator or denominator.
const MAX_BITS: usize = 4096;
/// Largest absolute value of an exponent of pi.
const MAX_PI_POWER: u32 = 64;
/// Largest number of independent roots of a divisor: division by a sum conjugates once per
/// independent root, and each time doubles the sum.
const MAX_CONJUGATIONS: usize = 4;

/// The term `coefficient * sqrt(radicand) * pi^pi_power`; the radicand is squarefree, the
/// coefficient nonzero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Term {
    pub(super) pi_power: i32,
    pub(super) radicand: u128,
    pub(super) coefficient: RBig,
}

impl Term {
    fn key(&self) -> (i32, u128) {
        (self.pi_power, self.radicand)
    }

    pub(super) fn is_negative(&self) -> bool {
        self.coefficient.sign() == Sign::Negative
    }
}

/// A sum of terms, ordered by the power of pi, then by the radicand; the empty sum is zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Surd {
    terms: Vec<Term>,
}

impl Surd {
    pub(super) fn zero() -> Self {
        Self { terms: Vec::new() }
    }

    /// The sum of terms that are in order and fit [`Term`].
    pub(super) fn of_terms(terms: Vec<Term>) -> Self {
        Self { terms }
    }

    pub(super) fn rational(value: RBig) -> Self {
        Self::monomial(value, 1, 0)
    }

    /// A single term; the radicand must be squarefree.
    pub(super) fn monomial(coefficient: RBig, radicand: u128, pi_power: i32) -> Self {
        let term = Term {
            pi_power,
            radicand,
            coefficient,
        };
        let terms = if term.coefficient.is_zero() {
            Vec::new()
        } else {
            vec![term]
        };
        Self { terms }
    }

    pub(super) fn terms(&self) -> &[Term] {
        &self.terms
    }

    pub(super) fn is_zero(&self) -> bool {
        self.terms.is_empty()
    }

    pub(super) fn as_rational(&self) -> Option<RBig> {
        match self.terms.as_slice() {
            [] => Some(RBig::ZERO),
            [term] if term.key() == (0, 1) => Some(term.coefficient.clone()),
            _ => None,
        }
    }

    pub(super) fn is_one(&self) -> bool {
        matches!(self.terms.as_slice(), [term] if term.key() == (0, 1) && term.coefficient.is_one())
    }

    /// `Some(r)` if this is exactly `r * pi`.
    pub(super) fn pi_multiple(&self) -> Option<RBig> {
        match self.terms.as_slice() {
            [] => Some(RBig::ZERO),
            [term] if term.key() == (1, 1) => Some(term.coefficient.clone()),
            _ => None,
        }
    }

    /// The sign, if all terms have the same one.
    pub(super) fn obvious_sign(&self) -> Option<Ordering> {
        let Some(first) = self.terms.first() else {
            return Some(Ordering::Equal);
        };
        let negative = first.is_negative();
        if self.terms.iter().any(|term| term.is_negative() != negative) {
            None
        } else if negative {
            Some(Ordering::Less)
        } else {
            Some(Ordering::Greater)
        }
    }

    pub(super) fn neg(&self) -> Self {
        let mut result = self.clone();
        for term in &mut result.terms {
            term.coefficient = -&term.coefficient;
        }
        result
    }

    pub(super) fn add(&self, other: &Self) -> Option<Self> {
        self.sum(other).bounded()
    }

    /// The order of two values, however close they are.
    pub(super) fn cmp(&self, other: &Self) -> Ordering {
        let difference = self.sum(&other.neg());
        difference.obvious_sign().unwrap_or_else(|| {
            if difference.approximate(1).0 == Sign::Negative {
                Ordering::Less
            } else {
                Ordering::Greater
            }
        })
    }

    fn sum(&self, other: &Self) -> Self {
        let mut terms = Vec::with_capacity(self.terms.len() + other.terms.len());
        let (mut left, mut right) = (self.terms.iter().peekable(), other.terms.iter().peekable());
        loop {
            let order = match (left.peek(), right.peek()) {
                (Some(a), Some(b)) => a.key().cmp(&b.key()),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (None, None) => return Self { terms },
            };
            let from_left = if order.is_le() { left.next() } else { None };
            let from_right = if order.is_ge() { right.next() } else { None };
            match (from_left, from_right) {
                (Some(a), Some(b)) => {
                    let coefficient = &a.coefficient + &b.coefficient;
                    if !coefficient.is_zero() {
                        terms.push(Term { coefficient, ..*a });
                    }
                }
                (a, b) => terms.extend(a.or(b).cloned()),
            }
        }
    }

    pub(super) fn mul(&self, other: &Self) -> Option<Self> {
        if self.terms.len() * other.terms.len() > MAX_TERMS * MAX_TERMS {
            return None;
        }
        let mut products = Vec::with_capacity(self.terms.len() * other.terms.len());
        for a in &self.terms {
            for b in &other.terms {
                let common = gcd(a.radicand, b.radicand);
                let radicand = (a.radicand / common).checked_mul(b.radicand / common)?;
                let mut coefficient = &a.coefficient * &b.coefficient;
                if common > 1 {
                    coefficient = coefficient * UBig::from(common);
                }
                products.push(Term {
                    pi_power: a.pi_power.checked_add(b.pi_power)?,
                    radicand,
                    coefficient,
                });
            }
        }
        products.sort_by_key(Term::key);
        let mut terms: Vec<Term> = Vec::with_capacity(products.len());
        for product in products {
            match terms.last_mut() {
                Some(last) if last.key() == product.key() => {
                    last.coefficient += product.coefficient;
                }
                _ => terms.push(product),
            }
        }
        terms.retain(|term| !term.coefficient.is_zero());
        Self { terms }.bounded()
    }

    /// The reciprocal of a single term, or of a sum with one common power of pi and few independent
    /// roots; `None` for other sums.
    pub(super) fn reciprocal(&self) -> Option<Self> {
        let first = self.terms.first()?;
        if self
            .terms
            .iter()
            .any(|term| term.pi_power != first.pi_power)
        {
            return None;
        }
        let pi_power = -first.pi_power;
        let mut divisor = self.times_pi_power(pi_power);
        let atoms = coprime_atoms(self.terms.iter().map(|term| term.radicand));
        let mut numerator = Self::rational(RBig::ONE);
        if self.terms.len() == 1 {
            numerator = Self::monomial(RBig::ONE, first.radicand, 0);
            divisor = divisor.mul(&numerator)?;
        } else if atoms.len() > MAX_CONJUGATIONS {
            return None;
        } else {
            for atom in atoms {
                // (A + B sqrt(atom)) (A - B sqrt(atom)) has no sqrt(atom), and is not zero
                let conjugate = divisor.conjugate(atom);
                if conjugate != divisor {
                    numerator = numerator.mul(&conjugate)?;
                    divisor = divisor.mul(&conjugate)?;
                }
            }
        }
        let divisor = divisor.as_rational().filter(|value| !value.is_zero())?;
        numerator.mul(&Self::monomial(RBig::ONE / divisor, 1, pi_power))
    }

    /// The nonnegative root, if it is such a sum too and can be found quickly. The value must not
    /// be negative.
    pub(super) fn sqrt(&self) -> Option<Self> {
        let Some(first) = self.terms.first() else {
            return Some(Self::zero());
        };
        let pi_power = first.pi_power;
        if pi_power % 2 != 0 || self.terms.iter().any(|term| term.pi_power != pi_power) {
            return None;
        }
        let root = match self.terms.as_slice() {
            [term] if term.radicand == 1 => sqrt_rational(&term.coefficient)?,
            // sqrt(a + b sqrt(c)) = sqrt((a + d) / 2) + sign(b) sqrt((a - d) / 2), d = sqrt(a^2 -
            // b^2 c)
            [a, b] if a.radicand == 1 && !a.is_negative() => {
                let a = &a.coefficient;
                let norm = a * a - &b.coefficient * &b.coefficient * UBig::from(b.radicand);
                let d = sqrt_rational(&norm)?.as_rational()?;
                let half = RBig::from_parts(IBig::ONE, UBig::from(2u8));
                let large = sqrt_rational(&((a + &d) * &half))?;
                let small = sqrt_rational(&((a - &d) * &half))?;
                if b.is_negative() {
                    large.add(&small.neg())?
                } else {
                    large.add(&small)?
                }
            }
            _ => return None,
        };
        root.times_pi_power(pi_power / 2).bounded()
    }

    /// The value as `(sign, magnitude, exponent)` with a relative error of at most 2^-bits.
    pub(super) fn approximate(&self, bits: usize) -> (Sign, UBig, i64) {
        const GUARD: usize = 32;
        // largest number of bits that are added for terms that cancel
        const MAX_EXTRA: usize = 1 << 17;
        let Some(top) = self.terms.iter().map(top_of_term).max() else {
            return (Sign::Positive, UBig::ZERO, 0);
        };
        let mut extra = 0;
        loop {
            let scale = signed(bits + GUARD + extra) - top;
            let working = bits + 2 * GUARD + extra;
            let mut sum = IBig::ZERO;
            for term in &self.terms {
                let magnitude = term_at_scale(term, scale, working);
                sum += IBig::from_parts(term.coefficient.sign(), magnitude);
            }
            let (sign, magnitude) = sum.into_parts();
            let known = magnitude.bit_len();
            // terms that cancel have to be computed with more bits
            if known >= bits + GUARD / 2 || self.terms.len() == 1 || extra > MAX_EXTRA {
                return (sign, magnitude, -scale);
            }
            extra = 2 * extra + (bits + GUARD - known);
        }
    }

    pub(super) fn to_real(&self) -> BigFloat {
        let (sign, magnitude, exponent) = self.approximate(PRECISION);
        BigFloat::new(sign, magnitude, exponent)
    }

    /// The `f64` nearest to the exact value, ties to even.
    pub(super) fn to_f64(&self) -> f64 {
        if let Some(value) = self.as_rational() {
            return rational_to_f64(&value);
        }
        let mut bits = 2 * 64;
        loop {
            let (sign, magnitude, exponent) = self.approximate(bits);
            // an irrational value is never midway between two `f64`: enough bits always decide
            let slack = UBig::ONE << (magnitude.bit_len().saturating_sub(bits));
            let above = nearest_f64(sign, &(&magnitude + &slack), exponent, false);
            if magnitude <= slack {
                return above;
            }
            let below = nearest_f64(sign, &(magnitude - slack), exponent, false);
            if above.to_bits() == below.to_bits() || bits > 1 << 14 {
                return above;
            }
            bits *= 2;
        }
    }

    fn times_pi_power(&self, power: i32) -> Self {
        let mut result = self.clone();
        for term in &mut result.terms {
            term.pi_power += power;
        }
        result
    }

    /// The sum with `sqrt(atom)` replaced by its negative.
    fn conjugate(&self, atom: u128) -> Self {
        let mut result = self.clone();
        for term in &mut result.terms {
            if term.radicand.is_multiple_of(atom) {
                term.coefficient = -&term.coefficient;
            }
        }
        result
    }

    /// The sum itself; `None` if it is too large to store exactly.
    fn bounded(self) -> Option<Self> {
        let fits = |term: &Term| {
            term.coefficient.numerator().bit_len() <= MAX_BITS
                && term.coefficient.denominator().bit_len() <= MAX_BITS
                && term.pi_power.unsigned_abs() <= MAX_PI_POWER
        };
        (self.terms.len() <= MAX_TERMS && self.terms.iter().all(fits)).then_some(self)
    }
}

/// The exact cosine of `turn * pi`, `turn` in `[0, 2)`, if square roots of rationals express it: at
/// multiples of pi/12 and of pi/5. (No other angles have such cosines.)
pub(super) fn cos_of_pi_times(turn: &RBig) -> Option<Surd> {
    let steps = |per_half_turn: u8| {
        let steps = turn * UBig::from(per_half_turn);
        (steps.is_int()).then(|| u8::try_from(steps.numerator()).ok())?
    };
    let ratio = |n: i8, d: u8, radicand| {
        Surd::monomial(RBig::from_parts(IBig::from(n), UBig::from(d)), radicand, 0)
    };
    if let Some(twelfths) = steps(12) {
        let twelfths = if twelfths > 12 {
            24 - twelfths
        } else {
            twelfths
        };
        let negative = twelfths > 6;
        let value = match if negative { 12 - twelfths } else { twelfths } {
            0 => ratio(1, 1, 1),
            1 => ratio(1, 4, 2).add(&ratio(1, 4, 6))?,
            2 => ratio(1, 2, 3),
            3 => ratio(1, 2, 2),
            4 => ratio(1, 2, 1),
            5 => ratio(-1, 4, 2).add(&ratio(1, 4, 6))?,
            _ => Surd::zero(),
        };
        return Some(if negative { value.neg() } else { value });
    }
    let fifths = steps(5)?;
    let fifths = if fifths > 5 { 10 - fifths } else { fifths };
    let (sign, rational) = match fifths {
        1 => (1, 1),
        2 => (1, -1),
        3 => (-1, 1),
        _ => (-1, -1),
    };
    ratio(rational, 4, 1).add(&ratio(sign, 4, 5))
}

/// An upper bound of the term's logarithm to base two, too large by at most a few bits.
fn top_of_term(term: &Term) -> i64 {
    let power = i64::from(term.pi_power);
    let pi_bits = if power >= 0 {
        (5 * power + 2) / 3
    } else {
        3 * power / 2 + 1
    };
    signed(term.coefficient.numerator().bit_len())
        - signed(term.coefficient.denominator().bit_len())
        + 1
        + i64::from((u128::BITS - term.radicand.leading_zeros()).div_ceil(2))
        + pi_bits
}

/// `|term| * 2^scale` rounded down, with roots and powers of pi computed to `working` bits.
fn term_at_scale(term: &Term, scale: i64, working: usize) -> UBig {
    let mut numerator = term.coefficient.numerator().unsigned_abs();
    let mut denominator = term.coefficient.denominator().clone();
    let mut scale = scale;
    if term.radicand > 1 {
        numerator *= (UBig::from(term.radicand) << (2 * working)).sqrt();
        scale -= signed(working);
    }
    if term.pi_power != 0 {
        let pi = pi_fixed(working);
        let mut power = pi.clone();
        for _ in 1..term.pi_power.unsigned_abs() {
            power = (power * &pi) >> working;
        }
        if term.pi_power > 0 {
            numerator *= power;
            scale -= signed(working);
        } else {
            denominator *= power;
            scale += signed(working);
        }
    }
    if scale >= 0 {
        shifted(numerator, scale) / denominator
    } else {
        numerator / shifted(denominator, -scale)
    }
}

fn rational_to_f64(value: &RBig) -> f64 {
    let numerator = value.numerator().unsigned_abs();
    let denominator = value.denominator();
    // a quotient of at least 64 bits, more than the 53 of the result
    let shift = 65 + signed(denominator.bit_len()) - signed(numerator.bit_len());
    let (quotient, exact) = if shift >= 0 {
        let scaled = shifted(numerator, shift);
        let quotient = &scaled / denominator;
        let exact = &quotient * denominator == scaled;
        (quotient, exact)
    } else {
        let scaled = shifted(denominator.clone(), -shift);
        let quotient = &numerator / &scaled;
        let exact = &quotient * &scaled == numerator;
        (quotient, exact)
    };
    nearest_f64(value.sign(), &quotient, -shift, !exact)
}

/// The exact root of a rational; `None` if the rational is negative or its factors are not found.
fn sqrt_rational(value: &RBig) -> Option<Surd> {
    if value.is_zero() {
        return Some(Surd::zero());
    }
    if value.sign() == Sign::Negative {
        return None;
    }
    let (root_n, free_n) = square_part(&value.numerator().unsigned_abs())?;
    let (root_d, free_d) = square_part(value.denominator())?;
    // numerator and denominator are coprime, so the product stays squarefree
    let radicand = free_n.checked_mul(free_d)?;
    let coefficient = RBig::from_parts(IBig::from(root_n), root_d * UBig::from(free_d));
    Surd::monomial(coefficient, radicand, 0).bounded()
}
