//! Tries a model on a log as it was read, so that a change of the spec is advised only where it fits
//! the log better.

use super::grams::{Fit, Grams, Stored};
use super::words::LogColumns;
use super::{
    EffortChange, MAX_LEFT_OF_WORST, MIN_DOUBTED_ERROR, Reading, Remedy, STATES, Sample, Suspicion,
    UNEXPLAINED_ERROR, implausible_count, is_less_explained, least_states, left_of, quality,
};
use regen_runtime::BaseModel;

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
        // another mistake may leave one effort unexplained that gravity does not act on
        let is_explained =
            |pair: (&f64, &f64)| *pair.0 > UNEXPLAINED_ERROR && *pair.1 < MIN_DOUBTED_ERROR;
        let worst = self.worst() < MAX_LEFT_OF_WORST * other.worst()
            || other.errors.iter().zip(&self.errors).any(is_explained);
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
        out.left_in_sample = Some(left_of(&after.errors));
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
    let equations: Vec<usize> = (0..grams.rows())
        .filter(|i| {
            grams
                .only_effort(*i)
                .is_some_and(|own| offsets.contains(&own))
        })
        .collect();
    // others, such as those that are noise alone, say nothing of it
    let left = |trial: &Trial| {
        let own = equations.iter().filter_map(|i| trial.nominal.get(*i));
        100.0 * own.fold(0.0, |m: f64, e| m.max(*e))
    };
    let what = format!(
        "the weight of the nominal bodies, or another constant, is missing in {}: with an offset \
         they leave at most {:.0} % of the effort, and {:.0} % without it",
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

    use super::super::swings_for_tests::{swings, with};
    use super::*;

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
        // another mistake may leave one effort as it was
        let pair = |first: f64, second: f64| Trial {
            errors: vec![first, second],
            ..before.clone()
        };
        assert!(gain(&pair(0.98, 0.02), &pair(1.0, 0.9)).is_some());
        assert_eq!(gain(&pair(0.98, 0.1), &pair(1.0, 0.9)), None);
        // less is enough if what was negative is not any more
        let negative = of_errors(0.4, 0.4, 0.9, 1);
        assert!(gain(&of_errors(0.27, 0.4, 0.9, 0), &negative).is_some());
        assert_eq!(gain(&of_errors(0.27, 0.4, 0.9, 0), &before), None);
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
        let words = format!("at most {now:.0} % of the effort, and {without:.0} % without it");
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
