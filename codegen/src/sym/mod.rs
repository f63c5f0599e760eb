//! Exact numbers and expressions, independent of robots.

mod angle;
mod big_float;
pub mod eval;
mod graph;
mod number;
pub mod print;
mod simplify;
mod surd;
mod tally;
mod tangent;
mod vector;

pub use angle::{Angle, AngleId};
pub use graph::{Ex, Graph, Node, SymbolId, System, SystemId};
pub use number::Number;
pub(crate) use number::NumberFactor;
pub use tally::Tally;
pub use vector::{IDENTITY, M3, V3, ZERO3, transposed};
