//! Controllers of actuated joints, such as PID position control, and the drives that carry out
//! their commands.

use std::collections::VecDeque;

/// What the derivative gain of a controller multiplies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Damping {
    /// The rate of the position error: its difference from sample to sample over the time between
    /// them.
    #[default]
    OfError,
    /// The joint's velocity with a negative sign, as in cascades whose inner loop is one of velocity, and in
    /// the actuators of physics engines.
    OfVelocity,
}

/// The gains of a PID controller of one joint: effort per position error, per its integral and per
/// its derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pid {
    /// The proportional gain, N/m or N m/rad.
    pub kp: f64,
    /// The integral gain, N/(m s) or N m/(rad s).
    pub ki: f64,
    /// The derivative gain, N s/m or N m s/rad.
    pub kd: f64,
    /// The gain of the integral of the velocity, which acts against it, N/m or N m/rad: of cascades whose
    /// inner loop of velocity integrates.
    pub ki_velocity: f64,
    /// What the derivative gain multiplies.
    pub damping: Damping,
    /// The number of samples from a measurement until the effort that is computed from it acts.
    pub late: usize,
    /// The number of samples by which the velocity is late that the derivative gain multiplies, as one that is
    /// computed from differences of positions is; between two samples it changes evenly.
    pub velocity_late: f64,
    /// How many times the controller acts within a row of the log that it is compared with, at even times,
    /// while its command stays that of the row; 0 as 1.
    pub acts_per_row: usize,
}

/// A drive: the lag and the limits with which it applies the commanded effort.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drive {
    /// The time constant of the first-order lag, s; 0: without lag.
    pub lag: f64,
    /// The least and greatest effort, N or N m.
    pub limit: Option<[f64; 2]>,
}

/// The input of a controller at each sample.
#[derive(Clone, Copy, Debug)]
pub struct ControllerInput<'a> {
    /// The time, s.
    pub t: f64,
    /// The time between samples, s.
    pub period: f64,
    /// All coordinates of the reference, a closed state (n, rad or m).
    pub q: &'a [f64],
    /// The reference's independent positions, rad or m (dof).
    pub q_i: &'a [f64],
    /// The reference's independent velocities, rad/s or m/s (dof).
    pub qd_i: &'a [f64],
    /// The reference's independent accelerations, rad/s^2 or m/s^2 (dof).
    pub qdd_i: &'a [f64],
    /// The measured positions of the actuated joints, rad or m, in the order of `Info::actuated`.
    pub measured: &'a [f64],
    /// The velocities of the actuated joints, rad/s or m/s; empty where no PID controller of the settings
    /// needs them.
    pub velocities: &'a [f64],
}

/// A controller: computes the efforts of the actuated joints once a period.
pub trait Controller {
    /// Fills the efforts of the actuated joints, N or N m, in the order of `Info::actuated`. The
    /// drives apply them, within their limits.
    fn efforts(&mut self, now: &ControllerInput<'_>, efforts: &mut [f64]);
}

impl<F: FnMut(&ControllerInput<'_>, &mut [f64])> Controller for F {
    fn efforts(&mut self, now: &ControllerInput<'_>, efforts: &mut [f64]) {
        self(now, efforts);
    }
}

/// A joint this far from its reference, rad or m, has left it for good: the loop is unstable. The
/// faster it goes, the shorter the steps of the integration become, so that the run is ended here.
const LOST_DISTANCE: f64 = 100.0;

/// The PID controllers of the actuated joints; the command of each is added to a constant effort. Joints
/// that have left their reference for good get no command (NaN), which ends the run.
#[derive(Clone, Debug)]
pub(super) struct PidControllers<'a> {
    pub(super) pid: &'a [Pid],
    pub(super) offset: &'a [f64],
    pub(super) drives: &'a [Drive],
    /// The indices of the actuated joints among the coordinates.
    pub(super) joints: &'a [usize],
    states: Vec<PidState>,
}

impl<'a> PidControllers<'a> {
    pub(super) fn new(
        pid: &'a [Pid],
        offset: &'a [f64],
        drives: &'a [Drive],
        joints: &'a [usize],
    ) -> Self {
        Self {
            pid,
            offset,
            drives,
            joints,
            states: vec![PidState::default(); joints.len()],
        }
    }
}

