//! Rust: a module of generic functions, constants, and a type that implements the runtime's traits.

mod base;
mod geometry;
mod module;
mod names;
mod stated;
mod statements;
mod trait_impl;

pub use module::{Options, module};
