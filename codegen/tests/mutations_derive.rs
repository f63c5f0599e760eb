//! Mutated specs never make the derivation panic, from the text of the spec to Rust.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::files::files;
use crate::mutations::{change, check_report, mutate, mutation};
use proptest::prelude::*;
use proptest::sample::Index;
use regen_codegen::diag::Source;
use regen_codegen::emit::{Options, module};
use regen_codegen::interpret;
use regen_codegen::pipeline::{BaseSource, DeriveError, derive_with};

/// Small robots that are quick to derive.
fn seeds() -> Vec<String> {
    let folders = [
        "robots",
        "tests/fixtures/oracle",
        "tests/fixtures/mechanisms",
        "tests/fixtures/pairs/fourbar",
        "tests/fixtures/pairs/slider_crank",
        "tests/fixtures/pairs/rsur",
        "tests/fixtures/pairs/turntable",
    ];
    let paths: Vec<_> = folders.iter().flat_map(|folder| files(folder)).collect();
    assert!(paths.len() > 20);
    paths
        .iter()
        .filter(|path| !path.ends_with("hexapod.yaml"))
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect()
}

/// Derives the robot that the text describes, emits its module and runs its functions; false if the
/// text is invalid.
fn derive_without_panic(text: &str) -> bool {
    let source = Source::new("fuzz.yaml", text);
    // with base parameters if they are quick to derive, as in the macro
    let robot = match derive_with(&source, BaseSource::Store(None)) {
        Err(DeriveError::NotStored) => derive_with(&source, BaseSource::Skip),
        other => other,
    };
    let robot = match robot {
        Ok(robot) => robot,
        Err(DeriveError::Spec(report)) => {
            check_report(text, &report);
            return false;
        }
        Err(problem) => panic!("{problem:?}"),
    };
    let source = module(&robot, &Options::default());
    // a value that is not finite would not compile
    for word in ["NaN", "inf)", "inf,"] {
        assert!(!source.contains(word), "{word} in\n{source}");
    }
    for function in &robot.functions {
        let arguments = function.program.arguments.iter();
        let arguments: Vec<Vec<f64>> = arguments.map(|a| vec![0.3; a.len]).collect();
        let arguments: Vec<&[f64]> = arguments.iter().map(Vec::as_slice).collect();
        let (values, _) = interpret::run(&function.program, &arguments);
        assert_eq!(
            values.len(),
            function.program.output.shape.iter().product::<usize>()
        );
    }
    true
}

#[test]
fn unmutated_seeds_are_derived() {
    for text in seeds() {
        assert!(derive_without_panic(&text));
    }
}

/// The number of cases; the environment variable `PROPTEST_CASES` increases it.
fn config() -> ProptestConfig {
    let config = ProptestConfig::default();
    let cases = if std::env::var_os("PROPTEST_CASES").is_some() {
        config.cases
    } else {
        100
    };
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..config
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn mutated_specs_are_derived_or_refused(
        seed in any::<Index>(),
        mutations in prop::collection::vec(prop_oneof![1 => mutation(), 2 => change()], 1..4),
    ) {
        let seeds = seeds();
        let seed = seeds[seed.index(seeds.len())].clone();
        let text = mutations.iter().fold(seed, |text, mutation| mutate(&text, mutation));
        derive_without_panic(&text);
    }
}
