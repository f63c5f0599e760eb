//! What the efforts of the logs say of a fit to responses, which does not use them.

use regen_identify::data::{Run, Track};
use regen_identify::model::IdentifiedModel;
use regen_identify::session::{LeastSquaresStart, Session, compare, from_logs};
use regen_interpreted::Interpreted;
use regen_report::results::EffortsOfLogs;
use regen_response::{
    Action, Damping, Law, Setup, SimulatedLoops, TrackControllers, Value, motion_distance,
};

use crate::args::IdentifyArgs;
use crate::{choice, observe, table};

/// An estimate whose squared error is larger than that of least squares by the square of this part of the
/// efforts, percent, contradicts them: values of another loop are far more off, and those of the right one
/// are off by the noise of the responses.
const LEAST_PERCENT: f64 = 3.0;
/// It is also to be larger by this part of the error of least squares, which the model does not explain.
const LEAST_PART: f64 = 0.3;
/// By how many rows the efforts of controllers that are tried are late, and the velocity of their damping.
const LATENCIES: [usize; 3] = [0, 1, 2];
const VELOCITY_LATENCIES: [f64; 5] = [0.0, 0.5, 1.0, 1.5, 2.0];

/// The efforts of the logs, with least squares of them.
pub(super) struct Efforts<'m> {
    session: Session<'m, Interpreted<'m>>,
    /// The time at the start of each log that simulations leave out, s.
    settle: f64,
    logs: Vec<Run>,
    start: LeastSquaresStart,
}

impl<'m> Efforts<'m> {
    /// Reads the efforts of the logs; `None` where they have none that determine the parameters.
    pub(super) fn of(args: &IdentifyArgs, model: &'m Interpreted<'m>) -> Option<Self> {
        let mut reading = args.reading.clone();
        let open = choice::open(&reading, false);
        let session = observe::session(model, &reading);
        let mut logs = args.logs.clone();
        choice::made(&mut reading, &session, &mut logs, open).ok()?;
        let session = observe::session(model, &reading);
        let mut opened = session.open(&logs).ok()?;
        let start = from_logs(&session, &mut opened).ok()?;
        Some(Self {
            session,
            settle: args.simulated.settle,
            logs,
            start,
        })
    }

    /// The base parameters of least squares.
    pub(super) fn least_squares(&self) -> &[f64] {
        &self.start.estimate.values
    }

    /// The controllers with another action or latency with which the robot of least squares moves nearest to
    /// the measured motion; `None` where gains are not known, or none moves nearer than with these ones. Each
    /// takes one simulation.
    pub(super) fn nearest_loop(&self, all: &[Track], setup: &Setup) -> Option<Setup> {
        let mut gains = setup.laws.iter().flat_map(Law::gains);
        if gains.any(Value::is_estimated) {
            return None;
        }
        let model = self.session.model;
        let info = model.info();
        let values = vec![self.least_squares().to_vec(); all.len()];
        let distance = |own: &Setup| {
            let known = vec![Some(own); all.len()];
            let controllers = TrackControllers::new(&known, &[], &info);
            let settle = self.settle;
            let loops =
                SimulatedLoops::choose(model, all, None, &controllers, None, settle, &values)
                    .ok()?;
            motion_distance(model, &loops.runs(), settle, &values)
        };
        let with = |action: Action, late: usize, velocity_late: f64| {
            let mut other = setup.clone();
            other.action = action;
            for law in &mut other.laws {
                (law.late, law.velocity_late) = (late, velocity_late);
            }
            other
        };
        let is_damped = setup
            .laws
            .iter()
            .any(|law| law.damping == Damping::OfVelocity);
        let of_velocity = if is_damped {
            &VELOCITY_LATENCIES[..]
        } else {
            &VELOCITY_LATENCIES[..1]
        };
        let mut tried = vec![with(Action::Continuous, 0, 0.0)];
        for late in LATENCIES {
            tried.extend(
                of_velocity
                    .iter()
                    .map(|own| with(Action::Sampled, late, *own)),
            );
        }
        let own = distance(setup).unwrap_or(f64::INFINITY);
        let others = tried.into_iter().filter(|other| other != setup);
        let others = others.filter_map(|other| Some((distance(&other)?, other)));
        let (nearest, other) = others.min_by(|a, b| a.0.total_cmp(&b.0))?;
        (nearest < own).then_some(other)
    }

    /// How well an estimate predicts the efforts, in the log where it is worst.
    pub(super) fn errors(&self, found: &IdentifiedModel) -> Option<EffortsOfLogs> {
        let models = [self.start.model(), found.clone()];
        let logs = (self.logs.as_slice(), &[][..]);
        let errors = compare(&self.session, Some(&self.start), logs, &models).ok()?;
        let [least, own] = &errors[..] else {
            return None;
        };
        let pairs = least.iter().zip(own).map(|(least, own)| EffortsOfLogs {
            relative_absolute: own.relative_absolute,
            least_squares: least.relative_absolute,
        });
        pairs.max_by(|a, b| excess(*a).total_cmp(&excess(*b)))
    }
}

/// By how much an estimate is worse than least squares, percent.
fn excess(errors: EffortsOfLogs) -> f64 {
    let (own, least) = (errors.relative_absolute, errors.least_squares);
    if own.is_finite() {
        (own * own - least * least).max(0.0).sqrt()
    } else {
        f64::INFINITY
    }
}

/// Whether the efforts contradict an estimate.
pub(super) fn contradicts(errors: EffortsOfLogs) -> bool {
    excess(errors) > LEAST_PERCENT.max(LEAST_PART * errors.least_squares)
}

/// Says that the efforts contradict an estimate, and which other controllers agree better.
///
/// - `tried`: other controllers, with the errors of the estimate with them.
pub(super) fn warning(errors: EffortsOfLogs, tried: Option<&(Setup, EffortsOfLogs)>) -> String {
    let percent = |value: f64| table::figure_of(3, value);
    // half of what does not agree is explained at least
    let better = tried.filter(|(_, own)| excess(*own) < 0.5 * excess(errors));
    let remedy = match better {
        Some((other, own)) => format!(
            "with {} in the controllers, which was tried, it has {} %",
            keys(other).join(", "),
            percent(own.relative_absolute)
        ),
        None => "no other action and no latency of the controllers that was tried explains half of that: \
                 look at the gains, the commands, and the columns and units of the efforts"
            .to_owned(),
    };
    format!(
        "warning: the efforts of the logs contradict this estimate: it predicts them with eps_RA {} %, and \
         least squares of them has {} % (--estimator ls); {remedy}",
        percent(errors.relative_absolute),
        percent(errors.least_squares)
    )
}

/// The keys that say when controllers act, and how late.
fn keys(setup: &Setup) -> Vec<String> {
    if setup.action == Action::Continuous {
        return vec!["`action: continuous`".to_owned()];
    }
    let mut out = vec!["`action: sampled`".to_owned()];
    let late = setup.laws.iter().map(|law| law.late).max().unwrap_or(0);
    let of_velocity = setup.laws.iter().map(|law| law.velocity_late);
    let of_velocity = of_velocity.fold(0.0, f64::max);
    if late > 0 {
        out.push(format!("`latency: {late}`"));
    }
    if of_velocity > 0.0 {
        out.push(format!("`velocity_latency: {of_velocity}`"));
    }
    out
}
