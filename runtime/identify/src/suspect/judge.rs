//! Describes what looks wrong with a log, and the remedy, by comparing its columns with each other,
//! with the nominal bodies and with the limits.

use regen_runtime::BaseModel;
use serde::Serialize;

use super::facts::CERTAIN_DEVIATIONS;
use super::words::{LogColumns, rounded};
use super::{Change, Findings, Nominal, Sample, WholeFit, facts, look, positions};
use crate::data::{Assignment, Quantity};
use crate::estimate::Estimate;
use crate::text;

/// The largest rms of a Fourier series' residuals, relative to that of the positions about their
/// mean: more cannot be noise.
const MAX_SERIES_RESIDUAL: f64 = 0.1;
/// The largest rms of a Fourier series' residuals over the noise of the position, where an effort has
/// a larger relative error than [`MAX_SERIES_ERROR`]: more is motion that the series lacks.
const MAX_SERIES_OVER_NOISE: f64 = 10.0;
/// The relative error of an effort above which what a series misses of the motion is mentioned.
const MAX_SERIES_ERROR: f64 = 0.05;
/// The smallest step, s, at which the unit of time is doubted: no moving robot is logged so slowly.
const MIN_SLOW_STEP_S: f64 = 0.5;
/// The highest speed, rad/s or m/s, of a log whose unit of time is doubted.
const MAX_STILL_SPEED: f64 = 0.05;
/// The smallest absolute correlation at which an effort is compared with that of the nominal
/// bodies.
pub(super) const MIN_CORRELATION: f64 = 0.8;
/// The smallest correlation at which a factor between the two is reported, as payloads and unknown
/// bodies change it too.
const MIN_CORRELATION_OF_FACTOR: f64 = 0.95;
/// The largest factor by which nominal values may be wrong.
const MAX_NOMINAL_FACTOR: f64 = 4.0;
/// The smallest part of an effort's rms that is neither friction nor constant, for it to be
/// compared with the nominal bodies.
pub(super) const MIN_COMPARED_PART: f64 = 0.2;
/// A largest error that is reduced to more than this part says nothing of a change.
const MIN_TOLD_PART: f64 = 0.9;
/// A position beyond its limits by less than this part of their distance is not doubted.
const MAX_BEYOND_PART: f64 = 0.05;
/// The part of the rows from which on positions beyond their limits are doubted.
const MIN_BEYOND_TIME: f64 = 0.5;
/// An effort of more than this many times its limit is in another unit.
const MIN_LIMIT_RATIO: f64 = 10.0;

/// A suspected mistake in a log. Its remedy is not serialised: each program words it in its own
/// options.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Suspicion {
    /// The name of the log.
    pub file: String,
    /// A description of the mistake.
    pub what: String,
    /// The largest error of the efforts without the change: rms of the residuals over rms of the
    /// effort about its mean, percent; `None` where the loops do not close, or the suspicion is not
    /// about errors.
    pub error: Option<f64>,
    /// The same error with the change.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changed: Option<f64>,
    /// What the change leaves of the efforts in the sample: the geometric mean of their errors, percent. Changes
    /// of the spec are tried on the sample only.
    #[serde(skip)]
    pub left_in_sample: Option<f64>,
    /// The error of each effort without and with the change.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub efforts: Vec<EffortChange>,
    /// The remedy.
    #[serde(skip)]
    pub remedy: Remedy,
}

/// The error of an effort without and with a change, percent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffortChange {
    /// The name of the coordinate.
    pub name: String,
    /// The error without the change; `None` where the loops do not close.
    pub error: Option<f64>,
    /// The error with the change.
    pub changed: f64,
}

/// The remedy for a log that looks wrong.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Remedy {
    /// Follow advice, and read columns in another way; either may be empty.
    Read {
        /// The steps to take first, each a sentence without its full stop.
        advice: Vec<String>,
        /// The new assignment of columns to quantities.
        columns: Vec<Assignment>,
    },
    /// Fit a Fourier series with the frequency of the motion and enough harmonics, or smooth by a
    /// filter.
    Series,
    /// Bound the weight of large residuals by Huber's loss, or leave rows out.
    Bounded,
    /// Look for the cause in the sign, the delay or the offset of an effort or in the motion, or
    /// solve for physical parameters only.
    Physical,
}

impl Remedy {
    /// Whether it says how columns are to be read.
    pub fn gives_columns(&self) -> bool {
        matches!(self, Self::Read { columns, .. } if !columns.is_empty())
    }

