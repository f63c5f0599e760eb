//! The program `regen`; see the library of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    regen_cli::main()
}
