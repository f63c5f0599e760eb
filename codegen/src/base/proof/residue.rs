//! Numbers modulo a prime, in which exact constants have an image: roots of unity for angles that are fractions
//! of pi, and with these sines, cosines and square roots.

use core::ops::{Add, Mul, Neg, Sub};
use std::collections::BTreeMap;

use dashu_int::{IBig, Sign, UBig};
use dashu_ratio::RBig;

use crate::sym::Number;

use super::mechanism::Scalar;

/// Angles that are a multiple of 2 pi over a divisor of this number have a root of unity: those of degrees with
/// three decimals among them.
pub(super) const TURN: u64 = 4_324_320_000;
/// The prime divisors of [`TURN`].
const TURN_PRIMES: [u64; 6] = [2, 3, 5, 7, 11, 13];

/// A number modulo the prime P, which is 1 modulo [`TURN`] and below 2^62.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Residue<const P: u64>(u64);

impl<const P: u64> Residue<P> {
    pub(super) fn new(value: u64) -> Self {
        Residue(value % P)
    }

    pub(super) fn is_zero(self) -> bool {
        self.0 == 0
    }

    pub(super) fn power(self, mut exponent: u64) -> Self {
        let (mut base, mut out) = (self, Self::ONE);
        while exponent > 0 {
            if exponent & 1 == 1 {
                out = out * base;
            }
            base = base * base;
            exponent >>= 1;
        }
        out
    }

    /// The power with an exponent of either sign; the base is not 0.
    pub(super) fn signed_power(self, exponent: i64) -> Self {
        let power = self.power(exponent.unsigned_abs());
        if exponent < 0 {
            power.power(P - 2)
        } else {
            power
        }
    }

    /// The image of a fraction; `None` if P divides its denominator.
    pub(super) fn of_fraction(value: &RBig) -> Option<Self> {
        let below = reduced::<P>(value.denominator()).inverse()?;
        let (sign, above) = value.numerator().clone().into_parts();
        let above = reduced::<P>(&above);
        let above = if sign == Sign::Negative {
            -above
        } else {
            above
        };
        Some(above * below)
    }

    /// `None` of 0.
    pub(super) fn inverse(self) -> Option<Self> {
        (!self.is_zero()).then(|| self.power(P - 2))
    }

    /// A square root (Tonelli and Shanks); `None` of a number that has none.
    fn square_root(self) -> Option<Self> {
        if self.is_zero() {
            return Some(self);
        }
        let half = (P - 1) / 2;
        if self.power(half) != Self::ONE {
            return None;
        }
        let twos = (P - 1).trailing_zeros();
        let odd = (P - 1) >> twos;
        let other = (2..1000)
            .map(Self::new)
            .find(|x| x.power(half) != Self::ONE)?;
        let (mut order, mut c) = (twos, other.power(odd));
        let (mut t, mut root) = (self.power(odd), self.power(odd.div_ceil(2)));
        while t != Self::ONE {
            let (mut least, mut square) = (0, t);
            while square != Self::ONE {
                square = square * square;
                least += 1;
            }
            let step = c.power(1 << (order - least - 1));
            order = least;
            c = step * step;
            t = t * c;
            root = root * step;
        }
        Some(root)
    }
}

impl<const P: u64> Scalar for Residue<P> {
    const ZERO: Self = Residue(0);
    const ONE: Self = Residue(1);
}

impl<const P: u64> Add for Residue<P> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let sum = self.0 + other.0;
        Residue(if sum >= P { sum - P } else { sum })
    }
}

impl<const P: u64> Neg for Residue<P> {
    type Output = Self;

    fn neg(self) -> Self {
        Residue(if self.0 == 0 { 0 } else { P - self.0 })
    }
}

impl<const P: u64> Sub for Residue<P> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const P: u64> Mul for Residue<P> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = u128::from(self.0) * u128::from(other.0) % u128::from(P);
        Residue(u64::try_from(product).unwrap_or_default())
    }
}

