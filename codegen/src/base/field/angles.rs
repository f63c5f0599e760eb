//! Angles with geometry names, such as `pi/2 + alpha` or `beta/2`: which sines and cosines are
//! variables, and how those of the other angles follow from them.
//!
//! All angles of a description are noted first. Angles in a rational proportion are multiples of one
//! *unit*, so that the sines of `alpha` and `2*alpha` are polynomials in the same two variables. A sum
//! of which no part occurs elsewhere is a unit of its own; others are split into their terms.

use crate::sym::Number;

use super::polynomial::{self, Monomial};
use super::{Ratio, Variables};

/// The largest multiple of a unit: the degree of polynomials in its sine and cosine grows with it.
/// Angles with larger multiples of a common unit are units of their own.
const MAX_MULTIPLE: i64 = 8;

/// A term of an angle: a quotient of products of names, without a factor, and its factor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Part {
    names: Ratio,
    factor: Number,
}

/// The units of the angles of a description.
#[derive(Clone, Debug, Default)]
pub(super) struct Angles {
    /// The angles, each without its constant part.
    noted: Vec<Vec<Part>>,
    /// The units, each a sum.
    units: Vec<Vec<Part>>,
}

/// Splits an angle into its constant part and its terms with names.
pub(super) fn split(angle: &Ratio) -> (Number, Vec<Part>) {
    let (above, below) = (angle.numerator(), angle.denominator());
    let mut constant = Number::zero();
    let mut parts = Vec::new();
    if below.terms.len() == 1
        && let Some(below) = below.terms.keys().next()
    {
        for (monomial, factor) in above.terms.iter().rev() {
            let (above, below) = polynomial::lowest(monomial, below);
            if above.is_empty() && below.is_empty() {
                constant = factor.clone();
                continue;
            }
            parts.push(Part {
                names: Ratio::of_monomials(above, below),
                factor: factor.clone(),
            });
        }
        return (constant, parts);
    }
    // a quotient of sums is one term
    let factor = above.leading().map_or_else(Number::one, |l| l.1.clone());
    if let Some(inverse) = Number::one().div(&factor) {
        let names = angle.scaled(&inverse);
        parts.push(Part { names, factor });
    }
    (constant, parts)
}

/// A fraction: numerator and denominator.
type Proportion = (i64, i64);

/// The quotient of two numbers as a fraction of small integers.
fn fraction(a: &Number, b: &Number) -> Option<Proportion> {
    let ratio = a.div(b)?.as_rational()?;
    Some((
        i64::try_from(ratio.numerator()).ok()?,
        i64::try_from(ratio.denominator()).ok()?,
    ))
}

/// The whole number by which `unit` is multiplied to give `angle`.
fn multiple(angle: &[Part], unit: &[Part]) -> Option<i64> {
    let (first, rest) = angle.split_first()?;
    let own = unit.first()?;
    let (n, 1) = fraction(&first.factor, &own.factor)? else {
        return None;
    };
    let is = |(a, u): (&Part, &Part)| {
        a.names == u.names && a.factor == u.factor.mul(&Number::from_i64(n))
    };
    let all = is((first, own)) && rest.iter().zip(unit.get(1..)?).all(is);
    (angle.len() == unit.len() && all).then_some(n)
}

/// The factor by which an angle is a multiple of another one; `None` if it is not a rational one.
fn proportion(angle: &[Part], other: &[Part]) -> Option<Proportion> {
    let found = fraction(&angle.first()?.factor, &other.first()?.factor)?;
    let factor = Number::ratio(found.0, found.1)?;
    let mut both = angle.iter().zip(other);
    let is = both.all(|(a, o)| a.names == o.names && a.factor == o.factor.mul(&factor));
    (is && angle.len() == other.len()).then_some(found)
}

fn greatest_common_divisor(a: i64, b: i64) -> i64 {
    if b == 0 {
        a.abs()
    } else {
        greatest_common_divisor(b, a % b)
    }
}

impl Angles {
    /// Notes an angle without its constant part.
    pub(super) fn note(&mut self, parts: Vec<Part>) {
        if !parts.is_empty() && !self.noted.contains(&parts) {
            self.noted.push(parts);
        }
    }

