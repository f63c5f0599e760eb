//! What watches a five-bar from cycle to cycle: the force of what touches it, and its base
//! parameters as they drift.

use regen_control::{
    Estimator, Forgetting, Observer, Outcome, Sample, SettingError, Settings, closure,
};
use regen_generated::fivebar::{self, Fivebar};

/// Numbers of cranks, of parameters and of base parameters.
const CRANKS: usize = fivebar::INDEPENDENT.len();
const PARAMETERS: usize = fivebar::PARAMETERS.len();
const BASE: usize = fivebar::BASE.len();

/// Columns of all parameters.
type Columns = [[f32; CRANKS]; PARAMETERS];

/// The watch with its memory.
#[derive(Debug)]
pub struct Watch {
    closure: closure!(fivebar::Fivebar, f32),
    observer: Observer<f32, CRANKS>,
    estimator: Estimator<f32, CRANKS, BASE>,
    phi: [f32; PARAMETERS],
}

impl Watch {
    /// A watch of cycles of `period` seconds, for these parameters. None where home is singular.
    ///
    /// # Errors
    /// When the period is not positive or longer than 16 ms.
    pub fn new(phi: [f32; PARAMETERS], period: f64) -> Result<Option<Self>, SettingError> {
        let settings = Settings {
            forgetting: Forgetting::Directional(600.0),
            ..Settings::new(period)
        };
        let observer = Observer::new(60.0, period)?;
        let estimator = Estimator::new(&settings, &[0.05; CRANKS])?;
        let closure = <closure!(fivebar::Fivebar, f32)>::new(&Fivebar);
        Ok(closure.ok().map(|closure| Self {
            closure,
            observer,
            estimator,
            phi,
        }))
    }

    /// One cycle: the external generalised force on the cranks, N m.
    ///
    /// - `angles`, `velocities`: of the cranks, rad and rad/s.
    /// - `efforts`: those that were commanded in the last cycle, N m.
    ///
    /// # Errors
    /// The outcome, where the loops could not be closed.
    pub fn cycle(
        &mut self,
        angles: &[f32; CRANKS],
        velocities: &[f32; CRANKS],
        efforts: &[f32; CRANKS],
    ) -> Result<[f32; CRANKS], Outcome<f32>> {
        let outcome = self.closure.track(angles, 3);
        if !outcome.is_closed() {
            return Err(outcome);
        }
        let motion = self.closure.motion(velocities, &[0.0; CRANKS]);
        let (q, qd) = (self.closure.q(), &motion.qd);
        let (p, _) = fivebar::momentum(q, qd, &self.phi);
        let (r, _) = fivebar::momentum_rate(q, qd, &self.phi);
        let mut columns: [Columns; 2] = [[[0.0; CRANKS]; PARAMETERS]; 2];
        let [momentum, rate] = &mut columns;
        let regular = fivebar::momentum_regressor(q, qd, momentum).is_regular();
        if !regular || !fivebar::momentum_rate_regressor(q, qd, rate).is_regular() {
            // a sample is missing: filters begin anew
            self.observer.restart();
            self.estimator.interrupt();
            return Ok([0.0; CRANKS]);
        }
        let sample = self.observer.update(&p, &r, efforts);
        if sample == Sample::Taken {
            let _ = self.estimator.update(&base(momentum), &base(rate), efforts);
        }
        Ok(self.observer.force())
    }

    /// The base parameters and their standard deviations, SI; none while they are not determined.
    pub fn parameters(&self) -> Option<([f32; BASE], [f32; BASE])> {
        let values = self.estimator.values()?;
        Some((values, self.estimator.deviations()))
    }
}

/// The columns of the base parameters, which are those of their first parameters.
fn base(all: &Columns) -> [[f32; CRANKS]; BASE] {
    let mut base = [[0.0; CRANKS]; BASE];
    for (column, parameter) in base.iter_mut().zip(&fivebar::BASE) {
        let first = parameter.terms.first().and_then(|term| all.get(term.index));
        *column = first.copied().unwrap_or([0.0; CRANKS]);
    }
    base
}

#[cfg(test)]
mod tests {
    use super::{BASE, Watch};
    use regen_generated::fivebar;

    #[test]
    fn a_push_on_a_crank_is_seen_and_the_robot_is_known() {
        #[allow(clippy::cast_possible_truncation, reason = "rounded to the nearest")]
        let phi = fivebar::NOMINAL.map(|value| value.unwrap_or(0.0) as f32);
        let mut watch = Watch::new(phi, 4e-3).unwrap().unwrap();
        let home = watch.closure.q_i();
        let (mut before, mut force) = ([0.0; 2], [0.0; 2]);
        for k in 0..3000_u16 {
            let t = 4e-3 * f32::from(k);
            let wave = |w: f32| [(w * t).sin(), w * (w * t).cos(), -w * w * (w * t).sin()];
            let (a, b) = (wave(2.0), wave(3.1));
            let angles = [home[0] + 0.3 * a[0], home[1] + 0.3 * b[0]];
            let velocities = [0.3 * a[1], 0.3 * b[1]];
            // the efforts of the motion, less a push in the end
            assert!(watch.closure.track(&angles, 6).is_closed());
            let motion = watch.closure.motion(&velocities, &[0.3 * a[2], 0.3 * b[2]]);
            let (mut tau, _) =
                fivebar::inverse_dynamics(watch.closure.q(), &motion.qd, &motion.qdd, &phi);
            if k > 2900 {
                tau[1] -= 0.4;
            } else if k == 2900 {
                let (values, sigmas) = watch.parameters().unwrap();
                let known: [f32; BASE] = fivebar::to_base(&phi);
                for ((value, sigma), known) in values.iter().zip(sigmas).zip(known) {
                    assert!(
                        (value - known).abs() < 0.01 && sigma < 0.01,
                        "{value} {known} {sigma}"
                    );
                }
            }
            let mean = [0, 1].map(|d| 0.5 * (before[d] + tau[d]));
            before = tau;
            force = watch.cycle(&angles, &velocities, &mean).unwrap();
        }
        assert!(
            (force[1] - 0.4).abs() < 0.01 && force[0].abs() < 0.01,
            "{force:?}"
        );
        assert!(Watch::new(phi, -1.0).is_err());
    }
}
