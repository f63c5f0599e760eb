//! The guide's examples in C and C++ compile against a robot's files and its identified constants,
//! and close its loops. Tests are left out with a message where no compiler is installed.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use regen_codegen::diag::Source;
use regen_codegen::emit::c;
use regen_codegen::pipeline::derive;
use regen_codegen::robot::Robot;
use regen_generated::fivebar::{self, Fivebar};
use regen_identify::files::{c_constants, python_constants, rust_constants};
use regen_identify::identify::digest;
use regen_identify::model::{IdentifiedModel, Provenance};
use regen_runtime::{BaseModel, LoopClosure};
use regen_tests::files;

const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"];

/// The five-bar's values as if they were identified.
fn identified() -> IdentifiedModel {
    IdentifiedModel {
        name: "least squares".to_owned(),
        beta: (0..fivebar::BASE.len()).map(|k| 0.1 + k as f64).collect(),
        provenance: Provenance {
            model: String::new(),
            logs: vec!["run1".to_owned(), "run */ 2\n".to_owned()],
            date: Some("2026-11-23".to_owned()),
            filter: None,
        },
        ..IdentifiedModel::default()
    }
}

fn model() -> &'static dyn BaseModel<f64> {
    &Fivebar
}

/// The five-bar with rods of this length.
fn robot(rods: &str) -> Robot {
    let text = std::fs::read_to_string(files::robots().join("fivebar.yaml")).unwrap();
    let text = text.replace("l2: 0.40", rods);
    assert!(text.contains(rods));
    derive(&Source::new("fivebar.yaml", &text)).unwrap()
}

/// Writes the robot's files, its constants and the blocks of the pages, which begin with the names of
/// their files; returns these names.
fn write_files(folder: &Path) -> Vec<String> {
    let own = c::files(&robot("l2: 0.40"));
    let constants = c_constants(model(), &identified(), &own.name).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("fivebar.h", &own.header);
    write("fivebar.c", &own.source);
    write("fivebar_identified.h", &constants);
    let mut names = Vec::new();
    for page in ["c", "ros2", "simulink", "plc"] {
        let path = files::package().join(format!("../runtime/guide/pages/{page}.md"));
        let page = std::fs::read_to_string(path).unwrap();
        for part in page.split("\n```").skip(1).step_by(2) {
            let (language, code) = part.split_once('\n').unwrap();
            if !matches!(language, "c" | "cpp") {
                continue;
            }
            let first = code.lines().next().unwrap();
            let name = first.trim_matches(['/', '*', ' ']).to_owned();
            write(&name, code);
            names.push(name);
        }
    }
    names
}

fn compile(folder: &Path, compiler: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(compiler);
    command.args(WARNINGS).args(arguments).current_dir(folder);
    let stubs = files::fixtures().join("stubs").canonicalize().unwrap();
    // without warnings from the headers of other products
    command.arg("-isystem").arg(stubs).output().unwrap()
}

#[track_caller]
fn assert_success(output: &Output) {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
}

fn is_installed(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        eprintln!("left out: there is no {program}");
    }
    found
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn the_guide_s_controllers_compile_and_close_the_loops() {
    if !is_installed("gcc") {
        return;
    }
    let folder = folder("c-guide");
    let names = write_files(&folder);
    assert_eq!(names.len(), 6, "{names:?}");
    for name in &names {
        let ends = std::path::Path::new(name).extension();
        if ends.is_some_and(|end| end == "c") {
            assert_success(&compile(
                &folder,
                "gcc",
                &["-std=c99", "-fsyntax-only", name],
            ));
        } else if ends.is_some_and(|end| end == "cpp") && is_installed("g++") {
            assert_success(&compile(
                &folder,
                "g++",
                &["-std=c++17", "-fsyntax-only", name],
            ));
        }
    }
    let main = "#include <stdio.h>\n#include <math.h>\n#include \"fivebar.h\"\nint main(void)\n{\n\
        double q[FIVEBAR_COORDINATE_COUNT], far[2] = { 2, NAN }, q_i[2];\nint status = 0;\n\
        for (int k = 0; k < FIVEBAR_COORDINATE_COUNT; k++) q[k] = fivebar_home[k];\n\
        for (int k = 0; k < 2; k++) q_i[k] = q[fivebar_independent[k]];\n\
        for (int n = 0; n < 50; n++) { q_i[0] += 0.004; q_i[1] -= 0.003; status |= fivebar_close(q_i, q); }\n\
        printf(\"%d %d\", status, fivebar_close(far, q));\n\
        for (int k = 0; k < FIVEBAR_COORDINATE_COUNT; k++) printf(\" %.17g\", q[k]);\nreturn 0;\n}\n";
    std::fs::write(folder.join("main.c"), main).unwrap();
    let arguments = [
        "-std=c99",
        "-O0",
        "-o",
        "close",
        "main.c",
        "fivebar.c",
        "-lm",
    ];
    assert_success(&compile(&folder, "gcc", &arguments));
    let output = Command::new(folder.join("close")).output().unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    let mut numbers = printed.split(' ').map(|x| x.parse::<f64>().unwrap());
    assert_eq!((numbers.next(), numbers.next()), (Some(0.0), Some(-1.0)));
    let home = fivebar::HOME;
    let [a, b] = fivebar::INDEPENDENT;
    let mut closure = LoopClosure::new(model()).unwrap();
    let known = closure.solve(&[home[a] + 0.2, home[b] - 0.15]).unwrap();
    assert!(known.outcome.is_closed());
    for (found, known) in numbers.zip(known.q) {
        assert!((found - known).abs() < 1e-13, "{found} {known}");
    }
}

