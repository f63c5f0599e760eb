//! Derivatives of simulated efforts beside differences of simulations.
#![allow(clippy::unwrap_used)]

use regen_experiment::closed_loop::{ClosedLoop, Controllers, LoopRun, simulate_loop};
use regen_experiment::simulate::Pid;
use regen_runtime::{BaseModel, Info};

use super::effort_slopes;
use crate::Number;
use crate::plant::Plant;
use crate::rounds::parameters;

mod models {
    #![allow(missing_docs, unreachable_pub)]
    regen_runtime::robot_model!("../../tests/responses/arm.yaml");
    regen_runtime::robot_model!("../../tests/responses/picker_passive.yaml");
    regen_runtime::robot_model!("../../tests/responses/swinging.yaml");
}

/// A motion of all joints about home, with reversals at different times.
fn swing(t: f64, home: &[f64], q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
    for (k, home) in home.iter().enumerate() {
        let (w, phase) = (3.0 + 1.3 * k as f64, 0.4 * (k + 1) as f64);
        q[k] = home + 0.3 * (w * t + phase).sin();
        qd[k] = 0.3 * w * (w * t + phase).cos();
        qdd[k] = -0.3 * w * w * (w * t + phase).sin();
    }
}

/// The largest error of any column of derivatives, as a part of the column's rms, after the lead.
///
/// - `step`: the time between samples, s.
fn worst<M>(model: &M, controllers: Controllers<'_>, lead: f64, step: f64) -> f64
where
    M: BaseModel<f64> + BaseModel<Number>,
{
    let info: Info<'_> = regen_runtime::Model::<f64>::info(model);
    let home: Vec<f64> = info.independent.iter().map(|c| info.home[*c]).collect();
    let reference = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
        swing(t, &home, q, qd, qdd);
    };
    let closed_loop = ClosedLoop {
        reference: &reference,
        lead,
        controllers,
    };
    let times: Vec<f64> = (0..900).map(|k| 1.0 + step * f64::from(k)).collect();
    let nominal = info.nominal_parameters().unwrap();
    let rank = BaseModel::<f64>::base_info(model).base.len();
    let mut beta = vec![0.0; rank];
    BaseModel::<f64>::to_base(model, &nominal, &mut beta).unwrap();
    let simulated = |beta: &[f64]| -> LoopRun {
        let phi = parameters(model, beta).unwrap();
        simulate_loop(model, &closed_loop, &phi, &times).unwrap()
    };
    let run = simulated(&beta);
    let plant = Plant::new(model, model, 1e-3).unwrap();
    let slopes = effort_slopes(&plant, model, &closed_loop, &run, &beta).unwrap();
    let a = info.actuated.len();
    assert_eq!(slopes.len(), times.len() * a * rank);
    let mut largest: f64 = 0.0;
    for k in 0..rank {
        let h = 1e-3 * beta[k].abs().max(1e-2);
        let at = |by: f64| {
            let mut moved = beta.clone();
            moved[k] += by;
            simulated(&moved).log.effort
        };
        let (above, below) = (at(h), at(-h));
        let [mut errors, mut squares] = [0.0; 2];
        for (row, own) in slopes.chunks_exact(a * rank).enumerate() {
            for (joint, slope) in own[k * a..(k + 1) * a].iter().enumerate() {
                let place = (run.lead + row) * a + joint;
                let difference = (above[place] - below[place]) / (2.0 * h);
                errors += (difference - slope) * (difference - slope);
                squares += difference * difference;
            }
        }
        largest = largest.max((errors / squares).sqrt());
    }
    largest
}

/// Friction at reversals is right up to a part of a sample, which is 6 % of a column in a loop of 3 Hz with
/// this friction.
const CLOSE: f64 = 0.03;
/// Time between samples, s.
const FINE: f64 = 0.0025;

#[test]
fn derivatives_include_integrals_offsets_limits_and_what_happened_in_the_lead() {
    let pid = [(60.0, 150.0, 3.0), (20.0, 40.0, 0.6)];
    let pid = pid.map(|(kp, ki, kd)| Pid {
        kp,
        ki,
        kd,
        ..Pid::default()
    });
    let controllers = Controllers::Known {
        pid: &pid,
        offset: &[4.0, 1.0],
    };
    let found = worst(&models::arm::Arm, controllers, 0.7, FINE);
    assert!(found < CLOSE, "{found}");
}

#[test]
fn derivatives_include_the_gains_that_follow_the_parameters() {
    let controllers = Controllers::Tuned {
        bandwidth: 10.0,
        given: &[],
    };
    let found = worst(&models::arm::Arm, controllers, 0.0, FINE);
    assert!(found < CLOSE, "{found}");
}

#[test]
fn derivatives_include_friction_of_a_joint_that_follows_from_a_loop() {
    let pid = [Pid {
        kp: 8.0,
        ki: 10.0,
        kd: 0.25,
        ..Pid::default()
    }; 2];
    let controllers = Controllers::Known {
        pid: &pid,
        offset: &[],
    };
    let found = worst(
        &models::picker_passive::PickerPassive,
        controllers,
        0.0,
        FINE,
    );
    assert!(found < CLOSE, "{found}");
}

#[test]
fn derivatives_of_a_soft_loop_are_right_with_few_samples() {
    let controllers = Controllers::Tuned {
        bandwidth: 3.0,
        given: &[],
    };
    let found = worst(&models::swinging::Swinging, controllers, 0.0, 0.01);
    assert!(found < CLOSE, "{found}");
}
