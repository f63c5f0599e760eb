//! The setup of a fit: the controllers and signals of an experiment, with known and estimated
//! values.

/// A number that is known, or estimated from a first value.
///
/// ```
/// use regen_response::Value;
///
/// let kp = Value::estimated(40.0);
/// assert!(kp.is_estimated() && !Value::known(2.0).is_estimated());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Value {
    /// The value, or the value from which the estimate starts.
    pub value: f64,
    estimated: bool,
}

impl Value {
    /// A known value.
    pub fn known(value: f64) -> Self {
        Self {
            value,
            estimated: false,
        }
    }

    /// A value to be estimated, with the value from which the search starts.
    pub fn estimated(start: f64) -> Self {
        Self {
            value: start,
            estimated: true,
        }
    }

    /// Whether the value is estimated.
    pub fn is_estimated(self) -> bool {
        self.estimated
    }
}

pub use regen_experiment::simulate::Damping;

/// When a controller changes its effort.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Action {
    /// At the samples of the log; between them the effort is constant (zero-order hold).
    #[default]
    Sampled,
    /// Continuously, as controllers much faster than the log and the actuators of physics engines
    /// do; commands are constant between samples.
    Continuous,
}

/// The controller of one actuated joint: `offset + kp e + ki integral(e) + kd rate` with the
/// position error `e`, command minus position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// The proportional gain, N m/rad or N/m.
    pub kp: Value,
    /// The integral gain, N m/(rad s) or N/(m s).
    pub ki: Value,
    /// The derivative gain, N m s/rad or N s/m.
    pub kd: Value,
    /// A constant effort, N m or N.
    pub offset: Value,
    /// The gain of the integral of the velocity from the first sample on, which acts against it, N m/rad or
    /// N/m: of cascades whose inner loop of velocity integrates.
    pub ki_velocity: f64,
    /// What the derivative gain multiplies.
    pub damping: Damping,
    /// The least and the greatest effort, N m or N; `None` without limits.
    pub limit: Option<[f64; 2]>,
    /// The number of rows from a measurement until the effort that is computed from it acts, of controllers
    /// that act at the samples.
    pub late: usize,
    /// The number of rows by which the velocity is late that the derivative gain multiplies, of controllers
    /// that act at the samples; between two rows it changes evenly.
    pub velocity_late: f64,
}

impl Law {
    /// The names of the gains in labels and files, in the order of [`gains`](Self::gains).
    pub const NAMES: [&'static str; 4] = ["kp", "ki", "kd", "offset"];

    /// A proportional-derivative controller with known gains, on the rate of the error, without
    /// limits.
    ///
    /// ```
    /// use regen_response::{Damping, Law};
    ///
    /// let law = Law::pd(40.0, 2.0);
    /// assert_eq!((law.kp.value, law.ki.value, law.damping), (40.0, 0.0, Damping::OfError));
    /// ```
    pub fn pd(kp: f64, kd: f64) -> Self {
        Self {
            kp: Value::known(kp),
            ki: Value::known(0.0),
            kd: Value::known(kd),
            offset: Value::known(0.0),
            ki_velocity: 0.0,
            damping: Damping::OfError,
            limit: None,
            late: 0,
            velocity_late: 0.0,
        }
    }

    /// The values in the order of [`NAMES`](Self::NAMES).
    pub fn gains(&self) -> [Value; 4] {
        [self.kp, self.ki, self.kd, self.offset]
    }

    /// Whether the integral gain is nonzero or estimated.
    pub(crate) fn integrates(&self) -> bool {
        self.ki.value != 0.0 || self.ki.is_estimated()
    }
}

/// How the logged value of a signal follows from the true one: `gain x(t - delay) + bias`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalModel {
    /// The time from a motion to the row that logs it, s; for a command, from its row to the time at
    /// which it takes effect.
    pub delay: Value,
    /// The factor.
    pub gain: Value,
    /// The bias, in the unit of the signal.
    pub bias: Value,
}

impl SignalModel {
    /// The names of the values in labels, in the order of [`values`](Self::values).
    pub const NAMES: [&'static str; 3] = ["delay", "gain", "bias"];

    /// The values in the order of [`NAMES`](Self::NAMES).
    pub fn values(&self) -> [Value; 3] {
        [self.delay, self.gain, self.bias]
    }
}

impl Default for SignalModel {
    /// A signal that is logged as it is: no delay, gain 1, no bias.
    fn default() -> Self {
        Self {
            delay: Value::known(0.0),
            gain: Value::known(1.0),
            bias: Value::known(0.0),
        }
    }
}

/// The quantity that a signal measures or commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SignalKind {
    /// The measured position of a coordinate, by its index.
    Position(usize),
    /// The measured velocity of a coordinate.
    Velocity(usize),
    /// The command of an actuated coordinate.
    Command(usize),
}

