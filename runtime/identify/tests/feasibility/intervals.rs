//! Confidence intervals of estimates under constraints contain the estimated value.

use regen_identify::estimate::{Deviations, Estimate, QrFactor};
use regen_identify::feasibility::{Options, identify};
use regen_identify::friction::{FrictionData, FrictionFit, FrictionIntervals, fit, intervals};
use regen_identify::intervals::{Constrained, LeastSquares, constrained};
use regen_runtime::Friction;

use crate::friction::{plain, simulate, simulate_for};
use crate::optimum::Random;
use crate::robots::Robot;

/// Pseudo-random noise, the same on every machine.
fn noise(t: usize) -> f64 {
    (12.9898 * (t * t) as f64).sin()
}

/// Observations of a robot's base parameters with noise of this size.
fn factor(robot: &Robot, size: f64) -> QrFactor {
    let noisy = |t: usize| size * noise(5 * t + 3);
    observed(robot, &noisy)
}

/// Observations with this noise of each row.
fn observed(robot: &Robot, of_row: &dyn Fn(usize) -> f64) -> QrFactor {
    let labels = robot.combinations.labels();
    let (n, rows) = (labels.len(), 200);
    let w: Vec<f64> = (0..n * rows)
        .map(|k| noise(k + 7) + 0.3 * noise(3 * k + 1))
        .collect();
    let beta = robot.beta();
    let tau: Vec<f64> = (0..rows)
        .map(|t| {
            let exact: f64 = (0..n).map(|j| w[j * rows + t] * beta[j]).sum();
            exact + of_row(t)
        })
        .collect();
    let mut factor = QrFactor::new(labels.to_vec());
    factor.push_block(&w, &tau).unwrap();
    factor
}

fn fitted(robot: &Robot, factor: &QrFactor, draws: usize) -> (Estimate, Constrained) {
    let options = Options::default();
    let fit = identify(factor, &robot.combinations, &robot.layout, &options).unwrap();
    let estimate = Estimate::of(factor).unwrap();
    let deviations = Deviations::white(&estimate);
    let data = LeastSquares {
        factor,
        values: &estimate.values,
        deviations: &deviations,
    };
    let adopted = (fit.phi.as_slice(), fit.beta.as_slice());
    let mut reported = 0;
    let found = constrained(
        data,
        &robot.combinations,
        &robot.layout,
        &options,
        adopted,
        draws,
        &mut |done| reported = done,
    )
    .unwrap();
    assert_eq!((reported, found.failed), (draws, 0));
    (estimate, found)
}

/// If no constraint is active, a physical fit is the least-squares fit, with the same uncertainty.
#[test]
fn without_active_constraints_intervals_are_those_of_least_squares() {
    let robot = plain();
    let (estimate, found) = fitted(&robot, &factor(&robot, 1e-4), 400);
    for (k, spread) in found.base.iter().enumerate() {
        let (low, high) = spread.interval(0.95);
        let half = estimate.half_width(k, 0.95);
        // with four hundred draws, the ends of an interval are accurate to 10 %
        for (end, exact) in [(low, spread.value - half), (high, spread.value + half)] {
            assert!((end - exact).abs() < 0.25 * half, "{k}: {end} {exact}");
        }
        let ratio = spread.sigma / estimate.sigma(k);
        assert!((0.85..1.15).contains(&ratio), "{k}: {ratio}");
    }
    // all parameters are observed here
    assert!(found.physical.iter().all(Option::is_some));
}

/// The noise moves the least-squares parameters outside of the physical set.
#[test]
fn intervals_at_constraints_contain_the_value_and_satisfy_them() {
    let mut robot = plain();
    // no friction
    robot.phi[10] = 0.0;
    let (_, found) = fitted(&robot, &factor(&robot, 0.5), 40);
    for spread in found.base.iter().chain(found.physical.iter().flatten()) {
        let (low, high) = spread.interval(0.95);
        assert!(low <= spread.value && spread.value <= high);
        assert!(low < high);
    }
    let friction = found.physical[10].as_ref().unwrap();
    let (low, high) = friction.interval(0.95);
    assert!(low > -1e-9 && high > 0.01, "{low} {high}");
}

