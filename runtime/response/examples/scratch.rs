#![allow(warnings, clippy::all)]
#[path = "../tests/responses/twin.rs"]
mod twin;
use regen_experiment::closed_loop::{ClosedLoop, Controllers};
use regen_response::*;
use regen_runtime::BaseModel;
use twin::*;
regen_runtime::robot_model!("../tests/responses/picker_asymmetric.yaml");
regen_runtime::robot_model!("../tests/responses/arm.yaml");
fn did<M: BaseModel<f64> + Sync>(twin: &Twin<'_, M>, c: Controllers<'_>, start: &[f64]) {
    let log = twin.log();
    let joints = twin.pid.len();
    let efforts: Vec<Vec<f64>> = (0..joints)
        .map(|k| {
            log.measured_effort
                .iter()
                .skip(k)
                .step_by(joints)
                .copied()
                .collect()
        })
        .collect();
    let reference = twin.reference();
    let run = EffortRun {
        times: &log.t,
        efforts: &efforts,
        closed_loop: ClosedLoop {
            reference: &reference,
            lead: 0.0,
            controllers: c,
        },
    };
    let clock = std::time::Instant::now();
    match didim(twin.model, &[run], &DidimOptions::default(), start) {
        Ok(f) => {
            let e = f.identified.correlated();
            let r: Vec<f64> = twin
                .beta()
                .iter()
                .enumerate()
                .map(|(k, x)| (10.0 * (e.values[k] - x) / e.sigma(k)).round() / 10.0)
                .collect();
            println!(
                "{:?} {} {} {:?} {r:?}",
                clock.elapsed(),
                f.rounds,
                f.settled,
                f.norms
            );
        }
        Err(e) => println!("{e}"),
    }
}
fn main() {
    let twin = Twin {
        noise: [1e-5, 0.01],
        ..Twin::new(&picker_asymmetric::PickerAsymmetric, &[[60.0, 0.8]; 2])
    };
    did(
        &twin,
        Controllers::Known {
            pid: &twin.pid,
            offset: &[],
        },
        &off(&twin.beta(), 0.2),
    );
    did(
        &twin,
        Controllers::Known {
            pid: &twin.pid,
            offset: &[],
        },
        &off(&twin.beta(), 0.02),
    );
    let twin = Twin {
        noise: [1e-5, 0.05],
        ..Twin::new(&arm::Arm, &[[300.0, 12.0], [60.0, 1.5]])
    };
    did(
        &twin,
        Controllers::Known {
            pid: &twin.pid,
            offset: &[],
        },
        &off(&twin.beta(), 0.2),
    );
    let twin = Twin {
        noise: [1e-5, 0.05],
        ..Twin::new(&arm::Arm, &[[3000.0, 60.0], [400.0, 6.0]])
    };
    for b in [8.0, 12.0, 20.0, 25.0, 30.0] {
        did(
            &twin,
            Controllers::Tuned {
                bandwidth: b,
                given: &[],
            },
            &off(&twin.beta(), 0.2),
        );
    }
}
