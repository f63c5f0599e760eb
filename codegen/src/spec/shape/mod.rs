//! Shapes of YAML values. Each record lists its keys once, and that list is used to read files, to
//! find unknown and missing keys, and to write the JSON Schema.

mod choice;
mod collection;
pub(super) mod json;
mod leaf;
mod record;

pub(super) use choice::{Choice, Chosen, choices};
pub(super) use collection::{Located, Ordered};
pub(super) use leaf::{
    BodyReference, ConstantName, CoordinateReference, CouplingForm, Flag, Label, LabelKey, Name,
    ParameterForm, ParameterReference, ParameterSymbol, RobotName, Scalar, TermExpression,
    TermName, Text, Word,
};
pub(super) use record::{Field, Layout, describe_record, read_default, record};

use std::rc::Rc;

use json::{Definitions, Json};

use super::yaml::Node;
use crate::diag::{Diagnostic, Sink};

/// A type that can be read from a YAML node.
pub(super) trait Shape: Sized {
    /// The noun phrase for the value in errors ("expected ..."): `a number or an expression`.
    const EXPECTED: &'static str;
    /// Whether the title of the value contains its kind, so that paths need not include the key of
    /// the list.
    const NAMES_ITSELF: bool = false;
    /// Whether the value is a list of items with such titles.
    const ITEMS_NAME_THEMSELVES: bool = false;

    /// Reads the value from a node; `None` after reporting an error.
    fn read(node: &Node, reader: &mut Reader) -> Option<Self>;

    /// The JSON Schema of the value.
    fn schema(definitions: &mut Definitions) -> Json;

    /// The name of the value in paths, as an item of a list.
    fn title(_node: &Node, index: usize) -> String {
        format!("entry {}", index + 1)
    }
}

/// The current path and the errors so far.
pub(super) struct Reader {
    sink: Sink,
    path: Vec<String>,
}

impl Reader {
    /// A reader at the top of a file.
    pub(super) fn new() -> Self {
        Self {
            sink: Sink::new(),
            path: Vec::new(),
        }
    }

    /// The errors so far.
    pub(super) fn into_sink(self) -> Sink {
        self.sink
    }

    /// Calls `act` with one more segment in the path.
    fn within<T>(&mut self, segment: impl Into<String>, act: impl FnOnce(&mut Self) -> T) -> T {
        self.path.push(segment.into());
        let result = act(self);
        self.path.pop();
        result
    }

    /// The current path, in words.
    fn path(&self) -> Rc<str> {
        join(&self.path).into()
    }

    /// Adds an error at the current path.
    fn report(&mut self, diagnostic: Diagnostic) {
        self.sink.push(diagnostic.path(join(&self.path)));
    }

    /// Adds an error at the path of the record that contains the current field.
    fn report_above(&mut self, diagnostic: Diagnostic) {
        let above = self.path.len().saturating_sub(1);
        self.sink.push(diagnostic.path(join(&self.path[..above])));
    }

    /// Adds an error of the form "expected this, found that".
    fn mismatch(&mut self, expected: &str, node: &Node) {
        let message = match node.describe().as_str() {
            "nothing" => format!("expected {expected}, found nothing"),
            found => format!("expected {expected}, found {found}"),
        };
        self.report(Diagnostic::new(node.span, message));
    }
}

/// Joins segments of a path to a text; quoted segments belong to the word before them.
fn join(segments: &[String]) -> String {
    let mut words = String::new();
    for segment in segments {
        if !words.is_empty() {
            words.push_str(if segment.starts_with('\'') { " " } else { ", " });
        }
        words.push_str(segment);
    }
    words
}
