//! Writes a crate with the modules of random mechanisms, which compares each compiled model with
//! the second derivation and with the interpreter:
//!
//! ```sh
//! cargo run --release -p regen-tests --features examples --example compile_random -- --from 0 --count 200 --into DIR
//! cargo run --manifest-path DIR/Cargo.toml
//! ```

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use regen_codegen::emit::{Options, module};
use regen_tests::derived::Derived;
use regen_tests::{files, random};

fn main() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().collect();
    let given = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1)
    };
    let number = |name: &str, default: u64| {
        given(name)
            .and_then(|a| a.parse::<u64>().ok())
            .unwrap_or(default)
    };
    let (from, count) = (number("--from", 0), number("--count", 8));
    let into = PathBuf::from(given("--into").ok_or("--into DIR is needed")?);
    let mut modules = String::new();
    let mut models = String::new();
    for seed in from..from + count {
        let sample = random::sample(seed).sample.ok_or("a seed without a spec")?;
        let derived = Derived::without_base("random.yaml", &sample.text)?;
        write(
            &into.join(format!("src/r{seed}.rs")),
            &module(&derived.robot, &Options::default()),
        )?;
        let _ = writeln!(modules, "mod r{seed};");
        let _ = writeln!(models, "        ({seed}, Box::new(r{seed}::R{seed})),");
    }
    let root = files::package().join("..");
    let root = root.canonicalize().map_err(|e| e.to_string())?;
    let manifest = format!(
        "[package]\nname = \"compiled_random\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\n\
         [workspace]\n\n[dependencies]\nregen-runtime = {{ path = \"{0}/runtime\" }}\n\
         regen-tests = {{ path = \"{0}/tests\" }}\n\n[profile.dev]\ndebug = false\n",
        root.display()
    );
    write(&into.join("Cargo.toml"), &manifest)?;
    let lock = std::fs::read_to_string(root.join("Cargo.lock")).map_err(|e| e.to_string())?;
    write(&into.join("Cargo.lock"), &lock)?;
    let program = PROGRAM
        .replace("MODULES", &modules)
        .replace("MODELS", &models);
    write(&into.join("src/main.rs"), &program)
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    let folder = path.parent().ok_or("no folder")?;
    std::fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}

/// The generated program: it compares each model with the second derivation at two states, and with
/// the interpreter's numbers.
const PROGRAM: &str = r#"//! Compiled random mechanisms, compared.
use regen_runtime::Model;
use regen_tests::compiled::Compiled;
use regen_tests::derived::Derived;
use regen_codegen::signature::FunctionKind;
use regen_tests::engine::{Engine, check_engine, row_error};
use regen_tests::random;

MODULES
fn compare(seed: u64, model: &dyn Model<f64>) -> Result<f64, String> {
    let sample = random::sample(seed).sample.ok_or("no spec")?;
    let compiled = Compiled(model);
    check_engine(&compiled, &sample.mechanism, seed, 2)?;
    let derived = Derived::without_base("random.yaml", &sample.text)?;
    let mut worst = 0.0_f64;
    for state in sample.mechanism.random_states(seed, 2)? {
        let ours = compiled.matrix(FunctionKind::Regressor, &[&state.q, &state.qd, &state.qdd])?;
        let theirs = derived.matrix(FunctionKind::Regressor, &[&state.q, &state.qd, &state.qdd])?;
        worst = worst.max(row_error(&ours, &theirs));
    }
    if worst <= 1e-10 { Ok(worst) } else { Err(format!("interpreter: {worst:e}")) }
}

fn main() {
    let models: Vec<(u64, Box<dyn Model<f64>>)> = vec![
MODELS
    ];
    let mut worst = 0.0_f64;
    let mut failures = 0;
    let count = models.len();
    for (seed, model) in models {
        match compare(seed, model.as_ref()) {
            Ok(error) => worst = worst.max(error),
            Err(error) => {
                failures += 1;
                println!("seed {seed}: {error}");
            }
        }
    }
    println!("{count} compiled, {failures} failed, at most {worst:e} from the interpreter");
    assert!(failures == 0);
}
"#;
