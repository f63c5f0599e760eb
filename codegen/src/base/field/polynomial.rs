//! Polynomials in the variables with exact constants as coefficients.

use std::collections::BTreeMap;

use crate::sym::Number;

use super::Variables;

/// Exponents by variable, without trailing zeros. By their order, the last entry of a map is the
/// leading term.
pub(super) type Monomial = Vec<u8>;

/// The largest number of terms of an expression; longer ones are dropped, as nobody would read
/// them.
const MAX_TERMS: usize = 40;
/// The same, where sines and cosines of names are among the variables: sums over both are longer.
const MAX_TERMS_WITH_ANGLES: usize = 600;
/// The largest power of a variable: the terms of longer expressions cancel, so that doubles could not
/// evaluate them.
const MAX_POWER: u8 = 32;
/// The largest number of steps for a greatest common divisor; then 1 is used instead.
const MAX_GCD_STEPS: usize = 24;

/// A polynomial, without zero coefficients.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub(crate) struct Polynomial {
    pub(super) terms: BTreeMap<Monomial, Number>,
}

fn product(a: &Monomial, b: &Monomial) -> Monomial {
    let mut result = vec![0; a.len().max(b.len())];
    for (i, e) in result.iter_mut().enumerate() {
        let sum = a
            .get(i)
            .copied()
            .unwrap_or(0)
            .saturating_add(b.get(i).copied().unwrap_or(0));
        *e = sum;
    }
    result
}

fn quotient(a: &Monomial, b: &Monomial) -> Option<Monomial> {
    let mut result = a.clone();
    result.resize(a.len().max(b.len()), 0);
    for (i, e) in b.iter().enumerate() {
        result[i] = result[i].checked_sub(*e)?;
    }
    trim(&mut result);
    Some(result)
}

/// The largest monomial that divides two others.
pub(super) fn shared(a: &Monomial, b: &Monomial) -> Monomial {
    let mut common: Monomial = a.iter().zip(b).map(|(x, y)| *x.min(y)).collect();
    trim(&mut common);
    common
}

/// The quotient of two monomials in lowest terms.
pub(super) fn lowest(above: &Monomial, below: &Monomial) -> (Monomial, Monomial) {
    let (mut above, mut below) = (above.clone(), below.clone());
    for (a, b) in above.iter_mut().zip(&mut below) {
        let common = (*a).min(*b);
        *a -= common;
        *b -= common;
    }
    trim(&mut above);
    trim(&mut below);
    (above, below)
}

fn trim(m: &mut Monomial) {
    while m.last() == Some(&0) {
        m.pop();
    }
}

impl Polynomial {
    pub(super) fn constant(value: Number) -> Self {
        let mut p = Polynomial::default();
        p.push(Vec::new(), value);
        p
    }

    pub(super) fn variable(index: usize) -> Self {
        let mut monomial = vec![0; index + 1];
        monomial[index] = 1;
        let mut p = Polynomial::default();
        p.push(monomial, Number::one());
        p
    }

    pub(super) fn is_zero(&self) -> bool {
        self.terms.is_empty()
    }

    /// The value, if the polynomial is a constant.
    pub(super) fn as_constant(&self) -> Option<Number> {
        match self.terms.len() {
            0 => Some(Number::zero()),
            1 => self.terms.get(&Vec::new()).cloned(),
            _ => None,
        }
    }

    /// Whether the polynomial has too many terms, more of them with sines of names, or too large a
    /// power.
    pub(super) fn too_long(&self, variables: &Variables) -> bool {
        let mut powers = self.terms.keys().flatten();
        let count = self.terms.len();
        count > MAX_TERMS
            && (count > MAX_TERMS_WITH_ANGLES || variables.named_sines().next().is_none())
            || powers.any(|power| *power > MAX_POWER)
    }

    fn push(&mut self, monomial: Monomial, value: Number) {
        if value.is_zero() {
            return;
        }
        match self.terms.entry(monomial) {
            std::collections::btree_map::Entry::Vacant(e) => {
                e.insert(value);
            }
            std::collections::btree_map::Entry::Occupied(mut e) => {
                let sum = e.get().add(&value);
                if sum.is_zero() {
                    e.remove();
                } else {
                    e.insert(sum);
                }
            }
        }
    }

