//! Texts with names, and places in them.

/// A half-open range of byte offsets into a [`Source`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span {
    /// The first byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

impl Span {
    /// The span of the bytes from `start` up to `end`, without the latter.
    pub fn new(start: usize, end: usize) -> Self {
        Self { start, end }
    }

    /// The smallest span that covers both.
    #[must_use]
    pub fn to(self, other: Self) -> Self {
        Self::new(self.start.min(other.start), self.end.max(other.end))
    }
}

/// A line and a column as editors count them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Position {
    /// The line, from 1.
    pub line: usize,
    /// The column in characters, from 1.
    pub column: usize,
}

/// A text, and the name by which errors refer to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// The path as the user gave it.
    pub name: String,
    /// The whole text.
    pub text: String,
}

impl Source {
    /// A text with a name.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
        }
    }

    /// The nearest span inside the text, on character boundaries.
    #[must_use]
    pub fn clamp(&self, span: Span) -> Span {
        let start = self.text.floor_char_boundary(span.start);
        let end = self.text.ceil_char_boundary(span.end);
        Span::new(start, end.max(start))
    }

    /// The line and column at which a span starts.
    pub fn position(&self, span: Span) -> Position {
        self.lines().position(span)
    }

    /// The starts of the lines, for finding many positions.
    pub(super) fn lines(&self) -> Lines<'_> {
        let newlines = self.text.match_indices('\n').map(|(at, _)| at + 1);
        Lines {
            source: self,
            starts: std::iter::once(0).chain(newlines).collect(),
            ascii: self.text.is_ascii(),
        }
    }
}

/// The lines of a source.
pub(super) struct Lines<'a> {
    source: &'a Source,
    starts: Vec<usize>,
    ascii: bool,
}

impl Lines<'_> {
    /// The line and column at which a span starts.
    pub(super) fn position(&self, span: Span) -> Position {
        let at = self.source.clamp(span).start;
        let line = self.starts.partition_point(|start| *start <= at);
        let start = self.starts[line - 1];
        Position {
            line,
            column: 1 + if self.ascii {
                at - start
            } else {
                self.source.text[start..at].chars().count()
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters_not_bytes() {
        let source = Source::new("f", "a: é\nüb: x");
        let x = source.text.find('x').unwrap_or(0);
        assert_eq!(
            source.position(Span::new(x, x + 1)),
            Position { line: 2, column: 5 }
        );
    }

    #[test]
    fn clamping_keeps_spans_inside_and_on_boundaries() {
        let source = Source::new("f", "éé");
        assert_eq!(source.clamp(Span::new(1, 3)), Span::new(0, 4));
        assert_eq!(source.clamp(Span::new(9, 12)), Span::new(4, 4));
        assert_eq!(source.clamp(Span::new(4, 2)), Span::new(4, 4));
    }
}
