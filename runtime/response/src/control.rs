//! The controllers of a window, with the derivatives of their efforts.

use std::collections::VecDeque;

use crate::parameters::Entry;
use crate::plant::Posture;
use crate::setup::{Action, Damping, Law};

/// A number with its derivatives by all unknowns of a window.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Sensitive {
    pub(crate) value: f64,
    pub(crate) rates: Vec<f64>,
}

impl Sensitive {
    pub(crate) fn constant(value: f64, unknowns: usize) -> Self {
        Self {
            value,
            rates: vec![0.0; unknowns],
        }
    }

    /// Adds `factor` times another number.
    pub(crate) fn add(&mut self, other: &Self, factor: f64) {
        self.value += factor * other.value;
        for (sum, x) in self.rates.iter_mut().zip(&other.rates) {
            *sum += factor * x;
        }
    }

    /// Adds the product of a parameter and a number.
    fn add_product(&mut self, gain: Entry, other: &Self, offset: usize) {
        self.add(other, gain.value);
        if let Some(slot) = gain.column.and_then(|c| self.rates.get_mut(offset + c)) {
            *slot += other.value;
        }
    }
}

/// The controller of one joint in a window.
#[derive(Clone, Debug)]
pub(crate) struct Controller {
    pub(crate) coordinate: usize,
    law: Law,
    /// kp, ki, kd and the offset.
    gains: [Entry; 4],
    /// The number of the window's own unknowns, which come before those that all windows share.
    offset: usize,
    /// The error at the last sample; `None` before the first.
    last: Option<Sensitive>,
    pub(crate) integral: Sensitive,
    /// The command at the last sample, its rate, and the effort that is held.
    command: Sensitive,
    command_rate: f64,
    pub(crate) effort: Sensitive,
    /// The position at the first sample.
    origin: Option<Sensitive>,
    /// Efforts that are computed and do not act yet.
    waiting: VecDeque<Sensitive>,
    /// The velocities of the last samples, the last one first.
    velocities: VecDeque<Sensitive>,
}

impl Controller {
    pub(crate) fn new(
        coordinate: usize,
        law: Law,
        gains: [Entry; 4],
        offset: usize,
        unknowns: usize,
    ) -> Self {
        let zero = Sensitive::constant(0.0, unknowns);
        Self {
            coordinate,
            law,
            gains,
            offset,
            last: None,
            integral: zero.clone(),
            command: zero.clone(),
            command_rate: 0.0,
            effort: zero,
            origin: None,
            waiting: VecDeque::new(),
            velocities: VecDeque::new(),
        }
    }

    /// Computes at a sample the effort that is held until the next one.
    ///
    /// - `command`: with its derivatives; `before`: the command one sample earlier, if any;
    /// - `step`: the time between samples, s; `[position, velocity]` of the joint.
    pub(crate) fn sample(
        &mut self,
        command: Sensitive,
        before: Option<&Sensitive>,
        step: f64,
        [position, velocity]: [&Sensitive; 2],
    ) {
        self.origin.get_or_insert_with(|| position.clone());
        let held_back = self.held_back(position);
        let mut error = command.clone();
        error.add(position, -1.0);
        self.command_rate = before.map_or(0.0, |b| (command.value - b.value) / step);
        let mut rate = Sensitive::constant(0.0, error.rates.len());
        match self.law.damping {
            Damping::OfVelocity => rate.add(&self.late_velocity(velocity), -1.0),
            Damping::OfError => {
                let earlier = self.last.take().or_else(|| {
                    // at the start of a window, the joint's previous position is extrapolated from
                    // its velocity
                    let mut earlier = before?.clone();
                    earlier.add(position, -1.0);
                    earlier.add(velocity, step);
                    Some(earlier)
                });
                if let Some(earlier) = earlier {
                    rate.add(&error, 1.0 / step);
                    rate.add(&earlier, -1.0 / step);
                }
            }
        }
        if self.waiting.is_empty() {
            self.wait(&error, velocity, step, before.is_some());
        }
        let mut grown = self.integral.clone();
        grown.add(&error, step);
        let mut effort = self.combined(&error, &grown, &rate);
        effort.add(&held_back, -1.0);
        let computed = match self.law.limit {
            Some([lo, hi]) if effort.value > hi || effort.value < lo => {
                // an integral does not wind up while the drive is saturated in its direction
                let bound = if effort.value > hi { hi } else { lo };
                let winds = (effort.value > hi) == (error.value > 0.0);
                if winds {
                    let mut held = self.combined(&error, &self.integral, &rate);
                    held.add(&held_back, -1.0);
                    clamped(held, [lo, hi])
                } else {
                    self.integral = grown;
                    Sensitive::constant(bound, effort.rates.len())
                }
            }
            _ => {
                self.integral = grown;
                effort
            }
        };
        self.waiting.push_back(computed);
        self.effort = self.waiting.pop_front().unwrap_or_default();
        self.last = Some(error);
        self.command = command;
    }

