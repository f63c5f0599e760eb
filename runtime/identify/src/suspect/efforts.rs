//! Hypotheses on the columns of efforts: exchanged, with flipped signs, in another unit, with an
//! offset.

use super::grams::{Fit, Grams};
use super::unknowns::log_errors;
use super::{
    Change, MAX_EXPLAINED_ERROR, MAX_OFFSET_PART, MIN_GAIN_PER_COLUMN, MIN_OFFSET_PART, Reading,
    facts, implausible_count, is_beside_noise, judge, quality, worst,
};
use regen_runtime::BaseModel;

/// Relative errors of the equations below this are normal, and no change is searched.
const GOOD_ERROR: f64 = 0.03;
/// Fits whose product of errors is within this factor of the best count as equally good; their
/// plausibility decides between them.
const EQUIVALENT_RATIO: f64 = 1.05;
/// The largest number of changes made one after the other.
const MAX_ROUNDS: usize = 3;
/// A free factor on an effort must reduce the product of errors by this factor.
const MIN_GAIN_OF_FACTOR: f64 = 3.0;
/// The factor by which a change must reduce the product of errors if it leaves noise.
const MIN_GAIN_IN_NOISE: f64 = 1.3;
/// The factor by which the largest error may grow by chance, as it may be noise of a weak effort.
const MAX_LOSS_OF_WORST: f64 = 1.02;
/// The least factor on an effort that leaves noise, which is reported.
const MIN_FACTOR_IN_NOISE: f64 = 1.05;
/// Factors on an effort between 1 over this and this may come from geometry and friction, and are
/// not reported.
const MIN_REPORTED_FACTOR: f64 = 2.0;
/// Flipped signs may increase the largest error and the product of errors of a sample by this factor if the
/// parameters become plausible; a fit of the whole log tells whether they fit worse.
const MAX_LOSS_OF_SIGNS: f64 = 1.01;
/// The largest number of efforts of which all orders are tried at once.
const MAX_ORDERED: usize = 4;
/// The largest number of efforts of which all signs are tried at once.
const MAX_SIGNED: usize = 7;
/// Factors between units: a factor within 10 % of one of them is set to it.
const UNITS: [f64; 4] = [1e3, 1e-3, 9.806_65, 0.01];

/// A factor that several equations agree on is that of a unit if it differs by less than this factor.
const MAX_OFF_UNIT: f64 = 1.3;
/// A factor below this is one that no equation tells.
const MIN_KNOWN_FACTOR: f64 = 1e-5;

/// A hypothesis on how the efforts are to be read.
#[derive(Clone)]
struct Candidate {
    read: Vec<Reading>,
    /// The indices of the efforts with an offset.
    offsets: Vec<usize>,
    /// The indices of the efforts that the candidate changes.
    touched: Vec<usize>,
    /// The factor by which the candidate must reduce the product of errors.
    needed: f64,
}