impl Controller for PidControllers<'_> {
    fn efforts(&mut self, now: &ControllerInput<'_>, efforts: &mut [f64]) {
        let loops = self.joints.iter().zip(self.pid).zip(&mut self.states);
        for (k, ((joint, pid), state)) in loops.enumerate() {
            let error = now.q[*joint] - now.measured[k];
            let velocity = now.velocities.get(k).copied().unwrap_or(0.0);
            let offset = self.offset.get(k).copied().unwrap_or(0.0);
            let drive = self.drives.get(k).copied().unwrap_or_default();
            // the limits of the effort that the PID controller adds to the offset
            let limit = drive.limit.map(|l| l.map(|bound| bound - offset));
            let effort =
                offset + pid.command(state, [error, velocity, now.measured[k]], now.period, limit);
            let is_lost = error.abs() > LOST_DISTANCE;
            efforts[k] = if is_lost { f64::NAN } else { effort };
        }
    }
}

/// The state of a PID controller between samples: the integral of the error, the last error, and the
/// efforts that are computed and do not act yet.
#[derive(Clone, Debug, Default)]
pub(super) struct PidState {
    integral: f64,
    last: Option<f64>,
    /// The position at the first sample.
    origin: Option<f64>,
    waiting: VecDeque<f64>,
    velocities: LateVelocity,
}

/// The velocities of the last samples.
#[derive(Clone, Debug, Default)]
struct LateVelocity(VecDeque<f64>);

impl LateVelocity {
    /// Adds the velocity of a sample; returns that of a number of samples before, where the first one was
    /// constant before it.
    fn at(&mut self, velocity: f64, late: f64) -> f64 {
        self.0.push_front(velocity);
        let of = |k: usize| self.0.get(k).or_else(|| self.0.back()).copied();
        #[allow(clippy::cast_sign_loss, reason = "at least 0")]
        let whole = late.max(0.0).floor() as usize;
        let part = late - whole as f64;
        let (newer, older) = (of(whole), of(whole + 1));
        self.0.truncate(whole + 2);
        let pair = newer.zip(older);
        pair.map_or(velocity, |(newer, older)| newer + part * (older - newer))
    }
}

impl Pid {
    /// Whether the effort depends on the joint's velocity itself.
    pub(super) fn needs_velocity(&self) -> bool {
        self.damping == Damping::OfVelocity || self.late > 0
    }

    /// The effort that acts from this sample on, N or N m, for its position error and velocity. The
    /// derivative of the error is its difference over the period; the integral is not updated while the
    /// drive is saturated in the direction of the error. Before the first sample the joint moved with the
    /// same velocity.
    pub(super) fn command(
        self,
        state: &mut PidState,
        [error, velocity, position]: [f64; 3],
        period: f64,
        limit: Option<[f64; 2]>,
    ) -> f64 {
        let moved = position - *state.origin.get_or_insert(position);
        if state.last.is_none() {
            for k in (1..=self.late).rev() {
                let earlier = error + k as f64 * period * velocity;
                let damped = match self.damping {
                    Damping::OfError => 0.0,
                    Damping::OfVelocity => self.kd * velocity,
                };
                let back = k as f64 * period * velocity;
                let effort = self.kp * earlier - damped + self.ki_velocity * back;
                let held = limit.map_or(effort, |[lo, hi]| effort.max(lo).min(hi));
                state.waiting.push_back(held);
            }
        }
        let effort = self.computed(state, [error, velocity, moved], period, limit);
        state.waiting.push_back(effort);
        state.waiting.pop_front().unwrap_or(effort)
    }

    /// The effort that is computed at this sample.
    fn computed(
        self,
        state: &mut PidState,
        [error, velocity, moved]: [f64; 3],
        period: f64,
        limit: Option<[f64; 2]>,
    ) -> f64 {
        let rate = match self.damping {
            Damping::OfError => state.last.map_or(0.0, |last| (error - last) / period),
            Damping::OfVelocity => -state.velocities.at(velocity, self.velocity_late),
        };
        state.last = Some(error);
        let grown = state.integral + error * period;
        let held = self.ki_velocity * moved;
        let effort_with =
            |integral: f64| self.kp * error + self.ki * integral + self.kd * rate - held;
        let Some([lo, hi]) = limit else {
            state.integral = grown;
            return effort_with(grown);
        };
        let effort = effort_with(grown);
        if (effort > hi && error > 0.0) || (effort < lo && error < 0.0) {
            return effort_with(state.integral).max(lo).min(hi);
        }
        state.integral = grown;
        effort.max(lo).min(hi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saturated_drive_does_not_wind_up() {
        let pid = Pid {
            kp: 10.0,
            ki: 100.0,
            ..Pid::default()
        };
        let limit = Some([-1.0, 1.0]);
        let mut state = PidState::default();
        for _ in 0..1000 {
            let effort = pid.command(&mut state, [1.0, 0.0, 0.0], 0.01, limit);
            assert!((effort - 1.0).abs() < 1e-15);
        }
        // without an error there is almost no effort: the integral did not grow
        assert!(pid.command(&mut state, [0.0; 3], 0.01, limit).abs() < 0.1);
    }
}
