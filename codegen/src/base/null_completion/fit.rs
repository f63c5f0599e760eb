//! Factors as functions of the geometry names, found from the change of a factor when the names are
//! scaled, one at a time and all together.

use dashu_int::IBig;

use crate::base::certificate::Float320;
use crate::base::field::{Element, Field, Variable};
use crate::sym::Number;

use super::recognise::{agree, factors, is_rounding, recognise};
use super::relation::relation;
use super::scaled_geometry::{Group, Powers};

/// The largest power of a name, in absolute value, in a product.
const MAX_POWER: i64 = 4;
/// The largest power of a sine or cosine, in absolute value, in a product.
const MAX_POWER_OF_SINE: i64 = 2;
/// The largest power of a name, in absolute value, in a sum.
const MAX_POWER_IN_SUM: i64 = 2;
/// The largest number of candidate terms for a sum, or for both sums of a quotient.
const MAX_CANDIDATES: usize = 14;
/// The degrees in the lengths of a quotient's numerator and denominator, short ones first.
const DEGREES_OF_QUOTIENTS: [[i64; 2]; 7] =
    [[0, 1], [1, 1], [2, 1], [1, 2], [2, 2], [0, 2], [3, 2]];

/// The value of a factor with scaled names.
#[derive(Clone, Debug)]
pub(super) struct ScaledFactor {
    /// The scale of each group.
    pub(super) scales: Vec<Number>,
    /// The factor with these scales.
    pub(super) value: Float320,
}

/// The sampled values of a factor of a null direction.
#[derive(Clone, Debug)]
pub(super) struct SampledFactor {
    /// The factor at the given geometry.
    pub(super) value: Float320,
    /// For each group, the factor with this group alone scaled; `None` for a group that cannot be
    /// scaled alone.
    pub(super) one_scaled: Vec<Option<Float320>>,
    /// The factor at each sampled set of scales of all groups.
    pub(super) all_scaled: Vec<ScaledFactor>,
}

impl SampledFactor {
    /// The values as doubles, by their bits, and further digits of the one at the given geometry:
    /// factors of a robot that is nearly symmetric may agree in as many digits as a double has.
    /// Factors that differ as functions of the names differ at some sample, since these are unrelated
    /// numbers.
    pub(super) fn leading_digits(&self) -> Vec<u64> {
        // no sample has the bits of a value that is not a number
        let bits = |value: Option<&Float320>| value.map_or(f64::NAN, Float320::to_f64).to_bits();
        let one_scaled = self.one_scaled.iter().map(|value| bits(value.as_ref()));
        let all_scaled = self
            .all_scaled
            .iter()
            .map(|sample| bits(Some(&sample.value)));
        let own = [bits(Some(&self.value))].into_iter();
        let further = self.value.leading_bits();
        own.chain(further)
            .chain(one_scaled)
            .chain(all_scaled)
            .collect()
    }
}

/// A product of powers of the groups' names and a number.
#[derive(Clone, Debug)]
struct Product {
    factor: Number,
    powers: Vec<Powers>,
}

/// A sum of products of powers, or a quotient of two.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    terms: Vec<Product>,
    /// The terms of the denominator; none where it is 1.
    below: Vec<Product>,
}

impl Fit {
    /// Finds the factor as a function of the names: a constant times powers of the names, a
    /// short sum of such products, or a quotient of two sums such as `(b - a)/(a + b)`.
    pub(super) fn find(observed: &SampledFactor, groups: &[Group], scale: &Number) -> Option<Fit> {
        if is_rounding(&observed.value) {
            let zero = observed.all_scaled.iter().all(|e| is_rounding(&e.value));
            return zero.then(|| Fit::sum(Vec::new()));
        }
        monomial(observed, groups, scale)
            .filter(|fit| fit.agrees_with(observed, groups))
            .or_else(|| sum(observed, groups, scale))
            .or_else(|| quotient(observed, groups, scale))
    }

    fn sum(terms: Vec<Product>) -> Fit {
        Fit {
            terms,
            below: Vec::new(),
        }
    }

    /// Whether the function agrees with the factor at the given geometry and wherever all groups
    /// were scaled.
    fn agrees_with(&self, observed: &SampledFactor, groups: &[Group]) -> bool {
        let scaled = observed.all_scaled.iter();
        !observed.all_scaled.is_empty()
            && scaled
                .map(|sample| (self.value(groups, Some(&sample.scales)), sample.value))
                .chain([(self.value(groups, None), observed.value)])
                .all(|(fitted, value)| fitted.is_some_and(|f| agree(&value, &f)))
    }