/// Finds the best change of effort columns, if any.
pub(super) fn search<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    own: &[f64],
    start: &Fit,
) -> Option<Change> {
    let count = model.info().actuated.len();
    let mut read = Reading::plain(count);
    let mut offsets: Vec<usize> = Vec::new();
    let mut now = start.clone();
    let mut touched: Vec<usize> = Vec::new();
    for _ in 0..MAX_ROUNDS {
        if worst(&now.errors) < GOOD_ERROR {
            break;
        }
        let implausible = implausible_count(model, grams, &now);
        let mut fits = Vec::new();
        let mut tried = candidates(grams, &read, &offsets, own, &touched, &now);
        if touched.is_empty() {
            tried.extend(orders(grams, own));
            tried.extend(of_units(grams, own));
        }
        for candidate in tried {
            let Some(fit) = grams.fit(&candidate.read, &candidate.offsets) else {
                continue;
            };
            let gain = quality(&now.errors) / quality(&fit.errors);
            // noise limits the gain, but not what becomes possible
            let is_enough = gain >= candidate.needed
                || (implausible > 0
                    && gain >= MIN_GAIN_PER_COLUMN
                    && implausible_count(model, grams, &fit) == 0);
            if is_enough && accepted(grams, &candidate, &fit) {
                fits.push((gain, fit, candidate));
            }
        }
        let top = fits.iter().fold(0.0, |m: f64, f| m.max(f.0));
        let mut equivalent = fits.into_iter().filter(|f| f.0 * EQUIVALENT_RATIO >= top);
        let Some(mut best) = equivalent.next() else {
            break;
        };
        // a fit sees only the ratio of two efforts; the nominal bodies tell which of them is wrong, or a unit that
        // there is
        let weight_of = |fit: &Fit, candidate: &Candidate| {
            let is_unit = |k: &usize| {
                let read = candidate.read.get(*k)?;
                let factor = (read.factor * own.get(read.from)? / own.get(*k)?).abs();
                Some((factor - 1.0).abs() < 1e-9 || UNITS.contains(&factor))
            };
            let odd = candidate
                .touched
                .iter()
                .filter(|k| is_unit(k) == Some(false));
            (
                implausible_count(model, grams, fit)
                    + judge::contradictions(&facts::nominal(model, grams, &candidate.read)),
                candidate.touched.len(),
                odd.count(),
            )
        };
        let mut weight = weight_of(&best.1, &best.2);
        for other in equivalent {
            let own = weight_of(&other.1, &other.2);
            if own < weight {
                (best, weight) = (other, own);
            }
        }
        let (_, fit, candidate) = best;
        touched.extend(&candidate.touched);
        (read, offsets, now) = (candidate.read, candidate.offsets, fit);
    }
    let is_worse =
        worst(&now.errors) > worst(&start.errors) && !is_beside_noise(&start.errors, &now.errors);
    if touched.is_empty() || is_worse {
        return None;
    }
    let mut change = Change {
        offsets: shifts(count, &offsets, &now, grams),
        before: start.errors.clone(),
        after: now.errors.clone(),
        efforts: read,
        ..Change::none(count, 0)
    };
    if let Some(flipped) = flip_driving_signs(model, grams, &change.efforts, &offsets, &now) {
        change.efforts = flipped.0;
    }
    Some(change)
}

/// The exchange, the signs or the units of efforts that explain most where positions are read in another way, as
/// either mistake may hide the other, with the number of efforts that are read so.
pub(super) fn beside_positions<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    own: &[f64],
) -> Option<(Vec<Reading>, usize)> {
    let plain = Reading::plain(own.len());
    let now = grams.fit(&plain, &[])?;
    let found = search(model, grams, own, &now).filter(|own| own.number_count() == 0)?;
    // any factor beside another change may be chance
    let is_unit = |(k, read): (usize, &Reading)| {
        let constants = own.get(k).zip(own.get(read.from));
        let factor = (read.factor * constants.map_or(1.0, |(k, from)| from / k)).abs();
        (factor - 1.0).abs() < 1e-9 || UNITS.contains(&factor)
    };
    let changed = found.efforts.iter().zip(&plain).filter(|(a, b)| a != b);
    let count = changed.count();
    found
        .efforts
        .iter()
        .enumerate()
        .all(is_unit)
        .then_some((found.efforts, count))
}

/// The exchange or the signs that explain what changes of the efforts, whose weights hide it: beside a weight the
/// errors of a gentle motion are small with any columns.
pub(super) fn beside_weights<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    own: &[f64],
) -> Option<Change> {
    let grams = grams.of_changes();
    let now = grams.fit(&Reading::plain(own.len()), &[])?;
    let found = search(model, &grams, own, &now)?;
    // a constant or a factor of what hardly changes is another weight
    let constant = |k: usize, from: usize| Some(own.get(k)? / own.get(from)?);
    let mut read = found.efforts.iter().enumerate();
    let are_plain = read.all(|(k, read)| {
        constant(k, read.from).is_some_and(|of| (read.factor.abs() / of - 1.0).abs() < 1e-9)
    });
    (are_plain && found.number_count() == 0).then_some(Change {
        beside_weights: true,
        ..found
    })
}

