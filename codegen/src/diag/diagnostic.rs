//! One error.

use super::Span;

/// One error: what is wrong, where, and what would mend it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// What is wrong, without the path: `unknown joint type 'prismtic'; did you mean 'prismatic'?`.
    pub message: String,
    /// The path in words, empty at the top of the file: `limb 'limb2', joint 'q7'`.
    pub path: String,
    /// The place.
    pub span: Span,
    /// A few words beside the caret.
    pub label: Option<String>,
    /// Other places that matter, such as "first defined here".
    pub secondary: Vec<(Span, String)>,
    /// What to write instead, or why the rule is there.
    pub hint: Option<String>,
    /// A word for the kind of error, by which callers find those that they add advice to.
    pub kind: Option<&'static str>,
}

impl Diagnostic {
    /// An error at a place.
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

    /// Names the place in words.
    #[must_use]
    pub fn path(mut self, path: impl Into<String>) -> Self {
        self.path = path.into();
        self
    }

    /// Adds a few words beside the caret.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// Adds another place.
    #[must_use]
    pub fn secondary(mut self, span: Span, label: impl Into<String>) -> Self {
        self.secondary.push((span, label.into()));
        self
    }

    /// Adds what to do about it.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Names the kind of error.
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

/// A character as it may stand in a one-line message.
fn printable(c: char) -> impl Iterator<Item = char> {
    let escaped = if c.is_control() {
        c.escape_default().collect::<Vec<_>>()
    } else {
        vec![c]
    };
    escaped.into_iter()
}
