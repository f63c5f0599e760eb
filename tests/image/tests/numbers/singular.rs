//! At a singularity and on both sides of it: a status comes before the numbers are wrong.
//!
//! Each robot with loops is led into a singularity of A_e, and then through it along the curve of
//! closed states, on which one of the independent coordinates turns back. What its functions say
//! on the way is compared with the same functions at the same independent coordinates in 32
//! digits, the loops closed in as many.

use crate::double::Double;
use crate::robot::Inputs;
use nalgebra::{DMatrix, DVector};
use regen_image::robots::{Robot, all};
use regen_robots as generated;
use regen_runtime::{Condition, LoopClosure, Model, NEAR_SINGULAR, Outcome, SizeError};

/// Where the pivot is p, errors at given coordinates are below this times 2^-52 / p^2, relative to
/// the largest entry.
const FACTOR: f64 = 50.0;

/// Where the condition is c, errors of rates at given independent coordinates are below this times
/// 2^-52 / c^3: by closing the loops, by solving for velocities, and for accelerations with the
/// squares of these. 56 was measured, where the pivot alone tells the condition.
const CUBE: f64 = 1e3;

/// And they are below this wherever the state is called regular.
const LARGEST: f64 = 1e-3;

type Solved = Result<Condition<Double>, SizeError>;

/// The functions of a robot in 32 digits.
struct Exact {
    name: &'static str,
    newton_step: fn(&[Double], &mut [Double]) -> Solved,
    velocities: fn(&[Double], &[Double], &mut [Double]) -> Solved,
    inverse_dynamics: fn([&[Double]; 4], &mut [Double]) -> Solved,
    accelerations: fn([&[Double]; 3], &mut [Double]) -> Solved,
}

macro_rules! exact {
    ($($module:ident :: $type:ident),*) => {
        [$({
            const MODEL: generated::$module::$type = generated::$module::$type;
            Exact {
                name: stringify!($module),
                newton_step: |q, out| MODEL.newton_step(q, out),
                velocities: |q, qd_i, out| MODEL.velocities(q, qd_i, out),
                accelerations: |[q, qd, qdd_i], out| MODEL.accelerations(q, qd, qdd_i, out),
                inverse_dynamics: |[q, qd, qdd, phi], out| MODEL.inverse_dynamics(q, qd, qdd, phi, out),
            }
        }),*]
    };
}

/// Robots whose loops can be led into a singularity. Four-bar and slider-crank have none, and
/// Stewart platform and hybrid take long to compile so.
fn exact() -> Vec<Exact> {
    let robots = exact![delta::Delta, fivebar::Fivebar, rps3::Rps3].into_iter();
    #[cfg(feature = "derived")]
    let robots = robots.chain(exact![
        linear_delta::LinearDelta,
        palletiser::Palletiser,
        prs3::Prs3,
        rrr3::Rrr3
    ]);
    robots.collect()
}

/// Directions of the independent coordinates, the same each time.
fn directions(dof: usize) -> Vec<Vec<f64>> {
    let mut state = 7_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    (0..24)
        .map(|_| (0..dof).map(|_| 3.0 * next()).collect())
        .collect()
}

/// Targets beyond a singularity, and the last state before it.
fn singular(robot: Robot<f64>) -> Vec<(Vec<f64>, f64, Vec<f64>)> {
    let info = robot.info();
    let model: &dyn Model = robot;
    let mut closure = LoopClosure::new(model).unwrap();
    let home: Vec<f64> = info
        .independent
        .iter()
        .map(|at| closure.home().q[*at])
        .collect();
    let mut found = Vec::new();
    let ahead = |direction: &Vec<f64>| home.iter().zip(direction).map(|(a, b)| a + b).collect();
    let mut targets: Vec<Vec<f64>> = directions(info.dof()).iter().map(ahead).collect();
    if info.name == "fivebar" {
        // Its singularities are points: here the cranks' ends meet.
        let meet = (1.0_f64 / 3.0).acos();
        let ends = [meet, std::f64::consts::PI - meet];
        targets.push(home.iter().zip(ends).map(|(a, b)| 2.0 * b - a).collect());
    }
    for target in targets {
        let solution = closure.solve(&target).unwrap();
        if let Outcome::Singular { at, .. } = solution.outcome {
            found.push((target, at, solution.q));
        }
    }
    found
}

fn jacobian(robot: Robot<f64>, q: &[f64]) -> DMatrix<f64> {
    let rows = robot.info().rows;
    let mut a = vec![0.0; rows * q.len()];
    robot.jacobian(q, &mut a).unwrap();
    DMatrix::from_row_slice(rows, q.len(), &a)
}