    /// The remedy of reading columns in another way.
    pub(super) fn columns(columns: Vec<Assignment>) -> Self {
        Self::Read {
            advice: Vec::new(),
            columns,
        }
    }
}

impl Suspicion {
    /// The effort whose error is reduced most, with the error with the change and without it; `None` if none is.
    fn most_reduced(&self) -> Option<(&str, f64, f64)> {
        let ratio = |own: &EffortChange| own.error.map_or(0.0, |error| error / own.changed);
        let best = self
            .efforts
            .iter()
            .max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
        (ratio(best) > 1.0).then_some((best.name.as_str(), best.changed, best.error?))
    }
}

impl std::fmt::Display for Suspicion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.file, self.what)?;
        if let (Some(changed), Some(error)) = (self.changed, self.error) {
            // where what it says is not about the errors of efforts, these are the same
            let [changed, error] = [changed, error].map(|e| format!("{e:.1}"));
            if changed == error {
                return Ok(());
            }
            // another effort has the largest error then, or noise
            if self.changed > self.error.map(|error| MIN_TOLD_PART * error)
                && let Some((name, changed, error)) = self.most_reduced()
            {
                return write!(
                    f,
                    ": so read, the error of `{name}` is {changed:.1} % and not {error:.1} %"
                );
            }
            write!(
                f,
                ": so read, the largest error of an effort is {changed} % and not {error} %"
            )
        } else if let Some(changed) = self.changed {
            write!(
                f,
                ": so read, the loops close, and the largest error of an effort is {changed:.1} %"
            )
        } else {
            Ok(())
        }
    }
}

