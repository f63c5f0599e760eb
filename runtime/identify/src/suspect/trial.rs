//! Tries a model on a log as it was read, so that a change of the spec is advised only where it fits
//! the log better.

use super::grams::{Fit, Grams, Stored};
use super::words::LogColumns;
use super::{
    Change, EffortChange, MIN_DOUBTED_ERROR, Nominal, Reading, Remedy, STATES, Sample, Suspicion,
    implausible_count, is_less_explained, least_states, quality,
};
use crate::data::Assignment;
use regen_runtime::BaseModel;

/// The part that another gravity may leave of the largest error.
const MAX_LEFT_OF_WORST: f64 = 0.8;
/// The factor by which another gravity must reduce the product of errors, as half of it is not an
/// accident.
const MIN_GAIN: f64 = 2.0;
/// The same, where it leaves fewer inertias negative.
const MIN_GAIN_IF_PLAUSIBLE: f64 = 1.3;
/// A change of the spec may increase the product of errors by this factor if the nominal bodies then
/// explain the efforts.
const MAX_LOSS: f64 = 1.05;
/// The factor by which a change of the spec must reduce what the nominal bodies leave of the efforts.
const MIN_GAIN_OF_NOMINAL: f64 = 3.0;
/// The largest part of an effort that the nominal bodies may leave after a change of the spec.
const MAX_LEFT_BY_NOMINAL: f64 = 0.5;
/// A constant below this part of what the nominal bodies need may come from masses that are not quite the nominal ones,
/// which gravity makes large beside a gentle motion.
const MIN_LACKING_PART: f64 = 0.5;
/// Distances of states, s, at which residuals are correlated: beyond the memory of usual filters, within the
/// motion.
const LAGS: [f64; 3] = [0.05, 0.1, 0.2];
/// With a smaller correlation they are noise.
pub(super) const MAX_CORRELATION_OF_NOISE: f64 = 0.35;
/// With fewer pairs of states nothing is said of that.
const MIN_PAIRS: usize = 50;
/// The factor by which a fit of the whole log may be worse with a change that only flips signs.
const MAX_LOSS_OF_SIGNS: f64 = 1.02;
/// The part by which a zero that was found is changed to find a better one.
const PART_OF_ZERO: f64 = 0.1;
/// A zero that is a whole number of quarters of a turn, but for rounding, is round.
const MAX_OFF_QUARTERS: f64 = 1e-9;
/// The smallest error of an effort that is compared, percent.
const LEAST_ERROR: f64 = 0.1;
/// The number of states of a short trial, unless the parameters need more.
const FEW_STATES: usize = 150;

/// How well a model fits a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The error of each equation: rms of the residuals over rms of the efforts about their mean.
    pub errors: Vec<f64>,
    /// What the nominal bodies leave of the effort of each equation, over the same; empty where they
    /// are not known.
    pub nominal: Vec<f64>,
    /// The largest correlation of residuals at some lags, of any equation: that of noise is small.
    pub correlation: f64,
    /// How many directions have a negative inertia, and how many joints are driven by their friction.
    pub implausible: usize,
}

/// Fits the whole log with some columns read in another way, and returns the error of each effort with its name, as
/// [`errors_with_columns`](crate::session::errors_with_columns) does; `None` where no fit is possible or known.
pub type WholeFit<'a> = dyn Fn(&[Assignment]) -> Option<Vec<(String, f64)>> + 'a;

/// The product of the errors of the efforts, as the sum of its logarithms.
fn log_product(errors: &[(String, f64)]) -> f64 {
    let errors = errors.iter().map(|own| own.1);
    let errors = errors.filter(|error| error.is_finite());
    errors.map(|error| libm::log(error.max(LEAST_ERROR))).sum()
}

/// A change with which the whole log was fitted.
struct Fitted {
    change: Change,
    found: Suspicion,
    errors: Vec<(String, f64)>,
}

/// Fits a model to a sample of a log; `None` where the loops do not close or an effort is constant.
pub fn trial<M: BaseModel<f64> + ?Sized>(model: &M, sample: &Sample) -> Option<Trial> {
    of(model, sample, &grams(model, sample, STATES)?, &[])
}

/// As [`trial`], with few states: enough to see whether it is worth one with all.
pub fn short_trial<M: BaseModel<f64> + ?Sized>(model: &M, sample: &Sample) -> Option<Trial> {
    let states = FEW_STATES.max(least_states(model));
    of(model, sample, &grams(model, sample, states)?, &[])
}

