//! Emitted C with names that C and C++ reserve, and at singular states. `tests/tests/c_robots.rs`
//! compares the C of every robot with compiled Rust. Skipped with a message where there is no
//! compiler.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::files::files;
use regen_codegen::diag::Source;
use regen_codegen::emit::c;
use regen_codegen::interpret;
use regen_codegen::pipeline::derive;
use regen_codegen::robot::{FunctionKind, Robot};

const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"];

fn robot(text: &str) -> Robot {
    derive(&Source::new("robot.yaml", text)).unwrap_or_else(|e| panic!("{e}"))
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Whether a program can be started; prints a message if not.
fn has(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        eprintln!("left out: there is no {program}");
    }
    found
}

fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program} {arguments:?}\n{errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn write(folder: &Path, robot: &Robot) -> String {
    let files = c::files(robot);
    for (extension, text) in [("h", &files.header), ("c", &files.source)] {
        std::fs::write(folder.join(format!("{}.{extension}", files.name)), text).unwrap();
    }
    files.name
}

/// An arm of two joints whose bodies and coordinates have names that C and C++ reserve or declare.
fn reserved(name: &str) -> String {
    format!(
        "name: {name}\nlimbs:\n  - name: arm\n    joints:\n\
         \x20     - {{name: register, type: revolute, body: class, actuated: true}}\n\
         \x20     - {{name: restrict, type: prismatic, dh: {{alpha: pi/2}}, body: sin, actuated: true}}\n"
    )
}

#[test]
fn words_of_c_and_of_cpp_name_robots_and_coordinates() {
    let folder = folder("c-words");
    for word in ["double", "register", "class", "_3rps", "HOME"] {
        let robot = robot(&reserved(word));
        let name = write(&folder, &robot);
        let source = format!("{name}.c");
        for (compiler, language) in [("gcc", "-std=c99"), ("g++", "-xc++")] {
            if has(compiler) {
                let mut arguments = vec![language, "-fsyntax-only"];
                arguments.extend(WARNINGS);
                arguments.push(&source);
                run(&folder, compiler, &arguments);
            }
        }
        let symbols = c::symbols(&robot);
        let distinct: BTreeSet<&String> = symbols.iter().collect();
        assert_eq!(symbols.len(), distinct.len(), "{word}");
        assert_eq!(
            symbols.iter().filter(|s| s.ends_with("_f")).count(),
            robot.functions.len()
        );
    }
    assert!(c::hides_a_header("math"));
}

/// At a state where the planned pivot vanishes, the system is solved with other pivots.
#[test]
fn a_vanishing_pivot_is_replaced_by_other_pivots_in_c() {
    if !has("gcc") {
        return;
    }
    let folder = folder("c-pivot");
    let path = files("robots");
    let path = path.iter().find(|p| p.ends_with("fourbar.yaml")).unwrap();
    let robot = robot(&std::fs::read_to_string(path).unwrap());
    let name = write(&folder, &robot);
    // coupler and rocker in one line: no velocity of theirs closes the loop
    let state = [0.4_f64, 0.3, 0.7];
    let velocities = robot.function(FunctionKind::Velocities).unwrap();
    let (_, singular) = interpret::run(&velocities.program, &[&state[..], &[1.0][..]]);
    assert!(singular < 1e-10, "{singular}");
    let main = format!(
        "#include <stdio.h>\n#include \"{name}.h\"\nint main(void)\n{{\nconst double q[] = {{ 0.4, 0.3, 0.7 }}, \
         qd_i[] = {{ 1.0 }};\ndouble qd[3];\nprintf(\"%.17g\\n\", {name}_velocities(q, qd_i, qd));\nreturn 0;\n}}\n"
    );
    std::fs::write(folder.join("main.c"), main).unwrap();
    run(
        &folder,
        "gcc",
        &[
            "-std=c99",
            "-o",
            "run",
            "main.c",
            &format!("{name}.c"),
            "-lm",
        ],
    );
    let pivot: f64 = run(&folder, "./run", &[]).trim().parse().unwrap();
    assert!(pivot < 1e-10, "{pivot}");
}

/// The entries of a result that a line stores.
fn stored(line: &str, next: &str, name: &str) -> Vec<usize> {
    let entry = |text: &str| text.split_once(']').and_then(|(k, _)| k.parse().ok());
    if let Some(bounds) = line.strip_prefix("    for (int i_ = ")
        && next.trim_start().starts_with(&format!("{name}[i_] = "))
    {
        let (first, rest) = bounds.split_once(';').unwrap();
        let last = rest.split_once("<= ").unwrap().1.split_once(';').unwrap().0;
        return (first.parse().unwrap()..=last.parse().unwrap()).collect();
    }
    let own = line.strip_prefix(&format!("    {name}["));
    own.and_then(entry).into_iter().collect()
}

#[test]
fn every_entry_of_a_result_with_many_zeros_is_stored_once_and_long_runs_by_a_loop() {
    // the last row of the regressor has a run of zeros for all bodies but the last
    let joints = (1..=8)
        .map(|k| format!("      - {{name: q{k}, type: prismatic, body: b{k}, actuated: true}}\n"))
        .collect::<Vec<_>>()
        .concat();
    let robot = robot(&format!(
        "name: stack\nlimbs:\n  - name: arm\n    joints:\n{joints}"
    ));
    let regressor = robot.function(FunctionKind::Regressor).unwrap();
    let output = &regressor.program.output.name;
    let source = c::files(&robot).source;
    for name in ["stack_regressor", "stack_regressor_f"] {
        let function = source.split_once(&format!(" {name}(\n")).unwrap().1;
        let lines: Vec<&str> = function.split("\n}\n").next().unwrap().lines().collect();
        let mut all: Vec<usize> = lines
            .windows(2)
            .flat_map(|pair| stored(pair[0], pair[1], output))
            .collect();
        all.sort_unstable();
        let expected: Vec<usize> = (0..regressor.program.outputs.len()).collect();
        assert_eq!(all, expected, "{name}");
        assert!(lines.iter().any(|l| l.contains("for (int i_ = ")), "{name}");
    }
}

#[test]
fn fused_products_are_those_of_each_precision() {
    let source = c::files(&robot(&reserved("arm"))).source;
    for (macros, function) in [("FP_FAST_FMA)", "fma("), ("FP_FAST_FMAF)", "fmaf(")] {
        assert!(
            source.contains(macros) && source.contains(function),
            "{function}"
        );
    }
}

#[test]
fn headers_tell_what_the_choice_of_base_parameters_left_out_and_knew() {
    let text = "name: flap\nlimbs:\n  - name: arm\n    joints:\n      \
        - {name: q1, type: revolute, axis: y, body: b, actuated: true}\n";
    for (choice, words) in [
        ("drop", "before `base.drop` left 1 out"),
        ("zero", "with 1 parameter known by `base.zero`"),
    ] {
        let tells = |text: &str| {
            let files = c::files(&robot(text));
            (files.header + &files.source).contains(words)
        };
        assert!(tells(&format!("{text}base: {{{choice}: [mz(b)]}}\n")));
        assert!(!tells(text));
    }
}

/// Variables of single precision take half of the bytes.
#[test]
fn functions_take_less_of_the_stack_in_single_precision() {
    let joints = (1..=6)
        .map(|k| format!("      - {{name: q{k}, type: revolute, dh: {{a: 0.3, alpha: 0.{k}}}, body: b{k}, actuated: true}}\n"))
        .collect::<Vec<_>>()
        .concat();
    let robot = robot(&format!(
        "name: stack\nlimbs:\n  - name: arm\n    joints:\n{joints}"
    ));
    let header = c::files(&robot).header;
    let stated: Vec<[usize; 2]> = header
        .lines()
        .filter_map(|line| line.trim().strip_prefix("Stack: at most "))
        .map(|rest| {
            let (double, rest) = rest.split_once(" bytes on double, ").unwrap();
            let (float, _) = rest.split_once(" on float").unwrap();
            [double, float].map(|bytes| bytes.parse().unwrap())
        })
        .collect();
    assert_eq!(stated.len(), robot.functions.len());
    assert!(
        stated.iter().all(|[double, float]| float <= double),
        "{stated:?}"
    );
    let largest = stated.iter().max().unwrap();
    assert!(10 * largest[1] < 7 * largest[0], "{stated:?}");
}
