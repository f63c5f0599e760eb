//! Each module of the generator uses only those modules that `ARCHITECTURE.md` permits.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
use std::path::Path;

/// The modules ("rooms"), and which others each may use. A module uses only modules above it.
const ROOMS: &[(&str, &[&str])] = &[
    ("bytes", &[]),
    ("numeric", &[]),
    ("diag", &[]),
    ("signature", &[]),
    ("sym", &["bytes", "numeric"]),
    ("spec", &["diag", "sym"]),
    ("model", &["spec", "sym"]),
    ("kinematics", &["model", "spec", "sym"]),
    ("dynamics", &["kinematics", "model", "sym"]),
    (
        "constraints",
        &["kinematics", "model", "numeric", "spec", "sym"],
    ),
    (
        "base",
        &[
            "constraints",
            "diag",
            "kinematics",
            "model",
            "numeric",
            "spec",
            "sym",
        ],
    ),
    ("optimize", &["sym"]),
    // a derived robot: names and programs, no expressions
    ("robot", &["base", "model", "optimize", "signature", "spec"]),
    (
        "functions",
        &[
            "base",
            "constraints",
            "dynamics",
            "kinematics",
            "model",
            "optimize",
            "signature",
            "sym",
        ],
    ),
    ("interpret", &["numeric", "optimize"]),
    (
        "store",
        &["base", "bytes", "optimize", "robot", "spec", "sym"],
    ),
    ("scene", &["model", "spec", "sym"]),
    ("digest", &["interpret", "robot"]),
    (
        "emit",
        &["base", "digest", "optimize", "robot", "signature"],
    ),
    (
        "checks",
        &[
            "base",
            "constraints",
            "diag",
            "kinematics",
            "model",
            "spec",
            "sym",
        ],
    ),
    (
        "explain",
        &[
            "base",
            "constraints",
            "diag",
            "kinematics",
            "model",
            "numeric",
            "robot",
            "spec",
            "sym",
        ],
    ),
    (
        "pipeline",
        &[
            "base",
            "checks",
            "constraints",
            "diag",
            "explain",
            "functions",
            "kinematics",
            "model",
            "optimize",
            "robot",
            "scene",
            "signature",
            "spec",
            "store",
            "sym",
        ],
    ),
];

/// The modules that a file's text names after `crate::`, without its unit tests.
fn named(text: &str) -> BTreeSet<String> {
    let shipped = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or("");
    let code = shipped
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"));
    let mut named = BTreeSet::new();
    for line in code {
        for after in line.split("crate::").skip(1) {
            let end = after.find(|c: char| !(c.is_alphanumeric() || c == '_'));
            named.insert(after[..end.unwrap_or(after.len())].to_owned());
        }
    }
    named
}

/// The modules that a module uses but may not.
fn trespasses(room: &str, text: &str) -> Vec<String> {
    let allowed = ROOMS.iter().find(|(name, _)| *name == room).unwrap().1;
    let known = |other: &String| other == room || allowed.contains(&other.as_str());
    named(text)
        .into_iter()
        .filter(|other| !known(other))
        .collect()
}

/// The texts of a module's files.
fn texts(path: &Path) -> Vec<String> {
    if path.ends_with("tests.rs") {
        return Vec::new();
    }
    if path.is_file() {
        return vec![std::fs::read_to_string(path).unwrap()];
    }
    let entries = std::fs::read_dir(path).unwrap();
    entries
        .flat_map(|entry| texts(&entry.unwrap().path()))
        .collect()
}

fn sources() -> Vec<(String, Vec<String>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let entries = std::fs::read_dir(folder).unwrap();
    let rooms = entries.map(|entry| {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        (name, texts(&path))
    });
    rooms.filter(|(name, _)| name != "lib").collect()
}

#[test]
fn no_room_uses_the_names_forbidden_to_it() {
    for (room, texts) in sources() {
        for text in texts {
            let found = trespasses(&room, &text);
            assert!(found.is_empty(), "{room} names {found:?}");
        }
    }
}

#[test]
fn the_table_lists_every_room_and_nothing_else() {
    let listed: BTreeSet<String> = ROOMS.iter().map(|(name, _)| (*name).to_owned()).collect();
    let built: BTreeSet<String> = sources().into_iter().map(|(name, _)| name).collect();
    assert_eq!(listed, built);
    let chapter = Path::new(env!("CARGO_MANIFEST_DIR")).join("ARCHITECTURE.md");
    let chapter = std::fs::read_to_string(chapter).unwrap();
    for room in &listed {
        assert!(chapter.contains(&format!("| `{room}` |")), "{room}");
    }
}

#[test]
fn rooms_name_only_rooms_above_them() {
    for (place, (room, allowed)) in ROOMS.iter().enumerate() {
        for other in *allowed {
            let above = ROOMS[..place].iter().any(|(name, _)| name == other);
            assert!(above, "{room} names {other}");
        }
    }
}

#[test]
fn a_forbidden_name_is_found() {
    assert_eq!(trespasses("sym", "use crate::spec::Spec;"), ["spec"]);
    assert_eq!(
        trespasses(
            "emit",
            "let x = crate::sym::Graph::new();\nuse crate::robot::Robot;"
        ),
        ["sym"]
    );
    assert!(trespasses("emit", "// crate::sym\n").is_empty());
    assert!(trespasses("emit", "#[cfg(test)]\nmod tests {\nuse crate::sym::Graph;").is_empty());
    // the modules that the rules are about do use others
    let named: usize = sources()
        .iter()
        .flat_map(|(_, texts)| texts)
        .map(|text| named(text).len())
        .sum();
    assert!(named > 100);
}

/// Files of the module `base` that take decisions in layers 1 and 2.
const EXACT: [&str; 16] = [
    "kept_columns.rs",
    "coefficient.rs",
    "coupled.rs",
    "geometry.rs",
    "known.rs",
    "linkage.rs",
    "rates.rs",
    "span.rs",
    "tree.rs",
    "trees.rs",
    "link_path.rs",
    "field/mod.rs",
    "field/polynomial.rs",
    "field/print.rs",
    "field/ratio.rs",
    "field/variables.rs",
];

#[test]
fn layers_1_and_2_contain_no_double() {
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/base");
    let holds = |file: &str| {
        let text = std::fs::read_to_string(base.join(file)).unwrap();
        text.contains("f64") || text.contains("f32")
    };
    for file in EXACT {
        assert!(!holds(file), "{file} speaks of doubles");
    }
    // double precision is found where it is permitted
    assert!(holds("analysis.rs"));
}
