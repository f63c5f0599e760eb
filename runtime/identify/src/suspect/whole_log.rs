//! Fits whole logs with columns that are read in another way, so that a change of columns is advised only where the
//! log fits better with it.

use super::efforts::unit_near;
use super::grams::LEAST_SPREAD;
use super::words::LogColumns;
use super::{Change, EffortChange, Nominal, Remedy, Sample, Suspicion};
use crate::data::Assignment;
use regen_runtime::BaseModel;

/// The factor by which a fit of the whole log must be better with another change than with the first one.
const MIN_GAIN_OF_RIVAL: f64 = 1.005;
/// The factor by which a fit of the whole log may be worse with a change that only flips signs.
const MAX_LOSS_OF_SIGNS: f64 = 1.02;
/// The part by which a number that was found is changed to find a better one.
const PART_OF_NUMBER: f64 = 0.1;
/// The factor by which the mean square may be larger with the factor of a unit than with another one.
const MAX_LOSS_OF_UNIT: f64 = 1.02;
/// A zero that is a whole number of quarters of a turn, but for rounding, is round.
const MAX_OFF_QUARTERS: f64 = 1e-9;
/// The smallest error of an effort that is compared, percent, and the smallest one for which columns are read in
/// another way: what friction leaves at reversals is smaller with another unit, too.
const LEAST_ERROR: f64 = 0.1;
const LEAST_DOUBTED_ERROR: f64 = 1.0;

/// Fits the whole log with some columns read in another way, and returns the error of each effort with its name, as
/// [`errors_with_columns`](crate::session::errors_with_columns) does; `None` where no fit is possible or known.
pub type WholeFit<'a> = dyn Fn(&[Assignment]) -> Option<Vec<(String, f64)>> + 'a;

/// The rms about the mean of values less a constant, at least a tenth of their rms.
fn spread_of(values: &[f64], constant: f64) -> f64 {
    let count = values.len().max(1) as f64;
    let values = values.iter().map(|u| u - constant);
    let mean = values.clone().sum::<f64>() / count;
    let square = values.map(|u| u * u).sum::<f64>() / count;
    (square - mean * mean).max(LEAST_SPREAD * square).sqrt()
}

/// The size that the errors of an effort are compared with, over the rms of its values about their mean.
fn of_changes(values: &[f64], constant: f64) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|u| (u - mean) * (u - mean)).sum::<f64>() / count;
    spread_of(values, constant) / square.sqrt()
}

/// The product of the errors of the efforts, as the sum of its logarithms.
///
/// - `least`: what a smaller error counts as, percent.
fn log_product(errors: &[(String, f64)], least: f64) -> f64 {
    let errors = errors.iter().map(|own| own.1);
    let errors = errors.filter(|error| error.is_finite());
    errors.map(|error| libm::log(error.max(least))).sum()
}

/// A change with which the whole log was fitted.
struct Fitted {
    change: Change,
    found: Suspicion,
    errors: Vec<(String, f64)>,
}

/// A number of a change that the whole log tells better than its sample.
#[derive(Clone, Copy)]
enum Number {
    /// The zero of a position, by its place.
    Zero(usize),
    /// How late a position is, by its place in the list.
    Late(usize),
    /// The factor of an effort that is none of a unit.
    Gain(usize),
}

impl Number {
    /// The only number of a change, if it is not round.
    fn only_of(change: &Change) -> Option<Self> {
        let zeros = change.positions.iter().enumerate();
        let zeros = zeros.filter(|(_, own)| own.offset != 0.0);
        let zeros = zeros.map(|(k, _)| Self::Zero(k));
        let late = (0..change.late.len()).map(Self::Late);
        let has_gain = |own: &f64| (own.abs() - 1.0).abs() > f64::EPSILON;
        let gains = change.efforts.iter().enumerate();
        let gains = gains.filter(|(_, own)| has_gain(&own.factor));
        let gains = gains.map(|(k, _)| Self::Gain(k));
        let all: Vec<Self> = zeros.chain(late).chain(gains).collect();
        let [only] = all[..] else { return None };
        let is_round = match only {
            Self::Zero(_) => {
                let quarters = only.of(change)? / core::f64::consts::FRAC_PI_2;
                (quarters - quarters.round()).abs() < MAX_OFF_QUARTERS
            }
            Self::Late(_) => false,
            // the constants of motors stay where columns are exchanged
            Self::Gain(k) => {
                let unit = unit_near(change.efforts.get(k)?.factor);
                change.efforts.get(k)?.from != k || unit == Some(change.efforts.get(k)?.factor)
            }
        };
        let others = change.number_count() - i32::from(!matches!(only, Self::Gain(_)));
        (!is_round && others == 0).then_some(only)
    }