fn grams<M: BaseModel<f64> + ?Sized>(model: &M, sample: &Sample, states: usize) -> Option<Grams> {
    let every = sample.states.len().div_ceil(states).max(1);
    let plain = Reading::plain(sample.measured.len());
    Grams::of(model, sample, &plain, every).filter(Grams::closes)
}

/// The fit with a free constant in some efforts.
fn of<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    grams: &Grams,
    offsets: &[usize],
) -> Option<Trial> {
    let read = Reading::plain(model.info().actuated.len());
    let fit = grams.fit(&read, offsets)?;
    Some(Trial {
        correlation: correlation(sample, grams, &fit),
        implausible: implausible_count(model, grams, &fit),
        errors: fit.errors,
        nominal: grams
            .errors_of_nominal(model, &read, offsets)
            .unwrap_or_default(),
    })
}

/// The largest correlation of the residuals of any equation at [`LAGS`].
pub(super) fn correlation(sample: &Sample, grams: &Grams, fit: &Fit) -> f64 {
    let time = |own: &Stored| sample.states.get(own.state).map_or(f64::NAN, |s| s.time);
    let mut out: f64 = 0.0;
    for lag in LAGS {
        let mut pairs = Vec::new();
        let mut begin = 0;
        for (k, own) in grams.stored.iter().enumerate() {
            while begin < k && time(own) - time(&grams.stored[begin]) > 1.2 * lag {
                begin += 1;
            }
            if begin < k && time(own) - time(&grams.stored[begin]) > 0.8 * lag {
                pairs.push((begin, k));
            }
        }
        if pairs.len() < MIN_PAIRS {
            continue;
        }
        for i in 0..grams.rows() {
            let left: Vec<f64> = (grams.stored.iter())
                .map(|own| own.residual(i, &fit.values))
                .collect();
            let products = pairs.iter().map(|(a, b)| left[*a] * left[*b]);
            let squares = pairs
                .iter()
                .map(|(a, b)| 0.5 * (left[*a].powi(2) + left[*b].powi(2)));
            let (sum, squares) = (products.sum::<f64>(), squares.sum::<f64>());
            if squares > 0.0 {
                out = out.max((sum / squares).abs());
            }
        }
    }
    if out > 0.0 { out } else { 1.0 }
}

impl Fitted {
    /// The same change with the zero of its position with which the whole log fits best, if that is its only number:
    /// the lowest point of a parabola through the mean squares at three zeros.
    fn with_best_zero(self, fitted: impl Fn(&Change) -> Option<Self>) -> Self {
        let zeros = self.change.positions.iter().enumerate();
        let mut zeros = zeros.filter(|(_, own)| own.offset != 0.0);
        let Some((place, zero)) = zeros.next().map(|(k, own)| (k, own.offset)) else {
            return self;
        };
        let quarters = zero / core::f64::consts::FRAC_PI_2;
        let is_round = (quarters - quarters.round()).abs() < MAX_OFF_QUARTERS;
        if self.change.number_count() != 1 || is_round {
            return self;
        }
        let first = self.change.clone();
        let at = |offset: f64| {
            let mut change = first.clone();
            let positions = change.positions.iter_mut().skip(place).take(1);
            positions.for_each(|own| own.offset = offset);
            fitted(&change)
        };
        let here = self.errors.clone();
        let squares = |own: &Self| {
            let pairs = own.errors.iter().zip(&here);
            let ratios = pairs.map(|(own, here)| own.1 / here.1);
            let ratios = ratios.filter(|ratio| ratio.is_finite());
            ratios.map(|ratio| ratio * ratio).sum::<f64>()
        };
        let step = PART_OF_ZERO * zero;
        let (Some(below), Some(above)) = (at(zero - step), at(zero + step)) else {
            return self;
        };
        let fits = [(zero - step, &below), (zero, &self), (zero + step, &above)];
        let lowest = lowest_of_parabola(fits.map(|(x, own)| (x, squares(own))));
        let within = |x: &f64| (x - zero).abs() < 3.0 * step.abs();
        let best = lowest.filter(within).and_then(at);
        let others = [below, above].into_iter().chain(best);
        others.fold(self, |best, own| {
            if squares(&own) < squares(&best) {
                own
            } else {
                best
            }
        })
    }
}