    pub(super) fn add(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        for (m, c) in &other.terms {
            sum.push(m.clone(), c.clone());
        }
        sum
    }

    pub(super) fn neg(&self) -> Self {
        self.scaled(&Number::from_i64(-1))
    }

    pub(super) fn scaled(&self, factor: &Number) -> Self {
        let mut scaled = Polynomial::default();
        for (m, c) in &self.terms {
            scaled.push(m.clone(), c.mul(factor));
        }
        scaled
    }

    /// The product, in which squares of sines are written with cosines.
    pub(super) fn mul(&self, other: &Self, variables: &Variables) -> Self {
        let mut result = Polynomial::default();
        for (m1, c1) in &self.terms {
            for (m2, c2) in &other.terms {
                result.push_reduced(product(m1, m2), c1.mul(c2), variables);
            }
        }
        result
    }

    /// The polynomial with the squares of a cosine, at `cosine`, written with the sine at `sine`.
    pub(super) fn with_squares_of_sine(&self, cosine: usize, sine: usize) -> Self {
        let one = Polynomial::constant(Number::one());
        let square = Polynomial::variable(sine).plain_mul(&Polynomial::variable(sine));
        let square = one.add(&square.neg());
        let powers = self.by_powers(cosine);
        let mut result = Polynomial::default();
        for (power, factor) in powers.iter().enumerate() {
            let squares = (0..power / 2).fold(factor.clone(), |p, _| p.plain_mul(&square));
            result = result.add(&if power % 2 == 0 {
                squares
            } else {
                squares.plain_mul(&Polynomial::variable(cosine))
            });
        }
        result
    }

    /// The polynomial with sine and cosine of twice an angle in place of products of those of the
    /// angle; each pair gives the sine first.
    pub(super) fn with_double_angle(
        &self,
        [sine, cosine]: [usize; 2],
        [double_sine, double_cosine]: [usize; 2],
    ) -> Self {
        let half = Number::ratio(1, 2).unwrap_or_else(Number::one);
        let halved = |p: Polynomial| p.scaled(&half);
        // cos^2 = (1 + cos 2x)/2
        let one = Polynomial::constant(Number::one());
        let square = halved(one.add(&Polynomial::variable(double_cosine)));
        let mut result = Polynomial::default();
        for (monomial, factor) in &self.terms {
            let power = |index: usize| monomial.get(index).copied().unwrap_or(0);
            let (sines, cosines) = (power(sine), power(cosine));
            let mut rest = monomial.clone();
            for index in [sine, cosine] {
                if let Some(e) = rest.get_mut(index) {
                    *e = 0;
                }
            }
            trim(&mut rest);
            let mut term = Polynomial::default();
            term.push(rest, factor.clone());
            for _ in 0..cosines / 2 {
                term = term.plain_mul(&square);
            }
            term = match (sines, cosines % 2) {
                (0, 0) => term,
                (0, _) => term.plain_mul(&Polynomial::variable(cosine)),
                (_, 0) => term.plain_mul(&Polynomial::variable(sine)),
                _ => halved(term.plain_mul(&Polynomial::variable(double_sine))),
            };
            result = result.add(&term);
        }
        result
    }

    /// The polynomial with other polynomials in place of some variables.
    pub(super) fn replaced(
        &self,
        replacement: &dyn Fn(usize) -> Option<Polynomial>,
        variables: &Variables,
    ) -> Self {
        let mut result = Polynomial::default();
        for (monomial, factor) in &self.terms {
            let mut term = Polynomial::constant(factor.clone());
            for (index, power) in monomial.iter().enumerate() {
                let base = replacement(index).unwrap_or_else(|| Polynomial::variable(index));
                for _ in 0..*power {
                    term = term.mul(&base, variables);
                }
            }
            result = result.add(&term);
        }
        result
    }