    fn of(self, change: &Change) -> Option<f64> {
        match self {
            Self::Zero(k) => change.positions.get(k).map(|own| own.offset),
            Self::Late(k) => change.late.get(k).map(|own| own.1),
            Self::Gain(k) => change.efforts.get(k).map(|own| own.factor),
        }
    }

    /// The change with another value of this number.
    fn changed(self, change: &Change, value: f64) -> Change {
        let mut out = change.clone();
        let place = match self {
            Self::Zero(k) => out.positions.get_mut(k).map(|own| &mut own.offset),
            Self::Late(k) => out.late.get_mut(k).map(|own| &mut own.1),
            Self::Gain(k) => out.efforts.get_mut(k).map(|own| &mut own.factor),
        };
        if let Some(own) = place {
            *own = value;
        }
        out
    }
}

impl Fitted {
    /// The same change with the value of its number with which the whole log fits best, if it has only one: the
    /// lowest point of a parabola through the mean squares at three values. A factor that is nearly that of a unit
    /// is that.
    fn with_best_number(self, fitted: impl Fn(&Change) -> Option<Self>) -> Self {
        let number = Number::only_of(&self.change);
        let Some((number, value)) = number.and_then(|own| Some((own, own.of(&self.change)?)))
        else {
            return self;
        };
        let first = self.change.clone();
        let at = |value: f64| fitted(&number.changed(&first, value));
        let here = self.errors.clone();
        let squares = |own: &Self| {
            let pairs = own.errors.iter().zip(&here);
            let ratios = pairs.map(|(own, here)| own.1 / here.1);
            let ratios = ratios.filter(|ratio| ratio.is_finite());
            ratios.map(|ratio| ratio * ratio).sum::<f64>()
        };
        let step = PART_OF_NUMBER * value;
        let (Some(below), Some(above)) = (at(value - step), at(value + step)) else {
            return self;
        };
        let fits = [
            (value - step, &below),
            (value, &self),
            (value + step, &above),
        ];
        let lowest = lowest_of_parabola(fits.map(|(x, own)| (x, squares(own))));
        let within = |x: &f64| (x - value).abs() < 3.0 * step.abs();
        let best = lowest.filter(within).and_then(at);
        let others = [below, above].into_iter().chain(best);
        let best = others.fold(self, |best, own| {
            if squares(&own) < squares(&best) {
                own
            } else {
                best
            }
        });
        let unit = match number {
            Number::Gain(_) => number.of(&best.change).and_then(unit_near),
            _ => None,
        };
        let unit = unit
            .filter(|unit| (unit.abs() - 1.0).abs() > f64::EPSILON)
            .and_then(at);
        match unit.filter(|own| squares(own) < MAX_LOSS_OF_UNIT * squares(&best)) {
            Some(unit) => unit,
            None => best,
        }
    }
}

/// Where the parabola through three points is lowest; `None` if it is not.
fn lowest_of_parabola([a, b, c]: [(f64, f64); 3]) -> Option<f64> {
    let slope = |a: (f64, f64), b: (f64, f64)| (b.1 - a.1) / (b.0 - a.0);
    let (first, second) = (slope(a, b), slope(b, c));
    let curvature = (second - first) / (c.0 - a.0);
    (curvature > 0.0).then(|| 0.5 * (a.0 + b.0 - first / curvature))
}

