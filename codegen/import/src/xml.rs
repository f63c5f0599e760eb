//! XML files as trees of elements and attributes with their positions in the text, with included
//! files inserted.

use std::cell::Cell;
use std::rc::Rc;

use regen_codegen::diag::{Source, Span};

use crate::log::{Log, Place};

/// Largest depth of nesting; no robot needs as much, and it bounds the recursion.
pub(crate) const MAX_DEPTH: usize = 300;
/// Largest number of attributes of an element: the time of the XML library grows with its square.
const MAX_ATTRIBUTES: usize = 1000;
/// Largest number of namespace declarations; the library copies those of the parents with each.
const MAX_DECLARATIONS: usize = 10_000;
/// Largest number of namespace declarations that are added because the file lacks them; the file is
/// parsed again with each.
const MAX_ADDED: usize = 20;
/// Largest number of included files.
const MAX_INCLUDED_FILES: usize = 100;

/// Whether a reader has used a part of a file; copies of the part share the mark.
#[derive(Clone, Debug, Default)]
pub(crate) struct Used(Rc<Cell<bool>>);

impl Used {
    pub(crate) fn mark(&self) {
        self.0.set(true);
    }

    pub(crate) fn is_marked(&self) -> bool {
        self.0.get()
    }
}

/// An element with its attributes, child elements and text. What a reader looks up in it is marked as
/// used; `unused` tells the rest.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    /// The name as written, with its prefix.
    pub(crate) tag: String,
    pub(crate) attributes: Vec<Attribute>,
    pub(crate) children: Vec<Element>,
    /// The text, unless it is blank, under the element's name.
    pub(crate) content: Option<Attribute>,
    pub(crate) used: Used,
    /// The position of the name in the start tag.
    pub(crate) place: Place,
    /// The position of the whole element.
    pub(crate) span: Span,
}

/// An attribute with its value as written.
#[derive(Clone, Debug)]
pub(crate) struct Attribute {
    pub(crate) name: String,
    pub(crate) value: String,
    /// The position of the value between its quotes.
    pub(crate) place: Place,
    pub(crate) used: Used,
}

/// A function that returns the bytes of an included file or of a mesh, or the reason why it cannot
/// be read, by the name given in the file.
pub type Reader<'a> = dyn FnMut(&str) -> Result<Vec<u8>, String> + 'a;

impl Element {
    pub(crate) fn attribute(&self, name: &str) -> Option<&Attribute> {
        let found = self.attributes.iter().find(|a| a.name == name);
        found.inspect(|a| a.used.mark())
    }

    pub(crate) fn text(&self, name: &str) -> Option<&str> {
        self.attribute(name).map(|a| a.value.as_str())
    }

    pub(crate) fn child(&self, tag: &str) -> Option<&Element> {
        let found = self.children.iter().find(|c| c.tag == tag);
        found.inspect(|c| c.used.mark())
    }

    pub(crate) fn all<'a>(&'a self, tag: &'a str) -> impl Iterator<Item = &'a Element> {
        let found = self.children.iter().filter(move |c| c.tag == tag);
        found.inspect(|c| c.used.mark())
    }

    /// The text.
    pub(crate) fn content(&self) -> Option<&Attribute> {
        self.content.as_ref().inspect(|c| c.used.mark())
    }

    /// Marks the element and all within it as used: it is known that nothing in it matters.
    pub(crate) fn set_aside(&self) {
        self.used.mark();
        let own = self.attributes.iter().chain(&self.content);
        own.for_each(|part| part.used.mark());
        self.children.iter().for_each(Self::set_aside);
    }

    /// The text of the first child element of this name.
    pub(crate) fn content_of(&self, tag: &str) -> Option<&Attribute> {
        self.child(tag)?.content()
    }
}

/// Reads a file's root element; `None` if an error was recorded.
pub(crate) fn read(source: &Source, log: &mut Log) -> Option<Element> {
    let file = log.add(source.clone());
    if source.text.starts_with("#usda") {
        return crate::usd::read_text(&source.text, file, log);
    }
    if let Some((at, message)) = excess(&source.text) {
        let place = Place::new(file, Span::new(at, at + 1));
        log.error(place, message, "no robot file needs as many");
        return None;
    }
    let mut text = source.text.clone();
    let mut added = AddedDeclarations::default();
    loop {
        match roxmltree::Document::parse(&text) {
            Ok(document) => {
                let mut walk = Walk {
                    file,
                    text: document.input_text(),
                    added,
                    log,
                };
                return walk.element(document.root_element(), 0);
            }
            // some tools do not declare their namespace prefixes, and robot readers accept this
            Err(roxmltree::Error::UnknownNamespace(prefix, _))
                if added.count < MAX_ADDED && !prefix.is_empty() =>
            {
                added.declare(&mut text, &prefix);
            }
            Err(error) => {
                let at = added.position_in_file(offset(&text, error.pos()));
                let place = Place::new(file, Span::new(at, at + 1));
                let message = format!("the file is not XML: {}", reason(&error));
                log.error(place, message, "an XML editor shows what is missing here");
                return None;
            }
        }
    }
}

