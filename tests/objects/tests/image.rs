//! The machine code of a robot's functions, read from object files: they cannot panic, never
//! recurse, and need no more stack than stated.
//!
//! With `REGEN_IMAGE_PROFILE=dev` the code of another profile is read; see `RECORD.md`.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![cfg(all(target_arch = "x86_64", target_os = "linux"))]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::LazyLock;

use regen_objects::{Graph, cargo, cycle, deepest, features, fixture, full, image, root};

/// The functions to which a compiler may turn copies and comparisons; every target has them.
const MEMORY: [&str; 5] = ["memcpy", "memmove", "memset", "memcmp", "bcmp"];

/// The functions that `Vec` calls, with the two that end a program without memory, and the one that
/// frees vectors if a user's own model unwinds, which `panic = "abort"` leaves out.
const ALLOCATOR: [&str; 8] = [
    "_Unwind_Resume",
    "__rustc::__rust_alloc",
    "__rustc::__rust_alloc_zeroed",
    "__rustc::__rust_dealloc",
    "__rustc::__rust_realloc",
    "__rustc::__rust_no_alloc_shim_is_unstable_v2",
    "alloc::raw_vec::handle_error",
    "alloc::alloc::handle_alloc_error",
];

/// The robots and the closure, in release.
static IMAGE: LazyLock<Graph> = LazyLock::new(|| {
    let libraries = image(features());
    let paths: Vec<&Path> = libraries.iter().map(AsRef::as_ref).collect();
    Graph::read(&paths)
});

/// The names of the robots of `robots/` that are read, in order, see [`full`].
fn modules() -> Vec<String> {
    let sources = std::fs::read_to_string(root().join("generated/sources.txt")).unwrap();
    let entries = std::fs::read_dir(root().join("robots")).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "yaml"))
        .map(|path| {
            let text = std::fs::read_to_string(path).unwrap();
            let mut lines = text.lines();
            let name = lines.find_map(|line| line.strip_prefix("name: "));
            name.unwrap().trim().to_owned()
        })
        .filter(|name| full() || sources.lines().any(|line| line == name))
        .collect();
    names.sort();
    names
}

/// The names of the modules, each with the section of the robot's table of methods.
fn robots() -> BTreeMap<String, Vec<usize>> {
    let table = |module: &String| {
        let name = format!("regen_image::robots::{}", module.to_uppercase());
        let found = IMAGE.find(|n| n == name);
        assert_eq!(
            found.len(),
            1,
            "tests/image/src/robots.rs must name {module} once"
        );
        (module.clone(), found)
    };
    let mut robots: BTreeMap<_, _> = modules().iter().map(table).collect();
    let single = IMAGE.find(|n| n == "regen_image::robots::FIVEBAR_F32");
    assert_eq!(single.len(), 1);
    robots.insert("fivebar as f32".to_owned(), single);
    robots
}

/// The functions that are called, defined in no object file and not `known`, each with the chain of
/// calls that leads to it.
fn externals(graph: &Graph, roots: &[usize], known: &[&str]) -> BTreeMap<String, String> {
    let reached = graph.reach(roots);
    let mut found = BTreeMap::new();
    for at in reached.keys() {
        for name in &graph.sections[*at].externals {
            if !known.contains(&name.as_str()) {
                found.insert(name.clone(), graph.path(&reached, *at));
            }
        }
    }
    found
}

/// Panics, formatting, allocation and unwinding are all in `core`, `alloc` and beyond: code that
/// calls nothing there can do none of them.
#[test]
fn robots_call_nothing_but_each_other_and_copies_of_memory() {
    for (robot, roots) in robots() {
        let functions = methods(&roots).len();
        assert!(
            functions >= 22,
            "{robot}: only {functions} methods are in the image"
        );
        let found = externals(&IMAGE, &roots, &MEMORY);
        assert!(found.is_empty(), "{robot}: {found:#?}");
    }
}

/// The methods of the traits in a robot's table, both those that the robot implements and those
/// that the traits provide.
fn methods(roots: &[usize]) -> Vec<usize> {
    let reached = IMAGE.reach(roots);
    let is_method = |at: &&usize| {
        let section = &IMAGE.sections[**at];
        let name = &section.name;
        let of = |its: &str| {
            let provided = name.starts_with(&format!("{its}::"));
            provided || name.starts_with('<') && name.contains(&format!(" as {its}"))
        };
        let traits = [
            "regen_runtime::model::Model",
            "regen_runtime::base::BaseModel",
        ];
        section.code.is_some() && traits.into_iter().any(of)
    };
    reached.keys().filter(is_method).copied().collect()
}

#[test]
fn the_closure_can_fail_only_for_lack_of_memory() {
    let roots = IMAGE.find(|name| name.starts_with("regen_image::closure::"));
    assert_eq!(roots.len(), 6);
    let known = [&MEMORY[..], &ALLOCATOR].concat();
    let found = externals(&IMAGE, &roots, &known);
    assert!(found.is_empty(), "{found:#?}");
    // the closure does allocate, so the list of allowed functions is needed
    assert!(!externals(&IMAGE, &roots, &MEMORY).is_empty());
}

/// The functions of a control cycle allocate nothing either.
#[test]
fn a_control_cycle_calls_nothing_but_copies_of_memory() {
    let roots = control();
    assert_eq!(roots.len(), 13);
    let found = externals(&IMAGE, &roots, &MEMORY);
    assert!(found.is_empty(), "{found:#?}");
}