    /// Chooses the units of all angles noted. They do not depend on the order of the angles.
    pub(super) fn settled(mut self) -> Self {
        let all = std::mem::take(&mut self.noted);
        let shares =
            |a: &[Part], b: &[Part]| a.iter().any(|p| b.iter().any(|o| o.names == p.names));
        let is_whole = |angle: &Vec<Part>| {
            let mut others = all.iter();
            others.all(|o| proportion(o, angle).is_some() || !shares(o, angle))
        };
        // angles in a rational proportion, with these proportions
        let mut groups: Vec<(Vec<Part>, Vec<Proportion>)> = Vec::new();
        for angle in &all {
            let pieces: Vec<Vec<Part>> = if angle.len() == 1 || is_whole(angle) {
                vec![angle.clone()]
            } else {
                angle.iter().map(|part| vec![part.clone()]).collect()
            };
            for piece in pieces {
                let group = groups
                    .iter_mut()
                    .find_map(|(first, all)| Some((proportion(&piece, first)?, all)));
                match group {
                    Some((found, all)) => all.push(found),
                    None => groups.push((piece, vec![(1, 1)])),
                }
            }
        }
        for (first, proportions) in groups {
            let below = proportions.iter().try_fold(1_i64, |product, (_, q)| {
                (product / greatest_common_divisor(product, *q)).checked_mul(*q)
            });
            let above = below.and_then(|below| {
                let wholes = proportions.iter().map(|(p, q)| p.checked_mul(below / q));
                wholes.collect::<Option<Vec<i64>>>()
            });
            let step = above.as_ref().map_or(0, |wholes| {
                wholes.iter().fold(0, |g, w| greatest_common_divisor(g, *w))
            });
            let largest = above.iter().flatten().map(|w| w.abs()).max().unwrap_or(0);
            let units: Vec<Proportion> = match below {
                Some(below) if step > 0 && largest / step <= MAX_MULTIPLE => vec![(step, below)],
                _ => proportions,
            };
            for (p, q) in units {
                if let Some(factor) = Number::ratio(p, q) {
                    self.add_unit(&first, &factor);
                }
            }
        }
        // in the order of the names, small factors first
        self.units.sort_by(|a, b| {
            let keys = |unit: &[Part]| -> Vec<[Vec<Monomial>; 2]> {
                unit.iter().map(|part| part.names.monomials()).collect()
            };
            let sizes = a.iter().zip(b).map(|(x, y)| x.factor.cmp_value(&y.factor));
            let by_size = sizes.into_iter().find(|order| order.is_ne());
            let by_names = keys(b).cmp(&keys(a));
            by_names.then(by_size.unwrap_or(core::cmp::Ordering::Equal))
        });
        self
    }

    /// Adds a multiple of an angle to the units, with a positive first factor.
    fn add_unit(&mut self, angle: &[Part], factor: &Number) -> usize {
        let negative = angle.first().is_some_and(|p| p.factor.is_negative());
        let factor = if negative == factor.is_negative() {
            factor.clone()
        } else {
            factor.neg()
        };
        let parts = angle.iter().map(|part| Part {
            names: part.names.clone(),
            factor: part.factor.mul(&factor),
        });
        let unit: Vec<Part> = parts.collect();
        if let Some(at) = self.units.iter().position(|u| *u == unit) {
            return at;
        }
        self.units.push(unit);
        self.units.len() - 1
    }

    /// An angle as a sum of whole multiples of units; units that are missing are added.
    pub(super) fn in_units(&mut self, angle: &[Part]) -> Vec<(usize, i64)> {
        if let Some(found) = self.multiple_of_unit(angle) {
            return vec![found];
        }
        let parts = angle.iter().map(std::slice::from_ref);
        let mut all = Vec::new();
        for part in parts {
            let found = self.multiple_of_unit(part);
            all.push(found.unwrap_or_else(|| {
                let at = self.add_unit(part, &Number::one());
                let same = self.units.get(at).is_some_and(|unit| unit == part);
                (at, if same { 1 } else { -1 })
            }));
        }
        all
    }

    /// The unit with the smallest multiple that gives an angle.
    fn multiple_of_unit(&self, angle: &[Part]) -> Option<(usize, i64)> {
        let units = self.units.iter().enumerate();
        let found = units.filter_map(|(k, unit)| Some((k, multiple(angle, unit)?)));
        let near = found.filter(|(_, n)| n.abs() <= MAX_MULTIPLE);
        near.min_by_key(|(k, n)| (n.abs(), *k))
    }

    /// The number of units.
    pub(super) fn count(&self) -> usize {
        self.units.len()
    }

    /// A unit as an expression in the variables.
    pub(super) fn unit(&self, index: usize, variables: &Variables) -> Option<Ratio> {
        let mut parts = self.units.get(index)?.iter();
        parts.try_fold(Ratio::zero(), |sum, part| {
            sum.add(&part.names.scaled(&part.factor), variables)
        })
    }
}