/// Namespace declarations that were inserted into the root's start tag.
#[derive(Clone, Copy, Debug, Default)]
struct AddedDeclarations {
    at: usize,
    length: usize,
    count: usize,
}

impl AddedDeclarations {
    fn declare(&mut self, text: &mut String, prefix: &str) {
        let declaration = format!(" xmlns:{prefix}=\"{prefix}\"");
        self.at = after_root_name(text);
        self.length += declaration.len();
        self.count += 1;
        text.insert_str(self.at, &declaration);
    }

    /// Converts a position in the text with the declarations to one in the file.
    fn position_in_file(self, place: usize) -> usize {
        if place <= self.at {
            place
        } else {
            place.saturating_sub(self.length).max(self.at)
        }
    }

    fn span(self, range: &std::ops::Range<usize>) -> Span {
        Span::new(
            self.position_in_file(range.start),
            self.position_in_file(range.end),
        )
    }
}

/// The position behind the name in the root's start tag.
fn after_root_name(text: &str) -> usize {
    let mut at = 0;
    while let Some(open) = text[at..].find('<').map(|found| at + found) {
        let rest = &text[open..];
        let Some(end) = end_of_other(rest) else {
            let name = rest.find(|c: char| c.is_whitespace() || c == '>' || c == '/');
            return open + name.unwrap_or(rest.len());
        };
        match rest.find(end) {
            Some(found) => at = open + found + end.len(),
            None => break,
        }
    }
    text.len()
}

/// What ends a comment, an instruction or literal text that begins here; `None` for tags.
fn end_of_other(rest: &str) -> Option<&'static str> {
    let ends = [
        ("<!--", "-->"),
        ("<![CDATA[", "]]>"),
        ("<?", "?>"),
        ("<!", ">"),
    ];
    let found = ends.iter().find(|(start, _)| rest.starts_with(start));
    found.map(|(_, end)| *end)
}

/// The place of an attribute or declaration beyond the limits, and what is wrong with it.
fn excess(text: &str) -> Option<(usize, String)> {
    if let Some((at, _)) = text.match_indices("xmlns").nth(MAX_DECLARATIONS) {
        return Some((at, format!("more than {MAX_DECLARATIONS} namespaces")));
    }
    let mut at = 0;
    while let Some(open) = text[at..].find('<').map(|found| at + found) {
        if let Some(end) = end_of_other(&text[open..]) {
            at = open + text[open..].find(end)? + end.len();
            continue;
        }
        let (mut quote, mut attributes) = (None, 0);
        at = text.len();
        for (k, byte) in text.bytes().enumerate().skip(open + 1) {
            match byte {
                _ if quote == Some(byte) => quote = None,
                _ if quote.is_some() => {}
                b'"' | b'\'' => quote = Some(byte),
                b'=' if attributes == MAX_ATTRIBUTES => {
                    let message = format!("more than {MAX_ATTRIBUTES} attributes in an element");
                    return Some((k, message));
                }
                b'=' => attributes += 1,
                b'<' | b'>' => {
                    at = k;
                    break;
                }
                _ => {}
            }
        }
    }
    None
}

/// The parser's message without its line and column.
fn reason(error: &roxmltree::Error) -> String {
    let text = error.to_string();
    match text.rsplit_once(" at ") {
        Some((words, place)) if place.chars().all(|c| c.is_ascii_digit() || c == ':') => {
            words.to_owned()
        }
        _ => text,
    }
}

/// The byte at a row and a column in characters.
fn offset(text: &str, pos: roxmltree::TextPos) -> usize {
    let row = (pos.row as usize).saturating_sub(1);
    let start: usize = text.split_inclusive('\n').take(row).map(str::len).sum();
    let line = &text[start.min(text.len())..];
    let column = (pos.col as usize).saturating_sub(1);
    let within = line.char_indices().nth(column).map_or(line.len(), |c| c.0);
    start + within
}

struct Walk<'a> {
    file: usize,
    /// The text that was parsed.
    text: &'a str,
    added: AddedDeclarations,
    log: &'a mut Log,
}

