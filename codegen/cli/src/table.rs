//! The layout of printed results: plain tables of at most 80 columns, numbers, and JSON.

use serde::Serialize;

#[cfg(test)]
pub(crate) use regen_codegen::explain::lines::WIDTH;
pub(crate) use regen_codegen::explain::lines::{columns, field};
pub(crate) use regen_identify::text::{figure, figure_of};
use regen_report::documents::Versioned;

/// An object as JSON text, which starts with the version of its schema.
pub(crate) fn document<T: Serialize>(value: &T) -> String {
    json(&Versioned::new(value))
}

/// A value as JSON text. All printed values have string keys in maps and finite numbers, so that
/// serialising cannot fail.
pub(crate) fn json<T: Serialize>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_default() + "\n"
}
