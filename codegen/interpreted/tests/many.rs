//! The results at one state, and at many states at once, have the same bits as those of the
//! interpreter of programs.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use regen_batch::{PredictedClosure, TrajectoryClosure};
use regen_codegen::diag::Source;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_codegen::{Mechanism, interpret};
use regen_interpreted::Interpreted;
use regen_runtime::function::{Argument, Signature, Sizes};
use regen_runtime::{
    Arguments, BaseFunction, BaseModel, Condition, ControlFunction, ControlModel, Function,
    LoopClosure, ManyStates, Model, SizeError,
};

/// Numbers from -4 to 4, with zeros among them, for the signs of velocities.
fn random(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    let bits = *seed >> 33;
    if bits.is_multiple_of(17) {
        return 0.0;
    }
    (bits as f64 / 2_f64.powi(31) - 0.5) * 8.0
}

/// A function at one state by the interpreter of programs and by the model, and at many.
type One<'a> = &'a dyn Fn(Arguments<'_, f64>, &mut [f64]) -> Result<Condition<f64>, SizeError>;
type Many<'a> =
    &'a dyn Fn(usize, Arguments<'_, f64>, &mut [f64], &mut [f64]) -> Result<(), SizeError>;

/// Compares a function at `count` random states, the first of which are at home.
fn compare(
    robot: &Robot,
    sizes: &Sizes,
    home: &[f64],
    signature: &Signature,
    count: usize,
    one: One<'_>,
    many: Many<'_>,
) {
    let program = robot
        .functions
        .iter()
        .find(|f| f.kind.name() == signature.name);
    let program = program.map(|f| &f.program);
    let mut seed = 7;
    let mut values: Vec<(Argument, Vec<f64>)> = Vec::new();
    for argument in signature.arguments {
        let states = if argument.is_parameter() { 1 } else { count };
        let length = sizes.length(argument.size());
        let mut series: Vec<f64> = (0..length * states).map(|_| random(&mut seed)).collect();
        if *argument == Argument::Q {
            for (series, home) in series.chunks_mut(count.max(1)).zip(home) {
                series.iter_mut().take(3).for_each(|q| *q = *home);
            }
        }
        values.push((*argument, series));
    }
    let given = |rows: &[(Argument, Vec<f64>)]| -> Vec<f64> {
        rows.iter().flat_map(|r| r.1.clone()).collect()
    };
    let output = sizes.output(signature);
    let (mut out, mut pivots) = (vec![7.0; output * count], vec![7.0; count]);
    let all = values
        .iter()
        .fold(Arguments::EMPTY, |all, (a, v)| all.with(*a, v));
    many(count, all, &mut out, &mut pivots).unwrap();
    for (state, pivot_of_many) in pivots.iter().enumerate() {
        let at: Vec<(Argument, Vec<f64>)> = values
            .iter()
            .map(|(a, v)| {
                let own = if a.is_parameter() {
                    v.clone()
                } else {
                    v.iter().skip(state).step_by(count).copied().collect()
                };
                (*a, own)
            })
            .collect();
        let arguments = at
            .iter()
            .fold(Arguments::EMPTY, |all, (a, v)| all.with(*a, v));
        let mut own = vec![0.0; output];
        let condition = one(arguments, &mut own).unwrap();
        let (expected, pivot) = match program {
            Some(program) if output > 0 => {
                let inputs: Vec<&[f64]> = at.iter().map(|(_, v)| v.as_slice()).collect();
                interpret::run(program, &inputs)
            }
            _ => (own.clone(), 1.0),
        };
        let bits = |x: f64| if x.is_nan() { 0 } else { x.to_bits() };
        assert_eq!(
            own.iter().map(|x| bits(*x)).collect::<Vec<_>>(),
            expected.iter().map(|x| bits(*x)).collect::<Vec<_>>(),
        );
        assert_eq!(bits(condition.pivot), bits(pivot));
        let found: Vec<u64> = out
            .iter()
            .skip(state)
            .step_by(count)
            .map(|x| x.to_bits())
            .collect();
        let same = found.iter().zip(&expected).all(|(found, x)| {
            *found == x.to_bits() || x.is_nan() && f64::from_bits(*found).is_nan()
        });
        assert!(
            same,
            "{} at state {state} of {count}: {:?}",
            signature.name,
            given(&at)
        );
        let pivot = *pivot_of_many;
        assert!(
            pivot.to_bits() == condition.pivot.to_bits()
                || pivot.is_nan() && condition.pivot.is_nan(),
            "{} at state {state} of {count}: pivot {pivot:e}, not {:e}",
            signature.name,
            condition.pivot,
        );
    }
}

