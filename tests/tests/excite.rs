//! Exciting trajectories: exact derivatives, limits that are respected at all times, reproducible
//! results.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::sync::atomic::AtomicBool;

use regen_experiment::excite::{
    Criterion, Excitation, ExciteError, Monitor, Outcome, Quantity, ScaledEvaluation,
    ScaledProblem, Settings, excite,
};
use regen_generated::rps3::Rps3;
use regen_runtime::{Limits, LoopClosure, Model};

/// Settings with few harmonics and samples, and the limits of the chapter's robot.
fn settings() -> Settings {
    let info = Model::<f64>::info(&Rps3);
    let mut settings = Settings {
        harmonics: 4,
        samples: 40,
        starts: 2,
        steps: 4,
        threads: 1,
        ..Settings::of(&info)
    };
    for c in info.independent {
        settings.limits[*c].position = Some([0.45, 0.75]);
        settings.limits[*c].velocity = Some([-0.6, 0.6]);
    }
    settings
}

fn search(settings: &Settings, stop: bool) -> Outcome {
    let stop = AtomicBool::new(stop);
    let watch = Monitor {
        stop: &stop,
        report: &|_| {},
    };
    excite(&Rps3, &Rps3, settings, watch).unwrap()
}

fn found(outcome: Outcome) -> Excitation {
    match outcome {
        Outcome::Found(found) => *found,
        other => panic!("{other:?}"),
    }
}

#[test]
fn gradients_are_the_finite_differences_of_every_criterion_and_limit() {
    for criterion in [
        Criterion::ScaledCondition,
        Criterion::Condition,
        Criterion::Determinant,
        Criterion::SmallestSingular,
    ] {
        let mut settings = Settings {
            criterion,
            samples: 20,
            deviations: vec![1.0, 2.0, 3.0],
            at_rest: criterion == Criterion::Condition,
            ..settings()
        };
        for limits in &mut settings.limits {
            limits.jerk = Some([-3.0, 3.0]);
        }
        let mut problem = ScaledProblem::new(&Rps3, &Rps3, &settings).unwrap();
        let kinds = problem.limits().iter().map(|limit| limit.quantity);
        for quantity in [
            Quantity::Position,
            Quantity::Velocity,
            Quantity::Acceleration,
            Quantity::Jerk,
            Quantity::Effort,
            Quantity::SwingLimit,
            Quantity::Singularity,
        ] {
            assert!(kinds.clone().any(|kind| kind == quantity), "{quantity:?}");
        }
        let mut y = problem.stationary(&[0.6, 0.61, 0.59]);
        for (k, y) in y.iter_mut().enumerate() {
            *y += 0.1 * (1.7 * k as f64).sin();
        }
        let direction: Vec<f64> = (0..y.len()).map(|k| (0.9 * k as f64 + 0.3).sin()).collect();
        // fourth-order differences: the rounding of the closure, times the condition number,
        // divided by h, is smaller than the truncation error of order h^4
        let h = 1e-4;
        let mut at = |part: f64| {
            let moved = y.iter().zip(&direction).map(|(y, d)| y + part * d);
            let moved: Vec<f64> = moved.collect();
            problem.at(&moved, 5.0).unwrap().expect("closed")
        };
        let here = at(0.0);
        let around = [-2.0, -1.0, 1.0, 2.0].map(|part| at(part * h));
        let along = |slope: &[f64]| {
            slope
                .iter()
                .zip(&direction)
                .map(|(s, d)| s * d)
                .sum::<f64>()
        };
        let agree = |exact: f64, of: &dyn Fn(&ScaledEvaluation) -> f64, what: &str| {
            let [a, b, c, d] = around.each_ref().map(of);
            let difference = (a - 8.0 * b + 8.0 * c - d) / (12.0 * h);
            let tolerance = 1e-5 * (1.0 + exact.abs());
            assert!(
                (exact - difference).abs() < tolerance,
                "{criterion:?} {what}: {exact} {difference}"
            );
        };
        agree(
            along(&here.gradient),
            &|evaluation| evaluation.objective,
            "objective",
        );
        let count = problem.limits().len();
        for (k, slope) in here.slopes.iter().enumerate() {
            let what = problem.limits()[k % count].to_string();
            agree(along(slope), &|evaluation| evaluation.values[k], &what);
        }
    }
}