/// The images of exact constants modulo P: sums, products and equalities of constants hold for their images.
#[derive(Debug)]
pub(super) struct Constants<const P: u64> {
    /// The image of `exp(2 pi i / TURN)`.
    unity: Residue<P>,
    /// The image of pi, of which no algebraic relation is known to hold: any number.
    pi: Residue<P>,
}

impl<const P: u64> Constants<P> {
    /// - `pi`: a random number, the image of pi.
    pub(super) fn new(pi: Residue<P>) -> Option<Self> {
        let is_primitive =
            |x: &Residue<P>| (TURN_PRIMES.iter()).all(|q| x.power((P - 1) / q) != Residue::ONE);
        let generator = (2..200).map(Residue::new).find(is_primitive)?;
        let unity = generator.power((P - 1) / TURN);
        Some(Constants { unity, pi })
    }

    /// `exp(i angle)` of an angle that is this multiple of pi; `None` where no root of unity is that.
    pub(super) fn turned(&self, multiple: &RBig) -> Option<Residue<P>> {
        let steps = multiple * RBig::from(TURN / 2);
        let steps = steps.is_int().then(|| steps.numerator().clone())?;
        let steps = steps % IBig::from(TURN);
        i64::try_from(steps)
            .ok()
            .map(|k| self.unity.signed_power(k))
    }

    /// The imaginary unit.
    fn imaginary(&self) -> Residue<P> {
        self.unity.power(TURN / 4)
    }

    /// Sine and cosine of the angle with this `exp(i angle)`.
    pub(super) fn sin_cos(&self, unit: Residue<P>) -> Option<[Residue<P>; 2]> {
        let inverse = unit.inverse()?;
        let half = Residue::new(2).inverse()?;
        let over = (Residue::new(2) * self.imaginary()).inverse()?;
        Some([(unit - inverse) * over, (unit + inverse) * half])
    }

    /// The image of a constant; `None` of one that is inexact, or whose square root or denominator has none.
    pub(super) fn number(&self, number: &Number) -> Option<Residue<P>> {
        let mut sum = Residue::ZERO;
        let mut roots = BTreeMap::new();
        for (coefficient, radicand, pi_power) in number.exact_terms()? {
            let mut term = Residue::of_fraction(&coefficient)?;
            for (prime, times) in prime_factors(radicand)? {
                let root = match roots.get(&prime) {
                    Some(root) => *root,
                    None => self.root_of_prime(prime)?,
                };
                roots.insert(prime, root);
                term = term * root.power(times);
            }
            sum = sum + term * self.pi.signed_power(i64::from(pi_power));
        }
        Some(sum)
    }

    /// The image of the square root of a prime: Gauss's sum where it is one of roots of unity at hand, so that it
    /// agrees with sines and cosines, else any root.
    fn root_of_prime(&self, prime: u64) -> Option<Residue<P>> {
        if !TURN_PRIMES.contains(&prime) {
            return Residue::new(prime).square_root();
        }
        if prime == 2 {
            let eighth = self.unity.power(TURN / 8);
            return Some(eighth + eighth.inverse()?);
        }
        let unit = self.unity.power(TURN / prime);
        let sum = (1..prime).fold(Residue::ZERO, |sum, a| {
            let is_square = (1..prime).any(|x| x * x % prime == a);
            let term = unit.power(a);
            if is_square { sum + term } else { sum - term }
        });
        // the sum is sqrt(p), or i sqrt(p) for p = 3 modulo 4
        Some(if prime % 4 == 1 {
            sum
        } else {
            -(sum * self.imaginary())
        })
    }
}

fn reduced<const P: u64>(value: &UBig) -> Residue<P> {
    let rest = value % UBig::from(P);
    Residue::new(u64::try_from(rest).unwrap_or_default())
}

