//! Indented text in lines, with lists that are wrapped where they are long.

use std::fmt::Write as _;

/// Largest width of an emitted line of a list, in characters.
const MAX_LINE_WIDTH: usize = 96;

/// Writes the items of an array, as many to a line as fit.
pub(super) fn wrapped(out: &mut String, items: impl Iterator<Item = String>) {
    let mut row = String::new();
    for item in items {
        if !row.is_empty() && row.len() + item.len() > 90 {
            let _ = writeln!(out, "    {}", row.trim_end());
            row.clear();
        }
        let _ = write!(row, "{item}, ");
    }
    if !row.is_empty() {
        let _ = writeln!(out, "    {}", row.trim_end());
    }
}

/// The text of a function's body while it is written.
#[derive(Debug, Default)]
pub(super) struct Text {
    out: String,
}

impl Text {
    /// Writes one line at an indentation of `depth` levels.
    pub(super) fn line(&mut self, depth: usize, text: &str) {
        for _ in 0..depth {
            self.out.push_str("    ");
        }
        self.out.push_str(text);
        self.out.push('\n');
    }

    /// Continues the last line.
    pub(super) fn append(&mut self, text: &str) {
        self.out.pop();
        self.out.push_str(text);
        self.out.push('\n');
    }

    /// Writes `head open items close tail`, over several lines if it is long. `brackets` opens and
    /// closes the list.
    pub(super) fn list(
        &mut self,
        depth: usize,
        head: &str,
        brackets: [&str; 2],
        items: &[String],
        tail: &str,
    ) {
        let [open, close] = brackets;
        let flat = format!("{head}{open}{}{close}{tail}", items.join(", "));
        if flat.len() + 4 * depth <= MAX_LINE_WIDTH {
            return self.line(depth, &flat);
        }
        self.line(depth, &format!("{head}{open}"));
        self.rows(depth + 1, items);
        self.line(depth, &format!("{close}{tail}"));
    }

    /// Writes items, each followed by a comma, over several lines if they are many.
    fn rows(&mut self, depth: usize, items: &[String]) {
        let mut row = String::new();
        for item in items {
            if !row.is_empty() && row.len() + item.len() + 4 * depth + 2 > MAX_LINE_WIDTH {
                self.line(depth, row.trim_end());
                row.clear();
            }
            let _ = write!(row, "{item}, ");
        }
        self.line(depth, row.trim_end());
    }

    /// The text so far.
    pub(super) fn into_string(self) -> String {
        self.out
    }
}