const STATES: i32 = 9;

/// For states up to 1.2 rad from home, whether C closes the loops there in one call from home, and all coordinates
/// after it.
fn closed_in_c(folder: &Path, robot: &Robot) -> Vec<(bool, Vec<f64>)> {
    let own = c::files(robot);
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("fivebar.h", &own.header);
    write("fivebar.c", &own.source);
    let main = format!(
        "#include <stdio.h>\n#include <math.h>\n#include \"fivebar.h\"\nint main(void)\n{{\n\
         for (int i = 0; i < {STATES}; i++) for (int j = 0; j < {STATES}; j++) {{\n\
         double q[FIVEBAR_COORDINATE_COUNT], q_i[2];\n\
         for (int k = 0; k < FIVEBAR_COORDINATE_COUNT; k++) q[k] = fivebar_home[k];\n\
         q_i[0] = q[fivebar_independent[0]] + 0.3 * (i - 4); q_i[1] = q[fivebar_independent[1]] + 0.3 * (j - 4);\n\
         printf(\"%d\", fivebar_close(q_i, q));\n\
         for (int k = 0; k < FIVEBAR_COORDINATE_COUNT; k++) printf(\" %.17g\", q[k]);\nprintf(\"\\n\"); }}\n\
         float q_f[FIVEBAR_COORDINATE_COUNT], q_i_f[2];\n\
         for (int k = 0; k < FIVEBAR_COORDINATE_COUNT; k++) q_f[k] = (float)fivebar_home[k];\n\
         q_i_f[0] = NAN; q_i_f[1] = q_f[fivebar_independent[1]];\n\
         printf(\"%d %d\\n\", fivebar_close_f(q_i_f, q_f), q_f[0] == (float)fivebar_home[0]);\nreturn 0;\n}}\n"
    );
    write("main.c", &main);
    let arguments = ["-std=c99", "-O1", "-o", "far", "main.c", "fivebar.c", "-lm"];
    assert_success(&compile(folder, "gcc", &arguments));
    let output = Command::new(folder.join("far")).output().unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    let mut lines: Vec<&str> = printed.lines().collect();
    // what is not finite is refused, and changes nothing
    assert_eq!(lines.pop(), Some("-1 1"));
    assert_eq!(lines.len(), usize::try_from(STATES * STATES).unwrap());
    let numbers = |line: &&str| -> (bool, Vec<f64>) {
        let mut numbers = line.split(' ').map(|x| x.parse::<f64>().unwrap());
        (numbers.next() == Some(0.0), numbers.collect())
    };
    lines.iter().map(numbers).collect()
}

#[test]
fn c_closes_the_loops_far_from_home_where_the_runtime_does_and_to_the_same_coordinates() {
    if !is_installed("gcc") {
        return;
    }
    let found = closed_in_c(&folder("c-far"), &robot("l2: 0.40"));
    let home = fivebar::HOME;
    let [a, b] = fivebar::INDEPENDENT;
    let mut closure = LoopClosure::new(model()).unwrap();
    for (k, (is_closed, q)) in (0..).zip(found) {
        let (i, j) = (f64::from(k / STATES - 4), f64::from(k % STATES - 4));
        let known = closure
            .solve(&[home[a] + 0.3 * i, home[b] + 0.3 * j])
            .unwrap();
        assert_eq!(
            is_closed,
            known.outcome.is_closed(),
            "{i} {j} {:?}",
            known.outcome
        );
        for (found, known) in q.iter().zip(known.q) {
            assert!((found - known).abs() < 1e-9, "{i} {j} {found} {known}");
        }
    }
}