/// The sign, the unit or the exchange of two that explains most of a log of which noise leaves so much that no
/// change halves the errors.
pub(super) fn in_noise<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    own: &[f64],
    now: &Fit,
) -> Option<Change> {
    let count = model.info().actuated.len();
    let plain = Reading::plain(count);
    let mut best: Option<(f64, Vec<Reading>, Fit)> = None;
    let mut tried: Vec<(Vec<Reading>, Vec<usize>)> = Vec::new();
    for k in 0..count {
        for factor in [-1.0].iter().chain(&UNITS) {
            let mut read = plain.clone();
            read[k].factor = *factor;
            tried.push((read, vec![k]));
        }
        // a factor that leaves noise is not one that geometry or friction pretends
        if let Some(factor) = best_factor(grams, &plain, &[], k, now, &log_errors)
            && (MIN_FACTOR_IN_NOISE..MIN_REPORTED_FACTOR).contains(&factor.max(1.0 / factor))
        {
            let mut read = plain.clone();
            read[k].factor = factor;
            tried.push((read, vec![k]));
        }
        for l in 0..k {
            let mut read = plain.clone();
            read.swap(k, l);
            read[k].factor = own[k] / own[l];
            read[l].factor = own[l] / own[k];
            tried.push((read, vec![k, l]));
        }
    }
    for (read, touched) in tried {
        let Some(fit) = grams.fit(&read, &[]) else {
            continue;
        };
        let candidate = Candidate {
            read,
            offsets: Vec::new(),
            touched,
            needed: MIN_GAIN_IN_NOISE,
        };
        let is_unit = |own: &Reading| {
            let size = own.factor.abs();
            (size - 1.0).abs() < f64::EPSILON || UNITS.contains(&size)
        };
        // a factor is one of many
        let gain = libm::exp(log_errors(now) - log_errors(&fit));
        let is_drive = candidate.touched.len() > 1;
        if !is_drive && !candidate.read.iter().all(is_unit) && gain < MIN_GAIN_OF_FACTOR {
            continue;
        }
        let error = quality(&fit.errors);
        let is_least = best.as_ref().is_none_or(|(least, ..)| error < *least);
        if is_least
            && quality(&now.errors) > candidate.needed * error
            && worst(&fit.errors) < MAX_LOSS_OF_WORST * worst(&now.errors)
            && accepted(grams, &candidate, &fit)
        {
            best = Some((error, candidate.read, fit));
        }
    }
    let (_, efforts, fit) = best?;
    Some(Change {
        efforts,
        before: now.errors.clone(),
        after: fit.errors,
        ..Change::none(count, 0)
    })
}

/// The offsets of all efforts; 0 for those without one.
fn shifts(count: usize, offsets: &[usize], fit: &Fit, grams: &Grams) -> Vec<f64> {
    let mut out = vec![0.0; count];
    for (k, value) in offsets.iter().zip(&fit.values[grams.columns()..]) {
        out[*k] = *value;
    }
    out
}

/// Whether a candidate explains the efforts that it changes, and its offsets are large enough to be
/// reported.
fn accepted(grams: &Grams, candidate: &Candidate, fit: &Fit) -> bool {
    let equations = (0..grams.rows()).filter(|&i| match grams.only_effort(i) {
        Some(k) => candidate.touched.contains(&k),
        None => true,
    });
    let mut equations = equations.filter_map(|i| fit.errors.get(i));
    let values = fit.values.get(grams.columns()..).unwrap_or_default();
    let shifted = candidate.offsets.iter().zip(values).all(|(k, value)| {
        let own = (0..grams.rows()).find(|i| grams.only_effort(*i) == Some(*k));
        own.is_none_or(|i| {
            let sizes = fit.sizes[i] * MIN_OFFSET_PART..=fit.sizes[i] * MAX_OFFSET_PART;
            sizes.contains(&value.abs())
        })
    });
    shifted && equations.all(|e| *e < MAX_EXPLAINED_ERROR)
}

