//! `regen identify --iv`: instrumental variables.

use std::fmt::Write as _;

use regen_experiment::simulate::{Drive, Reference as _, Settings, control, simulate};
use regen_experiment::trajectory::FourierReference;
use regen_identify::data::{DataError, Logs, Settings as Reading};
use regen_identify::estimate::EstimateError;
use regen_identify::identify::{InstrumentOptions, Instrumental, Motion, instrumental};
use regen_identify::signals::Method;
use regen_runtime::BaseModel;
use serde::Serialize;

use crate::args::IdentifyArgs;
use crate::exit::Failure;
use crate::identify::{Summary, weighting};
use crate::simulate::{linear_friction, reason};
use crate::{observe, path, progress, table};
use regen_identify::model::{IdentifiedModel, Intervals};
use regen_identify::session::Start;
use regen_interpreted::Interpreted;

/// What is said of the instruments.
#[derive(Serialize)]
pub(crate) struct InstrumentsJson {
    /// What motion they are taken at, in words.
    motion: String,
    /// Where the measured motion is smoothed, Hz; `None` where it is simulated.
    cutoff: Option<f64>,
    rounds: usize,
    settled: bool,
    /// eps_RA in percent with efforts predicted at the motion of the instruments.
    relative_absolute: f64,
    /// The equations that both are compared in.
    equations: usize,
    /// The correlation of each instrument with its column.
    relevance: Vec<Figure>,
    /// The probability of differences from least squares at least as large by chance.
    probability: f64,
    /// Whether this is of all differences together.
    joint: bool,
    /// Least squares less instrumental variables, over the deviation of this difference.
    differences: Vec<Figure>,
}

#[derive(Serialize)]
struct Figure {
    label: String,
    value: f64,
}

/// Below this probability least squares is called biased.
const BIASED: f64 = 0.01;
/// An F statistic of an instrument and its column below which it is called weak (Staiger and
/// Stock, 1997).
const WEAK: f64 = 10.0;
/// The bandwidth of simulated controllers without gains, Hz: that of `regen simulate`.
const BANDWIDTH: f64 = 3.0;

/// The model by instrumental variables, and what is said of it.
pub(crate) fn run(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    start: &Start,
    summary: &mut Summary,
) -> Result<IdentifiedModel, Failure> {
    // positions as they are, whatever filter the regressor's pass, and all of them: what passes a
    // filter is thinned behind it
    let raw = Reading {
        method: Method::Central,
        decimation: 1,
        ..observe::settings(&args.reading)
    };
    let working = progress::spinner("reading the measured motion".to_owned());
    let measured = Motion::recorded(model, &mut Logs::open(model, &args.logs, &raw)?)?;
    working.finish_and_clear();
    let options = InstrumentOptions {
        weighting: weighting(args),
        bandwidth: args.bandwidth,
        ..InstrumentOptions::default()
    };
    let mut logs = observe::open(model, &args.logs, &args.reading)?;
    let least = &start.estimate.values;
    let at_measured = measured.smoothed(None).map_err(|why| {
        let why = format!("--iv: the measured motion cannot be smoothed: {why}");
        Failure::Input(why)
    });
    let (smooth, cutoff) = at_measured?;
    let mut smooth = Some(smooth);
    let mut found = instrumental(model, &options, &mut logs, least, &mut |_| {
        Ok::<_, DataError>(smooth.take())
    })?;
    let mut cutoff = Some(cutoff);
    if let Some(file) = &args.reference {
        // least squares may be too far from a robot to be simulated; this is not biased as much
        let first = found.estimate.values.clone();
        let reference = path::read(file, model)?;
        let mut failed = None;
        let simulation =
            instrumental(
                model,
                &options,
                &mut logs,
                &first,
                &mut |values| match simulated(args, model, &reference, &measured, values) {
                    Ok(motion) => Ok(Some(motion)),
                    Err(why) => {
                        failed = Some(why);
                        Err(EstimateError::NoConvergence.into())
                    }
                },
            );
        if let Some(why) = failed {
            return Err(why);
        }
        (found, cutoff) = (simulation?, None);
    }
    summary.bandwidth = Some(found.bandwidth);
    summary.instruments = Some(InstrumentsJson::new(&found, cutoff));
    let method = format!(
        "instrumental variables, whitened scores correlated in {} samples (Newey and West)",
        found.bandwidth
    );
    // the regressor of the measured motion is that of least squares
    let mut estimate = found.estimate.clone();
    if let Some(blocks) = &start.blocks {
        let n = estimate.values.len();
        let all: Vec<usize> = (0..n).collect();
        let mut change = blocks.change(&start.factor, &all);
        change.resize(n, 0.0);
        let pairs = change
            .iter()
            .flat_map(|a| change.iter().map(move |b| a * b));
        let covariance = estimate.covariance.iter().zip(pairs);
        estimate.covariance = covariance.map(|(c, x)| c + x).collect();
    }
    Ok(IdentifiedModel {
        name: "instrumental variables".to_owned(),
        beta: found.estimate.values.clone(),
        feasibility: "not judged".to_owned(),
        intervals: Intervals::of(&estimate, &estimate, args.confidence, method),
        ..IdentifiedModel::default()
    })
}

