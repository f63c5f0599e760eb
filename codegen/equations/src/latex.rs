//! Equations as LaTeX, for a document with `amsmath`.

use std::fmt::Write as _;

use crate::constants::{Form, Irrational};
use crate::measure::{COLUMN, broken, width};
use crate::names::Name;
use crate::page::{Entry, Page};
use crate::plain::{Level, Spelling, Writer, digits};
use crate::text::stated;
use regen_codegen::base::latex::GREEK;

/// The largest number of columns of a matrix that is written as a `bmatrix`; it may have twice as many rows.
const MAX_MATRIX_COLUMNS: usize = 6;
/// The space between two columns of such a matrix, pt.
const BETWEEN_COLUMNS: f64 = 10.0;
/// The widest fraction or operand of a function that is not broken, pt.
const MAX_UNBROKEN: f64 = 0.6 * COLUMN;

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
            "sqrt" if width(operand) > MAX_UNBROKEN => format!("({operand})^{{1/2}}"),
            "sqrt" => format!("\\sqrt{{{operand}}}"),
            "sin" | "cos" if width(operand) > MAX_UNBROKEN => format!("\\{function}({operand})"),
            "sin" | "cos" => format!("\\{function}\\left({operand}\\right)"),
            "sign" if width(operand) > MAX_UNBROKEN => {
                format!("\\operatorname{{sgn}}({operand})")
            }
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
        if width(&above.0).max(width(&below.0)) <= MAX_UNBROKEN {
            return (format!("\\frac{{{}}}{{{}}}", above.0, below.0), Level::Atom);
        }
        let grouped = |(text, own): (String, Level), least: Level| {
            if own < least { self.group(&text) } else { text }
        };
        let (above, below) = (grouped(above, Level::Product), grouped(below, Level::Power));
        // in parentheses wherever it is a factor, which would seem to belong to the denominator
        (format!("{above} / {below}"), Level::Sum)
    }

    fn square(&self, operand: &str) -> String {
        if width(operand) > MAX_UNBROKEN {
            return format!("{operand}^2");
        }
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

/// A name as a letter, Latin or Greek, with an index below, under an accent such as `dot` (empty for none): `q1` with
/// the accent `dot` is `\dot{q}_{1}`, and `alpha_1` is `\alpha_{1}`. Other names are upright.
pub(crate) fn symbol(name: &str, accent: &str) -> String {
    let letters = name.chars().take_while(char::is_ascii_alphabetic).count();
    let (stem, rest) = name.split_at(letters);
    let index = rest.strip_prefix('_').unwrap_or(rest);
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '.';
    let accented = |stem: &str| match accent {
        "" => stem.to_owned(),
        accent => format!("\\{accent}{{{stem}}}"),
    };
    let letter = match stem {
        _ if letters == 1 => Some(stem.to_owned()),
        _ if GREEK.contains(&stem) => Some(format!("\\{stem}")),
        _ => None,
    };
    match (letter, index.is_empty()) {
        (Some(letter), true) => accented(&letter),
        (Some(letter), false) if index.chars().all(plain) => {
            format!("{}_{{{index}}}", accented(&letter))
        }
        _ => {
            let escaped = regen_codegen::base::latex::escaped(name);
            accented(&format!("\\mathrm{{{escaped}}}"))
        }
    }
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
    for (k, (name, value)) in page.used_lengths().enumerate() {
        if k == 0 {
            out.push_str("% lengths in m, angles in rad:\n");
        }
        let _ = writeln!(out, "% {name} = {}", stated(value));
    }
    out.push_str("% needs amsmath; \\allowdisplaybreaks lets long lists break\n");
    // the left and the right side of each equation
    let names = page.names.all();
    let mut sides: Vec<(String, String)> =
        (names.map(|(id, name)| (term(name), writer.expression(id).0))).collect();
    let letter = if page.letter == "tau" {
        "\\tau"
    } else {
        page.letter
    };
    let entries: Vec<Entry> = page.entries().collect();
    let value = |entry: &Entry| writer.operand(entry.id).0;
    let (rows, columns) = page.shape;
    let mut matrix = None;
    if columns > 1 && columns <= MAX_MATRIX_COLUMNS && rows <= 2 * MAX_MATRIX_COLUMNS {
        let mut cells = vec![vec!["0".to_owned(); columns]; rows];
        for entry in &entries {
            if let [row, column] = entry.index[..]
                && let Some(cell) = cells.get_mut(row - 1).and_then(|r| r.get_mut(column - 1))
            {
                *cell = value(entry);
            }
        }
        let widest = |column: usize| {
            let own = cells.iter().filter_map(|row| row.get(column));
            own.map(|cell| width(cell)).fold(BETWEEN_COLUMNS, f64::max) + BETWEEN_COLUMNS
        };
        let left = sides
            .iter()
            .map(|side| width(&side.0))
            .fold(width(letter), f64::max);
        let wide: f64 = (0..columns).map(widest).sum();
        if left + width("=") + wide <= COLUMN {
            let rows: Vec<String> = cells.iter().map(|row| row.join(" & ")).collect();
            matrix = Some(format!(
                "  {letter} &= \\begin{{bmatrix}}\n    {}\n  \\end{{bmatrix}}",
                rows.join(" \\\\\n    ")
            ));
        }
    }
    if matrix.is_none() {
        sides.extend(entries.iter().map(|entry| {
            let index: Vec<String> = entry.index.iter().map(usize::to_string).collect();
            (format!("{letter}_{{{}}}", index.join(",")), value(entry))
        }));
    }
    let left = sides.iter().map(|side| width(&side.0)).fold(0.0, f64::max);
    let room = COLUMN - left - width("=");
    let lines = sides
        .iter()
        .map(|(left, right)| format!("  {left} &= {}", broken(right, room)));
    let is_short = matrix.is_some();
    let lines: Vec<String> = lines.chain(matrix).collect();
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::fs;
    use std::path::Path;

    use regen_codegen::Mechanism;
    use regen_codegen::diag::Source;

    use super::*;
    use crate::{EquationSet, Parameters, Style, equations, kinds};

    #[test]
    fn no_line_is_wider_than_a_column_of_a_paper() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
        let (mut lines, mut widest) = (0, 0.0_f64);
        let files = fs::read_dir(folder).unwrap();
        let mut files: Vec<_> = files.map(|entry| entry.unwrap().path()).collect();
        files.retain(|path| path.extension().is_some_and(|end| end == "yaml"));
        assert!(files.len() > 10);
        files.sort();
        for path in files {
            let name = path.display();
            let text = fs::read_to_string(&path).unwrap();
            let mechanism = Mechanism::open(&Source::new("robot.yaml", &text)).unwrap();
            for of in [
                EquationSet::Closure,
                EquationSet::Jacobian,
                EquationSet::X,
                EquationSet::Regressor,
                EquationSet::Dynamics,
                EquationSet::Mass,
                EquationSet::Coriolis,
                EquationSet::Gravity,
                EquationSet::Frames,
            ] {
                let robot = mechanism
                    .robot_in_names(&kinds(of, Parameters::All))
                    .unwrap();
                // not every robot has loops
                let Ok(text) = equations(&robot, of, Parameters::All, Style::Latex) else {
                    continue;
                };
                let body = text.split("\\begin{align*}\n").nth(1).unwrap();
                let body = body.split("\n\\end{align*}").next().unwrap();
                // a matrix is one line as wide as its columns are
                let body = match body.split_once("\\begin{bmatrix}") {
                    Some((before, matrix)) => {
                        let rows = matrix.split("\\end").next().unwrap().split("\\\\");
                        let of = |row: &str| row.split('&').map(|x| width(x) + 10.0).sum::<f64>();
                        assert!(rows.map(of).all(|w| w < COLUMN), "{matrix}");
                        before
                    }
                    None => body,
                };
                let all: Vec<&str> = body.split("\\\\\n").collect();
                let left = all
                    .iter()
                    .filter_map(|line| Some(width(line.split_once("&=")?.0)));
                let left = left.fold(0.0, f64::max);
                for line in all {
                    let right = line.split_once('&').unwrap().1;
                    let own = left + width(right);
                    assert!(own <= COLUMN + 1e-9, "{name}: {own} pt: {line}");
                    (lines, widest) = (lines + 1, widest.max(own));
                }
            }
        }
        assert!(lines > 500 && widest > 0.9 * COLUMN, "{lines} {widest}");
    }
}
