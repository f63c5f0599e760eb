//! Mappings with fixed keys.

use super::json::{Definitions, Json, defined};
use super::{Reader, Shape};
use crate::diag::{Diagnostic, Span};
use crate::spec::suggest::did_you_mean;
use crate::spec::yaml::{self, Key, Kind, Node, shorten};

/// A key of a record.
pub(in crate::spec) struct Field {
    pub(in crate::spec) key: &'static str,
    pub(in crate::spec) doc: &'static str,
    pub(in crate::spec) required: bool,
    /// The value of a missing key, as YAML.
    pub(in crate::spec) default: Option<&'static str>,
    pub(in crate::spec) schema: fn(&mut Definitions) -> Json,
}

/// The keys of a record and the rules among them.
pub(in crate::spec) struct Layout {
    /// The noun for the record in messages: `joint`.
    pub(in crate::spec) noun: &'static str,
    pub(in crate::spec) doc: &'static str,
    pub(in crate::spec) fields: &'static [Field],
    /// Pairs of keys that exclude each other.
    pub(in crate::spec) exclusive: &'static [(&'static str, &'static str)],
    /// Keys that are required unless another key has a certain value: the key, the other key, the
    /// value.
    pub(in crate::spec) unless: &'static [(&'static str, &'static str, &'static str)],
}

