//! Simulated robots under position control.

use regen_experiment::simulate::{
    ControllerInput, Log, Pid, Sensors, Settings, Termination, linear_friction, simulate,
    simulate_controlled,
};
use regen_response::{Law, Run, Setup};
use regen_runtime::{BaseModel, Info};

/// A robot to simulate, with its controllers and its motion about home.
pub(crate) struct Twin<'m, M> {
    pub(crate) model: &'m M,
    pub(crate) pid: Vec<Pid>,
    pub(crate) offset: Vec<f64>,
    /// The amplitude of the motion, rad.
    pub(crate) swing: f64,
    pub(crate) step: f64,
    pub(crate) duration: f64,
    /// Standard deviations of positions and efforts.
    pub(crate) noise: [f64; 2],
    pub(crate) seed: u64,
    /// For how long each command is held, s; `None`: for a sample.
    pub(crate) hold: Option<f64>,
    /// Whether kd damps the velocity, not the rate of the error.
    pub(crate) damp_velocity: bool,
}

impl<'m, M: BaseModel<f64>> Twin<'m, M> {
    /// - `gains`: kp and kd of each actuated joint.
    pub(crate) fn new(model: &'m M, gains: &[[f64; 2]]) -> Self {
        let pid = |[kp, kd]: &[f64; 2]| Pid {
            kp: *kp,
            ki: 0.0,
            kd: *kd,
            ..Pid::default()
        };
        Self {
            model,
            pid: gains.iter().map(pid).collect(),
            offset: Vec::new(),
            swing: 0.3,
            step: 0.0025,
            duration: 2.0,
            noise: [0.0; 2],
            seed: 1,
            hold: None,
            damp_velocity: false,
        }
    }

    /// The commanded positions of the independent coordinates.
    pub(crate) fn reference(&self) -> impl Fn(f64, &mut [f64], &mut [f64], &mut [f64]) + use<M> {
        let info = self.model.info();
        let home: Vec<f64> = info.independent.iter().map(|c| info.home[*c]).collect();
        let (size, hold) = (self.swing, self.hold);
        move |t, q, qd, qdd| {
            // half a microsecond: the time of a sample may be rounded down
            let t = hold.map_or(t, |h| h * ((t + 5e-7) / h).floor());
            for (k, home) in home.iter().enumerate() {
                q[k] = *home;
                (qd[k], qdd[k]) = (0.0, 0.0);
                for (h, share) in [(1.0, 0.5), (2.3, 0.3), (3.9, 0.2)] {
                    let w = h * (3.0 + 1.3 * k as f64);
                    let phase = 0.4 * h * (k + 1) as f64;
                    q[k] += size * share * (w * t + phase).sin();
                    qd[k] += size * share * w * (w * t + phase).cos();
                    qdd[k] -= size * share * w * w * (w * t + phase).sin();
                }
            }
        }
    }

    pub(crate) fn truth(&self) -> Vec<f64> {
        let info = self.model.info();
        nominal(&info)
    }

    pub(crate) fn beta(&self) -> Vec<f64> {
        let mut beta = vec![0.0; self.model.base_info().base.len()];
        self.model.to_base(&self.truth(), &mut beta).unwrap();
        beta
    }

    pub(crate) fn log(&self) -> Log {
        let info = self.model.info();
        let phi = self.truth();
        let settings = Settings {
            duration: self.duration,
            period: self.step,
            pid: self.pid.clone(),
            offset: self.offset.clone(),
            friction: linear_friction(&info, &phi),
            sensors: Sensors {
                position_noise: self.noise[0],
                effort_noise: self.noise[1],
                ..Sensors::default()
            },
            seed: self.seed,
            tolerance: 1e-9,
            ..Settings::default()
        };
        let reference = self.reference();
        let log = if self.damp_velocity {
            let joints = info.actuated.to_vec();
            let mut last: Option<Vec<f64>> = None;
            let mut law = |now: &ControllerInput<'_>, efforts: &mut [f64]| {
                let before = last.replace(now.measured.to_vec());
                for (k, pid) in self.pid.iter().enumerate() {
                    let at = now.measured[k];
                    let rate = before.as_ref().map_or(0.0, |b| (at - b[k]) / now.period);
                    efforts[k] = pid.kp * (now.q[joints[k]] - at) - pid.kd * rate;
                }
            };
            simulate_controlled(self.model, &phi, &reference, &mut law, &settings).unwrap()
        } else {
            simulate(self.model, &phi, &reference, &settings).unwrap()
        };
        assert_eq!(log.ended, Termination::Complete);
        log
    }

    /// The run of the log as a fit to responses reads it.
    pub(crate) fn run(&self) -> Run {
        let info = self.model.info();
        let log = self.log();
        let joints = info.actuated.len();
        let column = |k: usize| -> Vec<f64> {
            log.measured_position
                .iter()
                .skip(k)
                .step_by(joints)
                .copied()
                .collect()
        };
        let reference = self.reference();
        let dof = info.dof();
        let mut commands = vec![Vec::new(); joints];
        for t in &log.t {
            let (mut q, mut qd, mut qdd) = (vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]);
            reference(*t, &mut q, &mut qd, &mut qdd);
            for (list, x) in commands.iter_mut().zip(&q) {
                list.push(*x);
            }
        }
        let positions = info.actuated.iter().enumerate();
        Run {
            times: log.t.clone(),
            commands,
            positions: positions.map(|(k, c)| (*c, column(k))).collect(),
            velocities: Vec::new(),
        }
    }

    /// The settings with the controllers of the robot, all known.
    pub(crate) fn setup(&self) -> Setup {
        let laws = self.pid.iter().enumerate().map(|(k, pid)| {
            let mut law = Law::pd(pid.kp, pid.kd);
            law.ki.value = pid.ki;
            law.offset.value = self.offset.get(k).copied().unwrap_or(0.0);
            law
        });
        Setup::new(laws.collect())
    }
}

pub(crate) fn nominal(info: &Info<'_>) -> Vec<f64> {
    info.nominal_parameters().expect("nominal values")
}

/// Parameters off the truth by up to this part, each by its own.
pub(crate) fn off(values: &[f64], part: f64) -> Vec<f64> {
    let factor = |k: usize| 1.0 + part * (2.3 * (k + 1) as f64).sin();
    values
        .iter()
        .enumerate()
        .map(|(k, x)| x * factor(k))
        .collect()
}

/// The largest error over the largest value.
pub(crate) fn worst(found: &[f64], truth: &[f64]) -> f64 {
    let size = truth.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let error = found.iter().zip(truth).map(|(a, b)| (a - b).abs());
    error.fold(0.0, f64::max) / size
}
