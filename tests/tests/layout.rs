//! The top level of the repository contains only the agreed files, and fixtures are in the folders
//! that `tests/README.md` lists.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use regen_tests::files;

/// The agreed names, without hidden files, which belong to tools.
const TOP: [&str; 16] = [
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "Cargo.lock",
    "Cargo.toml",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "README.md",
    "codegen",
    "generated",
    "macros",
    "robots",
    "runtime",
    "target",
    "tests",
];

/// The names that git tracks in a folder; without git, all names there.
fn names(folder: &Path) -> BTreeSet<String> {
    let listed = Command::new("git")
        .args(["ls-files", "-z"])
        .current_dir(folder)
        .output()
        .ok()
        .filter(|output| output.status.success());
    match listed {
        Some(output) => String::from_utf8_lossy(&output.stdout)
            .split('\0')
            .filter_map(|path| path.split('/').next())
            .filter(|name| !name.is_empty())
            .map(str::to_owned)
            .collect(),
        None => std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect(),
    }
}

#[test]
fn the_top_level_contains_only_the_agreed_names() {
    let found = names(&files::package().join(".."));
    let extra: Vec<_> = found
        .iter()
        .filter(|name| !name.starts_with('.') && !TOP.contains(&name.as_str()))
        .collect();
    assert!(extra.is_empty(), "{extra:?}");
    for name in TOP.iter().filter(|name| **name != "target") {
        assert!(found.contains(*name), "{name} is missing");
    }
}

#[test]
fn the_folder_of_robots_contains_only_robots() {
    for name in names(&files::robots()) {
        let known = [
            "README.md",
            "measured",
            "runs.schema.json",
            "spec.schema.json",
        ]
        .contains(&name.as_str());
        let extension = Path::new(&name).extension().and_then(|e| e.to_str());
        assert!(
            known || matches!(extension, Some("yaml" | "base")),
            "{name}"
        );
    }
}

#[test]
fn every_folder_of_fixtures_and_tools_is_in_the_table() {
    let page = std::fs::read_to_string(files::package().join("README.md")).unwrap();
    let rows: Vec<&str> = page
        .lines()
        .filter(|line| line.starts_with("| `"))
        .collect();
    for folder in ["fixtures", "tools"] {
        for name in names(&files::package().join(folder)) {
            let cell = format!("| `{name}/` |");
            assert!(
                rows.iter().any(|row| row.starts_with(&cell)),
                "{folder}/{name}"
            );
        }
    }
}

#[test]
fn every_fault_that_is_recorded_names_tests_that_there_are() {
    let page = std::fs::read_to_string(files::package().join("records/faults.md")).unwrap();
    let root = files::package().join("..");
    let mut faults = Vec::new();
    for row in page.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let [fault, kind, tests] = cells[..] else {
            panic!("{row}");
        };
        assert!(!kind.is_empty(), "{row}");
        faults.push(fault.trim_matches('`'));
        for test in tests.split(", ") {
            let name = test.trim_matches('`').split_once("::");
            let (file, name) = name.unwrap_or_else(|| panic!("{fault}: {test}"));
            let text = std::fs::read_to_string(root.join(file)).unwrap_or_default();
            let at = text.find(&format!("fn {name}("));
            let before = at.map_or("", |at| text[..at].trim_end());
            // only attributes stand between a test and its function
            let attributes = before
                .lines()
                .rev()
                .take_while(|line| line.trim().starts_with("#["));
            let attributes: Vec<&str> = attributes.map(str::trim).collect();
            assert!(
                attributes.contains(&"#[test]")
                    && !attributes.iter().any(|own| own.starts_with("#[ignore")),
                "{fault}: {file} has no test {name} that always runs"
            );
        }
    }
    assert!(faults.len() >= 59, "{}", faults.len());
    assert!(
        faults.is_sorted() && faults.windows(2).all(|pair| pair[0] != pair[1]),
        "{faults:?}"
    );
}

#[test]
fn every_file_of_a_test_program_is_a_module_of_it() {
    let root = files::package().join("..");
    let manifest = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let members = manifest
        .lines()
        .find(|line| line.starts_with("members"))
        .unwrap();
    let mut programs = 0;
    for member in members.split('"').skip(1).step_by(2) {
        let package = std::fs::read_to_string(root.join(member).join("Cargo.toml")).unwrap();
        if !package.contains("autotests = false") {
            continue;
        }
        programs += 1;
        let folder = root.join(member).join("tests");
        let program = std::fs::read_to_string(folder.join("all.rs")).unwrap();
        for entry in std::fs::read_dir(&folder).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if let Some(module) = name.strip_suffix(".rs").filter(|module| *module != "all") {
                let line = format!("mod {module};");
                assert!(
                    program.lines().any(|l| l == line),
                    "{member}/tests/all.rs lacks `{line}`, so that its tests do not run"
                );
            }
        }
    }
    assert_eq!(programs, 7);
}
