//! The chapter's claims about its 3-RPS, with few seeds of noise; the example `chapter` uses
//! twenty.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "../examples/chapter/friction.rs"]
#[allow(dead_code, reason = "the example uses all of it")]
mod friction;
#[path = "../examples/chapter/models.rs"]
#[allow(dead_code, reason = "the example uses all of it")]
mod models;
#[path = "../examples/chapter/robot.rs"]
#[allow(dead_code, reason = "the example uses all of it")]
mod robot;

use models::{Automatic, Table6};
use regen_identify::signals::Fourier;
use regen_runtime::{LoopClosure, State};

/// The trajectory that `regen excite` found with the condition number as its criterion.
fn states() -> Vec<State> {
    let text = include_str!("../examples/chapter/trajectory.json");
    let file: serde_json::Value = serde_json::from_str(text).unwrap();
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        let entries = value.as_array().unwrap();
        entries.iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let offsets = numbers(&file["offset"]);
    let parts: Vec<_> = (0..3)
        .map(|k| {
            (
                offsets[k],
                numbers(&file["cosine"][k]),
                numbers(&file["sine"][k]),
            )
        })
        .collect();
    let series = Fourier::of_positions(file["base_frequency"].as_f64().unwrap(), &parts).unwrap();
    robot::states(&series, robot::POINTS)
}

#[test]
fn nonlinear_feasible_friction_beats_linear_on_the_original_forces() {
    let [_, linear, nonlinear] = friction::table3(&states(), 1);
    assert!(nonlinear[1] < linear[1], "{nonlinear:?} {linear:?}");
}

#[test]
fn few_parameters_of_model_1_and_twelve_of_models_3_and_4_are_well_identified() {
    let states = states();
    let seeds = 5;
    let (mut errors, mut averages) = ([0.0; 5], [0.0; 5]);
    for seed in 1..=seeds {
        let table = Table6::new(&states, models::FORCE_NOISE, seed);
        let rows = table.rows().map(|(_, row)| row);
        assert_eq!(rows.map(|row| row.parameters), [37, 34, 24, 18, 12]);
        let [by_sign, _, _, third, fourth] = rows;
        assert!(
            by_sign.well_identified < 10,
            "seed {seed}: {}",
            by_sign.well_identified
        );
        assert_eq!(
            [third.well_identified, fourth.well_identified],
            [12, 12],
            "seed {seed}"
        );
        for (k, row) in rows.iter().enumerate() {
            errors[k] += row.relative_absolute / seeds as f64;
            averages[k] += row.average / seeds as f64;
        }
    }
    // With fewer parameters the fit is worse and the parameters are nearer to the true ones. This
    // is asserted for the mean over seeds, because eps_RA is a sum of absolute values while the fit
    // minimises squares, and can fall a little.
    for before in [0, 1] {
        assert!(errors[2] > errors[before], "{errors:?}");
        assert!(averages[2] < averages[before], "{averages:?}");
    }
}

#[test]
fn the_automatic_reduction_predicts_as_well_as_model_4() {
    let all = states();
    // identification uses the first half of the trajectory, and the second half validates
    let (first, second) = all.split_at(all.len() / 2);
    let found = Automatic::new(first, second, 1);
    let [automatic, fourth] = found.errors;
    assert!(automatic < 1.1 * fourth, "{automatic} {fourth}");
    assert!(found.kept.len() >= 12, "{:?}", found.kept);
}

#[test]
fn friction_and_drives_are_independent_of_rigid_bodies() {
    let states = states();
    let equations = models::equations(false);
    let factor = equations.factor(&states, &vec![0.0; 3 * states.len()]);
    assert_eq!(factor.spectrum().unwrap().rank(), 34);
    let bodies: Vec<usize> = (0..25).collect();
    assert_eq!(
        factor.select(&bodies).unwrap().spectrum().unwrap().rank(),
        25
    );
}

#[test]
fn within_cones_of_45_degrees_the_robot_is_far_from_singularities() {
    let model = robot::model();
    let mut closure = LoopClosure::new(model).unwrap();
    let (mut inside, mut outside) = (f64::INFINITY, f64::INFINITY);
    let leg = |k: usize| 0.35 + 0.5 * k as f64 / 7.0;
    for k in 0..512 {
        let closed = closure
            .solve(&[leg(k % 8), leg(k / 8 % 8), leg(k / 64)])
            .unwrap();
        let mut cosines = [0.0; 3];
        model.cones(&closed.q, &mut cosines).unwrap();
        let within = cosines.iter().all(|c| *c >= 45.0_f64.to_radians().cos());
        let least = if within { &mut inside } else { &mut outside };
        *least = least.min(closed.condition.pivot);
    }
    assert!(inside > 0.1 && outside < inside, "{inside} {outside}");
}