impl Layout {
    fn keys(&self) -> impl Iterator<Item = &'static str> + Clone {
        self.fields.iter().map(|field| field.key)
    }

    fn knows(&self, key: &Key) -> bool {
        self.keys().any(|known| known == key.text)
    }

    /// The first key of a file of another kind that stands in the place of a robot's, and which kind it is.
    fn other_file<'a>(&self, entries: &'a [(Key, Node)]) -> Option<(&'a Key, &'static str)> {
        const KINDS: [(&str, &str); 5] = [
            ("runs", "an experiment file, which names logs"),
            ("columns", "an experiment file, which names logs"),
            ("factors", "a file of factors (`regen observe`)"),
            (
                "parameters",
                "a file of parameters (`regen identify --out`)",
            ),
            ("harmonics", "a trajectory (`regen excite`)"),
        ];
        let mut kinds = KINDS.iter().filter(|_| self.noun == "robot");
        let of_kind = |(word, what): &(&str, &'static str)| {
            let (key, _) = entries.iter().find(|(key, _)| key.text == *word)?;
            Some((key, *what))
        };
        kinds.find_map(of_kind)
    }

    fn expected(&self) -> String {
        format!(
            "a {} ({})",
            self.noun,
            self.keys().collect::<Vec<_>>().join(", ")
        )
    }

    /// The entries of a record; reports unknown, missing and mutually exclusive keys.
    pub(in crate::spec) fn entries<'a>(
        &self,
        node: &'a Node,
        reader: &mut Reader,
    ) -> Option<&'a [(Key, Node)]> {
        let Kind::Map(entries) = &node.kind else {
            reader.mismatch(&self.expected(), node);
            return None;
        };
        if let (false, Some((key, what))) = (
            entries.iter().any(|(key, _)| self.knows(key)),
            self.other_file(entries),
        ) {
            reader.report(
                Diagnostic::new(
                    key.span,
                    format!("this is {what}, and not the description of a robot"),
                )
                .hint("the description comes first: `regen identify ROBOT.yaml ...`"),
            );
            return None;
        }
        // merge keys are reported elsewhere
        for (key, _) in entries.iter().filter(|(key, _)| key.text != "<<") {
            if !self.knows(key) {
                reader.report(self.unknown(key));
            }
        }
        for missing in self.missing(entries) {
            // the first key is a better place for the error than the whole record
            let span = entries.first().map_or(node.span, |(key, _)| key.span);
            reader.report(
                Diagnostic::new(span, format!("missing key '{}'", missing.key))
                    .label(format!("this {} has none", self.noun))
                    .hint(format!("{}: {}", missing.key, missing.doc)),
            );
        }
        for (first, second) in self.exclusive {
            if let (Some(a), Some(b)) = (key(entries, first), key(entries, second)) {
                let (earlier, later) = if a.span <= b.span { (a, b) } else { (b, a) };
                reader.report(
                    Diagnostic::new(
                        later.span,
                        format!("'{first}' and '{second}' exclude each other"),
                    )
                    .secondary(earlier.span, format!("'{}' is given here", earlier.text))
                    .hint("keep one of them"),
                );
            }
        }
        Some(entries)
    }

    fn unknown(&self, key: &Key) -> Diagnostic {
        let near = did_you_mean(&key.text, self.keys());
        let message = format!("unknown key '{}'{near}", shorten(&key.text));
        let diagnostic = Diagnostic::new(key.span, message);
        if near.is_empty() {
            let all = self.keys().collect::<Vec<_>>().join(", ");
            diagnostic.hint(format!("the keys here are: {all}"))
        } else {
            diagnostic
        }
    }

    fn missing<'a>(&'a self, entries: &'a [(Key, Node)]) -> impl Iterator<Item = &'a Field> {
        let needed = |field: &Field| {
            let unless = self.unless.iter().find(|(needed, ..)| *needed == field.key);
            field.required
                || unless.is_some_and(|(_, other, value)| {
                    let other = entries.iter().find(|(key, _)| key.text == *other);
                    other.is_none_or(|(_, node)| !matches!(&node.kind, Kind::Scalar(scalar) if scalar.text == *value))
                })
        };
        self.fields
            .iter()
            .filter(move |field| needed(field) && key(entries, field.key).is_none())
    }

    /// The JSON Schema of the record.
    pub(in crate::spec) fn schema(&self, definitions: &mut Definitions) -> Json {
        defined(&self.noun.replace(' ', "_"), definitions, |definitions| {
            let properties = self.fields.iter().map(|field| {
                let mut schema =
                    (field.schema)(definitions).with("description", Json::text(field.doc));
                if let Some(default) = field.default {
                    let default = yaml::literal(default, Span::default());
                    schema = schema.with("default", default.to_json());
                }
                (field.key, schema)
            });
            let properties = Json::object(properties);
            let required = self.fields.iter().filter(|field| field.required);
            let mut schema = Json::object([
                ("type", Json::text("object")),
                ("description", Json::text(self.doc)),
                ("properties", properties),
                ("required", Json::texts(required.map(|field| field.key))),
                ("additionalProperties", Json::Bool(false)),
            ]);
            let required =
                |keys: &[&str]| Json::object([("required", Json::texts(keys.iter().copied()))]);
            let rules = self
                .exclusive
                .iter()
                .map(|(a, b)| Json::object([("not", required(&[a, b]))]));
            let unless = self.unless.iter().map(|(needed, other, value)| {
                let is = Json::object([("const", Json::text(*value))]);
                let condition = required(&[other]).with("properties", Json::object([(*other, is)]));
                Json::object([("if", condition), ("else", required(&[needed]))])
            });
            let rules: Vec<Json> = rules.chain(unless).collect();
            if !rules.is_empty() {
                schema = schema.with("allOf", Json::Array(rules));
            }
            schema
        })
    }
}

fn key<'a>(entries: &'a [(Key, Node)], wanted: &str) -> Option<&'a Key> {
    entries
        .iter()
        .find(|(key, _)| key.text == wanted)
        .map(|(key, _)| key)
}

impl Reader {
    /// Reads the value of a key of a record; `None` if the key is missing.
    pub(in crate::spec) fn field<T: Shape>(
        &mut self,
        key: &str,
        entries: &[(Key, Node)],
    ) -> Option<Result<T, ()>> {
        let (_, value) = entries.iter().find(|(found, _)| found.text == key)?;
        let read = |reader: &mut Self| T::read(value, reader).ok_or(());
        // write `limb 'left'` in paths, not `limbs, limb 'left'`
        Some(
            if T::ITEMS_NAME_THEMSELVES && matches!(value.kind, Kind::List(_)) {
                read(self)
            } else {
                self.within(key, read)
            },
        )
    }
}

/// Reads the default value of a missing key, with the place of the record.
pub(in crate::spec) fn read_default<T: Shape>(
    yaml: &str,
    span: Span,
    reader: &mut Reader,
) -> Option<T> {
    T::read(&yaml::literal(yaml, span), reader)
}

