//! Equations as plain text.

use std::fmt::Write as _;

use crate::constants::Form;
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

    fn form(&self, form: &Form<'_>) -> (String, Level) {
        infix_form(form, "^")
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

/// A form in infix notation, such as `sqrt(3)*a/2` or `2*sqrt(3)/(3*a)`, with its precedence.
///
/// - `power`: the operator of powers.
pub(crate) fn infix_form(form: &Form<'_>, power: &str) -> (String, Level) {
    let [above, root, below] = form.factor;
    let (mut over, mut under) = (Vec::new(), Vec::new());
    if above > 1 {
        over.push(above.to_string());
    }
    over.extend(form.decimal.map(digits));
    if root > 1 {
        over.push(format!("sqrt({root})"));
    }
    if below > 1 {
        under.push(below.to_string());
    }
    if let Some(name) = form.name {
        let side = if form.inverse { &mut under } else { &mut over };
        side.push(name.to_owned());
    }
    for sine in form.sines {
        let mut text = format!("{}({})", sine.function, sine.angle);
        if sine.power > 1 {
            let _ = write!(text, "{power}{}", sine.power);
        }
        over.push(text);
    }
    let level = match (over.len(), under.len()) {
        (1, 0) if form.sines.iter().all(|sine| sine.power == 1) => Level::Atom,
        (1, 0) => Level::Power,
        _ => Level::Product,
    };
    let mut text = if over.is_empty() {
        "1".to_owned()
    } else {
        over.join("*")
    };
    match &under[..] {
        [] => {}
        [one] => {
            let _ = write!(text, "/{one}");
        }
        _ => {
            let _ = write!(text, "/({})", under.join("*"));
        }
    }
    (text, level)
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
        known: &page.known,
        spelling: Plain(page),
    };
    let mut out = format!("{}: {}\n", page.robot.name, page.heading);
    for line in page.captions() {
        let _ = writeln!(out, "{line}");
    }
    for (name, value) in page.used_lengths() {
        let _ = writeln!(out, "{name} = {}", digits(value));
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
