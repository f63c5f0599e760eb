//! Symbolic derivation of robot dynamics with closed loops, from a YAML spec to specialised Rust.
//! [`Mechanism`] is the entry point; `pipeline.rs` shows the whole derivation in one file.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.

pub mod base;
mod bytes;
mod checks;
pub mod constraints;
pub mod diag;
pub mod digest;
pub mod dynamics;
pub mod emit;
pub mod explain;
pub mod functions;
pub mod interpret;

pub mod kinematics;
pub mod model;
pub mod numeric;
pub mod optimize;
pub mod pipeline;
pub mod robot;
pub mod scene;
pub mod signature;
pub mod spec;
pub mod store;
pub mod sym;

pub use pipeline::Mechanism;
