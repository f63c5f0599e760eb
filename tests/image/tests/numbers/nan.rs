//! NaN and infinity as arguments of every generated function: the results must show them.

use crate::robot::{Function, Inputs, Output, functions};
use regen_image::robots::all;
use regen_runtime::function::Argument;

/// The output with another value of one entry of an argument.
fn with(
    function: Function,
    robot: regen_image::robots::Robot<f64>,
    inputs: &Inputs,
    place: (Argument, usize),
    value: f64,
) -> Output {
    let mut changed = inputs.of(place.0).to_vec();
    changed[place.1] = value;
    function.call_with(robot, inputs, place.0, &changed)
}

/// Whether the status says that the results are meaningless.
fn refused(output: &Output) -> bool {
    output
        .pivot
        .is_some_and(|pivot| pivot.is_nan() || pivot < regen_runtime::SINGULAR)
}

/// Sets each entry of each argument of every function to `bad`. Each result that depends on the
/// entry, which two other values of the entry show, must satisfy `ok`, or the status must refuse
/// all results.
fn check(ok: impl Fn(f64, &dyn Fn(f64) -> f64) -> bool, bad: f64) {
    let mut checked = 0;
    for (name, robot) in all() {
        let inputs = Inputs::near_home(robot);
        for function in functions() {
            let plain = function.call(robot, &inputs);
            assert!(
                plain.values.iter().all(|x| x.is_finite()),
                "{name} {}",
                function.name()
            );
            assert!(!refused(&plain), "{name} {}", function.name());
            for argument in function.takes() {
                for k in 0..inputs.of(*argument).len() {
                    let place = (*argument, k);
                    let at = |value| with(function, robot, &inputs, place, value);
                    let altered = at(bad);
                    let old = inputs.of(*argument)[k];
                    let moved = [at(old + 0.37), at(-1.9 * old - 0.01)];
                    for (i, before) in plain.values.iter().enumerate() {
                        // by more than rounding
                        let differs = |other: &Output| {
                            (other.values[i] - before).abs() > 1e-9 * (1.0 + before.abs())
                        };
                        if !moved.iter().any(differs) {
                            continue;
                        }
                        checked += 1;
                        let is_shown = refused(&altered)
                            || ok(altered.values[i], &|value| at(value).values[i]);
                        assert!(
                            is_shown,
                            "{name}: {}, {argument:?}[{k}] = {bad}: entry {i} is {}, pivot {:?}",
                            function.name(),
                            altered.values[i],
                            altered.pivot
                        );
                    }
                }
            }
        }
    }
    // so many only if all robots, functions and arguments take part
    assert!(checked > 20_000, "{checked}");
}

#[test]
fn nan_is_passed_on_or_refused_by_every_function_of_every_robot() {
    check(|value, _| value.is_nan(), f64::NAN);
}

/// A result that is bounded in an argument, such as Coulomb friction, may be its limit.
#[test]
fn infinity_gives_no_finite_number_except_a_limit() {
    for bad in [f64::INFINITY, f64::NEG_INFINITY] {
        let ok = |value: f64, at: &dyn Fn(f64) -> f64| {
            let limit = |size: f64| at(size.copysign(bad)).to_bits();
            !value.is_finite() || [1e30, 1e60].iter().all(|x| limit(*x) == value.to_bits())
        };
        check(ok, bad);
    }
}

#[test]
fn a_condition_refuses_every_coordinate_and_derivative_that_is_not_finite() {
    let mut checked = 0;
    for (name, robot) in all() {
        let inputs = Inputs::near_home(robot);
        for function in functions() {
            if function.call(robot, &inputs).pivot.is_none() {
                continue;
            }
            let motion = function.takes().iter();
            for argument in motion.filter(|argument| argument.name().starts_with('q')) {
                for k in 0..inputs.of(*argument).len() {
                    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                        let altered = with(function, robot, &inputs, (*argument, k), bad);
                        assert!(
                            refused(&altered),
                            "{name}: {}, {argument:?}[{k}] = {bad}: pivot {:?}",
                            function.name(),
                            altered.pivot
                        );
                        checked += 1;
                    }
                }
            }
        }
    }
    assert!(checked > 3_000, "{checked}");
}
