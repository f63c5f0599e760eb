//! What the engine is judged by: a second derivation of every quantity, written from the
//! robotics alone, and the comparison of an engine with it.
//!
//! `reference` uses nothing of the other crates. Its computations are dense, numeric and naive
//! on purpose: 4x4 matrices, dual numbers, least squares. `derived` and `compiled` put what is
//! judged behind the interface of `engine`.

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
pub mod random_spec;
pub use regen_reference as reference;

/// Whether samples are as large as `.ci/full` takes them, which sets `REGEN_FULL`; the gate takes
/// the first part of each.
pub fn full() -> bool {
    std::env::var_os("REGEN_FULL").is_some()
}
