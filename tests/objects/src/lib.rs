//! Object files, read as what the machine would run: which functions call which, what they need
//! that no file defines, and how much of the stack they take.
//!
//! A compiler puts every function and every constant into a section of its own, and refers from
//! one to the other by relocations. Sections and relocations are therefore a graph that misses
//! no call: an address that comes from anywhere else was handed in by the caller. Frames are read
//! from x86-64 instructions.
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
pub use libraries::{fixture, image, root};
pub use stack::{cycle, deepest};
