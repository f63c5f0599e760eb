//! Finds the motions that would determine a parameter which the log does not determine.
//!
//! Three motions of each joint are tried: other positions at rest, velocities in both directions, and
//! accelerations, each at states of the log. Their equations are added to those of the log with the
//! same total weight. A parameter needs the motion that reduces its standard deviation most.

use core::fmt;

use regen_identify::estimate::{EstimateError, QrFactor};
use regen_runtime::{BaseModel, LoopClosure, Motion, Status};
use serde::Serialize;

use crate::motion::{JointMotion, State};
use crate::predict::{Spread, spread};

/// The least factor by which a proposed motion must reduce the standard deviation.
const MIN_IMPROVEMENT: f64 = 3.0;
/// Another motion is reported too if its deviation is within this factor of that of the best one.
const EQUIVALENT_RATIO: f64 = 1.5;
/// The largest number of motions that are reported for one parameter.
const MAX_NEEDS: usize = 2;
/// The number of states of the log at which each motion is tried.
const STATES: usize = 12;
/// The speed of revolute and prismatic joints without limits, rad/s and m/s.
const DEFAULT_SPEED: [f64; 2] = [1.0, 0.2];
/// The range of revolute and prismatic joints without limits, to either side, rad and m.
const DEFAULT_RANGE: [f64; 2] = [1.0, 0.1];
/// The frequency of the oscillation by which a tried motion accelerates a joint, Hz.
const ACCELERATION_HZ: f64 = 0.5;
/// The part of a joint's limits that tried motions use.
const PART_OF_LIMITS: f64 = 0.5;

/// A kind of motion of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Other positions, also at rest.
    Positions,
    /// Velocity, in both directions.
    Velocity,
    /// Acceleration.
    Acceleration,
}

/// A motion of a joint that a parameter needs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Need {
    /// The joint's name.
    pub joint: String,
    /// The kind of motion that is needed.
    pub kind: Kind,
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { joint, kind } = self;
        match kind {
            Kind::Positions => write!(f, "other positions of {joint}"),
            Kind::Velocity => write!(f, "velocity of {joint}"),
            Kind::Acceleration => write!(f, "acceleration of {joint}"),
        }
    }
}

/// The equations and states of the log, with which each motion is tried.
pub(crate) struct Trial<'a, M: ?Sized> {
    pub(crate) model: &'a M,
    /// The weighted equations of the log.
    pub(crate) factor: &'a QrFactor,
    /// The weight of each equation of motion.
    pub(crate) weights: &'a [f64],
    pub(crate) states: &'a [State],
    pub(crate) motions: &'a [JointMotion],
}

/// For each parameter in question, the motions that reduce its standard deviation most.
///
/// - `now`: the standard deviations from the log alone.
pub(crate) fn needs<M: BaseModel<f64> + ?Sized>(
    trial: &Trial<'_, M>,
    now: &Spread,
    in_question: &[usize],
) -> Result<Vec<Vec<Need>>, EstimateError> {
    let info = trial.model.info();
    let mut out = vec![Vec::new(); in_question.len()];
    let Ok(mut closure) = LoopClosure::new(trial.model) else {
        return Ok(out);
    };
    // for each parameter, the factor by which each motion reduces its standard deviation
    let mut gains: Vec<Vec<(f64, Need)>> = vec![Vec::new(); in_question.len()];
    for (k, c) in info.independent.iter().enumerate() {
        for kind in [Kind::Positions, Kind::Velocity, Kind::Acceleration] {
            let Some(factor) = with_motion(trial, &mut closure, k, kind)? else {
                continue;
            };
            let then = spread(&factor)?;
            for (place, parameter) in in_question.iter().enumerate() {
                let after = then.sigmas.get(*parameter).copied().flatten();
                let before = now.sigmas.get(*parameter).copied().flatten();
                let gain = match (before, after) {
                    (None, Some(sigma)) if sigma > 0.0 => f64::MAX / (1.0 + sigma),
                    (Some(before), Some(after)) if after > 0.0 => before / after,
                    _ => 0.0,
                };
                if gain >= MIN_IMPROVEMENT {
                    let joint = info.coordinates.get(*c).map_or("", |n| n).to_owned();
                    gains[place].push((gain, Need { joint, kind }));
                }
            }
        }
    }
    for (needs, mut found) in out.iter_mut().zip(gains) {
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = found.first().map_or(0.0, |f| f.0);
        let near = found.into_iter().filter(|f| f.0 * EQUIVALENT_RATIO >= best);
        needs.extend(near.take(MAX_NEEDS).map(|f| f.1));
    }
    Ok(out)
}

