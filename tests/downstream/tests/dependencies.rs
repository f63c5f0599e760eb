//! Crates that a user of the macro or of the generated crate never builds.

/// Crates of the solvers and the command line: they take minutes to build, or are of no use in a
/// controller.
const HEAVY: [&str; 13] = [
    "faer",
    "csv",
    "statrs",
    "clarabel",
    "regen-lapack",
    "lapack-sys",
    "nalgebra",
    "schemars",
    "clap",
    "clap_complete",
    "indicatif",
    "serde_json",
    "num-dual",
];

/// The names of the crates that are built for a package, itself included, without dev-dependencies.
fn tree(package: &str, flags: &[&str]) -> Vec<String> {
    let lines = regen_downstream::tree(package, flags);
    let names = lines
        .iter()
        .filter_map(|line| line.split_whitespace().next());
    names.map(str::to_owned).collect()
}

fn contains(tree: &[String], name: &str) -> bool {
    tree.iter().any(|p| p == name)
}

#[track_caller]
fn assert_light(package: &str, flags: &[&str]) {
    let tree = tree(package, flags);
    assert!(
        contains(&tree, package),
        "the tree is of {package}: {tree:?}"
    );
    for heavy in HEAVY {
        assert!(
            !contains(&tree, heavy),
            "{package} {flags:?} builds {heavy}"
        );
    }
}

#[test]
fn the_macro_and_what_it_emits_never_build_the_heavy_crates() {
    assert_light("regen-macros", &[]);
    assert_light("regen-codegen", &[]);
    assert_light("regen-generated", &[]);
    assert_light("regen-generated", &["--features", "std"]);
    assert_light("regen-runtime", &[]);
    assert_light("regen-runtime", &["--features", "macros"]);
    assert_light("regen-robotics", &["--features", "control"]);
}

/// The check can fail: it finds crates that are built.
#[test]
fn a_crate_that_is_built_is_found() {
    assert!(contains(&tree("regen-macros", &[]), "syn"));
    assert!(contains(&tree("regen-generated", &[]), "libm"));
    assert!(contains(
        &tree("regen-runtime", &["--features", "macros"]),
        "regen-codegen"
    ));
    let identify = tree("regen-identify", &[]);
    for part in ["clarabel", "nalgebra", "regen-lapack"] {
        assert!(contains(&identify, part), "{part}");
    }
    assert!(contains(&tree("regen-cli", &[]), "clap"));
    assert!(contains(&tree("regen-cli", &[]), "serde_json"));
}

/// The solver needs no system library, and none that a build script downloads or compiles.
#[test]
fn the_conic_solver_needs_no_system_lapack() {
    let tree = tree("regen-identify", &[]);
    for library in [
        "openblas-src",
        "netlib-src",
        "intel-mkl-src",
        "accelerate-src",
        "cc",
    ] {
        assert!(!contains(&tree, library), "identification builds {library}");
    }
}

/// Without the macro, the runtime builds two crates, with or without the standard library.
#[test]
fn the_runtime_depends_on_libm_alone() {
    for flags in [&["--no-default-features"][..], &[]] {
        let mut tree = tree("regen-runtime", flags);
        tree.sort_unstable();
        assert_eq!(tree, ["libm", "regen-runtime"], "{flags:?}");
    }
}
