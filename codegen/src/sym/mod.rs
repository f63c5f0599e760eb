//! Exact numbers and expressions.

mod number;
mod real;
mod surd;

pub use number::Number;
