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
    notes: Vec<Entry>,
}

/// A note; those whose text is the same are printed as one.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Entry {
    place: Place,
    /// The text, with `{}` where the items stand that are grouped.
    text: String,
    item: Option<String>,
    /// Whether all items are listed, and not only the first few.
    lists_all: bool,
    changes_digits: bool,
}

/// Notes with the same text, at the first of their places.
struct Group<'a> {
    first: &'a Entry,
    items: Vec<&'a str>,
    count: usize,
}

impl Group<'_> {
    /// The text, with its items or the first few of them.
    fn text(&self) -> String {
        const MAX_ITEMS: usize = 4;
        let most = if self.first.lists_all {
            self.items.len()
        } else {
            MAX_ITEMS
        };
        let shown: Vec<&str> = self.items.iter().take(most).copied().collect();
        let more = match self.items.len().saturating_sub(most) {
            0 => String::new(),
            n => format!(" and {n} more"),
        };
        let listed = format!("{}{more}", shown.join(", "));
        let text = if self.items.is_empty() {
            self.first.text.clone()
        } else {
            self.first.text.replacen("{}", &listed, 1)
        };
        if self.count > self.items.len().max(1) {
            format!("{text} ({} times)", self.count)
        } else {
            text
        }
    }
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
        self.push(place, text.into(), None);
    }

    /// Records a note on an item: notes with the same text are printed as one that lists the items
    /// where the text has `{}`.
    pub(crate) fn note_of(&mut self, place: Place, text: impl Into<String>, item: &str) {
        self.push(place, text.into(), Some(item.to_owned()));
    }

    /// Records a note on an item; as [`Log::note_of`], but every item is listed.
    pub(crate) fn note_each(&mut self, place: Place, text: impl Into<String>, item: &str) {
        let entry = self.push(place, text.into(), Some(item.to_owned()));
        entry.lists_all = true;
    }

    /// Records a note on changed digits; as [`Log::note_of`].
    pub(crate) fn note_digits(&mut self, place: Place, text: impl Into<String>, item: &str) {
        let entry = self.push(place, text.into(), Some(item.to_owned()));
        entry.changes_digits = true;
    }

    fn push(&mut self, place: Place, text: String, item: Option<String>) -> &mut Entry {
        let at = self.notes.len();
        self.notes.push(Entry {
            place,
            text,
            item,
            lists_all: false,
            changes_digits: false,
        });
        &mut self.notes[at]
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
        let mut notes: Vec<&Entry> = self.notes.iter().collect();
        notes.sort_by_key(|note| (note.place.file, note.place.span.start));
        notes.dedup();
        let mut groups: Vec<Group<'_>> = Vec::new();
        for note in notes {
            let same = |group: &&mut Group<'_>| {
                group.first.text == note.text && group.first.item.is_some() == note.item.is_some()
            };
            let Some(group) = groups.iter_mut().find(same) else {
                groups.push(Group {
                    first: note,
                    items: note.item.as_deref().into_iter().collect(),
                    count: 1,
                });
                continue;
            };
            group.count += 1;
            if let Some(item) = note.item.as_deref()
                && !group.items.contains(&item)
            {
                group.items.push(item);
            }
        }
        groups
            .into_iter()
            .filter_map(|group| {
                let source = self.sources.get(group.first.place.file)?;
                let at = source.position(group.first.place.span);
                Some(Note {
                    file: source.name.clone(),
                    line: at.line,
                    column: at.column,
                    text: group.text(),
                    changes_digits: group.first.changes_digits,
                })
            })
            .collect()
    }
}
