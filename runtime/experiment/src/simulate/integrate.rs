//! An embedded Runge-Kutta method with step control.
//!
//! The pair of orders 5 and 4 by Dormand and Prince (A family of embedded Runge-Kutta
//! formulae, 1980), whose last stage is the first of the next step.

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
    /// The state vector.
    pub(super) y: Vec<f64>,
    /// The next step that the last error estimate suggests, s.
    step: f64,
    /// The relative tolerance of each step.
    relative: f64,
    /// The absolute tolerance of each entry of `y`.
    absolute: Vec<f64>,
    /// The number of steps, refused ones included.
    pub(super) steps: usize,
}

/// The times of the stages, relative to the step.
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

impl Integrator {
    /// Starts from the state `y` at time 0. `relative`: the relative tolerance; `scales`: the size
    /// of each entry of `y` below which its tolerance is absolute, `scales` times `relative`.
    pub(super) fn new(y: Vec<f64>, relative: f64, scales: &[f64]) -> Self {
        Self {
            t: 0.0,
            y,
            step: 1e-4,
            relative,
            absolute: scales.iter().map(|s| s * relative).collect(),
            steps: 0,
        }
    }

    /// Integrates up to exactly the time `end`. If the derivative `rhs` refuses a trial state, the
    /// step is reduced to a quarter, until it is too short.
    pub(super) fn advance<E>(
        &mut self,
        end: f64,
        mut rhs: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
    ) -> Result<(), Stop<E>> {
        let n = self.y.len();
        let mut k = vec![vec![0.0; n]; 7];
        rhs(self.t, &self.y, &mut k[0]).map_err(Stop::Refused)?;
        let mut trial = vec![0.0; n];
        while self.t < end {
            let left = end - self.t;
            let last = self.step >= left;
            let h = if last { left } else { self.step };
            self.steps += 1;
            let mut refused = None;
            for stage in 1..7 {
                for i in 0..n {
                    let sum: f64 = (0..stage).map(|s| A[stage][s] * k[s][i]).sum();
                    trial[i] = self.y[i] + h * sum;
                }
                let (_, rest) = k.split_at_mut(stage);
                let Some(out) = rest.first_mut() else { break };
                if let Err(e) = rhs(self.t + C[stage] * h, &trial, out) {
                    refused = Some(e);
                    break;
                }
            }
            let error = if refused.is_some() {
                f64::INFINITY
            } else {
                self.error(h, &k, &trial)
            };
            // false for NaN
            let accepted = error <= 1.0;
            if accepted {
                self.t = if last { end } else { self.t + h };
                self.y.copy_from_slice(&trial);
                k.swap(0, 6);
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

    /// The largest error estimate of any entry, relative to its tolerance.
    fn error(&self, h: f64, k: &[Vec<f64>], trial: &[f64]) -> f64 {
        let mut worst: f64 = 0.0;
        for i in 0..self.y.len() {
            let error: f64 = (0..7).map(|s| ERROR[s] * k[s][i]).sum();
            let size = self.y[i].abs().max(trial[i].abs());
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

    #[test]
    fn an_oscillator_returns_after_its_period() {
        let mut integrator = Integrator::new(vec![1.0, 0.0], 1e-11, &[1.0, 1.0]);
        integrator
            .advance(std::f64::consts::TAU, |_, y, dy| {
                dy.copy_from_slice(&[y[1], -y[0]]);
                Ok::<(), ()>(())
            })
            .unwrap();
        // the accumulated error of all steps
        assert!((integrator.y[0] - 1.0).abs() < 1e-9);
        assert!(integrator.y[1].abs() < 1e-9);
    }

    #[test]
    fn a_wall_is_reported_as_refused_and_never_crossed() {
        let mut integrator = Integrator::new(vec![0.0], 1e-8, &[1.0]);
        let stopped = integrator.advance(1.0, |_, y, dy| {
            dy[0] = 1.0;
            if y[0] > 0.5 { Err("wall") } else { Ok(()) }
        });
        assert_eq!(stopped, Err(Stop::Refused("wall")));
        assert!(integrator.y[0] <= 0.5 && integrator.y[0] > 0.49);
    }
}
