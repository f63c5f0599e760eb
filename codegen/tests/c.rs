//! The emitted C of every robot compiles without a warning as C99 and as C++, takes no more stack
//! than it states, and computes what the interpreter computes. Left out, with a word, where no
//! compiler is.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::files::files;
use regen_codegen::diag::Source;
use regen_codegen::emit::c;
use regen_codegen::interpret;
use regen_codegen::pipeline::derive;
use regen_codegen::robot::{Function, FunctionKind, Robot};

const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"];
/// Largest difference from the interpreter, relative to the largest entry of a function's output.
/// Sines and cosines differ by one unit in the last place, and solves magnify that.
const DOUBLE: f64 = 1e-14;
const FLOAT: f64 = 1e-5;

fn robot(text: &str) -> Robot {
    derive(&Source::new("robot.yaml", text)).unwrap_or_else(|e| panic!("{e}"))
}

/// The robots of the repository.
fn robots() -> Vec<Robot> {
    let paths = files("robots");
    let text = |path: &PathBuf| std::fs::read_to_string(path).unwrap();
    paths.iter().map(|path| robot(&text(path))).collect()
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Whether a program can be started; says so if not.
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

/// Irregular arguments of a function near home; loops need not be closed.
fn arguments(robot: &Robot, function: &Function) -> Vec<Vec<f64>> {
    let arguments = function.program.arguments.iter().enumerate();
    arguments
        .map(|(a, argument)| {
            let wave = |k: usize| libm::sin(0.7 + 1.3 * a as f64 + 1.7 * k as f64);
            let value = |k: usize| match argument.name.as_str() {
                "q" => robot.home[k] + 0.05 * wave(k),
                _ => wave(k),
            };
            // exact in single precision too
            (0..argument.len)
                .map(|k| f64::from(value(k) as f32))
                .collect()
        })
        .collect()
}

/// A C program that prints outputs and condition of every function in both precisions.
fn program(robots: &[(String, &Robot)]) -> String {
    let mut out = String::from("#include <stdio.h>\n");
    for (name, _) in robots {
        writeln!(out, "#include \"{name}.h\"").unwrap();
    }
    for (name, robot) in robots {
        writeln!(out, "static void run_{name}(void)\n{{").unwrap();
        for function in &robot.functions {
            for (number, suffix) in [("double", ""), ("float", "_f")] {
                let inputs = arguments(robot, function);
                let length = function.program.outputs.len();
                writeln!(
                    out,
                    "{{ {number} out[{}]; {number} pivot = 1;",
                    length.max(1)
                )
                .unwrap();
                let mut call = Vec::new();
                for (k, values) in inputs.iter().enumerate() {
                    // C has no arrays of length zero
                    let values = if values.is_empty() {
                        &vec![0.0]
                    } else {
                        values
                    };
                    let texts: Vec<String> =
                        values.iter().map(|v| format!("({number}){v:?}")).collect();
                    writeln!(
                        out,
                        "static const {number} in{k}[] = {{ {} }};",
                        texts.join(", ")
                    )
                    .unwrap();
                    call.push(format!("in{k}"));
                }
                call.push("out".to_owned());
                let kind = function.kind;
                let keep = if kind.signature().has_condition {
                    "pivot = "
                } else {
                    ""
                };
                writeln!(
                    out,
                    "{keep}{name}_{}{suffix}({});",
                    kind.name(),
                    call.join(", ")
                )
                .unwrap();
                writeln!(
                    out,
                    "for (int i = 0; i < {length}; i++) printf(\"%.17g \", (double)out[i]);"
                )
                .unwrap();
                writeln!(out, "printf(\"%.17g\\n\", (double)pivot); }}").unwrap();
            }
        }
        out.push_str("}\n");
    }
    out.push_str("int main(void)\n{\n");
    for (name, _) in robots {
        writeln!(out, "run_{name}();").unwrap();
    }
    out.push_str("return 0;\n}\n");
    out
}

/// The difference from what is expected, relative to the largest entry.
fn difference(found: &[f64], expected: &[f64]) -> f64 {
    let largest = expected.iter().fold(1e-300, |m: f64, x| m.max(x.abs()));
    assert_eq!(found.len(), expected.len());
    let pairs = found.iter().zip(expected);
    pairs.fold(0.0, |m: f64, (x, y)| {
        let apart = (x - y).abs() / largest;
        if apart <= m { m } else { apart }
    })
}

#[test]
fn every_robot_computes_in_c_what_the_interpreter_does() {
    if !has("gcc") {
        return;
    }
    let folder = folder("c-robots");
    let all = robots();
    let named: Vec<(String, &Robot)> = all.iter().map(|r| (write(&folder, r), r)).collect();
    std::fs::write(folder.join("main.c"), program(&named)).unwrap();
    let sources: Vec<String> = named.iter().map(|(name, _)| format!("{name}.c")).collect();
    // two compilers side by side
    let (left, right) = sources.split_at(sources.len() / 2);
    std::thread::scope(|scope| {
        for half in [left, right] {
            let folder = &folder;
            scope.spawn(move || {
                let mut arguments = vec!["-std=c99", "-O0", "-c", "-fstack-usage"];
                arguments.extend(WARNINGS);
                arguments.extend(half.iter().map(String::as_str));
                run(folder, "gcc", &arguments);
            });
        }
    });
    let objects: Vec<String> = named.iter().map(|(name, _)| format!("{name}.o")).collect();
    let mut link = vec!["-std=c99", "-O0", "-o", "run", "main.c"];
    link.extend(objects.iter().map(String::as_str));
    link.push("-lm");
    run(&folder, "gcc", &link);
    let text = run(&folder, "./run", &[]);
    let mut lines = text.lines();
    let (mut worst, mut worst_f) = ((0.0, String::new()), (0.0, String::new()));
    for (name, robot) in &named {
        for function in &robot.functions {
            let inputs = arguments(robot, function);
            let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
            let (expected, condition) = interpret::run(&function.program, &inputs);
            for (bound, worst) in [(DOUBLE, &mut worst), (FLOAT, &mut worst_f)] {
                let numbers = lines.next().unwrap().split_whitespace();
                let numbers: Vec<f64> = numbers.map(|x| x.parse().unwrap()).collect();
                let (pivot, outputs) = numbers.split_last().unwrap();
                let apart = difference(outputs, &expected);
                let case = format!("{name} {}", function.kind.name());
                assert!(apart <= bound, "{case}: {apart:e}");
                assert!(
                    (pivot - condition).abs() <= bound * 10.0,
                    "{case}: {pivot} {condition}"
                );
                if apart > worst.0 {
                    *worst = (apart, case);
                }
            }
        }
    }
    assert_eq!(lines.next(), None);
    println!("largest differences: {worst:?} on double, {worst_f:?} on float");
    for (name, robot) in &named {
        stack(&folder, name, robot);
    }
}

/// The stack of each function that the compiler reports is at most what the header states.
fn stack(folder: &Path, name: &str, robot: &Robot) {
    let header = std::fs::read_to_string(folder.join(format!("{name}.h"))).unwrap();
    let usage = std::fs::read_to_string(folder.join(format!("{name}.su"))).unwrap();
    let measured = |function: &str| -> usize {
        let suffix = format!(":{function}\t");
        let line = usage.lines().find(|line| line.contains(&suffix)).unwrap();
        line.split('\t').nth(1).unwrap().parse().unwrap()
    };
    // the frames below a function: a solve, and rows in it
    let below = |suffix: &str| {
        let helpers = ["sin_cos_lanes", "angle", "solve_pivoted", "row_size"];
        let known = helpers.map(|helper| format!("{name}_{helper}{suffix}"));
        let found = known
            .iter()
            .filter(|known| usage.contains(&format!(":{known}\t")));
        found.map(|known| measured(known)).sum::<usize>()
    };
    let mut stated = header.lines().filter_map(|line| {
        let (double, float) = line
            .split_once("Stack: at most ")?
            .1
            .split_once(" bytes on double, ")?;
        let float = float.split(' ').next()?;
        Some([double.parse::<usize>().unwrap(), float.parse().unwrap()])
    });
    for function in &robot.functions {
        let bounds = stated.next().unwrap();
        for (bound, suffix) in bounds.into_iter().zip(["", "_f"]) {
            let function = format!("{name}_{}{suffix}", function.kind.name());
            let found = measured(&function) + below(suffix);
            assert!(found <= bound, "{function}: {found} of {bound}");
        }
    }
}

/// A four-bar whose name, bodies and coordinates are words that C and C++ reserve.
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
fn a_vanishing_pivot_is_met_with_other_pivots_in_c() {
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
