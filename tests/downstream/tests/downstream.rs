//! Crates outside this workspace that use `robot_model!`, built as their owners would.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use regen_downstream::target_folder;

fn root() -> PathBuf {
    regen_downstream::root().canonicalize().unwrap()
}

/// A robot's file, the name of its module, and the path of its model.
struct Robot {
    file: String,
    module: String,
    model: String,
}

/// Whether every robot is built (`.ci/full`), or only those whose source is checked in.
fn full() -> bool {
    std::env::var_os("REGEN_FULL").is_some()
}

/// Every spec of `robots/` that is built, see [`full`].
fn robots() -> Vec<Robot> {
    let mut robots = Vec::new();
    let sources = fs::read_to_string(root().join("generated/sources.txt")).unwrap();
    for entry in fs::read_dir(root().join("robots")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "yaml") {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        let name = text
            .lines()
            .find_map(|line| line.strip_prefix("name:"))
            .unwrap();
        let module = name.split('#').next().unwrap().trim().to_owned();
        if !full() && !sources.lines().any(|line| line == module) {
            continue;
        }
        robots.push(Robot {
            file: path.file_name().unwrap().to_str().unwrap().to_owned(),
            model: format!("{module}::{}", camel_case(&module)),
            module,
        });
    }
    robots.sort_by(|a, b| a.file.cmp(&b.file));
    assert!(
        robots.len() >= 5,
        "3-RPS, PUMA560, five-bar, four-bar and a tree"
    );
    robots
}

fn camel_case(name: &str) -> String {
    let word = |word: &str| -> String {
        let mut letters = word.chars();
        let first = letters.next().into_iter().flat_map(char::to_uppercase);
        first.chain(letters).collect()
    };
    name.split('_').map(word).collect()
}

/// Writes a crate in the target directory: its own workspace, the dependency versions of this one,
/// the specs in its `robots/`.
fn outside_crate(name: &str, manifest: &str, source_file: &str, source: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(dir.join("src")).unwrap();
    fs::create_dir_all(dir.join("robots")).unwrap();
    for robot in robots() {
        let spec = root().join("robots").join(&robot.file);
        let copy = dir.join("robots").join(&robot.file);
        fs::copy(&spec, &copy).unwrap();
        // Base parameters that take too long for a macro are stored beside the spec.
        if spec.with_extension("base").exists() {
            fs::copy(spec.with_extension("base"), copy.with_extension("base")).unwrap();
        }
    }
    let runtime = root()
        .join("runtime")
        .display()
        .to_string()
        .replace('\\', "/");
    let manifest = format!(
        "[package]\nname = \"{name}\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\n[workspace]\n\n\
         {}",
        manifest.replace("RUNTIME", &runtime)
    );
    fs::write(dir.join("Cargo.toml"), manifest).unwrap();
    fs::copy(root().join("Cargo.lock"), dir.join("Cargo.lock")).unwrap();
    fs::write(dir.join("src").join(source_file), source).unwrap();
    dir
}

/// Runs cargo in a crate.
fn run_cargo(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO"))
        .args(args)
        .current_dir(dir)
        .env(
            "CARGO_TARGET_DIR",
            target_folder(env!("CARGO_TARGET_TMPDIR")),
        )
        .env("CARGO_INCREMENTAL", "0") // as `trybuild` sets it: the same crates are not built again
        .env_remove("RUSTFLAGS")
        .output()
        .unwrap()
}

