//! Equations as a Python script for SymPy.

use std::collections::HashMap;
use std::fmt::Write as _;

use crate::constants::{Form, Irrational};
use crate::identifiers::Identifiers;
use crate::names::Name;
use crate::page::Page;
use crate::plain::{Level, Spelling, Writer, digits};
use crate::text::{infix_form, infix_quotient};

/// Python with the identifiers of inputs, lengths and terms.
struct Python {
    inputs: Vec<Vec<String>>,
    names: HashMap<Name, String>,
}

impl Python {
    fn new(page: &Page<'_>) -> Self {
        let mut given = Identifiers::default();
        let inputs = page.inputs.iter().map(|argument| {
            let each = argument.iter();
            each.map(|input| given.give(&input.text)).collect()
        });
        let inputs = inputs.collect();
        let all = page.names.all();
        let names = all
            .map(|(_, name)| {
                let wanted = format!("{}_{}", name.letter, name.index);
                (name.clone(), given.give(&wanted))
            })
            .collect();
        Self { inputs, names }
    }
}

impl Spelling for &Python {
    fn number(&self, value: f64) -> String {
        digits(value)
    }

    fn input(&self, argument: usize, element: usize) -> String {
        self.inputs[argument][element].clone()
    }

    fn name(&self, name: &Name) -> String {
        self.names.get(name).cloned().unwrap_or_default()
    }

    fn form(&self, form: &Form) -> (String, Level) {
        let (text, level) = infix_form(form);
        // SymPy's division of two integers would be Python's
        match (form.irrational, form.below) {
            (Irrational::None, 2..) => (
                format!("Rational({}, {})", digits(form.above), form.below),
                Level::Atom,
            ),
            _ => (text, level),
        }
    }

    fn call(&self, function: &str, operand: &str) -> String {
        match function {
            // SymPy's default at zero is 1/2
            "positive" => format!("Heaviside({operand}, 0)"),
            "negative" => format!("Heaviside(-({operand}), 0)"),
            _ => format!("{function}({operand})"),
        }
    }

    fn product(&self, a: &str, b: &str) -> String {
        format!("{a}*{b}")
    }

    fn quotient(&self, above: (String, Level), below: (String, Level)) -> (String, Level) {
        infix_quotient(above, below)
    }

    fn square(&self, operand: &str) -> String {
        format!("{operand}**2")
    }

    fn group(&self, inner: &str) -> String {
        format!("({inner})")
    }
}

/// The Python function that evaluates the result at numbers, term by term.
const EVALUATE: &str = "

def evaluate(values):
    \"\"\"The result at numbers, given as a dictionary of symbols to numbers; lengths have those of
    the description unless they are given too.\"\"\"
    known = {**lengths, **values}

    def number(expression):
        return expression.xreplace({s: Float(known[s], 20) for s in expression.free_symbols}).evalf(20)

    for term, expression in terms:
        known[term] = number(expression)
    return result.applyfunc(number)
";

/// The whole script.
pub(crate) fn write(page: &Page<'_>) -> String {
    let python = Python::new(page);
    let writer = Writer {
        graph: &page.graph,
        names: &page.names,
        spelling: &python,
    };
    let for_docstring = |text: &str| text.replace('\\', "/").replace("\"\"\"", "'''");
    let mut out = format!(
        "\"\"\"{}: {}\n\n",
        for_docstring(&page.robot.name),
        for_docstring(&page.heading)
    );
    for line in page.captions() {
        let _ = writeln!(out, "{}", for_docstring(&line));
    }
    out.push_str(
        "\n`terms` lists intermediate terms in the order in which they are computed, `result` is the\n\
         matrix in them, and `evaluate` its value.\"\"\"\n\
         from sympy import Float, Heaviside, Matrix, Rational, Symbol, cos, pi, sign, sin, sqrt\n\n",
    );
    let symbol = |out: &mut String, identifier: &str, name: &str| {
        let name = name.replace(['\\', '\''], " ");
        let _ = writeln!(out, "{identifier} = Symbol('{name}', real=True)");
    };
    let given = |k: &usize| !page.is_given(*k);
    let all = page.inputs.iter().zip(&python.inputs).enumerate();
    for (_, (argument, identifiers)) in all.filter(|(k, _)| given(k)) {
        for (input, identifier) in argument.iter().zip(identifiers) {
            symbol(&mut out, identifier, &input.text);
        }
    }
    let all = page.arguments.iter().zip(&python.inputs).enumerate();
    for (_, (argument, identifiers)) in all.filter(|(k, _)| given(k)) {
        // an argument that has the name of one of its elements is a list with an underscore
        let _ = writeln!(out, "{argument}_ = [{}]", identifiers.join(", "));
    }
    let identifiers = page
        .geometry
        .and_then(|k| python.inputs.get(k))
        .into_iter()
        .flatten();
    let lengths = identifiers.zip(&page.robot.adjustable);
    let lengths: Vec<String> = lengths
        .map(|(identifier, (_, value))| format!("{identifier}: {}", digits(*value)))
        .collect();
    let _ = writeln!(out, "lengths = {{{}}}\n\nterms = []", lengths.join(", "));
    for (id, name) in page.names.all() {
        let identifier = writer.spelling.name(name);
        let text = writer.expression(id).0;
        let _ = writeln!(
            out,
            "{identifier} = Symbol('{identifier}', real=True)\nterms.append(({identifier}, {text}))"
        );
    }
    let (rows, columns) = page.shape;
    let _ = writeln!(out, "\nresult = Matrix.zeros({rows}, {columns})");
    for entry in page.entries() {
        let row = entry.index.first().map_or(0, |row| row - 1);
        let column = entry.index.get(1).map_or(0, |column| column - 1);
        let value = writer.operand(entry.id).0;
        let _ = writeln!(out, "result[{row}, {column}] = {value}");
    }
    out.push_str(EVALUATE);
    out
}
