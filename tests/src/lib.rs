//! The independent checks of the engine: a second derivation of every quantity, written from
//! robotics textbooks alone, and the comparison of an engine with it.
//!
//! `reference` uses none of the other crates. Its computations are dense, numeric and naive on
//! purpose: 4x4 matrices, dual numbers, least squares. `derived` and `compiled` put the code under
//! test behind the interface of `engine`.

#![allow(
    clippy::doc_markdown,
    reason = "A_e and qdd_i are formulas, written as in the equations"
)]

pub mod base;
pub mod compiled;
pub mod derived;
pub mod engine;
pub mod files;
pub mod platform;
pub mod random;
pub mod random_checks;
pub mod random_spec;
pub use regen_reference as reference;

/// Whether tests use the full sample sizes, as `.ci/full` does by setting `REGEN_FULL`; the gate
/// uses the first part of each sample.
pub fn full() -> bool {
    std::env::var_os("REGEN_FULL").is_some()
}

/// The size of a sample that has `all` members in `.ci/full` and `gate` in the gate.
pub fn sample_size(all: u64, gate: u64) -> u64 {
    if full() { all } else { gate }
}
