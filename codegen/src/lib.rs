//! Symbolic derivation of robot dynamics with closed loops.

pub mod diag;
pub mod spec;
pub mod sym;