/// Lists what looks wrong with one log, the most certain first: its clock, its Fourier series,
/// columns that are swapped, of flipped sign, shifted or in another unit, efforts that contradict
/// the nominal bodies or their limits, parameters that no body has, and spikes in efforts.
///
/// - `columns`: the log and the assignment of its columns;
/// - `sample`: some of its states, see [`Logs::sample`](crate::data::Logs::sample);
/// - `estimate`: that from all logs, with standard deviations; `None` where there is none;
/// - `whole`: fits the whole log with a change, which is told only if it fits better;
/// - `step`: called with the number of hypotheses tried so far and in total.
///
/// ```
/// use regen_identify::suspect::{LogColumns, Remedy, suspicions};
/// use regen_identify::data::{Measured, Sample};
/// # use regen_runtime::{
/// #     Arguments, BaseFunction, BaseInfo, BaseModel, Condition, Function, Info, Model, SizeError,
/// # };
/// # struct Slide;
/// # impl Model for Slide {
/// #     fn info(&self) -> Info<'_> {
/// #         Info { coordinates: &["q"], independent: &[0], actuated: &[0], ..Info::EMPTY }
/// #     }
/// #     fn eval(
/// #         &self, _: Function, _: Arguments<'_, f64>, _: &mut [f64],
/// #     ) -> Result<Condition<f64>, SizeError> {
/// #         Ok(Condition::regular(0.0))
/// #     }
/// # }
/// # impl BaseModel for Slide {
/// #     fn base_info(&self) -> BaseInfo<'_> {
/// #         BaseInfo { base: &[], free: &[], certificate: None, complete: true }
/// #     }
/// #     fn eval_base(
/// #         &self, _: BaseFunction, _: Arguments<'_, f64>, _: &mut [f64],
/// #     ) -> Result<Condition<f64>, SizeError> {
/// #         Ok(Condition::regular(0.0))
/// #     }
/// # }
/// // rows every 10 s, and a robot that hardly moves: times are in ms
/// let state = |k: i32| Measured {
///     time: 10.0 * f64::from(k),
///     motion: [vec![0.0], vec![1e-3], vec![0.0]],
///     efforts: vec![1.0],
///     ..Measured::default()
/// };
/// let sample = Sample {
///     measured: vec![0],
///     states: (0..10).map(state).collect(),
///     step: 10.0,
///     ..Sample::default()
/// };
/// let columns = LogColumns { file: "run.csv", given: &[], model: &Slide };
/// let found = suspicions(&columns, &sample, None, &|_| None, &mut |_, _| {});
/// assert!(found[0].what.starts_with("column `t` looks like ms and not s"));
/// let Remedy::Read { columns, .. } = &found[0].remedy else { panic!() };
/// assert_eq!(columns[0].factor, 1e-3);
/// ```
pub fn suspicions<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
    estimate: Option<&Estimate>,
    whole: &WholeFit<'_>,
    step: &mut dyn FnMut(usize, usize),
) -> Vec<Suspicion> {
    let model = columns.model;
    let info = model.info();
    let mut out = Vec::new();
    out.extend(clock(columns, sample));
    if out.is_empty() {
        out.extend(series(columns, sample));
    }
    // with a wrong clock or a wrong series no other check is meaningful
    if !out.is_empty() || sample.states.is_empty() {
        return out;
    }
    // nothing is to be learnt from a log with an effort of no use
    out.extend(columns.useless(sample, whole));
    if !out.is_empty() {
        return out;
    }
    // hypotheses that are judged by the efforts cannot tell with states that contradict themselves
    out.extend(contradiction(columns, sample));
    if !out.is_empty() {
        return out;
    }
    let own: Vec<f64> = info
        .actuated
        .iter()
        .map(|c| columns.drive_gain(&Quantity::Effort(columns.name(*c))))
        .collect();
    let all = estimate;
    let sigmas = estimate.map(|e| (0..e.values.len()).map(|k| e.sigma(k)).collect::<Vec<_>>());
    let estimate = estimate.zip(sigmas.as_ref());
    let estimate = estimate.map(|(e, sigmas)| (e.values.as_slice(), sigmas.as_slice()));
    let findings = look(model, sample, &own, estimate, step);
    if let Some(change) = &findings.change
        && !is_covered(change, &findings.nominal)
    {
        out.extend(columns.tried(change, sample, &findings.nominal, whole));
    }
    if !findings.rectified.is_empty() {
        out.push(columns.rectified(&findings.rectified, whole));
        return out;
    }
    if !findings.cut_off.is_empty() {
        out.extend(columns.cut_off(&findings.cut_off));
        return out;
    }
    if let Some(parts) = &findings.parts {
        out.push(columns.divided(parts, &findings.errors));
        return out;
    }
    out.extend(against_nominal(columns, &findings));
    // spikes may be beyond limits in the right unit
    if out.is_empty() && sample.spikes.is_empty() {
        out.extend(limits(columns, sample));
    }
    if out.is_empty() {
        out.extend(beyond(columns, sample));
    }
    let light = match all {
        Some(own) if out.is_empty() => {
            negative_inertias(model, sample, &own.values, &own.covariance)
        }
        _ => Vec::new(),
    };
    let are_all_light = all.is_some_and(|own| {
        are_of_flipped_signs(model, sample, (&own.values, &own.covariance), &light)
    });
    if are_all_light {
        let all: Vec<usize> = (0..info.actuated.len()).collect();
        out.push(
            columns.suspicion(
                "these parameters make the inertias negative: the signs of all efforts, or of all \
             positions, look flipped"
                    .to_owned(),
                Remedy::columns(columns.with_flipped_signs(&all)),
            ),
        );
    }
    if out.is_empty() {
        out.extend(columns.shifted(&findings.shifts));
    }
    if out.is_empty() {
        out.extend(findings.negative.iter().map(|negative| {
            columns.suspicion(
                format!(
                    "{} is {:.4} +- {:.2}, and cannot be negative",
                    negative.label, negative.value, negative.sigma
                ),
                Remedy::Physical,
            )
        }));
    }
    // what a single parameter or an offset explains is told before
    if out.is_empty() {
        out.extend(columns.drifting(&findings.drifts));
    }
    if out.is_empty() && !light.is_empty() {
        out.push(columns.light(&light));
    }
    out.extend(
        columns
            .far(&findings.far)
            .filter(|_| sample.spikes.is_empty()),
    );
    out.extend(columns.spikes(&sample.spikes));
    out.extend(held_columns(columns, sample));
    out.extend(coarse(columns, sample));
    if let Some((what, remedy)) = &sample.doubted_rate {
        let assignments: Result<Vec<Assignment>, _> = remedy.lines().map(str::parse).collect();
        let remedy = assignments.map_or_else(
            |_| Remedy::Read {
                advice: vec![remedy.clone()],
                columns: Vec::new(),
            },
            Remedy::columns,
        );
        out.push(columns.suspicion(what.clone(), remedy));
    }
    if out.is_empty() {
        out.extend(missed_by_series(columns, sample, &findings.errors));
    }
    without_repeated(out)
}

/// The suspicions without those that an earlier one already gives the columns for.
fn without_repeated(all: Vec<Suspicion>) -> Vec<Suspicion> {
    let mut out: Vec<Suspicion> = Vec::with_capacity(all.len());
    for own in all {
        let is_given = |earlier: &Suspicion| match (&earlier.remedy, &own.remedy) {
            (Remedy::Read { columns: first, .. }, Remedy::Read { columns, .. }) => {
                !columns.is_empty() && first == columns
            }
            _ => false,
        };
        if !out.iter().any(is_given) {
            out.push(own);
        }
    }
    out
}

