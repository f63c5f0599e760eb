//! The table of the shipped robots in `robots/README.md` has the right numbers.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeMap;

use regen_codegen::diag::Source;
use regen_codegen::pipeline::{BaseSource, derive_with};
use regen_tests::files;

/// The file, and the numbers of degrees of freedom, bodies and base parameters, of every row.
fn table() -> BTreeMap<String, [usize; 3]> {
    let text = std::fs::read_to_string(files::robots().join("README.md")).unwrap();
    let rows = text.lines().filter(|line| line.starts_with("| ["));
    let parsed = rows.map(|line| {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let (name, rest) = cells[1]
            .strip_prefix("[`")
            .unwrap()
            .split_once("`](")
            .unwrap();
        assert_eq!(rest, format!("{name}.yaml)"));
        let number = |i: usize| cells[i].parse::<usize>().unwrap();
        (name.to_owned(), [number(3), number(4), number(5)])
    });
    parsed.collect()
}

#[test]
fn every_robot_has_its_row_with_its_numbers() {
    let mut rows = table();
    for path in files::list(&files::robots(), "yaml").unwrap() {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path).unwrap();
        let mechanism = files::mechanism(&path).unwrap();
        // Stored base parameters have a test of their own.
        let stored = std::fs::read_to_string(path.with_extension("base")).ok();
        let from = stored
            .as_deref()
            .map_or(BaseSource::Derivation, |s| BaseSource::Store(Some(s)));
        let derived = derive_with(&Source::new(name.clone(), text), from).unwrap();
        let rank = derived.analysis.unwrap().base.rank();
        let row = rows.remove(&name).expect(&name);
        assert_eq!(
            row,
            [mechanism.dof(), mechanism.bodies.len(), rank],
            "{name}"
        );
    }
    assert!(rows.is_empty(), "rows without a robot: {rows:?}");
}
