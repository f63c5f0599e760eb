//! Controllers of actuated joints, such as PID position control, and the drives that carry out
//! their commands.

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
            let offset = self.offset.get(k).copied().unwrap_or(0.0);
            let drive = self.drives.get(k).copied().unwrap_or_default();
            // the limits of the effort that the PID controller adds to the offset
            let limit = drive.limit.map(|l| l.map(|bound| bound - offset));
            let effort = offset + pid.command(state, error, now.period, limit);
            let is_lost = error.abs() > LOST_DISTANCE;
            efforts[k] = if is_lost { f64::NAN } else { effort };
        }
    }
}

/// The state of a PID controller between samples: the integral of the error and the last error.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PidState {
    integral: f64,
    last: Option<f64>,
}

impl Pid {
    /// The effort for this sample's position error, N or N m. The derivative of the error is its
    /// difference over the period; the integral is not updated while the drive is saturated in the
    /// direction of the error.
    pub(super) fn command(
        self,
        state: &mut PidState,
        error: f64,
        period: f64,
        limit: Option<[f64; 2]>,
    ) -> f64 {
        let rate = state.last.map_or(0.0, |last| (error - last) / period);
        state.last = Some(error);
        let grown = state.integral + error * period;
        let effort_with = |integral: f64| self.kp * error + self.ki * integral + self.kd * rate;
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
            kd: 0.0,
        };
        let limit = Some([-1.0, 1.0]);
        let mut state = PidState::default();
        for _ in 0..1000 {
            let effort = pid.command(&mut state, 1.0, 0.01, limit);
            assert!((effort - 1.0).abs() < 1e-15);
        }
        // without an error there is almost no effort: the integral did not grow
        assert!(pid.command(&mut state, 0.0, 0.01, limit).abs() < 0.1);
    }
}