/// The largest prime whose root is taken.
const MAX_PRIME: u64 = 1 << 12;

/// The prime factors of a number, each with its power; `None` if one is too large to be found soon.
fn prime_factors(number: u128) -> Option<Vec<(u64, u64)>> {
    let (mut rest, mut found) = (number, Vec::new());
    let mut prime = 2_u64;
    while rest > 1 {
        if u128::from(prime) * u128::from(prime) > rest {
            prime = u64::try_from(rest).ok()?;
        }
        if prime > MAX_PRIME {
            return None;
        }
        let mut times = 0;
        while rest % u128::from(prime) == 0 {
            rest /= u128::from(prime);
            times += 1;
        }
        if times > 0 {
            found.push((prime, times));
        }
        prime += 1;
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::PRIMES;
    use super::*;

    const P: u64 = PRIMES[0];

    /// Whether a number is prime (Miller and Rabin; these bases decide it for all numbers of 64 bits).
    fn is_prime(n: u64) -> bool {
        let power = |base: u64, mut exponent: u64| {
            let (mut base, mut out) = (u128::from(base), 1_u128);
            while exponent > 0 {
                if exponent & 1 == 1 {
                    out = out * base % u128::from(n);
                }
                base = base * base % u128::from(n);
                exponent >>= 1;
            }
            out
        };
        let twos = (n - 1).trailing_zeros();
        [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37]
            .iter()
            .all(|a| {
                let mut x = power(*a, (n - 1) >> twos);
                let mut passes = x == 1;
                for _ in 0..twos {
                    passes |= x == u128::from(n - 1);
                    x = x * x % u128::from(n);
                }
                passes
            })
    }

    #[test]
    fn the_moduli_are_primes_with_roots_of_unity() {
        for p in PRIMES {
            assert!(is_prime(p) && (p - 1) % TURN == 0 && p < 1 << 62, "{p}");
        }
        let product = TURN_PRIMES.iter().fold(TURN, |mut rest, q| {
            while rest % q == 0 {
                rest /= q;
            }
            rest
        });
        assert_eq!(product, 1);
    }

    #[test]
    fn identities_of_constants_hold_for_their_images() {
        let constants = Constants::<P>::new(Residue::new(12_345)).unwrap();
        let number = |text: &str| {
            let spec = crate::spec::parse(&crate::diag::Source::new(
                "x.yaml",
                "name: x\nlimbs: [{name: a, joints: [{name: q, type: revolute, actuated: true, body: 1}]}]\n",
            ));
            constants
                .number(&spec.unwrap().evaluate(text).unwrap())
                .unwrap()
        };
        let sin_cos = |numerator: i64, denominator: i64| {
            let multiple = RBig::from(numerator) / RBig::from(denominator);
            constants
                .sin_cos(constants.turned(&multiple).unwrap())
                .unwrap()
        };
        // signs of roots agree with those of sines and cosines
        assert_eq!(sin_cos(1, 3), [number("sqrt(3)/2"), number("1/2")]);
        assert_eq!(sin_cos(-1, 4), [number("-sqrt(2)/2"), number("sqrt(2)/2")]);
        assert_eq!(sin_cos(1, 12)[1], number("(sqrt(6) + sqrt(2))/4"));
        assert_eq!(sin_cos(1, 5)[1], number("(1 + sqrt(5))/4"));
        assert_eq!(number("sqrt(35)"), number("sqrt(5)") * number("sqrt(7)"));
        let seven = number("sqrt(7)");
        assert_eq!(seven * seven, Residue::new(7));
        let root = number("sqrt(19)*pi");
        assert_eq!(root * root, number("19*pi^2"));
        assert_eq!(number("0.25 - 1/4"), Residue::ZERO);
        // no root of unity for an angle with a prime that is not at hand
        assert!(
            constants
                .turned(&(RBig::from(1) / RBig::from(17)))
                .is_none()
        );
    }
}
