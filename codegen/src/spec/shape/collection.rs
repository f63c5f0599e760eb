//! Lists, and mappings with arbitrary keys.

use super::json::{Definitions, Json};
use super::{Reader, Shape};
use crate::diag::{Diagnostic, Span};
use crate::spec::yaml::{Kind, Node};

impl<T: Shape> Shape for Vec<T> {
    const EXPECTED: &'static str = "a list";
    const ITEMS_NAME_THEMSELVES: bool = T::NAMES_ITSELF;

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let Kind::List(items) = &node.kind else {
            reader.mismatch(&format!("a list, each entry {}", T::EXPECTED), node);
            return None;
        };
        // read every item, also after an error, so that all errors are reported
        let read: Vec<Option<T>> = items
            .iter()
            .enumerate()
            .map(|(index, item)| {
                reader.within(T::title(item, index), |reader| T::read(item, reader))
            })
            .collect();
        read.into_iter().collect()
    }

    fn schema(definitions: &mut Definitions) -> Json {
        Json::object([
            ("type", Json::text("array")),
            ("items", T::schema(definitions)),
        ])
    }
}

impl<T: Shape, const N: usize> Shape for [T; N] {
    const EXPECTED: &'static str = "a list";

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let Kind::List(entries) = &node.kind else {
            reader.mismatch(&format!("a list of {N}, each entry {}", T::EXPECTED), node);
            return None;
        };
        let count = entries.len();
        let items = Vec::<T>::read(node, reader);
        if count != N {
            let message = format!("expected {N} entries, found {count}");
            reader.report(Diagnostic::new(node.span, message));
            return None;
        }
        items?.try_into().ok()
    }

    fn schema(definitions: &mut Definitions) -> Json {
        let count = i64::try_from(N).unwrap_or(i64::MAX);
        Vec::<T>::schema(definitions)
            .with("minItems", Json::Integer(count))
            .with("maxItems", Json::Integer(count))
    }
}

/// A value with its place in the file.
#[derive(Clone, Debug)]
pub(in crate::spec) struct Located<T> {
    pub(in crate::spec) value: T,
    pub(in crate::spec) span: Span,
}

impl<T: Shape> Shape for Located<T> {
    const EXPECTED: &'static str = T::EXPECTED;
    const ITEMS_NAME_THEMSELVES: bool = T::ITEMS_NAME_THEMSELVES;

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let span = node.span;
        T::read(node, reader).map(|value| Self { value, span })
    }

    fn schema(definitions: &mut Definitions) -> Json {
        T::schema(definitions)
    }
}

/// A mapping with arbitrary keys, in the order of the file.
#[derive(Clone, Debug)]
pub(in crate::spec) struct Ordered<K, V>(pub(in crate::spec) Vec<(K, V)>);

impl<K: Shape, V: Shape> Shape for Ordered<K, V> {
    const EXPECTED: &'static str = "a mapping";

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let Kind::Map(entries) = &node.kind else {
            reader.mismatch(
                &format!("a mapping from {} to {}", K::EXPECTED, V::EXPECTED),
                node,
            );
            return None;
        };
        let read: Vec<Option<(K, V)>> = entries
            .iter()
            .map(|(key, value)| {
                let name = Node::plain(&key.text, key.span);
                let name = K::read(&name, reader);
                let value =
                    reader.within(format!("'{}'", key.text), |reader| V::read(value, reader));
                name.zip(value)
            })
            .collect();
        let entries = read.into_iter().collect::<Option<Vec<_>>>()?;
        Some(Self(entries))
    }

    fn schema(definitions: &mut Definitions) -> Json {
        Json::object([
            ("type", Json::text("object")),
            ("propertyNames", K::schema(definitions)),
            ("additionalProperties", V::schema(definitions)),
        ])
    }
}
