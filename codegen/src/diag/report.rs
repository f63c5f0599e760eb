//! The errors of a phase, as a value and as text.

use std::fmt;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

use super::{Diagnostic, Position, Source, Span};

/// Largest number of errors that are printed: nobody reads more of a file that is wrong everywhere.
const MAX_SHOWN_ERRORS: usize = 100;
/// Lines of context above and below a place.
const CONTEXT_LINES: usize = 1;

/// All errors of a phase, ordered by their place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The text that the errors refer to.
    pub source: Source,
    /// The errors; at least one.
    pub diagnostics: Vec<Diagnostic>,
}

/// An error with its line and column, for machine-readable output.
#[derive(Clone, Copy, Debug)]
pub struct LocatedDiagnostic<'a> {
    name: &'a str,
    position: Position,
    diagnostic: &'a Diagnostic,
}

impl Report {
    /// Orders errors by their place, and drops exact duplicates.
    pub fn new(source: Source, mut diagnostics: Vec<Diagnostic>) -> Self {
        for diagnostic in &mut diagnostics {
            diagnostic.span = source.clamp(diagnostic.span);
            for (span, _) in &mut diagnostic.secondary {
                *span = source.clamp(*span);
            }
        }
        diagnostics.sort_by_key(|diagnostic| diagnostic.span);
        diagnostics.dedup();
        Self {
            source,
            diagnostics,
        }
    }

    /// The errors with their lines and columns.
    pub fn shown(&self) -> impl Iterator<Item = LocatedDiagnostic<'_>> {
        let lines = self.source.lines();
        self.diagnostics
            .iter()
            .map(move |diagnostic| LocatedDiagnostic {
                name: &self.source.name,
                position: lines.position(diagnostic.span),
                diagnostic,
            })
    }

    /// The errors with source lines and carets, ready to print.
    pub fn render(&self, color: bool) -> String {
        let renderer = if color {
            Renderer::styled()
        } else {
            Renderer::plain()
        };
        let mut blocks: Vec<String> = self
            .diagnostics
            .iter()
            .take(MAX_SHOWN_ERRORS)
            .map(|diagnostic| self.render_one(diagnostic, &renderer))
            .collect();
        if self.diagnostics.len() > MAX_SHOWN_ERRORS {
            blocks.push(format!(
                "... and {} more errors",
                self.diagnostics.len() - MAX_SHOWN_ERRORS
            ));
        }
        blocks.join("\n\n")
    }

    fn render_one(&self, diagnostic: &Diagnostic, renderer: &Renderer) -> String {
        let mut group = Group::with_title(Level::ERROR.primary_title(diagnostic.headline()));
        // the renderer scans all text that it is given, so that it gets only the lines around the
        // error
        let mut spans = vec![(diagnostic.span, diagnostic.label.as_deref(), true)];
        spans.extend(
            diagnostic
                .secondary
                .iter()
                .map(|(span, label)| (*span, Some(label.as_str()), false)),
        );
        let whole = spans
            .iter()
            .map(|(span, ..)| *span)
            .reduce(Span::to)
            .unwrap_or_default();
        let (window, line_start) = self.window(whole);
        let mut snippet = Snippet::source(&self.source.text[window.start..window.end])
            .line_start(line_start)
            .path(self.source.name.as_str());
        for (span, label, primary) in spans {
            let kind = if primary {
                AnnotationKind::Primary
            } else {
                AnnotationKind::Context
            };
            let range = self.on_one_line(span);
            snippet = snippet.annotation(
                kind.span(range.start - window.start..range.end - window.start)
                    .label(label),
            );
        }
        group = group.element(snippet);
        if let Some(hint) = &diagnostic.hint {
            group = group.element(Level::HELP.message(hint.as_str()));
        }
        renderer.render(&[group])
    }

    /// The part of a span on its first line, since carets under whole blocks are of no use.
    fn on_one_line(&self, span: Span) -> Span {
        let text = &self.source.text[span.start..span.end];
        let line = text.split(['\n', '\r']).next().unwrap_or(text);
        Span::new(span.start, span.start + line.trim_end().len())
    }

    /// The whole lines around a span, and the number of the first line.
    fn window(&self, span: Span) -> (Span, usize) {
        let text = self.source.text.as_str();
        let span = Span::new(span.start, self.on_one_line(span).end.max(span.end));
        let mut start = text[..span.start].rfind('\n').map_or(0, |at| at + 1);
        for _ in 0..CONTEXT_LINES {
            start = text[..start.saturating_sub(1)]
                .rfind('\n')
                .map_or(0, |at| at + 1);
        }
        let mut end = span.end;
        for _ in 0..=CONTEXT_LINES {
            end = text[end..].find('\n').map_or(text.len(), |at| end + at + 1);
        }
        let line = self.source.position(Span::new(start, start)).line;
        (Span::new(start, end), line)
    }
}

impl<'a> LocatedDiagnostic<'a> {
    /// The line, from 1.
    pub fn line(&self) -> usize {
        self.position.line
    }

    /// The column in characters, from 1.
    pub fn column(&self) -> usize {
        self.position.column
    }

    /// The error.
    pub fn diagnostic(&self) -> &'a Diagnostic {
        self.diagnostic
    }
}

impl fmt::Display for LocatedDiagnostic<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Position { line, column } = self.position;
        write!(
            f,
            "{}:{line}:{column}: {}",
            self.name,
            self.diagnostic.headline()
        )?;
        match &self.diagnostic.hint {
            Some(hint) => write!(f, " ({hint})"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, shown) in self.shown().take(MAX_SHOWN_ERRORS).enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            write!(f, "{shown}")?;
        }
        if self.diagnostics.len() > MAX_SHOWN_ERRORS {
            write!(
                f,
                "\n... and {} more errors",
                self.diagnostics.len() - MAX_SHOWN_ERRORS
            )?;
        }
        Ok(())
    }
}

impl std::error::Error for Report {}
