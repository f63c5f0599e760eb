//! Formats text in lines that fit a terminal of 80 columns.

use std::fmt::Write as _;

/// The largest number of characters of a line, unless a single word is longer.
pub const WIDTH: usize = 80;

/// Formats rows in columns, the first aligned left and the others right.
///
/// ```
/// use regen_codegen::explain::lines::columns;
///
/// let rows = [vec!["a".to_owned(), "1".to_owned()], vec!["bcd".to_owned(), "1234".to_owned()]];
/// assert_eq!(columns(&["x", "n"], &rows), "  x       n\n  a       1\n  bcd  1234\n");
/// ```
pub fn columns(head: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        cells
            .map(|cell| cell.chars().count())
            .chain(head.get(column).map(|title| title.chars().count()))
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let titles: Vec<String> = head.iter().map(|&title| title.to_owned()).collect();
    let mut out = String::new();
    for row in std::iter::once(&titles).chain(rows) {
        let mut line = String::from(" ");
        for (column, (cell, &width)) in row.iter().zip(&widths).enumerate() {
            let _ = if column == 0 {
                write!(line, " {cell:<width$}")
            } else {
                write!(line, "  {cell:>width$}")
            };
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}

/// Formats a name and its value; further lines of the value are aligned with its first.
///
/// ```
/// use regen_codegen::explain::lines::field;
///
/// assert_eq!(field("rank", "3 of 10 columns"), "  rank          3 of 10 columns\n");
/// ```
pub fn field(name: &str, value: &str) -> String {
    const INDENT: usize = 16;
    const WIDTH_OF_NAMES: usize = INDENT - 2;
    if name.chars().count() < WIDTH_OF_NAMES {
        return format!("  {name:<WIDTH_OF_NAMES$}{}", wrapped(value, INDENT));
    }
    // a name that fills its column is the beginning of the text
    format!("  {}", wrapped(&format!("{name} {value}"), INDENT))
}

/// Formats an entry of a list; further lines are aligned with its text.
///
/// ```
/// assert_eq!(regen_codegen::explain::lines::item("one"), "  - one\n");
/// ```
pub fn item(text: &str) -> String {
    const INDENT: usize = 4;
    format!("  - {}", wrapped(text, INDENT))
}

/// Wraps words into lines of at most [`WIDTH`] characters.
///
/// ```
/// let text = regen_codegen::explain::lines::paragraph(&"word ".repeat(20));
/// assert!(text.lines().count() == 2 && text.lines().all(|line| line.len() <= 80));
/// ```
pub fn paragraph(text: &str) -> String {
    wrapped(text, 0)
}

/// Wraps words into lines of at most [`WIDTH`] characters, all but the first indented.
fn wrapped(text: &str, indent: usize) -> String {
    let mut out = String::new();
    let mut column = indent;
    for (k, word) in text.split_whitespace().enumerate() {
        let length = word.chars().count();
        if k > 0 && column + 1 + length > WIDTH {
            let _ = write!(out, "\n{:indent$}", "");
            column = indent;
        } else if k > 0 {
            out.push(' ');
            column += 1;
        }
        out.push_str(word);
        column += length;
    }
    out.push('\n');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = vec![
            vec!["a".to_owned(), "1".to_owned()],
            vec!["bcd".to_owned(), "1234".to_owned()],
        ];
        assert_eq!(
            columns(&["x", "n"], &rows),
            "  x       n\n  a       1\n  bcd  1234\n"
        );
    }

    #[test]
    fn a_value_follows_a_long_name_after_a_blank() {
        let text = field("shoulder_pan_joint (atan)", &"Fc 12.3, ".repeat(20));
        assert!(text.starts_with("  shoulder_pan_joint (atan) Fc 12.3, "));
        assert!(text.lines().all(|line| line.len() <= 80));
        assert!(field("fourteen signs", "1").starts_with("  fourteen signs 1"));
    }

    #[test]
    fn long_fields_wrap_before_column_80() {
        let text = field("parameters", &"Ixx(1) ".repeat(40));
        assert!(text.lines().count() > 1);
        assert!(
            text.lines()
                .all(|line| line.len() <= WIDTH && !line.ends_with(' ')),
            "{text}"
        );
        assert_eq!(text.matches("Ixx(1)").count(), 40);
    }
}
