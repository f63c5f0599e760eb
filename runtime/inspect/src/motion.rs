//! How the joints of a robot move in the states of a log.

use regen_identify::states::StateSample;
use regen_runtime::Info;
use serde::Serialize;

/// Speeds below this part of the largest count as near a change of direction.
const SLOW_PART: f64 = 0.03;
/// The least share of the states in which a joint moves in either direction.
const MIN_SHARE: f64 = 0.02;
/// A velocity whose range is below this part of its largest value counts as constant.
const MAX_SPEED_VARIATION: f64 = 0.05;
/// The least part of a joint's range that a motion should cover.
const MIN_RANGE: f64 = 0.1;
/// A joint that rests in a larger share of the states counts as one that does not move.
const STILL_SHARE: f64 = 0.99;
/// The largest number of states that [`Motions::spread`] returns.
const MAX_SPREAD_STATES: usize = 64;

/// The motion of an independent joint in a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct JointMotion {
    /// The joint's name.
    pub name: String,
    /// The smallest and largest position, rad or m.
    pub positions: [f64; 2],
    /// The part of the joint's range between its limits that it covers; `None` without limits.
    pub covered: Option<f64>,
    /// The smallest and largest velocity, rad/s or m/s.
    pub velocities: [f64; 2],
    /// The share of the states in which it moves forward, and backward.
    pub directions: [f64; 2],
    /// The rms acceleration, rad/s^2 or m/s^2.
    pub acceleration: f64,
    /// The share of the states at rest.
    pub resting: f64,
    /// The deficiencies of the motion, in words, such as `never moves`, `never changes direction` or
    /// `never accelerates`.
    pub lacks: Vec<String>,
}

/// A state of the independent joints.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Vec<f64>,
    pub(crate) qdd: Vec<f64>,
}

/// Sums over the states of one joint.
#[derive(Clone, Debug)]
struct Sums {
    positions: [f64; 2],
    velocities: [f64; 2],
    squares: f64,
    resting: usize,
    count: usize,
}

/// The motion of all independent joints, accumulated state by state.
#[derive(Clone, Debug)]
pub(crate) struct Motions {
    sums: Vec<Sums>,
    /// One of this many states is stored.
    every: usize,
    /// The number of states so far.
    count: usize,
    pub(crate) states: Vec<State>,
    /// Velocities at stored states. They are needed to the end, since the share of slow ones depends
    /// on the largest.
    speeds: Vec<Vec<f64>>,
}

/// The number of stored velocities at which every other one is dropped.
const MAX_SPEEDS: usize = 4096;

impl Motions {
    pub(crate) fn new(dof: usize) -> Self {
        let sums = Sums {
            positions: [f64::INFINITY, f64::NEG_INFINITY],
            velocities: [f64::INFINITY, f64::NEG_INFINITY],
            squares: 0.0,
            resting: 0,
            count: 0,
        };
        Self {
            sums: vec![sums; dof],
            every: 1,
            count: 0,
            states: Vec::new(),
            speeds: Vec::new(),
        }
    }

    pub(crate) fn push(&mut self, info: &Info<'_>, row: &StateSample<'_>) {
        let pick = |of: &[f64]| -> Vec<f64> {
            let entries = info.independent.iter();
            entries
                .map(|c| of.get(*c).copied().unwrap_or(0.0))
                .collect()
        };
        let state = State {
            q: pick(row.q),
            qd: pick(row.qd),
            qdd: pick(row.qdd),
        };
        for (k, (sums, c)) in self.sums.iter_mut().zip(info.independent).enumerate() {
            let (q, v, a) = (state.q[k], state.qd[k], state.qdd[k]);
            sums.positions = [sums.positions[0].min(q), sums.positions[1].max(q)];
            sums.velocities = [sums.velocities[0].min(v), sums.velocities[1].max(v)];
            sums.squares += a * a;
            sums.count += 1;
            sums.resting += usize::from(row.at_standstill.get(*c).copied().unwrap_or(false));
        }
        if self.count.is_multiple_of(self.every) {
            self.speeds.push(state.qd.clone());
            if self.speeds.len() == MAX_SPEEDS {
                self.every *= 2;
                let mut k = 0;
                self.speeds.retain(|_| {
                    k += 1;
                    k % 2 == 1
                });
                let mut k = 0;
                self.states.retain(|_| {
                    k += 1;
                    k % 2 == 1
                });
            }
            self.states.push(state);
        }
        self.count += 1;
    }