/// Where the parabola through three points is lowest; `None` if it is not.
fn lowest_of_parabola([a, b, c]: [(f64, f64); 3]) -> Option<f64> {
    let slope = |a: (f64, f64), b: (f64, f64)| (b.1 - a.1) / (b.0 - a.0);
    let (first, second) = (slope(a, b), slope(b, c));
    let curvature = (second - first) / (c.0 - a.0);
    (curvature > 0.0).then(|| 0.5 * (a.0 + b.0 - first / curvature))
}

impl Trial {
    /// Whether a log may contradict the model, so that it is worth trying others.
    pub fn is_doubtful(&self) -> bool {
        let is_noise = self.correlation < MAX_CORRELATION_OF_NOISE;
        (self.errors.iter().any(|e| *e > MIN_DOUBTED_ERROR) && !is_noise)
            || self.implausible > 0
            || self.nominal.iter().any(|e| *e > MAX_LEFT_BY_NOMINAL)
    }

    /// Whether this explains more than another change: what the nominal bodies leave counts as the
    /// errors do.
    pub fn is_better_than(&self, other: &Self) -> bool {
        let all = |of: &Self| quality(&of.errors) * quality(&of.nominal);
        all(self) * MAX_LOSS < all(other)
    }

    /// The factor by which this fits better than another, if that is no accident: it halves the
    /// errors, or the nominal bodies explain the efforts only so.
    pub fn gain_over(&self, other: &Self) -> Option<f64> {
        let gain = quality(&other.errors) / quality(&self.errors);
        let explained = self.nominal.iter().all(|e| *e < MAX_LEFT_BY_NOMINAL);
        let nominal = quality(&other.nominal) / quality(&self.nominal);
        let known = !self.nominal.is_empty() && self.nominal.len() == other.nominal.len();
        // the nominal bodies tell an effort without its weight, which any fit explains
        let by_nominal = known && explained && nominal >= MIN_GAIN_OF_NOMINAL;
        // bodies that fitted before are not those of a robot under another gravity
        let against = known && nominal < 1.0 / MIN_GAIN;
        let needed = if self.implausible < other.implausible {
            MIN_GAIN_IF_PLAUSIBLE
        } else {
            MIN_GAIN
        };
        let worst = self.worst() < MAX_LEFT_OF_WORST * other.worst();
        let harms = is_less_explained(&other.errors, &self.errors);
        (((gain >= needed && worst && !against) || (by_nominal && gain * MAX_LOSS >= 1.0))
            && !harms)
            .then_some(gain * if known { nominal } else { 1.0 })
    }

