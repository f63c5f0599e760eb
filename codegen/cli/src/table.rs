//! Plain tables of at most 80 columns, and JSON.

use std::fmt::Write as _;

use serde::Serialize;

pub(crate) const WIDTH: usize = 80;

/// A value as JSON text. Maps have string keys and numbers are finite in all that is printed,
/// so that writing to a string cannot fail.
pub(crate) fn json<T: Serialize>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_default() + "\n"
}

/// Rows in columns, the first aligned left and the others right.
pub(crate) fn columns(head: &[&str], rows: &[Vec<String>]) -> String {
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

/// A named value, wrapped under itself.
pub(crate) fn field(name: &str, value: &str) -> String {
    const INDENT: usize = 16;
    format!("  {name:<w$}{}", wrapped(value, INDENT), w = INDENT - 2)
}

/// A statement in a list, wrapped under itself.
pub(crate) fn item(text: &str) -> String {
    const INDENT: usize = 4;
    format!("  - {}", wrapped(text, INDENT))
}

/// Words in lines that fit the width.
pub(crate) fn paragraph(text: &str) -> String {
    wrapped(text, 0)
}

/// Words in lines that fit the width, all but the first indented.
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

/// A figure in five digits, with an exponent only where it is hard to read without.
pub(crate) fn figure(value: f64) -> String {
    figure_of(5, value)
}

/// A figure in some digits, with an exponent only where it is hard to read without.
pub(crate) fn figure_of(digits: usize, value: f64) -> String {
    let digits = digits.max(1);
    let text = format!("{value:.*e}", digits - 1);
    // the exponent of what is printed: 0.99999 may round to 1.0
    let exponent = text.split_once('e').and_then(|(_, e)| e.parse().ok());
    let places = match exponent {
        _ if value == 0.0 => return "0".to_owned(),
        Some(before @ 0_isize..=4) => (digits - 1).saturating_sub(before.unsigned_abs()),
        Some(after @ -3..=-1) => digits - 1 + after.unsigned_abs(),
        _ => return text,
    };
    format!("{value:.places$}")
}

/// How large a number is, that counts by its exponent; zero plainly.
pub(crate) fn size(digits: usize, value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else {
        format!("{value:.*e}", digits.max(1) - 1)
    }
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
    fn figures_have_an_exponent_only_where_they_are_hard_to_read_without() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (2.2, "2.2000"),
            (-1.4143, "-1.4143"),
            (0.001, "0.0010000"),
            (0.000_999_999_9, "0.0010000"),
            (0.000_36, "3.6000e-4"),
            (9_999.99, "10000"),
            (12_345.6, "12346"),
            (123_456.0, "1.2346e5"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(figure(value), text);
        }
        assert_eq!(size(2, 0.0), "0");
        assert_eq!(size(2, 1.23e-16), "1.2e-16");
        assert_eq!(size(1, 1.0), "1e0");
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
