//! YAML as a tree of nodes with their places in the text.

use core::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::{Location, Spanned};

use super::Mistake;

/// A node of the document.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) kind: NodeKind,
    /// The byte at which it begins.
    pub(crate) at: usize,
}

/// The content of a node.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum NodeKind {
    Null,
    Flag(bool),
    Whole(u64),
    Number(f64),
    Text(String),
    List(Vec<Node>),
    /// Keys are unique and in the order of the file.
    Map(Vec<(Key, Node)>),
}

/// A key of a mapping.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Key {
    pub(crate) text: String,
    pub(crate) at: usize,
}

impl Node {
    /// Parses a text.
    pub(crate) fn parse(text: &str) -> Result<Self, Mistake> {
        let options = serde_saphyr::options! {
            strict_booleans: true,
            leading_zero_numbers_as_strings: true,
            underscored_numbers_as_strings: true,
            with_snippet: false,
        };
        serde_saphyr::from_str_with_options(text, options).map_err(|error| {
            let whole = error.to_string();
            // without its own place, which is told beside it
            let message = whole.split(" at line ").next().unwrap_or(&whole);
            let message = message.split(" (line ").next().unwrap_or(message);
            Mistake {
                at: error.location().map_or(0, |place| byte(text, place)),
                path: String::new(),
                message: format!("not YAML: {message}"),
                remedy: None,
            }
        })
    }

    /// The value of a key; `None` if this is not a mapping with that key.
    pub(crate) fn get(&self, key: &str) -> Option<&Self> {
        self.entries()
            .iter()
            .find(|(own, _)| own.text == key)
            .map(|(_, node)| node)
    }

    /// The entries of a mapping; none of other nodes.
    pub(crate) fn entries(&self) -> &[(Key, Self)] {
        match &self.kind {
            NodeKind::Map(entries) => entries,
            _ => &[],
        }
    }

    /// The items of a list; none of other nodes.
    pub(crate) fn items(&self) -> &[Self] {
        match &self.kind {
            NodeKind::List(items) => items,
            _ => &[],
        }
    }

    /// The text of a node that is text.
    pub(crate) fn text(&self) -> Option<&str> {
        match &self.kind {
            NodeKind::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The number of a node that is one.
    pub(crate) fn number(&self) -> Option<f64> {
        match self.kind {
            NodeKind::Whole(value) => Some(value as f64),
            NodeKind::Number(value) => Some(value),
            _ => None,
        }
    }

    /// The whole number of a node that is one.
    pub(crate) fn whole(&self) -> Option<u64> {
        match self.kind {
            NodeKind::Whole(value) => Some(value),
            _ => None,
        }
    }

    /// The node without places.
    pub(crate) fn to_json(&self) -> serde_json::Value {
        match &self.kind {
            NodeKind::Null => serde_json::Value::Null,
            NodeKind::Flag(value) => (*value).into(),
            NodeKind::Whole(value) => (*value).into(),
            NodeKind::Number(value) => (*value).into(),
            NodeKind::Text(text) => text.as_str().into(),
            NodeKind::List(items) => items.iter().map(Self::to_json).collect(),
            NodeKind::Map(entries) => entries
                .iter()
                .map(|(key, node)| (key.text.clone(), node.to_json()))
                .collect(),
        }
    }

    /// How messages call the contents.
    pub(crate) fn describe(&self) -> String {
        match &self.kind {
            NodeKind::Null => "nothing".to_owned(),
            NodeKind::Flag(value) => format!("'{value}'"),
            NodeKind::Whole(value) => format!("'{value}'"),
            NodeKind::Number(value) => format!("'{value}'"),
            NodeKind::Text(text) => format!("'{}'", shorten(text)),
            NodeKind::List(_) => "a list".to_owned(),
            NodeKind::Map(_) => "a mapping".to_owned(),
        }
    }
}

/// A text, cut to a length that fits into a message.
pub(crate) fn shorten(text: &str) -> String {
    const MAX_CHARACTERS: usize = 40;
    match text.char_indices().nth(MAX_CHARACTERS) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// The byte of a place in a text.
fn byte(text: &str, place: Location) -> usize {
    if let Some(at) = place.span().byte_offset() {
        return usize::try_from(at).unwrap_or(text.len());
    }
    let line = usize::try_from(place.line()).unwrap_or(1).max(1);
    let column = usize::try_from(place.column()).unwrap_or(1).max(1);
    let lines = text.split_inclusive('\n');
    let before: usize = lines.take(line - 1).map(str::len).sum();
    let own = text.get(before..).unwrap_or_default();
    let within = own.char_indices().nth(column - 1);
    before + within.map_or(0, |(at, _)| at)
}

/// The byte of the place at which a node is used.
fn offset(place: Location) -> usize {
    let at = place.span().byte_offset();
    at.and_then(|at| usize::try_from(at).ok()).unwrap_or(0)
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let found = Spanned::<NodeKind>::deserialize(deserializer)?;
        Ok(Self {
            kind: found.value,
            at: offset(found.referenced),
        })
    }
}

impl<'de> Deserialize<'de> for NodeKind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(KindVisitor)
    }
}

struct KindVisitor;

impl<'de> Visitor<'de> for KindVisitor {
    type Value = NodeKind;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a YAML value")
    }

    fn visit_unit<E>(self) -> Result<NodeKind, E> {
        Ok(NodeKind::Null)
    }

    fn visit_none<E>(self) -> Result<NodeKind, E> {
        Ok(NodeKind::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<NodeKind, E> {
        Ok(NodeKind::Flag(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<NodeKind, E> {
        Ok(NodeKind::Whole(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<NodeKind, E> {
        Ok(u64::try_from(value).map_or(NodeKind::Number(value as f64), NodeKind::Whole))
    }

    fn visit_f64<E>(self, value: f64) -> Result<NodeKind, E> {
        Ok(NodeKind::Number(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<NodeKind, E> {
        Ok(NodeKind::Text(value.to_owned()))
    }

    fn visit_string<E>(self, value: String) -> Result<NodeKind, E> {
        Ok(NodeKind::Text(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<NodeKind, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = list.next_element()? {
            items.push(item);
        }
        Ok(NodeKind::List(items))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<NodeKind, A::Error> {
        let mut entries = Vec::new();
        while let Some(key) = map.next_key::<Spanned<String>>()? {
            let value = map.next_value()?;
            let key = Key {
                text: key.value,
                at: offset(key.referenced),
            };
            entries.push((key, value));
        }
        Ok(NodeKind::Map(entries))
    }
}
