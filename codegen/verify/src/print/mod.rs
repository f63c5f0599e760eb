//! Reports of checks as tables for people, as Markdown and as JSON.
//!
//! ```
//! # use regen_codegen::{diag::Source, pipeline};
//! # let text = "\
//! # name: arm
//! # limbs:
//! #   - name: arm
//! #     joints:
//! #       - {name: q1, type: revolute, body: link, actuated: true}
//! # ";
//! let robot = pipeline::derive(&Source::new("arm.yaml", text))?;
//! let report = regen_verify::identities(&robot)?;
//! let table = regen_verify::print::identities_text(&report);
//! assert!(table.lines().all(|line| line.len() <= 80));
//! assert!(!table.contains("FAILED"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod one;
mod several;

use serde::Serialize;

pub use one::{CheckJson, checks, identities_text, one_json, one_text};
pub use several::{OfFile, several_json, several_markdown, several_text};

/// One line of JSON. The values that are printed have string keys in maps, so that serialising
/// cannot fail.
fn to_json<T: Serialize>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_default() + "\n"
}