/// The name of a record in a list: `limb 'left'`, or `limb number 2` if it has no name.
pub(in crate::spec) fn describe_record(noun: &str, node: &Node, index: usize) -> String {
    match node.get("name").map(|name| &name.kind) {
        Some(Kind::Scalar(name)) if !name.is_null() => format!("{noun} '{}'", shorten(&name.text)),
        _ => format!("{noun} number {}", index + 1),
    }
}

/// Declares a record: its keys with their documentation, and for each whether it is `required`,
/// `optional`, or has a `default` (written as YAML).
macro_rules! record {
    (
        $(#[doc = $doc:literal])+
        struct $name:ident, $noun:literal {
            $( $(#[doc = $field_doc:literal])+ $mode:ident $field:ident: $type:ty $(= $default:literal)?, )+
        }
        $(exclusive { $($a:literal $b:literal),+ })?
        $(unless { $($needed:literal $other:literal $value:literal),+ })?
    ) => {
        $(#[doc = $doc])+
        #[derive(Clone, Debug)]
        pub(in crate::spec) struct $name {
            $( $(#[doc = $field_doc])+ pub(in crate::spec) $field: record!(@type $mode $type), )+
            /// The place of the record in the file.
            #[allow(dead_code, reason = "errors point at some records only by their fields")]
            pub(in crate::spec) span: $crate::diag::Span,
        }

        impl $name {
            const LAYOUT: $crate::spec::shape::Layout = $crate::spec::shape::Layout {
                noun: $noun,
                doc: record!(@doc $($doc)+),
                fields: &[$(
                    $crate::spec::shape::Field {
                        key: record!(@key $field),
                        doc: record!(@doc $($field_doc)+),
                        required: record!(@required $mode),
                        default: record!(@default $($default)?),
                        schema: <$type as $crate::spec::shape::Shape>::schema,
                    },
                )+],
                exclusive: &[$($(($a, $b)),+)?],
                unless: &[$($(($needed, $other, $value)),+)?],
            };
        }

        impl $crate::spec::shape::Shape for $name {
            const EXPECTED: &'static str = concat!("a ", $noun);
            const NAMES_ITSELF: bool = true;

            fn read(node: &$crate::spec::yaml::Node, reader: &mut $crate::spec::shape::Reader) -> Option<Self> {
                let entries = Self::LAYOUT.entries(node, reader)?;
                // read every field, also after an error, so that all errors are reported
                $( let $field = record!(@read $mode, $type, record!(@key $field), entries, node, reader $(, $default)?); )+
                Some(Self { $( $field: $field?, )+ span: node.span })
            }

            fn schema(
                definitions: &mut $crate::spec::shape::json::Definitions,
            ) -> $crate::spec::shape::json::Json {
                Self::LAYOUT.schema(definitions)
            }

            fn title(node: &$crate::spec::yaml::Node, index: usize) -> String {
                $crate::spec::shape::describe_record($noun, node, index)
            }
        }
    };
    (@type optional $type:ty) => { Option<$type> };
    (@type $mode:ident $type:ty) => { $type };
    (@required required) => { true };
    (@required $mode:ident) => { false };
    (@default) => { None };
    (@default $default:literal) => { Some($default) };
    (@key kind) => { "type" };
    (@key $field:ident) => { stringify!($field) };
    (@doc $($doc:literal)+) => { concat!($($doc),+).trim_ascii_start() };
    (@read required, $type:ty, $key:expr, $entries:ident, $node:ident, $reader:ident) => {
        $reader.field::<$type>($key, $entries).and_then(Result::ok)
    };
    (@read optional, $type:ty, $key:expr, $entries:ident, $node:ident, $reader:ident) => {
        match $reader.field::<$type>($key, $entries) {
            None => Some(None),
            Some(read) => read.ok().map(Some),
        }
    };
    (@read default, $type:ty, $key:expr, $entries:ident, $node:ident, $reader:ident, $default:literal) => {
        match $reader.field::<$type>($key, $entries) {
            None => $crate::spec::shape::read_default::<$type>($default, $node.span, $reader),
            Some(read) => read.ok(),
        }
    };
}
pub(in crate::spec) use record;
