//! Symbolic derivation of robot dynamics with closed loops.

pub mod diag;
pub mod kinematics;
pub mod model;
pub mod numeric;
pub mod spec;
pub mod sym;