#[test]
fn a_trajectory_respects_every_limit_between_samples_and_starts_at_rest() {
    let settings = Settings {
        at_rest: true,
        ..settings()
    };
    let found = found(search(&settings, false));
    let info = Model::<f64>::info(&Rps3);
    let phi = settings.nominal.clone().unwrap();
    let mut closure = LoopClosure::new(&Rps3).unwrap();
    let (mut nearest, steps) = (f64::INFINITY, 3001_u16);
    let mut inside = |value: f64, range: Option<[f64; 2]>| {
        if let Some([lowest, highest]) = range {
            let margin = (value - lowest).min(highest - value) / (0.5 * (highest - lowest));
            assert!(margin >= 0.0, "{value} {lowest} {highest}");
            nearest = nearest.min(margin);
        }
    };
    for step in 0..steps {
        let time = f64::from(step) / f64::from(steps) / settings.frequency;
        let motion = [0, 1, 2].map(|c| found.series.at(c, time));
        let part = |order: usize| motion.map(|m| m[order]);
        let state = closure
            .track_state(&part(0), &part(1), &part(2))
            .expect("finite");
        assert!(state.outcome.is_closed());
        assert!(state.condition.pivot >= settings.singular_margin);
        if step == 0 {
            assert!(
                part(1)
                    .iter()
                    .chain(&part(2))
                    .all(|rate| rate.abs() < 1e-12)
            );
        }
        let mut tau = [0.0; 3];
        let _condition = Rps3
            .inverse_dynamics(&state.q, &state.qd, &state.qdd, &phi, &mut tau)
            .unwrap();
        let mut cones = [0.0; 3];
        Model::<f64>::cones(&Rps3, &state.q, &mut cones).unwrap();
        for (cosine, greatest) in cones.iter().zip(&settings.cones) {
            assert!(*cosine >= greatest.cos());
        }
        for (c, limits) in settings.limits.iter().enumerate() {
            inside(state.q[c], limits.position);
            inside(state.qd[c], limits.velocity);
            inside(state.qdd[c], limits.acceleration);
            if let Some(k) = info.actuated.iter().position(|a| *a == c) {
                inside(tau[k], limits.effort);
            }
        }
    }
    // the limits are relevant: one of them is nearly reached
    assert!(nearest < 0.05, "{nearest}");
    let stated = found
        .margins
        .iter()
        .map(|m| m.relative_distance)
        .fold(1.0, f64::min);
    assert!(stated >= 0.0 && stated <= nearest);
}

/// The largest jerk of each coordinate at many times, from differences of the accelerations of closed
/// states.
fn jerks(found: &Excitation, frequency: f64) -> Vec<f64> {
    let steps = 2000_u16;
    let h = 1e-4;
    let mut closure = LoopClosure::new(&Rps3).unwrap();
    let mut accelerations = |time: f64| {
        let motion = [0, 1, 2].map(|c| found.series.at(c, time));
        let part = |order: usize| motion.map(|m| m[order]);
        let state = closure.track_state(&part(0), &part(1), &part(2));
        state.expect("finite").qdd
    };
    let mut most = vec![0.0_f64; Model::<f64>::info(&Rps3).coordinates.len()];
    for step in 0..steps {
        let time = f64::from(step) / f64::from(steps) / frequency;
        let [before, after] = [time - h, time + h].map(&mut accelerations);
        for (most, (a, b)) in most.iter_mut().zip(before.iter().zip(&after)) {
            *most = most.max((b - a).abs() / (2.0 * h));
        }
    }
    most
}

