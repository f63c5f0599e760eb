//! A generated robot evaluated with every scalar type: the 3-RPS in double and single precision,
//! dual numbers and SIMD lanes.

#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(clippy::doc_markdown, reason = "formulas")]
#![allow(clippy::float_cmp, reason = "lanes that do not notice keep every bit")]

use std::f64::consts::FRAC_PI_2;

use num_dual::Dual64;
use pulp::{Arch, Simd, WithSimd, bytemuck};
use regen_batch::Lane;
use regen_codegen::diag::Source;
use regen_codegen::interpret::{self, Rounded, Single};
use regen_codegen::optimize::{Op, Program};
use regen_codegen::pipeline::derive;
use regen_codegen::robot::FunctionKind;
use regen_generated::rps3::{self, Rps3};
use regen_runtime::{Dual, LoopClosure, PIVOT_BOUND, Scalar};
use regen_tests::files;
use regen_tests::reference::Random;

const N: usize = 9;
const DOF: usize = 3;
const P: usize = 70;

/// Coordinates, velocities, accelerations.
type State = [[f64; N]; 3];

/// The results of a model at a state: the regressor column by column, all velocities from the
/// independent ones, the inverse dynamics, and the conditions of the three.
struct Answer<T> {
    regressor: [[T; DOF]; P],
    velocities: [T; N],
    tau: [T; DOF],
    conditions: [T; 3],
}

fn parameters() -> [f64; P] {
    let mut random = Random::new(3);
    [0; P].map(|_| random.uniform(-2.0, 2.0))
}

#[inline(always)]
#[allow(
    clippy::inline_always,
    reason = "lanes need the instruction set of the function that dispatches"
)]
fn evaluate<T: Scalar>([q, qd, qdd]: &[[T; N]; 3]) -> Answer<T> {
    let proto = q[0];
    let phi = parameters().map(|x| proto.splat(x));
    let qd_i = rps3::INDEPENDENT.map(|c| qd[c]);
    let mut regressor = [[proto; DOF]; P];
    let first = rps3::regressor(q, qd, qdd, &mut regressor);
    let (velocities, second) = rps3::velocities(q, &qd_i);
    let (tau, third) = rps3::inverse_dynamics(q, qd, qdd, &phi);
    Answer {
        regressor,
        velocities,
        tau,
        conditions: [first.pivot, second.pivot, third.pivot],
    }
}

impl<T: Copy> Answer<T> {
    /// The results in rows of one unit each: the regressor's rows, velocities, efforts.
    fn rows(&self) -> Vec<Vec<T>> {
        let row = |r: usize| self.regressor.iter().map(|column| column[r]).collect();
        let mut rows: Vec<Vec<T>> = (0..DOF).map(row).collect();
        rows.extend([self.velocities.to_vec(), self.tau.to_vec()]);
        rows
    }

    fn map<U>(&self, to: impl Fn(T) -> U) -> Answer<U> {
        Answer {
            regressor: self.regressor.map(|column| column.map(&to)),
            velocities: self.velocities.map(&to),
            tau: self.tau.map(&to),
            conditions: self.conditions.map(&to),
        }
    }
}

/// The largest difference in a row relative to the row's largest entry, over all rows.
fn difference(found: &Answer<f64>, expected: &Answer<f64>) -> f64 {
    let mut worst = 0.0_f64;
    for (found, expected) in found.rows().iter().zip(expected.rows()) {
        let size = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for (x, y) in found.iter().zip(&expected) {
            assert!(x.is_finite() && y.is_finite());
            worst = worst.max((x - y).abs() / size);
        }
    }
    worst
}

/// Closed states around home, with velocities and accelerations.
fn states(count: usize) -> Vec<State> {
    let mut random = Random::new(1);
    let mut closure = LoopClosure::new(&Rps3).unwrap();
    let mut states = Vec::new();
    while states.len() < count {
        let mut draw =
            |middle: f64, size: f64| [0; DOF].map(|_| random.uniform(middle - size, middle + size));
        let (q_i, qd_i, qdd_i) = (draw(0.6, 0.1), draw(0.0, 0.5), draw(0.0, 3.0));
        let state = closure.solve_state(&q_i, &qd_i, &qdd_i).unwrap();
        assert!(state.outcome.is_closed());
        let array = |values: &Vec<f64>| -> [f64; N] { values.as_slice().try_into().unwrap() };
        states.push([array(&state.q), array(&state.qd), array(&state.qdd)]);
    }
    states
}

