//! PID position control of actuated joints, and the drives that carry it out.

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
