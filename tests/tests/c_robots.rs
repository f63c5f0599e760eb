//! The emitted C of every robot compiles without a warning, takes no more stack than it states, and
//! computes what compiled Rust computes. Left out, with a word, where no C compiler is.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use regen_codegen::diag::Source;
use regen_codegen::emit::c;
use regen_codegen::interpret;
use regen_codegen::pipeline::derive;
use regen_codegen::robot::{Function, Robot};
use regen_runtime::function::Signature;
use regen_runtime::{Arguments, BaseFunction, ControlFunction, Function as Kind};
use regen_tests::files;

const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"];
/// Largest difference from compiled Rust on double, in units in the last place of the largest entry
/// of a function's output.
const ULPS: f64 = 4.0;
/// Largest difference on float from the interpreter on double, relative to the largest entry.
const FLOAT: f64 = 1e-5;
/// The robots whose functions on float are compiled and run: with loops, without, with square roots
/// and friction. The others' are only read by the compiler.
const ON_FLOAT: [&str; 6] = [
    "3rps_friction",
    "adjustable",
    "delta",
    "fivebar",
    "scara",
    "slider_crank",
];
/// Largest difference on double from the interpreter, whose sums have other roundings, in units in the last
/// place of the largest entry.
const INTERPRETED_ULPS: f64 = 100.0;

/// A robot with its C files, and the same robot as compiled Rust; without, it is compared with the
/// interpreter.
struct Compared {
    /// The name of its files, which names of functions begin with.
    name: String,
    robot: Robot,
    rust: Option<regen_robots::Robot>,
    on_float: bool,
}

/// All robots of `robots/` and one with adjustable geometry, their files written into a folder.
fn compared(folder: &Path) -> Vec<Compared> {
    let all = regen_robots::ALL.iter();
    let all = all.map(|&(file, rust)| (file, files::robots(), Some(rust)));
    let all = all.chain([("adjustable", files::fixtures().join("adjustable"), None)]);
    all.map(|(file, folder_of_specs, rust)| {
        let text = folder_of_specs.join(format!("{file}.yaml"));
        let text = std::fs::read_to_string(text).unwrap();
        let robot = derive(&Source::new(file, &text)).unwrap_or_else(|e| panic!("{e}"));
        let files = c::files(&robot);
        for (extension, text) in [("h", &files.header), ("c", &files.source)] {
            std::fs::write(folder.join(format!("{}.{extension}", files.name)), text).unwrap();
        }
        let on_float = ON_FLOAT.contains(&file);
        Compared {
            name: files.name,
            robot,
            rust,
            on_float,
        }
    })
    .collect()
}