    /// The velocity that the derivative gain multiplies; before the first sample it was constant.
    fn late_velocity(&mut self, velocity: &Sensitive) -> Sensitive {
        let late = self.law.velocity_late;
        if late <= 0.0 {
            return velocity.clone();
        }
        self.velocities.push_front(velocity.clone());
        #[allow(clippy::cast_sign_loss, reason = "above 0")]
        let whole = late.floor() as usize;
        let part = late - whole as f64;
        let mut out = Sensitive::constant(0.0, velocity.rates.len());
        for (k, weight) in [(whole, 1.0 - part), (whole + 1, part)] {
            let own = self.velocities.get(k).or_else(|| self.velocities.back());
            if let Some(own) = own {
                out.add(own, weight);
            }
        }
        self.velocities.truncate(whole + 2);
        out
    }

    /// Computes the efforts that act until the one of the first sample does: before it the joint and the
    /// command moved evenly.
    fn wait(&mut self, error: &Sensitive, velocity: &Sensitive, step: f64, has_rate: bool) {
        let mut rate = Sensitive::constant(0.0, error.rates.len());
        let is_of_velocity = self.law.damping == Damping::OfVelocity;
        if is_of_velocity || has_rate {
            rate.add(velocity, -1.0);
        }
        if !is_of_velocity {
            rate.value += self.command_rate;
        }
        for k in (1..=self.law.late).rev() {
            let before = k as f64 * step;
            let mut earlier = error.clone();
            earlier.add(velocity, before);
            earlier.value -= before * self.command_rate;
            let mut effort = self.combined(&earlier, &self.integral, &rate);
            effort.add(velocity, self.law.ki_velocity * before);
            let held = self.law.limit.map(|limit| clamped(effort.clone(), limit));
            self.waiting.push_back(held.unwrap_or(effort));
        }
    }

    /// The effort between samples.
    pub(crate) fn between(
        &self,
        action: Action,
        posture: &Posture,
        rates: &dyn Fn(usize) -> [Vec<f64>; 2],
    ) -> Sensitive {
        if action == Action::Sampled {
            return self.effort.clone();
        }
        let [by_position, by_velocity] = rates(self.coordinate);
        let position = Sensitive {
            value: posture.q[self.coordinate],
            rates: by_position,
        };
        let velocity = Sensitive {
            value: posture.qd[self.coordinate],
            rates: by_velocity,
        };
        let mut error = self.command.clone();
        error.add(&position, -1.0);
        let mut rate = Sensitive::constant(0.0, error.rates.len());
        rate.add(&velocity, -1.0);
        if self.law.damping == Damping::OfError {
            rate.value += self.command_rate;
        }
        let mut effort = self.combined(&error, &self.integral, &rate);
        effort.add(&self.held_back(&position), -1.0);
        match self.law.limit {
            Some(limit) => clamped(effort, limit),
            None => effort,
        }
    }

    /// The effort of the integral of the velocity: the distance from the position of the first sample times
    /// its gain.
    fn held_back(&self, position: &Sensitive) -> Sensitive {
        let mut out = Sensitive::constant(0.0, position.rates.len());
        if let (true, Some(origin)) = (self.law.ki_velocity != 0.0, &self.origin) {
            out.add(position, self.law.ki_velocity);
            out.add(origin, -self.law.ki_velocity);
        }
        out
    }

    fn combined(&self, error: &Sensitive, integral: &Sensitive, rate: &Sensitive) -> Sensitive {
        let one = Sensitive::constant(1.0, error.rates.len());
        let mut effort = Sensitive::constant(0.0, error.rates.len());
        let parts = [error, integral, rate, &one];
        for (gain, part) in self.gains.iter().zip(parts) {
            effort.add_product(*gain, part, self.offset);
        }
        effort
    }

    /// The stiffness and the damping that the controller adds between samples.
    pub(crate) fn stiffness(&self, action: Action) -> [f64; 2] {
        if action == Action::Sampled {
            return [0.0; 2];
        }
        [
            self.gains[0].value.abs() + self.law.ki_velocity.abs(),
            self.gains[2].value.abs(),
        ]
    }
}

/// An effort within its limits; beyond them its derivatives are 0.
fn clamped(effort: Sensitive, [lo, hi]: [f64; 2]) -> Sensitive {
    let bound = if effort.value > hi {
        hi
    } else if effort.value < lo {
        lo
    } else {
        return effort;
    };
    Sensitive::constant(bound, effort.rates.len())
}
