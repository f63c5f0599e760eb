//! What may stand where: each record lists its keys once, and that list reads files, finds unknown and missing
//! keys, and writes the JSON Schema.

mod choice;
mod collection;
pub(super) mod json;
mod leaf;
mod record;

pub(super) use choice::{Choice, Chosen, choices};
pub(super) use collection::{Located, Ordered};
pub(super) use leaf::{
    BodyReference, ConstantName, CoordinateReference, CouplingForm, Flag, Label, LabelKey, Name,
    ParameterForm, ParameterReference, ParameterSymbol, RobotName, Scalar, Text, Word,
};
pub(super) use record::{Field, Layout, describe_record, read_default, record};

use std::rc::Rc;

use json::{Definitions, Json};

use super::yaml::Node;
use crate::diag::{Diagnostic, Sink};

/// Something that is read from a node.
pub(super) trait Shape: Sized {
    /// What errors expect: `a number or an expression`.
    const EXPECTED: &'static str;
    /// Whether its title says what it is, so that paths need not name the key above the list.
    const NAMES_ITSELF: bool = false;
    /// Whether it is a list of such.
    const ITEMS_NAME_THEMSELVES: bool = false;

    /// Reads it, or reports why not.
    fn read(node: &Node, reader: &mut Reader) -> Option<Self>;

    /// Its JSON Schema.
    fn schema(definitions: &mut Definitions) -> Json;

    /// What paths call it as an item of a list.
    fn title(_node: &Node, index: usize) -> String {
        format!("entry {}", index + 1)
    }
}

/// Where reading is, and the errors so far.
pub(super) struct Reader {
    sink: Sink,
    path: Vec<String>,
}

impl Reader {
    /// At the top of a file.
    pub(super) fn new() -> Self {
        Self {
            sink: Sink::new(),
            path: Vec::new(),
        }
    }

    /// The errors.
    pub(super) fn into_sink(self) -> Sink {
        self.sink
    }

    /// Does something one level down.
    fn within<T>(&mut self, segment: impl Into<String>, act: impl FnOnce(&mut Self) -> T) -> T {
        self.path.push(segment.into());
        let result = act(self);
        self.path.pop();
        result
    }

    /// The path in words.
    fn path(&self) -> Rc<str> {
        join(&self.path).into()
    }

    /// Adds an error here.
    fn report(&mut self, diagnostic: Diagnostic) {
        self.sink.push(diagnostic.path(join(&self.path)));
    }

    /// Adds an error that belongs to the record around this field.
    fn report_above(&mut self, diagnostic: Diagnostic) {
        let above = self.path.len().saturating_sub(1);
        self.sink.push(diagnostic.path(join(&self.path[..above])));
    }

    /// Adds "expected this, found that".
    fn mismatch(&mut self, expected: &str, node: &Node) {
        let message = match node.describe().as_str() {
            "nothing" => format!("expected {expected}, found nothing"),
            found => format!("expected {expected}, found {found}"),
        };
        self.report(Diagnostic::new(node.span, message));
    }
}

/// Segments as words; quoted ones belong to the word before them.
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