fn run(folder: &Path, program: &str, arguments: &[String]) -> String {
    let mut command = Command::new(program);
    let output = command.args(arguments).current_dir(folder).output();
    let output = output.unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program} {arguments:?}\n{errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Irregular arguments of a function near home; loops need not be closed, but masses and moments of inertia are
/// those of bodies, so that the mass matrix is positive definite.
fn arguments(robot: &Robot, function: &Function) -> Vec<Vec<f64>> {
    let arguments = function.program.arguments.iter().enumerate();
    arguments
        .map(|(a, argument)| {
            let wave = |k: usize| (0.7 + 1.3 * a as f64 + 1.7 * k as f64).sin();
            let is_large = |k: usize| {
                let label = &robot.parameters[k].label;
                let mut names = ["Ixx(", "Iyy(", "Izz(", "m("].into_iter();
                names.any(|name| label.starts_with(name))
            };
            let value = |k: usize| match argument.name.as_str() {
                "q" => robot.home[k] + 0.05 * wave(k),
                "phi" if is_large(k) => 1.0 + 0.1 * wave(k),
                "phi" => 0.1 * wave(k),
                "geometry" => robot.adjustable[k].1 * (1.0 + 0.02 * wave(k)),
                _ => wave(k),
            };
            // exact in single precision too
            (0..argument.len)
                .map(|k| f64::from(value(k) as f32))
                .collect()
        })
        .collect()
}

/// The types on which a robot's functions are run, with the end of their names.
fn numbers(compared: &Compared) -> Vec<(&'static str, &'static str)> {
    let mut all = vec![("double", "")];
    if compared.on_float {
        all.push(("float", "_f"));
    }
    all
}

/// A C program that prints outputs and condition of every function.
fn program(robots: &[Compared]) -> String {
    let mut out = String::from("#include <stdio.h>\n");
    for Compared { name, .. } in robots {
        writeln!(out, "#include \"{name}.h\"").unwrap();
    }
    for compared in robots {
        let Compared { name, robot, .. } = compared;
        writeln!(out, "static void run_{name}(void)\n{{").unwrap();
        for function in &robot.functions {
            for (number, suffix) in numbers(compared) {
                call(
                    &mut out,
                    name,
                    function,
                    &arguments(robot, function),
                    [number, suffix],
                );
            }
        }
        out.push_str("}\n");
    }
    out.push_str("int main(void)\n{\n");
    for Compared { name, .. } in robots {
        writeln!(out, "run_{name}();").unwrap();
    }
    out.push_str("return 0;\n}\n");
    out
}

/// Writes a block that calls a function and prints its output and condition in one line.
fn call(
    out: &mut String,
    name: &str,
    function: &Function,
    inputs: &[Vec<f64>],
    [number, suffix]: [&str; 2],
) {
    let length = function.program.outputs.len();
    writeln!(
        out,
        "{{ {number} out[{}]; {number} pivot = 1;",
        length.max(1)
    )
    .unwrap();
    let mut call = Vec::new();
    for (k, values) in inputs.iter().enumerate() {
        let mut texts: Vec<String> = values.iter().map(|v| format!("({number}){v:?}")).collect();
        // C has no arrays of length zero
        if texts.is_empty() {
            texts.push("0".to_owned());
        }
        let texts = texts.join(", ");
        writeln!(out, "static const {number} in{k}[] = {{ {texts} }};").unwrap();
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
        "for (int i = 0; i < {length}; i++) printf(\"%.17g \", (double)out[i]);\n\
         printf(\"%.17g\\n\", (double)pivot); }}"
    )
    .unwrap();
}

/// What compiled Rust computes: the output and the condition.
fn by_rust(model: regen_robots::Robot, name: &str, inputs: &[Vec<f64>]) -> (Vec<f64>, f64) {
    let named = |signature: &'static Signature| {
        let given = signature.arguments.iter().zip(inputs);
        given.fold(Arguments::EMPTY, |all, (argument, entries)| {
            all.with(*argument, entries)
        })
    };
    let sizes = regen_runtime::function::Sizes::of(&model.info()).with_base(&model.base_info());
    let condition;
    let mut out;
    if let Some(kind) = Kind::ALL.into_iter().find(|k| k.signature().name == name) {
        out = vec![f64::NAN; sizes.output(kind.signature())];
        condition = model.eval(kind, named(kind.signature()), &mut out);
    } else if let Some(kind) = ControlFunction::ALL
        .into_iter()
        .find(|k| k.signature().name == name)
    {
        let mut controlled = regen_robots::CONTROLLED.iter();
        let of = model.info().name;
        let (_, model) = controlled.find(|(name, _)| *name == of).unwrap();
        out = vec![f64::NAN; sizes.output(kind.signature())];
        condition = model.eval_control(kind, named(kind.signature()), &mut out);
    } else {
        let mut kinds = BaseFunction::ALL.into_iter();
        let kind = kinds.find(|k| k.signature().name == name).unwrap();
        out = vec![f64::NAN; sizes.output(kind.signature())];
        condition = model.eval_base(kind, named(kind.signature()), &mut out);
    }
    (out, condition.unwrap().pivot)
}

/// The largest difference of two outputs, in units in the last place of the largest entry.
fn ulps(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let ulp = largest.next_up() - largest;
    let pairs = found.iter().zip(expected);
    pairs.fold(0.0, |m: f64, (x, y)| {
        let apart = (x - y).abs() / ulp;
        if apart <= m { m } else { apart }
    })
}