/// A state with leg 2 horizontal, where a pivot of the fixed order vanishes. It is not closed; the
/// functions take states as given.
fn state_with_zero_pivot() -> State {
    let [mut q, qd, qdd] = states(1)[0];
    let q6 = rps3::COORDINATES
        .iter()
        .position(|name| *name == "q6")
        .unwrap();
    q[q6] = FRAC_PI_2;
    [q, qd, qdd]
}

/// Evaluates with the fixed order of pivots only, by the interpreted program from which the module
/// was written: returns the smallest pivot relative to its usual size, and the velocities.
fn fixed_order([q, qd, _]: &State) -> (f64, [f64; N]) {
    let path = files::robots().join("3rps.yaml");
    let text = std::fs::read_to_string(path).unwrap();
    let robot = derive(&Source::new("3rps.yaml", text)).unwrap_or_else(|e| panic!("{e}"));
    let program = &robot.function(FunctionKind::Velocities).unwrap().program;
    let solve = program.steps.iter().find_map(|step| match &step.op {
        Op::Solve(solve) => Some(solve.clone()),
        _ => None,
    });
    let solve = solve.unwrap();
    let pivots = solve.pivots.iter().map(|pivot| pivot.0);
    let before_the_guard = Program {
        outputs: pivots
            .chain(solve.fixed.iter().flatten().copied())
            .collect(),
        ..program.clone()
    };
    let qd_i = rps3::INDEPENDENT.map(|c| qd[c]);
    let (values, _) = interpret::run(&before_the_guard, &[q, &qd_i]);
    let (values, dependent) = values.split_at(solve.pivots.len());
    let parts = values.iter().zip(&solve.pivots);
    let margin = parts.map(|(value, (_, size))| (value / size).abs());
    let mut velocities = *qd;
    for (c, value) in rps3::DEPENDENT.iter().zip(dependent) {
        velocities[*c] = *value;
    }
    (margin.fold(f64::INFINITY, f64::min), velocities)
}

/// The size of A qd, the violation of the velocity closure, which needs no solve.
fn violation(q: &[f64; N], velocities: &[f64; N]) -> f64 {
    let rows = rps3::jacobian(q);
    let products = rows
        .iter()
        .map(|row| row.iter().zip(velocities).map(|(a, v)| a * v).sum::<f64>());
    let size = velocities.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    products.fold(0.0_f64, |m, x| m.max(x.abs())) / size
}

#[test]
fn where_the_fixed_order_of_pivots_fails_the_fallback_solves() {
    let usual = states(1)[0];
    let (margin, velocities) = fixed_order(&usual);
    assert!(margin > 100.0 * PIVOT_BOUND);
    assert!(violation(&usual[0], &velocities) < 1e-13);
    let zero_pivot = state_with_zero_pivot();
    let (margin, velocities) = fixed_order(&zero_pivot);
    assert!(margin < 1e-10);
    assert!(violation(&zero_pivot[0], &velocities) > 1e-3);
    for state in [usual, zero_pivot] {
        let answer = evaluate(&state);
        assert!(answer.conditions.iter().all(|c| *c > PIVOT_BOUND));
        assert!(violation(&state[0], &answer.velocities) < 1e-13);
    }
}

#[test]
fn single_precision_has_five_digits() {
    for state in states(20) {
        let narrow = state.map(|values| values.map(|x| x as f32));
        // the same rounded arguments, so that only the arithmetic differs
        let wide = narrow.map(|values| values.map(f64::from));
        let found = evaluate(&narrow).map(f64::from);
        let error = difference(&found, &evaluate(&wide));
        assert!(error < 1e-5, "{error:e}");
        assert!(error > 0.0);
    }
}

