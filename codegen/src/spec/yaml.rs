//! Reads YAML as a tree of nodes with their places.
//!
//! The tree is built from the parser's events and not by serde: later checks need the place of
//! every key and value, and scalars as they are written, never as floats.

use std::collections::BTreeMap;

use saphyr_parser::{Event, Marker, Parser, ScalarStyle, Tag};

use super::shape::json::Json;
use crate::diag::{Diagnostic, Report, Sink, Source, Span};

/// Largest size of a file, in bytes.
pub const MAX_BYTES: usize = 1 << 20;
/// Largest depth of nested lists and mappings.
const MAX_DEPTH: usize = 64;
/// Largest number of nodes, with aliases expanded.
const MAX_NODES: usize = 20_000;

/// A node of the document, with aliases expanded.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    /// The kind and contents of the node.
    pub(super) kind: Kind,
    /// Its place in the file.
    pub(super) span: Span,
}

/// The kinds of nodes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// A plain or quoted scalar.
    Scalar(Scalar),
    /// A sequence.
    List(Vec<Node>),
    /// A mapping, in the order of the file, with unique keys.
    Map(Vec<(Key, Node)>),
}

/// A scalar's text.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scalar {
    /// The text, without quotes.
    pub(super) text: String,
    /// Whether the text is written without quotes: only then `null` and `true` are more than text.
    pub(super) plain: bool,
    /// The offset at which the file contains the text character by character; `None` if escapes or
    /// folded lines make it differ.
    pub(super) verbatim: Option<usize>,
}

/// A key of a mapping.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Key {
    /// The text, without quotes.
    pub(super) text: String,
    /// Its place in the file.
    pub(super) span: Span,
}

impl Node {
    /// How errors refer to the contents of this node.
    pub(super) fn describe(&self) -> String {
        match &self.kind {
            Kind::List(_) => "a list".into(),
            Kind::Map(_) => "a mapping".into(),
            Kind::Scalar(scalar) if scalar.is_null() => "nothing".into(),
            Kind::Scalar(scalar) => format!("'{}'", shorten(&scalar.text)),
        }
    }

    /// The value of a key, if this is a mapping with that key.
    pub(super) fn get(&self, key: &str) -> Option<&Node> {
        match &self.kind {
            Kind::Map(entries) => entries
                .iter()
                .find(|(name, _)| name.text == key)
                .map(|(_, value)| value),
            _ => None,
        }
    }

    /// A plain scalar.
    pub(super) fn plain(text: &str, span: Span) -> Self {
        Self {
            kind: Kind::Scalar(Scalar {
                text: text.to_owned(),
                plain: true,
                verbatim: None,
            }),
            span,
        }
    }

    /// The contents as JSON.
    pub(super) fn to_json(&self) -> Json {
        match &self.kind {
            Kind::Scalar(scalar) => match scalar.text.as_str() {
                "true" => Json::Bool(true),
                "false" => Json::Bool(false),
                text if scalar.plain && text.parse::<f64>().is_ok() => {
                    Json::Number(text.to_owned())
                }
                text => Json::text(text),
            },
            Kind::List(items) => Json::Array(items.iter().map(Node::to_json).collect()),
            Kind::Map(entries) => Json::object(
                entries
                    .iter()
                    .map(|(key, value)| (key.text.as_str(), value.to_json())),
            ),
        }
    }

    /// Sets the place of all nodes of the tree, for a tree whose text is not in the file.
    pub(super) fn relocate(&mut self, span: Span) {
        self.span = span;
        match &mut self.kind {
            Kind::Scalar(scalar) => scalar.verbatim = None,
            Kind::List(items) => items.iter_mut().for_each(|item| item.relocate(span)),
            Kind::Map(entries) => {
                for (key, value) in entries {
                    key.span = span;
                    value.relocate(span);
                }
            }
        }
    }

