//! Mappings with fixed keys.

use super::json::{Definitions, Json, defined};
use super::{Reader, Shape};
use crate::diag::{Diagnostic, Span};
use crate::spec::suggest::{did_you_mean, one_of};
use crate::spec::yaml::{self, Key, Kind, Node, shorten};

/// What a record says about one of its keys.
pub(in crate::spec) struct Field {
    pub(in crate::spec) key: &'static str,
    pub(in crate::spec) doc: &'static str,
    pub(in crate::spec) required: bool,
    /// The value that stands for a missing one, as YAML.
    pub(in crate::spec) default: Option<&'static str>,
    pub(in crate::spec) schema: fn(&mut Definitions) -> Json,
}

/// The entries of a record, with unknown, missing and clashing keys reported.
pub(in crate::spec) fn read_fields<'a>(
    node: &'a Node,
    expected: &str,
    fields: &[Field],
    exclusive: &[(&str, &str)],
    reader: &mut Reader,
) -> Option<&'a [(Key, Node)]> {
    let Kind::Map(entries) = &node.kind else {
        reader.mismatch(expected, node);
        return None;
    };
    let keys = || fields.iter().map(|field| field.key);
    for (key, _) in entries {
        // merge keys have their own error
        if keys().any(|known| known == key.text) || key.text == "<<" {
            continue;
        }
        let near = did_you_mean(&key.text, keys());
        let message = format!("unknown key '{}'{near}", shorten(&key.text));
        let diagnostic = Diagnostic::new(key.span, message);
        reader.report(if near.is_empty() {
            diagnostic.hint(format!(
                "the keys of {expected} are {}",
                keys().collect::<Vec<_>>().join(", ")
            ))
        } else {
            diagnostic
        });
    }
    let find = |wanted: &str| {
        entries
            .iter()
            .find(|(key, _)| key.text == wanted)
            .map(|(key, _)| key)
    };
    for field in fields.iter().filter(|field| field.required) {
        if find(field.key).is_none() {
            // the first key is a better place than the whole record
            let span = entries.first().map_or(node.span, |(key, _)| key.span);
            reader.report(
                Diagnostic::new(span, format!("missing key '{}'", field.key))
                    .label(format!(
                        "this {} has none",
                        expected.trim_start_matches("a ")
                    ))
                    .hint(format!("{}: {}", field.key, field.doc)),
            );
        }
    }
    for (first, second) in exclusive {
        if let (Some(a), Some(b)) = (find(first), find(second)) {
            let message = format!(
                "{} exclude each other",
                one_of([*first, *second]).replace(" or ", " and ")
            );
            let (earlier, later) = if a.span <= b.span { (a, b) } else { (b, a) };
            reader.report(
                Diagnostic::new(later.span, message)
                    .secondary(earlier.span, format!("'{}' is given here", earlier.text))
                    .hint("keep one of them"),
            );
        }
    }
    Some(entries)
}

impl Reader {
    /// Reads the value of a key of a record.
    pub(in crate::spec) fn field<T: Shape>(
        &mut self,
        key: &str,
        entries: &[(Key, Node)],
    ) -> Option<Result<T, ()>> {
        let (_, value) = entries.iter().find(|(found, _)| found.text == key)?;
        let read = |reader: &mut Self| T::read(value, reader).ok_or(());
        // `limb 'left'` need not be `limbs, limb 'left'`
        Some(if T::NAMES_ITSELF && matches!(value.kind, Kind::List(_)) {
            read(self)
        } else {
            self.within(key, read)
        })
    }
}

/// The value that stands for a missing key, at the place of the record.
pub(in crate::spec) fn read_default<T: Shape>(
    yaml: &str,
    span: Span,
    reader: &mut Reader,
) -> Option<T> {
    T::read(&yaml::literal(yaml, span), reader)
}

/// How a record in a list is called: `limb 'left'`, or `limb 2` without a name.
pub(in crate::spec) fn describe_record(noun: &str, node: &Node, index: usize) -> String {
    match node.get("name").map(|name| &name.kind) {
        Some(Kind::Scalar(name)) if !name.is_null() => format!("{noun} '{}'", shorten(&name.text)),
        _ => format!("{noun} number {}", index + 1),
    }
}

/// The schema of a record.
pub(in crate::spec) fn record_schema(
    name: &str,
    doc: &str,
    fields: &[Field],
    exclusive: &[(&str, &str)],
    definitions: &mut Definitions,
) -> Json {
    defined(name, definitions, |definitions| {
        let properties = fields.iter().map(|field| {
            let mut schema = (field.schema)(definitions).with("description", Json::text(field.doc));
            if let Some(default) = field.default {
                schema = schema.with("default", yaml::literal(default, Span::default()).to_json());
            }
            (field.key, schema)
        });
        let properties = Json::object(properties);
        let required = fields
            .iter()
            .filter(|field| field.required)
            .map(|field| field.key);
        let mut schema = Json::object([
            ("type", Json::text("object")),
            ("description", Json::text(doc)),
            ("properties", properties),
            ("required", Json::texts(required)),
            ("additionalProperties", Json::Bool(false)),
        ]);
        for (a, b) in exclusive {
            let both = Json::object([("required", Json::texts([*a, *b]))]);
            schema = schema.with("not", both);
        }
        schema
    })
}

/// Declares a record: its keys with their docs, and for each whether it is `required`, `optional`, or has a
/// `default` (written as YAML).
macro_rules! record {
    (
        $(#[doc = $doc:literal])+
        struct $name:ident, $noun:literal {
            $( $(#[doc = $field_doc:literal])+ $mode:ident $field:ident: $type:ty $(= $default:literal)?, )+
        }
        $(exclusive { $($a:literal $b:literal),+ })?
    ) => {
        $(#[doc = $doc])+
        #[derive(Clone, Debug)]
        pub(in crate::spec) struct $name {
            $( $(#[doc = $field_doc])+ pub(in crate::spec) $field: record!(@type $mode $type), )+
            /// Where the record stands.
            #[allow(dead_code)] // not every record is pointed at as a whole
            pub(in crate::spec) span: $crate::diag::Span,
        }

        impl $name {
            const EXCLUSIVE: &'static [(&'static str, &'static str)] = &[$($(($a, $b)),+)?];
            const FIELDS: &'static [$crate::spec::shape::Field] = &[$(
                $crate::spec::shape::Field {
                    key: record!(@key $field),
                    doc: record!(@doc $($field_doc)+),
                    required: record!(@required $mode),
                    default: record!(@default $($default)?),
                    schema: <$type as $crate::spec::shape::Shape>::schema,
                },
            )+];
        }

        impl $crate::spec::shape::Shape for $name {
            const EXPECTED: &'static str = concat!("a ", $noun);
            const NAMES_ITSELF: bool = true;

            fn read(node: &$crate::spec::yaml::Node, reader: &mut $crate::spec::shape::Reader) -> Option<Self> {
                let entries = $crate::spec::shape::read_fields(
                    node, Self::EXPECTED, Self::FIELDS, Self::EXCLUSIVE, reader,
                )?;
                // every field is read, also after a bad one
                $( let $field = record!(@read $mode, $type, record!(@key $field), entries, node, reader $(, $default)?); )+
                Some(Self { $( $field: $field?, )+ span: node.span })
            }

            fn schema(
                definitions: &mut $crate::spec::shape::json::Definitions,
            ) -> $crate::spec::shape::json::Json {
                $crate::spec::shape::record_schema(
                    &$noun.replace(' ', "_"), record!(@doc $($doc)+), Self::FIELDS, Self::EXCLUSIVE, definitions,
                )
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