/// All hypotheses that change one or two efforts further.
fn candidates(
    grams: &Grams,
    read: &[Reading],
    offsets: &[usize],
    own: &[f64],
    touched: &[usize],
    now: &Fit,
) -> Vec<Candidate> {
    let poorly_fitted = |k: usize| {
        let alone = (0..grams.rows()).find(|i| grams.only_effort(*i) == Some(k));
        alone.is_none_or(|i| now.errors[i] > GOOD_ERROR)
    };
    let with = |changes: &[(usize, Reading)], needed: f64| {
        let mut read = read.to_vec();
        for (k, r) in changes {
            read[*k] = *r;
        }
        Candidate {
            read,
            offsets: offsets.to_vec(),
            touched: changes.iter().map(|c| c.0).collect(),
            needed,
        }
    };
    let times = |k: usize, factor: f64| Reading {
        factor: read[k].factor * factor,
        ..read[k]
    };
    let mut out = Vec::new();
    for k in 0..read.len() {
        out.push(with(&[(k, times(k, -1.0))], MIN_GAIN_PER_COLUMN));
        if let Some(factor) = gain(grams, read, offsets, k, now)
            && !touched.contains(&k)
        {
            out.push(with(&[(k, times(k, factor))], MIN_GAIN_OF_FACTOR));
        }
        if !offsets.contains(&k) && poorly_fitted(k) {
            let mut shifted = with(&[], MIN_GAIN_PER_COLUMN);
            shifted.offsets.push(k);
            shifted.touched.push(k);
            out.push(shifted);
        }
        for l in (0..k).filter(|l| poorly_fitted(*l) || poorly_fitted(k)) {
            // a torque constant is that of a motor, so it does not move with the column
            let constant =
                |a: usize, b: usize| own.get(a).zip(own.get(b)).map_or(1.0, |(a, b)| a / b);
            for (a, b) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
                let (from_k, from_l) = (read[k], read[l]);
                let as_k = Reading {
                    from: from_l.from,
                    factor: from_l.factor * constant(k, l) * a,
                    offset: 0.0,
                };
                let as_l = Reading {
                    from: from_k.from,
                    factor: from_k.factor * constant(l, k) * b,
                    offset: 0.0,
                };
                let signs = if a * b > 0.0 && a > 0.0 {
                    1.0
                } else {
                    MIN_GAIN_PER_COLUMN
                };
                out.push(with(
                    &[(k, as_k), (l, as_l)],
                    MIN_GAIN_PER_COLUMN * MIN_GAIN_PER_COLUMN * signs,
                ));
            }
        }
    }
    out
}

/// All orders of a few efforts with all signs, of which no exchange of two explains an effort alone. Of more
/// efforts the order in which each equation alone is explained best, with all signs.
fn orders(grams: &Grams, own: &[f64]) -> Vec<Candidate> {
    let count = own.len();
    let all = if (2..=MAX_ORDERED).contains(&count) {
        permutations(count)
    } else {
        best_order(grams, count).into_iter().collect()
    };
    let mut out = Vec::new();
    for order in all {
        for signs in 0..1_usize << count {
            let reading = |k: usize| Reading {
                from: order[k],
                // a torque constant is that of a motor, so it does not move with the column
                factor: if signs >> k & 1 == 1 { -1.0 } else { 1.0 } * own[k] / own[order[k]],
                offset: 0.0,
            };
            let read: Vec<Reading> = (0..count).map(reading).collect();
            let touched: Vec<usize> = (0..count)
                .filter(|k| order[*k] != *k || signs >> k & 1 == 1)
                .collect();
            let flipped = signs.count_ones();
            // less is tried by exchanges and flips one after the other
            if touched.len() > 1 {
                let changes =
                    i32::try_from(touched.len().max(flipped as usize)).unwrap_or(i32::MAX);
                out.push(Candidate {
                    read,
                    offsets: Vec::new(),
                    touched,
                    needed: MIN_GAIN_PER_COLUMN.powi(changes),
                });
            }
        }
    }
    out
}