    /// Adds a term, in which sin^2 is replaced by 1 - cos^2 until no square of a sine remains.
    fn push_reduced(&mut self, monomial: Monomial, value: Number, variables: &Variables) {
        for (i, e) in monomial.iter().enumerate() {
            if *e < 2 {
                continue;
            }
            let Some(cosine) = variables.cosine_of(i) else {
                continue;
            };
            let mut less = monomial.clone();
            less[i] -= 2;
            let mut more = less.clone();
            more.resize(more.len().max(cosine + 1), 0);
            more[cosine] += 2;
            trim(&mut less);
            trim(&mut more);
            self.push_reduced(less, value.clone(), variables);
            self.push_reduced(more, value.neg(), variables);
            return;
        }
        self.push(monomial, value);
    }

    pub(super) fn leading(&self) -> Option<(&Monomial, &Number)> {
        self.terms.last_key_value()
    }

    /// The quotient of an exact division; `None` if there is a remainder.
    pub(super) fn divided(&self, divisor: &Self) -> Option<Self> {
        let (lead, factor) = divisor.leading()?;
        let (lead, factor) = (lead.clone(), Number::one().div(factor)?);
        let mut rest = self.clone();
        let mut result = Polynomial::default();
        let most = MAX_TERMS.max(self.terms.len());
        let mut steps = 0;
        while let Some((m, c)) = rest.leading() {
            steps += 1;
            if steps > most {
                return None;
            }
            let monomial = quotient(m, &lead)?;
            let coefficient = c.mul(&factor);
            for (m2, c2) in &divisor.terms {
                let mut p = product(&monomial, m2);
                trim(&mut p);
                rest.push(p, c2.mul(&coefficient).neg());
            }
            result.push(monomial, coefficient);
        }
        Some(result)
    }

    /// The largest monomial that divides every term.
    pub(super) fn common_monomial(&self) -> Monomial {
        let mut terms = self.terms.keys();
        let Some(first) = terms.next() else {
            return Vec::new();
        };
        let mut common = first.clone();
        for m in terms {
            for (i, e) in common.iter_mut().enumerate() {
                *e = (*e).min(m.get(i).copied().unwrap_or(0));
            }
        }
        trim(&mut common);
        common
    }

    /// The polynomial divided by a monomial that divides every term, as
    /// [`common_monomial`](Self::common_monomial) does; other terms are dropped.
    pub(super) fn without(&self, monomial: &Monomial) -> Self {
        let mut result = Polynomial::default();
        for (m, c) in &self.terms {
            if let Some(q) = quotient(m, monomial) {
                result.push(q, c.clone());
            }
        }
        result
    }

    pub(super) fn from_monomial(monomial: Monomial) -> Self {
        let mut p = Polynomial::default();
        p.push(monomial, Number::one());
        p
    }

    pub(super) fn variables_used(&self) -> Vec<usize> {
        let mut used: Vec<usize> = self
            .terms
            .keys()
            .flat_map(|m| {
                m.iter()
                    .enumerate()
                    .filter(|(_, e)| **e > 0)
                    .map(|(i, _)| i)
            })
            .collect();
        used.sort_unstable();
        used.dedup();
        used
    }

    /// The coefficients of the powers of one variable, highest power last.
    fn by_powers(&self, variable: usize) -> Vec<Polynomial> {
        let mut powers: Vec<Polynomial> = Vec::new();
        for (m, c) in &self.terms {
            let power = m.get(variable).copied().unwrap_or(0) as usize;
            if powers.len() <= power {
                powers.resize(power + 1, Polynomial::default());
            }
            let mut rest = m.clone();
            if let Some(e) = rest.get_mut(variable) {
                *e = 0;
            }
            trim(&mut rest);
            powers[power].push(rest, c.clone());
        }
        powers
    }

    /// The product, in which squares of sines remain.
    fn plain_mul(&self, other: &Self) -> Self {
        let mut result = Polynomial::default();
        for (m1, c1) in &self.terms {
            for (m2, c2) in &other.terms {
                result.push(product(m1, m2), c1.mul(c2));
            }
        }
        result
    }

    /// A common divisor: the greatest if it is found in a few steps, else 1. Sines and cosines
    /// count as independent variables here.
    pub(super) fn common_divisor(&self, other: &Self) -> Self {
        let mut budget = MAX_GCD_STEPS;
        gcd(self, other, &mut budget).unwrap_or_else(|| Polynomial::constant(Number::one()))
    }

