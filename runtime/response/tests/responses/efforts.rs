//! DIDIM: parameters from efforts, without any measured motion.

use regen_experiment::closed_loop::{ClosedLoop, Controllers};
use regen_identify::estimate::Estimate;
use regen_response::{Didim, DidimError, DidimOptions, EffortRun, Number, didim};
use regen_runtime::BaseModel;

use crate::exact::{ARM, FIVE};
use crate::models::arm::Arm;
use crate::models::picker_asymmetric::PickerAsymmetric;
use crate::twin::{Twin, off, worst};

fn estimated<M>(
    twin: &Twin<'_, M>,
    controllers: Controllers<'_>,
    start: &[f64],
) -> Result<Didim, DidimError>
where
    M: BaseModel<f64> + BaseModel<Number> + Sync,
{
    let log = twin.log();
    let joints = twin.pid.len();
    let column = |k: usize| {
        log.measured_effort
            .iter()
            .skip(k)
            .step_by(joints)
            .copied()
            .collect()
    };
    let efforts: Vec<Vec<f64>> = (0..joints).map(column).collect();
    let reference = twin.reference();
    let run = EffortRun {
        times: &log.t,
        efforts: &efforts,
        positions: &[],
        closed_loop: ClosedLoop {
            reference: &reference,
            lead: 0.0,
            controllers,
        },
    };
    didim(
        twin.model,
        twin.model,
        &[run],
        &DidimOptions::default(),
        start,
    )
}

fn ratios(estimate: &Estimate, truth: &[f64]) -> Vec<f64> {
    let of = |(k, x): (usize, &f64)| (estimate.values[k] - x) / estimate.sigma(k);
    truth.iter().enumerate().map(of).collect()
}

fn all_within<M>(twin: &Twin<'_, M>)
where
    M: BaseModel<f64> + BaseModel<Number> + Sync,
{
    let truth = twin.beta();
    let known = Controllers::Known {
        pid: &twin.pid,
        offset: &[],
    };
    let found = estimated(twin, known, &off(&truth, 0.2)).unwrap();
    assert!(
        found.converged && found.rounds <= 10,
        "{} {:?}",
        found.rounds,
        found.norms
    );
    let ratios = ratios(&found.identified.correlated(), &truth);
    assert!(ratios.iter().all(|r| r.abs() < 4.0), "{ratios:?}");
    let model = found.model(0.95);
    assert_eq!(
        (model.name.as_str(), model.beta.len()),
        ("DIDIM", truth.len())
    );
}

#[test]
fn efforts_alone_give_the_parameters_of_a_five_bar_with_friction_by_direction() {
    all_within(&Twin {
        noise: [1e-5, 0.01],
        ..Twin::new(&PickerAsymmetric, &FIVE)
    });
}

#[test]
fn efforts_alone_give_the_parameters_of_an_arm() {
    all_within(&Twin {
        noise: [1e-5, 0.05],
        ..Twin::new(&Arm, &ARM)
    });
}

#[test]
fn a_soft_loop_whose_rounds_approach_slowly_converges_to_the_parameters() {
    // a third of the stiffness: the motion follows from the parameters by as much as from the commands
    let soft: Vec<[f64; 2]> = ARM.iter().map(|[kp, kd]| [kp / 3.0, kd / 2.0]).collect();
    all_within(&Twin {
        noise: [1e-5, 0.05],
        ..Twin::new(&Arm, &soft)
    });
}

#[test]
fn a_loop_with_a_twelfth_of_the_stiffness_converges_too() {
    let soft: Vec<[f64; 2]> = ARM.iter().map(|[kp, kd]| [kp / 12.0, kd / 4.0]).collect();
    all_within(&Twin {
        noise: [1e-5, 0.05],
        ..Twin::new(&Arm, &soft)
    });
}

/// Exact derivatives of the simulated efforts: efforts without noise are met in few rounds, each with the
/// square of the error before.
fn meets_exact_efforts<M>(twin: &Twin<'_, M>, controllers: Controllers<'_>)
where
    M: BaseModel<f64> + BaseModel<Number> + Sync,
{
    let truth = twin.beta();
    let found = estimated(twin, controllers, &off(&truth, 0.1)).unwrap();
    let norms = &found.norms;
    assert!(found.converged && norms[2] < 1e-3 * norms[0], "{norms:?}");
    let values = &found.identified.estimate.values;
    assert!(worst(values, &truth) < 1e-3, "{values:?} {truth:?}");
}

#[test]
fn exact_efforts_of_a_soft_loop_are_met_in_few_rounds() {
    let soft: Vec<[f64; 2]> = ARM.iter().map(|[kp, kd]| [kp / 3.0, kd / 2.0]).collect();
    let arm = Twin::new(&Arm, &soft);
    meets_exact_efforts(
        &arm,
        Controllers::Known {
            pid: &arm.pid,
            offset: &[],
        },
    );
    let five = Twin::new(&PickerAsymmetric, &FIVE);
    meets_exact_efforts(
        &five,
        Controllers::Known {
            pid: &five.pid,
            offset: &[],
        },
    );
}

#[test]
fn an_estimate_that_cannot_be_simulated_is_refused_with_its_reason() {
    let twin = Twin::new(&Arm, &ARM);
    let mut start = twin.beta();
    start[0] = -1.0;
    let known = Controllers::Known {
        pid: &twin.pid,
        offset: &[],
    };
    let error = estimated(&twin, known, &start).unwrap_err();
    assert!(matches!(error, DidimError::Loop(_)), "{error}");
}
