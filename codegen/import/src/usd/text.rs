//! USD as text: prims as elements, with their metadata and properties as attributes.

use regen_codegen::diag::Span;

use crate::log::{Log, Place};
use crate::xml::{Attribute, Element, MAX_DEPTH, Used};

/// The longest value that is kept, bytes; longer ones are arrays of meshes, of which the beginning is kept.
const MAX_VALUE: usize = 4096;

/// What is wrong, and at which byte.
type Parsed<T> = Result<T, (usize, String)>;

/// Reads a layer as the element `usda`; `None` if an error was recorded.
pub(crate) fn read(text: &str, file: usize, log: &mut Log) -> Option<Element> {
    let is_control = |c: char| c.is_control() && !matches!(c, '\n' | '\r' | '\t');
    if let Some(at) = text.find(is_control) {
        let place = Place::new(file, Span::new(at, at + 1));
        log.error(
            place,
            "the file is not USD: a control character",
            super::FLATTEN,
        );
        return None;
    }
    let mut parser = Parser {
        text,
        // behind the first line, `#usda 1.0`
        at: text.find('\n').unwrap_or(text.len()),
        file,
    };
    parser.layer().map_or_else(
        |(at, message)| {
            let place = Place::new(file, Span::new(at, at + 1));
            let hint = super::FLATTEN;
            log.error(place, message, hint);
            None
        },
        Some,
    )
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    file: usize,
}

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a str {
        self.text.get(self.at..).unwrap_or_default()
    }

    fn fail<T>(&self, message: &str) -> Parsed<T> {
        Err((self.at, format!("the file is not USD: {message}")))
    }

    /// Passes over blanks and comments, within the line or beyond it.
    fn pass(&mut self, beyond: bool) {
        loop {
            let rest = self.rest();
            let is_blank = |c: char| c.is_whitespace() && (beyond || c != '\n');
            let blank = rest.len() - rest.trim_start_matches(is_blank).len();
            self.at += blank;
            let rest = self.rest();
            if rest.starts_with('#') {
                self.at += rest.find('\n').unwrap_or(rest.len());
            } else if rest.starts_with("/*") {
                self.at += rest.find("*/").map_or(rest.len(), |end| end + 2);
            } else if blank == 0 {
                return;
            }
        }
    }

    /// Takes a mark, if it comes next.
    fn takes(&mut self, mark: &str) -> bool {
        self.pass(true);
        let is_next = self.rest().starts_with(mark);
        self.at += if is_next { mark.len() } else { 0 };
        is_next
    }

    /// A word of the present line; empty if none comes next.
    fn word(&mut self) -> &'a str {
        self.pass(false);
        let rest = self.rest();
        let is_end = |c: char| c.is_whitespace() || ",;()[]{}=\"'@<>#".contains(c);
        let word = rest.split(is_end).next().unwrap_or_default();
        self.at += word.len();
        // the brackets of an array's type
        self.at += if self.rest().starts_with("[]") { 2 } else { 0 };
        word
    }

    /// A text between marks; the longer ones may have line breaks.
    fn quoted(&mut self, marks: &[&str]) -> Parsed<Option<(&'a str, Span)>> {
        let rest = self.rest();
        let Some(mark) = marks.iter().find(|mark| rest.starts_with(**mark)) else {
            return Ok(None);
        };
        let end = mark.replace('<', ">");
        let mut from = mark.len();
        loop {
            let Some(found) = rest.get(from..).and_then(|text| text.find(&end)) else {
                return self.fail("a text without an end");
            };
            let until = from + found;
            let inside = rest.get(mark.len()..until).unwrap_or_default();
            let slashes = inside.len() - inside.trim_end_matches('\\').len();
            let part = rest.get(from..until).unwrap_or_default();
            if matches!(*mark, "\"" | "'") && part.contains('\n') {
                return self.fail("a text without an end");
            }
            if slashes % 2 == 0 {
                let start = self.at + mark.len();
                self.at += until + end.len();
                return Ok(Some((inside, Span::new(start, start + inside.len()))));
            }
            from = until + end.len();
        }
    }

    /// Adds a value's words to a text, separated by blanks, and returns where they stand.
    fn value(&mut self, out: &mut String, depth: usize) -> Parsed<Span> {
        if depth > MAX_DEPTH {
            return self.fail("brackets are too deep within each other");
        }
        self.pass(true);
        let start = self.at;
        let mut push = |word: &str| {
            if out.len() < MAX_VALUE {
                out.push_str(if out.is_empty() { "" } else { " " });
                out.push_str(word);
            }
        };
        let marks = ["\"\"\"", "'''", "\"", "'", "@@@", "@", "<"];
        if let Some((text, span)) = self.quoted(&marks)? {
            push(text);
            return Ok(span);
        }
        let brackets = [("(", ")"), ("[", "]"), ("{", "}")];
        let Some((_, close)) = brackets.into_iter().find(|(open, _)| self.takes(open)) else {
            let word = self.word();
            if word.is_empty() {
                return self.fail("a value is missing");
            }
            push(word);
            return Ok(Span::new(start, start + word.len()));
        };
        while !self.takes(close) {
            if !(self.takes(",") || self.takes(";") || self.takes("=")) {
                self.value(out, depth + 1)?;
            }
        }
        Ok(Span::new(start, self.at))
    }

    fn attribute(&self, name: String, value: String, span: Span) -> Attribute {
        Attribute {
            name,
            value,
            place: Place::new(self.file, span),
            used: Used::default(),
        }
    }

    /// Reads a property or an entry of metadata, of which the first words may have been read: qualifiers, type, name,
    /// and what may follow, a value and metadata.
    fn statement(&mut self, first: &'a str, out: &mut Vec<Attribute>) -> Parsed<()> {
        let (mut name, mut is_deleted) = (first, false);
        let mut start = self.at - first.len();
        loop {
            let word = self.word();
            if word.is_empty() {
                break;
            }
            is_deleted |= name == "delete";
            (name, start) = (word, self.at - word.len());
        }
        let mut span = Span::new(start, start + name.len());
        let mut value = String::new();
        if self.takes("=") {
            span = self.value(&mut value, 0)?;
        }
        let deleted = if is_deleted { "delete " } else { "" };
        let name = format!("{deleted}{name}");
        let metadata = self.metadata()?;
        for own in metadata {
            out.push(Attribute {
                name: format!("{} of {name}", own.name),
                ..own
            });
        }
        out.push(self.attribute(name, value, span));
        Ok(())
    }

    /// Reads the metadata in parentheses, if there are any.
    fn metadata(&mut self) -> Parsed<Vec<Attribute>> {
        let mut out = Vec::new();
        if !self.takes("(") {
            return Ok(out);
        }
        while !self.takes(")") {
            if self.takes(";") || self.takes(",") {
                continue;
            }
            if let Some((text, span)) = self.quoted(&["\"\"\"", "'''", "\"", "'"])? {
                out.push(self.attribute("doc".to_owned(), text.to_owned(), span));
                continue;
            }
            let word = self.word();
            if word.is_empty() {
                return self.fail("an entry of metadata is missing");
            }
            self.statement(word, &mut out)?;
        }
        Ok(out)
    }

    fn layer(&mut self) -> Parsed<Element> {
        let place = Place::new(self.file, Span::new(0, 5));
        let span = Span::new(0, self.text.len());
        let mut layer = Element {
            tag: "usda".to_owned(),
            attributes: self.metadata()?,
            children: Vec::new(),
            content: None,
            used: Used::default(),
            place,
            span,
        };
        self.body(&mut layer, 0)?;
        Ok(layer)
    }

    /// Reads what is in a prim, up to its brace, or to the end of the layer.
    fn body(&mut self, within: &mut Element, depth: usize) -> Parsed<()> {
        if depth > MAX_DEPTH {
            return self.fail("prims are too deep within each other");
        }
        loop {
            if self.takes(";") {
                continue;
            }
            if depth > 0 && self.takes("}") || depth == 0 && self.rest().is_empty() {
                return Ok(());
            }
            let start = self.at;
            let word = self.word();
            match word {
                "" => return self.fail("a prim or a property is missing here"),
                "def" | "over" | "class" => {
                    let child = self.prim(word, start, depth)?;
                    within.children.push(child);
                }
                "variantSet" => {
                    let message = "variants: which one is chosen is not known here";
                    return Err((start, message.to_owned()));
                }
                _ => self.statement(word, &mut within.attributes)?,
            }
        }
    }

    fn prim(&mut self, specifier: &str, start: usize, depth: usize) -> Parsed<Element> {
        let kind = self.word();
        self.pass(true);
        let Some((name, span)) = self.quoted(&["\"", "'"])? else {
            return self.fail("the name of a prim is missing");
        };
        let mut attributes = vec![self.attribute("name".to_owned(), name.to_owned(), span)];
        attributes.extend(self.metadata()?);
        let tag = match (specifier, kind) {
            ("def", kind) if !kind.is_empty() => kind,
            (specifier, _) => specifier,
        };
        let mut prim = Element {
            tag: tag.to_owned(),
            attributes,
            children: Vec::new(),
            content: None,
            used: Used::default(),
            place: Place::new(self.file, span),
            span,
        };
        if self.takes("{") {
            self.body(&mut prim, depth + 1)?;
        }
        prim.span = Span::new(start, self.at);
        Ok(prim)
    }
}
