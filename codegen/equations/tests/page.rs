//! The equations in the guide are up to date; `REGEN_UPDATE=1` writes them again.

use std::fmt::Write as _;
use std::path::Path;

use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_equations::{EquationSet, Parameters, Style, equations, kinds};

/// What a command of the page prints.
fn printed(command: &str) -> String {
    let words: Vec<&str> = command.split_whitespace().collect();
    let [_, _, file, _, of, rest @ ..] = &words[..] else {
        panic!("{command}");
    };
    let of = match *of {
        "closure" => EquationSet::Closure,
        "jacobian" => EquationSet::Jacobian,
        "X" => EquationSet::X,
        other => panic!("{other}"),
    };
    let style = if rest.contains(&"latex") {
        Style::Latex
    } else {
        Style::Text
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let text = std::fs::read_to_string(root.join(file)).unwrap();
    let source = Source::new(*file, &text);
    let mechanism = Mechanism::open(&source).unwrap();
    let robot = mechanism
        .robot_in_names(&kinds(of, Parameters::All))
        .unwrap();
    equations(&robot, of, Parameters::All, style).unwrap()
}

#[test]
fn the_guide_prints_what_the_command_does() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let path = root.join("runtime/guide/pages/equations.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let mut made = String::new();
    let mut parts = page.split("```");
    let mut pending = None;
    made.push_str(parts.next().unwrap());
    for part in parts {
        made.push_str("```");
        if let Some(command) = part.strip_prefix("sh run\n") {
            pending = Some(command.trim().to_owned());
            made.push_str(part);
        } else if part.starts_with("text\n") {
            let command = pending.take().unwrap();
            write!(made, "text\n{}", printed(&command)).unwrap();
        } else {
            made.push_str(part);
        }
    }
    if std::env::var_os("REGEN_UPDATE").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    assert!(
        made == page || std::env::var_os("REGEN_UPDATE").is_some(),
        "REGEN_UPDATE=1 writes the page anew"
    );
}