fn check(text: &str) {
    let mechanism = Mechanism::open(&Source::new("robot.yaml", text)).unwrap();
    let robot = mechanism.robot(&FunctionKind::ALL).unwrap();
    let model = Interpreted::new(&robot);
    let base = model.base_info();
    let mut sizes = Sizes::of(&model.info());
    (sizes.base, sizes.free) = (model.rank(), base.free.len());
    let home = Model::<f64>::info(&model).home;
    // one state, less than a register, and blocks with a rest
    for count in [1, 3, 37, 96] {
        for function in Function::ALL {
            compare(
                &robot,
                &sizes,
                home,
                function.signature(),
                count,
                &|arguments, out| Model::eval(&model, function, arguments, out),
                &|count, arguments, out, pivots| {
                    model.eval_many(function, count, arguments, out, pivots)
                },
            );
        }
        for function in ControlFunction::ALL {
            compare(
                &robot,
                &sizes,
                home,
                function.signature(),
                count,
                &|arguments, out| model.eval_control(function, arguments, out),
                &|count, arguments, out, pivots| {
                    model.eval_control_many(function, count, arguments, out, pivots)
                },
            );
        }
        for function in BaseFunction::ALL {
            compare(
                &robot,
                &sizes,
                home,
                function.signature(),
                count,
                &|arguments, out| model.eval_base(function, arguments, out),
                &|count, arguments, out, pivots| {
                    model.eval_base_many(function, count, arguments, out, pivots)
                },
            );
        }
    }
}

#[test]
fn an_arm_at_many_states_has_the_bits_of_single_states() {
    check(include_str!("../../../robots/puma560.yaml"));
}

#[test]
fn a_parallel_robot_with_friction_at_many_states_has_the_bits_of_single_states() {
    check(include_str!("../../../robots/3rps_friction.yaml"));
}

/// Each direction has a friction of its own, and at rest there is none.
#[test]
fn an_arm_with_friction_of_either_direction_at_many_states_has_the_bits_of_single_states() {
    check(
        "\
name: arm
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, friction: asymmetric}
",
    );
}

/// Random states far from closed ones make some of the fixed pivots too small.
#[test]
fn a_closed_loop_solved_by_other_pivots_has_the_bits_of_single_states() {
    check(include_str!("../../../robots/fivebar.yaml"));
}

/// Compares a trajectory that is closed in blocks with one that is closed state by state: sines of
/// this size about home, with a jump and, if it is large, states that cannot be closed.
fn compare_closure(text: &str, size: f64) -> (usize, usize) {
    let mechanism = Mechanism::open(&Source::new("robot.yaml", text)).unwrap();
    let robot = mechanism.robot(&FunctionKind::ALL).unwrap();
    let model = Interpreted::new(&robot);
    let info = Model::<f64>::info(&model);
    let (n, dof, count) = (info.coordinates.len(), info.dof(), 400);
    let mut parts = [(); 3].map(|()| vec![0.0; dof * count]);
    for (i, c) in info.independent.iter().enumerate() {
        for k in 0..count {
            let t = if k < 250 {
                0.01 * k as f64
            } else {
                0.01 * k as f64 + 0.3
            };
            let speed = 2.0 + i as f64;
            let at = i * count + k;
            parts[0][at] = info.home[*c] + size * (speed * t).sin();
            parts[1][at] = size * speed * (speed * t).cos();
            parts[2][at] = -size * speed * speed * (speed * t).sin();
        }
    }
    let mut blocks = TrajectoryClosure::new(&model).unwrap();
    // in calls of different lengths, which must go on where the last one ended
    let mut states: Vec<Vec<Vec<f64>>> = Vec::new();
    let mut outcomes = Vec::new();
    for (first, end) in [(0, 1), (1, 150), (150, count)] {
        let part = |all: &Vec<f64>| -> Vec<f64> {
            all.chunks(count)
                .flat_map(|series| series[first..end].to_vec())
                .collect()
        };
        let [q, qd, qdd] = parts.each_ref().map(part);
        let found = blocks.track(end - first, &q, &qd, &qdd).unwrap();
        for k in 0..end - first {
            let rows = [&found.q, &found.qd, &found.qdd];
            states.push(rows.map(|series| found.at(series, k).collect()).to_vec());
        }
        outcomes.extend(found.outcomes);
    }
    let mut one = LoopClosure::new(&model).unwrap();
    let (mut closed, mut open) = (0, 0);
    for k in 0..count {
        let at =
            |part: usize| -> Vec<f64> { (0..dof).map(|i| parts[part][i * count + k]).collect() };
        let state = one.track_state(&at(0), &at(1), &at(2)).unwrap();
        assert_eq!(
            state.outcome.is_closed(),
            outcomes[k].is_closed(),
            "state {k}"
        );
        if !state.outcome.is_closed() {
            open += 1;
            continue;
        }
        closed += 1;
        for (found, expected) in states[k].iter().zip([&state.q, &state.qd, &state.qdd]) {
            let largest = expected.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            for c in 0..n {
                let error = (found[c] - expected[c]).abs() / largest;
                // rounding errors, amplified near singularities
                let bound = 1e-13 / state.condition.pivot.powi(3).min(1.0);
                assert!(error <= bound, "state {k}, coordinate {c}: {error:e}");
            }
        }
    }
    (closed, open)
}