/// Rods that are too short for the cranks where these point away from each other.
#[test]
fn c_refuses_lines_to_states_that_no_rods_reach_and_leaves_the_coordinates() {
    if !is_installed("gcc") {
        return;
    }
    let short = robot("l2: 0.34");
    let at = |name: &str| short.coordinates.iter().position(|c| c == name).unwrap();
    let home = [short.home[at("q1")], short.home[at("q3")]];
    // the distance between the ends of the cranks
    let width = |[a, b]: [f64; 2]| {
        let (x, y) = (0.2 + 0.3 * (b.cos() - a.cos()), 0.3 * (b.sin() - a.sin()));
        x.hypot(y)
    };
    let (mut refused, mut reached) = (0, 0);
    for (k, (is_closed, q)) in (0..).zip(closed_in_c(&folder("c-short"), &short)) {
        let far = [
            0.3 * f64::from(k / STATES - 4),
            0.3 * f64::from(k % STATES - 4),
        ];
        let on_line = |part: f64| width([home[0] + part * far[0], home[1] + part * far[1]]);
        let widest = (0..=100).map(|k| on_line(f64::from(k) / 100.0));
        let widest = widest.fold(0.0, f64::max);
        if widest > 0.68 {
            assert!(!is_closed, "{far:?}");
            refused += 1;
            assert_eq!(q, short.home);
        } else if widest < 0.67 {
            assert!(is_closed, "{far:?}");
            reached += 1;
        }
    }
    assert!(refused > 8 && reached > 8, "{refused} {reached}");
}

#[test]
fn constants_of_another_model_are_refused() {
    let right = digest(model());
    let wrong = "0123456789abcdef";
    if is_installed("gcc") {
        let folder = folder("c-refused");
        write_files(&folder);
        let path = folder.join("fivebar_identified.h");
        let header = std::fs::read_to_string(&path).unwrap();
        for part in [
            "Method: least squares.",
            "Date: 2026-11-23.",
            "Logs: run1, run * / 2",
        ] {
            assert!(header.contains(part), "{part}\n{header}");
        }
        std::fs::write(&path, header.replace(&right, wrong)).unwrap();
        let output = compile(&folder, "gcc", &["-std=c99", "-fsyntax-only", "torque.c"]);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(
            !output.status.success() && errors.contains("identify again"),
            "{errors}"
        );
    }
    let rust = rust_constants(model(), &identified(), Some("super::fivebar")).unwrap();
    assert!(
        rust.contains(&format!("super::fivebar::DIGEST == 0x{right}")),
        "{rust}"
    );
    assert!(
        rust.contains("// Logs: run1, run */ 2 .\n// Date: 2026-11-23.\n"),
        "{rust}"
    );
    if is_installed("python3") {
        let python = python_constants(model(), &identified()).unwrap();
        let number = u64::from_str_radix(&right, 16).unwrap();
        let script = format!(
            "{python}\ncheck(DIGEST); check({number}); check('0x{right}')\n\
             assert LOGS == ['run1', 'run */ 2\\n'] and DATE == '2026-11-23'\n\
             assert list(BETA.values())[1] == 1.1 and METHOD == 'least squares'\n\
             try:\n    check('{wrong}')\nexcept ValueError as error:\n    print(error)\n"
        );
        let output = Command::new("python3")
            .args(["-c", &script])
            .output()
            .unwrap();
        assert_success(&output);
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(printed.contains("identify again"), "{printed}");
    }
}

/// Compares the Jacobians of a robot's functions for `casadi.external` with central differences, and
/// what is solved with what solves it; prints the number of compared entries.
const JACOBIANS: &str = r#"#include <math.h>
#include <stdio.h>
#include "fivebar.h"
#define INT long long int
typedef int function(const double **, double **, INT *, double *, int);
typedef const INT *sparsity(INT);
typedef int work(INT *, INT *, INT *, INT *);
#define EACH(X) X(inverse_dynamics) X(forward_dynamics) X(close) X(frame_pose)
#define DECLARE(n) function fivebar_casadi_##n, jac_fivebar_casadi_##n; \
    sparsity fivebar_casadi_##n##_sparsity_in, jac_fivebar_casadi_##n##_sparsity_out; \
    work fivebar_casadi_##n##_work, jac_fivebar_casadi_##n##_work;
