//! Least squares with statistics of 75,000 equations in 34 parameters, as of a trajectory of the
//! 3-RPS with friction and rotors. Prints the best of some runs in ms; tests/tools/estimation/ratio.py
//! runs it beside numpy.

use std::time::Instant;

use regen_identify::estimate::{Estimate, EstimateError, QrFactor};

const ROWS: usize = 75_000;
const COLUMNS: usize = 34;
const RUNS: usize = 15;

fn main() -> Result<(), EstimateError> {
    // an asymmetric sequence without structure (Weyl's), in -1..1
    let entry = |k: usize| {
        let x = (k as f64 * 0.754_877_666_246_692_7).fract();
        2.0 * (x * x * 12.989_8 + x).fract() - 1.0
    };
    let w: Vec<f64> = (0..ROWS * COLUMNS).map(entry).collect();
    let tau: Vec<f64> = (0..ROWS)
        .map(|t| {
            let exact: f64 = (0..COLUMNS).map(|j| w[j * ROWS + t] * (j + 1) as f64).sum();
            exact + entry(t * 7 + 3)
        })
        .collect();
    let labels: Vec<String> = (0..COLUMNS).map(|j| format!("p{j}")).collect();
    let mut best = f64::INFINITY;
    let mut sum = 0.0;
    for _ in 0..RUNS {
        let start = Instant::now();
        let mut factor = QrFactor::new(labels.clone());
        factor.push_block(&w, &tau)?;
        let estimate = Estimate::of(&factor)?;
        sum += estimate.values.iter().sum::<f64>() + estimate.sigma(0);
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!("{:.3} ms", best * 1e3);
    // the sum is used, so that the compiler does not remove the work
    assert!(sum.is_finite());
    Ok(())
}