/// The error bound is computed from the program's operations at each state. Compiled code stays
/// within it, with or without fused operations, and the bound is at most some thousand times the
/// measured error.
#[test]
fn single_precision_stays_within_its_computed_bound() {
    let path = files::robots().join("3rps.yaml");
    let source = Source::new("3rps.yaml", std::fs::read_to_string(path).unwrap());
    let robot = derive(&source).unwrap();
    let program = &robot.function(FunctionKind::Regressor).unwrap().program;
    let (mut largest, mut widest) = (0.0_f64, 0.0_f64);
    for state in states(20) {
        let narrow = state.map(|values| values.map(|x| x as f32));
        let found = evaluate(&narrow);
        let exact = |k: usize| narrow[k].map(|x| Rounded::<Single>::exact(f64::from(x)));
        let arguments = [exact(0), exact(1), exact(2)];
        let (bounds, _) = interpret::run(program, &[&arguments[0], &arguments[1], &arguments[2]]);
        let entries = found.regressor.iter().flatten();
        assert_eq!(bounds.len(), P * DOF);
        for (entry, bound) in entries.zip(&bounds) {
            let error = (f64::from(*entry) - bound.value).abs();
            assert!(error <= bound.error * (1.0 + 1e-6), "{error:e} {bound:?}");
            largest = largest.max(error);
            widest = widest.max(bound.error);
        }
    }
    assert!(
        largest > 0.0 && widest < 1e4 * largest,
        "{largest:e} {widest:e}"
    );
}

#[test]
fn dual_numbers_carry_the_derivatives_of_the_inverse_dynamics() {
    let tau = |[q, qd, qdd]: &State| evaluate(&[*q, *qd, *qdd]).tau;
    for state in states(4) {
        let plain = evaluate(&state);
        for c in 0..N {
            let mut seeded = state.map(|values| values.map(|x| Dual(Dual64::from_re(x))));
            seeded[0][c].0.eps = 1.0;
            let answer = evaluate(&seeded);
            assert!(difference(&answer.map(|x| x.0.re), &plain) < 1e-13);
            // fourth-order differences: a truncation error of order h^4, and rounding over h
            let h = 1e-3;
            let at = |steps: f64| {
                let mut moved = state;
                moved[0][c] += steps * h;
                tau(&moved)
            };
            let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(at);
            for row in 0..DOF {
                let difference = (a[row] - 8.0 * b[row] + 8.0 * c[row] - d[row]) / (12.0 * h);
                let derivative = answer.tau[row].0.eps;
                let size = 1.0 + difference.abs() + plain.tau[row].abs();
                let error = (derivative - difference).abs() / size;
                assert!(error < 1e-8, "{error:e}");
            }
        }
    }
}

/// Evaluates as many states as there are lanes, all at once.
struct Together<'a>(&'a [State]);

impl WithSimd for Together<'_> {
    type Output = Vec<Answer<f64>>;

    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let lanes = S::F64_LANES;
        let load = |part: usize, c: usize| {
            let values: Vec<f64> = self.0[..lanes].iter().map(|state| state[part][c]).collect();
            Lane {
                simd,
                v: simd.partial_load_f64s(&values),
            }
        };
        let state = [0, 1, 2].map(|part| std::array::from_fn(|c| load(part, c)));
        let answer = evaluate(&state);
        let take = |lane: Lane<S>, at: usize| bytemuck::cast_slice::<S::f64s, f64>(&[lane.v])[at];
        (0..lanes).map(|at| answer.map(|x| take(x, at))).collect()
    }
}

fn check_lanes(run: impl Fn(&[State]) -> Vec<Answer<f64>>) {
    let usual = states(8);
    let together = run(&usual);
    for (found, state) in together.iter().zip(&usual) {
        let single = evaluate(state);
        assert!(difference(found, &single) < 1e-12);
        for (x, y) in found.conditions.iter().zip(&single.conditions) {
            assert!((x - y).abs() < 1e-12);
        }
    }
    // each lane in turn gets the state that the fixed pivots cannot solve
    for place in 0..together.len() {
        let mut mixed = usual.clone();
        mixed[place] = state_with_zero_pivot();
        let answers = run(&mixed);
        for (at, found) in answers.iter().enumerate() {
            if at == place {
                let single = evaluate(&mixed[at]);
                assert!(difference(found, &single) < 1e-11);
                assert!(violation(&mixed[at][0], &found.velocities) < 1e-13);
            } else {
                // the other lanes are unchanged
                assert_eq!(found.rows(), together[at].rows());
                assert_eq!(found.conditions, together[at].conditions);
            }
        }
    }
}

#[test]
fn each_lane_evaluates_its_own_state_and_falls_back_separately() {
    check_lanes(|states| Arch::new().dispatch(Together(states)));
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        let lanes = Arch::new().dispatch(Together(&states(8))).len();
        assert!(lanes > 1, "nothing shares a register with another state");
    }
}

#[test]
fn a_processor_without_lanes_gives_the_same_results() {
    check_lanes(|states| Together(states).with_simd(pulp::Scalar));
}
