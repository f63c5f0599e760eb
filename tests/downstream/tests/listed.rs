//! The tables of `DEPENDENCIES.md` and `.deny.toml` agree with cargo.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::LazyLock;

use regen_downstream::{cargo, root, tree};
use serde_json::Value;

/// The packages of the workspace and all packages that Cargo.lock lists for them.
static PACKAGES: LazyLock<Vec<Value>> = LazyLock::new(|| {
    let text = cargo(&[
        "metadata",
        "--format-version",
        "1",
        "--locked",
        "--features",
        "regen-fuzz/targets",
    ]);
    let all: Value = serde_json::from_str(&text).unwrap();
    all["packages"].as_array().unwrap().clone()
});

fn text<'v>(value: &'v Value, key: &str) -> &'v str {
    value[key].as_str().unwrap()
}

/// The rows of the table whose head starts with `head`, cell by cell, without back quotes.
fn table(head: &str) -> Vec<Vec<String>> {
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("DEPENDENCIES.md"))
            .unwrap();
    let mut lines = page.lines().skip_while(|line| !line.starts_with(head));
    assert!(lines.next().is_some(), "no table {head}");
    lines
        .skip(1)
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            let cells = line.trim_matches('|').split('|');
            cells.map(|cell| cell.trim().replace('`', "")).collect()
        })
        .collect()
}

/// The strings of a list in `.deny.toml`, each on a line of its own.
fn listed(key: &str) -> BTreeSet<String> {
    let file = std::fs::read_to_string(root().join(".deny.toml")).unwrap();
    let start = format!("{key} = [");
    let lines = file.lines().skip_while(|line| *line != start).skip(1);
    let list: BTreeSet<_> = lines
        .take_while(|line| *line != "]")
        .map(|line| line.trim().trim_matches([',', '"']).to_owned())
        .collect();
    assert!(!list.is_empty(), "no {key} in .deny.toml");
    list
}

#[test]
fn every_direct_dependency_has_its_row_and_every_row_its_dependency() {
    let mut found: BTreeMap<String, BTreeMap<String, bool>> = BTreeMap::new();
    let ours = PACKAGES
        .iter()
        .filter(|package| package["source"].is_null());
    for package in ours {
        let user = text(package, "name").strip_prefix("regen-").unwrap();
        for dependency in package["dependencies"].as_array().unwrap() {
            if text(dependency, "name").starts_with("regen-") {
                continue;
            }
            let users = found
                .entry(text(dependency, "name").to_owned())
                .or_default();
            // true in the product, false in its tests only
            *users.entry(user.to_owned()).or_default() |= dependency["kind"] != "dev";
        }
    }
    let users = |users: &BTreeMap<String, bool>| {
        let user = |(name, product): (&String, &bool)| {
            if *product {
                name.clone()
            } else {
                format!("{name} (tests)")
            }
        };
        users.iter().map(user).collect::<Vec<_>>().join(", ")
    };
    let found: BTreeMap<_, _> = found
        .iter()
        .map(|(name, u)| (name.clone(), users(u)))
        .collect();
    let rows = table("| crate | used by");
    let stated = rows.iter().map(|row| (row[0].clone(), row[1].clone()));
    assert_eq!(stated.collect::<BTreeMap<_, _>>(), found);
    for row in rows {
        assert!(row[2].len() > 10, "{}: why?", row[0]);
        let licences = PACKAGES.iter().filter(|p| text(p, "name") == row[0]);
        let licences: BTreeSet<&str> = licences.map(|p| text(p, "license")).collect();
        assert!(
            licences.contains(row[3].as_str()),
            "{}: {licences:?}",
            row[0]
        );
    }
}

#[test]
fn every_licence_is_among_those_that_are_allowed() {
    let allowed = listed("allow");
    let stated: BTreeSet<String> = table("| licence")
        .into_iter()
        .map(|r| r[0].clone())
        .collect();
    assert_eq!(stated, allowed);
    let mut needed = BTreeSet::new();
    for package in PACKAGES.iter() {
        let name = text(package, "name");
        let written = package["license"]
            .as_str()
            .unwrap_or_else(|| panic!("{name}: no licence"));
        let expression = spdx::Expression::parse_mode(written, spdx::ParseMode::LAX).unwrap();
        let meets = |without: Option<&str>| {
            expression.evaluate(|requirement| {
                let id = requirement.license.id().map(|id| id.name);
                id.is_some_and(|id| allowed.contains(id) && Some(id) != without)
            })
        };
        assert!(meets(None), "{name}: {written}");
        needed.extend(allowed.iter().filter(|id| !meets(Some(id))));
    }
    // every allowed licence is needed by some crate
    assert_eq!(needed, allowed.iter().collect());
}

