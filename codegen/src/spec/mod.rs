//! From YAML to a validated spec.

mod types;

pub use types::*;