/// The settings of a fit to responses.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The controllers, in the order of `Info::actuated`.
    pub laws: Vec<Law>,
    /// Whether the controllers act at the samples or continuously.
    pub action: Action,
    /// The models of signals that are not logged as they are.
    pub signals: Vec<(SignalKind, SignalModel)>,
    /// The length of a window, s; the last window of a run may be up to half as long again.
    pub window: f64,
    /// The width w of the smooth sign `tanh(v / w)` that Coulomb friction of joints has, rad/s or m/s;
    /// that of a drive is the velocity at which its joints reach w.
    pub friction_width: f64,
    /// The greatest delay of a measured signal that the search tries, s. Where a delay is
    /// estimated, rows within this time of the ends of a window are left out.
    pub greatest_delay: f64,
    /// The largest number of steps of the search.
    pub steps: usize,
    /// The number of threads; 0: as many as the machine has.
    pub threads: usize,
}

impl Setup {
    /// The default settings for these controllers: they act at the samples, signals are logged as
    /// they are, windows of 1 s, friction that changes its direction within 1 mm/s or mrad/s.
    pub fn new(laws: Vec<Law>) -> Self {
        Self {
            laws,
            action: Action::default(),
            signals: Vec::new(),
            window: 1.0,
            friction_width: 1e-3,
            greatest_delay: 0.02,
            steps: 60,
            threads: 0,
        }
    }

    /// The model of a signal; the default model if the setup names none.
    pub fn signal(&self, kind: SignalKind) -> SignalModel {
        let own = self.signals.iter().find(|(k, _)| *k == kind);
        own.map_or_else(SignalModel::default, |(_, model)| *model)
    }
}

/// A run of a robot under position control: what was commanded and what was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// The times of the rows, s, ascending.
    pub times: Vec<f64>,
    /// The commanded positions of all actuated joints, rad or m, in the order of `Info::actuated`;
    /// one list for each joint.
    pub commands: Vec<Vec<f64>>,
    /// Measured positions by coordinate, rad or m.
    pub positions: Vec<(usize, Vec<f64>)>,
    /// Measured velocities by coordinate, rad/s or m/s.
    pub velocities: Vec<(usize, Vec<f64>)>,
}

impl Run {
    /// Cuts the rows into windows of about this length, s: ranges of rows of at least `least` rows.
    pub(crate) fn windows(&self, length: f64, least: usize) -> Vec<core::ops::Range<usize>> {
        let mut out: Vec<core::ops::Range<usize>> = Vec::new();
        let mut start = 0;
        for k in 0..self.times.len() {
            // a window ends with the row from which the next one starts
            if self.times[k] - self.times[start] >= length * (1.0 - 1e-9) && k + 1 > start + least {
                out.push(start..k + 1);
                start = k;
            }
        }
        let rest = start..self.times.len();
        match out.last_mut() {
            Some(last)
                if self.times.last().is_none_or(|end| {
                    end - self.times[start] < 0.5 * length || rest.len() < least
                }) =>
            {
                last.end = rest.end;
            }
            _ if rest.len() >= least => out.push(rest),
            _ => {}
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_cover_the_run_and_the_last_takes_a_short_rest() {
        let run = Run {
            times: (0..=230).map(|k| 0.01 * f64::from(k)).collect(),
            ..Run::default()
        };
        let windows = run.windows(1.0, 5);
        assert_eq!(windows, [0..101, 100..231]);
        assert_eq!(run.windows(0.7, 5).last(), Some(&(210 - 70..231)));
        assert_eq!(run.windows(100.0, 5).first(), Some(&(0..231)));
        assert!(run.windows(1.0, 500).is_empty());
    }

    #[test]
    fn a_controller_integrates_where_its_integral_gain_is_or_may_become_nonzero() {
        let with = |ki: Value| Law {
            ki,
            ..Law::pd(40.0, 2.0)
        };
        assert!(with(Value::known(3.0)).integrates());
        assert!(with(Value::estimated(3.0)).integrates());
        assert!(with(Value::estimated(0.0)).integrates());
        assert!(!with(Value::known(0.0)).integrates());
    }
}
