//! Checks a fit for results that are physically impossible: friction that drives a joint, efforts
//! that contradict the nominal bodies, negative friction or rotor inertia.

use core::f64::consts::TAU;

use super::grams::{Fit, Grams, named};
use super::{Change, MIN_OFFSET_PART, Reading, Sample};
use regen_runtime::{BaseModel, BaseTerm, Info, Joint, Motion, Parameter, Symbol};

/// Friction drives a joint if its power into the joint is more than this part of the efforts'
/// power.
const DRIVING_POWER_PART: f64 = 0.05;
/// Positions or velocities of more than this many times their limits cannot be those of this robot.
const MAX_LIMIT_RATIO: f64 = 5.0;
/// Degrees, and parts of them and of rad, the usual first; millimetres, centimetres, and smaller ones.
const DEGREE: f64 = core::f64::consts::PI / 180.0;
const UNITS_OF_ANGLES: [f64; 5] = [DEGREE, 1e-3, 0.1 * DEGREE, 0.01 * DEGREE, 0.001 * DEGREE];
const UNITS_OF_LENGTHS: [f64; 5] = [1e-3, 0.01, 1e-4, 1e-5, 1e-6];
/// The part of its range by which a position may be beyond it in its right unit.
const MAX_UNIT_MARGIN: f64 = 0.2;
/// A value more than this many standard deviations below zero is certainly negative.
pub(super) const CERTAIN_DEVIATIONS: f64 = 6.0;
/// A negative parameter matters if a fit without it has an error larger by this factor.
const MIN_ERROR_RATIO: f64 = 1.5;

/// Comparison of the effort of one equation with the effort that the nominal bodies need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nominal {
    /// The equation: an index into `Info::independent`.
    pub equation: usize,
    /// The effort that acts on it: an index into `Info::actuated`.
    pub effort: usize,
    /// The correlation of both, without the parts that friction and constants explain.
    pub correlation: f64,
    /// The factor by which the nominal bodies' effort fits the measured one best.
    pub factor: f64,
    /// The part of the effort's rms that is neither friction nor constant.
    pub part: f64,
}

/// A base parameter that is identified as negative although it cannot be.
#[derive(Clone, Debug, PartialEq)]
pub struct NegativeParameter {
    /// The parameter's label.
    pub label: String,
    /// The identified value, SI.
    pub value: f64,
    /// The standard deviation of the value.
    pub sigma: f64,
}

/// A constant offset of a joint's effort, inferred from friction that brakes in one direction and
/// drives the joint in the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Shift {
    /// The effort: an index into `Info::actuated`.
    pub effort: usize,
    /// The constant, N or N m.
    pub offset: f64,
    /// An upper bound of the offset's standard deviation.
    pub sigma: f64,
    /// The Coulomb friction of both directions, N or N m: forward, backward.
    pub friction: [f64; 2],
}

/// Whether positions or velocities are far beyond the limits of the robot.
pub(super) fn beyond_limits<M: BaseModel<f64> + ?Sized>(model: &M, sample: &Sample) -> bool {
    let info = model.info();
    let beyond = |(k, c): (usize, &usize)| {
        let Some(joint) = info.joints.get(*c) else {
            return false;
        };
        let limits = [joint.limits.position, joint.limits.velocity];
        let limits = limits.iter().zip([0, 1]);
        limits
            .filter_map(|(limit, d)| limit.map(|l| (l, d)))
            .any(|(limit, d)| {
                let bound = limit[0].abs().max(limit[1].abs());
                let most = sample.states.iter().filter_map(|s| s.motion[d].get(k));
                bound > 0.0 && most.fold(0.0, |m: f64, x| m.max(x.abs())) > MAX_LIMIT_RATIO * bound
            })
    };
    sample.measured.iter().enumerate().any(beyond)
}

/// The units of positions that move over more than the range of their joints, and are within it in degrees or
/// millimetres; `None` if there are none. Where all that have limits do, those without are in the same unit.
pub(super) fn units_by_limits<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
) -> Option<Change> {
    let info = model.info();
    let count = sample.measured.len();
    let mut out = Change::none(info.actuated.len(), count);
    let mut is_found = false;
    for (kind, units) in [
        (Motion::Rotation, UNITS_OF_ANGLES),
        (Motion::Translation, UNITS_OF_LENGTHS),
    ] {
        let (mut own, mut right) = (Vec::new(), false);
        for (k, c) in sample.measured.iter().enumerate() {
            let Some(joint) = info.joints.get(*c).filter(|joint| joint.motion == kind) else {
                continue;
            };
            let Some([low, high]) = joint.limits.position else {
                continue;
            };
            let values = || sample.states.iter().filter_map(|s| s.motion[0].get(k));
            let bounds = values().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], q| {
                [a.min(*q), b.max(*q)]
            });
            let [least, most] = bounds;
            let margin = MAX_UNIT_MARGIN * (high - low);
            let fits = |unit: &&f64| {
                let turned = turns_between(joint, [*unit * least, *unit * most]);
                *unit * least + turned > low - margin && *unit * most + turned < high + margin
            };
            match units.iter().find(fits) {
                Some(unit) if most - least > high - low => own.push((k, *unit)),
                _ => right = true,
            }
        }
        let Some((_, common)) = own.first().copied() else {
            continue;
        };
        is_found = true;
        right |= own
            .iter()
            .any(|(_, unit)| unit.to_bits() != common.to_bits());
        for (k, reading) in out.positions.iter_mut().enumerate() {
            let of_kind = sample
                .measured
                .get(k)
                .and_then(|c| info.joints.get(*c))
                .is_some_and(|joint| joint.motion == kind);
            if let Some((_, unit)) = own.iter().find(|own| own.0 == k) {
                reading.factor = *unit;
            } else if of_kind && !right {
                reading.factor = common;
            }
        }
    }
    is_found.then_some(out)
}

