//! The unknowns of a fit: base parameters of the robot, parameters of payloads, gains of drives.

use super::payload::Load;

/// The gain of an effort.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum GainKind {
    /// The effort was measured in N m or N, or its gain is known.
    Known,
    /// The effort is a current of this gain, which another identification found.
    Found(f64),
    /// The effort is a current of the unknown gain with this index.
    Unknown(usize),
}

/// The unknowns of a fit, and what is known beside them: measured efforts are `i = g W x`, with gains
/// k = 1/g.
#[derive(Clone)]
pub(super) struct Unknowns {
    pub(super) gains: Vec<GainKind>,
    /// The places of the unknown parameters of the robot.
    pub(super) robot: Vec<usize>,
    /// All base parameters, with those that are known; the others are 0.
    pub(super) known: Vec<f64>,
    /// The payloads that are carried.
    pub(super) loads: Vec<Load>,
}

/// Values of the unknowns.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) robot: Vec<f64>,
    /// The unknowns of each payload.
    pub(super) loads: Vec<Vec<f64>>,
    /// 1/k of each unknown gain.
    pub(super) inverse_gains: Vec<f64>,
}

impl Point {
    pub(super) fn to_vec(&self) -> Vec<f64> {
        let loads = self.loads.iter().flatten();
        let all = self.robot.iter().chain(loads).chain(&self.inverse_gains);
        all.copied().collect()
    }

    pub(super) fn moved(&self, step: &[f64]) -> Self {
        let mut out = self.clone();
        let loads = out.loads.iter_mut().flatten();
        let all = out.robot.iter_mut().chain(loads);
        for (x, dx) in all.chain(&mut out.inverse_gains).zip(step) {
            *x += dx;
        }
        out
    }
}

impl Unknowns {
    /// 1/k of an effort.
    pub(super) fn inverse_gain(&self, effort: usize, point: &Point) -> f64 {
        match self.gains.get(effort) {
            Some(GainKind::Found(gain)) => 1.0 / gain,
            Some(GainKind::Unknown(k)) => point.inverse_gains.get(*k).copied().unwrap_or(1.0),
            _ => 1.0,
        }
    }

    /// All base parameters.
    pub(super) fn base(&self, point: &Point) -> Vec<f64> {
        let mut x = self.known.clone();
        for (place, value) in self.robot.iter().zip(&point.robot) {
            x[*place] = *value;
        }
        for (load, unknown) in self.loads.iter().zip(&point.loads) {
            for (place, value) in load.base.iter().zip(load.values(unknown)) {
                x[*place] = value;
            }
        }
        x
    }

    pub(super) fn unknown_gains(&self) -> usize {
        let unknown = |gain: &&GainKind| matches!(gain, GainKind::Unknown(_));
        self.gains.iter().filter(unknown).count()
    }

    /// The number of unknowns.
    pub(super) fn count(&self) -> usize {
        let of_loads: usize = self.loads.iter().map(|load| load.unknown.len()).sum();
        self.robot.len() + of_loads + self.unknown_gains()
    }
}

/// A column over all base parameters from one over some.
pub(super) fn spread(n: usize, places: &[usize], column: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; n];
    for (place, value) in places.iter().zip(column) {
        out[*place] = *value;
    }
    out
}