#[test]
fn limits_of_jerks_hold_at_all_times_for_coordinates_of_loops_too_and_cost_no_more_than_they_must()
{
    let free = settings();
    let without = jerks(&found(search(&free, false)), free.frequency);
    let mut limited = settings();
    for (limits, most) in limited.limits.iter_mut().zip(&without) {
        limits.jerk = Some([-0.5 * most, 0.5 * most]);
    }
    let found = found(search(&limited, false));
    let mut used = 0.0_f64;
    for (c, (most, before)) in jerks(&found, free.frequency)
        .iter()
        .zip(&without)
        .enumerate()
    {
        let part = most / (0.5 * before);
        // differences of accelerations are off by the square of their step
        assert!(part <= 1.0 + 1e-5, "{c}: {part}");
        used = used.max(part);
        let stated = found.margins.iter().filter(|margin| {
            margin.limit.quantity == Quantity::Jerk && margin.limit.name == info_name(c)
        });
        let stated = stated.map(|margin| margin.relative_distance);
        let least = stated.fold(f64::INFINITY, f64::min);
        assert!(
            least <= 1.0 - part + 1e-5 && least > 0.9 - part,
            "{c}: {least} {part}"
        );
    }
    assert!(used > 0.9, "{used}");
}

fn info_name(coordinate: usize) -> &'static str {
    Model::<f64>::info(&Rps3).coordinates[coordinate]
}

#[test]
fn the_result_is_the_same_on_any_number_of_threads_and_better_than_its_start() {
    let one = settings();
    let two = Settings {
        threads: 2,
        ..settings()
    };
    let searched = found(search(&one, false));
    assert_eq!(searched, found(search(&two, false)));
    let other = Settings {
        seed: 2,
        ..settings()
    };
    assert_ne!(searched.series, found(search(&other, false)).series);
    // if stopped at once, the search returns the first start
    let start = found(search(&one, true));
    let (before, after) = (start.figures, searched.figures);
    assert!(
        after.scaled_condition < 0.5 * before.scaled_condition,
        "{before:?} {after:?}"
    );
}

#[test]
fn a_limit_that_no_motion_respects_is_reported() {
    let mut settings = settings();
    settings.starts = 1;
    let q7 = Model::<f64>::info(&Rps3).index_of("q7").unwrap();
    // the weight of the platform alone is larger
    settings.limits[q7].effort = Some([-5.0, 5.0]);
    match search(&settings, false) {
        Outcome::Infeasible { limit, excess, .. } => {
            assert_eq!(
                (limit.quantity, limit.name.as_str()),
                (Quantity::Effort, "q7")
            );
            assert!(excess > 1.0);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_variable_that_is_not_finite_is_an_error() {
    let settings = settings();
    let mut problem = ScaledProblem::new(&Rps3, &Rps3, &settings).unwrap();
    let good = problem.stationary(&[0.6, 0.61, 0.59]);
    assert!(problem.at(&good, 8.0).is_ok());
    for bad in [f64::NAN, f64::INFINITY] {
        for k in 0..good.len() {
            let mut y = good.clone();
            y[k] = bad;
            assert!(problem.at(&y, 8.0).is_err(), "variable {k} is {bad}");
        }
    }
}

#[test]
fn misuse_is_an_error_that_says_what_to_do() {
    let fails = |settings: &Settings| match ScaledProblem::new(&Rps3, &Rps3, settings) {
        Err(error) => error,
        Ok(_) => panic!("accepted"),
    };
    let mut settings = settings();
    let q2 = Model::<f64>::info(&Rps3).index_of("q2").unwrap();
    settings.limits[q2].position = Some([0.7, 0.5]);
    assert!(matches!(fails(&settings), ExciteError::Range { .. }));
    settings.limits[q2] = Limits::NONE;
    assert!(
        fails(&settings)
            .to_string()
            .contains("coordinate q2 has no range")
    );
    let few = Settings {
        samples: 5,
        ..self::settings()
    };
    assert!(fails(&few).to_string().contains("take more samples"));
    let short = Settings {
        cones: vec![0.5],
        ..self::settings()
    };
    assert!(fails(&short).to_string().contains("`cones` has 1 entries"));
}
