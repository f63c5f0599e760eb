//! Values that are written as one of several words.

use super::json::{Definitions, Json, defined};
use super::{Reader, Shape};
use crate::diag::{Diagnostic, Span};
use crate::spec::suggest::{did_you_mean, one_of};
use crate::spec::yaml::{Kind, Node, shorten};

/// A type with a word for each of its values.
pub(in crate::spec) trait Choice: Copy + PartialEq + 'static {
    /// The noun for a value in messages, such as `joint type`.
    const NOUN: &'static str;
    /// The word, the value itself and its description, for each value.
    const ALL: &'static [(&'static str, Self, &'static str)];

    /// The word for a value.
    fn word(self) -> &'static str {
        Self::ALL
            .iter()
            .find(|(_, value, _)| *value == self)
            .map_or("", |(word, ..)| word)
    }
}

/// A value with its place in the file.
#[derive(Clone, Copy, Debug)]
pub(in crate::spec) struct Chosen<T> {
    pub(in crate::spec) value: T,
    pub(in crate::spec) span: Span,
}

impl<T: Choice> Shape for Chosen<T> {
    const EXPECTED: &'static str = T::NOUN;

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let words = || T::ALL.iter().map(|(word, ..)| *word);
        let Kind::Scalar(scalar) = &node.kind else {
            reader.mismatch(&one_of(words()), node);
            return None;
        };
        if let Some((_, value, _)) = T::ALL.iter().find(|(word, ..)| *word == scalar.text) {
            return Some(Chosen {
                value: *value,
                span: node.span,
            });
        }
        if scalar.is_null() {
            reader.mismatch(&one_of(words()), node);
            return None;
        }
        let near = did_you_mean(&scalar.text, words());
        let message = format!("unknown {} '{}'{near}", T::NOUN, shorten(&scalar.text));
        reader.report_above(
            Diagnostic::new(node.span, message).hint(format!("it is one of {}", one_of(words()))),
        );
        None
    }

    fn schema(definitions: &mut Definitions) -> Json {
        defined(&T::NOUN.replace(' ', "_"), definitions, |_| {
            Json::object([
                ("type", Json::text("string")),
                ("enum", Json::texts(T::ALL.iter().map(|(word, ..)| *word))),
                (
                    "enumDescriptions",
                    Json::texts(T::ALL.iter().map(|(.., meaning)| *meaning)),
                ),
            ])
        })
    }
}

/// Implements [`Choice`] for a type: its noun, and the words and meanings of its values.
macro_rules! choices {
    ($type:ty, $noun:literal { $($word:literal => $value:ident: $meaning:literal,)+ }) => {
        impl $crate::spec::shape::Choice for $type {
            const NOUN: &'static str = $noun;
            const ALL: &'static [(&'static str, Self, &'static str)] =
                &[$(($word, Self::$value, $meaning)),+];
        }
    };
}
pub(in crate::spec) use choices;
