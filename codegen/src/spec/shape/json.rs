//! A minimal JSON value, for writing the schema.

use std::fmt::Write;

/// A JSON value; objects keep the order of their entries.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::spec) enum Json {
    Bool(bool),
    Integer(i64),
    /// A number, with the digits as written.
    Number(String),
    Text(String),
    Array(Vec<Json>),
    Object(Vec<(String, Json)>),
}

/// The named definitions of the schema, in the order of their first use.
pub(in crate::spec) type Definitions = Vec<(String, Json)>;

/// A reference to a named definition, which `make` builds at its first use.
pub(in crate::spec) fn defined(
    name: &str,
    definitions: &mut Definitions,
    make: impl FnOnce(&mut Definitions) -> Json,
) -> Json {
    if !definitions.iter().any(|(known, _)| known == name) {
        let place = definitions.len();
        definitions.push((name.to_owned(), Json::Bool(true)));
        definitions[place].1 = make(definitions);
    }
    Json::object([("$ref", Json::text(format!("#/$defs/{name}")))])
}

impl Json {
    pub(in crate::spec) fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    pub(in crate::spec) fn object<K: Into<String>>(
        entries: impl IntoIterator<Item = (K, Json)>,
    ) -> Self {
        Self::Object(
            entries
                .into_iter()
                .map(|(key, value)| (key.into(), value))
                .collect(),
        )
    }

    pub(in crate::spec) fn texts<'a>(texts: impl IntoIterator<Item = &'a str>) -> Self {
        Self::Array(texts.into_iter().map(Self::text).collect())
    }

    /// Adds an entry to an object; leaves other values unchanged.
    pub(in crate::spec) fn with(mut self, key: &str, value: Json) -> Self {
        if let Self::Object(entries) = &mut self {
            entries.push((key.to_owned(), value));
        }
        self
    }

    /// The JSON text, indented by two blanks per level.
    pub(in crate::spec) fn pretty(&self) -> String {
        let mut out = String::new();
        self.write(&mut out, 0);
        out.push('\n');
        out
    }

    fn write(&self, out: &mut String, indent: usize) {
        match self {
            Self::Bool(value) => out.push_str(if *value { "true" } else { "false" }),
            Self::Integer(value) => {
                let _ = write!(out, "{value}");
            }
            Self::Number(text) => out.push_str(text),
            Self::Text(text) => quote(out, text),
            Self::Array(items) => {
                let flat = items
                    .iter()
                    .all(|item| !matches!(item, Self::Array(_) | Self::Object(_)));
                bracketed(out, indent, '[', ']', flat, items, |out, item, indent| {
                    item.write(out, indent);
                });
            }
            Self::Object(entries) => {
                bracketed(
                    out,
                    indent,
                    '{',
                    '}',
                    false,
                    entries,
                    |out, (key, value), indent| {
                        quote(out, key);
                        out.push_str(": ");
                        value.write(out, indent);
                    },
                );
            }
        }
    }
}

fn bracketed<T>(
    out: &mut String,
    indent: usize,
    open: char,
    close: char,
    flat: bool,
    items: &[T],
    mut write: impl FnMut(&mut String, &T, usize),
) {
    let line = |out: &mut String, indent: usize| {
        if !flat {
            out.push('\n');
            out.extend(std::iter::repeat_n(' ', 2 * indent));
        }
    };
    out.push(open);
    for (index, item) in items.iter().enumerate() {
        if index > 0 {
            out.push_str(if flat { ", " } else { "," });
        }
        line(out, indent + 1);
        write(out, item, indent + 1);
    }
    if !items.is_empty() {
        line(out, indent);
    }
    out.push(close);
}

fn quote(out: &mut String, text: &str) {
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04x}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped_and_nesting_is_indented() {
        let json = Json::object([
            ("a", Json::text("x\"\\\n\u{1}")),
            ("b", Json::Array(vec![Json::Integer(1), Json::Bool(false)])),
            ("c", Json::Object(Vec::new())),
        ]);
        let expected =
            "{\n  \"a\": \"x\\\"\\\\\\n\\u0001\",\n  \"b\": [1, false],\n  \"c\": {}\n}\n";
        assert_eq!(json.pretty(), expected);
    }

    #[test]
    fn definitions_are_made_once() {
        let mut definitions = Definitions::new();
        let first = defined("x", &mut definitions, |_| Json::Integer(1));
        let second = defined("x", &mut definitions, |_| Json::Integer(2));
        assert_eq!(first, second);
        assert_eq!(definitions, vec![("x".to_owned(), Json::Integer(1))]);
    }
}
