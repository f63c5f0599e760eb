//! Generated code must not be able to panic, so neither may the runtime functions it calls: their
//! optimised code must not call a panic.

#![allow(clippy::unwrap_used, clippy::expect_used)]
#![cfg(feature = "std")]

use std::path::Path;
use std::process::Command;

/// The source of a user's crate with two sizes of the pivoted solve.
const USER: &str = "
#[inline(never)]
pub fn solve_2(a: &[[f64; 2]; 3], b: &[[f64; 1]; 3]) -> ([[f64; 1]; 2], f64) {
    regen_runtime::solve_pivoted(a, b)
}
#[inline(never)]
pub fn solve_9(a: &[[f64; 9]; 12], b: &[[f32; 9]; 12]) -> ([[f32; 4]; 9], f32) {
    let mut narrow = [[0.0; 9]; 12];
    for (to, from) in narrow.iter_mut().flatten().zip(a.iter().flatten()) {
        *to = *from as f32;
    }
    let mut side = [[0.0; 4]; 12];
    for (to, from) in side.iter_mut().flatten().zip(b.iter().flatten()) {
        *to = *from;
    }
    regen_runtime::solve_pivoted(&narrow, &side)
}
";

/// The source of a crate that checks its slices as a generated `impl Model` does.
const SHAPES: &str = "
use regen_runtime::{SizeError, array, array_mut, matrix_mut};
#[inline(never)]
pub fn shapes(q: &[f64], out: &mut [f64], w: &mut [f64]) -> Result<(), SizeError> {
    let [a, b] = array(q, \"q\")?;
    *array_mut(out, \"out\")? = [*a, *b, *a];
    let columns: &mut [[f64; 3]; 7] = matrix_mut(w, \"w\")?;
    columns[6] = [*b; 3];
    Ok(())
}
";

/// A replacement of the crate `libm` that cannot panic.
const LIBM: &str = "
#![no_std]
macro_rules! same { ($($name:ident)*) => { $(pub fn $name(x: f64) -> f64 { x })* } }
same! { exp atan log tanh }
pub fn pow(x: f64, y: f64) -> f64 { x * y }
pub fn sincos(x: f64) -> (f64, f64) { (x, x) }
pub fn sincosf(x: f32) -> (f32, f32) { (x, x) }
";

/// The source of a crate that can panic, to check that the search finds panics.
const CONTROL: &str = "
#[inline(never)]
pub fn entry(a: &[f64], i: usize) -> f64 {
    a[i]
}
";

fn run(command: &mut Command) {
    let output = command.output().expect("rustc runs");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// The optimised assembly of a crate that uses the runtime.
fn assembly(name: &str, source: &str) -> String {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let runtime = folder.join(format!("libruntime_{name}.rlib"));
    let common = ["--edition=2024", "-Copt-level=3", "-Ccodegen-units=1"];
    // none of the examined functions calls `libm`, so that a replacement suffices
    let libm = folder.join(format!("liblibm_{name}.rlib"));
    let source_of_libm = folder.join(format!("libm_{name}.rs"));
    std::fs::write(&source_of_libm, LIBM).unwrap();
    run(Command::new(&rustc)
        .args(common)
        .args(["--crate-name=libm", "--crate-type=rlib"])
        .arg("-o")
        .arg(&libm)
        .arg(&source_of_libm));
    run(Command::new(&rustc)
        .args(common)
        .args(["--crate-name=regen_runtime", "--crate-type=rlib"])
        .args(["--cfg", "feature=\"closure\"", "--cfg", "feature=\"std\""])
        .arg("--extern")
        .arg(format!("libm={}", libm.display()))
        .arg("-o")
        .arg(&runtime)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")));

    let user = folder.join(format!("{name}.rs"));
    let out = folder.join(format!("{name}.s"));
    std::fs::write(&user, source).unwrap();
    run(Command::new(&rustc)
        .args(common)
        .args(["--crate-type=rlib", "--emit=asm"])
        .arg("--extern")
        .arg(format!("regen_runtime={}", runtime.display()))
        .arg("-L")
        .arg(folder)
        .arg("-o")
        .arg(&out)
        .arg(&user));
    std::fs::read_to_string(&out).unwrap()
}

/// The lines of the assembly that name a panic, or one of the failures that lead to a panic.
fn panics(assembly: &str) -> Vec<&str> {
    assembly
        .lines()
        .filter(|line| ["panic", "_fail"].iter().any(|word| line.contains(word)))
        .collect()
}

#[test]
fn the_solve_cannot_panic() {
    let solve = assembly("solve", USER);
    assert!(
        solve.contains("solve_pivoted"),
        "the solve is compiled here"
    );
    assert_eq!(panics(&solve), Vec::<&str>::new());
}

#[test]
fn the_checks_of_lengths_cannot_panic() {
    let shapes = assembly("shapes", SHAPES);
    assert_eq!(panics(&shapes), Vec::<&str>::new());
}

#[test]
fn an_unchecked_index_is_detected_as_a_panic() {
    assert!(!panics(&assembly("control", CONTROL)).is_empty());
}
