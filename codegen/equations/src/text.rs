//! Equations as plain text.

use std::fmt::Write as _;

use crate::constants::{Form, Irrational, form};
use crate::names::Name;
use crate::page::Page;
use crate::plain::{Level, Spelling, Writer, digits};

/// Plain text, with the names of the description.
pub(crate) struct Plain<'p>(pub(crate) &'p Page<'p>);

impl Spelling for Plain<'_> {
    fn number(&self, value: f64) -> String {
        digits(value)
    }

    fn input(&self, argument: usize, element: usize) -> String {
        self.0.inputs[argument][element].text.clone()
    }

    fn name(&self, name: &Name) -> String {
        term(name)
    }

    fn form(&self, form: &Form) -> (String, Level) {
        infix_form(form)
    }

    fn call(&self, function: &str, operand: &str) -> String {
        format!("{function}({operand})")
    }

    fn product(&self, a: &str, b: &str) -> String {
        format!("{a}*{b}")
    }

    fn quotient(&self, above: (String, Level), below: (String, Level)) -> (String, Level) {
        infix_quotient(above, below)
    }

    fn square(&self, operand: &str) -> String {
        format!("{operand}^2")
    }

    fn group(&self, inner: &str) -> String {
        format!("({inner})")
    }
}

/// A form in infix notation, such as `sqrt(6)/4` or `9.81*sqrt(2)/2`, with its precedence.
pub(crate) fn infix_form(form: &Form) -> (String, Level) {
    let root = match form.irrational {
        Irrational::None => None,
        Irrational::Root(number) => Some(format!("sqrt({number})")),
        Irrational::Pi => Some("pi".to_owned()),
    };
    let has_number = root.is_none() || form.above.to_bits() != 1.0_f64.to_bits();
    let number = has_number.then(|| digits(form.above));
    let parts: Vec<String> = number.into_iter().chain(root).collect();
    let above = parts.join("*");
    if form.below > 1 {
        return (format!("{above}/{}", form.below), Level::Product);
    }
    let level = if parts.len() > 1 {
        Level::Product
    } else {
        Level::Atom
    };
    (above, level)
}

/// A number as a form, or else with its digits.
pub(crate) fn stated(value: f64) -> String {
    let sign = if value < 0.0 { "-" } else { "" };
    form(value.abs()).map_or_else(
        || digits(value),
        |form| format!("{sign}{}", infix_form(&form).0),
    )
}

/// The quotient `a/b`. A sum is put in parentheses, and so is a product in the denominator.
pub(crate) fn infix_quotient(above: (String, Level), below: (String, Level)) -> (String, Level) {
    let grouped = |(text, own): (String, Level), level: Level| {
        if own < level {
            format!("({text})")
        } else {
            text
        }
    };
    let (above, below) = (grouped(above, Level::Product), grouped(below, Level::Power));
    (format!("{above}/{below}"), Level::Product)
}

/// The name of an intermediate term, such as `s_12` or `c_(1+2-3)`.
fn term(name: &Name) -> String {
    if name.index.contains(['+', '-']) {
        format!("{}_({})", name.letter, name.index)
    } else {
        format!("{}_{}", name.letter, name.index)
    }
}

/// The whole page: the heading, the lengths in use, the intermediate terms, and the entries.
pub(crate) fn write(page: &Page<'_>) -> String {
    let writer = Writer {
        graph: &page.graph,
        names: &page.names,
        spelling: Plain(page),
    };
    let mut out = format!("{}: {}\n", page.robot.name, page.heading);
    for line in page.captions() {
        let _ = writeln!(out, "{line}");
    }
    for (name, value) in page.used_lengths() {
        let _ = writeln!(out, "{name} = {}", stated(value));
    }
    out.push('\n');
    for (id, name) in page.names.all() {
        let text = writer.expression(id).0;
        let _ = writeln!(out, "{} = {text}", term(name));
    }
    out.push('\n');
    for entry in page.entries() {
        let index: Vec<String> = entry.index.iter().map(usize::to_string).collect();
        let value = writer.operand(entry.id).0;
        let _ = writeln!(out, "{}_{} = {value}", page.letter, index.join(","));
    }
    if page.has_zeros() {
        let _ = writeln!(
            out,
            "\nEntries of {} that are not listed are 0.",
            page.letter
        );
    }
    out
}
