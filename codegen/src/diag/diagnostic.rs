//! An error in a spec or another text, with its place.

use super::Span;

/// An error: what is wrong, where, and how to correct it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// What is wrong, without the path: `unknown joint type 'prismtic'; did you mean 'prismatic'?`.
    pub message: String,
    /// The enclosing elements in words, such as `limb 'limb2', joint 'q7'`; empty at the top level
    /// of the file.
    pub path: String,
    /// The place in the text.
    pub span: Span,
    /// A few words next to the caret.
    pub label: Option<String>,
    /// Other places that are relevant, such as "first defined here".
    pub secondary: Vec<(Span, String)>,
    /// What to write instead, or the reason for the rule.
    pub hint: Option<String>,
    /// An identifier of the kind of error, for callers that add advice to errors of this kind.
    pub kind: Option<&'static str>,
}

impl Diagnostic {
    /// An error at a place in the text, without path, label or hint.
    pub fn new(span: Span, message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            path: String::new(),
            span,
            label: None,
            secondary: Vec::new(),
            hint: None,
            kind: None,
        }
    }

    /// Sets the path in words.
    #[must_use]
    pub fn path(mut self, path: impl Into<String>) -> Self {
        self.path = path.into();
        self
    }

    /// Sets the few words next to the caret.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// Adds another relevant place.
    #[must_use]
    pub fn secondary(mut self, span: Span, label: impl Into<String>) -> Self {
        self.secondary.push((span, label.into()));
        self
    }

    /// Sets the hint: what to do about the error.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Sets the kind of error.
    #[must_use]
    pub fn kind(mut self, kind: &'static str) -> Self {
        self.kind = Some(kind);
        self
    }

    /// Path and message in one line, control characters escaped.
    pub fn headline(&self) -> String {
        let text = if self.path.is_empty() {
            self.message.clone()
        } else {
            format!("{}: {}", self.path, self.message)
        };
        text.chars().flat_map(printable).collect()
    }
}

/// A character for a message of one line: control characters, such as line breaks, are escaped.
fn printable(c: char) -> impl Iterator<Item = char> {
    let escaped = if c.is_control() {
        c.escape_default().collect::<Vec<_>>()
    } else {
        vec![c]
    };
    escaped.into_iter()
}
