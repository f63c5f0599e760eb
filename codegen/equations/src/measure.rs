//! How wide formulas are in print, estimated from above, and where they are broken.
//!
//! Widths are in points of Computer Modern at 10 pt, whose glyphs are about as wide as those of other text
//! fonts. Letters count as their widest ones, so that what fits here fits in print.

use core::iter::Peekable;
use core::str::Chars;

/// What fits into a column of a paper of two columns: LaTeX's own have 221 pt on A4, those of conferences 240 to 252.
pub(crate) const COLUMN: f64 = 221.0;
/// How far further lines of an equation are to the right.
pub(crate) const INDENT: f64 = 10.0;
/// What stands at the beginning of further lines: the empty group makes a sign that follows binary.
const NEXT_LINE: &str = " \\\\\n  &\\quad {}";
/// The part of the width that indices have: small glyphs are wider than their size is.
const SCRIPT: f64 = 0.8;
/// What LaTeX leaves free after an index.
const AFTER_SCRIPT: f64 = 0.5;
/// A sign between two operands, with its spaces.
const SIGN: f64 = 12.3;
/// A dot between two factors.
const DOT: f64 = 7.3;

/// The width of a formula in math mode.
pub(crate) fn width(source: &str) -> f64 {
    of_group(&mut source.chars().peekable())
}

/// The width up to the end of a group.
fn of_group(rest: &mut Peekable<Chars<'_>>) -> f64 {
    let mut all = 0.0;
    while let Some(c) = rest.next() {
        match c {
            '}' => break,
            c => all += of_token(c, rest),
        }
    }
    all
}

/// The width of the next argument of a command.
fn of_argument(rest: &mut Peekable<Chars<'_>>) -> f64 {
    match rest.next() {
        Some('{') => of_group(rest),
        Some(c) => of_token(c, rest),
        None => 0.0,
    }
}

fn of_token(c: char, rest: &mut Peekable<Chars<'_>>) -> f64 {
    match c {
        '{' => of_group(rest),
        '_' | '^' => SCRIPT * of_argument(rest) + AFTER_SCRIPT,
        '\\' => of_command(rest),
        ' ' | '&' | '\n' => 0.0,
        '+' | '-' => SIGN,
        '=' | '<' | '>' => 13.4,
        '(' | ')' | '[' | ']' => 3.9,
        ',' => 4.5,
        '.' => 2.8,
        'm' | 'w' => 9.0,
        'M' | 'W' => 10.5,
        'i' | 'j' | 'l' | 't' => 4.2,
        c if c.is_ascii_uppercase() => 8.2,
        c if c.is_ascii_lowercase() => 5.8,
        _ => 5.1,
    }
}

fn of_command(rest: &mut Peekable<Chars<'_>>) -> f64 {
    let mut name: String = rest.next().into_iter().collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        while let Some(c) = rest.next_if(char::is_ascii_alphabetic) {
            name.push(c);
        }
    }
    match name.as_str() {
        "," => 1.7,
        "cdot" => DOT,
        "quad" => INDENT,
        "frac" => 2.4 + of_argument(rest).max(of_argument(rest)),
        "tfrac" => 2.4 + SCRIPT * of_argument(rest).max(of_argument(rest)),
        "sqrt" => 10.0 + of_argument(rest),
        // a delimiter as high as a fraction
        "left" | "right" => {
            rest.next();
            6.0
        }
        "sin" | "cos" => 15.0,
        "operatorname" => 1.7 + of_argument(rest),
        "mathrm" | "dot" | "ddot" => of_argument(rest),
        _ => 6.6,
    }
}

/// A formula in lines that fit.
///
/// It is broken before signs, also in parentheses, before factors and before strokes of fractions, but within
/// no group in braces and between no `\left` and `\right`.
///
/// - `room`: of the first line; of the further ones it is less by [`INDENT`].
pub(crate) fn broken(source: &str, room: f64) -> String {
    let mut out = String::new();
    let (mut line, mut room) = (0.0, room);
    let further = room - INDENT;
    for term in parts(source, &[" + ", " - "]) {
        let pieces = if width(term) <= further {
            vec![term]
        } else {
            parts(term, &["\\,", " \\cdot ", " / "])
        };
        for piece in pieces {
            let own = width(piece);
            if line == 0.0 || line + own <= room {
                out.push_str(piece);
                line += own;
                continue;
            }
            out.push_str(NEXT_LINE);
            room = further;
            line = own;
            match piece.strip_prefix("\\,") {
                Some(factor) => {
                    out.push_str(" \\cdot ");
                    out.push_str(factor);
                    line += DOT;
                }
                None => out.push_str(piece),
            }
        }
    }
    out
}

/// The source in parts that begin with a separator, except for the first.
fn parts<'s>(source: &'s str, separators: &[&str]) -> Vec<&'s str> {
    let (mut depth, mut start) = (0_usize, 0);
    let mut out = Vec::new();
    for (at, c) in source.char_indices() {
        let rest = source.get(at..).unwrap_or_default();
        let is_separator = depth == 0 && separators.iter().any(|own| rest.starts_with(own));
        if is_separator && at > start {
            out.push(source.get(start..at).unwrap_or_default());
            start = at;
        }
        match c {
            '{' => depth += 1,
            '}' => depth = depth.saturating_sub(1),
            '\\' if rest.starts_with("\\left") => depth += 1,
            '\\' if rest.starts_with("\\right") => depth = depth.saturating_sub(1),
            _ => {}
        }
    }
    out.push(source.get(start..).unwrap_or_default());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_as_long_as_fits_and_say_what_the_formula_says() {
        let sum: Vec<String> = (0..60)
            .map(|k| format!("(a_{{{k}}}\\,q_{{2}} - b)"))
            .collect();
        let text = broken(&sum.join(" + "), 200.0);
        let lines: Vec<&str> = text.split(" \\\\\n").collect();
        assert!(lines.len() > 10, "{text}");
        // what is left for the last line may be short
        for line in &lines[1..lines.len() - 1] {
            assert!((140.0..=200.0).contains(&width(line)), "{line}");
        }
        assert!(width(lines[lines.len() - 1]) <= 200.0, "{text}");
        assert_eq!(text.replace(NEXT_LINE, ""), sum.join(" + "));
        // a product is broken where it has no sums, and what no line holds is not cut
        let product = vec!["x_{1}"; 40].join("\\,");
        assert!(broken(&product, 100.0).contains("{} \\cdot x_{1}\\,"));
        let fraction = format!("\\frac{{{product}}}{{2}}");
        assert_eq!(broken(&fraction, 100.0), fraction);
    }

    #[test]
    fn widths_are_those_of_what_is_printed() {
        // a fraction is as wide as its wider part, an index is smaller than what it belongs to
        assert!(width("\\frac{abc}{a}") < width("abc") + 3.0);
        assert!(width("x_{abc}") < width("x") + width("abc"));
        assert!((width("\\sin\\left(q\\right)") - 15.0 - 12.0 - 5.8).abs() < 1e-9);
        assert!((width("\\dot{q}") - width("q")).abs() < 1e-9);
    }
}