/// The suspicion that one position contradicts the others where more are measured than needed, by the
/// loops alone; `None` if they agree, or no unit, sign or offset of a single one makes them agree.
pub fn contradiction<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Option<Suspicion> {
    let found = positions::contradiction(columns.model, sample)?;
    columns.contradicting(sample, found)
}

/// The columns that have a new value only every few rows.
fn held_columns<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Option<Suspicion> {
    let mut every: Vec<usize> = sample.held.iter().map(|own| own.1).collect();
    every.sort_unstable();
    every.dedup();
    let one = |rows: &usize| {
        let titles = sample.held.iter().filter(|own| own.1 == *rows);
        let titles: Vec<String> = titles.map(|(title, _)| format!("`{title}`")).collect();
        match &titles[..] {
            [only] => format!("column {only} has a new value only every {rows} rows"),
            all => format!(
                "columns {} have a new value only every {rows} rows",
                all.join(", ")
            ),
        }
    };
    let words: Vec<String> = every.iter().map(one).collect();
    (!words.is_empty()).then(|| {
        let advice = if sample.are_rows_repeated {
            "Its rows are those of a slower clock, each of them several times: log each once, with its own time"
        } else {
            "Its values are up to as many rows old, as those of a slower sensor or topic: log it with the others"
        };
        columns.suspicion(
            words.join(", and "),
            Remedy::Read {
                advice: vec![advice.to_owned()],
                columns: Vec::new(),
            },
        )
    })
}

/// The columns of efforts that have few values.
fn coarse<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Option<Suspicion> {
    let one = |(title, step, part): &(String, f64, f64)| {
        let percent = text::figure_of(2, 100.0 * part);
        let step = text::figure_of(4, *step);
        format!("column `{title}` has steps of {step}, {percent} % of its standard deviation")
    };
    let words: Vec<String> = sample.coarse.iter().map(one).collect();
    (!words.is_empty()).then(|| {
        let advice = "What happens between the steps of a sensor or converter is lost: log it with more digits";
        columns.suspicion(
            words.join(", and "),
            Remedy::Read {
                advice: vec![advice.to_owned()],
                columns: Vec::new(),
            },
        )
    })
}

/// Whether the times are in another unit than s.
fn clock<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Option<Suspicion> {
    let speeds = sample.states.iter().flat_map(|s| &s.motion[1]);
    let fastest = speeds.fold(0.0, |m: f64, v| m.max(v.abs()));
    if sample.step < MIN_SLOW_STEP_S || fastest > MAX_STILL_SPEED {
        return None;
    }
    let (unit, factor) = match sample.step {
        step if step < 100.0 => ("ms", 1e-3),
        step if step < 1e5 => ("us", 1e-6),
        step if step < 1e11 => ("ns", 1e-9),
        // no unit of time explains such a step
        _ => return None,
    };
    let mut time = columns.source(&Quantity::Time);
    let is_given = columns.given.iter().any(|a| a.quantity == Quantity::Time);
    if let (Some(title), false) = (&sample.time_column, is_given) {
        time.column.clone_from(title);
    }
    Some(columns.suspicion(
        format!(
            "column `{}` looks like {unit} and not s: the usual step would be {} s",
            time.column,
            text::figure(sample.step)
        ),
        Remedy::columns(vec![Assignment {
            factor: time.factor * factor,
            ..time
        }]),
    ))
}

/// Whether the Fourier series is not that of the motion.
fn series<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Option<Suspicion> {
    let pairs = sample.series_residuals.iter().zip(&sample.measured);
    let worst = pairs.max_by(|a, b| a.0.total_cmp(b.0))?;
    if *worst.0 < MAX_SERIES_RESIDUAL {
        return None;
    }
    let above = sample
        .series_residuals
        .iter()
        .filter(|residual| **residual >= MAX_SERIES_RESIDUAL)
        .count();
    Some(columns.suspicion(
        format!(
            "the Fourier series leaves {:.1} % of the motion of `{}` ({} of {} positions above \
             {:.0} %)",
            100.0 * worst.0,
            columns.name(*worst.1),
            above,
            sample.series_residuals.len(),
            100.0 * MAX_SERIES_RESIDUAL,
        ),
        Remedy::Series,
    ))
}

