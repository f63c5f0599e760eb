//! Bad input never panics: specs mutated by bytes, lines and tokens.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write;
use std::path::Path;

use proptest::prelude::*;
use proptest::sample::Index;
use regen_codegen::diag::Source;
use regen_codegen::spec::parse;

fn seeds() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut paths = Vec::new();
    for folder in ["tests/oracle", "robots/invalid"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path
                .extension()
                .is_some_and(|extension| extension == "yaml")
            {
                paths.push(path);
            }
        }
    }
    paths.sort();
    assert!(paths.len() > 40);
    let texts = paths
        .iter()
        .map(|path| std::fs::read_to_string(path).unwrap());
    texts.filter(|text| text.len() < 4000).collect()
}

/// Pieces that matter to YAML or to expressions.
const TOKENS: &[&str] = &[
    "{", "}", "[", "]", ":", ": ", ",", "- ", "\n", "\n  ", "#", "'", "\"", "&x ", "*x", "<<: ",
    "!!int ", "---\n", "|", ">", "? ", "\t", "\r\n", "%", "@", "`", "\u{feff}", "é", "−", "0",
    "1e999", "1e-400", "/0", "^", "^-1", "(", ")", "sqrt(", "pi", "q1", "s1.1", "world", "null",
    "~", "true", "name", "type", "body", "01", "..", ".inf", "\\", "\u{0}", "\u{2028}",
];

#[derive(Clone, Debug)]
enum Mutation {
    Insert(Index, usize),
    Delete(Index, usize),
    Replace(Index, char),
    SwapLines(Index, Index),
    DropLine(Index),
    Repeat(Index, Index),
    SwapWords(Index, Index),
}

fn mutation() -> impl Strategy<Value = Mutation> {
    prop_oneof![
        (any::<Index>(), 0..TOKENS.len()).prop_map(|(at, token)| Mutation::Insert(at, token)),
        (any::<Index>(), 1..20_usize).prop_map(|(at, count)| Mutation::Delete(at, count)),
        (any::<Index>(), any::<char>()).prop_map(|(at, c)| Mutation::Replace(at, c)),
        (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Mutation::SwapLines(a, b)),
        any::<Index>().prop_map(Mutation::DropLine),
        (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Mutation::Repeat(a, b)),
        (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Mutation::SwapWords(a, b)),
    ]
}

fn swap(parts: Vec<&str>, a: Index, b: Index, joint: &str) -> String {
    let mut parts = parts;
    if !parts.is_empty() {
        let (a, b) = (a.index(parts.len()), b.index(parts.len()));
        parts.swap(a, b);
    }
    parts.join(joint)
}

fn mutate(text: &str, mutation: &Mutation) -> String {
    let mut characters: Vec<char> = text.chars().collect();
    let size = characters.len() + 1;
    match *mutation {
        Mutation::Insert(at, token) => {
            let at = at.index(size);
            characters.splice(at..at, TOKENS[token].chars());
        }
        Mutation::Delete(at, count) => {
            let at = at.index(size);
            let end = (at + count).min(characters.len());
            characters.drain(at..end);
        }
        Mutation::Replace(at, c) => {
            if let Some(place) = characters.get_mut(at.index(size)) {
                *place = c;
            }
        }
        Mutation::Repeat(a, b) => {
            let (a, b) = (a.index(size), b.index(size));
            let piece = characters[a.min(b)..a.max(b)].to_vec();
            characters.splice(a..a, piece);
        }
        Mutation::SwapLines(a, b) => return swap(text.split('\n').collect(), a, b, "\n"),
        Mutation::DropLine(at) => {
            let mut lines: Vec<&str> = text.split('\n').collect();
            lines.remove(at.index(lines.len()));
            return lines.join("\n");
        }
        Mutation::SwapWords(a, b) => return swap(text.split(' ').collect(), a, b, " "),
    }
    characters.into_iter().collect()
}

/// Reads a text and shows its errors, whose places must be in it.
fn survive(text: &str) {
    let source = Source::new("fuzz.yaml", text);
    let Err(report) = parse(&source) else {
        return;
    };
    assert!(!report.diagnostics.is_empty());
    for shown in report.shown() {
        let diagnostic = shown.diagnostic();
        let spans = std::iter::once(diagnostic.span)
            .chain(diagnostic.secondary.iter().map(|(span, _)| *span));
        for span in spans {
            assert!(text.get(span.start..span.end).is_some(), "{diagnostic:?}");
        }
        assert!(shown.line() <= text.split('\n').count());
        assert!(!diagnostic.headline().contains('\n'), "{diagnostic:?}");
    }
    assert!(report.render(false).contains("error"));
    assert!(!report.to_string().is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_specs_never_panic(seed in any::<Index>(), mutations in prop::collection::vec(mutation(), 1..6)) {
        let seeds = seeds();
        let text = mutations.iter().fold(seeds[seed.index(seeds.len())].clone(), |text, mutation| mutate(&text, mutation));
        survive(&text);
    }

    #[test]
    fn random_tokens_never_panic(tokens in prop::collection::vec(0..TOKENS.len(), 0..60)) {
        let text: String = tokens.iter().map(|token| TOKENS[*token]).collect();
        survive(&text);
    }

    #[test]
    fn random_expressions_never_panic(expression in "[-+*/^() .0-9a-eqpisnrt]{0,40}") {
        let head = "name: r\ngeometry: {a: 2, b: ";
        let tail = "}\nlimbs: [{name: l, joints: [{name: q, type: revolute, body: 1, actuated: true}]}]\n";
        survive(&format!("{head}{expression}{tail}"));
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
    // thousands of limbs in one chain, of constants in terms of each other, of errors
    let joint =
        |n: usize| format!("joints: [{{name: q{n}, type: revolute, body: {n}, actuated: true}}]");
    let mut limbs = "name: r\nlimbs:\n".to_owned();
    for n in 1..1000 {
        writeln!(limbs, "- {{name: l{n}, from: {}, {}}}", n + 1, joint(n)).unwrap();
    }
    survive(&limbs);
    let mut constants = "name: r\ngeometry:\n  a0: 1\n".to_owned();
    for n in 1..9000 {
        writeln!(constants, "  a{n}: a{} + b{n}", n - 1).unwrap();
    }
    writeln!(constants, "limbs: [{{name: l, {}}}]", joint(1)).unwrap();
    survive(&constants);
}