    fn count(&self) -> usize {
        1 + match &self.kind {
            Kind::Scalar(_) => 0,
            Kind::List(items) => items.iter().map(Node::count).sum(),
            Kind::Map(entries) => entries.iter().map(|(_, value)| 1 + value.count()).sum(),
        }
    }

    fn depth(&self) -> usize {
        match &self.kind {
            Kind::Scalar(_) => 0,
            Kind::List(items) => 1 + items.iter().map(Node::depth).max().unwrap_or(0),
            Kind::Map(entries) => 1 + entries.iter().map(|(_, v)| v.depth()).max().unwrap_or(0),
        }
    }
}

impl Scalar {
    /// Whether this is YAML's null: an empty text, `~` or `null`.
    pub(super) fn is_null(&self) -> bool {
        self.plain && matches!(self.text.as_str(), "" | "~" | "null" | "Null" | "NULL")
    }
}

/// Parses YAML that is not part of the file, and gives its nodes the place `span`.
pub(super) fn literal(text: &str, span: Span) -> Node {
    let source = Source::new("default", text);
    let mut node = load(&source).unwrap_or_else(|_| Node::plain(text, span));
    node.relocate(span);
    node
}

/// A text, cut to a length that fits in a message.
pub(super) fn shorten(text: &str) -> String {
    // largest number of characters of a text in a message
    const MAX_CHARACTERS: usize = 40;
    if text.chars().count() <= MAX_CHARACTERS {
        return text.to_owned();
    }
    text.chars()
        .take(MAX_CHARACTERS)
        .chain("...".chars())
        .collect()
}

/// Reads the only document of a file.
///
/// # Errors
/// A report with everything that prevents the file from being one YAML document within the limits.
pub(super) fn load(source: &Source) -> Result<Node, Report> {
    if source.text.len() > MAX_BYTES {
        return Err(too_large(source));
    }
    let mut sink = Sink::new();
    let root = match Loader::new(source, &mut sink).run() {
        Ok(root) => root,
        Err(diagnostic) => {
            sink.push(*diagnostic);
            None
        }
    };
    if root.is_none() && sink.is_empty() {
        sink.push(
            Diagnostic::new(Span::default(), "the file is empty")
                .hint("a robot needs at least `name:` and `limbs:`"),
        );
    }
    sink.finish(source)?;
    // the sink was empty, so there is a root
    Ok(root.unwrap_or(Node {
        kind: Kind::Map(Vec::new()),
        span: Span::default(),
    }))
}

/// The error about a file that is too large, without its text, which may be a line of any length.
fn too_large(source: &Source) -> Report {
    let bytes = source.text.len();
    let message = format!("the file has {bytes} bytes; the limit is {MAX_BYTES}");
    let source = Source::new(source.name.as_str(), "");
    Report::new(source, vec![Diagnostic::new(Span::default(), message)])
}

/// A list or mapping that is still being read.
enum Open {
    List {
        span: Span,
        anchor: usize,
        items: Vec<Node>,
    },
    Map {
        span: Span,
        anchor: usize,
        entries: Vec<(Key, Node)>,
        key: Option<Key>,
    },
}

/// An error that ends the reading at once.
type Fatal = Box<Diagnostic>;

struct Loader<'a> {
    source: &'a Source,
    sink: &'a mut Sink,
    /// Byte offset of each character, if these differ from the characters' indices.
    offsets: Option<Vec<usize>>,
    stack: Vec<Open>,
    anchors: BTreeMap<usize, (Node, usize)>,
    nodes: usize,
    root: Option<Node>,
}

impl<'a> Loader<'a> {
    fn new(source: &'a Source, sink: &'a mut Sink) -> Self {
        Self {
            source,
            sink,
            offsets: None,
            stack: Vec::new(),
            anchors: BTreeMap::new(),
            nodes: 0,
            root: None,
        }
    }

