//! Generates the module of a platform on UPS legs, without base parameters, a given number of
//! times: for counting instructions, which unlike time do not depend on the load of the machine.
//!
//! ```sh
//! cargo build --release -p regen-tests --features examples --example platform_once
//! for legs in 3 6 12; do for times in 1 2; do
//!     valgrind --tool=callgrind --callgrind-out-file=/dev/null \
//!         target/release/examples/platform_once $legs $times
//! done; done
//! ```

use std::process::ExitCode;

use regen_codegen::emit::{Options, module};
use regen_tests::derived::Derived;
use regen_tests::platform;

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).map(|a| a.parse::<usize>().ok());
    let (Some(Some(legs)), Some(Some(times))) = (numbers.next(), numbers.next()) else {
        eprintln!("platform_once LEGS TIMES");
        return ExitCode::from(2);
    };
    let text = platform::ups(legs);
    for _ in 0..times {
        match Derived::without_base("ups.yaml", &text) {
            Ok(derived) => println!("{}", module(&derived.robot, &Options::default()).len()),
            Err(error) => {
                eprintln!("{error}");
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}
