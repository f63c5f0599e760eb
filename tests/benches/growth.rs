//! The cost of a platform on three to twelve UPS legs: the time from the text of its spec to the
//! text of its module, and of one evaluation of its regressor by the interpreter.
//!
//! ```sh
//! cargo bench -p regen-tests --bench growth
//! ```
//!
//! The numbers of operations of the programs are printed with the times; `tests/growth.rs` asserts
//! that they grow linearly. The benchmark never fails: times are no test.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use regen_codegen::emit::{Options, module};
use regen_codegen::robot::FunctionKind;
use regen_tests::derived::Derived;
use regen_tests::engine::Engine;
use regen_tests::platform;

const LEGS: [usize; 7] = [3, 4, 5, 6, 8, 10, 12];

fn growth(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("growth");
    group
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2));
    for legs in LEGS {
        let text = platform::ups(legs);
        let generate = || {
            let derived = Derived::without_base("ups.yaml", &text)?;
            let source = module(&derived.robot, &Options::default());
            Ok::<_, String>((derived, source))
        };
        let (derived, source) = match generate() {
            Ok(done) => done,
            Err(error) => {
                eprintln!("{legs} legs: {error}");
                continue;
            }
        };
        let operations = |kind| derived.robot.function(kind).map(|f| f.program.operations());
        println!(
            "{legs} legs: regressor {:?}, module {} kB",
            operations(FunctionKind::Regressor),
            source.len() / 1000
        );
        group.bench_function(BenchmarkId::new("generate", legs), |b| {
            b.iter(|| black_box(generate().is_ok()));
        });
        let q = derived.home();
        let rate = vec![0.1; q.len()];
        group.bench_function(BenchmarkId::new("regressor", legs), |b| {
            b.iter(|| {
                black_box(
                    derived
                        .matrix(FunctionKind::Regressor, &[&q, &rate, &rate])
                        .is_ok(),
                )
            });
        });
    }
    group.finish();
}

criterion_group!(benches, growth);
criterion_main!(benches);