/// Whether the Fourier series misses motion that matters for the efforts: what is left of a position
/// is far above its noise, and an effort is not explained.
///
/// - `errors`: those of the equations, see [`Findings::errors`].
fn missed_by_series<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
    errors: &[f64],
) -> Option<Suspicion> {
    let pairs = sample.series_over_noise.iter().zip(&sample.measured);
    let (left, position) = pairs.max_by(|a, b| a.0.total_cmp(b.0))?;
    let error = errors.iter().fold(0.0, |m: f64, e| m.max(*e));
    (*left > MAX_SERIES_OVER_NOISE && error > MAX_SERIES_ERROR).then(|| {
        columns.suspicion(
            format!(
                "the Fourier series leaves {} times the noise of `{}`, and {:.0} % of an effort",
                text::figure_of(2, *left),
                columns.name(*position),
                100.0 * error
            ),
            Remedy::Series,
        )
    })
}

/// Whether a factor is more than nominal values may be wrong by.
fn is_far(nominal: &Nominal) -> bool {
    nominal.correlation >= MIN_CORRELATION_OF_FACTOR && is_far_factor(nominal.factor)
}

fn is_far_factor(factor: f64) -> bool {
    !(1.0 / MAX_NOMINAL_FACTOR..MAX_NOMINAL_FACTOR).contains(&factor)
}

/// Whether a change only multiplies efforts that are then other multiples of what the nominal bodies need, which tell
/// the factors of all: a fit tells ratios.
fn is_covered(change: &Change, nominal: &[Nominal]) -> bool {
    let none = Change::none(change.efforts.len(), change.positions.len());
    let rest = Change {
        efforts: none.efforts.clone(),
        before: Vec::new(),
        after: Vec::new(),
        ..change.clone()
    };
    let pairs = change.efforts.iter().zip(&none.efforts).enumerate();
    let mut changed = pairs.filter(|(_, (own, plain))| own != plain);
    let is_far = |effort: usize| {
        let mut all = nominal.iter();
        all.any(|n| n.effort == effort && n.part >= MIN_COMPARED_PART && is_far(n))
    };
    rest == none && changed.all(|(k, (own, _))| own.from == k && own.factor > 0.0 && is_far(k))
}

/// The number of efforts whose sign or size contradicts the nominal bodies.
pub(super) fn contradictions(nominal: &[Nominal]) -> usize {
    let compared = nominal.iter().filter(|n| n.part >= MIN_COMPARED_PART);
    compared
        .filter(|n| n.correlation <= -MIN_CORRELATION || is_far(n))
        .count()
}

/// Compares the efforts with those that the nominal bodies need.
fn against_nominal<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    findings: &Findings,
) -> Vec<Suspicion> {
    let compared = findings
        .nominal
        .iter()
        .filter(|n| n.part >= MIN_COMPARED_PART);
    let compared: Vec<_> = compared
        .filter(|n| n.correlation.abs() >= MIN_CORRELATION)
        .collect();
    let mut out = Vec::new();
    let list = |which: &[&Nominal], value: &dyn Fn(&Nominal) -> f64| {
        let each = which.iter().map(|n| format!("{:.3}", value(n)));
        each.collect::<Vec<_>>().join(", ")
    };
    let names = |which: &[&Nominal]| {
        let each = which
            .iter()
            .map(|n| format!("`{}`", columns.effort(n.effort).column));
        each.collect::<Vec<_>>().join(", ")
    };
    let against: Vec<_> = compared
        .iter()
        .copied()
        .filter(|n| n.correlation < 0.0)
        .collect();
    if !against.is_empty() {
        // one machine has one sign convention, unless another effort agrees with the bodies
        let agree = compared.len() > against.len();
        let turned: Vec<usize> = if against.len() > 1 && !agree {
            (0..columns.model.info().actuated.len()).collect()
        } else {
            against.iter().map(|n| n.effort).collect()
        };
        out.push(columns.suspicion(
            format!(
                "the sign of {} contradicts the weights and inertias of the nominal bodies \
                 (correlation {}): it looks flipped, if the bodies are those of this robot",
                names(&against),
                list(&against, &|n| n.correlation)
            ),
            Remedy::columns(columns.with_flipped_signs(&turned)),
        ));
    }
    // they were compared as they are read with the change
    let before = |k: usize| {
        let change = findings.change.as_ref();
        let own = change.and_then(|change| change.efforts.get(k));
        own.filter(|own| own.from == k)
            .map_or(1.0, |own| own.factor)
    };
    // those that are near without it contradict the change
    let is_far_as_read = |n: &&Nominal| is_far(n) && is_far_factor(n.factor / before(n.effort));
    let far: Vec<_> = (compared.iter().copied()).filter(is_far_as_read).collect();
    if !far.is_empty() {
        let milli = far.iter().all(|n| (300.0..3000.0).contains(&n.factor));
        // all efforts have one unit, unless one of them agrees with the bodies
        let agree = compared.len() > far.len() || far.len() < 2;
        let efforts: Vec<(usize, f64)> = if milli && !agree {
            let all = 0..columns.model.info().actuated.len();
            all.map(|k| (k, 1e3)).collect()
        } else {
            far.iter().map(|n| (n.effort, n.factor)).collect()
        };
        let read = efforts.iter().map(|(k, times)| {
            let source = columns.effort(*k);
            let factor = if milli { 1e-3 } else { 1.0 / times } * before(*k);
            let factor = if (factor - 1e-3).abs() < 1e-12 {
                factor
            } else {
                rounded(factor)
            };
            Assignment {
                factor: source.factor * factor,
                ..source
            }
        });
        let what = format!(
            "{} {} {} times what the nominal bodies need (correlation {})",
            names(&far),
            if far.len() > 1 { "are" } else { "is" },
            list(&far, &|n| n.factor),
            list(&far, &|n| n.correlation),
        );
        let why = if milli {
            ": this looks like mN m or mN"
        } else {
            ": a torque constant, a gear's ratio or a unit is missing, or the bodies are others"
        };
        out.push(columns.suspicion(what + why, Remedy::columns(read.collect())));
    }
    out
}

