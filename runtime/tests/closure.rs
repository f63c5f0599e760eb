//! Tests of the loop closure on mechanisms whose branches and singularities are known in closed
//! form.

#![cfg(feature = "closure")]
#![allow(clippy::unwrap_used, clippy::float_cmp, unreachable_pub)]
#![allow(clippy::doc_markdown, reason = "formulas")]

use core::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;
use regen_runtime::{ClosureError, LoopClosure, Model, Outcome, SizeError};

use crate::four_bars::{FourBars, Loop};
use crate::pendulum::Pendulum;
use crate::slider_crank::SliderCrank;

/// The state of a slider-crank in closed form; `elbow` is the sign of the rod's cosine.
fn exact(model: &SliderCrank, angle: f64, elbow: f64) -> [f64; 3] {
    let sine = (model.offset - model.crank * angle.sin()) / model.rod;
    let rod = if elbow > 0.0 {
        sine.asin()
    } else {
        PI - sine.asin()
    };
    let slider = model.crank * angle.cos() + model.rod * rod.cos();
    [angle, rod - angle, slider]
}

fn slider_crank(crank: f64, rod: f64, offset: f64, angle: f64, elbow: f64) -> SliderCrank {
    let mut model = SliderCrank {
        crank,
        rod,
        offset,
        home: [0.0; 3],
    };
    model.home = exact(&model, angle, elbow);
    model
}

fn turns(x: f64) -> f64 {
    let whole = (x / (2.0 * PI)).round();
    x - whole * 2.0 * PI
}

fn assert_at(q: &[f64], expected: &[f64; 3], bound: f64) {
    // the rod's angle may differ by whole turns
    let differences = [
        q[0] - expected[0],
        turns(q[1] - expected[1]),
        q[2] - expected[2],
    ];
    for difference in differences {
        assert!(difference.abs() < bound, "{q:?} is not {expected:?}");
    }
}

/// A parallelogram: flat at input angle 0, where its branches cross.
const PARALLELOGRAM: Loop = Loop {
    input: 1.0,
    coupler: 2.0,
    follower: 1.0,
    ground: 2.0,
};