/// The equations of the log with those of a motion of the k-th independent joint; `None` if the loops
/// do not close or are singular at all states of this motion.
fn with_motion<M: BaseModel<f64> + ?Sized>(
    trial: &Trial<'_, M>,
    closure: &mut LoopClosure<'_, M>,
    k: usize,
    kind: Kind,
) -> Result<Option<QrFactor>, EstimateError> {
    let info = trial.model.info();
    let joint = info.independent.get(k).and_then(|c| info.joints.get(*c));
    let turns = joint.is_none_or(|j| j.motion == Motion::Rotation);
    let plain = |values: [f64; 2]| if turns { values[0] } else { values[1] };
    let most = |limit: Option<[f64; 2]>| limit.map(|[a, b]| PART_OF_LIMITS * a.abs().max(b.abs()));
    let limits = joint.map(|j| j.limits).unwrap_or_default();
    let speed = most(limits.velocity).unwrap_or(plain(DEFAULT_SPEED));
    let rate = core::f64::consts::TAU * ACCELERATION_HZ * speed;
    let rate = most(limits.acceleration).map_or(rate, |limit| limit.min(rate));
    let centre = trial
        .motions
        .get(k)
        .map_or(0.0, |m| 0.5 * (m.positions[0] + m.positions[1]));
    let side = plain(DEFAULT_RANGE);
    let [low, high] = limits.position.unwrap_or([centre - side, centre + side]);
    let every = trial.states.len().div_ceil(STATES).max(1);
    let parts: &[f64] = match kind {
        Kind::Positions => &[0.1, 0.35, 0.65, 0.9],
        Kind::Velocity | Kind::Acceleration => &[-1.0, -0.5, 0.5, 1.0],
    };
    let (n, r) = (info.dof(), trial.factor.columns());
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for state in trial.states.iter().step_by(every) {
        for part in parts {
            let State {
                mut q,
                mut qd,
                mut qdd,
            } = state.clone();
            match kind {
                Kind::Positions => {
                    q[k] = low + part * (high - low);
                    qd.fill(0.0);
                    qdd.fill(0.0);
                }
                Kind::Velocity => {
                    qd[k] = part * speed;
                    qdd.fill(0.0);
                }
                Kind::Acceleration => qdd[k] = part * rate,
            }
            let Ok(closed) = closure.solve_state(&q, &qd, &qdd) else {
                continue;
            };
            if !closed.outcome.is_closed() {
                continue;
            }
            let mut w = vec![0.0; n * r];
            let regular = trial
                .model
                .base_regressor(&closed.q, &closed.qd, &closed.qdd, &mut w)?;
            if regular.status() != Status::Singular && w.iter().all(|x| x.is_finite()) {
                rows.push(w);
            }
        }
    }
    if rows.is_empty() {
        return Ok(None);
    }
    let whole = trial.factor.rows() as f64 / (n * rows.len()) as f64;
    let mut factor = trial.factor.clone();
    for mut w in rows {
        for column in w.chunks_exact_mut(n.max(1)) {
            for (entry, weight) in column.iter_mut().zip(trial.weights) {
                *entry *= weight * whole.sqrt();
            }
        }
        factor.push_block(&w, &vec![0.0; n])?;
    }
    Ok(Some(factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::testing::models::Pendulum;
    use regen_runtime::{
        Arguments, BaseFunction, BaseInfo, Condition, Function, Info, Joint, Model, SizeError,
    };

    /// The pendulum with a limit of its speed, rad/s.
    struct Limited([Joint; 1]);

    impl Model<f64> for Limited {
        fn info(&self) -> Info<'_> {
            let info = Model::<f64>::info(&Pendulum);
            Info {
                joints: &self.0,
                ..info
            }
        }

        fn eval(
            &self,
            function: Function,
            x: Arguments<'_, f64>,
            out: &mut [f64],
        ) -> Result<Condition<f64>, SizeError> {
            Pendulum.eval(function, x, out)
        }
    }

    impl BaseModel<f64> for Limited {
        fn base_info(&self) -> BaseInfo<'_> {
            BaseModel::<f64>::base_info(&Pendulum)
        }

        fn eval_base(
            &self,
            function: BaseFunction,
            x: Arguments<'_, f64>,
            out: &mut [f64],
        ) -> Result<Condition<f64>, SizeError> {
            Pendulum.eval_base(function, x, out)
        }
    }
    #[test]
    fn a_tried_acceleration_is_that_of_half_a_hertz_at_half_of_the_largest_speed() {
        for largest in [2.0, 8.0] {
            let mut joint = regen_runtime::Joint::ROTATION;
            joint.limits.velocity = Some([-largest, largest]);
            let model = Limited([joint]);
            // a log of eight equations that show nothing
            let mut log = QrFactor::new(vec!["Izz(1)".to_owned(), "mx(1)".to_owned()]);
            log.push_block(&[0.0; 16], &[0.0; 8]).unwrap();
            let state = State {
                q: vec![0.5],
                qd: vec![0.0],
                qdd: vec![0.0],
            };
            let trial = Trial {
                model: &model,
                factor: &log,
                weights: &[1.0],
                states: &[state],
                motions: &[],
            };
            let mut closure = LoopClosure::new(&model).unwrap();
            let found = with_motion(&trial, &mut closure, 0, Kind::Acceleration).unwrap();
            // (1, 1/2, 1/2, 1) times pi rad/s^2 for each rad/s, as many equations as in the log
            let rate = core::f64::consts::PI * largest / 2.0;
            let wanted = (8.0 * 2.5 / 4.0_f64).sqrt() * rate;
            let norm = found.unwrap().column_norms()[0];
            assert!((norm / wanted - 1.0).abs() < 1e-12, "{norm} {wanted}");
        }
    }
}
