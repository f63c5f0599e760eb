//! Times one call that evaluates the base regressor of an interpreted robot at many states. It prints
//! the least processor time of several such calls, in seconds; on systems other than Linux, the least
//! wall-clock time.
//!
//!     cargo run --release -p regen-interpreted --example batch -- robots/puma560.yaml 75000

use std::error::Error;
use std::time::Instant;

use regen_batch::eval_base_many;
use regen_codegen::diag::Source;
use regen_codegen::pipeline;
use regen_interpreted::Interpreted;
use regen_runtime::{Arguments, BaseFunction};

/// The number of calls, of which the fastest counts.
const ROUNDS: usize = 15;

/// The processor time of this process, in seconds; where that is unknown, the time since `begin`.
fn now(begin: Instant) -> f64 {
    let stat = std::fs::read_to_string("/proc/self/schedstat").ok();
    let nanoseconds = stat.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| begin.elapsed().as_secs_f64(), |time| 1e-9 * time)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let path = words.next().ok_or("which description?")?;
    let count: usize = words.next().ok_or("how many states?")?.parse()?;
    let text = std::fs::read_to_string(&path)?;
    let robot = pipeline::derive(&Source::new(&path, &text))?;
    let model = Interpreted::new(&robot);
    let info = model.info();
    let (n, dof) = (info.coordinates.len(), info.independent.len());
    // entry by entry, any values: the time does not depend on them
    let series = |scale: f64| -> Vec<f64> {
        (0..n * count)
            .map(|k| scale * (0.1 * k as f64).sin())
            .collect()
    };
    let (q, qd, qdd) = (series(1.0), series(2.0), series(5.0));
    let arguments = Arguments {
        q: &q,
        qd: &qd,
        qdd: &qdd,
        ..Arguments::EMPTY
    };
    let mut out = vec![0.0; dof * model.rank() * count];
    let mut pivots = vec![0.0; count];
    let function = BaseFunction::BaseRegressor;
    let (start, mut best) = (Instant::now(), f64::MAX);
    for _ in 0..ROUNDS {
        let begin = now(start);
        eval_base_many(&model, function, count, arguments, &mut out, &mut pivots)?;
        best = best.min(now(start) - begin);
    }
    println!("{best:.6}");
    Ok(())
}
