//! Mutations of specs by bytes, lines, tokens and numbers, and checks of the resulting errors. Used
//! by the tests of the reader and of the whole derivation.

use proptest::prelude::*;
use proptest::sample::Index;
use regen_codegen::diag::Report;

/// Tokens with a meaning in YAML or in expressions.
pub(crate) const TOKENS: &[&str] = &[
    "{", "}", "[", "]", ":", ": ", ",", "- ", "\n", "\n  ", "#", "'", "\"", "&x ", "*x", "<<: ",
    "!!int ", "---\n", "|", ">", "? ", "\t", "\r\n", "%", "@", "`", "\u{feff}", "é", "−", "0",
    "1e999", "1e-400", "/0", "^", "^-1", "(", ")", "sqrt(", "pi", "q1", "s1.1", "world", "null",
    "~", "true", "name", "type", "body", "01", "..", ".inf", "\\", "\u{0}", "\u{2028}",
];

/// Values that are special for some quantities, and ordinary ones.
const NUMBERS: &[&str] = &[
    "0", "1", "-1", "2", "0.1", "-0.3", "1e-9", "1e9", "1e-300", "1e300", "1/3", "sqrt(2)", "pi/2",
    "-pi/2", "pi", "2*pi", "1/7*pi",
];

/// Kinds that can replace each other in a spec.
const KINDS: &[&str] = &[
    "revolute",
    "prismatic",
    "helical",
    "cylindrical",
    "universal",
    "spherical",
    "fixed",
];

#[derive(Clone, Debug)]
pub(crate) enum Mutation {
    Insert(Index, usize),
    Delete(Index, usize),
    Replace(Index, char),
    SwapLines(Index, Index),
    DropLine(Index),
    Repeat(Index, Index),
    SwapWords(Index, Index),
    Number(Index, usize),
    Kind(Index, usize),
}

/// Any mutation; most of them make the spec invalid.
pub(crate) fn mutation() -> impl Strategy<Value = Mutation> {
    prop_oneof![
        (any::<Index>(), 0..TOKENS.len()).prop_map(|(at, token)| Mutation::Insert(at, token)),
        (any::<Index>(), 1..20_usize).prop_map(|(at, count)| Mutation::Delete(at, count)),
        (any::<Index>(), any::<char>()).prop_map(|(at, c)| Mutation::Replace(at, c)),
        (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Mutation::SwapLines(a, b)),
        any::<Index>().prop_map(Mutation::DropLine),
        (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Mutation::Repeat(a, b)),
        (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Mutation::SwapWords(a, b)),
        change(),
    ]
}

/// A mutation that keeps the grammar: other numbers, other kinds.
pub(crate) fn change() -> impl Strategy<Value = Mutation> {
    prop_oneof![
        3 => (any::<Index>(), 0..NUMBERS.len())
            .prop_map(|(at, number)| Mutation::Number(at, number)),
        1 => (any::<Index>(), 0..KINDS.len()).prop_map(|(at, kind)| Mutation::Kind(at, kind)),
    ]
}

/// Replaces one of the kinds in the text by another.
fn other_kind(text: &str, at: Index, kind: &str) -> String {
    let mut matches: Vec<(usize, &str)> = KINDS
        .iter()
        .flat_map(|kind| text.match_indices(kind))
        .collect();
    matches.sort_unstable();
    if matches.is_empty() {
        return text.to_owned();
    }
    let (start, old) = matches[at.index(matches.len())];
    format!("{}{kind}{}", &text[..start], &text[start + old.len()..])
}

/// Replaces one of the numbers in the text by another.
fn other_number(text: &str, at: Index, number: &str) -> String {
    let bytes = text.as_bytes();
    let digit = |i: usize| {
        bytes
            .get(i)
            .is_some_and(|b| b.is_ascii_digit() || *b == b'.')
    };
    let starts: Vec<usize> = (0..bytes.len())
        .filter(|&i| {
            digit(i) && (i == 0 || !(digit(i - 1) || bytes[i - 1].is_ascii_alphanumeric()))
        })
        .collect();
    if starts.is_empty() {
        return text.to_owned();
    }
    let start = starts[at.index(starts.len())];
    let end = (start..bytes.len())
        .find(|&i| !digit(i))
        .unwrap_or(bytes.len());
    format!("{}{number}{}", &text[..start], &text[end..])
}

fn swap(parts: Vec<&str>, a: Index, b: Index, joint: &str) -> String {
    let mut parts = parts;
    if !parts.is_empty() {
        let (a, b) = (a.index(parts.len()), b.index(parts.len()));
        parts.swap(a, b);
    }
    parts.join(joint)
}

pub(crate) fn mutate(text: &str, mutation: &Mutation) -> String {
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
        Mutation::Kind(at, kind) => return other_kind(text, at, KINDS[kind]),
        Mutation::Number(at, number) => return other_number(text, at, NUMBERS[number]),
    }
    characters.into_iter().collect()
}

/// Asserts that each error has a place inside the text and a message of one line, and can be
/// printed.
pub(crate) fn check_report(text: &str, report: &Report) {
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