proptest! {
    #[test]
    fn both_branches_are_followed_over_any_path(
        offset in -0.5..0.5_f64,
        start in -3.0..3.0_f64,
        target in -30.0..30.0_f64,
        elbow in prop::sample::select(vec![-1.0, 1.0]),
    ) {
        let model = slider_crank(1.0, 1.6, offset, start, elbow);
        let mut closure = LoopClosure::new(&model).unwrap();
        let solution = closure.solve(&[target]).unwrap();
        prop_assert_eq!(solution.outcome, Outcome::Closed);
        prop_assert!(solution.residual < 1e-13 * (1.0 + target.abs()), "{:e}", solution.residual);
        assert_at(&solution.q, &exact(&model, target, elbow), 1e-12);
        // continuous along the path: the rod makes no whole turn, because it turns relative to the
        // crank by as much as the crank turns
        let (rod, at_home) = (solution.q[0] + solution.q[1], model.home[0] + model.home[1]);
        prop_assert!((rod - at_home).abs() < PI);
    }

    #[test]
    fn a_crank_longer_than_the_rod_stops_at_the_fold(
        rod in 0.3..0.95_f64,
        start in -0.9..0.9_f64,
        target in -6.0..6.0_f64,
        elbow in prop::sample::select(vec![-1.0, 1.0]),
    ) {
        // a fold: the rod is perpendicular to the slider at sin(angle) = +-rod
        let fold = rod.asin();
        let model = slider_crank(1.0, rod, 0.0, start * fold, elbow);
        let mut closure = LoopClosure::new(&model).unwrap();
        let solution = closure.solve(&[target]).unwrap();
        if target.abs() < fold - 1e-9 {
            prop_assert_eq!(solution.outcome, Outcome::Closed);
            assert_at(&solution.q, &exact(&model, target, elbow), 1e-6);
        } else if target.abs() > fold + 1e-9 {
            let expected = (fold - start * fold * target.signum()) / (target - start * fold).abs();
            match solution.outcome {
                Outcome::Singular { at, condition } => {
                    prop_assert!((at - expected).abs() < 1e-10, "{} {}", at, expected);
                    prop_assert!(condition.pivot < 1e-4);
                }
                other => prop_assert!(false, "{}", other),
            }
            // the last state is closed and on the branch
            assert_at(&solution.q, &exact(&model, solution.q[0], elbow), 1e-5);
        }
    }

    #[test]
    fn tracking_gives_the_states_of_solving(angles in prop::collection::vec(-4.0..4.0_f64, 1..20)) {
        let model = slider_crank(1.0, 1.6, 0.3, 0.4, -1.0);
        let (mut tracked, mut solved) = (LoopClosure::new(&model).unwrap(), LoopClosure::new(&model).unwrap());
        for angle in angles {
            let (a, b) = (tracked.track(&[angle]).unwrap(), solved.solve(&[angle]).unwrap());
            prop_assert_eq!(a.outcome, Outcome::Closed);
            for (a, b) in a.q.iter().zip(&b.q) {
                prop_assert!((a - b).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn rates_are_those_of_the_closed_form(angle in -3.0..3.0_f64, qd in -2.0..2.0_f64, qdd in -2.0..2.0_f64) {
        let model = slider_crank(1.0, 1.6, 0.3, 0.4, 1.0);
        let state = LoopClosure::new(&model).unwrap().solve_state(&[angle], &[qd], &[qdd]).unwrap();
        let h = 1e-4;
        let [before, now, after] = [-h, 0.0, h].map(|t| {
            exact(&model, angle + t * qd + 0.5 * t * t * qdd, 1.0)
        });
        for k in 0..3 {
            let first = (after[k] - before[k]) / (2.0 * h);
            let second = (after[k] - 2.0 * now[k] + before[k]) / (h * h);
            prop_assert!((state.qd[k] - first).abs() < 1e-5, "{} {}", state.qd[k], first);
            prop_assert!((state.qdd[k] - second).abs() < 1e-4, "{} {}", state.qdd[k], second);
        }
    }

    #[test]
    fn a_crossing_of_branches_is_never_passed(
        start in 0.2..2.9_f64,
        target in -2.9..-0.1_f64,
        loops in 1..3_usize,
        crossed: bool,
    ) {
        // with two equal loops the determinant touches zero and keeps its sign
        let flat = if crossed {
            // The antiparallelogram: the follower mirrored on the diagonal.
            let diagonal = (-start.sin()).atan2(2.0 - start.cos());
            let follower = 2.0 * diagonal - start;
            let coupler = (follower.sin() - start.sin()).atan2(2.0 + follower.cos() - start.cos());
            [coupler - start, follower]
        } else {
            [-start, start]
        };
        let mut home = vec![start];
        for _ in 0..loops {
            home.extend(flat);
        }
        let model = FourBars { loops: vec![PARALLELOGRAM; loops], home };
        let mut closure = LoopClosure::new(&model).unwrap();
        prop_assert_eq!((closure.home().outcome, closure.home().steps), (Outcome::Closed, 0));
        let solution = closure.solve(&[target]).unwrap();
        match solution.outcome {
            Outcome::Singular { at, .. } => {
                prop_assert!((at - start / (start - target)).abs() < 1e-3, "{}", at);
            }
            other => prop_assert!(false, "{}", other),
        }
    }

    #[test]
    fn a_four_bar_goes_round_with_its_branch(target in -20.0..20.0_f64, up: bool) {
        // Grashof's condition: the input is the shortest bar and turns fully; each branch is a
        // circle
        let bars = Loop { input: 0.5, coupler: 1.5, follower: 1.2, ground: 1.4 };
        let guess = if up { vec![0.0, 0.8, 1.8] } else { vec![0.0, -0.8, -1.8] };
        let model = FourBars { loops: vec![bars], home: guess };
        let mut closure = LoopClosure::new(&model).unwrap();
        prop_assert_eq!(closure.home().outcome, Outcome::Closed);
        let solution = closure.solve(&[target]).unwrap();
        prop_assert_eq!(solution.outcome, Outcome::Closed);
        // the elbow of coupler and follower stays on the same side
        let elbow = (solution.q[0] + solution.q[1] - solution.q[2]).sin();
        prop_assert_eq!(elbow < 0.0, up);
        prop_assert!(solution.residual < 1e-13);
    }
}

#[test]
fn home_is_closed_from_a_rough_guess() {
    let model = SliderCrank {
        home: [0.7, -1.5, 2.0],
        ..SliderCrank::default()
    };
    let closure = LoopClosure::new(&model).unwrap();
    assert_eq!(closure.home().outcome, Outcome::Closed);
    assert_at(&closure.home().q, &exact(&model, 0.7, 1.0), 1e-14);
}

#[test]
fn a_home_out_of_reach_is_not_closed_and_nothing_is_solved_from_it() {
    let model = SliderCrank {
        crank: 3.0,
        rod: 1.0,
        offset: 0.0,
        home: [FRAC_PI_2, 0.1, 0.5],
    };
    let mut closure = LoopClosure::new(&model).unwrap();
    assert!(
        matches!(closure.home().outcome, Outcome::NotClosed { at, residual } if at == 0.0 && residual > 0.5)
    );
    let state = closure.solve_state(&[0.1], &[1.0], &[0.0]).unwrap();
    assert!(matches!(state.outcome, Outcome::NotClosed { .. }));
    assert!(state.qd.iter().chain(&state.qdd).all(|x| x.is_nan()));
}

#[test]
fn a_singular_home_is_singular() {
    // the rod is perpendicular to the slider's axis: the slider may move to either side
    let model = SliderCrank {
        crank: 1.0,
        rod: 1.0,
        offset: 2.0,
        home: [FRAC_PI_2, 0.0, 0.0],
    };
    let closure = LoopClosure::new(&model).unwrap();
    assert!(matches!(closure.home().outcome, Outcome::Singular { .. }));
}

#[test]
fn a_target_at_the_fold_is_singular() {
    let model = slider_crank(1.0, 0.5, 0.0, 0.1, 1.0);
    let solution = LoopClosure::new(&model)
        .unwrap()
        .solve(&[PI / 6.0])
        .unwrap();
    assert!(matches!(solution.outcome, Outcome::Singular { at, .. } if at > 1.0 - 1e-9));
}

#[test]
fn small_mechanisms_are_closed_as_tightly_as_large_ones() {
    for size in [1e-3, 1.0, 1e3] {
        let model = slider_crank(size, 1.6 * size, 0.2 * size, 0.3, -1.0);
        let solution = LoopClosure::new(&model).unwrap().solve(&[2.5]).unwrap();
        assert_eq!(solution.outcome, Outcome::Closed);
        assert!(solution.residual <= 4.0 * f64::EPSILON * size.max(1e-3));
        assert_at(
            &solution.q,
            &exact(&model, 2.5, -1.0),
            1e-14 * size.max(1.0),
        );
    }
}

#[test]
fn a_failed_track_leaves_the_last_solution() {
    let model = slider_crank(1.0, 0.5, 0.0, 0.1, 1.0);
    let mut closure = LoopClosure::new(&model).unwrap();
    let before = closure.track(&[0.3]).unwrap();
    assert!(!closure.track(&[1.5]).unwrap().outcome.is_closed());
    let after = closure.track(&[0.3]).unwrap();
    assert_eq!(after.outcome, Outcome::Closed);
    assert!((after.q[2] - before.q[2]).abs() < 1e-15);
    closure.restart();
    let back = closure.track(&[0.1]).unwrap();
    assert_eq!(back.outcome, Outcome::Closed);
    assert!((back.q[2] - closure.home().q[2]).abs() < 1e-15);
}

#[test]
fn a_mechanism_without_loops_is_always_closed() {
    let model = Pendulum;
    let mut closure = LoopClosure::new(&model as &dyn Model).unwrap();
    let state = closure.solve_state(&[7.0], &[2.0], &[3.0]).unwrap();
    assert_eq!(state.outcome, Outcome::Closed);
    assert_eq!((state.q[0], state.qd[0], state.qdd[0]), (7.0, 2.0, 3.0));
    assert_eq!((state.residual, state.condition.pivot), (0.0, 1.0));
}

#[test]
fn misuse_is_an_error_that_names_the_argument() {
    let model = SliderCrank::default();
    let mut closure = LoopClosure::new(&model).unwrap();
    let size = SizeError {
        argument: "q_i",
        expected: 1,
        got: 2,
    };
    assert_eq!(closure.solve(&[0.0, 1.0]), Err(ClosureError::Size(size)));
    let not_finite = ClosureError::NotFinite {
        argument: "qdd_i",
        index: 0,
    };
    assert_eq!(
        closure.solve_state(&[0.0], &[0.0], &[f64::NAN]),
        Err(not_finite)
    );
    let short = FourBars {
        loops: vec![PARALLELOGRAM],
        home: vec![0.0; 2],
    };
    let size = SizeError {
        argument: "home",
        expected: 3,
        got: 2,
    };
    assert_eq!(
        LoopClosure::new(&short).err(),
        Some(ClosureError::Size(size))
    );
}
