//! Errors with their places: what is wrong, where in which file, and how to correct it.
//!
//! Independent of robots and YAML: only texts and byte offsets occur here.

mod diagnostic;
mod number;
mod report;
mod sink;
mod source;

pub use diagnostic::Diagnostic;
pub use number::{counted, rounded};
pub use report::{LocatedDiagnostic, Report};
pub use sink::Sink;
pub use source::{Position, Source, Span};
