//! Specs mutated by bytes, lines and tokens never make the reader panic.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write;

use crate::files::files;
use crate::mutations::{TOKENS, check_report, mutate, mutation};
use proptest::prelude::*;
use proptest::sample::Index;
use regen_codegen::diag::Source;
use regen_codegen::spec::parse;

fn seeds() -> Vec<String> {
    let folders = ["tests/fixtures/oracle", "tests/fixtures/invalid"];
    let paths: Vec<_> = folders.iter().flat_map(|folder| files(folder)).collect();
    assert!(paths.len() > 40);
    let texts = paths
        .iter()
        .map(|path| std::fs::read_to_string(path).unwrap());
    texts.filter(|text| text.len() < 4000).collect()
}

/// Reads a text and checks its errors.
fn parse_without_panic(text: &str) {
    if let Err(report) = parse(&Source::new("fuzz.yaml", text)) {
        check_report(text, &report);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_specs_never_panic(seed in any::<Index>(), mutations in prop::collection::vec(mutation(), 1..6)) {
        let seeds = seeds();
        let text = mutations.iter().fold(seeds[seed.index(seeds.len())].clone(), |text, mutation| mutate(&text, mutation));
        parse_without_panic(&text);
    }

    #[test]
    fn random_tokens_never_panic(tokens in prop::collection::vec(0..TOKENS.len(), 0..60)) {
        let text: String = tokens.iter().map(|token| TOKENS[*token]).collect();
        parse_without_panic(&text);
    }

    #[test]
    fn random_expressions_never_panic(expression in "[-+*/^() .0-9a-eqpisnrt]{0,40}") {
        let head = "name: r\ngeometry: {a: 2, b: ";
        let tail = "}\nlimbs: [{name: l, joints: [{name: q, type: revolute, body: 1, actuated: true}]}]\n";
        parse_without_panic(&format!("{head}{expression}{tail}"));
    }
}

#[test]
fn a_file_over_the_limit_is_refused_before_it_is_read() {
    let text = format!("name: r\n#{}", "x".repeat(1 << 20));
    let report = parse(&Source::new("big.yaml", text)).expect_err("too big");
    assert!(
        report.to_string().contains("the limit is 1048576"),
        "{report}"
    );
}

#[test]
fn wide_files_are_refused_or_read_in_time() {
    // a thousand limbs in one chain; thousands of constants defined by each other, all invalid
    let joint =
        |n: usize| format!("joints: [{{name: q{n}, type: revolute, body: {n}, actuated: true}}]");
    let mut limbs = "name: r\nlimbs:\n".to_owned();
    for n in 1..1000 {
        writeln!(limbs, "- {{name: l{n}, from: {}, {}}}", n + 1, joint(n)).unwrap();
    }
    parse_without_panic(&limbs);
    let mut constants = "name: r\ngeometry:\n  a0: 1\n".to_owned();
    for n in 1..9000 {
        writeln!(constants, "  a{n}: a{} + b{n}", n - 1).unwrap();
    }
    writeln!(constants, "limbs: [{{name: l, {}}}]", joint(1)).unwrap();
    parse_without_panic(&constants);
}
