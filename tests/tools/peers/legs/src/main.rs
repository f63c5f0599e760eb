//! Prints, for platforms on three to twelve UPS legs, the time in nanoseconds of one evaluation of
//! the regressor of all parameters at home: the minimum of many interleaved rounds.
#![allow(dead_code)]

use std::hint::black_box;
use std::time::{Duration, Instant};

include!(concat!(env!("OUT_DIR"), "/platforms.rs"));

struct Platform {
    legs: usize,
    run: Box<dyn FnMut()>,
    least: Duration,
}

const CALLS: u32 = 64;

macro_rules! platforms {
    ($($legs:literal $module:ident),*) => {
        vec![$({
            use $module::{COORDINATES, HOME, INDEPENDENT, PARAMETERS};
            const N: usize = COORDINATES.len();
            let rates: [[f64; N]; 2] =
                [0.3, 1.1].map(|k| std::array::from_fn(|i| (k + 1.7 * i as f64).sin()));
            let mut w = vec![[0.0; INDEPENDENT.len()]; PARAMETERS.len()];
            let run = move || {
                for _ in 0..CALLS {
                    let w = w.as_mut_slice().try_into().expect("as many columns");
                    let (q, [qd, qdd]) = black_box((&HOME, &rates));
                    black_box($module::regressor(q, qd, qdd, w).pivot);
                }
            };
            Platform { legs: $legs, run: Box::new(run), least: Duration::MAX }
        }),*]
    };
}

fn main() {
    let mut all = platforms![3 ups3, 4 ups4, 5 ups5, 6 ups6, 8 ups8, 10 ups10, 12 ups12];
    for _ in 0..300 {
        for platform in &mut all {
            let start = Instant::now();
            (platform.run)();
            platform.least = platform.least.min(start.elapsed());
        }
    }
    for Platform { legs, least, .. } in all {
        println!("{legs} {:.1}", least.as_secs_f64() * 1e9 / f64::from(CALLS));
    }
}
