//! From programs to Rust text. Knows nothing of how they were derived.

mod base;
mod body;
mod module;
mod names;
mod stated;
mod trait_impl;

pub use module::{Options, module};