EACH(DECLARE)
static int compared;
static int differs(function *f, function *jac, sparsity *in, sparsity *out, work *sizes)
{
    static double values[4][FIVEBAR_PARAMETER_COUNT], memory[4000], blocks[4][12 * FIVEBAR_PARAMETER_COUNT], sides[2][12];
    const double *arg[5] = { values[0], values[1], values[2], values[3], 0 };
    double *res[4] = { blocks[0], blocks[1], blocks[2], blocks[3] };
    INT count, results, words, numbers;
    for (int k = 0; k < FIVEBAR_PARAMETER_COUNT; k++) values[3][k] = fivebar_nominal[k];
    values[0][0] = 2.1; values[0][1] = 1.0; values[1][0] = 0.7; values[1][1] = -0.4;
    values[2][0] = 0.3; values[2][1] = 1.1;
    sizes(&count, &results, &words, &numbers);
    if (results > 4 || words != 0 || numbers > 4000 || jac(arg, res, 0, memory, 0) != 0) return 1;
    for (INT k = 0; k < results; k++) {
        const INT rows = out(k)[0], columns = out(k)[1];
        if (in(k)[0] != columns || in(k)[1] != 1 || in(k)[2] != 1 || out(k)[2] != 1) return 2;
        for (INT c = 0; c < columns; c++) {
            const double at = values[k][c];
            for (int side = 0; side < 2; side++) {
                double *into[1] = { sides[side] };
                values[k][c] = side ? at - 1e-6 : at + 1e-6;
                if (f(arg, into, 0, memory, 0) != 0) return 3;
            }
            values[k][c] = at;
            for (INT r = 0; r < rows; r++) {
                const double own = blocks[k][rows * c + r], slope = (sides[0][r] - sides[1][r]) / 2e-6;
                /* rounding of values of order 10 over the step */
                if (!(fabs(own - slope) < 1e-7 * (20 + fabs(own)))) return 4;
                compared++;
            }
        }
    }
    /* null pointers: zeros, and results that nobody wants */
    arg[1] = arg[2] = 0;
    double *none[4] = { 0, 0, 0, 0 };
    return f(arg, none, 0, memory, 0) != 0 || jac(arg, none, 0, memory, 0) != 0 ? 5 : 0;
}
int main(void)
{
#define COMPARE(n) { const int wrong = differs(fivebar_casadi_##n, jac_fivebar_casadi_##n, \
    fivebar_casadi_##n##_sparsity_in, jac_fivebar_casadi_##n##_sparsity_out, jac_fivebar_casadi_##n##_work); \
    if (wrong) { printf("%s %d\n", #n, wrong); return 1; } }
    EACH(COMPARE)
    double memory[4000], tau[2], qdd[2], far[2] = { 3.1415, 0 }, q[2] = { 2.1, 1.0 }, qd[2] = { 0.7, -0.4 }, a[2] = { 3, -2 };
    const double *arg[4] = { q, qd, a, fivebar_nominal };
    double *res[1] = { tau };
    int wrong = fivebar_casadi_inverse_dynamics(arg, res, 0, memory, 0);
    arg[2] = tau; res[0] = qdd;
    wrong |= fivebar_casadi_forward_dynamics(arg, res, 0, memory, 0);
    wrong |= !(fabs(qdd[0] - 3) + fabs(qdd[1] + 2) < 1e-9);
    arg[0] = far; /* cranks that point away from each other */
    wrong |= fivebar_casadi_forward_dynamics(arg, res, 0, memory, 0) == 0;
    far[0] = NAN;
    wrong |= jac_fivebar_casadi_close(arg, res, 0, memory, 0) == 0;
    printf("%d", compared);
    return wrong;
}
"#;

#[test]
fn functions_for_casadi_have_the_jacobians_of_their_differences() {
    if !is_installed("gcc") {
        return;
    }
    // rods with which the cranks cannot point away from each other
    let robot = robot("l2: 0.34");
    let (folder, own) = (folder("c-casadi"), c::files(&robot));
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("fivebar.h", &own.header);
    write("fivebar.c", &own.source);
    write("fivebar_casadi.c", &c::casadi(&robot));
    write("main.c", JACOBIANS);
    let sources = ["main.c", "fivebar.c", "fivebar_casadi.c", "-lm"];
    let arguments = ["-std=c99", "-O1", "-o", "jacobians"];
    assert_success(&compile(
        &folder,
        "gcc",
        &[&arguments[..], &sources].concat(),
    ));
    let output = Command::new(folder.join("jacobians")).output().unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{printed}");
    let parameters = robot.parameters.len();
    // rows by columns of each: two of dynamics, four coordinates, one frame
    let entries = 2 * 2 * (6 + parameters) + 4 * 2 + 12 * 2;
    assert_eq!(printed, entries.to_string());
    if is_installed("g++") {
        let arguments = ["-std=c++17", "-fsyntax-only", "-x", "c++"];
        assert_success(&compile(
            &folder,
            "g++",
            &[&arguments[..], &["fivebar_casadi.c"]].concat(),
        ));
    }
}
