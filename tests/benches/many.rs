//! The time per state of the base regressor at many states: programs executed block by block
//! (`Interpreted`, which the command uses) beside the compiled model in the same vector registers.
//!
//! ```sh
//! RUSTFLAGS="-C target-cpu=native" cargo bench -p regen-tests --bench many
//! ```
//!
//! Each time is the fastest of interleaved rounds in one run, so that load on the machine affects
//! both alike. The aim is at most 2.5 times the compiled model. The benchmark never fails: times
//! are no test.
//!
//! Measured on two virtual cores of an AMD EPYC with AVX-512, Rust 1.95, without `target-cpu`, others
//! building at the same time: PUMA 560 87.7 and 93.7 ns (ratio 1.07), Panda 106 and 136 ns (1.28),
//! 3-RPS 121 and 90 ns (0.74), 6-UPS platform 1,843 and 685 ns (0.37). Straight-line code of the
//! larger ones no longer fits the first-level cache of instructions, while a list of them streams. On
//! 26 November 2026, quiet, where compiled models took about half as long again: 136 and 147 ns (1.08), 164 and
//! 227 ns (1.39), 177 and 141 ns (0.80), 2,637 and 982 ns (0.37).
#![allow(
    clippy::expect_used,
    clippy::inline_always,
    reason = "the robots are known, and what is left as a call is compiled without the token's registers"
)]

use std::hint::black_box;
use std::time::{Duration, Instant};

use pulp::Simd;
use regen_batch::{Block, Consumer, Samples, base_regressors, eval_base_many};
use regen_codegen::diag::Source;
use regen_codegen::pipeline;
use regen_generated::{puma560, rps3};
use regen_interpreted::Interpreted;
use regen_robots::{panda, stewart};
use regen_runtime::{Arguments, BaseFunction, BaseKernel};

/// The number of states of a round.
const STATES: usize = 1024;
const ROUNDS: usize = 300;

/// Stores nothing: the registers of the compiled model count as its result.
struct Discard;

impl<const DOF: usize, const COLUMNS: usize> Consumer<DOF, COLUMNS> for Discard {
    #[inline(always)]
    fn take<S: Simd>(&mut self, block: &Block<'_, S, DOF, COLUMNS>) {
        black_box(block);
    }
}

/// Motion without pattern about home, one series after the other.
fn motion(home: &[f64]) -> [Vec<f64>; 3] {
    [0.1, 1.0, 1.0].map(|size| {
        let series = home.iter().enumerate().flat_map(|(c, home)| {
            let offset = if size < 1.0 { *home } else { 0.0 };
            (0..STATES).map(move |k| offset + size * (1.7 * c as f64 + 0.37 * k as f64).sin())
        });
        series.collect()
    })
}

/// Prints both times and their ratio.
fn compare<K, const N: usize, const DOF: usize, const COLUMNS: usize>(
    name: &str,
    text: &str,
    home: &[f64; N],
) where
    K: BaseKernel<N, DOF, COLUMNS>,
{
    let robot = pipeline::derive(&Source::new(name, text)).expect("the robots derive");
    let model = Interpreted::new(&robot);
    let [q, qd, qdd] = motion(home);
    let series = |all: &'_ [f64]| -> [Vec<f64>; N] {
        core::array::from_fn(|c| all[c * STATES..(c + 1) * STATES].to_vec())
    };
    let (own_q, own_qd, own_qdd) = (series(&q), series(&qd), series(&qdd));
    let parts = [&own_q, &own_qd, &own_qdd].map(|all| all.each_ref().map(Vec::as_slice));
    let samples = Samples::new(parts[0], parts[1], parts[2]).expect("equally long");
    let (mut w, mut pivots) = (vec![0.0; DOF * COLUMNS * STATES], vec![0.0; STATES]);
    let arguments = Arguments {
        q: &q,
        qd: &qd,
        qdd: &qdd,
        ..Arguments::EMPTY
    };
    let (mut compiled, mut executed) = (Duration::MAX, Duration::MAX);
    for _ in 0..ROUNDS {
        let start = Instant::now();
        base_regressors::<K, _, N, DOF, COLUMNS>(black_box(&samples), &mut Discard);
        compiled = compiled.min(start.elapsed());
        let start = Instant::now();
        let function = BaseFunction::BaseRegressor;
        eval_base_many(&model, function, STATES, arguments, &mut w, &mut pivots)
            .expect("the sizes are the model's");
        black_box(&w);
        executed = executed.min(start.elapsed());
    }
    let per_state = |time: Duration| time.as_secs_f64() * 1e9 / STATES as f64;
    println!(
        "{name:10} compiled {:7.1} ns   executed {:7.1} ns   ratio {:.2}",
        per_state(compiled),
        per_state(executed),
        per_state(executed) / per_state(compiled)
    );
}

fn main() {
    compare::<puma560::Puma560, _, _, _>(
        "puma560",
        include_str!("../../robots/puma560.yaml"),
        &puma560::HOME,
    );
    compare::<panda::Panda, _, _, _>(
        "panda",
        include_str!("../../robots/panda.yaml"),
        &panda::HOME,
    );
    compare::<rps3::Rps3, _, _, _>("3rps", include_str!("../../robots/3rps.yaml"), &rps3::HOME);
    compare::<stewart::Stewart, _, _, _>(
        "stewart",
        include_str!("../../robots/stewart.yaml"),
        &stewart::HOME,
    );
}