/// Finds efforts far beyond the limits of their actuators.
fn limits<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Vec<Suspicion> {
    let info = columns.model.info();
    let mut out = Vec::new();
    for (k, c) in info.actuated.iter().enumerate() {
        let Some([low, high]) = info.joints.get(*c).and_then(|j| j.limits.effort) else {
            continue;
        };
        let limit = low.abs().max(high.abs());
        let efforts = sample.states.iter().filter_map(|s| s.efforts.get(k));
        let most = efforts.fold(0.0, |m: f64, u| m.max(u.abs()));
        if limit > 0.0 && most > MIN_LIMIT_RATIO * limit {
            let source = columns.effort(k);
            out.push(columns.suspicion(
                format!(
                    "column `{}` reaches {:.1} times the limit of its effort: it looks like \
                     another unit, such as mN m or mN",
                    source.column,
                    most / limit
                ),
                Remedy::columns(vec![Assignment {
                    factor: source.factor * 1e-3,
                    ..source
                }]),
            ));
        }
    }
    out
}

/// Finds positions that are beyond the limits of their joints most of the time.
fn beyond<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Vec<Suspicion> {
    let info = columns.model.info();
    let mut out = Vec::new();
    for (k, c) in sample.measured.iter().enumerate() {
        let Some(joint) = info.joints.get(*c) else {
            continue;
        };
        let Some([low, high]) = joint.limits.position else {
            continue;
        };
        let margin = MAX_BEYOND_PART * (high - low);
        let (least, most) = positions::range(sample, k);
        let turned = facts::turns_between(joint, [least, most]);
        let states = sample.states.iter().filter_map(|s| s.motion[0].get(k));
        let outside = states
            .map(|q| q + turned)
            .filter(|q| *q < low - margin || *q > high + margin);
        let part = outside.count() as f64 / sample.states.len().max(1) as f64;
        if margin > 0.0 && part > MIN_BEYOND_TIME {
            let source = columns.source(&Quantity::Position(columns.name(*c)));
            let what = format!(
                "column `{}` is beyond the limits of its joint, {} to {}, in {:.0} % of the rows",
                source.column,
                text::figure(low),
                text::figure(high),
                100.0 * part
            );
            let (what, remedy) = if positions::is_mirrored(columns.model, sample, k) {
                let flipped = Assignment {
                    factor: -source.factor,
                    offset: -source.offset,
                    ..source
                };
                let what = format!("{what}, and within them with the other sign");
                (what, Remedy::columns(vec![flipped]))
            } else {
                let advice = "Its sign, its zero or its unit is another one than the spec's, or the \
                              limits are wrong";
                let remedy = Remedy::Read {
                    advice: vec![advice.to_owned()],
                    columns: Vec::new(),
                };
                (what, remedy)
            };
            out.push(columns.suspicion(what, remedy));
        }
    }
    out
}

/// The diagonal of the mass matrix at home with these base parameters, kg m^2 or kg.
fn inertia<M: BaseModel<f64> + ?Sized>(model: &M, values: &[f64]) -> Option<Vec<f64>> {
    let info = model.info();
    let dof = info.dof();
    let mut mass = vec![0.0; dof * dof];
    let _ = model.base_mass_matrix(info.home, values, &mut mass).ok()?;
    Some(mass.into_iter().step_by(dof + 1).collect())
}

