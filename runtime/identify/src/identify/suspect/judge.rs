//! What looks wrong with a log, in words and with the remedy, from what its columns say of each
//! other, of the nominal bodies and of the limits.

use regen_runtime::BaseModel;
use serde::Serialize;

use super::words::{LogColumns, rounded};
use super::{Findings, Nominal, Sample, look};
use crate::data::{Assignment, Quantity};
use crate::estimate::Estimate;
use crate::text;

/// The part of the positions that a Fourier series may leave: more is no noise.
const LEFT: f64 = 0.1;
/// A step from which on, in s, no robot is logged that moves.
const SLOW: f64 = 0.5;
/// A robot that is slower than this, in rad/s or m/s, at such steps is read with a wrong clock.
const STILL: f64 = 0.05;
/// The correlation of an effort with that of the nominal bodies from which on they are one thing.
pub(super) const ONE: f64 = 0.8;
/// The same for a factor between the two, which payloads and unknown bodies change as well.
const SURE: f64 = 0.95;
/// Nominal values are not more wrong than by this factor.
const FAR: f64 = 4.0;
/// The part of an effort that must be neither friction nor constant, to compare it with bodies.
pub(super) const PART: f64 = 0.2;
/// An effort this many times beyond its limit is in another unit.
const BEYOND: f64 = 10.0;

/// What looks wrong with a log. Its remedy is not serialised: a program says it by its own options.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Suspicion {
    /// The log.
    pub file: String,
    /// What it looks like.
    pub what: String,
    /// The largest error among the efforts that it is about as the log is: rms of the residuals
    /// over rms of the effort about its mean, percent; none where the loops do not close.
    pub error: Option<f64>,
    /// The same with the change.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changed: Option<f64>,
    /// Each effort that fits otherwise with the change.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub efforts: Vec<EffortChange>,
    /// What to do about it.
    #[serde(skip)]
    pub remedy: Remedy,
}

/// An effort's error without and with a change, percent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffortChange {
    /// The coordinate.
    pub name: String,
    /// Without the change; none where the loops do not close.
    pub error: Option<f64>,
    /// With it.
    pub changed: f64,
}

/// What to do about a log that looks wrong.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Remedy {
    /// To follow advice, and to read columns in another way, if any of the two is needed.
    Read {
        /// What to do first, each in a sentence without its full stop.
        advice: Vec<String>,
        /// The quantities that are to be read in another way.
        columns: Vec<Assignment>,
    },
    /// To fit a Fourier series of the motion's own frequency and of enough harmonics, or to smooth
    /// by a filter.
    Series,
    /// To look for the cause in the sign, the delay or the offset of an effort or in the motion, or
    /// to solve for physical parameters only.
    Physical,
}

impl Remedy {
    /// Reading columns in another way.
    pub(super) fn columns(columns: Vec<Assignment>) -> Self {
        Self::Read {
            advice: Vec::new(),
            columns,
        }
    }
}

