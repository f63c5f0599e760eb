//! Reads from object files which functions call which, which symbols no file defines, and how much
//! stack the functions take.
//!
//! A compiler puts every function and every constant into a section of its own, and refers from one
//! to the other by relocations. Sections and relocations are therefore a graph with every call
//! except those of function pointers that a caller passes in. Frames are read from x86-64
//! instructions.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a tool of tests: what it cannot read ends them"
)]

mod code;
mod graph;
mod libraries;
mod stack;

pub use code::Code;
pub use graph::{Graph, Section};
pub use libraries::{cargo, features, fixture, full, image, root};
pub use stack::{cycle, deepest};