/// The independent coordinates whose inertia a fit makes negative by many of its standard deviations, and by so much
/// that it matters for the effort; where all are, the signs of all efforts, or of all positions, are flipped.
///
/// - `covariance`: that of the values, n x n.
fn negative_inertias<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    values: &[f64],
    covariance: &[f64],
) -> Vec<usize> {
    let Some(inertia) = inertia(model, values) else {
        return Vec::new();
    };
    let n = values.len();
    let part = |k: usize| {
        let mut unit = vec![0.0; n];
        unit.iter_mut().skip(k).take(1).for_each(|x| *x = 1.0);
        self::inertia(model, &unit)
    };
    // the inertias of each parameter at value 1
    let Some(parts) = (0..n).map(part).collect::<Option<Vec<_>>>() else {
        return Vec::new();
    };
    let variance = |i: usize| -> f64 {
        let of = |k: usize| parts.get(k).and_then(|own| own.get(i)).unwrap_or(&0.0);
        let pairs = covariance.iter().enumerate();
        pairs.map(|(k, c)| c * of(k / n) * of(k % n)).sum()
    };
    let is_negative = |(i, m): (usize, &f64)| *m < -CERTAIN_DEVIATIONS * variance(i).sqrt();
    let light = (inertia.iter().enumerate()).filter(|own| own.1 < &0.0 && is_negative(*own));
    let info = model.info();
    let light = light.filter_map(|(k, inertia)| Some((*info.independent.get(k)?, *inertia)));
    // friction and weights that the spec lacks are taken up by small ones
    let matters = |(coordinate, inertia): &(usize, f64)| {
        let rms = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = values.fold((0.0, 0.0), |(sum, n), x| (sum + x * x, n + 1.0));
            (sum / count).sqrt()
        };
        let place = sample.measured.iter().position(|own| own == coordinate);
        let effort = info.actuated.iter().position(|own| own == coordinate);
        let (Some(place), Some(effort)) = (place, effort) else {
            return true;
        };
        let states = || sample.states.iter();
        let acceleration = rms(&mut states().filter_map(|own| own.motion[2].get(place).copied()));
        let effort = rms(&mut states().filter_map(|own| own.efforts.get(effort).copied()));
        inertia.abs() * acceleration > MIN_COMPARED_PART * effort
    };
    light.filter(matters).map(|own| own.0).collect()
}

