//! Each module of the generator and of identification uses only those modules that the files `ARCHITECTURE.md` permit.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
use std::path::Path;

use regen_tests::files;

/// A module ("room") and the others that it may use.
type Room = (&'static str, &'static [&'static str]);

/// A package whose modules are rooms. A room uses only rooms above it in the list.
struct House {
    /// Its folder.
    folder: &'static str,
    /// The file that says what each room does.
    table: &'static str,
    rooms: &'static [Room],
}

const HOUSES: [House; 2] = [
    House {
        folder: "codegen",
        table: "codegen/ARCHITECTURE.md",
        rooms: GENERATOR,
    },
    House {
        folder: "runtime/identify",
        table: "ARCHITECTURE.md",
        rooms: IDENTIFICATION,
    },
];

const IDENTIFICATION: &[Room] = &[
    ("text", &[]),
    ("document", &[]),
    ("turned", &[]),
    ("qr_update", &[]),
    ("signals", &["qr_update"]),
    ("estimate", &["qr_update", "signals"]),
    ("singular", &["qr_update"]),
    ("feasibility", &["estimate", "qr_update", "text"]),
    ("intervals", &["estimate", "feasibility"]),
    ("states", &["estimate", "qr_update", "signals", "turned"]),
    (
        "identify",
        &["estimate", "qr_update", "signals", "states", "turned"],
    ),
    ("identifiability", &["estimate", "feasibility"]),
    ("status", &["estimate", "identifiability"]),
    (
        "data",
        &[
            "document",
            "estimate",
            "feasibility",
            "identify",
            "intervals",
            "signals",
            "states",
            "text",
            "turned",
        ],
    ),
    ("suspect", &["data", "estimate", "states", "text"]),
    ("choice", &["data", "signals"]),
    (
        "friction",
        &[
            "estimate",
            "feasibility",
            "identify",
            "intervals",
            "qr_update",
            "signals",
            "states",
        ],
    ),
    (
        "model",
        &[
            "choice",
            "data",
            "estimate",
            "friction",
            "identify",
            "intervals",
            "states",
        ],
    ),
    (
        "gains",
        &[
            "data",
            "estimate",
            "feasibility",
            "identify",
            "intervals",
            "model",
            "qr_update",
            "states",
            "status",
        ],
    ),
    (
        "experiment_file",
        &[
            "data", "document", "gains", "identify", "signals", "states", "text",
        ],
    ),
    (
        "files",
        &[
            "choice",
            "data",
            "document",
            "estimate",
            "feasibility",
            "friction",
            "identify",
            "model",
            "states",
            "status",
        ],
    ),
    ("observation", &[]),
    (
        "session",
        &[
            "choice",
            "data",
            "estimate",
            "feasibility",
            "friction",
            "gains",
            "identifiability",
            "identify",
            "intervals",
            "model",
            "signals",
            "states",
        ],
    ),
];

const GENERATOR: &[Room] = &[
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
        &["base", "diag", "digest", "optimize", "robot", "signature"],
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
    let code = code.collect::<Vec<&str>>().join("\n");
    let mut named = BTreeSet::new();
    let name_of = |text: &str| {
        let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_'));
        text[..end.unwrap_or(text.len())].to_owned()
    };
    for after in code.split("crate::").skip(1) {
        let Some(list) = after.strip_prefix('{') else {
            named.insert(name_of(after));
            continue;
        };
        // the first names of a list in braces, at its own depth
        let (mut depth, mut begins) = (0, true);
        for (place, c) in list.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => begins = true,
                c if begins && !c.is_whitespace() => {
                    named.insert(name_of(&list[place..]));
                    begins = false;
                }
                _ => {}
            }
        }
    }
    named
}

/// The modules that a module uses but may not.
fn trespasses(rooms: &[Room], room: &str, text: &str) -> Vec<String> {
    let allowed = rooms.iter().find(|(name, _)| *name == room).unwrap().1;
    let known = |other: &String| other == room || allowed.contains(&other.as_str());
    let found = named(text).into_iter();
    // names that are no rooms are those of the package itself
    let is_room = |other: &String| rooms.iter().any(|(name, _)| name == other);
    found
        .filter(|other| is_room(other) && !known(other))
        .collect()
}

/// The texts of a module's files.
fn texts(path: &Path) -> Vec<String> {
    if path.to_string_lossy().ends_with("tests.rs") {
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

fn sources(house: &House) -> Vec<(String, Vec<String>)> {
    let folder = files::package().join("..").join(house.folder).join("src");
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
    for house in HOUSES {
        for (room, texts) in sources(&house) {
            for text in texts {
                let found = trespasses(house.rooms, &room, &text);
                assert!(found.is_empty(), "{}: {room} names {found:?}", house.folder);
            }
        }
    }
}

#[test]
fn the_table_lists_every_room_and_nothing_else() {
    for house in HOUSES {
        let listed = house.rooms.iter().map(|(name, _)| (*name).to_owned());
        let listed: BTreeSet<String> = listed.collect();
        let built: BTreeSet<String> = sources(&house).into_iter().map(|(name, _)| name).collect();
        assert_eq!(listed, built);
        let chapter =
            std::fs::read_to_string(files::package().join("..").join(house.table)).unwrap();
        for room in &listed {
            assert!(chapter.contains(&format!("| `{room}` |")), "{room}");
        }
    }
}

#[test]
fn rooms_name_only_rooms_above_them() {
    for house in HOUSES {
        for (place, (room, allowed)) in house.rooms.iter().enumerate() {
            for other in *allowed {
                let above = house.rooms[..place].iter().any(|(name, _)| name == other);
                assert!(above, "{}: {room} names {other}", house.folder);
            }
        }
    }
}

#[test]
fn a_forbidden_name_is_found() {
    let trespasses = |room, text| trespasses(GENERATOR, room, text);
    assert_eq!(trespasses("sym", "use crate::spec::Spec;"), ["spec"]);
    assert_eq!(
        trespasses(
            "emit",
            "let x = crate::sym::Graph::new();\nuse crate::robot::Robot;"
        ),
        ["sym"]
    );
    assert_eq!(
        trespasses("sym", "use crate::{bytes::Reader, spec::{Spec, Joint}};"),
        ["spec"]
    );
    assert!(trespasses("emit", "// crate::sym\n").is_empty());
    assert!(trespasses("emit", "#[cfg(test)]\nmod tests {\nuse crate::sym::Graph;").is_empty());
    // the modules that the rules are about do use others
    for house in HOUSES {
        let sources = sources(&house);
        let all = sources.iter().flat_map(|(_, texts)| texts);
        let named: usize = all.map(|text| named(text).len()).sum();
        assert!(named > 100, "{}: {named}", house.folder);
    }
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
    let base = files::package().join("..").join("codegen/src/base");
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
