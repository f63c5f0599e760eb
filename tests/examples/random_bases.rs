//! The base parameters of many random mechanisms with loops, judged one by one: as many as the
//! certified rank, and `W(all) = W(base) * combinations` in every row of the second derivation.
//!
//! ```sh
//! cargo run --release -p regen-tests --example random_bases -- 0 1000
//! ```
//!
//! `tests/base/RECORD.md` keeps what it printed.

use std::process::ExitCode;
use std::time::Instant;

use regen_tests::base::{Judged, judge};
use regen_tests::random_spec;

fn main() -> ExitCode {
    let arguments: Vec<u64> = std::env::args().skip(1).flat_map(|a| a.parse()).collect();
    let [first, count] = arguments[..] else {
        eprintln!("usage: random_bases FIRST_SEED COUNT");
        return ExitCode::from(2);
    };
    let (mut judged, mut short, mut directions, mut failed) = (0_usize, 0_usize, 0_usize, 0_usize);
    let mut worst = (0.0_f64, first);
    let mut slowest = (0.0_f64, first);
    for seed in first..first + count {
        let start = Instant::now();
        let text = random_spec::closed_loop(seed);
        let found = text.clone().and_then(|text| judge(&text, seed));
        let seconds = start.elapsed().as_secs_f64();
        if seconds > slowest.0 {
            slowest = (seconds, seed);
        }
        match found {
            Ok(Judged {
                error, completed, ..
            }) => {
                judged += 1;
                if completed > 0 {
                    short += 1;
                    directions += completed;
                    println!("seed {seed}: trees fall short by {completed}");
                }
                if error > worst.0 {
                    worst = (error, seed);
                }
            }
            Err(why) => {
                failed += 1;
                println!("seed {seed}: {why}");
                if let Ok(text) = text {
                    println!("{text}");
                }
            }
        }
    }
    println!(
        "{judged} of {count} hold from seed {first} on, {failed} fail; worst row {:.1e} (seed {}); \
         trees fall short in {short}, by {directions} directions; slowest {:.2} s (seed {})",
        worst.0, worst.1, slowest.0, slowest.1
    );
    ExitCode::from(u8::from(failed > 0))
}