/// Whether most inertias are negative, and none is positive that is known and matters: the signs of all efforts, or of
/// all positions, make them so.
///
/// - `values`: the estimate, and its covariance, n x n; `light`: the coordinates whose inertias it makes negative.
fn are_of_flipped_signs<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    (values, covariance): (&[f64], &[f64]),
    light: &[usize],
) -> bool {
    let turned: Vec<f64> = values.iter().map(|value| -value).collect();
    let are_most = !light.is_empty() && 2 * light.len() >= model.info().dof();
    are_most && negative_inertias(model, sample, &turned, covariance).is_empty()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::swings_for_tests::{columns, sample, swings};
    use super::*;

    #[test]
    fn columns_that_are_held_for_as_many_rows_are_told_together() {
        let model = swings(true);
        let said = |held: &[(&str, usize)], are_rows_repeated: bool| {
            let own = Sample {
                are_rows_repeated,
                held: held
                    .iter()
                    .map(|(title, rows)| ((*title).to_owned(), *rows))
                    .collect(),
                ..sample()
            };
            let found = held_columns(&columns(&model), &own).unwrap();
            let Remedy::Read { advice, .. } = found.remedy else {
                panic!("no advice")
            };
            (found.what, advice[0].contains("slower clock"))
        };
        assert_eq!(
            said(&[("a", 3)], false),
            (
                "column `a` has a new value only every 3 rows".to_owned(),
                false
            )
        );
        let two = "columns `a`, `c` have a new value only every 2 rows, and column `b` has a new value only every 3 rows";
        assert_eq!(
            said(&[("a", 2), ("b", 3), ("c", 2)], false),
            (two.to_owned(), false)
        );
        assert!(said(&[("a", 2), ("b", 2), ("c", 2)], true).1);
    }

    #[test]
    fn one_remedy_is_told_once() {
        let model = swings(true);
        let columns = columns(&model);
        let flips = |what: &str, efforts: &[usize]| {
            let flipped = columns.with_flipped_signs(efforts);
            columns.suspicion(what.to_owned(), Remedy::columns(flipped))
        };
        let light = || columns.light(&[0]);
        let all = vec![
            flips("a", &[0]),
            light(),
            flips("b", &[0]),
            flips("c", &[1]),
            light(),
        ];
        let found = without_repeated(all);
        let words: Vec<&str> = found.iter().map(|own| own.what.as_str()).collect();
        // advice without columns may be the same for several
        assert_eq!(words.len(), 4);
        assert_eq!((words[0], words[2]), ("a", "c"));
    }

    #[test]
    fn inertias_that_are_negative_beyond_their_deviations_are_told() {
        let model = swings(false);
        let mut covariance = vec![0.0; 49];
        covariance.iter_mut().step_by(8).for_each(|x| *x = 1e-4);
        let light = |second: f64| {
            let values = [0.5, second, 0.4, 0.6, 0.2, 0.1, -0.15];
            negative_inertias(&model, &sample(), &values, &covariance)
        };
        assert_eq!(light(-0.3), [1]);
        assert_eq!(light(0.3), [0; 0]);
        // friction takes up what is small beside the effort
        assert_eq!(light(-0.03), [0; 0]);
        // it may be by chance
        assert_eq!(light(-0.05), [0; 0]);
    }

    #[test]
    fn signs_of_all_efforts_are_flipped_where_most_inertias_are_negative_and_none_is_positive() {
        let model = swings(false);
        let mut covariance = vec![0.0; 49];
        covariance.iter_mut().step_by(8).for_each(|x| *x = 1e-4);
        let flipped = |inertias: [f64; 3]| {
            let [a, b, c] = inertias;
            let values = [a, b, c, 0.6, 0.2, 0.1, -0.15];
            let light = negative_inertias(&model, &sample(), &values, &covariance);
            are_of_flipped_signs(&model, &sample(), (&values, &covariance), &light)
        };
        assert!(flipped([-0.5, -0.3, -0.4]));
        // one that is unknown contradicts nothing, and one that is known does
        assert!(flipped([-0.5, 0.001, -0.4]));
        assert!(!flipped([-0.5, 0.3, -0.4]));
        assert!(!flipped([0.001, -0.3, 0.001]));
        assert!(!flipped([0.5, 0.3, 0.4]));
    }

    #[test]
    fn the_effort_that_is_explained_better_is_named_where_another_has_the_largest_error() {
        let effort = |name: &str, error: f64, changed: f64| EffortChange {
            name: name.to_owned(),
            error: Some(error),
            changed,
        };
        let mut found = columns(&swings(false)).suspicion("it is late".to_owned(), Remedy::Bounded);
        found.efforts = vec![effort("q1", 7.0, 8.8), effort("q2", 7.3, 1.2)];
        (found.error, found.changed) = (Some(7.3), Some(8.8));
        let says = ": so read, the error of `q2` is 1.2 % and not 7.3 %";
        assert!(found.to_string().ends_with(says), "{found}");
        (found.error, found.changed) = (Some(7.3), Some(5.0));
        assert!(
            found
                .to_string()
                .ends_with("the largest error of an effort is 5.0 % and not 7.3 %")
        );
    }

    #[test]
    fn efforts_have_one_unit_unless_one_of_them_agrees_with_the_bodies() {
        let model = swings(true);
        let read = |factors: &[f64]| -> Vec<(String, f64)> {
            let one = |(effort, factor): (usize, &f64)| Nominal {
                equation: effort,
                effort,
                correlation: 0.99,
                factor: *factor,
                part: 0.9,
            };
            let findings = Findings {
                nominal: factors.iter().enumerate().map(one).collect(),
                ..Findings::default()
            };
            let found = against_nominal(&columns(&model), &findings);
            let columns = found.into_iter().flat_map(|own| match own.remedy {
                Remedy::Read { columns, .. } => columns,
                _ => Vec::new(),
            });
            columns.map(|own| (own.column, own.factor)).collect()
        };
        let milli = |name: &str| (name.to_owned(), 1e-3);
        assert_eq!(read(&[1.0, 1.1, 0.9]), []);
        // all, though the third is not compared
        assert_eq!(
            read(&[980.0, 1020.0]),
            ["tau_q1", "tau_q2", "tau_q3"].map(milli)
        );
        assert_eq!(read(&[980.0, 1.1, 1020.0]), ["tau_q1", "tau_q3"].map(milli));
        assert_eq!(read(&[1.0, 1000.0, 1.0]), [milli("tau_q2")]);
        assert_eq!(read(&[1.0, 8.0, 1.0]), [("tau_q2".to_owned(), 0.125)]);
    }
}
