//! Equations as LaTeX, for a document with `amsmath`.

use std::fmt::Write as _;

use crate::constants::{Form, Irrational};
use crate::names::Name;
use crate::page::{Entry, Page};
use crate::plain::{Level, Spelling, Writer, digits};

/// The longest entry of a matrix that is written as a `bmatrix`, in characters of source; matrices
/// with longer entries are written entry by entry.
const MAX_ENTRY_LENGTH: usize = 48;
/// The largest number of columns of such a matrix; it may have twice as many rows.
const MAX_MATRIX_COLUMNS: usize = 6;
/// Characters of an equation's source after which a sum continues on the next line.
const LINE_LENGTH: usize = 150;

/// LaTeX in math mode.
pub(crate) struct Latex<'p>(pub(crate) &'p Page<'p>);

impl Spelling for Latex<'_> {
    fn number(&self, value: f64) -> String {
        let text = digits(value);
        match text.split_once('e') {
            Some((digits, exponent)) => format!("{digits} \\cdot 10^{{{exponent}}}"),
            None => text,
        }
    }

    fn input(&self, argument: usize, element: usize) -> String {
        self.0.inputs[argument][element].latex.clone()
    }

    fn name(&self, name: &Name) -> String {
        term(name)
    }

    fn form(&self, form: &Form) -> (String, Level) {
        let root = match form.irrational {
            Irrational::None => None,
            Irrational::Root(number) => Some(format!("\\sqrt{{{number}}}")),
            Irrational::Pi => Some("\\pi".to_owned()),
        };
        let has_number = root.is_none() || form.above.to_bits() != 1.0_f64.to_bits();
        let number = has_number.then(|| self.number(form.above));
        let parts: Vec<String> = number.into_iter().chain(root).collect();
        let above = parts.join("\\,");
        if form.below > 1 {
            return (format!("\\tfrac{{{above}}}{{{}}}", form.below), Level::Atom);
        }
        let level = if parts.len() > 1 {
            Level::Product
        } else {
            Level::Atom
        };
        (above, level)
    }

    fn call(&self, function: &str, operand: &str) -> String {
        match function {
            "sqrt" => format!("\\sqrt{{{operand}}}"),
            "sin" | "cos" => format!("\\{function}\\left({operand}\\right)"),
            "sign" => format!("\\operatorname{{sgn}}\\left({operand}\\right)"),
            "positive" => format!("\\left[{operand} > 0\\right]"),
            _ => format!("\\left[{operand} < 0\\right]"),
        }
    }

    fn product(&self, a: &str, b: &str) -> String {
        if b.starts_with(|c: char| c.is_ascii_digit()) {
            format!("{a} \\cdot {b}")
        } else {
            format!("{a}\\,{b}")
        }
    }

    fn quotient(&self, above: (String, Level), below: (String, Level)) -> (String, Level) {
        (format!("\\frac{{{}}}{{{}}}", above.0, below.0), Level::Atom)
    }

    fn square(&self, operand: &str) -> String {
        format!("{{{operand}}}^2")
    }

    fn group(&self, inner: &str) -> String {
        format!("({inner})")
    }
}

/// The name of an intermediate term: its letter with an index.
fn term(name: &Name) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.');
    let index = if name.index.chars().all(plain) {
        name.index.clone()
    } else {
        let escaped = regen_codegen::base::latex::escaped(&name.index);
        format!("\\mathrm{{{escaped}}}")
    };
    format!("{}_{{{index}}}", name.letter)
}

/// A name as letters with an index below, under an accent such as `dot` (empty for none): `q1` with
/// the accent `dot` is `\dot{q}_{1}`.
pub(crate) fn symbol(name: &str, accent: &str) -> String {
    let letters = name.chars().take_while(char::is_ascii_alphabetic).count();
    let (stem, rest) = name.split_at(letters);
    let index = rest.strip_prefix('_').unwrap_or(rest);
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '.';
    let accented = |stem: &str| match accent {
        "" => stem.to_owned(),
        accent => format!("\\{accent}{{{stem}}}"),
    };
    match (letters, index.is_empty()) {
        (1, true) => accented(stem),
        (1, false) if index.chars().all(plain) => format!("{}_{{{index}}}", accented(stem)),
        _ => {
            let escaped = regen_codegen::base::latex::escaped(name);
            accented(&format!("\\mathrm{{{escaped}}}"))
        }
    }
}

/// A long sum on several lines of `align*`, broken between terms.
fn broken(text: &str) -> String {
    let mut out = String::new();
    let (mut line, mut depth) = (0_usize, 0_usize);
    let bytes = text.as_bytes();
    for (at, c) in text.char_indices() {
        match c {
            '{' | '(' | '[' => depth += 1,
            '}' | ')' | ']' => depth = depth.saturating_sub(1),
            _ => {}
        }
        let between = c == ' ' && depth == 0 && matches!(bytes.get(at + 1), Some(b'+' | b'-'));
        if between && line > LINE_LENGTH {
            out.push_str(" \\\\\n  &\\quad");
            line = 0;
        }
        out.push(c);
        line += 1;
    }
    out
}

/// The whole fragment.
pub(crate) fn write(page: &Page<'_>) -> String {
    let writer = Writer {
        graph: &page.graph,
        names: &page.names,
        spelling: Latex(page),
    };
    let mut out = format!("% {}: {}\n", page.robot.name, page.heading);
    for line in page.captions() {
        let _ = writeln!(out, "% {line}");
    }
    for (name, value) in page.used_lengths() {
        let _ = writeln!(out, "% {name} = {} m or rad", digits(value));
    }
    out.push_str("% needs amsmath; \\allowdisplaybreaks lets long lists break\n");
    let mut lines: Vec<String> = Vec::new();
    for (id, name) in page.names.all() {
        lines.push(format!(
            "  {} &= {}",
            term(name),
            broken(&writer.expression(id).0)
        ));
    }
    let letter = if page.letter == "tau" {
        "\\tau"
    } else {
        page.letter
    };
    let entries: Vec<Entry> = page.entries().collect();
    let value = |entry: &Entry| writer.operand(entry.id).0;
    let (rows, columns) = page.shape;
    let is_short = columns > 1
        && columns <= MAX_MATRIX_COLUMNS
        && rows <= 2 * MAX_MATRIX_COLUMNS
        && entries
            .iter()
            .all(|entry| value(entry).len() <= MAX_ENTRY_LENGTH);
    if is_short {
        let mut cells = vec![vec!["0".to_owned(); columns]; rows];
        for entry in &entries {
            if let [row, column] = entry.index[..]
                && let Some(cell) = cells.get_mut(row - 1).and_then(|r| r.get_mut(column - 1))
            {
                *cell = value(entry);
            }
        }
        let rows: Vec<String> = cells.iter().map(|row| row.join(" & ")).collect();
        lines.push(format!(
            "  {letter} &= \\begin{{bmatrix}}\n    {}\n  \\end{{bmatrix}}",
            rows.join(" \\\\\n    ")
        ));
    } else {
        for entry in &entries {
            let index: Vec<String> = entry.index.iter().map(usize::to_string).collect();
            lines.push(format!(
                "  {letter}_{{{}}} &= {}",
                index.join(","),
                broken(&value(entry))
            ));
        }
    }
    let _ = write!(
        out,
        "\\begin{{align*}}\n{}\n\\end{{align*}}\n",
        lines.join(" \\\\\n")
    );
    if page.has_zeros() && !is_short {
        let _ = writeln!(out, "Entries of ${letter}$ that are not listed are zero.");
    }
    out
}
