//! Robots whose names mean something else in Rust, or in a generated module, compile.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use regen_codegen::diag::Source;
use regen_codegen::{emit, pipeline};
use regen_downstream::{root, target_folder};

/// The prelude of the standard library in the editions up to 2024, and the derived traits.
const PRELUDE: &str = "AsMut AsRef AsyncFn AsyncFnMut AsyncFnOnce Box Clone Copy Debug Default \
    DoubleEndedIterator Drop Eq Err ExactSizeIterator Extend Fn FnMut FnOnce From FromIterator \
    Future Hash Into IntoFuture IntoIterator Iterator None Ok Option Ord PartialEq PartialOrd \
    Result Send Sized Some String Sync ToOwned ToString TryFrom TryInto Unpin Vec";

/// A type parameter, crates, primitive types, contextual keywords, names without a letter, and
/// names of which the type would be `Self` or a number.
const OTHERS: &str = "T t core std alloc regen_runtime f64 usize str bool auto default union raw \
    safe macro_rules model_t _ __ _1 _3rps _self self_";

/// A prismatic joint with friction and limits: its module has all imports that a tree's module can
/// have.
const SLIDE: &str = "limbs: [{name: a, joints: [{name: q, type: prismatic, body: 1, \
    actuated: true, friction: linear, limits: {effort: [-1, 1]}}]}]\n";

/// The text of the module of a robot with this name, or `None` if the name is refused.
fn module(name: &str, rest: &str) -> Option<String> {
    let source = Source::new("robot.yaml", spec(name, rest));
    let options = emit::Options::default();
    Some(emit::module(&pipeline::derive(&source).ok()?, &options))
}

fn spec(name: &str, rest: &str) -> String {
    format!("name: {name}\n{rest}")
}

/// The names that a module imports and the constants that it defines.
fn names_in_scope(module: &str) -> BTreeSet<String> {
    let uses = module.split("use ::regen_runtime::{").skip(1);
    let uses = uses.flat_map(|rest| rest.split('}').next().unwrap().split(','));
    let constants = module.lines().filter_map(|line| {
        let rest = line.strip_prefix("pub const ")?;
        rest.split(':').next()
    });
    uses.chain(constants)
        .map(|name| name.trim().to_owned())
        .filter(|name| !name.is_empty())
        .collect()
}

/// The name of a module whose type has this name: `SizeError` comes from `size_error`, and `Box`,
/// whose lower-case form is a keyword, from itself.
fn robot_name(type_name: &str) -> String {
    let mut name = String::new();
    for (at, c) in type_name.char_indices() {
        if c.is_ascii_uppercase() && at > 0 {
            name.push('_');
        }
        name.push(c.to_ascii_lowercase());
    }
    let is_constant = type_name.len() > 1 && !type_name.contains(|c: char| c.is_ascii_lowercase());
    if is_constant || ["box", "fn"].contains(&name.as_str()) {
        type_name.to_owned()
    } else {
        name
    }
}

#[test]
fn robots_named_like_imports_or_prelude_items_compile_as_source_and_by_the_macro() {
    let root = root().canonicalize().unwrap();
    let closed = fs::read_to_string(root.join("robots/fourbar.yaml")).unwrap();
    let closed = closed.replace("name: fourbar\n", "");
    let of_tree = names_in_scope(&module("plain", SLIDE).unwrap());
    let of_loop = names_in_scope(&module("plain", &closed).unwrap());
    for name in [
        "Joint",
        "SwingLimit",
        "Friction",
        "Limits",
        "BaseKernel",
        "HOME",
    ] {
        assert!(of_tree.contains(name), "{name} is read from {of_tree:?}");
    }
    let only_of_loop: Vec<&String> = of_loop.difference(&of_tree).collect();
    assert_eq!(only_of_loop, ["Cut"]);

    let mut robots: Vec<(String, &str)> = of_tree
        .iter()
        .map(String::as_str)
        .chain(PRELUDE.split_whitespace())
        .map(|name| (robot_name(name), SLIDE))
        .chain(
            OTHERS
                .split_whitespace()
                .map(|name| (name.to_owned(), SLIDE)),
        )
        .chain(
            only_of_loop
                .iter()
                .map(|name| (robot_name(name), closed.as_str())),
        )
        .collect();
    robots.sort();
    robots.dedup();

    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("names");
    fs::create_dir_all(dir.join("src")).unwrap();
    fs::create_dir_all(dir.join("robots")).unwrap();
    // Specs have numbers as file names: the names of some robots differ only in case, which some
    // file systems ignore.
    let (mut macros, mut sources) = (String::new(), String::new());
    for (at, (name, rest)) in robots.iter().enumerate() {
        if name == "_" {
            assert_eq!(module(name, rest), None, "`_` cannot name a module");
            continue;
        }
        let text = module(name, rest).unwrap_or_else(|| panic!("{name} is refused"));
        fs::write(dir.join(format!("robots/{at}.yaml")), spec(name, rest)).unwrap();
        writeln!(macros, "::regen_runtime::robot_model!(\"{at}.yaml\");").unwrap();
        writeln!(sources, "pub mod {name} {{\n{text}\n}}").unwrap();
    }
    let runtime = root.join("runtime").display().to_string();
    let manifest = format!(
        "[package]\nname = \"names\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\n[workspace]\n\n\
         [dependencies]\nregen-runtime = {{ path = {runtime:?}, features = [\"macros\"] }}\n"
    );
    fs::write(dir.join("Cargo.toml"), manifest).unwrap();
    fs::copy(root.join("Cargo.lock"), dir.join("Cargo.lock")).unwrap();
    let source =
        format!("#![allow(non_snake_case)]\n{macros}\npub mod checked_in {{\n{sources}\n}}\n");
    fs::write(dir.join("src/lib.rs"), source).unwrap();
    let output = Command::new(env!("CARGO"))
        .args(["check", "--quiet"])
        .current_dir(&dir)
        .env(
            "CARGO_TARGET_DIR",
            target_folder(env!("CARGO_TARGET_TMPDIR")),
        )
        .env("CARGO_INCREMENTAL", "0")
        .env_remove("RUSTFLAGS")
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    assert!(!errors.contains("warning: "), "{errors}");
}