/// The whole turns that bring a range of angles nearest to the middle of the limits of their joint, rad, which are the
/// same posture; 0 for slides and without limits.
pub(super) fn turns_between(joint: &Joint, [least, most]: [f64; 2]) -> f64 {
    match (joint.motion, joint.limits.position) {
        (Motion::Rotation, Some([low, high])) => {
            TAU * ((f64::midpoint(low, high) - f64::midpoint(least, most)) / TAU).round()
        }
        _ => 0.0,
    }
}

/// The coordinates whose friction drives the joint, with its power over the efforts' power
/// (negative).
pub(super) fn driving<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    fit: &Fit,
) -> Vec<(usize, f64)> {
    let info = model.info();
    let base = model.base_info().base;
    let mut powers = vec![0.0; info.independent.len()];
    for (i, coordinate) in info.independent.iter().enumerate() {
        let Some(name) = info.coordinates.get(*coordinate) else {
            continue;
        };
        let of_joint = |term: &BaseTerm<'_>| {
            let parameter = info.parameters.get(term.index);
            parameter.is_some_and(|p| p.is_friction() && p.owner == *name)
        };
        for (k, parameter) in base.iter().enumerate() {
            // friction combined with other parameters cannot be separated
            if !parameter.terms.is_empty() && parameter.terms.iter().all(of_joint) {
                powers[i] += grams.power[k] * fit.values[k];
            }
        }
    }
    let pairs = info.independent.iter().zip(powers.iter().zip(&grams.spent));
    pairs
        .filter(|(_, (power, spent))| **spent > 0.0 && **power < -DRIVING_POWER_PART * **spent)
        .map(|(c, (power, spent))| (*c, power / spent))
        .collect()
}

/// The standard deviations of the efforts that the nominal bodies need along a log, in the order of
/// `Info::independent`, N or N m; `None` where the bodies are not known or the loops do not close. Friction
/// is none of them.
pub(super) fn needed_by_bodies<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
) -> Option<Vec<f64>> {
    let every = sample.states.len().div_ceil(crate::data::STATES).max(1);
    let plain = Reading::plain(sample.measured.len());
    let grams = Grams::of(model, sample, &plain, every).filter(Grams::closes)?;
    grams
        .nominal
        .then(|| (0..grams.rows()).map(|i| grams.needed(i)).collect())
}

/// Compares each equation's effort with that of the nominal bodies.
pub(super) fn nominal<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    read: &[Reading],
) -> Vec<Nominal> {
    if !grams.nominal {
        return Vec::new();
    }
    let one = |equation: usize| {
        let effort = grams.only_effort(equation)?;
        let (correlation, factor, part) = grams.compare_with_nominal(model, equation, read)?;
        Some(Nominal {
            equation,
            effort,
            correlation,
            factor,
            part,
        })
    };
    (0..grams.rows()).filter_map(one).collect()
}

/// The friction and rotor parameters that are negative by many standard deviations, and without
/// which the error of an effort would be much larger.
pub(super) fn negative<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    now: &Fit,
    values: &[f64],
    sigmas: &[f64],
) -> Vec<NegativeParameter> {
    let (info, base) = (model.info(), model.base_info().base);
    let pairs = values.iter().zip(sigmas).enumerate();
    let mut out = Vec::new();
    for (k, (value, sigma)) in pairs {
        let certainly_negative = |value: f64, sigma: f64| value < -CERTAIN_DEVIATIONS * sigma;
        let Some(parameter) = base.get(k) else {
            continue;
        };
        let joints = all(&info, parameter.terms, Parameter::is_friction)
            || all(&info, parameter.terms, Parameter::is_rotor);
        if !joints || !certainly_negative(*value, *sigma) {
            continue;
        }
        // with an offset larger than the friction, only one of both directions is negative
        let other = named(model, k).and_then(opposite).map(|other| {
            let place = (0..base.len()).find(|c| named(model, *c) == Some(other));
            place.map(|c| (values[c], sigmas[c]))
        });
        match other {
            Some(Some((v, s))) if certainly_negative(value + v, sigma + s) => {}
            Some(_) => continue,
            None => {}
        }
        let Some(without) = grams.fit_without(&Reading::plain(model.info().actuated.len()), k)
        else {
            continue;
        };
        let pairs = without.errors.iter().zip(&now.errors);
        if pairs
            .into_iter()
            .any(|(a, b)| *a > MIN_ERROR_RATIO * b.max(0.01))
        {
            out.push(NegativeParameter {
                label: parameter.label.to_owned(),
                value: *value,
                sigma: *sigma,
            });
        }
    }
    out
}

