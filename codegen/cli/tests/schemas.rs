//! `regen schema --of COMMAND`: the schemas describe what commands print.
//!
//! Every run of a test of this program with JSON as its output is checked against its schema by
//! `common::regen`. A new key of an output is described in `codegen/report/src/documents`.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;

use regen_report::documents::Document;
use serde_json::{Value, json};

use crate::common::shape::misfits;
use crate::common::{pendulum, regen, root, scratch};

#[test]
fn each_command_with_json_has_a_schema_and_each_schema_a_command() {
    let dir = scratch("schemas");
    let help = regen(&dir, &["--help"]).ended(0).out;
    let commands = help.split("Commands:").nth(1).unwrap();
    let commands = commands.split("Arguments:").next().unwrap().lines();
    let named = commands.filter_map(|line| {
        let name = line.strip_prefix("  ")?.split(' ').next()?;
        (!name.is_empty() && name != "help").then(|| name.to_owned())
    });
    let mut with_json = vec!["model".to_owned()];
    for name in named {
        let help = regen(&dir, &[&name, "--help"]).ended(0).out;
        if help.contains("--format <") && help.contains("json:") {
            with_json.push(name);
        }
    }
    with_json.sort();
    let mut described: Vec<&str> = Document::ALL.iter().map(|d| d.name()).collect();
    described.sort_unstable();
    assert_eq!(with_json, described);
    for name in described {
        let schema = regen(&dir, &["schema", "--of", name]).ended(0).json();
        let id = schema["$id"].as_str().unwrap();
        assert!(id.starts_with(&format!("urn:regen:{name}:")), "{id}");
    }
    regen(&dir, &["schema", "--of", "absent"]).ended(2);
}

/// The commands that no other test of this program runs with JSON, or not with these options.
#[test]
fn printed_json_fits_the_schemas_of_the_commands() {
    let dir = scratch("schemas_printed");
    fs::write(dir.join("arm.yaml"), pendulum("arm")).unwrap();
    let guide = root().join("runtime/guide/fivebar");
    for name in ["fivebar.yaml", "run1.csv", "run2.csv", "runs.yaml"] {
        fs::copy(guide.join(name), dir.join(name)).unwrap();
    }
    let five = "fivebar.yaml";
    let fourier = ["--fourier", "0.2,5"];
    for (words, options) in [
        (vec!["new", "own", "--kind", "planar"], &[][..]),
        (vec!["check", "arm.yaml"], &[]),
        (vec!["base", "arm.yaml"], &[]),
        (vec!["verify", "arm.yaml"], &[]),
        (vec!["arm.yaml", "--out", "."], &[]),
        (vec!["identify", five, "runs.yaml", "--out", "p.json"], &[]),
        (
            vec![
                "identify",
                five,
                "run1.csv",
                "run2.csv",
                "--feasible",
                "--cross",
            ],
            &fourier,
        ),
        (vec!["identify", five, "run1.csv", "--reduce"], &fourier),
        (vec!["identify", five, "run1.csv", "--iv"], &fourier),
        (vec!["validate", five, "p.json", "runs.yaml"], &[]),
        (
            vec!["observe", five, "run1.csv", "--out", "f.json"],
            &fourier,
        ),
        (vec!["inspect", "run1.csv"], &[]),
        (vec!["inspect", "run1.csv", "--spec", five], &[]),
    ] {
        let words = [&words[..], options, &["--format", "json"]].concat();
        // `regen` of these tests compares the output with its schema
        let printed = regen(&dir, &words).ended(0).json();
        // only the fit of a physical model prints how far it may be from its optimum
        let gap = printed["gap"].as_f64();
        assert_eq!(gap.is_some(), words.contains(&"--feasible"), "{words:?}");
        assert!(gap.is_none_or(|gap| (0.0..1e-6).contains(&gap)), "{gap:?}");
    }
}

#[test]
fn misfits_of_a_schema_are_reported() {
    let schema: Value = serde_json::from_str(Document::Info.schema()).unwrap();
    let dir = scratch("schemas_misfits");
    fs::write(dir.join("arm.yaml"), pendulum("arm")).unwrap();
    let good = regen(&dir, &["info", "arm.yaml", "--format", "json"]).json();
    assert_eq!(misfits(&schema, &good), [""; 0]);
    let wrong = |change: &dyn Fn(&mut Value)| {
        let mut value = good.clone();
        change(&mut value);
        misfits(&schema, &value)
    };
    for (found, expected) in [
        (wrong(&|v| v["dof"] = json!(1.5)), "$.dof: 1.5 is no"),
        (wrong(&|v| v["robot"] = json!(null)), "$.robot: null is no"),
        (wrong(&|v| v["more"] = json!(1)), "$.more is not described"),
        (
            wrong(&|v| v["cuts"] = json!([{"name": "x"}])),
            "$.cuts[0]: rows is missing",
        ),
        (
            wrong(&|v| {
                v.as_object_mut().unwrap().remove("dof");
            }),
            "$: dof is missing",
        ),
    ] {
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].starts_with(expected), "{found:?}");
    }
}
