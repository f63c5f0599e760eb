//! The JSON Schema of the format.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};

use regen_codegen::spec::schema;

fn robots() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots")
}

/// With `REGEN_UPDATE=1` in the environment the file is written instead of compared.
#[test]
fn the_schema_beside_the_robots_is_fresh() {
    let path = robots().join("spec.schema.json");
    if std::env::var_os("REGEN_UPDATE").is_some() {
        std::fs::write(&path, schema()).unwrap();
    }
    let written = std::fs::read_to_string(&path)
        .unwrap()
        .replace("\r\n", "\n");
    assert!(
        written == schema(),
        "robots/spec.schema.json is stale: run `REGEN_UPDATE=1 cargo test -p regen-codegen --test all spec_schema`"
    );
}

#[test]
fn every_robot_refers_to_the_schema() {
    for entry in std::fs::read_dir(robots()).unwrap() {
        let path = entry.unwrap().path();
        if path
            .extension()
            .is_some_and(|extension| extension == "yaml")
        {
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(
                text.starts_with("# yaml-language-server: $schema=spec.schema.json"),
                "{}: the first line must name the schema",
                path.display()
            );
        }
    }
}

/// Every `$ref` of a JSON value.
fn references(json: &serde_json::Value, found: &mut Vec<String>) {
    match json {
        serde_json::Value::Object(entries) => {
            for (key, value) in entries {
                match value.as_str() {
                    Some(target) if key == "$ref" => found.push(target.to_owned()),
                    _ => references(value, found),
                }
            }
        }
        serde_json::Value::Array(items) => items.iter().for_each(|item| references(item, found)),
        _ => {}
    }
}

#[test]
fn the_schema_is_json_whose_references_lead_somewhere() {
    let json: serde_json::Value = serde_json::from_str(&schema()).unwrap();
    let mut found = Vec::new();
    references(&json, &mut found);
    assert!(found.len() > 20, "{found:?}");
    for target in found {
        let definition = json.pointer(target.trim_start_matches('#'));
        assert!(
            definition.is_some_and(serde_json::Value::is_object),
            "{target}"
        );
    }
}

#[test]
fn the_schema_describes_every_key_and_closes_every_record() {
    let json: serde_json::Value = serde_json::from_str(&schema()).unwrap();
    let definitions = json["$defs"].as_object().unwrap();
    let mut keys = 0;
    for (name, definition) in definitions {
        let Some(properties) = definition["properties"].as_object() else {
            continue;
        };
        assert_eq!(definition["additionalProperties"], false, "{name}");
        for (key, property) in properties {
            keys += 1;
            assert!(property["description"].is_string(), "{name}, {key}");
        }
    }
    assert_eq!(
        keys, 85,
        "keys were added or lost: adjust this number knowingly"
    );
    assert_eq!(
        definitions["joint"]["properties"]["type"]["$ref"],
        "#/$defs/joint_type"
    );
    assert_eq!(
        definitions["joint_type"]["enum"].as_array().unwrap().len(),
        7
    );
    assert_eq!(
        definitions["limb"]["required"],
        serde_json::json!(["name", "joints"])
    );
}
