//! The shapes of an experiment file's parts. A parsed tree is checked against them, and the JSON
//! Schema is written from them; both use the table in `keys.rs`.

use serde_json::{Map, Value, json};

use crate::data::expression;
use crate::document::{Mistake, Mistakes};
use crate::document::{Node, NodeKind, shorten};

/// The shape of a value.
pub(super) enum Shape {
    /// A finite number within a range.
    Number(Range),
    /// A whole number, 1 or more.
    Count,
    /// A number, or an expression of decimals, fractions and pi; not 0 if it is a factor.
    Expression {
        factor: bool,
    },
    /// A name or a path.
    Text,
    /// The name of a column, its number, or a range of numbers.
    Column,
    /// One of these words, each with its meaning.
    Words(&'static [(&'static str, &'static str)]),
    Record(&'static Record),
    /// A list, of this length if one is stated.
    List(&'static Shape, Option<usize>),
    /// A mapping with any keys; the text describes them in messages.
    Map(&'static Shape, &'static str),
    /// A mapping with the keys of a record and any others, which the text describes in messages.
    Open(&'static Record, &'static Shape, &'static str),
    /// One of several shapes.
    Either(&'static [Shape]),
}

/// The range of a number.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Range {
    Any,
    Positive,
    NotNegative,
}

/// A mapping with known keys.
pub(super) struct Record {
    /// The thing that the mapping describes, as messages call it.
    pub(super) noun: &'static str,
    pub(super) keys: &'static [Entry],
    /// Whether exactly one of the keys must be given.
    pub(super) one: bool,
}

/// A key of a record.
pub(super) struct Entry {
    pub(super) name: &'static str,
    pub(super) shape: Shape,
    pub(super) required: bool,
    pub(super) doc: &'static str,
}

/// Collects mistakes.
#[derive(Default)]
pub(super) struct Sink {
    pub(super) mistakes: Vec<Mistake>,
}

impl Sink {
    /// Adds a mistake, with its remedy unless that is empty.
    pub(super) fn push(&mut self, at: usize, path: &str, message: String, remedy: &str) {
        let mistake = Mistake {
            at,
            path: path.to_owned(),
            message,
            remedy: None,
        };
        self.mistakes.push(if remedy.is_empty() {
            mistake
        } else {
            mistake.words(remedy)
        });
    }

    /// An error if there are mistakes.
    pub(super) fn into_result(self) -> Result<(), Mistakes> {
        if self.mistakes.is_empty() {
            Ok(())
        } else {
            Err(Mistakes(self.mistakes))
        }
    }
}

/// The path of a key below another one.
pub(super) fn below(path: &str, key: &str) -> String {
    if path.is_empty() {
        format!("`{}`", shorten(key))
    } else {
        format!("{path}, `{}`", shorten(key))
    }
}

/// The known word nearest to a misspelt one, as `; did you mean 'x'?`; empty if all are far.
pub(super) fn did_you_mean<'w>(word: &str, known: impl IntoIterator<Item = &'w str>) -> String {
    /// Longer words are not compared: this and the next bound limit the time.
    const MAX_WORD: usize = 64;
    /// The largest number of known words that are compared.
    const MAX_CANDIDATES: usize = 1000;
    // one typing error in short words, two in longer ones
    let length = word.chars().count();
    let allowed = if length < 4 { 1 } else { 2 };
    if length > MAX_WORD {
        return String::new();
    }
    let near = |candidate: &&str| {
        let distance = if candidate.eq_ignore_ascii_case(word) {
            0
        } else {
            strsim::osa_distance(word, candidate)
        };
        let trivial = distance >= candidate.chars().count() || differ_in_digits(word, candidate);
        (distance <= allowed && !trivial).then_some(distance)
    };
    let found = known.into_iter().take(MAX_CANDIDATES);
    let found = found.filter_map(|candidate| Some((near(&candidate)?, candidate)));
    found
        .min_by_key(|(distance, _)| *distance)
        .map_or_else(String::new, |(_, near)| format!("; did you mean '{near}'?"))
}

/// Whether two words differ in their digits only: `q7` is not a misspelt `q1`.
fn differ_in_digits(a: &str, b: &str) -> bool {
    let same = |(x, y): (char, char)| x == y || (x.is_ascii_digit() && y.is_ascii_digit());
    a != b && a.chars().count() == b.chars().count() && a.chars().zip(b.chars()).all(same)
}

/// Words as a list: `'a', 'b' or 'c'`.
pub(super) fn one_of<'w>(words: impl IntoIterator<Item = &'w str>) -> String {
    let quoted: Vec<String> = words.into_iter().map(|word| format!("'{word}'")).collect();
    match quoted.split_last() {
        None => String::new(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

impl Shape {
    /// The expected value, as messages describe it.
    fn expected(&self) -> String {
        match self {
            Self::Number(Range::Any) => "a number".to_owned(),
            Self::Number(Range::Positive) => "a number above 0".to_owned(),
            Self::Number(Range::NotNegative) => "a number of at least 0".to_owned(),
            Self::Count => "a whole number of at least 1".to_owned(),
            Self::Expression { .. } => "a number or an expression such as 1/45".to_owned(),
            Self::Text => "a text".to_owned(),
            Self::Column => {
                "a column's name, its number, or numbers such as 2..7 or [2, 5, 4]".to_owned()
            }
            Self::Words(words) => one_of(words.iter().map(|word| word.0)),
            Self::Record(record) => {
                let keys = record.keys.iter().map(|key| key.name);
                let keys: Vec<&str> = keys.collect();
                format!("a mapping with {}", keys.join(", "))
            }
            Self::List(of, Some(count)) => format!("a list of {count}, each {}", of.expected()),
            Self::List(of, None) => format!("a list, each entry {}", of.expected()),
            Self::Map(of, keys) | Self::Open(_, of, keys) => {
                format!("a mapping from {keys} to {}", of.expected())
            }
            Self::Either(shapes) => {
                let each: Vec<String> = shapes.iter().map(Self::expected).collect();
                each.join(", or ")
            }
        }
    }

    /// Whether a node has the kind of this shape (number, text, mapping, list), whatever its content.
    fn is_of_kind(&self, node: &Node) -> bool {
        match self {
            Self::Number(_) | Self::Count => node.number().is_some(),
            Self::Expression { .. } => {
                // a word does not count as an expression, so that the mistakes of another
                // alternative are reported for it
                node.number().is_some()
                    || node.text().is_some_and(|text| {
                        text.starts_with(|c: char| !c.is_alphabetic()) || text.starts_with("pi")
                    })
            }
            Self::Column => {
                node.number().is_some() || node.text().is_some() || !node.items().is_empty()
            }
            Self::Text | Self::Words(_) => node.text().is_some(),
            Self::Record(_) | Self::Map(..) | Self::Open(..) => {
                matches!(node.kind, NodeKind::Map(_))
            }
            Self::List(..) => matches!(node.kind, NodeKind::List(_)),
            Self::Either(shapes) => shapes.iter().any(|shape| shape.is_of_kind(node)),
        }
    }

    /// Adds all mistakes of a node and of what it contains.
    pub(super) fn check(&self, node: &Node, path: &str, sink: &mut Sink) {
        let mut mismatch = |why: &str| {
            let message = format!(
                "expected {}, found {}{why}",
                self.expected(),
                node.describe()
            );
            sink.push(node.at, path, message, "");
        };
        match self {
            Self::Number(range) => match node.number() {
                Some(value) if range.has(value) => {}
                _ => mismatch(""),
            },
            Self::Count => match node.whole() {
                Some(value) if value > 0 => {}
                _ => mismatch(""),
            },
            Self::Expression { factor } => {
                if let Err(why) = value(node, *factor) {
                    mismatch(&why.map_or_else(String::new, |why| format!(": {why}")));
                }
            }
            Self::Text => match node.text() {
                Some(text) if !text.is_empty() => {}
                _ => mismatch(""),
            },
            Self::Column => {
                if column(node).is_none() {
                    mismatch("");
                }
            }
            Self::Words(words) => {
                let known = || words.iter().map(|word| word.0);
                match node.text() {
                    Some(text) if known().any(|word| word == text) => {}
                    Some(text) => {
                        let near = did_you_mean(text, known());
                        let message = format!("unknown word '{}'{near}", shorten(text));
                        let remedy = format!("it is {}", one_of(known()));
                        sink.push(node.at, path, message, &remedy);
                    }
                    None => mismatch(""),
                }
            }
            Self::Record(record) => match &node.kind {
                NodeKind::Map(_) => record.check(node, path, sink),
                _ => mismatch(""),
            },
            Self::List(of, count) => match &node.kind {
                NodeKind::List(items) => {
                    if count.is_some_and(|count| count != items.len()) || items.is_empty() {
                        let count = count.map_or("at least 1".to_owned(), |c| c.to_string());
                        let found = items.len();
                        let message = format!("expected {count} entries, found {found}");
                        sink.push(node.at, path, message, "");
                    }
                    for (k, item) in items.iter().enumerate() {
                        of.check(item, &format!("{path}, entry {}", k + 1), sink);
                    }
                }
                _ => mismatch(""),
            },
            Self::Map(of, _) => match &node.kind {
                NodeKind::Map(entries) => {
                    for (key, item) in entries {
                        of.check(item, &below(path, &key.text), sink);
                    }
                }
                _ => mismatch(""),
            },
            Self::Open(record, of, _) => match &node.kind {
                NodeKind::Map(entries) => {
                    for (key, item) in entries {
                        let known = record.keys.iter().find(|own| own.name == key.text);
                        let shape = known.map_or(*of, |own| &own.shape);
                        shape.check(item, &below(path, &key.text), sink);
                    }
                }
                _ => mismatch(""),
            },
            Self::Either(shapes) => {
                let fits = |shape: &&Self| {
                    let mut own = Sink::default();
                    shape.check(node, path, &mut own);
                    own.mistakes.is_empty()
                };
                if shapes.iter().any(|shape| fits(&shape)) {
                    return;
                }
                // report the mistakes of the alternative of the same kind
                match shapes.iter().find(|shape| shape.is_of_kind(node)) {
                    Some(shape) => shape.check(node, path, sink),
                    None => mismatch(""),
                }
            }
        }
    }

    /// The JSON Schema of the shape.
    pub(super) fn schema(&self) -> Value {
        match self {
            Self::Number(Range::Any) => json!({"type": "number"}),
            Self::Number(Range::Positive) => json!({"type": "number", "exclusiveMinimum": 0}),
            Self::Number(Range::NotNegative) => json!({"type": "number", "minimum": 0}),
            Self::Count => json!({"type": "integer", "minimum": 1}),
            Self::Expression { .. } => json!({"type": ["number", "string"]}),
            Self::Text => json!({"type": "string", "minLength": 1}),
            Self::Column => {
                let one = [
                    json!({"type": "integer", "minimum": 1}),
                    json!({"type": "string", "minLength": 1}),
                ];
                let several = json!({"type": "array", "items": {"anyOf": one}, "minItems": 1});
                let [number, name] = one;
                json!({"anyOf": [number, name, several]})
            }
            Self::Words(words) => {
                let names: Vec<&str> = words.iter().map(|word| word.0).collect();
                let meanings: Vec<&str> = words.iter().map(|word| word.1).collect();
                json!({"type": "string", "enum": names, "enumDescriptions": meanings})
            }
            Self::Record(record) => record.schema(),
            Self::List(of, Some(count)) => json!({
                "type": "array", "items": of.schema(), "minItems": count, "maxItems": count,
            }),
            Self::List(of, None) => {
                json!({"type": "array", "items": of.schema(), "minItems": 1})
            }
            Self::Map(of, _) => json!({"type": "object", "additionalProperties": of.schema()}),
            Self::Open(record, of, _) => {
                let mut out = record.schema();
                if let Value::Object(out) = &mut out {
                    out.insert("additionalProperties".to_owned(), of.schema());
                }
                out
            }
            Self::Either(shapes) => {
                let each: Vec<Value> = shapes.iter().map(Self::schema).collect();
                json!({"anyOf": each})
            }
        }
    }
}

impl Range {
    fn has(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::Any => true,
                Self::Positive => value > 0.0,
                Self::NotNegative => value >= 0.0,
            }
    }
}

impl Record {
    fn check(&self, node: &Node, path: &str, sink: &mut Sink) {
        let names = || self.keys.iter().map(|key| key.name);
        for (key, item) in node.entries() {
            if let Some(known) = self.keys.iter().find(|known| known.name == key.text) {
                known.shape.check(item, &below(path, &key.text), sink);
                continue;
            }
            let near = did_you_mean(&key.text, names());
            let message = format!("unknown key '{}'{near}", shorten(&key.text));
            let keys: Vec<&str> = names().collect();
            let remedy = format!("{} has the keys {}", self.noun, keys.join(", "));
            sink.push(key.at, path, message, &remedy);
        }
        for key in self.keys.iter().filter(|key| key.required) {
            if node.get(key.name).is_none() {
                let message = format!("{} lacks the key '{}'", self.noun, key.name);
                sink.push(node.at, path, message, key.doc);
            }
        }
        if self.one && names().filter(|name| node.get(name).is_some()).count() != 1 {
            let message = format!("{} has exactly one of {}", self.noun, one_of(names()));
            sink.push(node.at, path, message, "");
        }
    }

    /// The JSON Schema of the record.
    pub(super) fn schema(&self) -> Value {
        let mut properties = Map::new();
        for key in self.keys {
            let mut own = key.shape.schema();
            if let Value::Object(own) = &mut own {
                own.insert("description".to_owned(), json!(key.doc));
            }
            properties.insert(key.name.to_owned(), own);
        }
        let required = self.keys.iter().filter(|key| key.required);
        let required: Vec<&str> = required.map(|key| key.name).collect();
        let mut out = json!({
            "type": "object", "properties": properties, "additionalProperties": false,
        });
        if let Value::Object(out) = &mut out {
            if !required.is_empty() {
                out.insert("required".to_owned(), json!(required));
            }
            if self.one {
                out.insert("minProperties".to_owned(), json!(1));
                out.insert("maxProperties".to_owned(), json!(1));
            }
        }
        out
    }
}

/// The value of a number or an expression.
///
/// # Errors
/// The reason why the text is not an expression; `None` if the node is neither number nor text.
pub(super) fn value(node: &Node, factor: bool) -> Result<f64, Option<String>> {
    let read = if factor {
        expression::factor
    } else {
        expression::evaluate
    };
    match (node.number(), node.text()) {
        (Some(number), _) if factor && number == 0.0 => read("0").map_err(Some),
        (Some(number), _) if number.is_finite() => Ok(number),
        (_, Some(text)) => read(text).map_err(Some),
        _ => Err(None),
    }
}

/// A column of a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Column {
    /// Its name, which may be a pattern with one `*`.
    Name(String),
    /// Its number, from 1.
    Number(usize),
    /// The first and the last number of several columns.
    Range(usize, usize),
    /// Several columns by their names or numbers.
    List(Vec<Column>),
}

/// The column that a node names; `None` if it does not name one.
pub(super) fn column(node: &Node) -> Option<Column> {
    if let Some(number) = node.whole() {
        let number = usize::try_from(number).ok().filter(|number| *number > 0);
        return number.map(Column::Number);
    }
    if !node.items().is_empty() {
        let each = node.items().iter().map(|item| {
            let one = column(item)?;
            matches!(one, Column::Name(_) | Column::Number(_)).then_some(one)
        });
        return each.collect::<Option<_>>().map(Column::List);
    }
    let text = node.text().filter(|text| !text.is_empty())?;
    let number = |text: &str| text.trim().parse::<usize>().ok();
    if let Some((first, last)) = text.split_once("..")
        && let (Some(first), Some(last)) = (number(first), number(last))
    {
        return (0 < first && first <= last).then_some(Column::Range(first, last));
    }
    Some(Column::Name(text.to_owned()))
}
