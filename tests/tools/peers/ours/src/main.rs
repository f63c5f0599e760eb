//! Times our base regressors together with the standard library's sines and cosines.
//!
//! `peers-ours calls ROBOT COUNT` evaluates the base regressor of a robot `COUNT` times.
//! `peers-ours` prints one line per figure: a name and nanoseconds per call, the minimum of many
//! interleaved rounds. `peers-ours columns ROBOT` reads states from standard input, one line of q,
//! qd, qdd each, and prints the base regressor, column by column, one line per state.
#![allow(dead_code, non_camel_case_types)]

use std::hint::black_box;
use std::io::BufRead;
use std::time::{Duration, Instant};

use pulp::{Simd, WithSimd};
use regen_batch::{
    Block, Consumer, Normal, Samples, base_regressors, base_regressors_on_threads, task,
};
use regen_runtime::robot_model;

robot_model!("../../../../../robots/iiwa14.yaml");
robot_model!("../../../../../robots/panda.yaml");
robot_model!("../../../../../robots/puma560.yaml");
robot_model!("../../../../../robots/3rps.yaml");
robot_model!("../../../../../robots/rx90.yaml");
robot_model!("../../../../../robots/stewart.yaml");
robot_model!("../../../../../robots/ur5e.yaml");

/// Irregular coordinates, velocities and accelerations near home.
fn state<const N: usize>(home: &[f64; N], k: f64) -> [[f64; N]; 3] {
    let wave = |k: f64| std::array::from_fn(|i| (k + 1.7 * i as f64).sin());
    let (mut q, qd, qdd): ([f64; N], [f64; N], [f64; N]) = (wave(k), wave(k + 0.8), wave(k + 2.0));
    for (q, home) in q.iter_mut().zip(home) {
        *q = home + 0.1 * *q;
    }
    [q, qd, qdd]
}

/// A consumer that stores nothing, so that blocks remain in the cache.
struct Discard;
impl<const DOF: usize, const COLUMNS: usize> Consumer<DOF, COLUMNS> for Discard {
    #[inline(always)]
    fn take<S: Simd>(&mut self, block: &Block<'_, S, DOF, COLUMNS>) {
        black_box(block.w);
    }
}

/// Runs with the instruction set without AVX-512, as on a machine with AVX2.
#[cfg(target_arch = "x86_64")]
fn on_avx2<F: WithSimd<Output = ()>>(run: F) {
    use pulp::x86::V3;
    if let Some(simd) = V3::try_new() {
        Simd::vectorize(simd, run);
    }
}

const SAMPLES: usize = 256;
const CALLS: usize = 256;

struct Figure {
    name: String,
    run: Box<dyn FnMut()>,
    /// The number of evaluations in one run.
    calls: usize,
}

fn figure(all: &mut Vec<Figure>, name: String, calls: usize, run: impl FnMut() + 'static) {
    all.push(Figure {
        name,
        run: Box::new(run),
        calls,
    });
}

macro_rules! one_by_one {
    ($all:ident, $robot:ident) => {{
        use $robot::{BASE, HOME, INDEPENDENT};
        const DOF: usize = INDEPENDENT.len();
        const P: usize = BASE.len();
        let one = state(&HOME, 0.3);
        let mut w = [[0.0; DOF]; P];
        figure(
            &mut $all,
            format!("{} base", stringify!($robot)),
            CALLS,
            move || {
                for _ in 0..CALLS {
                    let [q, qd, qdd] = black_box(&one);
                    black_box($robot::base_regressor(q, qd, qdd, &mut w)).pivot;
                    black_box(&w);
                }
            },
        );
        let beta: [f64; P] = std::array::from_fn(|i| 0.1 + i as f64);
        figure(
            &mut $all,
            format!("{} inverse dynamics", stringify!($robot)),
            CALLS,
            move || {
                for _ in 0..CALLS {
                    let [q, qd, qdd] = black_box(&one);
                    black_box($robot::base_inverse_dynamics(q, qd, qdd, black_box(&beta)).0);
                }
            },
        );
    }};
}

macro_rules! together {
    ($all:ident, $robot:ident, $model:ident) => {{
        use $robot::{BASE, COORDINATES, HOME, INDEPENDENT, $model};
        const N: usize = COORDINATES.len();
        const DOF: usize = INDEPENDENT.len();
        const P: usize = BASE.len();
        let states: Vec<_> = (0..SAMPLES)
            .map(|i| state(&HOME, 0.01 * i as f64))
            .collect();
        let part = |k: usize| -> [&'static [f64]; N] {
            std::array::from_fn(|c| {
                &*Box::leak(states.iter().map(|s| s[k][c]).collect::<Box<[_]>>())
            })
        };
        let samples = Samples::new(part(0), part(1), part(2)).expect("as many of each");
        figure(
            &mut $all,
            format!("{} batch", stringify!($robot)),
            SAMPLES,
            move || {
                base_regressors::<$model, _, N, DOF, P>(black_box(&samples), &mut Discard);
            },
        );
        #[cfg(target_arch = "x86_64")]
        figure(
            &mut $all,
            format!("{} batch avx2", stringify!($robot)),
            SAMPLES,
            move || {
                on_avx2(task::<$model, _, N, DOF, P>(
                    black_box(&samples),
                    &mut Discard,
                ));
            },
        );
        figure(
            &mut $all,
            format!("{} batch portable", stringify!($robot)),
            SAMPLES,
            move || {
                task::<$model, _, N, DOF, P>(black_box(&samples), &mut Discard)
                    .with_simd(pulp::Scalar);
            },
        );
        let tau: &'static [f64] = Box::leak(vec![1.0; SAMPLES].into_boxed_slice());
        figure(
            &mut $all,
            format!("{} normal equations", stringify!($robot)),
            SAMPLES,
            move || {
                let mut normal = Normal::<DOF, P>::new([tau; DOF], [1.0; DOF]);
                base_regressors::<$model, _, N, DOF, P>(black_box(&samples), &mut normal);
                black_box(&normal);
            },
        );
    }};
}

