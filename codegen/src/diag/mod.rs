//! Errors with places: what went wrong, where in which file, and how to mend it.
//!
//! Knows text and byte offsets, nothing of robots or YAML.

mod diagnostic;
mod report;
mod sink;
mod source;

pub use diagnostic::Diagnostic;
pub use report::{Report, Shown};
pub use sink::Sink;
pub use source::{Position, Source, Span};
