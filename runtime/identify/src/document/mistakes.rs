//! Mistakes in JSON files with their places. The parts of a file are parsed one by one, each a slice
//! of the text, so that every mistake has an offset.

use core::fmt;

use serde_json::error::Category;
use serde_json::value::RawValue;

/// The remedy for a mistake.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Remedy {
    /// What to write instead, or the reason for the rule.
    Words(String),
    /// The file is of another kind than the one that is read.
    OtherFile,
}

/// A mistake in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// The byte offset of its beginning in the text.
    pub at: usize,
    /// The part of the file in words, such as `cosine, row 2`; empty for the whole file.
    pub path: String,
    /// The mistake, in words.
    pub message: String,
    /// The remedy, if one is known.
    pub remedy: Option<Remedy>,
}

impl Mistake {
    /// A mistake in a value, which must be a slice of the text.
    pub fn of(text: &str, raw: &RawValue, path: &str, message: &str) -> Self {
        Self {
            at: offset(text, raw.get()),
            path: path.to_owned(),
            message: message.to_owned(),
            remedy: None,
        }
    }

    /// An error of the JSON parser in a part of the text, with its place in the whole.
    ///
    /// ```
    /// use regen_identify::files::Mistake;
    ///
    /// let text = "[\n  3,\n  x]";
    /// let error = serde_json::from_str::<Vec<f64>>(text).unwrap_err();
    /// let mistake = Mistake::unparsed(text, text, &error, "list");
    /// assert_eq!((mistake.at, &*mistake.path), (9, "list"));
    /// assert_eq!(mistake.message, "not JSON: expected value");
    /// ```
    pub fn unparsed(text: &str, part: &str, error: &serde_json::Error, path: &str) -> Self {
        let line_start: usize = part
            .split_inclusive('\n')
            .take(error.line().saturating_sub(1))
            .map(str::len)
            .sum();
        let at = offset(text, part) + line_start + error.column().saturating_sub(1);
        // without the parser's " at line 1 column 2", which counts from the beginning of the part
        let whole = error.to_string();
        let message = whole.rsplit_once(" at line ").map_or(&*whole, |(m, _)| m);
        let message = match error.classify() {
            Category::Syntax | Category::Eof => format!("not JSON: {message}"),
            Category::Data | Category::Io => message.to_owned(),
        };
        Self {
            at,
            path: path.to_owned(),
            message,
            remedy: None,
        }
    }

    /// Adds a remedy in words.
    #[must_use]
    pub fn words(mut self, words: &str) -> Self {
        self.remedy = Some(Remedy::Words(words.to_owned()));
        self
    }

    /// Adds the remedy that another kind of file is needed.
    #[must_use]
    pub fn other_file(mut self) -> Self {
        self.remedy = Some(Remedy::OtherFile);
        self
    }
}

/// The byte offset of a slice of the text.
fn offset(text: &str, part: &str) -> usize {
    let start = text.as_ptr() as usize;
    (part.as_ptr() as usize).saturating_sub(start)
}

/// All mistakes in a file, at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistakes(pub Vec<Mistake>);

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, mistake) in self.0.iter().enumerate() {
            let Mistake {
                at, path, message, ..
            } = mistake;
            let line = if k == 0 { "" } else { "\n" };
            let colon = if path.is_empty() { "" } else { ": " };
            write!(f, "{line}byte {at}: {path}{colon}{message}")?;
        }
        Ok(())
    }
}

impl core::error::Error for Mistakes {}