/// The closed state nearest to q, all coordinates free; `None` if there is none.
fn closed(robot: Robot<f64>, q: &[f64]) -> Option<Vec<f64>> {
    let mut q = q.to_vec();
    let mut f = vec![0.0; robot.info().rows];
    for _ in 0..12 {
        robot.constraints(&q, &mut f).unwrap();
        let step = jacobian(robot, &q)
            .svd(true, true)
            .solve(&DVector::from_row_slice(&f), 1e-7)
            .ok()?;
        for (q, step) in q.iter_mut().zip(step.iter()) {
            *q -= step;
        }
    }
    robot.constraints(&q, &mut f).unwrap();
    f.iter().all(|f| f.abs() < 1e-14).then_some(q)
}

/// The direction of the dependent coordinates in which the mechanism can move at a singularity.
fn free_motion(robot: Robot<f64>, q: &[f64]) -> Vec<f64> {
    let dependent = robot.info().dependent;
    let a = jacobian(robot, q).select_columns(dependent);
    let svd = a.svd(false, true);
    let v = svd.v_t.unwrap();
    let least = svd.singular_values.imin();
    let mut direction = vec![0.0; q.len()];
    for (at, x) in dependent.iter().zip(v.row(least).iter()) {
        direction[*at] = *x;
    }
    direction
}

/// Velocities, accelerations and efforts; the pivot.
fn rates(robot: Robot<f64>, q: &[f64], inputs: &Inputs) -> (Vec<Vec<f64>>, f64) {
    let n = q.len();
    let (mut qd, mut qdd, mut tau) = (vec![0.0; n], vec![0.0; n], vec![0.0; robot.info().dof()]);
    let worst = robot.velocities(q, &inputs.qd_i, &mut qd).unwrap();
    let worst = worst.worst(
        robot
            .accelerations(q, &qd, &inputs.qdd_i, &mut qdd)
            .unwrap(),
    );
    let worst = worst.worst(
        robot
            .inverse_dynamics(q, &qd, &qdd, &inputs.phi, &mut tau)
            .unwrap(),
    );
    (vec![qd, qdd, tau], worst.pivot)
}

fn splat(values: &[f64]) -> Vec<Double> {
    values.iter().map(|x| Double::new(*x)).collect()
}

impl Exact {
    /// All coordinates in 32 digits where the loops close at q's independent ones.
    fn closed(&self, robot: Robot<f64>, q: &[f64]) -> Option<Vec<Double>> {
        let dependent = robot.info().dependent;
        let mut q = splat(q);
        let mut step = splat(&vec![0.0; dependent.len()]);
        let mut last = f64::INFINITY;
        for _ in 0..12 {
            let _ = (self.newton_step)(&q, &mut step).unwrap();
            last = step.iter().fold(0.0, |m: f64, x| m.max(x.to_f64().abs()));
            for (at, step) in dependent.iter().zip(&step) {
                q[*at] = q[*at] + *step;
            }
        }
        (last < 1e-24).then_some(q)
    }

    /// Velocities, accelerations and efforts at q, each from the one before, or from what was
    /// found for that.
    fn rates_at(&self, q: &[Double], inputs: &Inputs, found: Option<&[Vec<f64>]>) -> Vec<Vec<f64>> {
        let zero = vec![0.0; q.len()];
        let (mut qd, mut qdd) = (splat(&zero), splat(&zero));
        let mut tau = splat(&zero[..inputs.qd_i.len()]);
        let lower = |values: &[Double]| values.iter().map(|x| x.to_f64()).collect();
        let _ = (self.velocities)(q, &splat(&inputs.qd_i), &mut qd).unwrap();
        let velocities = lower(&qd);
        qd = found.map_or(qd, |found| splat(&found[0]));
        let _ = (self.accelerations)([q, &qd, &splat(&inputs.qdd_i)], &mut qdd).unwrap();
        let accelerations = lower(&qdd);
        qdd = found.map_or(qdd, |found| splat(&found[1]));
        let _ = (self.inverse_dynamics)([q, &qd, &qdd, &splat(&inputs.phi)], &mut tau).unwrap();
        vec![velocities, accelerations, lower(&tau)]
    }
}

/// The largest difference over the largest entry, of the worst of the vectors.
fn error(found: &[Vec<f64>], exact: &[Vec<f64>]) -> f64 {
    let pairs = found.iter().zip(exact);
    let errors = pairs.map(|(found, exact)| {
        let size = exact.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let differences = found.iter().zip(exact).map(|(a, b)| (a - b).abs());
        // NaN is the worst
        differences.fold(0.0, |m: f64, d| if d <= m { m } else { d }) / size
    });
    errors.fold(0.0, |m: f64, e| if e <= m { m } else { e })
}

/// The worst error of states that are called regular, with their pivots, and how many are not.
#[derive(Debug, Default)]
struct Tally {
    regular: usize,
    warned: usize,
    /// The error times a power of the pivot, in units of rounding; the error; the pivot.
    factor: [f64; 3],
    /// The largest error; its pivot.
    worst: [f64; 2],
}

