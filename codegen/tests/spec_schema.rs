//! The JSON Schema of the format.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};

use regen_codegen::spec::schema;

fn robots() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots")
}

/// With `REGEN_UPDATE=1` in the environment it is written instead.
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
        "robots/spec.schema.json is stale: run `REGEN_UPDATE=1 cargo test -p regen-codegen --test spec_schema`"
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