    fn value(&self, groups: &[Group], scales: Option<&[Number]>) -> Option<Number> {
        let sum_of = |terms: &[Product]| -> Option<Number> {
            let mut sum = Number::zero();
            for product in terms {
                let powers = powers_of(groups, scales, &product.powers)?;
                sum = sum.add(&product.factor.mul(&powers));
            }
            Some(sum)
        };
        let above = sum_of(&self.terms)?;
        if self.below.is_empty() {
            return Some(above);
        }
        above.div(&sum_of(&self.below)?)
    }

    /// The function as an element of the field.
    pub(super) fn element(&self, field: &mut Field, groups: &[Group]) -> Element {
        let above = element_of(&self.terms, field, groups);
        if self.below.is_empty() {
            return above;
        }
        let below = element_of(&self.below, field, groups);
        // the denominator was not zero at any sample
        field.div(&above, &below).unwrap_or_else(Element::zero)
    }
}

fn element_of(terms: &[Product], field: &mut Field, groups: &[Group]) -> Element {
    let mut sum = Element::zero();
    for product in terms {
        let mut term = Element::exact(product.factor.clone());
        for (group, power) in groups.iter().zip(&product.powers) {
            let name = Variable::Name(group.name.clone());
            let name = field.variable(name, group.value.clone());
            let variables = if group.is_angle {
                let (sin, cos) = field.sin_cos_of(&name);
                [cos, sin]
            } else {
                [name, Element::one()]
            };
            for (variable, power) in variables.iter().zip(power) {
                for _ in 0..power.unsigned_abs() {
                    term = if *power > 0 {
                        field.mul(&term, variable)
                    } else {
                        // neither the value of a group is zero, nor its sine or cosine
                        field.div(&term, variable).unwrap_or_else(Element::zero)
                    };
                }
            }
        }
        sum = field.add(&sum, &term);
    }
    sum
}

/// The product of powers of the names, with each name scaled if `scales` are given.
fn powers_of(groups: &[Group], scales: Option<&[Number]>, powers: &[Powers]) -> Option<Number> {
    let mut product = Number::one();
    for (k, (group, power)) in groups.iter().zip(powers).enumerate() {
        let scale = scales.and_then(|s| s.get(k));
        product = product.mul(&group.product(scale, *power)?);
    }
    Some(product)
}

/// The powers with which a group may occur in a product, small ones first.
fn candidates(group: &Group, sum: bool) -> Vec<Powers> {
    let mut all: Vec<Powers> = if group.is_angle {
        // the square of a sine is written with the cosine in a sum
        let cosines = -MAX_POWER_OF_SINE..=MAX_POWER_OF_SINE;
        let sines = -MAX_POWER_OF_SINE..=if sum { 1 } else { MAX_POWER_OF_SINE };
        cosines
            .flat_map(|c| sines.clone().map(move |s| [c, s]))
            .collect()
    } else {
        let largest = if sum { MAX_POWER_IN_SUM } else { MAX_POWER };
        (-largest..=largest).map(|p| [p, 0]).collect()
    };
    if group.is_angle && sum {
        all.retain(|[c, s]| c.abs() + s.abs() <= MAX_POWER_OF_SINE);
    }
    all.sort_by_key(|powers| powers.iter().map(|p| p.abs()).sum::<i64>());
    all
}

/// The powers of a group's name in a factor that is a product of powers; `None` if it is not.
fn power(before: &Float320, after: &Float320, scale: &Number, group: &Group) -> Option<Powers> {
    let ratio = after.checked_div(*before)?;
    candidates(group, false).into_iter().find(|powers| {
        let change = group.product(Some(scale), *powers).and_then(|scaled| {
            let own = group.product(None, *powers)?;
            scaled.div(&own)
        });
        change.is_some_and(|change| agree(&ratio, &change))
    })
}

fn monomial(observed: &SampledFactor, groups: &[Group], scale: &Number) -> Option<Fit> {
    let one_scaled = observed.one_scaled.iter().zip(groups);
    let powers: Option<Vec<Powers>> = one_scaled
        .map(|(after, group)| {
            after.map_or(Some([0; 2]), |a| power(&observed.value, &a, scale, group))
        })
        .collect();
    let powers = powers?;
    let product = powers_of(groups, None, &powers)?;
    let factor = recognise(
        &observed
            .value
            .checked_div(Float320::from_number(&product))?,
    )?;
    Some(Fit::sum(vec![Product { factor, powers }]))
}