/// How many of these logs have an interval that contains the moments of inertia of a body with these,
/// and the mean length of the intervals relative to those of least squares.
fn held(moment: f64, logs: u64) -> (usize, f64) {
    let mut robot = plain();
    robot.phi[..9].fill(0.0);
    for k in [0, 3, 5] {
        robot.phi[k] = moment;
    }
    let (mut held, mut lengths) = (0, 0.0);
    for seed in 0..logs {
        let noise = std::cell::RefCell::new(Random(900 + seed));
        let data = observed(&robot, &|_| 1.5 * noise.borrow_mut().signed());
        let (estimate, found) = fitted(&robot, &data, 40);
        for k in [0, 3, 5] {
            let (low, high) = found.base[k].interval(0.95);
            held += usize::from(low <= moment && moment <= high);
            lengths += (high - low) / (2.0 * estimate.half_width(k, 0.95));
            let own = found.physical[k].as_ref().unwrap().interval(0.95);
            assert!(low >= 0.0 && own.0 >= 0.0);
            assert!((own.1 - high).abs() < 1e-12, "{own:?} {high}");
        }
    }
    (held, lengths / (3 * logs) as f64)
}

#[test]
fn moments_of_inertia_near_their_bound_are_as_often_in_their_intervals_as_others() {
    let (near, short) = held(0.01, 24);
    let (far, length) = held(3.0, 24);
    println!("near {near} {short}, far {far} {length}");
    assert!(near >= 66 && far >= 66, "of 72: {near} {far}");
    // no more than least squares, of which the bound cuts a part
    assert!(
        short < 0.9 && (0.9..1.2).contains(&length),
        "{short} {length}"
    );
}

#[test]
fn a_parameter_that_is_chosen_freely_has_no_interval() {
    let mut robot = plain();
    let kept: Vec<usize> = (0..11).filter(|k| *k != 3).collect();
    robot.combinations = robot.combinations.select(&kept).unwrap();
    let (_, found) = fitted(&robot, &factor(&robot, 1e-3), 4);
    for (k, spread) in found.physical.iter().enumerate() {
        assert_eq!(spread.is_some(), k != 3);
    }
}

/// The fit of data with nonlinear friction, and its intervals.
fn of_friction(robot: &Robot, data: &FrictionData) -> (FrictionFit, FrictionIntervals) {
    let options = Options::default();
    let (combinations, layout) = (&robot.combinations, &robot.layout);
    let best = fit(data, combinations, layout, &options).unwrap();
    let found = intervals(data, combinations, layout, &options, &best, 60, &mut |_| {}).unwrap();
    (best, found)
}

#[test]
fn nonlinear_friction_has_intervals_at_its_optimum() {
    let robot = plain();
    let stribeck: &[f64] = &[2.0, 3.5, 0.12, 1.3, 1.1];
    let power: &[f64] = &[1.5, 0.9, 2.2, 0.6];
    let laws = [(Friction::Stribeck, stribeck), (Friction::Power, power)];
    let data = simulate(&robot, &laws, 0.05);
    let (best, found) = of_friction(&robot, &data);
    assert_eq!(found.failed, 0);
    let mut covered = 0;
    let joints = found.joints.iter().zip(&best.joints).zip(laws);
    for ((spreads, joint), (_, truth)) in joints {
        for ((spread, value), truth) in spreads.iter().zip(&joint.values).zip(truth) {
            let spread = spread.as_ref().unwrap();
            let (low, high) = spread.interval(0.95);
            assert!(low <= *value && *value <= high && spread.sigma > 0.0);
            assert!(spread.sigma < 0.3 * value.abs(), "{spread:?}");
            covered += usize::from(low <= *truth && *truth <= high);
        }
    }
    // by chance, at most one of the nine intervals may miss its value
    assert!(covered >= 8, "{covered}");
    for (spread, value) in found.base.iter().zip(&best.beta) {
        let (low, high) = spread.interval(0.95);
        assert!(low <= *value && *value <= high);
    }
}

/// With few slow samples, a high and narrow peak of static friction explains the efforts as well as a low and wide one.
#[test]
fn intervals_of_friction_hold_the_truth_where_few_samples_are_slow() {
    let robot = plain();
    let stribeck: &[f64] = &[2.0, 3.5, 0.06, 2.0, 1.1];
    let laws = [(Friction::Stribeck, stribeck)];
    let (mut held, mut count) = (0, 0);
    for seed in 0..8 {
        let data = simulate_for(&[Friction::Stribeck], &robot, &laws, 0.3, seed);
        let (_, found) = of_friction(&robot, &data);
        for (spread, truth) in found.joints[0].iter().zip(stribeck) {
            let Some(spread) = spread else {
                continue;
            };
            let (low, high) = spread.interval(0.95);
            held += usize::from(low <= *truth && *truth <= high);
            count += 1;
        }
    }
    println!("{held} of {count}");
    assert!(count >= 32 && 10 * held >= 9 * count, "{held} of {count}");
}
