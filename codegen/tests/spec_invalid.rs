//! Invalid specs: all errors in tests/fixtures/invalid, as they are printed.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};

use regen_codegen::diag::Source;
use regen_codegen::spec::parse;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn files() -> Vec<String> {
    let folder = std::fs::read_dir(root().join("tests/fixtures/invalid")).unwrap();
    let mut names: Vec<String> = folder
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn source(file: &str) -> Source {
    let name = format!("tests/fixtures/invalid/{file}");
    let text = std::fs::read_to_string(root().join(&name)).unwrap();
    // line ends that git changed on Windows give the same result
    Source::new(name, text.replace("\r\n", "\n"))
}

#[test]
fn every_invalid_file_is_refused_with_these_words() {
    let files = files();
    assert!(files.len() >= 45, "files are missing: {files:?}");
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("snapshots/invalid");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    let _guard = settings.bind_to_scope();
    for file in files {
        let report = parse(&source(&file)).expect_err(&file);
        insta::assert_snapshot!(file.trim_end_matches(".yaml"), report.render(false));
    }
}

#[test]
fn every_shown_error_belongs_to_a_file() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots/invalid");
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let file = name.trim_end_matches(".new").replace(".snap", ".yaml");
        assert!(
            files().contains(&file),
            "tests/fixtures/invalid/{file} is gone, its errors are not"
        );
    }
}

#[test]
fn plain_text_names_file_line_column_and_path() {
    let report = parse(&source("shape_unknown_joint_type.yaml")).expect_err("invalid");
    let text = report.to_string();
    let line = text.lines().nth(1).unwrap();
    assert!(
        line.starts_with(
            "tests/fixtures/invalid/shape_unknown_joint_type.yaml:9:26: \
             limb 'limb2', joint 'q7': unknown joint type 'prismtic'; did you mean 'prismatic'?"
        ),
        "{line}"
    );
    let second = report.shown().nth(1).unwrap();
    assert_eq!((second.line(), second.column()), (9, 26));
}

#[test]
fn color_changes_nothing_but_color() {
    let report = parse(&source("names_duplicates.yaml")).expect_err("invalid");
    let colored = report.render(true);
    assert!(colored.contains("\u{1b}["));
    let mut plain = String::new();
    let mut pieces = colored.split("\u{1b}[");
    plain.push_str(pieces.next().unwrap());
    for piece in pieces {
        plain.push_str(piece.split_once('m').unwrap().1);
    }
    assert_eq!(plain, report.render(false));
}