/// A sum, found as an integer relation among products of powers at unrelated values of the names.
fn sum(observed: &SampledFactor, groups: &[Group], scale: &Number) -> Option<Fit> {
    let sample = observed.all_scaled.first()?;
    let mut exponents = vec![vec![]];
    for (after, group) in observed.one_scaled.iter().zip(groups) {
        let is_involved =
            after.is_some_and(|a| power(&observed.value, &a, scale, group) != Some([0; 2]));
        let mut range = vec![[0; 2]];
        if is_involved {
            range = candidates(group, true);
            range.sort_unstable();
        }
        exponents = exponents
            .into_iter()
            .flat_map(|powers: Vec<Powers>| {
                range.iter().map(move |p| {
                    let mut powers = powers.clone();
                    powers.push(*p);
                    powers
                })
            })
            .collect();
        if exponents.len() > 1000 {
            return None;
        }
    }
    let roots = [Number::one(), Number::from_i64(3).sqrt()?];
    // the factor has a dimension, so all terms have the same degree in the lengths
    for degree in [0, 1, -1, 2, -2] {
        let lengths = |p: &[Powers]| -> i64 {
            let powers = p.iter().zip(groups).filter(|(_, group)| !group.is_angle);
            powers.map(|(p, _)| p[0]).sum()
        };
        let mut candidates: Vec<&Vec<Powers>> =
            exponents.iter().filter(|p| lengths(p) == degree).collect();
        candidates.sort_by_key(|p| p.iter().flatten().map(|e| e.abs()).sum::<i64>());
        for roots in [&roots[..1], &roots[..]] {
            let max_candidates = MAX_CANDIDATES / roots.len();
            let mut products = Vec::new();
            let mut values = Vec::new();
            for powers in candidates.iter().take(max_candidates) {
                for root in roots {
                    let value = powers_of(groups, Some(&sample.scales), powers)?;
                    values.push(value.mul(root));
                    products.push((root, (*powers).clone()));
                }
            }
            let Some(coefficients) = factors(&sample.value, &values) else {
                continue;
            };
            let terms = products.into_iter().zip(coefficients);
            let terms = terms.map(|((root, powers), f)| Product {
                factor: root.mul(&Number::from_rational(f)),
                powers,
            });
            let fit = Fit::sum(terms.filter(|t| !t.factor.is_zero()).collect());
            // terms may be related by chance at one set of values; at others they are not
            if fit.agrees_with(observed, groups) {
                return Some(fit);
            }
        }
    }
    None
}