/// The orders of the efforts with signs and units with which the equations agree; none if that is what they are, or
/// if other factors than units would be needed.
fn of_units(grams: &Grams, own: &[f64]) -> Vec<Candidate> {
    let count = own.len();
    let same: Vec<usize> = (0..count).collect();
    let Some(best) = best_order(grams, count) else {
        return Vec::new();
    };
    let mut out = Vec::new();
    for order in if best == same {
        vec![same]
    } else {
        vec![same, best]
    } {
        let units = |one: usize| -> Option<Vec<f64>> {
            let of = |(k, factor): (usize, &f64)| {
                let constant = own.get(k)? / own.get(*order.get(k)?)?;
                Some(constant * unit_near(factor / constant)?)
            };
            let found = grams.factors(&order, one)?;
            found.iter().enumerate().map(of).collect()
        };
        // a torque constant is that of a motor, so it does not move with the column
        let constants = |order: &[usize]| -> Option<Vec<f64>> {
            let of = |(k, from): (usize, &usize)| Some(own.get(k)? / own.get(*from)?);
            order.iter().enumerate().map(of).collect()
        };
        let others = |read: &Vec<f64>| {
            read.iter()
                .filter(|f| (f.abs() - 1.0).abs() > f64::EPSILON)
                .count()
        };
        // the unit of most efforts is right; where factors are none of units, nothing is said of them
        let known = (0..count).filter_map(units).min_by_key(others);
        let Some(factors) = known.or_else(|| constants(&order)) else {
            continue;
        };
        for sign in [1.0, -1.0] {
            let reading = |k: usize| Reading {
                from: order[k],
                factor: sign * factors[k],
                offset: 0.0,
            };
            let read: Vec<Reading> = (0..count).map(reading).collect();
            let plain = Reading::plain(count);
            let touched: Vec<usize> = (0..count).filter(|k| read[*k] != plain[*k]).collect();
            // one alone, and a constant alone, are tried besides
            let plain = Candidate {
                needed: MIN_GAIN_PER_COLUMN.powi(i32::try_from(touched.len()).unwrap_or(i32::MAX)),
                offsets: Vec::new(),
                read,
                touched,
            };
            if !plain.touched.is_empty() {
                out.extend((0..count).map(|k| Candidate {
                    needed: MIN_GAIN_PER_COLUMN * plain.needed,
                    offsets: vec![k],
                    touched: [plain.touched.as_slice(), &[k]].concat(),
                    ..plain.clone()
                }));
            }
            if plain.touched.len() > 1 {
                out.push(plain);
            }
        }
    }
    out
}

/// The factor of a unit, or 1, that a factor is near to, with its sign; 1 where nothing tells it.
pub(super) fn unit_near(factor: f64) -> Option<f64> {
    if factor.abs() < MIN_KNOWN_FACTOR {
        return Some(1.0);
    }
    let near = |unit: &&f64| (1.0 / MAX_OFF_UNIT..MAX_OFF_UNIT).contains(&(factor.abs() / **unit));
    let unit = [1.0].iter().chain(&UNITS).find(near)?;
    Some(unit.copysign(factor))
}

/// All orders of `0..count`.
pub(super) fn permutations(count: usize) -> Vec<Vec<usize>> {
    let mut out = vec![Vec::new()];
    for _ in 0..count {
        let more = |order: &Vec<usize>| -> Vec<Vec<usize>> {
            let rest = (0..count).filter(|k| !order.contains(k));
            rest.map(|k| [order.as_slice(), &[k]].concat()).collect()
        };
        out = out.iter().flat_map(more).collect();
    }
    out
}

