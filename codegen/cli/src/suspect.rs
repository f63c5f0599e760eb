//! What looks wrong with a log that was read without a fault, said with the remedy: columns that are
//! swapped, turned round, in another unit or shifted, and efforts that contradict the bodies.

#[cfg(test)]
mod tests;
mod words;

use regen_identify::data::{Assignment, Logs, Quantity};
use regen_identify::estimate::Estimate;
use regen_identify::identify::suspect::{self, Change, Findings, Sample};
use regen_runtime::BaseModel;
use serde::Serialize;

use crate::args::IdentifyArgs;
use crate::{progress, table, terminal};
use regen_interpreted::Interpreted;
use words::Columns;

/// The part of the positions that a Fourier series may leave: more is no noise.
const LEFT: f64 = 0.1;
/// A step from which on, in s, no robot is logged that moves.
const SLOW: f64 = 0.5;
/// A robot that is slower than this, in rad/s or m/s, at such steps is read with a wrong clock.
const STILL: f64 = 0.05;
/// The correlation of an effort with that of the nominal bodies from which on they are one thing.
const ONE: f64 = 0.8;
/// The same for a factor between the two, which payloads and unknown bodies change as well.
const SURE: f64 = 0.95;
/// Nominal values are not more wrong than by this factor.
const FAR: f64 = 4.0;
/// The part of an effort that must be neither friction nor constant, to compare it with bodies.
const PART: f64 = 0.2;
/// An effort this many times beyond its limit is in another unit.
const BEYOND: f64 = 10.0;

/// What looks wrong with a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Suspicion {
    file: String,
    /// What it looks like.
    what: String,
    /// The largest error among the efforts that it is about as the log is: rms of the residuals
    /// over rms of the effort about its mean, percent; none where the loops do not close.
    error: Option<f64>,
    /// The same with the change.
    #[serde(skip_serializing_if = "Option::is_none")]
    changed: Option<f64>,
    /// Each effort that fits otherwise with the change.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    efforts: Vec<EffortChange>,
    /// Options that read the log so, or what else to do.
    remedy: String,
}

/// An effort's error without and with a change, percent.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct EffortChange {
    name: String,
    error: Option<f64>,
    changed: f64,
}

impl std::fmt::Display for Suspicion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.file, self.what)?;
        if let (Some(changed), Some(error)) = (self.changed, self.error) {
            write!(
                f,
                ": so read, the largest error of an effort is {changed:.1} % and not {error:.1} %"
            )?;
        } else if let Some(changed) = self.changed {
            write!(
                f,
                ": so read, the loops close, and the largest error of an effort is {changed:.1} %"
            )?;
        }
        if self.remedy.starts_with("--column") {
            write!(f, ". If that is so, read it with {}", self.remedy)
        } else {
            write!(f, ". {}", self.remedy)
        }
    }
}

/// Tells at once what looks wrong with each log, unless that is turned off.
///
/// - `found`: what was identified from all of them, with deviations; none where nothing was.
pub(crate) fn tell(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    logs: &Logs<'_, Interpreted<'_>>,
    found: Option<&Estimate>,
) -> Vec<Suspicion> {
    if args.no_suspicion {
        return Vec::new();
    }
    let working = progress::later("looking at the columns");
    let mut out = Vec::new();
    for (k, report) in logs.reports().iter().enumerate() {
        let Ok(sample) = logs.sample(k) else { continue };
        let columns = Columns {
            file: &report.file,
            given: &args.reading.column,
            model,
        };
        out.extend(one(&columns, &sample, found, &mut |k, n| working.at(k, n)));
    }
    working.end();
    for suspicion in &out {
        terminal::note(&format!("warning: {suspicion}"));
    }
    out
}

/// What looks wrong with one log.
fn one(
    columns: &Columns<'_>,
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
    let findings = suspect::look(model, sample, &own, estimate, step);
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
            columns.turned(&all),
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
                "The sign or the delay of an effort, an offset, or a motion that does not tell \
                 it from the rest may be the cause; --feasible keeps it at 0 or above"
                    .to_owned(),
            )
        }));
    }
    out
}

/// Times that are in another unit.
fn clock(columns: &Columns<'_>, sample: &Sample) -> Option<Suspicion> {
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
            table::figure(sample.step)
        ),
        Columns::option(&Assignment {
            factor: time.factor * factor,
            ..time
        }),
    ))
}

/// A series that is not that of the motion.
fn series(columns: &Columns<'_>, sample: &Sample) -> Option<Suspicion> {
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
        "The frequency is not that of the motion, the harmonics are too few, or parts of the log \
         are not periodic: give --fourier the motion's own, or use --butterworth"
            .to_owned(),
    ))
}

/// Efforts that contradict the nominal bodies.
fn weights(columns: &Columns<'_>, findings: &Findings) -> Vec<Suspicion> {
    let compared = findings.nominal.iter().filter(|n| n.part >= PART);
    let compared: Vec<_> = compared.filter(|n| n.correlation.abs() >= ONE).collect();
    let mut out = Vec::new();
    let list = |which: &[&suspect::Nominal], value: &dyn Fn(&suspect::Nominal) -> f64| {
        let each = which.iter().map(|n| format!("{:.3}", value(n)));
        each.collect::<Vec<_>>().join(", ")
    };
    let names = |which: &[&suspect::Nominal]| {
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
            columns.turned(&turned),
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
        let options = efforts.iter().map(|(k, times)| {
            let source = columns.effort(*k);
            Columns::option(&Assignment {
                factor: source.factor
                    * if milli {
                        1e-3
                    } else {
                        words::rounded(1.0 / times)
                    },
                ..source
            })
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
        out.push(columns.say(what + why, options.collect::<Vec<_>>().join(" ")));
    }
    out
}

/// Efforts far beyond what the actuators can give.
fn limits(columns: &Columns<'_>, sample: &Sample) -> Vec<Suspicion> {
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
                Columns::option(&Assignment {
                    factor: source.factor * 1e-3,
                    ..source
                }),
            ));
        }
    }
    out
}

/// The diagonal of the mass matrix at home, kg m^2 or kg, with these base parameters.
fn inertia(model: &Interpreted<'_>, values: &[f64]) -> Option<Vec<f64>> {
    let info = model.info();
    let dof = info.dof();
    let mut mass = vec![0.0; dof * dof];
    let _ = model.base_mass_matrix(info.home, values, &mut mass).ok()?;
    Some(mass.into_iter().step_by(dof + 1).collect())
}

/// Whether a fit makes the inertia of every coordinate negative, by more than the deviations of
/// the parameters explain: then the signs of all efforts, or of all positions, are flipped.
fn upside_down(model: &Interpreted<'_>, values: &[f64], sigmas: &[f64]) -> bool {
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