    /// The largest error, percent.
    fn worst(&self) -> f64 {
        100.0 * self.errors.iter().fold(0.0, |m: f64, e| m.max(*e))
    }
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
        // a filter is not that of rows at another rate, and advice on delays cannot be followed here
        if change.is_of_times() {
            return untried;
        }
        let before = whole(&[]);
        let fitted = |change: &Change| {
            let found = self.change(change, sample, nominal)?;
            let Remedy::Read { columns, .. } = &found.remedy else {
                return None;
            };
            let errors = whole(columns).filter(|_| !columns.is_empty())?;
            let change = change.clone();
            Some(Fitted {
                change,
                found,
                errors,
            })
        };
        let of_positions = self.with_positions_exchanged(change, sample);
        let rivals = change.rival.as_deref().into_iter().chain(&of_positions);
        let all = [change].into_iter().chain(rivals).filter_map(fitted);
        let best = all.min_by(|a, b| log_product(&a.errors).total_cmp(&log_product(&b.errors)));
        let best = match (best, &before) {
            (Some(best), _) => best.with_best_zero(fitted),
            // a log that can be read neither so nor otherwise may have further mistakes
            (None, None) if change.before.is_empty() => return untried,
            (None, _) => return None,
        };
        let mut out = best.found;
        if let Some(before) = &before {
            let gain = log_product(before) - log_product(&best.errors);
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
            out.changed_in_sample = out.changed;
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

    /// The exchange of the positions that are exchanged if it is not the efforts, which legs that are alike hardly
    /// tell apart; `None` for any other change.
    fn with_positions_exchanged(&self, change: &Change, sample: &Sample) -> Option<Change> {
        let actuated = self.model.info().actuated;
        let none = Change::none(change.efforts.len(), change.positions.len());
        let exchanged = change.efforts.iter().enumerate();
        let exchanged: Vec<(usize, usize)> = exchanged
            .filter(|(to, own)| own.from != *to)
            .map(|(to, own)| (to, own.from))
            .collect();
        let only = Change {
            efforts: none.efforts.clone(),
            before: Vec::new(),
            after: Vec::new(),
            rival: None,
            ..change.clone()
        };
        let are_plain = (change.efforts.iter()).all(|own| (own.factor - 1.0).abs() < f64::EPSILON);
        if exchanged.is_empty() || only != none || !are_plain {
            return None;
        }
        let place = |effort: usize| {
            let coordinate = actuated.get(effort)?;
            sample.measured.iter().position(|own| own == coordinate)
        };
        let mut out = Change {
            before: change.before.clone(),
            after: change.after.clone(),
            ..none
        };
        for (to, from) in exchanged {
            // a column that has the effort of another joint is the position of that one, too, or has it instead
            let (column, joint) = (place(to)?, place(from)?);
            out.positions.get_mut(joint)?.from = column;
        }
        Some(out)
    }

    /// The suspicion that a log is that of another spec, which was tried on it.
    ///
    /// - `before`, `after`: the fits of both;
    /// - `advice`: the change of the spec, a sentence without its full stop.
    pub fn other_spec(
        &self,
        what: String,
        before: &Trial,
        after: &Trial,
        advice: String,
    ) -> Suspicion {
        let info = self.model.info();
        let names = info.independent.iter().map(|c| self.name(*c));
        let errors = before.errors.iter().zip(&after.errors);
        let efforts = names.zip(errors).map(|(name, (error, changed))| {
            let [error, changed] = [error, changed].map(|e| 100.0 * e);
            EffortChange {
                name,
                error: Some(error),
                changed,
            }
        });
        let mut out = self.suspicion(
            what,
            Remedy::Read {
                advice: vec![advice],
                columns: Vec::new(),
            },
        );
        out.efforts = efforts.collect();
        out.error = Some(before.worst());
        out.changed = Some(after.worst());
        out
    }
}

/// The suspicion that efforts lack the weight of the nominal bodies, which a constant explains; `None`
/// if none does. It is the offset that was tried, and so joints that have one are not named.
pub fn weightless<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Option<(Suspicion, Trial)> {
    let (model, info) = (columns.model, columns.model.info());
    let grams = grams(model, sample, STATES)?;
    let before = of(model, sample, &grams, &[])?;
    let has_offset = |k: &usize| {
        let name = info.actuated.get(*k).map(|c| columns.name(*c));
        let offset = name.map(|name| {
            info.parameters
                .iter()
                .any(|p| p.is_offset() && p.owner == name)
        });
        offset.unwrap_or(true)
    };
    let mut offsets: Vec<usize> = Vec::new();
    let mut now = before.clone();
    for k in (0..info.actuated.len()).filter(|k| !has_offset(k)) {
        let mut more = offsets.clone();
        more.push(k);
        let Some(found) = of(model, sample, &grams, &more) else {
            continue;
        };
        // friction that differs between both directions takes a constant up
        let by_nominal = quality(&now.nominal) >= MIN_GAIN_OF_NOMINAL * quality(&found.nominal);
        let i = (0..grams.rows()).find(|i| grams.only_effort(*i) == Some(k));
        let explained = i
            .and_then(|i| found.nominal.get(i))
            .is_some_and(|e| *e < MAX_LEFT_BY_NOMINAL);
        let read = Reading::plain(info.actuated.len());
        let lacks = i.is_some_and(|i| grams.lacking_part(i, &read) > MIN_LACKING_PART);
        if by_nominal && explained && lacks {
            (offsets, now) = (more, found);
        }
    }
    if offsets.is_empty() {
        return None;
    }
    let joints: Vec<String> = offsets
        .iter()
        .filter_map(|k| info.actuated.get(*k))
        .map(|c| format!("`{}`", columns.name(*c)))
        .collect();
    let names: Vec<String> = offsets
        .iter()
        .map(|k| format!("`{}`", columns.effort(*k).column))
        .collect();
    let left = |trial: &Trial| {
        let most = trial.nominal.iter().fold(0.0, |m: f64, e| m.max(*e));
        100.0 * most
    };
    let what = format!(
        "the weight of the nominal bodies, or another constant, is missing in {}: with an offset \
         they leave at most {:.0} % of an effort, and {:.0} % without it",
        names.join(", "),
        left(&now),
        left(&before),
    );
    let advice = format!("Give {} `offset: true` in the spec", joints.join(" and "));
    Some((columns.other_spec(what, &before, &now, advice), now))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::swings_for_tests::{Swings, sample, swings, with};
    use super::*;
    use crate::data::Quantity;

    /// One effort of which this part is left, percent.
    fn left(percent: f64) -> Vec<(String, f64)> {
        vec![("q1".to_owned(), percent)]
    }

    fn columns_of(model: &Swings) -> LogColumns<'_, Swings> {
        LogColumns {
            file: "log.csv",
            given: &[],
            model,
        }
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
        let found = columns_of(&model).tried(change, &sample(), &[], whole)?;
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
            let found = columns_of(&model)
                .tried(&change, &sample, &[], &whole)
                .unwrap();
            let Remedy::Read { columns, .. } = found.remedy else {
                panic!("{found:?}")
            };
            let columns = columns.iter().take(3);
            columns
                .map(|own| format!("{}={}", own.quantity, own.column))
                .collect::<Vec<_>>()
        };
        assert_eq!(
            found(20.0),
            ["tau_q1=tau_q2", "tau_q2=tau_q3", "tau_q3=tau_q1"]
        );
        // the first column has the second joint's label, and so the first joint's position is in the second
        assert_eq!(found(1.0), ["q1=q3", "q2=q1", "q3=q2"]);
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