/// The efforts with a constant offset that direction-dependent friction has absorbed, so that it
/// drives the joint in one direction.
pub(super) fn shifts<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    now: &Fit,
    values: &[f64],
    sigmas: &[f64],
) -> Vec<Shift> {
    let info = model.info();
    let base = model.base_info().base;
    let of = |symbol: &'static str, name: &str| -> Option<(f64, f64)> {
        let wanted = Parameter::new(Symbol::Friction(symbol), name);
        let place = (0..base.len()).find(|c| named(model, *c) == Some(wanted))?;
        // a combination with other parameters is not the friction alone
        let terms = base.get(place)?.terms;
        let alone = all(&info, terms, Parameter::is_friction);
        let found = (*values.get(place)?, *sigmas.get(place)?);
        alone.then_some(found)
    };
    let one = |(effort, coordinate): (usize, &usize)| -> Option<Shift> {
        let name = info.coordinates.get(*coordinate)?;
        let forward = of("Fc+", name)?;
        let back = of("Fc-", name)?;
        // friction may differ between both directions, but cannot drive in exactly one of them
        let drives = |side: (f64, f64)| side.0 < -CERTAIN_DEVIATIONS * side.1;
        if drives(forward) == drives(back) || forward.0 + back.0 < 0.0 {
            return None;
        }
        let offset = 0.5 * (forward.0 - back.0);
        let equation = (0..grams.rows()).find(|i| grams.only_effort(*i) == Some(effort));
        let size = equation.and_then(|i| now.sizes.get(i)).copied();
        let matters = size.is_none_or(|size| offset.abs() > MIN_OFFSET_PART * size);
        matters.then_some(Shift {
            effort,
            offset,
            // an upper bound, as the errors of both may be negatively correlated
            sigma: 0.5 * (forward.1 + back.1),
            friction: [forward.0, back.0],
        })
    };
    info.actuated.iter().enumerate().filter_map(one).collect()
}

/// Whether all parameters of a combination satisfy a condition.
fn all<'a>(info: &Info<'a>, terms: &[BaseTerm<'_>], are: fn(&Parameter<'a>) -> bool) -> bool {
    let mut parameters = terms.iter().map(|term| info.parameters.get(term.index));
    parameters.all(|parameter| parameter.is_some_and(are))
}

/// The friction coefficient of the opposite direction.
fn opposite(parameter: Parameter<'_>) -> Option<Parameter<'_>> {
    let symbol = match parameter.symbol {
        Symbol::Friction("Fc+") => "Fc-",
        Symbol::Friction("Fc-") => "Fc+",
        Symbol::Friction("Fv+") => "Fv-",
        Symbol::Friction("Fv-") => "Fv+",
        _ => return None,
    };
    Some(Parameter::new(Symbol::Friction(symbol), parameter.owner))
}

#[cfg(test)]
mod tests {
    use super::super::swings_for_tests::{sample, swings};
    use super::*;

    #[test]
    fn friction_that_drives_one_way_is_an_offset_of_half_the_difference() {
        let mut model = swings(false);
        model.parameters[5] = Parameter::new(Symbol::Friction("Fc+"), "q2");
        model.parameters[6] = Parameter::new(Symbol::Friction("Fc-"), "q2");
        let plain = Reading::plain(3);
        let grams = Grams::of(&model, &sample(), &plain, 1);
        let Some((grams, now)) = grams.and_then(|own| own.fit(&plain, &[]).map(|fit| (own, fit)))
        else {
            panic!("no fit");
        };
        let of = |forward: f64, back: f64| {
            let values = [0.5, 0.3, 0.4, 0.6, 0.2, forward, back];
            let sigmas = [0.01, 0.01, 0.01, 0.01, 0.01, 0.02, 0.06];
            shifts(&model, &grams, &now, &values, &sigmas)
        };
        let found = of(3.0, -2.0);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].effort, found[0].friction), (1, [3.0, -2.0]));
        assert!((found[0].offset - 2.5).abs() < 1e-12 && (found[0].sigma - 0.04).abs() < 1e-12);
        let other = of(-2.0, 3.0);
        assert!(other.len() == 1 && (other[0].offset + 2.5).abs() < 1e-12);
        // friction that brakes both ways, or drives both ways, is no offset
        assert_eq!(of(3.0, 2.0), []);
        assert_eq!(of(-3.0, -2.0), []);
        assert_eq!(of(1.0, -2.0), []);
    }
}
