//! Times a cycle of the closure: `cargo run --release -p regen-control --example cycle`.
#![allow(clippy::unwrap_used, clippy::cast_possible_truncation)]

use std::hint::black_box;
use std::time::Instant;

use regen_control::closure;
use regen_generated::{delta, fivebar, rps3};

macro_rules! timed {
    ($name:literal, $module:ident :: $model:ident, $number:ident, $size:expr) => {{
        let mut closure = <closure!($module::$model, $number)>::new(&$module::$model).unwrap();
        let home = closure.q_i();
        let rates = home.map(|_| 0.1);
        let mut least = f64::INFINITY;
        for _ in 0..50 {
            let start = Instant::now();
            for k in 0..1000 {
                // a cycle of 1 ms on a sine of 1 Hz
                let wave = $size * (0.001 * f64::from(k) * std::f64::consts::TAU).sin();
                let q_i = home.map(|x| x + wave as $number);
                assert!(closure.track(black_box(&q_i), 6).is_closed());
                black_box(closure.motion(black_box(&rates), &rates));
            }
            least = least.min(start.elapsed().as_secs_f64() * 1e6);
        }
        println!(
            "{} on {}: {:.0} ns a cycle",
            $name,
            stringify!($number),
            least
        );
    }};
}

fn main() {
    timed!("five-bar", fivebar::Fivebar, f64, 0.1);
    timed!("five-bar", fivebar::Fivebar, f32, 0.1);
    timed!("3-RPS", rps3::Rps3, f64, 0.05);
    timed!("3-RPS", rps3::Rps3, f32, 0.05);
    timed!("delta", delta::Delta, f64, 0.1);
    timed!("delta", delta::Delta, f32, 0.1);
}