/// The motion of the robot with these base parameters under PID control along a reference, at the
/// samples of the measured motion. Each run begins one period earlier, so that it has settled.
fn simulated(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    reference: &FourierReference,
    measured: &Motion,
    values: &[f64],
) -> Result<Motion, Failure> {
    let info = model.info();
    let (n, dof) = (info.coordinates.len(), info.dof());
    let mut phi = vec![0.0; info.parameters.len()];
    let free = vec![0.0; model.base_info().free.len()];
    model.parameters_from_base(values, &free, &mut phi)?;
    let refused = |why: String| {
        Failure::Numeric(format!(
            "--iv: the robot cannot be simulated with the present estimate: {why}; leave out \
             --reference, then the measured motion is used"
        ))
    };
    let mut out = Motion::new(dof);
    for run in measured.runs() {
        let times = measured.times().get(run).unwrap_or_default();
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            continue;
        };
        if times.len() < 2 {
            continue;
        }
        let step = (last - first) / (times.len() - 1) as f64;
        let early = (reference.period() / step).ceil();
        let begin = first - early * step;
        let start = reference.position(begin);
        let controllers = control(BANDWIDTH, &args.pid, model, &phi, &start);
        let controllers = controllers.map_err(|why| refused(why.to_string()))?;
        let drive = |joint: &usize| Drive {
            lag: 0.0,
            limit: info.joints.get(*joint).and_then(|j| j.limits.effort),
        };
        let settings = Settings {
            duration: last - begin,
            period: step,
            pid: controllers.pid,
            offset: controllers.offset,
            drives: info.actuated.iter().map(drive).collect(),
            friction: linear_friction(&info, &phi),
            tolerance: 1e-7,
            ..Settings::default()
        };
        let along = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
            reference.at(begin + t, q, qd, qdd);
        };
        let log = simulate(model, &phi, &along, &settings);
        let log = log.map_err(|why| refused(why.to_string()))?;
        if let Some(why) = reason(&log) {
            return Err(refused(why));
        }
        #[allow(clippy::cast_sign_loss, reason = "a number of periods")]
        let skip = early as usize;
        for (k, time) in times.iter().enumerate() {
            let row = (skip + k) * n;
            let pick = |all: &[f64]| -> Vec<f64> {
                let row = all.get(row..row + n).unwrap_or_default();
                let independent = info.independent.iter();
                independent.filter_map(|c| row.get(*c).copied()).collect()
            };
            let [q, qd, qdd] = [&log.q, &log.qd, &log.qdd].map(|all| pick(all));
            out.push(*time, [&q, &qd, &qdd], k > 0)
                .map_err(|why| Failure::Input(why.to_string()))?;
        }
    }
    Ok(out)
}

impl InstrumentsJson {
    fn new(found: &Instrumental, cutoff: Option<f64>) -> Self {
        let figures = |values: &[f64]| {
            let labels = found.estimate.labels.iter();
            let pairs = labels.zip(values).map(|(label, value)| Figure {
                label: label.clone(),
                value: *value,
            });
            pairs.collect()
        };
        Self {
            motion: if cutoff.is_some() {
                "measured and smoothed, for no --reference is given".to_owned()
            } else {
                "simulated along the reference".to_owned()
            },
            cutoff,
            rounds: found.rounds,
            settled: found.settled,
            relative_absolute: found.at_instruments,
            equations: found.estimate.efforts.iter().map(|e| e.rows).sum(),
            relevance: figures(&found.relevance),
            probability: found.test.probability,
            joint: found.test.joint,
            differences: figures(&found.test.ratios),
        }
    }

    /// For people.
    pub(crate) fn human(&self) -> String {
        let mut text = self.motion.clone();
        if let Some(cutoff) = self.cutoff {
            let _ = write!(text, ", below {} Hz", table::figure_of(3, cutoff));
        }
        let mut out = table::field("instruments", &text);
        let settled = if self.settled { "" } else { ", not settled" };
        out.push_str(&table::field(
            "rounds",
            &format!("{}{settled}", self.rounds),
        ));
        let least = |a: &&Figure, b: &&Figure| a.value.abs().total_cmp(&b.value.abs());
        if let Some(weakest) = self.relevance.iter().min_by(least) {
            let square = weakest.value * weakest.value;
            let strength = square / (1.0 - square) * self.equations as f64;
            let weak = if strength < WEAK { ": weak" } else { "" };
            let text = format!(
                "{} or more, of {}{weak}",
                table::figure_of(3, weakest.value),
                weakest.label
            );
            out.push_str(&table::field("correlation", &text));
        }
        let verdict = if self.probability < BIASED {
            let most = self.differences.iter().max_by(least);
            let most = most.map_or_else(String::new, |f| {
                format!(
                    ", most in {} ({} sigma)",
                    f.label,
                    table::figure_of(2, f.value)
                )
            });
            format!("least squares is biased{most}")
        } else {
            "least squares does not differ by more than chance".to_owned()
        };
        let figure = table::figure_of(2, self.probability);
        let text = format!("{verdict}; p = {figure} (Durbin, Wu, Hausman)");
        out.push_str(&table::field("bias", &text));
        out.push_str(&table::field(
            "eps_RA there",
            &format!(
                "{:.3} % at the motion of the instruments",
                self.relative_absolute
            ),
        ));
        out
    }
}