/// The functions of a control cycle that the image has.
fn control() -> Vec<usize> {
    IMAGE.find(|name| name.starts_with("regen_image::control::"))
}

#[test]
fn no_function_of_robots_of_the_closure_or_of_a_control_cycle_recurses() {
    assert_eq!(cycle(&IMAGE, &control()), None);
    for (robot, roots) in robots() {
        assert_eq!(cycle(&IMAGE, &roots), None, "{robot}");
    }
    let closure = IMAGE.find(|name| name.starts_with("regen_image::closure::"));
    assert_eq!(cycle(&IMAGE, &closure), None);
}

/// Bytes that `generated/README.md` states, by robot.
fn stated() -> BTreeMap<String, u64> {
    let file = root().join("generated/README.md");
    let text = std::fs::read_to_string(file).unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.map(|row| {
        let (robot, rest) = row.split_once("` | ").unwrap();
        let bytes = rest.trim_end_matches([' ', '|']).replace(',', "");
        (robot.to_owned(), bytes.parse().unwrap())
    })
    .collect()
}

/// The size depends on the machine and the compiler, so the stated bound leaves a margin.
#[test]
fn the_stack_of_each_robot_is_within_what_is_stated() {
    let stated = stated();
    let mut rows = String::new();
    let mut fits = !full() || stated.len() == modules().len();
    for (robot, roots) in robots() {
        let depths = methods(&roots)
            .into_iter()
            .map(|at| deepest(&IMAGE, at).unwrap());
        let (bytes, chain) = depths.max().unwrap();
        let Some(&bound) = stated.get(&robot) else {
            fits &= robot == "fivebar as f32";
            let _ = writeln!(rows, "{robot}: {bytes} by {chain}");
            continue;
        };
        // a bound far above the actual size is refused too
        fits &= bytes <= bound && bound <= 2 * bytes + 4096;
        let _ = writeln!(rows, "{robot}: {bytes} of {bound} by {chain}");
    }
    println!("{rows}");
    assert!(
        fits,
        "generated/README.md states other sizes, or other robots:\n{rows}"
    );
}

/// Runs the tests in `tests/image/tests/` in release, with the robots built above.
#[test]
fn results_show_nan_infinity_and_singularities_in_release() {
    let output = cargo("test", &["--release", "--package", "regen-image"])
        .args(["--features", features(), "--test", "numbers"])
        .current_dir(root())
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{printed}{errors}");
    let tests = printed
        .lines()
        .filter(|line| line.starts_with("test ") && line.ends_with(" ok"));
    assert!(tests.count() >= 5, "{printed}");
}

/// A check of the checks: a panic, circles of calls and large frames are found where they are.
#[test]
fn a_panic_a_circle_of_calls_and_a_large_frame_are_found() {
    let library = fixture(
        Path::new(env!("CARGO_TARGET_TMPDIR")),
        "seen",
        "#![no_std]
        pub fn index(values: &[f64], at: usize) -> f64 { values[at] }
        pub fn total(values: &[f64]) -> f64 { values.iter().sum() }
        #[inline(never)]
        fn odd(n: u64, f: fn(u64) -> u64) -> u64 { if n == 0 { 0 } else { f(n) ^ even(n - 1, f).rotate_left(3) } }
        #[inline(never)]
        fn even(n: u64, f: fn(u64) -> u64) -> u64 { if n == 0 { 1 } else { f(n) ^ odd(n - 1, f).rotate_left(5) } }
        pub fn parity(n: u64, f: fn(u64) -> u64) -> u64 { odd(n, f) }
        pub fn again(n: u64, f: fn(u64) -> u64) -> u64 { if n == 0 { 0 } else { f(n) ^ again(n - 1, f).rotate_left(3) } }
        pub fn small(f: fn(&mut [u8])) { let mut a = [0; 1000]; f(&mut a); }
        pub fn pages(f: fn(&mut [u8])) { let mut a = [0; 50_000]; f(&mut a); small(f); }
        pub static TABLE: [fn(&[f64], usize) -> f64; 1] = [index];",
    );
    let graph = Graph::read(&[&library]);
    let named = |name: &str| {
        let found = graph.find(|n| n == format!("seen::{name}"));
        assert_eq!(found.len(), 1, "{name}");
        found
    };
    let panics = |name| {
        externals(&graph, &named(name), &MEMORY)
            .into_keys()
            .collect::<Vec<_>>()
    };
    assert_eq!(panics("index"), ["core::panicking::panic_bounds_check"]);
    assert_eq!(
        panics("TABLE"),
        ["core::panicking::panic_bounds_check"],
        "by way of a constant"
    );
    assert!(panics("total").is_empty());

    let circle = cycle(&graph, &named("parity")).unwrap();
    assert!(
        circle.contains("odd") && circle.contains("even"),
        "{circle}"
    );
    assert_eq!(
        cycle(&graph, &named("again")).as_deref(),
        Some("seen::again")
    );
    assert_eq!(cycle(&graph, &named("pages")), None);

    let bytes = |name: &str| deepest(&graph, named(name)[0]).unwrap().0;
    let (small, pages) = (bytes("small"), bytes("pages"));
    assert!((1000..1100).contains(&small), "{small}");
    assert!((51_000..51_300).contains(&pages), "{pages}");
}