/// A quotient of homogeneous polynomials in the lengths on which the factor depends, found as an integer relation
/// among their terms, those of the denominator times the factor; `None` also of a factor that depends on angles.
fn quotient(observed: &SampledFactor, groups: &[Group], scale: &Number) -> Option<Fit> {
    let sample = observed.all_scaled.first()?;
    let mut involved = Vec::new();
    for (k, (after, group)) in observed.one_scaled.iter().zip(groups).enumerate() {
        let changes =
            after.is_some_and(|a| power(&observed.value, &a, scale, group) != Some([0; 2]));
        if changes && group.is_angle {
            return None;
        }
        if changes {
            involved.push(k);
        }
    }
    let of_degree = |degree: i64| -> Vec<Vec<Powers>> {
        let mut all = vec![(vec![[0; 2]; groups.len()], degree)];
        for (place, &k) in involved.iter().enumerate() {
            let is_last = place + 1 == involved.len();
            let powers = all.into_iter().flat_map(|(powers, left)| {
                let least = if is_last { left } else { 0 };
                (least..=left).map(move |power| {
                    let mut powers = powers.clone();
                    powers[k] = [power, 0];
                    (powers, left - power)
                })
            });
            all = powers.collect();
        }
        all.into_iter().map(|(powers, _)| powers).collect()
    };
    if !(2..=3).contains(&involved.len()) {
        return None;
    }
    DEGREES_OF_QUOTIENTS.into_iter().find_map(|[above, below]| {
        let (above, below) = (of_degree(above), of_degree(below));
        if above.len() + below.len() > MAX_CANDIDATES {
            return None;
        }
        let value = |powers: &Vec<Powers>| {
            powers_of(groups, Some(&sample.scales), powers).map(|x| Float320::from_number(&x))
        };
        let times_factor = |powers: &Vec<Powers>| Some(value(powers)? * sample.value);
        let values = above
            .iter()
            .map(value)
            .chain(below.iter().map(times_factor));
        let integers = relation(&values.collect::<Option<Vec<Float320>>>()?)?;
        let (of_above, of_below) = integers.split_at_checked(above.len())?;
        let products = |all: Vec<Vec<Powers>>, factors: &[IBig], sign: i64| -> Vec<Product> {
            let products = all
                .into_iter()
                .zip(factors)
                .map(|(powers, factor)| Product {
                    factor: Number::from_rational(factor.clone().into())
                        .mul(&Number::from_i64(sign)),
                    powers,
                });
            products.filter(|p| !p.factor.is_zero()).collect()
        };
        let fit = Fit {
            terms: products(above, of_above, 1),
            below: products(below, of_below, -1),
        };
        (!fit.below.is_empty() && fit.agrees_with(observed, groups)).then_some(fit)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::collections::BTreeSet;

    /// A finger and its mirrored twin, whose frames are rounded differently in the file.
    #[test]
    fn factors_that_agree_as_doubles_are_told_apart() {
        let value = Number::parse_decimal("117.711955557822268").unwrap();
        let beside = Number::parse_decimal("117.7119555578222680000001").unwrap();
        let [digits, other] = [&value, &beside].map(|number| {
            let value = Float320::from_number(number);
            SampledFactor {
                value,
                one_scaled: Vec::new(),
                all_scaled: Vec::new(),
            }
            .leading_digits()
        });
        assert_eq!(digits[0], other[0]);
        assert_ne!(digits, other);
    }

    type Function<'a> = &'a dyn Fn(&Number, &Number) -> Number;

    /// Values of a function of two lengths, a and b, with each length changed alone and both
    /// together.
    fn observed(f: impl Fn(&Number, &Number) -> Number) -> (SampledFactor, Vec<Group>, Number) {
        let text = "name: two\ngeometry: {a: 0.3, b: 0.7}\nlimbs: [{name: arm, joints: \
                    [{name: q1, type: revolute, body: 1, actuated: true}]}]\n";
        let source = crate::diag::Source::new("two.yaml", text);
        let spec = crate::spec::parse(&source).unwrap();
        let groups = super::super::scaled_geometry::groups(&spec, &BTreeSet::new());
        let [a, b] = ["0.3", "0.7"].map(|d| Number::parse_decimal(d).unwrap());
        let wide = |x: &Number| Float320::from_number(x);
        let scale = Number::ratio(33, 32).unwrap();
        let at = |s: &Number, t: &Number| wide(&f(&a.mul(s), &b.mul(t)));
        let one = Number::one();
        // unrelated large numbers, as in the sampling of mechanisms
        let all_scaled = [(1_037_720, 1_075_437), (970_520, 941_037)].map(|(p, q)| {
            let scales = [p, q].map(|n| Number::ratio(n, 1_000_003).unwrap());
            ScaledFactor {
                value: at(&scales[0], &scales[1]),
                scales: scales.to_vec(),
            }
        });
        let observed = SampledFactor {
            value: at(&one, &one),
            one_scaled: vec![Some(at(&scale, &one)), Some(at(&one, &scale))],
            all_scaled: all_scaled.to_vec(),
        };
        (observed, groups, scale)
    }

    #[test]
    fn products_of_lengths_and_sums_of_their_ratios_are_found_from_their_values() {
        let half = Number::ratio(1, 2).unwrap();
        let functions: [Function<'_>; 7] = [
            &|a, b| a.add(&b.mul(&half)),
            &|a, b| a.mul(b).mul(&half),
            &|a, b| b.mul(b).div(a).unwrap(),
            &|a, b| a.div(b).unwrap().add(&half),
            &|a, b| a.div(b).unwrap().sub(&b.mul(b).div(&a.mul(a)).unwrap()),
            &|a, b| b.sub(a).div(&a.add(b)).unwrap(),
            &|a, b| a.mul(b).div(&a.mul(a).add(&b.mul(b)).mul(&half)).unwrap(),
        ];
        for (k, f) in functions.into_iter().enumerate() {
            let (sampled, groups, scale) = observed(f);
            let fit = Fit::find(&sampled, &groups, &scale);
            let fit = fit.unwrap_or_else(|| panic!("function {k}"));
            // at lengths that were not used to find the function
            let scales = [5, 3].map(Number::from_i64);
            let [a, b] = [(3, 2), (21, 10)].map(|(p, q)| Number::ratio(p, q).unwrap());
            assert_eq!(fit.value(&groups, Some(&scales)), Some(f(&a, &b)), "{k}");
        }
    }
}
