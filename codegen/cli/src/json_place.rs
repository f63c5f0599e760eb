//! Where mistakes in a JSON file stand: its parts are parsed one by one, each a slice of the text.

use regen_codegen::diag::{Diagnostic, Source, Span};
use serde_json::error::Category;
use serde_json::value::RawValue;

/// Where a part of the source's text starts in it.
pub(crate) fn offset(source: &Source, part: &str) -> usize {
    let start = source.text.as_ptr() as usize;
    (part.as_ptr() as usize).saturating_sub(start)
}

/// A mistake in a value.
pub(crate) fn mistake(
    source: &Source,
    raw: &RawValue,
    path: &str,
    message: &str,
    hint: &str,
) -> Diagnostic {
    let start = offset(source, raw.get());
    Diagnostic::new(Span::new(start, start + 1), message)
        .path(path)
        .hint(hint)
}

/// An error of the JSON parser in a part of the text, with its place in the whole.
pub(crate) fn unparsed(
    source: &Source,
    part: &str,
    error: &serde_json::Error,
    path: &str,
) -> Diagnostic {
    let line_start: usize = part
        .split_inclusive('\n')
        .take(error.line().saturating_sub(1))
        .map(str::len)
        .sum();
    let at = offset(source, part) + line_start + error.column().saturating_sub(1);
    // Without its own " at line 1 column 2", which counts from the part.
    let whole = error.to_string();
    let message = whole.rsplit_once(" at line ").map_or(&*whole, |(m, _)| m);
    let message = match error.classify() {
        Category::Syntax | Category::Eof => format!("not JSON: {message}"),
        Category::Data | Category::Io => message.to_owned(),
    };
    Diagnostic::new(Span::new(at, at + 1), message).path(path)
}