    /// Up to [`MAX_SPREAD_STATES`] states, evenly spread over the log.
    pub(crate) fn spread(&self) -> Vec<State> {
        let every = self.states.len().div_ceil(MAX_SPREAD_STATES).max(1);
        self.states.iter().step_by(every).cloned().collect()
    }

    pub(crate) fn finish(&self, info: &Info<'_>) -> Vec<JointMotion> {
        let one = |(k, c): (usize, &usize)| {
            let sums = &self.sums[k];
            let count = sums.count.max(1) as f64;
            let [low, high] = sums.velocities;
            let most = low.abs().max(high.abs());
            let all = self.speeds.len().max(1) as f64;
            let share = |sign: f64| {
                let moving = self
                    .speeds
                    .iter()
                    .filter(|v| sign * v[k] > SLOW_PART * most);
                moving.count() as f64 / all
            };
            let limits = info.joints.get(*c).and_then(|j| j.limits.position);
            let width = sums.positions[1] - sums.positions[0];
            let mut out = JointMotion {
                name: info.coordinates.get(*c).map_or("", |n| n).to_owned(),
                positions: sums.positions,
                covered: limits
                    .map(|[a, b]| width / (b - a))
                    .filter(|c| c.is_finite()),
                velocities: sums.velocities,
                directions: [share(1.0), share(-1.0)],
                acceleration: (sums.squares / count).sqrt(),
                resting: sums.resting as f64 / count,
                lacks: Vec::new(),
            };
            let [forward, backward] = out.directions;
            let mut lacks = |what: &str| out.lacks.push(what.to_owned());
            if out.resting >= STILL_SHARE || most.is_nan() || most <= 0.0 {
                lacks("never moves");
            } else {
                if forward < MIN_SHARE || backward < MIN_SHARE {
                    lacks("never changes direction");
                }
                if high - low < MAX_SPEED_VARIATION * most {
                    lacks("never accelerates");
                }
                if out.covered.is_some_and(|covered| covered < MIN_RANGE) {
                    lacks("stays in less than a tenth of its range");
                }
            }
            out
        };
        info.independent.iter().enumerate().map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use regen_runtime::{Joint, Limits};

    use super::*;

    #[test]
    fn the_covered_part_of_a_range_is_that_between_the_extreme_positions() {
        let limits = Limits {
            position: Some([-1.0, 3.0]),
            ..Limits::NONE
        };
        let joint = Joint {
            limits,
            ..Joint::ROTATION
        };
        let info = Info {
            coordinates: &["q"],
            independent: &[0],
            joints: &[joint],
            ..Info::EMPTY
        };
        let mut motions = Motions::new(1);
        for (q, qd) in [(1.0, 2.0), (1.5, -2.0), (0.5, 0.5)] {
            let row = StateSample {
                time: 0.0,
                q: &[q],
                qd: &[qd],
                qdd: &[0.0],
                tau: &[],
                efforts: &[],
                held: &[],
                at_standstill: &[],
                weights: &[],
                follows: true,
                bridged: false,
            };
            motions.push(&info, &row);
        }
        let found = motions.finish(&info);
        assert_eq!(format!("{:?}", found[0].positions), "[0.5, 1.5]");
        assert_eq!(found[0].covered, Some(0.25));
        assert_eq!(found[0].lacks, [""; 0]);
    }
}
