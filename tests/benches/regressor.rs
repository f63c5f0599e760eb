//! The time of one evaluation of the regressor, all columns, compared with the sines and cosines of
//! six angles in the same run.
//!
//! ```sh
//! RUSTFLAGS="-C target-cpu=native" cargo bench -p regen-tests --bench regressor
//! # for any processor, without fused multiply-add; only the ratios
//! cargo bench -p regen-tests --bench regressor -- nothing
//! ```
//!
//! After criterion's figures come the ratios, each from the fastest of interleaved rounds, so that
//! load on the machine affects both times equally. The benchmark never fails: times are no test.
//!
//! The target ratios are twice the times of hand-written straight-line Rust on a machine of this
//! kind with native flags: 120 ns for the PUMA 560 and 250 ns for the 3-RPS. There the six angles
//! took 41 to 60 ns; 60 ns gives the strictest ratios, 2 x 2.0 and 2 x 4.2.
//!
//! Measured on two virtual cores of an AMD EPYC with AVX-512, Rust 1.95, robots as ratios to the
//! six angles:
//!
//! | | native | any processor |
//! |---|---|---|
//! | six angles | 57.7 ns | 57.8 ns |
//! | PUMA 560 | 2.9 | 3.8 |
//! | 3-RPS | 3.0 | 3.2 |
//! | five-bar | 1.2 | 1.3 |

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group};
use regen_generated::{fivebar, puma560, rps3};

const ANGLES: [f64; 6] = [0.3, -1.2, 2.1, 0.7, -0.4, 1.9];

fn sines_and_cosines(angles: &[f64; 6]) -> [(f64, f64); 6] {
    angles.map(f64::sin_cos)
}

/// An evaluation at a fixed state.
type Run = fn();

fn six_angles() {
    black_box(sines_and_cosines(black_box(&ANGLES)));
}

/// Coordinates, velocities and accelerations without pattern.
fn state<const N: usize>(home: &[f64; N]) -> [[f64; N]; 3] {
    let wave = |k: f64| std::array::from_fn(|i| (k + 1.7 * i as f64).sin());
    let (mut q, qd, qdd): ([f64; N], [f64; N], [f64; N]) = (wave(0.3), wave(1.1), wave(2.3));
    for (q, home) in q.iter_mut().zip(home) {
        *q = home + 0.1 * *q;
    }
    [q, qd, qdd]
}

macro_rules! evaluation {
    ($name:ident) => {
        fn $name() {
            const P: usize = $name::PARAMETERS.len();
            const DOF: usize = $name::INDEPENDENT.len();
            thread_local! {
                static STATE: [[f64; $name::COORDINATES.len()]; 3] = state(&$name::HOME);
            }
            STATE.with(|state| {
                let [q, qd, qdd] = black_box(state);
                let mut w = [[0.0; DOF]; P];
                black_box($name::regressor(q, qd, qdd, &mut w)).pivot;
                black_box(&w);
            });
        }
    };
}
evaluation!(puma560);
evaluation!(rps3);
evaluation!(fivebar);

/// The name and function of each measurement, and the target ratio.
const ALL: [(&str, Run, Option<f64>); 4] = [
    ("sines and cosines of six angles", six_angles, None),
    ("puma560, 60 columns", puma560, Some(4.0)),
    ("3rps, 70 columns", rps3, Some(8.3)),
    ("fivebar, 40 columns", fivebar, None),
];

fn figures(criterion: &mut Criterion) {
    for (name, run, _) in ALL {
        criterion.bench_function(name, |bencher| bencher.iter(run));
    }
}

fn ratios() {
    const CALLS: u32 = 2_000;
    let mut fastest = [Duration::MAX; ALL.len()];
    for _ in 0..400 {
        for (fastest, (_, run, _)) in fastest.iter_mut().zip(ALL) {
            let start = Instant::now();
            for _ in 0..CALLS {
                run();
            }
            *fastest = (*fastest).min(start.elapsed());
        }
    }
    println!("\nfused multiply-add: {}", cfg!(target_feature = "fma"));
    for (time, (name, _, target)) in fastest.iter().zip(ALL) {
        let nanoseconds = time.as_secs_f64() * 1e9 / f64::from(CALLS);
        let ratio = time.as_secs_f64() / fastest[0].as_secs_f64();
        let target = target.map_or_else(String::new, |ratio| format!("   mark {ratio:4.1}"));
        println!("{name:32} {nanoseconds:7.1} ns   ratio {ratio:5.2}{target}");
    }
}

criterion_group!(benches, figures);

fn main() {
    // `cargo test --benches` only checks that it runs
    if std::env::args().any(|argument| argument == "--test") {
        return ALL.iter().for_each(|(_, run, _)| run());
    }
    benches();
    ratios();
}