/// The order of the efforts with the least product of the errors of the equations, each solved alone; `None`
/// where an equation has several efforts, or there are too many for all signs.
fn best_order(grams: &Grams, count: usize) -> Option<Vec<usize>> {
    if !(2..=MAX_SIGNED).contains(&count) || grams.rows() != count {
        return None;
    }
    let mut costs = vec![vec![0.0; count]; count];
    for i in 0..count {
        let effort = grams.only_effort(i)?;
        for (from, cost) in costs[effort].iter_mut().enumerate() {
            *cost = grams.error_of(i, from)?.max(0.01).ln();
        }
    }
    // the least cost of the first efforts for each set of columns, and the last column of it
    let mut best = vec![(f64::INFINITY, 0); 1 << count];
    best[0].0 = 0.0;
    for set in 0..1_usize << count {
        let k = set.count_ones() as usize;
        for from in (0..count).filter(|from| k < count && set >> from & 1 == 0) {
            let next = set | 1 << from;
            let cost = best[set].0 + costs[k][from];
            if cost < best[next].0 {
                best[next] = (cost, from);
            }
        }
    }
    let mut set = (1 << count) - 1;
    let mut order = vec![0; count];
    for k in (0..count).rev() {
        order[k] = best[set].1;
        set &= !(1 << order[k]);
    }
    Some(order)
}

/// The factor on one effort that minimises the product of errors, if it is far from 1.
fn gain(grams: &Grams, read: &[Reading], offsets: &[usize], k: usize, now: &Fit) -> Option<f64> {
    let factor = best_factor(grams, read, offsets, k, now, &|fit| quality(&fit.errors))?;
    (!(1.0 / MIN_REPORTED_FACTOR..MIN_REPORTED_FACTOR).contains(&factor)).then_some(factor)
}

/// The factor on one effort that minimises the error of a fit; `None` if none reduces it.
fn best_factor(
    grams: &Grams,
    read: &[Reading],
    offsets: &[usize],
    k: usize,
    now: &Fit,
    error: &dyn Fn(&Fit) -> f64,
) -> Option<f64> {
    let with = |factor: f64| -> f64 {
        let mut read = read.to_vec();
        read[k].factor *= factor;
        let fit = grams.fit(&read, offsets);
        fit.map_or(f64::INFINITY, |fit| error(&fit))
    };
    let root = 10.0_f64.sqrt();
    let mut best = (error(now), 1.0);
    for towards in [root, 1.0 / root] {
        let mut factor = 1.0;
        for _ in 0..7 {
            factor *= towards;
            let error = with(factor);
            if error < best.0 {
                best = (error, factor);
            }
        }
    }
    let mut step = root;
    for _ in 0..9 {
        step = step.sqrt();
        for factor in [best.1 * step, best.1 / step] {
            let error = with(factor);
            if error < best.0 {
                best = (error, factor);
            }
        }
    }
    // no factor reduced the errors
    if (best.1 - 1.0).abs() < f64::EPSILON {
        return None;
    }
    let factor = best.1;
    let unit = UNITS.iter().find(|u| (factor / **u - 1.0).abs() < 0.1);
    Some(unit.copied().unwrap_or(factor))
}

/// Flips the signs of the efforts whose friction drives the joint; returns the readings if friction
/// then brakes and the fit is as good as before.
fn flip_driving_signs<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    read: &[Reading],
    offsets: &[usize],
    now: &Fit,
) -> Option<(Vec<Reading>, Fit)> {
    let info = model.info();
    let before = facts::driving(model, grams, now);
    let mut flipped = read.to_vec();
    for (coordinate, _) in &before {
        let k = info.actuated.iter().position(|a| a == coordinate)?;
        let equation = (0..grams.rows()).find(|i| grams.only_effort(*i) == Some(k))?;
        // the nominal bodies confirm the sign of this effort
        let nominal = grams
            .nominal
            .then(|| grams.compare_with_nominal(model, equation, read));
        if nominal.flatten().is_some_and(|(c, _, _)| c > 0.5) {
            return None;
        }
        flipped[k].factor = -flipped[k].factor;
    }
    if before.is_empty() {
        return None;
    }
    let fit = grams.fit(&flipped, offsets)?;
    let most = |fit: &Fit| worst(&fit.errors).max(0.01);
    let worse = most(&fit) > MAX_LOSS_OF_SIGNS * most(now)
        || quality(&fit.errors) > MAX_LOSS_OF_SIGNS * quality(&now.errors);
    let fewer = implausible_count(model, grams, &fit) < implausible_count(model, grams, now);
    (fewer && !worse && facts::driving(model, grams, &fit).is_empty()).then_some((flipped, fit))
}

