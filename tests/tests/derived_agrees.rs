//! The engine's functions, interpreted, agree with the second derivation at random closed states,
//! on robots and on mechanisms chosen to be difficult.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;

use regen_tests::derived::Derived;
use regen_tests::engine::{check_engine, check_pair};
use regen_tests::files;

const STATES: usize = 6;

fn check_folder(folder: &Path) {
    let mut failures = Vec::new();
    for path in files::list(folder, "yaml").unwrap() {
        let mechanism = files::mechanism(&path).unwrap();
        let result = Derived::from_file(&path)
            .and_then(|engine| check_engine(&engine, &mechanism, 7, STATES));
        if let Err(e) = result {
            failures.push(format!("{}: {e}", path.display()));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn robots_agree_with_the_second_derivation() {
    check_folder(&files::robots());
}

#[test]
fn awkward_mechanisms_agree_with_the_second_derivation() {
    check_folder(&files::mechanisms());
}

#[test]
fn both_sides_of_every_pair_agree_with_the_second_derivation() {
    for folder in files::folders(&files::pairs()).unwrap() {
        check_folder(&folder);
    }
}

#[test]
fn opening_a_loop_at_another_joint_gives_the_same_derived_regressor() {
    for folder in files::folders(&files::pairs()).unwrap() {
        let list = files::list(&folder, "yaml").unwrap();
        let specs: Vec<_> = list.iter().map(|f| files::mechanism(f).unwrap()).collect();
        let engines: Vec<_> = list
            .iter()
            .map(|f| Derived::from_file(f).unwrap())
            .collect();
        for (engine, spec) in engines.iter().zip(&specs).skip(1) {
            let first = (&engines[0] as &dyn regen_tests::engine::Engine, &specs[0]);
            check_pair(first, (engine, spec), 11, 3).unwrap();
        }
    }
}