    fn run(mut self) -> Result<Option<Node>, Fatal> {
        let text = self.source.text.as_str();
        if !text.is_ascii() {
            self.offsets = Some(text.char_indices().map(|(at, _)| at).collect());
        }
        let mut parser = Parser::new_from_str(text);
        while let Some(event) = parser.next_event() {
            let (event, span) = event.map_err(|error| {
                let at = self.offset(*error.marker());
                let message = format!("not YAML: {}", error.info());
                let mut found = Diagnostic::new(Span::new(at, at + 1), message);
                found.hint = self
                    .open_bracket()
                    .or_else(|| super::brackets::open_before(text, at));
                found
            })?;
            let span = Span::new(self.offset(span.start), self.offset(span.end));
            self.event(event, span)?;
        }
        Ok(self.root)
    }

    /// Where the innermost bracket stands that is not closed yet: it is often the mistake, while the
    /// reader notices it lines later.
    fn open_bracket(&self) -> Option<String> {
        let text = &self.source.text;
        self.stack.iter().rev().find_map(|open| {
            let (Open::List { span, .. } | Open::Map { span, .. }) = open;
            let (before, after) = text.split_at_checked(span.start)?;
            let bracket = after.chars().next().filter(|c| "{[".contains(*c))?;
            Some(super::brackets::still_open(before, bracket))
        })
    }

    fn offset(&self, marker: Marker) -> usize {
        let end = self.source.text.len();
        match &self.offsets {
            None => marker.index().min(end),
            Some(offsets) => offsets.get(marker.index()).copied().unwrap_or(end),
        }
    }

    fn event(&mut self, event: Event<'_>, span: Span) -> Result<(), Fatal> {
        match event {
            Event::DocumentStart(_) if self.root.is_some() => {
                return Err(Diagnostic::new(span, "a second YAML document")
                    .hint("one file describes one robot: remove the `---`")
                    .into());
            }
            Event::Scalar(text, style, anchor, tag) => {
                self.refuse_tag(tag.as_deref(), span);
                let node = self.scalar(text.into_owned(), style, span);
                self.close(node, anchor)?;
            }
            Event::SequenceStart(anchor, tag) => {
                self.refuse_tag(tag.as_deref(), span);
                self.open(Open::List {
                    span,
                    anchor,
                    items: Vec::new(),
                })?;
            }
            Event::MappingStart(anchor, tag) => {
                self.refuse_tag(tag.as_deref(), span);
                self.open(Open::Map {
                    span,
                    anchor,
                    entries: Vec::new(),
                    key: None,
                })?;
            }
            Event::SequenceEnd | Event::MappingEnd => self.end(span)?,
            Event::Alias(anchor) => self.alias(anchor, span)?,
            _ => {}
        }
        Ok(())
    }

    fn refuse_tag(&mut self, tag: Option<&Tag>, span: Span) {
        if tag.is_some() {
            self.sink.push(
                Diagnostic::new(span, "YAML tags have no meaning here")
                    .hint("remove the tag; every field knows its own type"),
            );
        }
    }

    fn scalar(&self, text: String, style: ScalarStyle, span: Span) -> Node {
        let span = self.source.clamp(span);
        let written = &self.source.text[span.start..span.end];
        let quote = match style {
            ScalarStyle::SingleQuoted | ScalarStyle::DoubleQuoted => 1,
            _ => 0,
        };
        let verbatim = written
            .get(quote..)
            .is_some_and(|inner| inner.starts_with(&text))
            .then_some(span.start + quote);
        // plain scalars are trimmed, since the parser may report their end after trailing blanks
        let span = match (style, verbatim) {
            (ScalarStyle::Plain, Some(start)) => Span::new(start, start + text.len()),
            _ => span,
        };
        Node {
            kind: Kind::Scalar(Scalar {
                text,
                plain: style == ScalarStyle::Plain,
                verbatim,
            }),
            span,
        }
    }

    fn alias(&mut self, anchor: usize, span: Span) -> Result<(), Fatal> {
        let Some((node, count)) = self.anchors.get(&anchor) else {
            return Err(
                Diagnostic::new(span, "this alias refers to the node that it is part of").into(),
            );
        };
        self.nodes += count;
        self.check_budget(span)?;
        if self.stack.len() + node.depth() > MAX_DEPTH {
            return Err(too_deep(span));
        }
        let node = node.clone();
        self.place(node)
    }

