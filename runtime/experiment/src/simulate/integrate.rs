//! Integration with step control: a method of order four for equations of second order where it is
//! accurate enough, and an embedded Runge-Kutta pair elsewhere.
//!
//! - Nyström's method of order four for `q'' = f(t, q, q')` (Über die numerische Integration von
//!   Differentialgleichungen, 1925). Its second and third stage have the same positions, so that a
//!   step needs what depends on positions alone at three places. The derivative at its end is the
//!   first of the next step, and gives the error estimate: a tenth of the step times its
//!   difference from that of the last stage, which is the difference of the rates from a method of
//!   order three (Balac and Mahé, Embedded Runge-Kutta scheme for step-size control in the
//!   interaction picture method, 2013).
//! - The pair of orders 5 and 4 by Dormand and Prince (A family of embedded Runge-Kutta formulae,
//!   1980), whose last stage is the first of the next step.

/// Why an integration stopped before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop<E> {
    /// The step that the error estimate requires is too short.
    StepTooSmall,
    /// The derivative could not be computed at the start, or with any step.
    Refused(E),
}

/// The state of an integration.
#[derive(Clone, Debug)]
pub(super) struct Integrator {
    /// Time, s.
    pub(super) t: f64,
    /// The state vector: positions, as many velocities in the same order, and other entries.
    pub(super) y: Vec<f64>,
    /// The number of positions.
    positions: usize,
    /// The next step that the last error estimate of the pair suggests, s.
    step: f64,
    /// The relative tolerance of each step.
    relative: f64,
    /// The absolute tolerance of each entry of `y`.
    absolute: Vec<f64>,
    /// The number of steps, refused ones included.
    pub(super) steps: usize,
    /// The number of calls of `advance` that use only the pair before Nyström's method is tried again,
    /// and how many that will be after it fails again.
    wait: usize,
    next_wait: usize,
    /// The derivatives of the stages.
    k: Vec<Vec<f64>>,
    trial: Vec<f64>,
}

/// The part of the tolerance within which the error estimate of Nyström's method must be: the pair's
/// local errors are mostly far below its estimate, and the error over a run should not grow.
const NYSTROM_PART: f64 = 0.1;
/// The largest number of calls of `advance` between two trials of Nyström's method.
const LONGEST_WAIT: usize = 64;
/// The times of the pair's stages, relative to the step.
const C: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
/// The coefficients of the stages; the last row are the weights of the fifth order.
#[rustfmt::skip]
const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// The weights of the fifth order minus those of the fourth, for the error estimate.
const ERROR: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];
/// The same for Nyström's method, in which the fifth derivative is that of the next step.
const NYSTROM_ERROR: [f64; 5] = [0.0, 0.0, 0.0, 0.1, -0.1];

impl Integrator {
    /// Starts from the state `y` at time 0.
    ///
    /// - `positions`: the number of entries of `y` that are positions; as many velocities follow
    ///   them;
    /// - `relative`: the relative tolerance;
    /// - `scales`: the size of each entry of `y` below which its tolerance is absolute, `scales`
    ///   times `relative`.
    pub(super) fn new(y: Vec<f64>, positions: usize, relative: f64, scales: &[f64]) -> Self {
        let n = y.len();
        Self {
            t: 0.0,
            y,
            positions,
            step: 1e-4,
            relative,
            absolute: scales.iter().map(|s| s * relative).collect(),
            steps: 0,
            wait: 0,
            next_wait: 1,
            k: vec![vec![0.0; n]; 7],
            trial: vec![0.0; n],
        }
    }

    /// Integrates up to exactly the time `end`. If the derivative `rhs` refuses a trial state, the
    /// step is reduced to a quarter, until it is too short.
    ///
    /// One step of Nyström's method is tried first. Where its error is too large, the pair goes the
    /// whole way, and so it does for the next 1, 2, 4, ... 64 calls.
    pub(super) fn advance<E>(
        &mut self,
        end: f64,
        mut rhs: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), Stop<E>> {
        rhs(self.t, &self.y, &mut self.k[0]).map_err(Stop::Refused)?;
        if self.wait > 0 {
            self.wait -= 1;
        } else if self.t < end {
            if self.nystrom(end, &mut rhs) {
                self.next_wait = 1;
                return Ok(());
            }
            self.wait = self.next_wait;
            self.next_wait = LONGEST_WAIT.min(2 * self.next_wait);
        }
        self.pair(end, rhs)
    }

    /// One step of Nyström's method up to `end`; false where its error is too large or the derivative
    /// is refused. `k[0]` is the derivative at the start.
    fn nystrom<E>(
        &mut self,
        end: f64,
        rhs: &mut impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
    ) -> bool {
        let (h, n) = (end - self.t, self.positions);
        self.steps += 1;
        for stage in 1..5 {
            let (known, rest) = self.k.split_at_mut(stage);
            let Some(out) = rest.first_mut() else { break };
            let (part, time) = match stage {
                1 | 2 => (0.5 * h, self.t + 0.5 * h),
                _ => (h, end),
            };
            for i in 0..self.y.len() {
                // the mean rate of the entry from the start to the stage
                let rate = if i < n {
                    let (velocity, at) = (self.y[n + i], n + i);
                    match stage {
                        1 | 2 => velocity + 0.25 * h * known[0][at],
                        3 => velocity + 0.5 * h * known[2][at],
                        _ => velocity + h / 6.0 * (known[0][at] + known[1][at] + known[2][at]),
                    }
                } else if stage < 4 {
                    known[stage - 1][i]
                } else {
                    let inner = known[1][i] + known[2][i];
                    (known[0][i] + 2.0 * inner + known[3][i]) / 6.0
                };
                self.trial[i] = self.y[i] + part * rate;
            }
            if rhs(time, &self.trial, out).is_err() {
                return false;
            }
        }
        // false for NaN
        let accepted = self.error(h, &NYSTROM_ERROR) <= NYSTROM_PART;
        if accepted {
            self.t = end;
            self.y.copy_from_slice(&self.trial);
        }
        accepted
    }

