//! Emits programs as Rust text; independent of how they were derived.

mod base;
mod body;
mod digest;
mod module;
mod names;
mod stated;
mod trait_impl;

pub use digest::digest;
pub use module::{Options, module};
