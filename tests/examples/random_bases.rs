//! Checks the base parameters of many random mechanisms one by one: their number is the certified
//! rank, and `W(all) = W(base) * combinations` in every row of the second derivation.
//!
//! ```sh
//! cargo run --release -p regen-tests --features examples --example random_bases -- 0 1000
//! ```
//!
//! Seeds count up from the first argument until the given number of mechanisms has been checked.
//! `tests/records/base.md` contains the output of a run.

use std::process::ExitCode;
use std::time::Instant;

use regen_tests::base::{Verdict, check_base};
use regen_tests::random_spec;

#[derive(Default)]
struct Count {
    judged: usize,
    short: usize,
    directions: usize,
    with_numbers: usize,
    rows: usize,
    unproven: usize,
    uncertified: usize,
    failed: usize,
    worst: (f64, u64),
    slowest: (f64, u64),
}

fn main() -> ExitCode {
    let numbers: Vec<u64> = std::env::args().skip(1).flat_map(|a| a.parse()).collect();
    let [first, wanted] = numbers[..] else {
        eprintln!("usage: random_bases FIRST_SEED COUNT");
        return ExitCode::from(2);
    };
    let mut count = Count::default();
    let mut seed = first;
    while count.judged + count.failed < usize::try_from(wanted).unwrap_or(0) {
        if let Ok(text) = random_spec::closed_loop(seed) {
            count.add(seed, &text);
        }
        seed += 1;
    }
    println!(
        "seeds {first} to {}: {} judged, {} fail; worst row {:.1e} \
         (seed {}); trees fall short in {}, by {} directions, with factors that are numbers only \
         in {}; {} of {} rows are neither derived nor proven; {} more say themselves that they cannot be certified; slowest {:.2} s (seed {})",
        seed - 1,
        count.judged + count.failed,
        count.failed,
        count.worst.0,
        count.worst.1,
        count.short,
        count.directions,
        count.with_numbers,
        count.unproven,
        count.rows,
        count.uncertified,
        count.slowest.0,
        count.slowest.1
    );
    ExitCode::from(u8::from(count.failed > 0))
}

impl Count {
    fn add(&mut self, seed: u64, text: &str) {
        let start = Instant::now();
        let verdict = check_base(text, seed);
        let seconds = start.elapsed().as_secs_f64();
        if seconds > self.slowest.0 {
            self.slowest = (seconds, seed);
        }
        match verdict {
            Ok(Verdict::Correct(found)) => {
                self.judged += 1;
                self.rows += found.rank;
                self.unproven += found.unproven;
                if found.completed > 0 {
                    self.short += 1;
                    self.directions += found.completed;
                    self.with_numbers += usize::from(found.numbers > 0);
                }
                if found.error > self.worst.0 {
                    self.worst = (found.error, seed);
                }
            }
            Ok(Verdict::Uncertified(why)) => {
                self.uncertified += 1;
                println!("seed {seed}: not certified: {why}");
            }
            Ok(Verdict::Wrong(why)) | Err(why) => {
                self.failed += 1;
                println!("seed {seed}: {why}\n{text}");
            }
        }
    }
}