#[test]
fn a_trajectory_closed_in_blocks_is_that_closed_state_by_state() {
    for text in [
        include_str!("../../../robots/3rps_friction.yaml"),
        include_str!("../../../robots/delta.yaml"),
        include_str!("../../../robots/fourbar.yaml"),
        include_str!("../../../robots/puma560.yaml"),
    ] {
        let (closed, _) = compare_closure(text, 0.1);
        assert_eq!(closed, 400);
    }
}

#[test]
fn a_trajectory_that_leaves_the_workspace_ends_in_blocks_where_it_ends_state_by_state() {
    let (closed, open) = compare_closure(include_str!("../../../robots/delta.yaml"), 1.5);
    assert!(closed > 50 && open > 50, "{closed} closed, {open} open");
}

/// Closes states along a motion from predictions, good, poor and missing ones, and compares them
/// with those of `LoopClosure`; returns how many were closed and how many not.
fn compare_predicted(text: &str, size: f64) -> (usize, usize) {
    let mechanism = Mechanism::open(&Source::new("robot.yaml", text)).unwrap();
    let robot = mechanism.robot(&FunctionKind::ALL).unwrap();
    let model = Interpreted::new(&robot);
    let info = Model::<f64>::info(&model);
    let mut predicted = PredictedClosure::new(&model).unwrap();
    let mut one = LoopClosure::new(&model).unwrap();
    let (mut closed, mut open, mut seed) = (0, 0, 11);
    for k in 0..400_u32 {
        let t = 0.01 * f64::from(k);
        let of = |(i, c): (usize, &usize)| info.home[*c] + size * ((2.0 + i as f64) * t).sin();
        let q_i: Vec<f64> = info.independent.iter().enumerate().map(of).collect();
        let expected = one.track(&q_i).unwrap();
        // near the solution, off by up to 0.2, and none
        let guess: Vec<f64> = (info.dependent.iter())
            .map(|c| match k % 4 {
                0 | 1 => expected.q[*c] + 1e-4 * random(&mut seed),
                2 => expected.q[*c] + 0.05 * random(&mut seed),
                _ => f64::NAN,
            })
            .collect();
        let outcome = predicted.close(&q_i, &guess).unwrap();
        assert_eq!(
            outcome.is_closed(),
            expected.outcome.is_closed(),
            "state {k}"
        );
        if !outcome.is_closed() {
            open += 1;
            continue;
        }
        closed += 1;
        let bound = 1e-13 / expected.condition.pivot.powi(3).min(1.0);
        for (found, expected) in predicted.q().iter().zip(&expected.q) {
            let error = (found - expected).abs() / expected.abs().max(1.0);
            assert!(error <= bound, "state {k}: {error:e}");
        }
        let mut f = vec![0.0; info.rows];
        model.constraints(predicted.q(), &mut f).unwrap();
        let residual = f.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!((residual - predicted.residual()).abs() < 1e-15, "state {k}");
    }
    (closed, open)
}

#[test]
fn a_state_closed_from_a_prediction_is_that_on_the_branch() {
    for text in [
        include_str!("../../../robots/3rps.yaml"),
        include_str!("../../../robots/fourbar.yaml"),
        include_str!("../../../robots/puma560.yaml"),
    ] {
        assert_eq!(compare_predicted(text, 0.1), (400, 0));
    }
    let (closed, open) = compare_predicted(include_str!("../../../robots/delta.yaml"), 1.5);
    assert!(closed > 50 && open > 50, "{closed} closed, {open} open");
}