/// A change of signs only, for a log whose errors are normal.
pub(super) fn signs<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    now: &Fit,
) -> Option<Change> {
    // friction of a fit that explains nothing has no sign
    if now.errors.iter().any(|e| *e > MAX_EXPLAINED_ERROR) {
        return None;
    }
    let count = model.info().actuated.len();
    let (efforts, fit) = flip_driving_signs(model, grams, &Reading::plain(count), &[], now)?;
    Some(Change {
        efforts,
        before: now.errors.clone(),
        after: fit.errors,
        sign: true,
        ..Change::none(count, 0)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::swings_for_tests::{sample, scale, swings, with};
    use super::*;
    use crate::intervals::Random;

    fn grams_of(sample: &super::super::Sample) -> Grams {
        Grams::of(&swings(true), sample, &Reading::plain(3), 1).unwrap()
    }

    #[test]
    fn each_further_change_of_a_hypothesis_must_halve_the_errors() {
        let grams = grams_of(&with(|s| s.efforts.swap(0, 2)));
        let plain = Reading::plain(3);
        let now = grams.fit(&plain, &[]).unwrap();
        let all = candidates(&grams, &plain, &[], &[1.0; 3], &[], &now);
        let mut exchanges = 0;
        for own in all.iter().filter(|own| own.touched.len() == 2) {
            let [k, l] = own.touched[..] else { continue };
            assert_eq!((own.read[k].from, own.read[l].from), (l, k));
            let is_turned = own.read[k].factor < 0.0 || own.read[l].factor < 0.0;
            let changes = if is_turned { 3 } else { 2 };
            assert!(
                (own.needed - MIN_GAIN_PER_COLUMN.powi(changes)).abs() < 1e-12,
                "{:?}",
                own.read
            );
            exchanges += 1;
        }
        // the first and the last one with four signs, and each of them with the other
        assert!(exchanges >= 4, "{exchanges}");
    }

    #[test]
    fn an_exchange_is_found_beside_an_effort_that_is_noise() {
        let model = swings(true);
        for seed in 1..=12 {
            let mut random = Random(seed);
            // of a joint that hardly moves
            let mut sample = sample();
            for own in &mut sample.states {
                own.efforts.swap(0, 1);
                own.efforts[2] = 0.05 * random.normal();
                scale(own, 2, 1e-3);
            }
            let grams = grams_of(&sample);
            let now = grams.fit(&Reading::plain(3), &[]).unwrap();
            let found = search(&model, &grams, &[1.0; 3], &now).unwrap();
            let from: Vec<usize> = found.efforts.iter().map(|own| own.from).collect();
            assert_eq!(
                from,
                [1, 0, 2],
                "{seed} {:?} {:?}",
                found.before,
                found.after
            );
        }
    }

    #[test]
    fn exchanges_and_signs_are_found_beside_weights() {
        let model = swings(true);
        // a gentle motion about a posture, with the efforts of weights
        let gentle = |change: &dyn Fn(&mut crate::data::Measured)| {
            let mut random = Random(5);
            with(|_| ())
                .states
                .into_iter()
                .map(|mut own| {
                    for k in 0..3 {
                        scale(&mut own, k, 2e-3);
                        own.motion[0][k] += 1.2;
                        let [q, qd, qdd] = [0, 1, 2].map(|d| own.motion[d][k]);
                        let inertia = [0.5, 0.3, 0.4][k];
                        let friction = [0.2, 0.1, 0.15][k];
                        let tau = inertia * qdd + 0.6 * 9.81 * q.sin() + friction * qd;
                        own.efforts[k] = tau + 2e-5 * random.normal();
                    }
                    change(&mut own);
                    own
                })
                .collect::<Vec<_>>()
        };
        let found = |change: &dyn Fn(&mut crate::data::Measured)| {
            let states = gentle(change);
            let grams = grams_of(&super::super::Sample { states, ..sample() });
            let now = grams.fit(&Reading::plain(3), &[])?;
            assert!(
                search(&model, &grams, &[1.0; 3], &now).is_none(),
                "{:?}",
                now.errors
            );
            beside_weights(&model, &grams, &[1.0; 3]).map(|own| {
                let each = own.efforts.iter().map(|own| (own.from, own.factor));
                each.collect::<Vec<_>>()
            })
        };
        assert_eq!(found(&|_| ()), None);
        // no constant and no factor is told there
        assert_eq!(found(&|own| own.efforts[1] += 0.02), None);
        assert_eq!(found(&|own| own.efforts[1] *= 1.003), None);
        let exchanged = found(&|own| own.efforts.swap(0, 2));
        assert_eq!(exchanged, Some(vec![(2, 1.0), (1, 1.0), (0, 1.0)]));
    }

    #[test]
    fn hypotheses_name_the_efforts_that_they_change_and_none_is_tried_twice() {
        let grams = grams_of(&sample());
        let (plain, own) = (Reading::plain(3), [2.0, 5.0, 0.7]);
        let now = grams.fit(&plain, &[]).unwrap();
        let ordered = orders(&grams, &own);
        // six orders with eight signs, without none and those of one sign
        assert_eq!(ordered.len(), 44);
        for (place, one) in ordered.iter().enumerate() {
            assert!(ordered[..place].iter().all(|other| other.read != one.read));
        }
        let other = grams_of(&with(|s| s.efforts.swap(0, 2)));
        let exchanged = candidates(
            &other,
            &plain,
            &[],
            &own,
            &[],
            &other.fit(&plain, &[]).unwrap(),
        );
        assert!(exchanged.iter().any(|one| one.read[0].from == 2));
        let all = candidates(&grams, &plain, &[], &own, &[], &now);
        let all = ordered.iter().chain(&all).chain(&exchanged);
        for one in all {
            for k in 0..3 {
                let is_changed = one.read[k] != plain[k] || one.offsets.contains(&k);
                assert_eq!(one.touched.contains(&k), is_changed, "{:?}", one.read);
                let read = one.read[k];
                let of_motors = own[k] / own[read.from];
                assert!(read.from == k || (read.factor.abs() / of_motors - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn factors_of_units_are_those_with_which_the_equations_agree() {
        let scaled = with(|s| s.efforts[1] *= 1e3);
        let found = of_units(&grams_of(&scaled), &[1.0; 3]);
        let is_found = found.iter().any(|own| {
            (own.read[1].factor - 1e-3).abs() < 1e-12 && own.read[0] == Reading::plain(3)[0]
        });
        assert!(is_found && !found.is_empty());
        assert!(
            of_units(&grams_of(&sample()), &[1.0; 3])
                .iter()
                .all(|own| own.touched != [1])
        );
    }

    #[test]
    fn units_are_told_apart_from_the_torque_constants_of_exchanged_columns() {
        let own = [2.0, 5.0, 0.7];
        // the columns of the first and the last joint are exchanged, and one is in mA
        let mistaken = with(|s| {
            let [first, last] = [s.efforts[0], s.efforts[2]];
            s.efforts[0] = own[0] * 1e3 * last / own[2];
            s.efforts[2] = own[2] * first / own[0];
        });
        let found = of_units(&grams_of(&mistaken), &own);
        let is_right = |one: &Candidate| {
            let factors = [own[0] / own[2], 1.0, 1e-3 * own[2] / own[0]];
            let mut pairs = one.read.iter().zip([2, 1, 0]).zip(factors);
            pairs.all(|((read, from), factor)| {
                read.from == from && (read.factor / factor - 1.0).abs() < 1e-9
            })
        };
        assert!(found.iter().any(is_right));
    }
}
