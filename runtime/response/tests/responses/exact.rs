//! Exact data give exact parameters, in as few steps as exact derivatives need.

use regen_response::{Action, Damping, Number, ResponseFit, Run, Setup, fit_responses};
use regen_runtime::BaseModel;

use crate::models::arm::Arm;
use crate::models::picker_asymmetric::PickerAsymmetric;
use crate::twin::{Twin, off, worst};

/// Fits from base parameters 10 % off; also returns the squares of each step.
pub(crate) fn fitted<M>(
    model: &M,
    runs: &[Run],
    setup: &Setup,
    start: &[f64],
) -> (ResponseFit, Vec<f64>)
where
    M: BaseModel<f64> + BaseModel<Number> + Sync,
{
    let mut squares = Vec::new();
    let mut progress = |_: usize, s: f64| squares.push(s);
    let found = fit_responses(model, model, runs, setup, start, 0.95, &mut progress).unwrap();
    (found, squares)
}

/// 0.8 s at 200 Hz.
pub(crate) fn short<M: BaseModel<f64>>(twin: Twin<'_, M>) -> Twin<'_, M> {
    Twin {
        step: 0.005,
        duration: 0.8,
        ..twin
    }
}

pub(crate) const FIVE: [[f64; 2]; 2] = [[60.0, 0.8]; 2];
pub(crate) const ARM: [[f64; 2]; 2] = [[300.0, 12.0], [60.0, 1.5]];

#[test]
fn exact_responses_of_a_five_bar_with_friction_by_direction_give_its_parameters() {
    let twin = short(Twin::new(&PickerAsymmetric, &FIVE));
    let truth = twin.beta();
    let (found, squares) = fitted(
        &PickerAsymmetric,
        &[twin.run()],
        &twin.setup(),
        &off(&truth, 0.1),
    );
    assert!(
        worst(&found.model.beta, &truth) < 1e-3,
        "{:?} {truth:?}",
        found.model.beta
    );
    assert!(found.undetermined.is_empty(), "{:?}", found.undetermined);
    // with exact derivatives, only the errors of integration remain after the fourth step
    assert!(squares[3] < 1e-5 * squares[0], "{squares:?}");
}

#[test]
fn an_integral_an_offset_and_effort_limits_are_simulated_as_the_controller_has_them() {
    let mut twin = short(Twin::new(&Arm, &ARM));
    twin.offset = vec![9.0, 1.5];
    for pid in &mut twin.pid {
        pid.ki = 200.0;
    }
    let truth = twin.beta();
    let (found, _) = fitted(&Arm, &[twin.run()], &twin.setup(), &off(&truth, 0.05));
    assert!(
        worst(&found.model.beta, &truth) < 1e-3,
        "{:?} {truth:?}",
        found.model.beta
    );
}

/// A log of a fast controller of which the fit gets every eighth sample, while commands change only
/// there.
#[test]
fn continuous_controllers_are_fitted_without_their_own_samples() {
    let twin = Twin {
        step: 0.000_625,
        duration: 0.8,
        hold: Some(0.005),
        damp_velocity: true,
        ..Twin::new(&Arm, &ARM)
    };
    let fine = twin.run();
    let thin = |x: &Vec<f64>| -> Vec<f64> { x.iter().step_by(8).copied().collect() };
    let run = Run {
        times: thin(&fine.times),
        commands: fine.commands.iter().map(thin).collect(),
        positions: fine.positions.iter().map(|(c, x)| (*c, thin(x))).collect(),
        ..Run::default()
    };
    let mut setup = twin.setup();
    setup.action = Action::Continuous;
    for law in &mut setup.laws {
        law.damping = Damping::OfVelocity;
    }
    let truth = twin.beta();
    let (found, _) = fitted(&Arm, &[run], &setup, &off(&truth, 0.05));
    // the controller's damping is late by one of its samples, which changes Fv = 0.4 by up to 1 %
    // of kd = 12
    let off_by = worst(&found.model.beta, &truth);
    assert!(off_by < 0.1, "{off_by}: {:?} {truth:?}", found.model.beta);
}
