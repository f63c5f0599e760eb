//! Targets for descriptions: YAML, the expressions in it, the derivation, and C.

use std::fmt::Write as _;
use std::process::Command;

use regen_codegen::diag::{Report, Source};
use regen_codegen::pipeline::{BaseSource, DeriveError, derive_with};
use regen_codegen::robot::Robot;
use regen_codegen::spec::{Spec, parse};
use regen_codegen::{emit, interpret};

/// The text of a file; the reader refuses bytes that are not UTF-8.
fn text(bytes: &[u8]) -> Option<&str> {
    std::str::from_utf8(bytes).ok()
}

/// Checks that errors have places inside the text and can be printed.
pub(crate) fn check_report(text: &str, report: &Report) {
    assert!(!report.diagnostics.is_empty(), "a report without an error");
    for shown in report.shown() {
        let diagnostic = shown.diagnostic();
        let places = diagnostic.secondary.iter().map(|(span, _)| *span);
        for span in places.chain([diagnostic.span]) {
            assert!(text.get(span.start..span.end).is_some(), "{diagnostic:?}");
        }
        assert!(shown.line() <= text.split('\n').count(), "{diagnostic:?}");
        assert!(!diagnostic.headline().contains('\n'), "{diagnostic:?}");
    }
    assert!(report.render(false).contains("error"));
    // control sequences of a terminal never come from a file
    let all = report.to_string();
    assert!(!all.is_empty() && !all.contains('\u{1b}'), "{all}");
}

/// The spec of a text; errors are checked by [`check_report`].
fn read(text: &str) -> Option<Spec> {
    match parse(&Source::new("input.yaml", text)) {
        Ok(spec) => Some(spec),
        Err(report) => {
            check_report(text, &report);
            None
        }
    }
}

/// Checks that a description is read or refused.
///
/// # Panics
/// When the reader panics, or its report has places outside of the text.
pub fn yaml(bytes: &[u8]) {
    if let Some(text) = text(bytes) {
        let _ = read(text);
    }
}

/// A robot with the text at every place of an expression, with `\"` and `\\` escaped as YAML
/// requires.
fn with_expression(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len() + 2);
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if (c as u32) < 0x20 || c == '\u{7f}' => {
                let _ = write!(quoted, "\\x{:02x}", c as u32);
            }
            c => quoted.push(c),
        }
    }
    format!(
        "name: r\ngeometry: {{a: 3, b: -1/2, c: \"{quoted}\"}}\n\
         limbs: [{{name: l, joints: [{{name: q1, type: revolute, dh: {{alpha: \"{quoted}\"}}, \
         body: 1, actuated: true, friction: linear}}, {{name: q2, type: revolute, body: 2}}]}}]\n\
         couplings: {{q2: \"{quoted}\"}}\nbase: {{zero: [\"{quoted}\"]}}\n"
    )
}

/// Checks that an expression has an exact value or an error, as a constant, as a coupling and as a
/// form of parameters.
///
/// # Panics
/// When the reader panics, or a value is not finite.
pub fn expression(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let robot = "name: r\ngeometry: {a: 3, b: -1/2}\n\
                 limbs: [{name: l, joints: [{name: q1, type: revolute, body: 1, actuated: true}]}]\n";
    let value = read(robot).and_then(|spec| spec.evaluate(text));
    if let Some(value) = value {
        let number = value.to_f64();
        assert!(number.is_finite(), "{text} is {number}");
        assert!(number != 0.0 || value.is_zero(), "{text} is too small");
    }
    let _ = read(&with_expression(text));
}

/// The length of the largest text that is derived, bytes: longer ones take too long.
const MAX_DERIVED_BYTES: usize = 1500;

/// The robot of a short description; errors are checked by [`check_report`].
fn derived(bytes: &[u8]) -> Option<Robot> {
    let text = text(bytes).filter(|text| text.len() <= MAX_DERIVED_BYTES)?;
    let source = Source::new("input.yaml", text);
    // like the macro: with base parameters if these are quick
    let robot = match derive_with(&source, BaseSource::Store(None)) {
        Err(DeriveError::NotStored) => derive_with(&source, BaseSource::Skip),
        other => other,
    };
    match robot {
        Ok(robot) => Some(robot),
        Err(DeriveError::Spec(report)) => {
            check_report(text, &report);
            None
        }
        Err(problem) => unreachable!("nothing was stored: {problem:?}"),
    }
}

/// Checks that a description becomes a robot whose functions can be run, or is refused.
///
/// # Panics
/// When the derivation or a function panics, or an output has another size than stated.
pub fn derive(bytes: &[u8]) {
    let Some(robot) = derived(bytes) else { return };
    for function in &robot.functions {
        let arguments = function.program.arguments.iter();
        let arguments: Vec<Vec<f64>> = arguments.map(|a| vec![0.3; a.len]).collect();
        let arguments: Vec<&[f64]> = arguments.iter().map(Vec::as_slice).collect();
        let (values, _) = interpret::run(&function.program, &arguments);
        let size = function.program.output.shape.iter().product::<usize>();
        assert_eq!(values.len(), size);
    }
}

/// Checks that a description becomes C that gcc compiles without a warning, or is refused. Without
/// gcc, the C is only written.
///
/// # Panics
/// When gcc refuses the C.
pub fn c(bytes: &[u8]) {
    let Some(robot) = derived(bytes) else { return };
    // the command refuses these
    if emit::c::hides_a_header(&robot.name) {
        return;
    }
    let files = emit::c::files(&robot);
    let folder = std::env::temp_dir().join(format!("regen-fuzz-c-{}", std::process::id()));
    let source = folder.join("robot.c");
    let written = std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(folder.join(format!("{}.h", files.name)), &files.header))
        .and_then(|()| std::fs::write(&source, &files.source));
    let compiled = written.and_then(|()| {
        let mut gcc = Command::new("gcc");
        gcc.args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion"]);
        gcc.args(["-Werror", "-fsyntax-only"]).arg(&source).output()
    });
    // a folder that cannot be removed is left for the system to clean up
    let _ = std::fs::remove_dir_all(&folder);
    if let Ok(compiled) = compiled {
        let warnings = String::from_utf8_lossy(&compiled.stderr);
        assert!(compiled.status.success(), "{warnings}");
    }
}
