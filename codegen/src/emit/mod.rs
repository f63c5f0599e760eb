//! Emits programs as text of a programming language; independent of how they were derived.
//!
//! What all languages share: `plan` cuts a program into blocks and names its values, `body` walks
//! through the plan, `elements` names what sizes count, and `documentation` has the sentences that
//! headers contain. A `Language` spells operations and statements. `rust` and `c` write the files
//! around the functions.

mod body;
pub mod c;
mod digest;
mod documentation;
mod elements;
mod language;
mod names;
mod plan;
mod rust;
mod text;

pub use digest::digest;
pub use rust::{Options, module};
