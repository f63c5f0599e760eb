//! Controllers of actuated joints, PID position control among them, and the drives that carry
//! out what they command.

/// A PID controller's gains at one joint: effort per position, per integral, per velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pid {
    /// Proportional, N/m or N m/rad.
    pub kp: f64,
    /// Integral, per s.
    pub ki: f64,
    /// Derivative, times s.
    pub kd: f64,
}

/// A drive: how it follows what the controller commands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drive {
    /// The time constant of its first-order lag, s; 0 follows at once.
    pub lag: f64,
    /// The least and greatest effort, N or N m.
    pub limit: Option<[f64; 2]>,
}

/// What a controller is given at each sample.
#[derive(Clone, Copy, Debug)]
pub struct ControllerInput<'a> {
    /// The time, s.
    pub t: f64,
    /// The time between samples, s.
    pub period: f64,
    /// The reference: all coordinates, closed (n).
    pub q: &'a [f64],
    /// The reference's independent positions, rad or m (dof).
    pub q_i: &'a [f64],
    /// The reference's independent velocities (dof).
    pub qd_i: &'a [f64],
    /// The reference's independent accelerations (dof).
    pub qdd_i: &'a [f64],
    /// The positions of the actuated joints as measured, in the order of `Info::actuated`.
    pub measured: &'a [f64],
}

/// What decides on the efforts of the actuated joints, once a period.
pub trait Controller {
    /// Fills the efforts of the actuated joints, N or N m, in the order of `Info::actuated`. The
    /// drives carry them out, within their limits.
    fn efforts(&mut self, now: &ControllerInput<'_>, efforts: &mut [f64]);
}

impl<F: FnMut(&ControllerInput<'_>, &mut [f64])> Controller for F {
    fn efforts(&mut self, now: &ControllerInput<'_>, efforts: &mut [f64]) {
        self(now, efforts);
    }
}

/// A PID controller for each actuated joint, with constant efforts under them.
#[derive(Clone, Debug)]
pub(super) struct Bank<'a> {
    pub(super) pid: &'a [Pid],
    pub(super) offset: &'a [f64],
    pub(super) drives: &'a [Drive],
    /// The coordinates of the actuated joints.
    pub(super) joints: &'a [usize],
    memories: Vec<Memory>,
}

impl<'a> Bank<'a> {
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
            memories: vec![Memory::default(); joints.len()],
        }
    }
}

impl Controller for Bank<'_> {
    fn efforts(&mut self, now: &ControllerInput<'_>, efforts: &mut [f64]) {
        let loops = self.joints.iter().zip(self.pid).zip(&mut self.memories);
        for (k, ((joint, pid), memory)) in loops.enumerate() {
            let error = now.q[*joint] - now.measured[k];
            let offset = self.offset.get(k).copied().unwrap_or(0.0);
            let drive = self.drives.get(k).copied().unwrap_or_default();
            // what is left for the controller
            let limit = drive.limit.map(|l| l.map(|bound| bound - offset));
            efforts[k] = offset + pid.command(memory, error, now.period, limit);
        }
    }
}

/// A controller's memory between samples.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    integral: f64,
    last: Option<f64>,
}

impl Pid {
    /// The effort for this sample's position error. The derivative is the difference of
    /// errors; the integral stands still while the drive is saturated in its direction.
    pub(super) fn command(
        self,
        memory: &mut Memory,
        error: f64,
        period: f64,
        limit: Option<[f64; 2]>,
    ) -> f64 {
        let rate = memory.last.map_or(0.0, |last| (error - last) / period);
        memory.last = Some(error);
        let grown = memory.integral + error * period;
        let wish = |integral: f64| self.kp * error + self.ki * integral + self.kd * rate;
        let Some([lo, hi]) = limit else {
            memory.integral = grown;
            return wish(grown);
        };
        let effort = wish(grown);
        if (effort > hi && error > 0.0) || (effort < lo && error < 0.0) {
            return wish(memory.integral).max(lo).min(hi);
        }
        memory.integral = grown;
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
        let mut memory = Memory::default();
        for _ in 0..1000 {
            let effort = pid.command(&mut memory, 1.0, 0.01, limit);
            assert!((effort - 1.0).abs() < 1e-15);
        }
        // as soon as the error is gone, so is the effort
        assert!(pid.command(&mut memory, 0.0, 0.01, limit).abs() < 0.1);
    }
}