    fn check_budget(&self, span: Span) -> Result<(), Fatal> {
        if self.nodes <= MAX_NODES {
            return Ok(());
        }
        Err(Diagnostic::new(
            span,
            format!("the file has more than {MAX_NODES} nodes, aliases expanded"),
        )
        .hint("aliases of aliases multiply; write out what is meant")
        .into())
    }

    fn open(&mut self, open: Open) -> Result<(), Fatal> {
        let (Open::List { span, .. } | Open::Map { span, .. }) = open;
        self.nodes += 1;
        self.check_budget(span)?;
        if self.stack.len() >= MAX_DEPTH {
            return Err(too_deep(span));
        }
        if let Some(Open::Map { key: None, .. }) = self.stack.last() {
            return Err(
                Diagnostic::new(span, "a key must be plain text, not a list or a mapping").into(),
            );
        }
        self.stack.push(open);
        Ok(())
    }

    fn end(&mut self, end: Span) -> Result<(), Fatal> {
        let (kind, span, anchor) = match self.stack.pop() {
            Some(Open::List {
                span,
                anchor,
                items,
            }) => (Kind::List(items), span, anchor),
            Some(Open::Map {
                span,
                anchor,
                entries,
                ..
            }) => (Kind::Map(entries), span, anchor),
            None => return Ok(()),
        };
        let span = self.source.clamp(span.to(end));
        // block collections end where the next token starts: cut off blanks and comments
        let end = match &kind {
            Kind::List(items) => items.last().map(|item| item.span.end),
            Kind::Map(entries) => entries.last().map(|(_, value)| value.span.end),
            Kind::Scalar(_) => None,
        };
        let flow = self.source.text[span.start..span.end].ends_with([']', '}']);
        let span = match end {
            Some(end) if !flow && end >= span.start => Span::new(span.start, end),
            _ => span,
        };
        self.nodes -= 1;
        self.close(Node { kind, span }, anchor)
    }

    /// Registers a complete node under its anchor, if it has one, and places it.
    fn close(&mut self, node: Node, anchor: usize) -> Result<(), Fatal> {
        self.nodes += 1;
        self.check_budget(node.span)?;
        if anchor > 0 {
            let count = node.count();
            self.anchors.insert(anchor, (node.clone(), count));
        }
        self.place(node)
    }

    /// Adds a node to the collection that is being read, or makes it the root.
    fn place(&mut self, node: Node) -> Result<(), Fatal> {
        match self.stack.last_mut() {
            None => self.root = Some(node),
            Some(Open::List { items, .. }) => items.push(node),
            Some(Open::Map { entries, key, .. }) => match key.take() {
                None => {
                    let span = node.span;
                    let Kind::Scalar(scalar) = node.kind else {
                        return Err(Diagnostic::new(
                            span,
                            "a key must be plain text, not a list or a mapping",
                        )
                        .into());
                    };
                    if scalar.plain && scalar.text == "<<" {
                        self.sink.push(
                            Diagnostic::new(span, "merge keys `<<` are not supported").hint(
                                "write the keys out; aliases (`*name`) may stand for whole values",
                            ),
                        );
                    }
                    *key = Some(Key {
                        text: scalar.text,
                        span,
                    });
                }
                Some(key) => match entries.iter().find(|(first, _)| first.text == key.text) {
                    Some((first, _)) => self.sink.push(
                        Diagnostic::new(
                            key.span,
                            format!("duplicate key '{}'", shorten(&key.text)),
                        )
                        .label("defined again here")
                        .secondary(first.span, "first defined here"),
                    ),
                    None => entries.push((key, node)),
                },
            },
        }
        Ok(())
    }
}

fn too_deep(span: Span) -> Fatal {
    Diagnostic::new(
        span,
        format!("lists and mappings nested deeper than {MAX_DEPTH}"),
    )
    .into()
}