impl Walk<'_> {
    fn element(&mut self, node: roxmltree::Node<'_, '_>, depth: usize) -> Option<Element> {
        let span = self.added.span(&node.range());
        let text = self.text;
        let name = text.get(node.range().start + 1..).unwrap_or_default();
        let end = name.find(|c: char| c.is_whitespace() || c == '/' || c == '>');
        let name = &name[..end.unwrap_or(name.len())];
        let place = Place::new(
            self.file,
            Span::new(span.start, span.start + 1 + name.len()),
        );
        if depth > MAX_DEPTH {
            let message = format!("more than {MAX_DEPTH} elements within each other");
            let hint = "no robot is nested so deeply";
            self.log.error(place, message, hint);
            return None;
        }
        let tag = match node.tag_name().namespace() {
            Some(space) if space.contains("xacro") => format!("xacro:{}", node.tag_name().name()),
            _ => name.to_owned(),
        };
        let attribute = |name: &str, value: &str, range| Attribute {
            name: name.to_owned(),
            value: value.to_owned(),
            place: Place::new(self.file, self.added.span(&range)),
            used: Used::default(),
        };
        let attributes = node.attributes().map(|a| {
            let name = text.get(a.range_qname()).unwrap_or(a.name());
            attribute(name, a.value(), a.range_value())
        });
        let attributes = attributes.collect();
        let mut written = node.children().filter(roxmltree::Node::is_text);
        let content = written.find_map(|node| {
            let value = node.text()?.trim();
            // without the blanks around it
            let raw = text.get(node.range())?;
            let start = node.range().start + raw.len() - raw.trim_start().len();
            let range = start..start + raw.trim().len();
            (!value.is_empty()).then(|| attribute(&tag, value, range))
        });
        let mut children = Vec::new();
        for child in node.children().filter(roxmltree::Node::is_element) {
            children.push(self.element(child, depth + 1)?);
        }
        Some(Element {
            tag,
            attributes,
            children,
            content,
            used: Used::default(),
            place,
            span,
        })
    }
}

/// Replaces every `<include file="..."/>` by the children of the included file's root.
pub(crate) fn include(root: &mut Element, reader: &mut Reader<'_>, log: &mut Log) {
    let mut included = Vec::new();
    splice(root, reader, &mut included, 0, log);
}

fn splice(
    element: &mut Element,
    reader: &mut Reader<'_>,
    included: &mut Vec<String>,
    depth: usize,
    log: &mut Log,
) {
    if depth > MAX_DEPTH {
        return;
    }
    let mut children = Vec::with_capacity(element.children.len());
    for mut child in std::mem::take(&mut element.children) {
        if child.tag != "include" {
            splice(&mut child, reader, included, depth + 1, log);
            children.push(child);
            continue;
        }
        let Some(file) = child.attribute("file") else {
            log.error(
                child.place,
                "an include without a file",
                "write file=\"...\"",
            );
            continue;
        };
        if included.contains(&file.value) {
            log.error(
                file.place,
                format!("'{}' is included more than once", file.value),
                "a file may be included once in a model",
            );
            continue;
        }
        if included.len() >= MAX_INCLUDED_FILES {
            log.error(
                file.place,
                format!("more than {MAX_INCLUDED_FILES} files are included"),
                "write them into fewer files",
            );
            continue;
        }
        included.push(file.value.clone());
        let text = reader(&file.value).and_then(|bytes| {
            String::from_utf8(bytes).map_err(|_| "it is not UTF-8 text".to_owned())
        });
        let text = match text {
            Ok(text) => text,
            Err(why) => {
                let message = format!("cannot read the included file '{}': {why}", file.value);
                let hint = "included files are looked up beside the file that is imported";
                log.error(file.place, message, hint);
                continue;
            }
        };
        let source = Source::new(file.value.clone(), text);
        if let Some(mut root) = read(&source, log) {
            splice(&mut root, reader, included, depth + 1, log);
            children.extend(root.children);
        }
    }
    element.children = children;
}

/// Takes elements and attributes of a name out of an element; returns their places.
pub(crate) fn take_out(element: &mut Element, name: &str) -> Vec<Place> {
    let mut places = Vec::new();
    element.attributes.retain(|attribute| {
        let is_other = attribute.name != name;
        if !is_other {
            places.push(attribute.place);
        }
        is_other
    });
    // a schema of a prim of USD
    let lists = element
        .attributes
        .iter_mut()
        .filter(|a| a.name == "apiSchemas");
    for list in lists {
        let words = list.value.split(' ').filter(|word| *word != name);
        let kept = words.collect::<Vec<_>>().join(" ");
        if kept != list.value {
            places.push(list.place);
            list.value = kept;
        }
    }
    element.children.retain(|child| {
        let is_other = child.tag != name;
        if !is_other {
            places.push(child.place);
        }
        is_other
    });
    for child in &mut element.children {
        places.extend(take_out(child, name));
    }
    places
}