macro_rules! printed {
    ($robot:ident, $state:ident) => {{
        const N: usize = $robot::COORDINATES.len();
        let part = |k: usize| -> [f64; N] { std::array::from_fn(|i| $state[k * N + i]) };
        let mut w = [[0.0; $robot::INDEPENDENT.len()]; $robot::BASE.len()];
        let _ = $robot::base_regressor(&part(0), &part(1), &part(2), &mut w);
        let values: Vec<String> = w.iter().flatten().map(|x| format!("{x:e}")).collect();
        println!("{}", values.join(" "));
    }};
}

fn columns(robot: &str) {
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let state: Vec<f64> = line
            .split_whitespace()
            .filter_map(|x| x.parse().ok())
            .collect();
        match robot {
            "puma560" => printed!(puma560, state),
            "ur5e" => printed!(ur5e, state),
            "rx90" => printed!(rx90, state),
            "panda" => printed!(panda, state),
            "iiwa14" => printed!(iiwa14, state),
            "rps3" => printed!(rps3, state),
            "stewart" => printed!(stewart, state),
            other => eprintln!("no robot `{other}`"),
        }
    }
}

macro_rules! called {
    ($robot:ident, $count:ident) => {{
        let state = state(&$robot::HOME, 0.3);
        let mut w = [[0.0; $robot::INDEPENDENT.len()]; $robot::BASE.len()];
        for _ in 0..$count {
            let [q, qd, qdd] = black_box(&state);
            black_box($robot::base_regressor(q, qd, qdd, &mut w).pivot);
            black_box(&w);
        }
    }};
}

/// Evaluates a base regressor `count` times, for counting instructions.
fn calls(robot: &str, count: usize) {
    match robot {
        "puma560" => called!(puma560, count),
        "ur5e" => called!(ur5e, count),
        "rx90" => called!(rx90, count),
        "panda" => called!(panda, count),
        "iiwa14" => called!(iiwa14, count),
        "rps3" => called!(rps3, count),
        "stewart" => called!(stewart, count),
        other => eprintln!("no robot `{other}`"),
    }
}

fn growth() {
    println!("samples seconds");
    let states: Vec<_> = (0..1 << 16)
        .map(|i| state(&puma560::HOME, 1e-3 * i as f64))
        .collect();
    let part = |k: usize| -> [Vec<f64>; 6] {
        std::array::from_fn(|c| states.iter().map(|s| s[k][c]).collect())
    };
    let (q, qd, qdd) = (part(0), part(1), part(2));
    let first = |all: &'static [Vec<f64>; 6], count: usize| all.each_ref().map(|s| &s[..count]);
    let [q, qd, qdd] = [q, qd, qdd].map(|all| &*Box::leak(Box::new(all)));
    for count in (8..=16).map(|e| 1_usize << e) {
        let samples = Samples::new(first(q, count), first(qd, count), first(qdd, count))
            .expect("as many of each");
        let mut least = Duration::MAX;
        for _ in 0..30 {
            let start = Instant::now();
            base_regressors::<puma560::Puma560, _, 6, 6, 36>(&samples, &mut Discard);
            least = least.min(start.elapsed());
        }
        println!("{count} {:.6e}", least.as_secs_f64());
    }
    let samples = Samples::new(first(q, 1 << 16), first(qd, 1 << 16), first(qdd, 1 << 16))
        .expect("as many of each");
    for threads in 1..=2 {
        let mut least = Duration::MAX;
        for _ in 0..30 {
            let mut consumers: Vec<Discard> = (0..threads).map(|_| Discard).collect();
            let start = Instant::now();
            base_regressors_on_threads::<puma560::Puma560, _, 6, 6, 36>(&samples, &mut consumers);
            least = least.min(start.elapsed());
        }
        println!("threads {threads} {:.6e}", least.as_secs_f64());
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["columns", robot] => return columns(robot),
        ["growth"] => return growth(),
        ["calls", robot, count] => return calls(robot, count.parse().unwrap_or(0)),
        _ => {}
    }
    let rounds = 400;
    let mut all = Vec::new();
    for count in [6, 7] {
        let angles: Vec<f64> = (0..count).map(|i| 0.3 - 0.7 * f64::from(i)).collect();
        figure(&mut all, format!("sincos {count}"), CALLS, move || {
            for _ in 0..CALLS {
                for x in black_box(&angles) {
                    black_box(x.sin_cos());
                }
            }
        });
    }
    one_by_one!(all, puma560);
    one_by_one!(all, ur5e);
    one_by_one!(all, rx90);
    one_by_one!(all, panda);
    one_by_one!(all, iiwa14);
    one_by_one!(all, rps3);
    one_by_one!(all, stewart);
    together!(all, puma560, Puma560);
    together!(all, ur5e, Ur5e);
    together!(all, rx90, Rx90);
    together!(all, panda, Panda);
    together!(all, iiwa14, Iiwa14);
    together!(all, rps3, Rps3);
    let mut least = vec![Duration::MAX; all.len()];
    for _ in 0..rounds {
        for (least, figure) in least.iter_mut().zip(&mut all) {
            let start = Instant::now();
            (figure.run)();
            *least = (*least).min(start.elapsed());
        }
    }
    for (least, figure) in least.iter().zip(&all) {
        println!(
            "{}\t{:.2}",
            figure.name,
            least.as_secs_f64() * 1e9 / figure.calls as f64
        );
    }
}