    /// Integrates up to `end` by the pair; `k[0]` is the derivative at the start.
    fn pair<E>(
        &mut self,
        end: f64,
        mut rhs: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), Stop<E>> {
        let n = self.y.len();
        while self.t < end {
            let left = end - self.t;
            let last = self.step >= left;
            let h = if last { left } else { self.step };
            self.steps += 1;
            let mut refused = None;
            for stage in 1..7 {
                for i in 0..n {
                    let sum: f64 = (0..stage).map(|s| A[stage][s] * self.k[s][i]).sum();
                    self.trial[i] = self.y[i] + h * sum;
                }
                let (_, rest) = self.k.split_at_mut(stage);
                let Some(out) = rest.first_mut() else { break };
                if let Err(e) = rhs(self.t + C[stage] * h, &self.trial, out) {
                    refused = Some(e);
                    break;
                }
            }
            let error = if refused.is_some() {
                f64::INFINITY
            } else {
                self.error(h, &ERROR)
            };
            // false for NaN
            let accepted = error <= 1.0;
            if accepted {
                self.t = if last { end } else { self.t + h };
                self.y.copy_from_slice(&self.trial);
                self.k.swap(0, 6);
            }
            let factor = if error.is_finite() {
                (0.9 * libm::pow(error.max(1e-10), -0.2)).clamp(0.2, 5.0)
            } else {
                0.25
            };
            // a step that was shortened only to end at `end` does not shorten the next
            if !(accepted && last) || factor < 1.0 {
                self.step = h * factor;
            }
            if !accepted && self.step < 1e-12 * (1.0 + self.t) {
                return Err(refused.map_or(Stop::StepTooSmall, Stop::Refused));
            }
        }
        Ok(())
    }

    /// The largest error estimate of any entry, relative to its tolerance; `weights` of the stages.
    fn error(&self, h: f64, weights: &[f64]) -> f64 {
        let mut worst: f64 = 0.0;
        for i in 0..self.y.len() {
            let stages = weights.iter().zip(&self.k);
            let error: f64 = stages.map(|(weight, k)| weight * k[i]).sum();
            let size = self.y[i].abs().max(self.trial[i].abs());
            let ratio = (h * error).abs() / (self.absolute[i] + self.relative * size);
            if ratio.is_nan() {
                return f64::NAN;
            }
            worst = worst.max(ratio);
        }
        worst
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y'' = -y, as positions and velocities.
    #[allow(
        clippy::unnecessary_wraps,
        reason = "the integrator takes functions that may fail"
    )]
    fn oscillator(_: f64, y: &[f64], dy: &mut [f64]) -> Result<(), ()> {
        dy.copy_from_slice(&[y[1], -y[0]]);
        Ok(())
    }

    #[test]
    fn an_oscillator_returns_after_its_period() {
        let mut integrator = Integrator::new(vec![1.0, 0.0], 1, 1e-11, &[1.0, 1.0]);
        integrator
            .advance(std::f64::consts::TAU, oscillator)
            .unwrap();
        // the accumulated error of all steps
        assert!((integrator.y[0] - 1.0).abs() < 1e-9);
        assert!(integrator.y[1].abs() < 1e-9);
    }

    /// Steps of a fixed length, as periods of a controller are: half the length has a sixteenth of the
    /// error, also where the acceleration depends on the velocity.
    #[test]
    fn short_periods_take_one_step_of_order_four_each() {
        let damped = |_: f64, y: &[f64], dy: &mut [f64]| {
            dy.copy_from_slice(&[y[1], -y[0] - 0.4 * y[1] * y[1] * y[1], y[0] * y[1]]);
            Ok::<(), ()>(())
        };
        let run = |periods: u32| {
            let start = vec![1.0, 0.5, 0.0];
            let mut integrator = Integrator::new(start, 1, 1e-3, &[1.0; 3]);
            for k in 1..=periods {
                integrator
                    .advance(f64::from(k) / f64::from(periods), damped)
                    .unwrap();
            }
            assert_eq!(integrator.steps, periods as usize);
            integrator.y
        };
        let (coarse, fine, exact) = (run(20), run(40), run(640));
        for ((coarse, fine), exact) in coarse.iter().zip(&fine).zip(&exact) {
            let ratio = (coarse - exact) / (fine - exact);
            assert!((13.0..20.0).contains(&ratio), "{ratio}");
        }
    }

    /// Where one step is not accurate enough, the pair takes several.
    #[test]
    fn a_long_period_is_divided() {
        let mut integrator = Integrator::new(vec![1.0, 0.0], 1, 1e-9, &[1.0, 1.0]);
        for k in 1..=100 {
            integrator.advance(f64::from(k), oscillator).unwrap();
        }
        assert!(integrator.steps > 1000);
        assert!((integrator.y[0] - libm::cos(100.0)).abs() < 1e-6);
    }

    #[test]
    fn a_wall_is_reported_as_refused_and_never_crossed() {
        let mut integrator = Integrator::new(vec![0.0], 0, 1e-8, &[1.0]);
        let stopped = integrator.advance(1.0, |_, y, dy| {
            dy[0] = 1.0;
            if y[0] > 0.5 { Err("wall") } else { Ok(()) }
        });
        assert_eq!(stopped, Err(Stop::Refused("wall")));
        assert!(integrator.y[0] <= 0.5 && integrator.y[0] > 0.49);
    }
}