#[test]
fn every_crate_comes_from_the_registry_or_this_workspace() {
    let sources: BTreeSet<&str> = PACKAGES
        .iter()
        .filter_map(|p| p["source"].as_str())
        .collect();
    assert_eq!(sources.len(), 1, "{sources:?}");
    assert!(
        sources.iter().all(|s| s.starts_with("registry+")),
        "{sources:?}"
    );
}

/// The numbers of a version, such as `1.95` or `1.63.0`.
fn release(version: &str) -> Vec<u32> {
    let mut numbers: Vec<u32> = version.split('.').map(|n| n.parse().unwrap()).collect();
    numbers.resize(3, 0);
    numbers
}

/// `CONTRIBUTING.md` has the policy.
#[test]
fn every_crate_builds_with_the_oldest_supported_compiler_and_pages_name_it() {
    let ours = |p: &&Value| p["source"].is_null();
    let promised: BTreeSet<&str> = PACKAGES
        .iter()
        .filter(ours)
        .map(|p| text(p, "rust_version"))
        .collect();
    let [oldest] = promised.iter().copied().collect::<Vec<_>>()[..] else {
        panic!("{promised:?}");
    };
    let mut stated = 0;
    for package in PACKAGES.iter() {
        let Some(needed) = package["rust_version"].as_str() else {
            continue;
        };
        stated += 1;
        let name = text(package, "name");
        assert!(
            release(needed) <= release(oldest),
            "{name} needs Rust {needed}, and packages here promise {oldest}"
        );
    }
    assert!(stated > 100, "{stated}");
    for (page, words) in [
        ("README.md", format!("# {oldest} or later")),
        ("codegen/python/README.md", format!("Rust {oldest}")),
    ] {
        let page_text = std::fs::read_to_string(root().join(page)).unwrap();
        assert!(page_text.contains(&words), "{page}: {words}");
    }
}

#[test]
fn every_crate_in_several_versions_is_explained() {
    let mut versions: BTreeMap<&str, usize> = BTreeMap::new();
    for package in PACKAGES.iter() {
        *versions.entry(text(package, "name")).or_default() += 1;
    }
    versions.retain(|_, count| *count > 1);
    let rows = table("| crate | versions");
    let stated = rows
        .iter()
        .map(|row| (row[0].as_str(), row[1].parse().unwrap()));
    assert_eq!(stated.collect::<BTreeMap<_, _>>(), versions);
    assert_eq!(
        listed("skip"),
        versions.keys().map(|&name| name.to_owned()).collect()
    );
    for row in &rows {
        assert!(row[2].len() > 5, "{}: why?", row[0]);
    }
}

/// The names and versions of the crates that a package builds, itself included.
fn built(package: &str, features: &str) -> BTreeSet<String> {
    let flags = if features.is_empty() {
        vec![]
    } else {
        vec!["--features", features]
    };
    let crates = tree(package, &flags);
    // a crate that was listed before is followed by a star
    crates
        .iter()
        .map(|line| {
            line.split_whitespace()
                .take(2)
                .collect::<Vec<_>>()
                .join(" ")
        })
        .collect()
}

#[test]
fn trees_are_no_larger_than_stated() {
    let rows = table("| package | features");
    assert_eq!(rows.len(), 6);
    for row in rows {
        let stated: usize = row[2].parse().unwrap();
        let crates = built(&row[0], &row[1]);
        assert_eq!(
            crates.len(),
            stated,
            "{} with {:?}: {crates:#?}",
            row[0],
            row[1]
        );
    }
}

#[test]
fn what_users_build_contains_no_crate_twice() {
    for (package, features) in [
        ("regen-macros", ""),
        ("regen-generated", ""),
        ("regen-runtime", "macros"),
    ] {
        let crates = built(package, features);
        let names: BTreeSet<&str> = crates.iter().filter_map(|c| c.split(' ').next()).collect();
        assert_eq!(names.len(), crates.len(), "{package}: {crates:#?}");
    }
}