    fn of_errors(error: f64, nominal: f64, correlation: f64, implausible: usize) -> Trial {
        Trial {
            errors: vec![error, 0.01],
            nominal: vec![nominal, 0.1],
            correlation,
            implausible,
        }
    }

    #[test]
    fn a_log_is_doubtful_by_errors_that_are_no_noise_signs_or_nominal_bodies() {
        assert!(!of_errors(0.01, 0.1, 0.9, 0).is_doubtful());
        assert!(of_errors(0.2, 0.1, 0.9, 0).is_doubtful());
        assert!(!of_errors(0.2, 0.1, 0.1, 0).is_doubtful());
        assert!(of_errors(0.01, 0.1, 0.1, 1).is_doubtful());
        assert!(of_errors(0.01, 0.9, 0.1, 0).is_doubtful());
    }

    #[test]
    fn a_change_gains_by_half_the_errors_or_by_what_the_nominal_bodies_explain() {
        let gain = |after: &Trial, before: &Trial| after.gain_over(before);
        let before = of_errors(0.4, 0.4, 0.9, 0);
        let half = gain(&of_errors(0.1, 0.4, 0.9, 0), &before).unwrap();
        assert!((half - 4.0).abs() < 1e-9);
        assert_eq!(gain(&of_errors(0.35, 0.4, 0.9, 0), &before), None);
        // less is enough if what was negative is not any more
        let negative = of_errors(0.4, 0.4, 0.9, 1);
        assert!(gain(&of_errors(0.28, 0.4, 0.9, 0), &negative).is_some());
        assert_eq!(gain(&of_errors(0.28, 0.4, 0.9, 0), &before), None);
        // the same errors, which the nominal bodies explain only so
        let unexplained = of_errors(0.4, 2.0, 0.9, 0);
        let explained = gain(&of_errors(0.4, 0.2, 0.9, 0), &unexplained).unwrap();
        assert!((explained - 10.0).abs() < 1e-9);
        assert_eq!(gain(&of_errors(0.4, 1.0, 0.9, 0), &unexplained), None);
        // bodies that fitted before are not those of another gravity
        assert_eq!(
            gain(&of_errors(0.1, 2.0, 0.9, 0), &of_errors(0.4, 0.2, 0.9, 0)),
            None
        );
        assert!((before.worst() - 40.0).abs() < 1e-9);
    }

    #[test]
    fn a_weight_that_is_missing_is_told_with_what_the_bodies_leave_of_the_effort() {
        let model = swings(true);
        let sample = with(|s| s.efforts[1] -= 6.0);
        let columns = LogColumns {
            file: "log.csv",
            given: &[],
            model: &model,
        };
        let before = trial(&model, &sample).unwrap();
        let (found, after) = weightless(&columns, &sample).unwrap();
        let left = |own: &Trial| 100.0 * own.nominal.iter().fold(0.0, |m: f64, e| m.max(*e));
        let (now, without) = (left(&after), left(&before));
        assert!(now < 20.0 && without > 80.0, "{now} {without}");
        let words = format!("at most {now:.0} % of an effort, and {without:.0} % without it");
        assert!(
            found.what.contains("`tau_q2`") && found.what.contains(&words),
            "{}",
            found.what
        );
        // what a mass that is a little off needs more is no missing weight, nor is a log as it is
        for constant in [0.0, 0.7] {
            let sample = with(|s| s.efforts[1] -= constant);
            assert!(weightless(&columns, &sample).is_none(), "{constant}");
        }
    }
}