impl<M: BaseModel<f64> + ?Sized> LogColumns<'_, M> {
    /// The suspicion that a change or its rival corrects the log, whichever fits the whole log better; `None` if it
    /// fits no better with either.
    ///
    /// - `nominal`: as for [`change`](Self::change).
    pub(super) fn tried(
        &self,
        change: &Change,
        sample: &Sample,
        nominal: &[Nominal],
        whole: &WholeFit<'_>,
    ) -> Option<Suspicion> {
        let untried = self.change(change, sample, nominal);
        // a filter is not that of rows at another rate, and advice on delays of efforts cannot be followed here
        if change.is_of_times() {
            return untried;
        }
        let mut before = whole(&[]);
        if let (true, Some(before)) = (change.beside_weights, &mut before) {
            let plain = Change::none(change.efforts.len(), change.positions.len());
            self.scale(&plain, sample, before, &of_changes);
        }
        let fitted = |change: &Change| {
            let found = self.change(change, sample, nominal)?;
            let Remedy::Read { columns, .. } = &found.remedy else {
                return None;
            };
            let mut errors = whole(columns).filter(|_| !columns.is_empty())?;
            // an effort may be made as large as one likes by a constant, and its relative error as small
            self.scale(change, sample, &mut errors, &|values, offset| {
                spread_of(values, offset) / spread_of(values, 0.0)
            });
            if change.beside_weights {
                self.scale(change, sample, &mut errors, &of_changes);
            }
            let change = change.clone();
            Some(Fitted {
                change,
                found,
                errors,
            })
        };
        let flipped = self.with_positions_flipped(change, sample);
        let exchanged = self.with_positions_exchanged(change, sample);
        let rivals = change.rival.as_deref().into_iter().chain(&exchanged);
        let rivals = rivals.chain(&flipped).filter_map(fitted);
        let first = fitted(change);
        let (mut best, mut likewise) = (first, None);
        for own in rivals {
            let gain = best.as_ref().map_or(f64::INFINITY, |best| {
                log_product(&best.errors, LEAST_ERROR) - log_product(&own.errors, LEAST_ERROR)
            });
            if gain.abs() <= libm::log(MIN_GAIN_OF_RIVAL) {
                likewise = match Some(&own.change) {
                    other if other == flipped.as_ref() => Some("that of the position"),
                    other if other == exchanged.as_ref() => Some("the positions of their joints"),
                    _ => likewise,
                };
            }
            if gain > libm::log(MIN_GAIN_OF_RIVAL) {
                best = Some(own);
            }
        }
        let best = match (best, &before) {
            (Some(best), _) => best.with_best_number(fitted),
            // a log that can be read neither so nor otherwise may have further mistakes
            (None, None) if change.before.is_empty() => return untried,
            (None, _) => return None,
        };
        let mut out = best.found;
        if let Some(positions) = likewise {
            out.what = format!(
                "{}, or {positions}, which this log does not tell apart",
                out.what
            );
        }
        if let Some(before) = &before {
            let floor = if best.change.number_count() > 0 {
                LEAST_ERROR
            } else {
                LEAST_DOUBTED_ERROR
            };
            let gain = log_product(before, floor) - log_product(&best.errors, floor);
            let least = if change.sign {
                -libm::log(MAX_LOSS_OF_SIGNS)
            } else {
                0.0
            };
            if gain <= least {
                return None;
            }
            let worst = |errors: &[(String, f64)]| {
                let errors = errors.iter().map(|own| own.1);
                errors.filter(|error| error.is_finite()).reduce(f64::max)
            };
            (out.error, out.changed) = (worst(before), worst(&best.errors));
            let pairs = before.iter().zip(&best.errors);
            let pairs = pairs.filter(|(before, after)| (before.1 + after.1).is_finite());
            let both = pairs.map(|(before, after)| EffortChange {
                name: after.0.clone(),
                error: Some(before.1),
                changed: after.1,
            });
            out.efforts = both.collect();
        }
        Some(out)
    }

    /// Multiplies the error of each effort by a ratio of sizes of its column, as it is read with a change, without and
    /// with the constant that the change takes from it.
    fn scale(
        &self,
        change: &Change,
        sample: &Sample,
        errors: &mut [(String, f64)],
        ratio: &dyn Fn(&[f64], f64) -> f64,
    ) {
        let readings = change.efforts.iter().zip(&change.offsets);
        for (effort, (own, offset)) in readings.enumerate() {
            let coordinate = self.model.info().actuated.get(effort);
            let name = coordinate.map(|own| self.name(*own)).unwrap_or_default();
            let mut errors = errors.iter_mut().filter(|own| own.0 == name);
            if let Some(error) = errors.next() {
                let values = sample
                    .states
                    .iter()
                    .filter_map(|state| state.efforts.get(own.from));
                let values: Vec<f64> = values.map(|u| own.factor * u).collect();
                let ratio = ratio(&values, *offset);
                error.1 *= if ratio.is_finite() { ratio } else { 1.0 };
            }
        }
    }

    /// The change of the signs of the positions whose efforts have another sign with a change, which tells apart only
    /// what other joints need; `None` if it changes anything else.
    fn with_positions_flipped(&self, change: &Change, sample: &Sample) -> Option<Change> {
        let none = Change::none(change.efforts.len(), change.positions.len());
        let mut out = Change {
            before: change.before.clone(),
            after: change.after.clone(),
            beside_weights: change.beside_weights,
            ..none.clone()
        };
        let mut only = none.clone();
        for (effort, own) in change.efforts.iter().enumerate() {
            if own.factor < 0.0 {
                only.efforts.get_mut(effort)?.factor = -1.0;
                let place = self.place_of(effort, sample)?;
                out.positions.get_mut(place)?.factor = -1.0;
            }
        }
        let is_of_signs = only != none && only.efforts == change.efforts;
        (is_of_signs && change.has_efforts_only()).then_some(out)
    }

    /// The index of the position of an effort's joint among the measured ones.
    fn place_of(&self, effort: usize, sample: &Sample) -> Option<usize> {
        let coordinate = self.model.info().actuated.get(effort)?;
        sample.measured.iter().position(|own| own == coordinate)
    }

    /// The exchange of the positions that are exchanged if it is not the efforts, which legs that are alike hardly
    /// tell apart; `None` for any other change.
    fn with_positions_exchanged(&self, change: &Change, sample: &Sample) -> Option<Change> {
        let none = Change::none(change.efforts.len(), change.positions.len());
        let exchanged = change.efforts.iter().enumerate();
        let exchanged: Vec<(usize, usize)> = exchanged
            .filter(|(to, own)| own.from != *to)
            .map(|(to, own)| (to, own.from))
            .collect();
        let are_plain = (change.efforts.iter()).all(|own| (own.factor - 1.0).abs() < f64::EPSILON);
        if exchanged.is_empty() || !change.has_efforts_only() || !are_plain {
            return None;
        }
        let mut out = Change {
            before: change.before.clone(),
            after: change.after.clone(),
            beside_weights: change.beside_weights,
            ..none
        };
        for (to, from) in exchanged {
            // a column that has the effort of another joint is the position of that one, too, or has it instead
            let (column, joint) = (self.place_of(to, sample)?, self.place_of(from, sample)?);
            out.positions.get_mut(joint)?.from = column;
        }
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::swings_for_tests::{columns, sample, swings};
    use super::*;
    use crate::data::Quantity;

    /// One effort of which this part is left, percent.
    fn left(percent: f64) -> Vec<(String, f64)> {
        vec![("q1".to_owned(), percent)]
    }

    /// A change of the zero of the first position, and one of that of the third.
    fn shifted(first: f64, third: f64) -> Change {
        let one = |place: usize, zero: f64| {
            let mut out = Change::none(3, 3);
            out.positions[place].offset = zero;
            (out.before, out.after) = (vec![0.1; 3], vec![0.02; 3]);
            out
        };
        Change {
            rival: Some(Box::new(one(2, third))),
            ..one(0, first)
        }
    }

    /// The change that is told if the whole log is fitted so, as an assignment.
    fn told(change: &Change, whole: &WholeFit<'_>) -> Option<Assignment> {
        let model = swings(true);
        let found = columns(&model).tried(change, &sample(), &[], whole)?;
        let Remedy::Read { columns, .. } = found.remedy else {
            return None;
        };
        columns.first().cloned()
    }

    #[test]
    fn of_two_zeros_the_one_with_which_the_whole_log_fits_is_told_with_its_best_value() {
        let change = shifted(0.1, -0.2);
        let whole = |columns: &[Assignment]| {
            Some(match columns.first() {
                None => left(10.0),
                Some(own) if own.quantity == Quantity::Position("q1".to_owned()) => left(5.0),
                Some(own) => left(f64::hypot(1.0, 50.0 * (own.offset + 0.18))),
            })
        };
        let found = told(&change, &whole).unwrap();
        assert_eq!(found.quantity, Quantity::Position("q3".to_owned()));
        assert!((found.offset + 0.18).abs() < 1e-12, "{found:?}");
        // without fits, the sample decides
        let found = told(&change, &|_| None);
        assert_eq!(found, None, "the errors were known");
        let open = Change {
            before: Vec::new(),
            ..change
        };
        assert!((told(&open, &|_| None).unwrap().offset - 0.1).abs() < 1e-12);
        // a quarter of a turn is what somebody chose
        let quarter = core::f64::consts::FRAC_PI_2;
        let away = |columns: &[Assignment]| {
            let off = columns.first().map_or(1.0, |own| own.offset - 1.5);
            Some(left(1.0 + off.abs()))
        };
        let found = told(&shifted(quarter, 3.0), &away).unwrap();
        assert!((found.offset - quarter).abs() < 1e-4, "{found:?}");
    }

    #[test]
    fn a_factor_and_a_delay_have_the_values_with_which_the_whole_log_fits_best() {
        let of_factor = |found: f64, best: f64| {
            let mut change = Change::none(3, 3);
            change.efforts[1].factor = found;
            (change.before, change.after) = (vec![0.9; 3], vec![0.1; 3]);
            let whole = |columns: &[Assignment]| {
                let off = columns.first().map_or(9.0, |own| own.factor / best - 1.0);
                Some(left(10.0 * f64::hypot(0.1, off)))
            };
            told(&change, &whole).unwrap().factor
        };
        let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 0.01;
        assert!(near(of_factor(0.2, 0.23), 0.23));
        // what is nearly a unit is one, unless the log fits clearly worse so
        assert!((of_factor(10.9, 9.79) - 9.806_65).abs() < 1e-9);
        assert!(near(of_factor(10.9, 10.8), 10.8));
        let mut change = Change::none(3, 3);
        change.late = vec![(1, 0.05)];
        (change.before, change.after) = (vec![0.9; 3], vec![0.1; 3]);
        let whole = |columns: &[Assignment]| {
            let off = columns.first().map_or(9.0, |own| own.late / 0.062 - 1.0);
            Some(left(10.0 * f64::hypot(0.1, off)))
        };
        let found = told(&change, &whole).unwrap();
        assert_eq!(found.quantity, Quantity::Position("q2".to_owned()));
        assert!(near(found.late, 0.062), "{found:?}");
    }

    #[test]
    fn positions_are_exchanged_where_the_whole_log_fits_better_so_than_with_other_efforts() {
        let model = swings(true);
        let sample = sample();
        let mut change = Change::none(3, 3);
        for (own, from) in change.efforts.iter_mut().zip([1, 2, 0]) {
            own.from = from;
        }
        (change.before, change.after) = (vec![0.9; 3], vec![0.1; 3]);
        let found = |of_positions: f64| {
            let whole = move |columns: &[Assignment]| {
                let of_efforts = |own: &Assignment| matches!(own.quantity, Quantity::Effort(_));
                Some(left(match columns.first() {
                    None => 90.0,
                    Some(own) if of_efforts(own) => 10.0,
                    Some(_) => of_positions,
                }))
            };
            let found = columns(&model)
                .tried(&change, &sample, &[], &whole)
                .unwrap();
            let Remedy::Read { columns, .. } = found.remedy else {
                panic!("{found:?}")
            };
            let columns = columns.iter().take(3);
            let columns = columns.map(|own| format!("{}={}", own.quantity, own.column));
            let is_either = found
                .what
                .contains(", or the positions of their joints, which");
            (columns.collect::<Vec<_>>().join(" "), is_either)
        };
        let efforts = "tau_q1=tau_q2 tau_q2=tau_q3 tau_q3=tau_q1".to_owned();
        assert_eq!(found(20.0), (efforts.clone(), false));
        assert_eq!(found(9.99), (efforts, true));
        // the first column has the second joint's label, and so the first joint's position is in the second
        assert_eq!(found(1.0), ("q1=q3 q2=q1 q3=q2".to_owned(), false));
    }

    #[test]
    fn positions_are_flipped_where_the_whole_log_fits_better_so_than_with_flipped_efforts() {
        let mut change = Change::none(3, 3);
        change.efforts[1].factor = -1.0;
        (change.before, change.after) = (vec![0.9; 3], vec![0.1; 3]);
        let with = |of_positions: f64| {
            move |columns: &[Assignment]| {
                let of_efforts = |own: &Assignment| matches!(own.quantity, Quantity::Effort(_));
                Some(left(match columns.first() {
                    None => 90.0,
                    Some(own) if of_efforts(own) => 10.0,
                    Some(_) => of_positions,
                }))
            }
        };
        let model = swings(true);
        let found = |of_positions: f64| {
            let whole = with(of_positions);
            let found = columns(&model)
                .tried(&change, &sample(), &[], &whole)
                .unwrap();
            let Remedy::Read { columns, .. } = found.remedy else {
                panic!("{found:?}")
            };
            (
                columns[0].quantity.clone(),
                found.what.contains("does not tell apart"),
            )
        };
        assert_eq!(found(11.0), (Quantity::Effort("q2".to_owned()), false));
        assert_eq!(found(9.99), (Quantity::Effort("q2".to_owned()), true));
        assert_eq!(found(5.0), (Quantity::Position("q2".to_owned()), false));
    }

    #[test]
    fn an_effort_that_a_constant_only_makes_larger_is_explained_no_better() {
        let sample = sample();
        let values: Vec<f64> = sample.states.iter().map(|own| own.efforts[0]).collect();
        let constant = -40.0 * spread_of(&values, 0.0);
        let larger = spread_of(&values, constant) / spread_of(&values, 0.0);
        assert!(larger > 3.0, "{larger}");
        let mut change = Change::none(3, 3);
        change.offsets[0] = constant;
        (change.before, change.after) = (vec![0.1; 3], vec![0.02; 3]);
        let told = |residual: f64| {
            let whole = |columns: &[Assignment]| {
                Some(left(if columns.is_empty() {
                    10.0
                } else {
                    residual / larger
                }))
            };
            told(&change, &whole).is_some()
        };
        assert!(told(9.0) && !told(10.1));
    }

    #[test]
    fn columns_are_not_exchanged_in_a_log_that_is_explained_within_a_percent() {
        let mut change = Change::none(3, 3);
        (change.efforts[0].from, change.efforts[1].from) = (1, 0);
        (change.before, change.after) = (vec![0.1; 3], vec![0.02; 3]);
        let told = |before: f64, after: f64| {
            let whole = |columns: &[Assignment]| {
                Some(left(if columns.is_empty() { before } else { after }))
            };
            told(&change, &whole).is_some()
        };
        assert!(told(1.5, 0.5) && !told(0.9, 0.2));
    }

    #[test]
    fn what_does_not_lessen_the_errors_of_the_whole_log_is_not_told() {
        let with_left = |percent: f64| {
            move |columns: &[Assignment]| {
                Some(left(if columns.is_empty() { 10.0 } else { percent }))
            }
        };
        let change = shifted(0.1, -0.2);
        assert!(told(&change, &with_left(9.0)).is_some());
        assert!(told(&change, &with_left(10.5)).is_none());
        let mut signs = Change::none(3, 3);
        signs.efforts[0].factor = -1.0;
        signs.sign = true;
        assert!(told(&signs, &with_left(10.1)).is_some());
        assert!(told(&signs, &with_left(10.5)).is_none());
    }
}