impl Tally {
    fn add(&mut self, pivot: f64, power: i32, error: impl FnOnce() -> f64) {
        // NaN is not a regular pivot
        if pivot.is_nan() || pivot < NEAR_SINGULAR {
            self.warned += 1;
            return;
        }
        self.regular += 1;
        let error = error();
        let factor = error * pivot.powi(power) / f64::EPSILON;
        let more = |x: f64, than: f64| x.is_nan() || x > than;
        if more(factor, self.factor[0]) {
            self.factor = [factor, error, pivot];
        }
        if more(error, self.worst[0]) {
            self.worst = [error, pivot];
        }
    }
}

#[test]
fn at_the_coordinates_that_are_given_a_status_comes_before_errors() {
    let mut led = 0;
    for exact in exact() {
        let (_, robot) = all().find(|(name, _)| *name == exact.name).unwrap();
        let inputs = Inputs::near_home(robot);
        let mut tally = Tally::default();
        for (_, _, q) in singular(robot).into_iter().take(6) {
            let direction = free_motion(robot, &q);
            for k in -24..=24_i32 {
                let size = 10_f64.powf(f64::from(k.abs()) / 2.0 - 12.0);
                let t = size * f64::from(k.signum());
                let moved: Vec<f64> = q.iter().zip(&direction).map(|(q, d)| q + t * d).collect();
                if let Some(q) = closed(robot, &moved) {
                    let (found, pivot) = rates(robot, &q, &inputs);
                    tally.add(pivot, 2, || {
                        error(&found, &exact.rates_at(&splat(&q), &inputs, Some(&found)))
                    });
                }
            }
        }
        println!("{}: {tally:?}", exact.name);
        if tally.regular + tally.warned > 0 {
            led += 1;
            // In the five-bar's singularity both outer links turn together, and stay in it.
            let both = tally.regular > 0 || exact.name == "fivebar";
            assert!(tally.warned > 0 && both, "{}: {tally:?}", exact.name);
            assert!(tally.factor[0] < FACTOR, "{}: {tally:?}", exact.name);
        }
    }
    assert_eq!(led, exact().len());
}

#[test]
fn at_independent_coordinates_a_status_comes_before_errors() {
    let mut led = 0;
    for exact in exact() {
        let (_, robot) = all().find(|(name, _)| *name == exact.name).unwrap();
        let model: &dyn Model = robot;
        let inputs = Inputs::near_home(robot);
        let mut closure = LoopClosure::new(model).unwrap();
        let home: Vec<f64> = robot
            .info()
            .independent
            .iter()
            .map(|k| closure.home().q[*k])
            .collect();
        let mut tally = Tally::default();
        for (target, at, _) in singular(robot).into_iter().take(8) {
            for k in 0..=24_i32 {
                let part = at * (1.0 - 10_f64.powf(-f64::from(k) / 2.0));
                let q_i: Vec<f64> = home
                    .iter()
                    .zip(&target)
                    .map(|(a, b)| a + part * (b - a))
                    .collect();
                let state = closure
                    .solve_state(&q_i, &inputs.qd_i, &inputs.qdd_i)
                    .unwrap();
                if !state.outcome.is_closed() {
                    tally.warned += 1;
                    continue;
                }
                tally.add(state.condition.pivot, 3, || {
                    let truth = exact.closed(robot, &state.q).expect(exact.name);
                    let truth = exact.rates_at(&truth, &inputs, None);
                    error(&[state.qd, state.qdd], &truth[..2])
                });
            }
        }
        println!("{}: {tally:?}", exact.name);
        if tally.regular + tally.warned > 0 {
            led += 1;
            assert!(
                tally.warned > 0 && tally.regular > 0,
                "{}: {tally:?}",
                exact.name
            );
            let within = tally.factor[0] < CUBE && tally.worst[0] < LARGEST;
            assert!(within, "{}: {tally:?}", exact.name);
        }
    }
    assert_eq!(led, exact().len());
}

#[test]
fn beyond_a_singularity_nothing_is_closed_and_no_rates_are_numbers() {
    let mut led = 0;
    for (name, robot) in all() {
        let info = robot.info();
        let model: &dyn Model = robot;
        let rates = vec![0.5; info.dof()];
        for (target, at, _) in singular(robot) {
            let mut closure = LoopClosure::new(model).unwrap();
            let home: Vec<f64> = info
                .independent
                .iter()
                .map(|k| closure.home().q[*k])
                .collect();
            led += 1;
            for beyond in [1.0 + 1e-6, 1.001, 1.1] {
                let q_i: Vec<f64> = home
                    .iter()
                    .zip(&target)
                    .map(|(a, b)| a + beyond * at * (b - a))
                    .collect();
                let direct = closure.solve_state(&q_i, &rates, &rates).unwrap();
                let tracked = closure.track_state(&q_i, &rates, &rates).unwrap();
                for state in [direct, tracked] {
                    assert!(
                        !state.outcome.is_closed(),
                        "{name} at {beyond}: {:?}",
                        state.outcome
                    );
                    assert!(
                        state.qd.iter().chain(&state.qdd).all(|x| x.is_nan()),
                        "{name}"
                    );
                }
            }
        }
    }
    assert!(led > 50, "{led}");
}