impl std::fmt::Display for Suspicion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.file, self.what)?;
        if let (Some(changed), Some(error)) = (self.changed, self.error) {
            write!(
                f,
                ": so read, the largest error of an effort is {changed:.1} % and not {error:.1} %"
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

/// What looks wrong with one log, the most certain first: its clock, its series, columns that are
/// swapped, turned round, shifted or in another unit, efforts that contradict the nominal bodies
/// or their limits, and parameters that no body has.
///
/// - `columns`: the log and how its columns are read;
/// - `sample`: some of its states, see [`Logs::sample`](crate::data::Logs::sample);
/// - `found`: what was identified from all logs, with deviations; none where nothing was;
/// - `step`: is called with the number of hypotheses tried and of all.
///
/// ```
/// use regen_identify::identify::suspect::{LogColumns, Measured, Remedy, Sample, suspicions};
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
/// };
/// let sample = Sample {
///     measured: vec![0],
///     states: (0..10).map(state).collect(),
///     step: 10.0,
///     ..Sample::default()
/// };
/// let columns = LogColumns { file: "run.csv", given: &[], model: &Slide };
/// let found = suspicions(&columns, &sample, None, &mut |_, _| {});
/// assert!(found[0].what.starts_with("column `t` looks like ms and not s"));
/// let Remedy::Read { columns, .. } = &found[0].remedy else { panic!() };
/// assert_eq!(columns[0].factor, 1e-3);
/// ```
pub fn suspicions<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
    found: Option<&Estimate>,
    step: &mut dyn FnMut(usize, usize),
) -> Vec<Suspicion> {
    let model = columns.model;
    let info = model.info();
    let mut out = Vec::new();
    out.extend(clock(columns, sample));
    if out.is_empty() {
        out.extend(series(columns, sample));
    }
    // behind a wrong clock or a wrong series nothing fits
    if !out.is_empty() || sample.states.is_empty() {
        return out;
    }
    let own: Vec<f64> = info
        .actuated
        .iter()
        .map(|c| columns.own(&Quantity::Effort(columns.name(*c))))
        .collect();
    let sigmas = found.map(|f| (0..f.values.len()).map(|k| f.sigma(k)).collect::<Vec<_>>());
    let estimate = found.zip(sigmas.as_ref());
    let estimate = estimate.map(|(f, sigmas)| (f.values.as_slice(), sigmas.as_slice()));
    let findings = look(model, sample, &own, estimate, step);
    if let Some(change) = &findings.change {
        out.extend(columns.change(change, sample, &findings.nominal));
    }
    out.extend(weights(columns, &findings));
    if out.is_empty() {
        out.extend(limits(columns, sample));
    }
    if out.is_empty()
        && let Some((values, sigmas)) = estimate
        && upside_down(model, values, sigmas)
    {
        let all: Vec<usize> = (0..info.actuated.len()).collect();
        out.push(columns.say(
            "these parameters make every inertia negative: the signs of all efforts, or of all \
             positions, look flipped"
                .to_owned(),
            Remedy::columns(columns.turned(&all)),
        ));
    }
    if out.is_empty() {
        out.extend(columns.shifted(&findings.shifts));
    }
    if out.is_empty() {
        out.extend(findings.negative.iter().map(|told| {
            columns.say(
                format!(
                    "{} is {:.4} +- {:.2}, and cannot be negative",
                    told.label, told.value, told.sigma
                ),
                Remedy::Physical,
            )
        }));
    }
    out
}

/// Times that are in another unit.
fn clock<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Option<Suspicion> {
    let speeds = sample.states.iter().flat_map(|s| &s.motion[1]);
    let fastest = speeds.fold(0.0, |m: f64, v| m.max(v.abs()));
    if sample.step < SLOW || fastest > STILL {
        return None;
    }
    let (unit, factor) = match sample.step {
        step if step < 100.0 => ("ms", 1e-3),
        step if step < 1e5 => ("us", 1e-6),
        step if step < 1e11 => ("ns", 1e-9),
        // no clock of any unit is that slow
        _ => return None,
    };
    let time = columns.source(&Quantity::Time);
    Some(columns.say(
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

/// A series that is not that of the motion.
fn series<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
) -> Option<Suspicion> {
    let pairs = sample.left.iter().zip(&sample.measured);
    let worst = pairs.max_by(|a, b| a.0.total_cmp(b.0))?;
    if *worst.0 < LEFT {
        return None;
    }
    let bad = sample.left.iter().filter(|left| **left >= LEFT).count();
    Some(columns.say(
        format!(
            "the Fourier series leaves {:.1} % of the motion of `{}` ({} of {} positions above \
             {:.0} %)",
            100.0 * worst.0,
            columns.name(*worst.1),
            bad,
            sample.left.len(),
            100.0 * LEFT,
        ),
        Remedy::Series,
    ))
}

/// Efforts that contradict the nominal bodies.
fn weights<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    findings: &Findings,
) -> Vec<Suspicion> {
    let compared = findings.nominal.iter().filter(|n| n.part >= PART);
    let compared: Vec<_> = compared.filter(|n| n.correlation.abs() >= ONE).collect();
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
        // one machine has one convention, unless an effort agrees with the bodies as surely
        let agree = compared.len() > against.len();
        let turned: Vec<usize> = if against.len() > 1 && !agree {
            (0..columns.model.info().actuated.len()).collect()
        } else {
            against.iter().map(|n| n.effort).collect()
        };
        out.push(columns.say(
            format!(
                "the sign of {} contradicts the weights and inertias of the nominal bodies \
                 (correlation {}): it looks flipped, if the bodies are those of this robot",
                names(&against),
                list(&against, &|n| n.correlation)
            ),
            Remedy::columns(columns.turned(&turned)),
        ));
    }
    let far: Vec<_> = compared
        .iter()
        .copied()
        .filter(|n| n.correlation >= SURE && !(1.0 / FAR..FAR).contains(&n.factor))
        .collect();
    if !far.is_empty() {
        let milli = far.iter().all(|n| (300.0..3000.0).contains(&n.factor));
        // a unit is that of all, unless one of them agrees with the bodies
        let agree = compared.len() > far.len() || far.len() < 2;
        let efforts: Vec<(usize, f64)> = if milli && !agree {
            let all = 0..columns.model.info().actuated.len();
            all.map(|k| (k, 1e3)).collect()
        } else {
            far.iter().map(|n| (n.effort, n.factor)).collect()
        };
        let read = efforts.iter().map(|(k, times)| {
            let source = columns.effort(*k);
            Assignment {
                factor: source.factor * if milli { 1e-3 } else { rounded(1.0 / times) },
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
        out.push(columns.say(what + why, Remedy::columns(read.collect())));
    }
    out
}

/// Efforts far beyond what the actuators can give.
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
        if limit > 0.0 && most > BEYOND * limit {
            let source = columns.effort(k);
            out.push(columns.say(
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

/// The diagonal of the mass matrix at home, kg m^2 or kg, with these base parameters.
fn inertia<M: BaseModel<f64> + ?Sized>(model: &M, values: &[f64]) -> Option<Vec<f64>> {
    let info = model.info();
    let dof = info.dof();
    let mut mass = vec![0.0; dof * dof];
    let _ = model.base_mass_matrix(info.home, values, &mut mass).ok()?;
    Some(mass.into_iter().step_by(dof + 1).collect())
}

/// Whether a fit makes the inertia of every coordinate negative, by more than the deviations of
/// the parameters explain: then the signs of all efforts, or of all positions, are flipped.
fn upside_down<M: BaseModel<f64> + ?Sized>(model: &M, values: &[f64], sigmas: &[f64]) -> bool {
    let Some(mut inertia) = inertia(model, values) else {
        return false;
    };
    for (k, sigma) in sigmas.iter().enumerate() {
        let mut unit = vec![0.0; values.len()];
        unit[k] = *sigma;
        let Some(part) = self::inertia(model, &unit) else {
            return false;
        };
        for (m, part) in inertia.iter_mut().zip(part) {
            *m += part.abs();
        }
    }
    !inertia.is_empty() && inertia.iter().all(|m| *m < 0.0)
}
