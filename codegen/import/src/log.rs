//! Errors, which end the import, and notes, which do not.

use regen_codegen::diag::{Diagnostic, Report, Source, Span};

/// The [`Diagnostic::kind`] of an error caused by a loop of joints. A file that describes trees
/// cannot contain loops; [`Options::cuts`](crate::Options::cuts) can close them.
pub const LOOP_IN_TREE: &str = "loop in a tree";

/// A position in one of the files read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) file: usize,
    pub(crate) span: Span,
}

impl Place {
    pub(crate) fn new(file: usize, span: Span) -> Self {
        Self { file, span }
    }
}

/// A message on something that was decided, left out or changed by the import.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// The name of the file.
    pub file: String,
    /// The line in the file, from 1.
    pub line: usize,
    /// The column in characters, from 1.
    pub column: usize,
    /// The message.
    pub text: String,
    /// Whether digits of the file were changed; [`Options::exact`](crate::Options::exact) prevents
    /// this.
    pub changes_digits: bool,
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            file,
            line,
            column,
            text,
            ..
        } = self;
        write!(f, "{file}:{line}:{column}: {text}")
    }
}

/// All errors and notes, with the texts to which they refer.
#[derive(Debug, Default)]
pub(crate) struct Log {
    sources: Vec<Source>,
    errors: Vec<(usize, Diagnostic)>,
    notes: Vec<(Place, String, bool)>,
}

impl Log {
    /// Adds a text, and returns the file number for [`Place`].
    pub(crate) fn add(&mut self, source: Source) -> usize {
        self.sources.push(source);
        self.sources.len() - 1
    }

    /// Records an error: its place, the message and a hint how to correct it.
    pub(crate) fn error(&mut self, place: Place, message: impl Into<String>, hint: &str) {
        let diagnostic = Diagnostic::new(place.span, message).hint(hint);
        self.errors.push((place.file, diagnostic));
    }

    /// Records an error caused by a loop of joints in a tree.
    pub(crate) fn loop_error(&mut self, place: Place, message: &str, hint: &str) {
        let diagnostic = Diagnostic::new(place.span, message).hint(hint);
        let diagnostic = diagnostic.kind(LOOP_IN_TREE);
        self.errors.push((place.file, diagnostic));
    }

    pub(crate) fn note(&mut self, place: Place, text: impl Into<String>) {
        self.notes.push((place, text.into(), false));
    }

    /// Records a note on changed digits.
    pub(crate) fn note_digits(&mut self, place: Place, text: impl Into<String>) {
        self.notes.push((place, text.into(), true));
    }

    pub(crate) fn forget_notes(&mut self) {
        self.notes.clear();
    }

    pub(crate) fn failed(&self) -> bool {
        !self.errors.is_empty()
    }

    /// The errors, as one report per file that has any.
    pub(crate) fn reports(&self) -> Vec<Report> {
        let of = |file: usize| -> Vec<Diagnostic> {
            let errors = self.errors.iter().filter(|e| e.0 == file);
            errors.map(|e| e.1.clone()).collect()
        };
        let files = self.sources.iter().enumerate();
        files
            .map(|(file, source)| (source, of(file)))
            .filter(|(_, errors)| !errors.is_empty())
            .map(|(source, errors)| Report::new(source.clone(), errors))
            .collect()
    }

    /// The notes, in the order of the files.
    pub(crate) fn notes(&self) -> Vec<Note> {
        let mut notes: Vec<&(Place, String, bool)> = self.notes.iter().collect();
        notes.sort_by_key(|(place, ..)| (place.file, place.span.start));
        notes.dedup();
        // notes that say the same are one, at the first of their places
        let mut grouped: Vec<(&(Place, String, bool), usize)> = Vec::new();
        for note in notes {
            match grouped.iter_mut().find(|(first, _)| first.1 == note.1) {
                Some((_, count)) => *count += 1,
                None => grouped.push((note, 1)),
            }
        }
        grouped
            .into_iter()
            .filter_map(|((place, text, changes_digits), count)| {
                let source = self.sources.get(place.file)?;
                let at = source.position(place.span);
                Some(Note {
                    file: source.name.clone(),
                    line: at.line,
                    column: at.column,
                    text: match count {
                        1 => text.clone(),
                        n => format!("{text} ({n} times)"),
                    },
                    changes_digits: *changes_digits,
                })
            })
            .collect()
    }
}
