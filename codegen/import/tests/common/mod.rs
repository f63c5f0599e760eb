//! Import of texts, with the resulting specs, errors and notes.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test binary uses a part of this"
)]
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};

use regen_codegen::diag::Source;
use regen_codegen::spec::{self, Spec};
use regen_import::{Imported, Options, import};

/// The folder of published robot files.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/import")
}

/// A published robot file, unchanged.
pub fn published(file: &str) -> Source {
    let text = std::fs::read_to_string(folder().join(file)).unwrap();
    Source::new(file, text)
}

/// The result of an import, or all errors, one per line.
pub fn attempt(source: &Source, options: &Options) -> Result<Imported, String> {
    let mut no_includes = |_: &str| Err("there is none".to_owned());
    import(source, &mut no_includes, options).map_err(|reports| {
        let lines: Vec<String> = reports.iter().map(ToString::to_string).collect();
        lines.join("\n")
    })
}

#[track_caller]
pub fn imported_with(text: &str, options: &Options) -> Imported {
    attempt(&Source::new("robot.xml", text), options).unwrap_or_else(|e| panic!("{e}"))
}

#[track_caller]
pub fn imported(text: &str) -> Imported {
    imported_with(text, &Options::default())
}

/// The errors of a text that cannot be imported.
#[track_caller]
pub fn refused(text: &str) -> String {
    refused_with(text, &Options::default())
}

#[track_caller]
pub fn refused_with(text: &str, options: &Options) -> String {
    match attempt(&Source::new("robot.xml", text), options) {
        Ok(imported) => panic!("{}", imported.spec),
        Err(complaints) => complaints,
    }
}

/// The spec's text of an import, checked by a derivation.
#[track_caller]
pub fn parsed(text: &str) -> Spec {
    spec::parse(&Source::new("imported.yaml", text)).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The notes of an import, one per line.
pub fn notes(imported: &Imported) -> String {
    let lines: Vec<String> = imported.notes.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

#[track_caller]
pub fn assert_has(text: &str, part: &str) {
    assert!(text.contains(part), "no {part:?} in\n{text}");
}
