//! Tables and equations of every robot fit plain LaTeX documents on A4, of one column and of two. Skipped with a
//! message where there is no pdflatex, which `.ci/full` installs.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::common::{regen, root, scratch};

/// Largest width by which a line may be too long, in points.
const MAX_OVERFULL: f64 = 1.0;

/// What is written of each robot.
const SETS: [&str; 10] = [
    "base",
    "equations --of closure",
    "equations --of jacobian",
    "equations --of X",
    "equations --of regressor",
    "equations --of dynamics --parameters base",
    "equations --of mass",
    "equations --of coriolis --parameters base",
    "equations --of gravity",
    "equations --of frames",
];

#[test]
fn no_line_of_a_table_or_an_equation_is_too_long() {
    if Command::new("pdflatex").arg("--version").output().is_err() {
        eprintln!("skipped: there is no pdflatex");
        return;
    }
    let dir = scratch("latex");
    let mut body = String::from(
        "\\usepackage{amsmath,array,booktabs,xtab}\n\\allowdisplaybreaks\n\\begin{document}\n",
    );
    let mut parts = 0;
    for entry in fs::read_dir(root().join("robots")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|end| end != "yaml") {
            continue;
        }
        let spec = path.display().to_string();
        for words in SETS {
            let mut args: Vec<&str> = words.split(' ').collect();
            args.extend([spec.as_str(), "--format", "latex"]);
            let run = regen(&dir, &args);
            // not every robot has loops and named frames
            if run.code != 0 {
                let is_missing = ["no loops", "no frames"]
                    .iter()
                    .any(|w| run.err.contains(w));
                assert!(is_missing, "{args:?}\n{}", run.err);
                continue;
            }
            parts += 1;
            let name = path.file_stem().unwrap().display();
            writeln!(
                body,
                "\\typeout{{part {name}: {words}}}\n{}\\clearpage",
                run.out
            )
            .unwrap();
        }
    }
    body += "\\end{document}\n";
    for (name, options) in [("one", "a4paper"), ("two", "a4paper,twocolumn")] {
        let document = format!("\\documentclass[{options}]{{article}}\n{body}");
        measure(&dir, name, &document, parts);
    }
}

/// Requires that LaTeX makes a document of so many parts whose lines are not too long.
fn measure(dir: &Path, name: &str, document: &str, parts: usize) {
    fs::write(dir.join(format!("{name}.tex")), document).unwrap();
    // the second run has the widths of the first
    for _ in 0..2 {
        let output = Command::new("pdflatex")
            .args(["-interaction=nonstopmode", "-halt-on-error", name])
            .current_dir(dir)
            .output()
            .unwrap();
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{printed}");
    }
    let log = fs::read(dir.join(format!("{name}.log"))).unwrap();
    let log = String::from_utf8_lossy(&log);
    let mut part = "";
    let mut count = 0;
    let mut far = Vec::new();
    for line in log.lines() {
        if let Some(name) = line.strip_prefix("part ") {
            part = name;
            count += 1;
        }
        let width = line.strip_prefix("Overfull \\hbox (");
        let width = width.and_then(|rest| rest.split("pt").next());
        if width.is_some_and(|width| width.parse::<f64>().unwrap() > MAX_OVERFULL) {
            far.push(format!("{name}, {part}: {line}"));
        }
    }
    assert_eq!(count, parts);
    assert!(far.is_empty(), "{}", far.join("\n"));
}

#[test]
fn common_factors_are_collected_and_symbols_are_explained() {
    let args = ["base", "robots/3rps.yaml", "--format", "latex"];
    let latex = regen(&root(), &args).ended(0).out;
    for part in [
        "\\begin{xtabular}",
        "\\tablecaption{",
        "\\label{tab:rps3-base}",
        "a^{2} \\,\\allowbreak \\bigl(m_{3} + m_{2}\\bigr)",
        "I_{xy,k} = -\\int xy\\,dm",
        "m_{1} x_{1}",
    ] {
        assert!(latex.contains(part), "{part}\n{latex}");
    }
}
