//! Identifies the simulated 3-RPS from one experiment, then makes it follow a fast motion: with PID
//! control alone, and with computed torque control from the identified parameters.
//!
//! ```sh
//! cargo run --release -p regen-guide --example computed_torque
//! ```

use std::error::Error;
use std::f64::consts::TAU;

use regen_experiment::simulate::Noise;
use regen_experiment::simulate::{
    ControllerInput, Drive, Log, Pid, Sensors, Settings, nominal_friction, perturb_parameters,
    simulate, simulate_controlled,
};
use regen_generated::rps3_friction::Rps3Friction;
use regen_identify::identify::{EquationKind, Options, identify};
use regen_identify::states::Recorded;
use regen_runtime::{BaseModel, LoopClosure};

/// The robot, over `f64`.
fn robot() -> &'static dyn BaseModel<f64> {
    &Rps3Friction
}

/// A smooth periodic motion of the lengths of the three legs about 0.62 m. Each wave is an
/// amplitude in m and a frequency as a multiple of 1/7.5 Hz. The function fills positions,
/// velocities and accelerations at a time in s.
fn motion(waves: &'static [(f64, f64)]) -> impl Fn(f64, &mut [f64], &mut [f64], &mut [f64]) {
    move |t, q, qd, qdd| {
        for leg in 0..3 {
            (q[leg], qd[leg], qdd[leg]) = (0.62, 0.0, 0.0);
            for (size, multiple) in waves {
                let w = TAU * multiple / 7.5;
                // the legs differ in phase, so that the platform tilts
                let a = w * t + 2.1 * leg as f64 * multiple;
                q[leg] += size * a.sin();
                qd[leg] += size * w * a.cos();
                qdd[leg] -= size * w * w * a.sin();
            }
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let info = robot().info();
    // the true robot, whose parameters the controller does not have: the ten parameters of each
    // body are those of the drawing times one factor of 0.9 to 1.1, and every other parameter has
    // its own factor
    let drawing = info.nominal_parameters().ok_or("no nominal values")?;
    let truth = perturb_parameters(&info, &drawing, 0.1, &mut Noise::new(7));
    let laws = nominal_friction(&info)?;
    let settings = Settings {
        duration: 7.5,
        pid: vec![
            Pid {
                kp: 8.0e4,
                ki: 2.0e5,
                kd: 4.0e3,
                ..Pid::default()
            };
            3
        ],
        drives: vec![
            Drive {
                lag: 0.0,
                limit: Some([-3000.0, 3000.0])
            };
            3
        ],
        friction: laws,
        sensors: Sensors {
            position_step: 1e-6,
            effort_noise: 2.0,
            ..Sensors::default()
        },
        seed: 1,
        ..Settings::default()
    };

    // 1. the experiment, under PID control
    let exciting = motion(&[(0.03, 2.0), (0.02, 5.0), (0.008, 9.0)]);
    let log = simulate(robot(), &truth, &exciting, &settings)?;
    let beta = identified(&log)?;

    // 2. a motion that was not in the experiment
    let fast = motion(&[(0.06, 4.0), (0.006, 10.0)]);
    let by_pid = simulate(robot(), &truth, &fast, &settings)?;
    let mut controller = ComputedTorque::new(beta)?;
    let mut command =
        |now: &ControllerInput<'_>, efforts: &mut [f64]| controller.efforts(now, efforts);
    let by_model = simulate_controlled(robot(), &truth, &fast, &mut command, &settings)?;

    let (pid, model) = (tracking(&by_pid, &fast), tracking(&by_model, &fast));
    println!("root mean square of the legs' errors, after the first second");
    println!("  PID alone                          {:7.3} mm", 1e3 * pid);
    println!(
        "  computed torque as identified      {:7.3} mm",
        1e3 * model
    );
    if model * 3.0 > pid {
        return Err("the model should track at least three times better".into());
    }
    Ok(())
}

/// The base parameters by least squares, each leg's equations weighted by its noise. The efforts
/// are the measured ones; the motion is the exact one of the simulation, which a real log does not
/// have.
fn identified(log: &Log) -> Result<Vec<f64>, Box<dyn Error>> {
    let n = robot().info().coordinates.len();
    let mut data = Recorded::new();
    for (k, t) in log.t.iter().enumerate() {
        let row = |list: &[f64], width: usize| list[k * width..(k + 1) * width].to_vec();
        data.push(
            *t,
            &row(&log.q, n),
            &row(&log.qd, n),
            &row(&log.qdd, n),
            &row(&log.measured_effort, 3),
        );
    }
    let found = identify(
        robot(),
        EquationKind::Forces,
        &Options::default(),
        &mut data,
    )?
    .estimate;
    println!(
        "{} samples, {} base parameters, condition number {:.0} with columns scaled",
        log.t.len(),
        found.values.len(),
        found.scaled_condition
    );
    Ok(found.values)
}

/// Computed torque control in base parameters: `tau = M(q) (qdd_d + Kv de/dt + Kp e) + h(q, qd_d)`,
/// with the measured positions q, the desired motion q_d, qd_d, qdd_d, the error `e = q_d - q` and
/// the forces h of velocities, gravity and friction.
struct ComputedTorque {
    /// The base parameters, SI.
    beta: Vec<f64>,
    closure: LoopClosure<'static, dyn BaseModel<f64>>,
    /// The measured positions of the last sample, m, for the velocities.
    last: Option<Vec<f64>>,
}

impl ComputedTorque {
    fn new(beta: Vec<f64>) -> Result<Self, Box<dyn Error>> {
        let closure = LoopClosure::new(robot())?;
        Ok(Self {
            beta,
            closure,
            last: None,
        })
    }

    fn efforts(&mut self, now: &ControllerInput<'_>, efforts: &mut [f64]) {
        // the error decays with a natural frequency of 20 rad/s, critically damped: kp in 1/s^2, kv
        // in 1/s
        let (kp, kv) = (400.0, 40.0);
        let measured = now.measured;
        let last = self.last.replace(measured.to_vec());
        let rate = |k: usize| match &last {
            Some(last) => (measured[k] - last[k]) / now.period,
            None => now.qd_i[k],
        };
        let wanted: Vec<f64> = (0..3)
            .map(|k| {
                let (e, ed) = (now.q_i[k] - measured[k], now.qd_i[k] - rate(k));
                now.qdd_i[k] + kv * ed + kp * e
            })
            .collect();
        // the model is evaluated at the measured positions and the desired velocities: the
        // velocities from the encoders are noisy, so that the sign of Coulomb friction would
        // chatter at each reversal. Where the loops cannot be closed, the efforts of the last
        // sample remain
        if let Ok(state) = self.closure.solve_state(measured, now.qd_i, &wanted)
            && state.outcome.is_closed()
        {
            let _condition =
                robot().base_inverse_dynamics(&state.q, &state.qd, &state.qdd, &self.beta, efforts);
        }
    }
}

/// The root mean square of the true tracking errors of the three legs after the first second, m.
fn tracking(log: &Log, reference: &impl Fn(f64, &mut [f64], &mut [f64], &mut [f64])) -> f64 {
    let n = robot().info().coordinates.len();
    let (mut sum, mut count) = (0.0, 0.0);
    for (k, t) in log.t.iter().enumerate().filter(|(_, t)| **t > 1.0) {
        let mut wanted = [0.0; 3];
        reference(*t, &mut wanted, &mut [0.0; 3], &mut [0.0; 3]);
        for (leg, wanted) in robot().info().independent.iter().zip(wanted) {
            sum += (log.q[k * n + leg] - wanted).powi(2);
            count += 1.0;
        }
    }
    (sum / f64::max(count, 1.0)).sqrt()
}