/// Compiles all robots without a warning, two compilers side by side.
fn compile(folder: &Path, robots: &[Compared]) {
    let (left, right) = robots.split_at(robots.len() / 2);
    std::thread::scope(|scope| {
        for half in [left, right] {
            scope.spawn(move || {
                for Compared { name, on_float, .. } in half {
                    let macros = name.to_ascii_uppercase();
                    let mut common = vec!["-std=c99".to_owned(), "-ffp-contract=off".to_owned()];
                    common.extend(WARNINGS.map(str::to_owned));
                    common.push(format!("{name}.c"));
                    let mut objects = common.clone();
                    objects.extend(["-O0", "-c", "-fstack-usage"].map(str::to_owned));
                    if !on_float {
                        objects.push(format!("-D{macros}_NO_FLOAT"));
                        common
                            .extend(["-fsyntax-only".to_owned(), format!("-D{macros}_NO_DOUBLE")]);
                        run(folder, "gcc", &common);
                    }
                    run(folder, "gcc", &objects);
                }
            });
        }
    });
}

#[test]
fn every_robot_gives_the_same_results_in_c_and_in_compiled_rust() {
    if Command::new("gcc").arg("--version").output().is_err() {
        eprintln!("left out: there is no gcc");
        return;
    }
    let folder = folder("c-robots");
    let all = compared(&folder);
    std::fs::write(folder.join("main.c"), program(&all)).unwrap();
    compile(&folder, &all);
    let mut link: Vec<String> = ["-std=c99", "-O0", "-o", "run", "main.c"]
        .map(str::to_owned)
        .to_vec();
    link.extend(all.iter().map(|one| format!("{}.o", one.name)));
    link.push("-lm".to_owned());
    run(&folder, "gcc", &link);
    let text = run(&folder, "./run", &[]);
    let mut lines = text.lines();
    let (mut worst, mut worst_f) = ((0.0, String::new()), (0.0, String::new()));
    for compared in &all {
        let Compared {
            name, robot, rust, ..
        } = compared;
        for function in &robot.functions {
            let kind = function.kind;
            let case = format!("{name} {}", kind.name());
            let inputs = arguments(robot, function);
            for (number, _) in numbers(compared) {
                let printed = lines.next().unwrap().split_whitespace();
                let printed: Vec<f64> = printed.map(|x| x.parse().unwrap()).collect();
                let (pivot, outputs) = printed.split_last().unwrap();
                let (expected, condition) = match rust {
                    Some(rust) if number == "double" => by_rust(*rust, kind.name(), &inputs),
                    _ => {
                        let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
                        interpret::run(&function.program, &inputs)
                    }
                };
                let apart = ulps(outputs, &expected);
                let (bound, worst) = match rust {
                    _ if number != "double" => (FLOAT / f64::EPSILON, &mut worst_f),
                    Some(_) => (ULPS, &mut worst),
                    None => (INTERPRETED_ULPS, &mut worst),
                };
                assert!(apart <= bound, "{case} on {number}: {apart} ulp");
                let least = bound * f64::EPSILON * 10.0;
                assert!(
                    (pivot - condition).abs() <= least,
                    "{case}: {pivot} {condition}"
                );
                if apart > worst.0 {
                    *worst = (apart, case.clone());
                }
            }
        }
    }
    assert_eq!(lines.next(), None);
    println!("largest differences: {worst:?} on double, {worst_f:?} on float");
    for compared in &all {
        stack(&folder, compared);
    }
}

/// The stack of each function that the compiler reports is at most what the header states.
fn stack(folder: &Path, compared: &Compared) {
    let Compared { name, robot, .. } = compared;
    let header = std::fs::read_to_string(folder.join(format!("{name}.h"))).unwrap();
    let usage = std::fs::read_to_string(folder.join(format!("{name}.su"))).unwrap();
    let measured = |function: &str| -> usize {
        let suffix = format!(":{function}\t");
        let line = usage.lines().find(|line| line.contains(&suffix)).unwrap();
        line.split('\t').nth(1).unwrap().parse().unwrap()
    };
    // the frames below a function: a solve, and rows in it
    let below = |suffix: &str| {
        let helpers = [
            "sin_cos_lanes",
            "sin_cos",
            "any_angle",
            "angle",
            "near",
            "solve_pivoted",
            "row_size",
        ];
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
        for ((_, suffix), bound) in numbers(compared).into_iter().zip(bounds) {
            let function = format!("{name}_{}{suffix}", function.kind.name());
            let found = measured(&function) + below(suffix);
            assert!(found <= bound, "{function}: {found} of {bound}");
        }
    }
}
