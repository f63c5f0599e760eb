//! Specs by path, their base parameters from layers 1 and 2, and evaluation of expressions in the
//! spec's grammar.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses its part")]

use std::path::PathBuf;

use regen_codegen::base::{Base, derive};
use regen_codegen::diag::Source;
use regen_codegen::model::{self, Model};
use regen_codegen::spec;
use regen_codegen::sym::Number;

/// The text of a file, by its path in the workspace.
pub fn file(path: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    std::fs::read_to_string(root.join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// The texts of all specs in a folder of the workspace, in the order of their names.
pub fn specs(folder: &str) -> Vec<String> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found: Vec<PathBuf> = std::fs::read_dir(root.join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "yaml"))
        .collect();
    found.sort();
    assert!(!found.is_empty(), "{folder}");
    found
        .iter()
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect()
}

/// The base parameters of a spec from layers 1 and 2 alone. With a `target` for the dimension of
/// the null space, the search for trees ends when it is reached.
pub fn base_with(text: &str, target: Option<usize>) -> (Model, Base) {
    let spec = spec::parse(&Source::new("test.yaml", text)).unwrap_or_else(|e| panic!("{e}"));
    let model = model::build(&spec);
    let base = derive(&spec, &model, target);
    (model, base)
}

/// The base parameters of a spec from layers 1 and 2 alone.
pub fn base(text: &str) -> (Model, Base) {
    base_with(text, None)
}

/// A row of the table as a person would write it.
pub fn row(model: &Model, base: &Base, at: usize) -> String {
    let mut text = String::new();
    for term in &base.parameters[at].terms {
        let label = &model.parameters[term.column].label;
        let printed = term.coefficient.to_string();
        let (sign, factor) = match printed.strip_prefix('-') {
            Some(rest) if !rest.contains(" + ") && !rest.contains(" - ") => (" - ", rest),
            _ => (" + ", printed.as_str()),
        };
        if !text.is_empty() {
            text.push_str(sign);
        }
        match factor {
            "1" => {}
            sum if sum.contains(' ') => text.extend(["(", sum, ") "]),
            factor => text.extend([factor, " "]),
        }
        text.push_str(label);
    }
    text
}

/// The values of expressions in the geometry names of a spec. They are added to the spec as further
/// names, so that its own parser evaluates them.
pub fn evaluate(text: &str, expressions: &[String]) -> Vec<Number> {
    let names: Vec<(String, &String)> = (0..).map(|k| format!("x{k}_")).zip(expressions).collect();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let at = lines.iter().position(|l| l.starts_with("geometry:"));
    match at {
        Some(at) if lines[at].contains('{') => {
            let end = lines[at].rfind('}').unwrap();
            let more: Vec<String> = names
                .iter()
                .map(|(n, e)| format!(", {n}: \"{e}\""))
                .collect();
            lines[at].insert_str(end, &more.concat());
        }
        Some(at) => {
            let length = lines[at + 1..]
                .iter()
                .take_while(|l| l.starts_with(' ') && !l.trim().is_empty())
                .count();
            let more = names.iter().map(|(n, e)| format!("  {n}: \"{e}\""));
            let after = at + 1 + length;
            lines.splice(after..after, more);
        }
        None => {
            let more = names.iter().map(|(n, e)| format!("  {n}: \"{e}\""));
            let block = std::iter::once("geometry:".to_owned()).chain(more);
            lines.splice(1..1, block.filter(|_| !expressions.is_empty()));
            let name = lines.iter().position(|l| l.starts_with("name:")).unwrap();
            let name = lines.remove(name);
            lines.insert(0, name);
        }
    }
    let text = lines.join("\n") + "\n";
    let spec = spec::parse(&Source::new("test.yaml", text)).unwrap_or_else(|e| panic!("{e}"));
    let values = names.iter().map(|(name, _)| {
        let quantity = spec.geometry.iter().find(|(n, _)| n.value == *name);
        quantity.unwrap().1.value.clone()
    });
    values.collect()
}