    /// The quotient of a division by a sine, using sin^2 = 1 - cos^2; `None` if there is a
    /// remainder.
    pub(super) fn divided_by_sine(&self, sine: usize, variables: &Variables) -> Option<Self> {
        let cosine = variables.cosine_of(sine)?;
        let powers = self.by_powers(sine);
        let (free, with) = match powers.as_slice() {
            [] => return Some(Polynomial::default()),
            [free] => (free, Polynomial::default()),
            [free, with] => (free, with.clone()),
            _ => return None,
        };
        // free = sin^2 x, so free / sin = sin x
        let square = Polynomial::variable(cosine).plain_mul(&Polynomial::variable(cosine));
        let square = Polynomial::constant(Number::one()).add(&square.neg());
        let inner = if free.is_zero() {
            Polynomial::default()
        } else {
            free.divided(&square)?
        };
        Some(with.add(&inner.plain_mul(&Polynomial::variable(sine))))
    }
}

/// Greatest common divisor by Euclid's algorithm on primitive parts, variable by variable.
fn gcd(a: &Polynomial, b: &Polynomial, budget: &mut usize) -> Option<Polynomial> {
    let one = || Polynomial::constant(Number::one());
    if a.is_zero() {
        return Some(b.clone());
    }
    if b.is_zero() {
        return Some(a.clone());
    }
    if a.as_constant().is_some() || b.as_constant().is_some() {
        return Some(one());
    }
    *budget = budget.checked_sub(1)?;
    let used_a = a.variables_used();
    let shared: Vec<usize> = b
        .variables_used()
        .into_iter()
        .filter(|v| used_a.contains(v))
        .collect();
    let Some(&main) = shared.last() else {
        return Some(one());
    };
    let (content_a, mut p) = primitive(a, main, budget)?;
    let (content_b, mut q) = primitive(b, main, budget)?;
    let content = gcd(&content_a, &content_b, budget)?;
    let degree = |x: &Polynomial| x.by_powers(main).len();
    if degree(&p) < degree(&q) {
        std::mem::swap(&mut p, &mut q);
    }
    while !q.is_zero() {
        *budget = budget.checked_sub(1)?;
        if degree(&q) <= 1 {
            // no common factor contains the main variable
            p = one();
            break;
        }
        let r = pseudo_remainder(&p, &q, main, budget)?;
        p = q;
        q = if r.is_zero() {
            r
        } else {
            primitive(&r, main, budget)?.1
        };
    }
    Some(content.plain_mul(&p))
}

/// Content (the common divisor of the coefficients of the powers of `main`) and primitive part (the
/// polynomial divided by it).
fn primitive(a: &Polynomial, main: usize, budget: &mut usize) -> Option<(Polynomial, Polynomial)> {
    let mut content = Polynomial::default();
    for coefficient in a.by_powers(main) {
        content = gcd(&content, &coefficient, budget)?;
        if content.as_constant().is_some_and(|c| !c.is_zero()) {
            break;
        }
    }
    let part = a.divided(&content)?;
    Some((content, part))
}

fn pseudo_remainder(
    a: &Polynomial,
    b: &Polynomial,
    main: usize,
    budget: &mut usize,
) -> Option<Polynomial> {
    let b_powers = b.by_powers(main);
    let degree_b = b_powers.len() - 1;
    let lead_b = b_powers.last()?.clone();
    let mut rest = a.clone();
    loop {
        let powers = rest.by_powers(main);
        if rest.is_zero() || powers.len() <= degree_b {
            return Some(rest);
        }
        *budget = budget.checked_sub(1)?;
        let lead = powers.last()?.clone();
        let mut shift = vec![0; main + 1];
        shift[main] = u8::try_from(powers.len() - 1 - degree_b).ok()?;
        trim(&mut shift);
        let shifted = Polynomial::from_monomial(shift)
            .plain_mul(&lead)
            .plain_mul(b);
        rest = rest.plain_mul(&lead_b).add(&shifted.neg());
        if rest.terms.len() > MAX_TERMS {
            return None;
        }
    }
}
