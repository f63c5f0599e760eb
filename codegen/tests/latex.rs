//! The tables of base parameters of every robot fit the page of a plain LaTeX document. Skipped
//! with a message where there is no pdflatex.

use std::path::Path;
use std::process::Command;

use crate::files::files;
use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_codegen::explain::table::{Style, Table};

/// Largest width by which a line may be too long, in points.
const MAX_OVERFULL: f64 = 1.0;

/// The table of a robot of the repository.
fn table(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let mut mechanism = Mechanism::open(&Source::new("robot.yaml", &text)).unwrap();
    if let Ok(stored) = std::fs::read_to_string(path.with_extension("base")) {
        mechanism.load_base(&stored).unwrap();
    }
    let robot = mechanism.robot(&[]).unwrap();
    let analysis = mechanism.analysis().unwrap();
    Table::new(&robot, analysis, Style::Short, &[]).latex()
}

#[test]
fn no_line_of_a_table_is_too_long() {
    if Command::new("pdflatex").arg("--version").output().is_err() {
        eprintln!("skipped: there is no pdflatex");
        return;
    }
    let mut document = String::from(
        "\\documentclass{article}\n\\usepackage{array,booktabs,longtable}\n\\begin{document}\n",
    );
    for path in files("robots") {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let table = table(&path);
        document.extend(["\\typeout{table of ", &name, "}\n", &table, "\\clearpage\n"]);
    }
    document += "\\end{document}\n";
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("latex");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("tables.tex"), document).unwrap();
    // the second run has the widths of the first
    for _ in 0..2 {
        let output = Command::new("pdflatex")
            .args(["-interaction=nonstopmode", "-halt-on-error", "tables.tex"])
            .current_dir(&folder)
            .output()
            .unwrap();
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{printed}");
    }
    let log = std::fs::read(folder.join("tables.log")).unwrap();
    let log = String::from_utf8_lossy(&log);
    let mut robot = "";
    let mut count = 0;
    for line in log.lines() {
        if let Some(name) = line.strip_prefix("table of ") {
            robot = name;
            count += 1;
        }
        let width = line.strip_prefix("Overfull \\hbox (");
        let width = width.and_then(|rest| rest.split("pt").next());
        if let Some(width) = width {
            let width: f64 = width.parse().unwrap();
            assert!(width <= MAX_OVERFULL, "{robot}: {line}");
        }
    }
    assert_eq!(count, files("robots").len());
}

#[test]
fn common_factors_are_collected_and_symbols_are_explained() {
    let path = files("robots");
    let path = path.iter().find(|p| p.ends_with("3rps.yaml")).unwrap();
    let latex = table(path);
    for part in [
        "\\begin{longtable}",
        "\\caption{",
        "\\label{tab:rps3-base}",
        "a^{2} \\,\\allowbreak \\bigl(m_{3} + m_{2}\\bigr)",
        "I_{xy,k} = -\\int xy\\,dm",
        "m_{1} x_{1}",
    ] {
        assert!(latex.contains(part), "{part}\n{latex}");
    }
}
