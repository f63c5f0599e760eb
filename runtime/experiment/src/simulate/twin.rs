//! A simulated robot with known parameters, and the settings that all its runs share.

use core::fmt;

use regen_identify::friction::JointFit;
use regen_runtime::{Info, Model, Symbol};

use super::control::Drive;
use super::friction::{MissingNominal, fitted_friction, perturb_friction};
use super::noise::{Noise, perturb_parameters};
use super::settings::{Sensors, Settings};
use super::tuning::{Gains, TuningError, control};

/// The options of a twin: its controllers, drives, friction, sensors and random parameters.
#[derive(Clone, Debug)]
pub struct TwinOptions<'a> {
    /// The bandwidth of the controllers without given gains, Hz.
    pub bandwidth: f64,
    /// Gains that replace tuned ones.
    pub gains: &'a [Gains],
    /// The time between samples of the controllers and of the log, s.
    pub period: f64,
    /// The time constant of the drives, s.
    pub lag: f64,
    /// Whether joints have friction.
    pub friction: bool,
    /// The velocity over which smoothed friction changes its direction, rad/s or m/s.
    pub friction_width: f64,
    /// The sensors of positions and efforts.
    pub sensors: Sensors,
    /// The largest random difference of parameters and nonlinear friction from the nominal values,
    /// relative to these.
    pub perturb: f64,
    /// The seed of these random differences.
    pub seed: u64,
}

/// A robot with known parameters under controllers that were tuned to the nominal ones.
#[derive(Clone, Debug)]
pub struct Twin {
    /// The true parameters, p, SI; friction is 0 where the twin has none.
    pub parameters: Vec<f64>,
    /// The settings of its runs: controllers, drives, friction and sensors.
    pub settings: Settings,
    /// As [`Control::spread`](super::Control::spread).
    pub spread: f64,
}

impl Twin {
    /// Draws the true parameters and tunes the controllers.
    ///
    /// - `nominal`: p parameters, SI;
    /// - `fitted`: friction that replaces nominal nonlinear friction;
    /// - `states`: the independent coordinates, dof, rad or m, of the start and of further states of the
    ///   motion, at which the controllers are tuned.
    ///
    /// # Errors
    /// When a joint's friction has no value, or no controllers can be tuned.
    ///
    /// ```
    /// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs")); }
    /// use regen_experiment::simulate::{Sensors, Twin, TwinOptions, simulate};
    ///
    /// let options = TwinOptions {
    ///     bandwidth: 5.0,
    ///     gains: &[],
    ///     period: 0.01,
    ///     lag: 0.0,
    ///     friction: true,
    ///     friction_width: 1e-3,
    ///     sensors: Sensors::default(),
    ///     perturb: 0.1,
    ///     seed: 7,
    /// };
    /// let twin = Twin::new(&models::Pendulum, &[0.5, 2.0], &[], &[vec![0.0]], &options)?;
    /// assert!((twin.parameters[0] - 0.5).abs() < 0.05 && twin.parameters[0] != 0.5);
    /// let rest = |_: f64, q: &mut [f64], _: &mut [f64], _: &mut [f64]| q[0] = 0.0;
    /// let run = twin.run(7, 0, 0.5);
    /// let log = simulate(&models::Pendulum, &twin.parameters, &rest, &run)?;
    /// assert_eq!(log.t.len(), 51);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn new<M: Model<f64> + ?Sized>(
        model: &M,
        nominal: &[f64],
        fitted: &[JointFit],
        states: &[Vec<f64>],
        options: &TwinOptions<'_>,
    ) -> Result<Self, TwinError> {
        let info = model.info();
        let mut random = Noise::new(options.seed);
        let mut parameters = if options.perturb > 0.0 {
            perturb_parameters(&info, nominal, options.perturb, &mut random)
        } else {
            nominal.to_vec()
        };
        let friction = if options.friction {
            let mut laws = fitted_friction(&info, &parameters, fitted)?;
            if options.perturb > 0.0 {
                perturb_friction(&mut laws, options.perturb, &mut random);
            }
            laws
        } else {
            without_friction(&info, &mut parameters);
            Vec::new()
        };
        let tuned = (options.bandwidth, options.period);
        let control = control(tuned, options.gains, model, nominal, states)?;
        let drive = |joint: &usize| Drive {
            lag: options.lag,
            limit: info.joints.get(*joint).and_then(|j| j.limits.effort),
        };
        Ok(Self {
            parameters,
            spread: control.spread,
            settings: Settings {
                period: options.period,
                pid: control.pid,
                drives: info.actuated.iter().map(drive).collect(),
                offset: control.offset,
                friction,
                friction_width: options.friction_width,
                sensors: options.sensors,
                ..Settings::default()
            },
        })
    }

    /// The settings of one run, whose sensor noise differs from that of other runs.
    ///
    /// - `seed`: the seed of the noise of all runs; `number`: that of the run, from 0; `duration`:
    ///   s.
    pub fn run(&self, seed: u64, number: usize, duration: f64) -> Settings {
        Settings {
            duration,
            // the seed differs from those of other runs, and from those of other small seeds
            seed: seed ^ ((number as u64 + 1) << 32),
            ..self.settings.clone()
        }
    }
}

/// Sets the friction parameters of all joints to zero.
fn without_friction(info: &Info<'_>, parameters: &mut [f64]) {
    for (parameter, value) in info.parameters.iter().zip(parameters) {
        if matches!(parameter.symbol, Symbol::Friction(_)) {
            *value = 0.0;
        }
    }
}

/// Why there is no twin.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TwinError {
    /// A joint's friction has no value.
    Friction(MissingNominal),
    /// No controllers can be tuned.
    Control(TuningError),
}

impl fmt::Display for TwinError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Friction(why) => why.fmt(f),
            Self::Control(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for TwinError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Friction(why) => Some(why),
            Self::Control(why) => Some(why),
        }
    }
}

impl From<MissingNominal> for TwinError {
    fn from(why: MissingNominal) -> Self {
        Self::Friction(why)
    }
}

impl From<TuningError> for TwinError {
    fn from(why: TuningError) -> Self {
        Self::Control(why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_runs_of_small_seeds_share_a_seed() {
        let twin = Twin {
            parameters: Vec::new(),
            settings: Settings::default(),
            spread: 1.0,
        };
        let mut all: Vec<u64> = (0..50)
            .flat_map(|seed| (0..50).map(move |run| (seed, run)))
            .map(|(seed, run)| twin.run(seed, run, 1.0).seed)
            .collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 2500);
    }
}