/// Runs cargo in a crate and returns its standard output.
#[track_caller]
fn cargo(dir: &Path, args: &[&str]) -> String {
    let output = run_cargo(dir, args);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {args:?}:\n{errors}");
    assert!(!errors.contains("warning: "), "cargo {args:?}:\n{errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Runs cargo in a crate that does not compile, and returns its errors.
#[track_caller]
fn cargo_fails(dir: &Path, args: &[&str]) -> String {
    let output = run_cargo(dir, args);
    assert!(!output.status.success(), "cargo {args:?} succeeds");
    String::from_utf8(output.stderr).unwrap()
}

/// A program that evaluates every method of every robot at home and prints residuals.
fn program(runtime: &str) -> String {
    let mut source = String::new();
    for robot in robots() {
        writeln!(source, "{runtime}::robot_model!({:?});", robot.file).unwrap();
    }
    write!(
        source,
        r#"
fn evaluate(model: &dyn {runtime}::Model<f64>) -> Result<f64, {runtime}::SizeError> {{
    let info = model.info();
    let (n, dof, ne) = (info.coordinates.len(), info.dof(), info.dependent.len());
    let (p, q) = (info.parameters.len(), info.home);
    let (rate, still, phi) = (vec![0.1; n], vec![0.0; dof], vec![1.0; p]);
    let mut out = vec![0.0; info.rows];
    model.constraints(q, &mut out)?;
    let residual = out.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    model.bias(q, &rate, &mut out)?;
    model.jacobian(q, &mut vec![0.0; info.rows * n])?;
    let _ = model.newton_step(q, &mut vec![0.0; ne])?;
    model.dependent_jacobian(q, &mut vec![0.0; ne * ne])?;
    let _ = model.velocities(q, &still, &mut vec![0.0; n])?;
    let _ = model.accelerations(q, &rate, &still, &mut vec![0.0; n])?;
    let _ = model.adaptive_regressor(q, &rate, &still, &still, &mut vec![0.0; dof * p])?;
    let _ = model.mass_matrix(q, &phi, &mut vec![0.0; dof * dof])?;
    let _ = model.gravity(q, &phi, &mut vec![0.0; dof])?;
    let _ = model.bias_forces(q, &rate, &phi, &mut vec![0.0; dof])?;
    let _ = model.generalized_forces(q, &vec![1.0; info.actuated.len()], &mut vec![0.0; dof])?;
    model.poses(q, &mut vec![0.0; 12 * info.bodies.len()])?;
    let mut tau = vec![0.0; dof];
    let _ = model.inverse_dynamics(q, &rate, &rate, &phi, &mut tau)?;
    let mut w = vec![0.0; dof * p];
    let _ = model.regressor(q, &rate, &rate, &mut w)?;
    for (row, tau) in tau.iter().enumerate() {{
        let sum: f64 = w.iter().skip(row).step_by(dof).sum();
        assert!((sum - tau).abs() <= 1e-9 * (1.0 + tau.abs()), "{{}}: W phi = tau", info.name);
    }}
    Ok(residual)
}}

fn main() {{
"#
    )
    .unwrap();
    for Robot { module, model, .. } in robots() {
        writeln!(
            source,
            "    println!(\"{module} {{:e}}\", evaluate(&{model}).unwrap());"
        )
        .unwrap();
    }
    source + "}\n"
}

/// The compiler's writer of debug information can crash on long functions: this would happen in
/// cargo's default profile, and in release with full debug information.
#[test]
fn every_robot_runs_in_a_crate_that_renames_the_runtime_with_debug_information() {
    let dir = outside_crate(
        "renamed",
        "[dependencies]\nrobots = { package = \"regen-runtime\", path = \"RUNTIME\", \
         features = [\"macros\"] }\n\n[profile.release]\ndebug = 2\n",
        "main.rs",
        &program("robots"),
    );
    let optimised = &["run", "--release"][..];
    let builds = if full() {
        &[&["run"], optimised][..]
    } else {
        &[&["run"][..]]
    };
    for args in builds {
        let out = cargo(&dir, args);
        let lines: Vec<&str> = out.lines().collect();
        assert_eq!(lines.len(), robots().len(), "{out}");
        for line in lines {
            let residual: f64 = line.split(' ').nth(1).unwrap().parse().unwrap();
            assert!(residual < 1e-12, "home is closed: {line}");
        }
    }
}

#[test]
fn a_crate_without_the_standard_library_can_use_every_robot() {
    let mut source =
        "//! A controller's robots.\n#![no_std]\n#![deny(missing_docs)]\n\n".to_owned();
    for robot in robots() {
        writeln!(source, "regen_runtime::robot_model!({:?});", robot.file).unwrap();
    }
    source.push_str("\n/// All of them.\npub fn all() -> [&'static dyn regen_runtime::Model<f64>; COUNT] {\n    [");
    for Robot { model, .. } in robots() {
        write!(source, "&{model}, ").unwrap();
    }
    source.push_str("]\n}\n");
    let source = source.replace("COUNT", &robots().len().to_string());
    let dir = outside_crate(
        "bare",
        "[dependencies]\nregen-runtime = { path = \"RUNTIME\", default-features = false, \
         features = [\"macros\"] }\n",
        "lib.rs",
        &source,
    );
    cargo(&dir, &["build"]);
    // The crates that the controller links, without macros and their dependencies.
    let linked = cargo(
        &dir,
        &[
            "tree",
            "--edges",
            "no-proc-macro,normal",
            "--prefix",
            "none",
            "--format",
            "{p}|{f}",
        ],
    );
    assert!(linked.lines().any(|l| l.starts_with("libm ")), "{linked}");
    assert!(!linked.contains("std"), "{linked}");
}

#[test]
fn the_readme_s_example_runs() {
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let (_, rest) = readme.split_once("```rust\n").unwrap();
    let (example, _) = rest.split_once("```").unwrap();
    let dir = outside_crate(
        "readme",
        "[dependencies]\nregen-robotics = { path = \"RUNTIME/robotics\", features = [\"control\"] }\n",
        "main.rs",
        example,
    );
    let out = cargo(&dir, &["run"]);
    assert_eq!(out.matches(',').count(), 2, "three leg forces: {out}");
}

/// What each feature of the facade adds: a type that a program without it cannot name.
const FACADE: [(&str, &str); 6] = [
    ("control", "control::closure!(rps3::Rps3, f32)"),
    ("batch", "batch::TrackedStates"),
    ("calibrate", "calibrate::Pose"),
    ("identify", "identify::estimate::QrFactor"),
    ("formats", "identify::data::Settings"),
    ("experiment", "experiment::excite::ExciteError"),
];

#[test]
fn the_facade_is_the_only_dependency_that_a_program_needs() {
    let facade = |features: &str, uses: &str| {
        let source = format!(
            "regen_robotics::robot_model!(\"3rps.yaml\");\n\nfn main() {{\n    \
             let info = regen_robotics::runtime::Model::<f64>::info(&rps3::Rps3);\n    \
             println!(\"{{}} {{}}\", info.name, {uses});\n}}\n"
        );
        let manifest = format!(
            "[dependencies]\nregen-robotics = {{ path = \"RUNTIME/robotics\", \
             features = [{features}] }}\n"
        );
        outside_crate("facade", &manifest, "main.rs", &source)
    };
    let out = cargo(&facade("", "info.dof()"), &["run"]);
    assert_eq!(out, "rps3 3\n");

    // solvers take minutes to build
    let chosen = if full() { &FACADE[..] } else { &FACADE[..2] };
    for (feature, named) in chosen {
        let uses = format!("core::mem::size_of::<regen_robotics::{named}>()");
        cargo(&facade(&format!("{feature:?}"), &uses), &["check"]);
        let errors = cargo_fails(&facade("", &uses), &["check"]);
        assert!(
            errors.contains("in `regen_robotics`"),
            "{feature}: {errors}"
        );
    }
}

#[test]
fn the_facade_works_without_the_standard_library_and_under_another_name() {
    let dir = outside_crate(
        "bare_facade",
        "[dependencies]\nrobots = { package = \"regen-robotics\", path = \"RUNTIME/robotics\", \
         default-features = false, features = [\"control\", \"macros\"] }\n",
        "lib.rs",
        "//! A controller.\n#![no_std]\n#![deny(missing_docs)]\n\n\
         robots::robot_model!(\"3rps.yaml\");\n\n\
         /// Its loops.\npub type Legs = robots::control::closure!(rps3::Rps3, f64);\n",
    );
    cargo(&dir, &["build"]);
    let edges = [
        "tree",
        "--edges",
        "no-proc-macro,normal",
        "--prefix",
        "none",
    ];
    let linked = cargo(&dir, &[&edges[..], &["--format", "{p}|{f}"]].concat());
    let of_runtime = linked.lines().find(|l| l.starts_with("regen-runtime "));
    assert!(
        of_runtime.is_some_and(|l| l.ends_with("|macros")),
        "{linked}"
    );
    assert!(!linked.contains("nalgebra"), "{linked}");
}

#[test]
fn an_edit_of_the_spec_rebuilds_the_crate() {
    let spec = |parameter: &str| {
        format!(
            "name: arm\nlimbs:\n  - name: arm\n    joints:\n      - {{name: q1, type: revolute, \
             body: {parameter}, actuated: true}}\n"
        )
    };
    let dir = outside_crate(
        "edited",
        "[dependencies]\nregen-runtime = { path = \"RUNTIME\", features = [\"macros\"] }\n",
        "main.rs",
        "regen_runtime::robot_model!(\"arm.yaml\");\n\nfn main() {\n    \
         println!(\"{}\", arm::PARAMETERS[0]);\n}\n",
    );
    for body in ["1", "link"] {
        fs::write(dir.join("robots/arm.yaml"), spec(body)).unwrap();
        assert_eq!(cargo(&dir, &["run"]), format!("Ixx({body})\n"));
    }
}
