//! The JSON Schema of the format, generated from the same lists of keys that read files.

use super::raw::RawSpec;
use super::shape::Shape;
use super::shape::json::{Definitions, Json};

/// The JSON Schema of robot specs (draft 2020-12), the same text in every run.
///
/// Editors complete and check `robots/*.yaml` with it. It describes the shapes of records only;
/// [`parse`](super::parse) also checks that names and labels exist, and which values they have.
pub fn schema() -> String {
    let mut definitions = Definitions::new();
    let reference = RawSpec::schema(&mut definitions);
    let root = Json::object([
        (
            "$schema",
            Json::text("https://json-schema.org/draft/2020-12/schema"),
        ),
        ("title", Json::text("Robot spec")),
    ]);
    let Json::Object(entries) = reference else {
        return root.pretty();
    };
    entries
        .into_iter()
        .fold(root, |root, (key, value)| root.with(&key, value))
        .with("$defs", Json::Object(definitions))
        .pretty()
}
