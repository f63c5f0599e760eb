//! The structure of emitted functions, which decides whether the compiler can process them: rustc's
//! debug-information writer overflows its stack at some thousands of variables in a scope.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;

use crate::files::files;
use regen_codegen::diag::Source;
use regen_codegen::emit::{Options, module};
use regen_codegen::pipeline::{BaseSource, derive_with};

/// Largest number of variables in a scope.
const MAX_VARIABLES: usize = 800;

/// The emitted module without base parameters, whose functions are smaller than the others.
fn emit(text: &str) -> String {
    let source = Source::new("robot.yaml", text);
    let robot =
        derive_with(&source, BaseSource::Skip).unwrap_or_else(|problem| panic!("{problem:?}"));
    module(&robot, &Options::default())
}

/// The tokens of Rust text, without comments and strings.
fn tokens(text: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    for line in text.lines() {
        let code = line.split("//").next().unwrap_or("");
        // every second part is between quotes
        for part in code.split('"').step_by(2) {
            let mut rest = part.trim_start();
            while let Some(first) = rest.chars().next() {
                let word = |c: char| c.is_alphanumeric() || c == '_';
                let end = if word(first) {
                    rest.find(|c| !word(c)).unwrap_or(rest.len())
                } else {
                    first.len_utf8()
                };
                tokens.push(&rest[..end]);
                rest = rest[end..].trim_start();
            }
        }
    }
    tokens
}

/// The largest number of variables that one scope of the text binds.
fn largest_scope(text: &str) -> usize {
    let mut open = vec![0_usize];
    let mut largest = 0;
    let mut tokens = tokens(text).into_iter();
    while let Some(token) = tokens.next() {
        match token {
            "{" => open.push(0),
            "}" => largest = largest.max(open.pop().unwrap()),
            "let" => {
                let pattern = tokens.by_ref().take_while(|token| *token != "=");
                let bound = pattern.filter(|token| {
                    let first = token.chars().next();
                    let name = first.is_some_and(|c| c.is_alphabetic() || c == '_');
                    name && !["_", "mut"].contains(token)
                });
                *open.last_mut().unwrap() += bound.count();
            }
            _ => {}
        }
    }
    assert_eq!(open.len(), 1, "braces do not match");
    largest.max(open[0])
}

#[test]
fn variables_are_counted_scope_by_scope() {
    let text = "fn f() {\n let [a, _, b] = {\n let (c, mut d) = g(\"let x = {\"); // let y = {\n [c, d]\n };\n let e = a;\n}";
    assert_eq!(largest_scope(text), 3);
    let many: String = (0..900).fold("fn f() {".to_owned(), |mut text, i| {
        write!(text, "let t{i} = x;").unwrap();
        text
    });
    assert_eq!(largest_scope(&(many + "}")), 900);
}

/// A chain of 50 coordinates: revolute joints and some spherical ones.
fn chain() -> String {
    let mut text = "name: chain\nlimbs:\n  - name: chain\n    joints:\n".to_owned();
    for joint in 1..=40 {
        let kind = if joint % 8 == 0 {
            "spherical"
        } else {
            "revolute"
        };
        writeln!(
            text,
            "      - {{name: j{joint}, type: {kind}, dh: {{a: 0.1, alpha: pi/5}}, body: {joint}, actuated: true}}"
        )
        .unwrap();
    }
    text
}

/// A platform on twelve legs of variable length, six of which determine its pose.
fn twelve_legs() -> String {
    const LEGS: usize = 12;
    const BASE: f64 = 0.5;
    const PLATFORM: f64 = 0.3;
    const HEIGHT: f64 = 0.6;
    let mut text = "name: twelve_legs\nlimbs:\n".to_owned();
    let (mut cuts, mut home) = ("cuts:\n".to_owned(), "home:\n".to_owned());
    for leg in 0..LEGS {
        // the legs lean to the left and to the right in turn
        let at = 0.5 * leg as f64;
        let lean = if leg % 2 == 0 { 0.4 } else { -0.4 };
        let on_platform = [PLATFORM * (at + lean).cos(), PLATFORM * (at + lean).sin()];
        let [x, y] = [PLATFORM * lean.cos() - BASE, PLATFORM * lean.sin()];
        let length = (x * x + y * y + HEIGHT * HEIGHT).sqrt();
        let (first, second) = ((-y).atan2(HEIGHT), (x / length).asin());
        writeln!(
            text,
            "  - name: leg{leg}\n    base: {{xyz: [{}, {}, 0], rpy: [0, 0, {at}]}}\n    joints:\n      \
             - {{name: u{leg}, type: universal, body: cylinder{leg}}}\n      \
             - {{name: p{leg}, type: prismatic, body: rod{leg}, actuated: true}}",
            BASE * at.cos(),
            BASE * at.sin(),
        )
        .unwrap();
        writeln!(
            home,
            "  u{leg}.1: {first}\n  u{leg}.2: {second}\n  p{leg}: {length}"
        )
        .unwrap();
        if leg == 0 {
            writeln!(
                text,
                "      - {{name: ball, type: spherical}}\n      \
                 - {{name: centre, type: fixed, origin: {{xyz: [{}, {}, 0]}}, body: platform}}",
                -on_platform[0], -on_platform[1],
            )
            .unwrap();
            writeln!(home, "  ball.2: {}\n  ball.3: {}", -second, -first).unwrap();
        } else {
            writeln!(
                cuts,
                "  - {{name: ball{leg}, joint: spherical, between: [{{body: platform, xyz: [{}, {}, 0]}}, {{body: rod{leg}}}]}}",
                on_platform[0], on_platform[1],
            )
            .unwrap();
        }
    }
    format!("{text}{cuts}independent: [p0, p1, p2, p3, p4, p5]\n{home}")
}

#[test]
fn no_scope_of_the_repositorys_robots_has_many_variables() {
    let folders = [
        "robots",
        "tests/fixtures/oracle",
        "tests/fixtures/mechanisms",
    ];
    let paths: Vec<_> = folders.iter().flat_map(|folder| files(folder)).collect();
    assert!(paths.len() > 15);
    for path in paths {
        let text = emit(&std::fs::read_to_string(&path).unwrap());
        let largest = largest_scope(&text);
        assert!(largest <= MAX_VARIABLES, "{}: {largest}", path.display());
    }
}

#[test]
fn large_robots_store_their_values_in_arrays() {
    // the arguments of the first and the results of a solve of the second are too many for separate
    // variables
    for (spec, part) in [(chain(), ", phi["), (twelve_legs(), "let (solved, found)")] {
        let text = emit(&spec);
        for part in [part, " = kept[0];", "mul_add(kept["] {
            assert!(text.contains(part), "{part}");
        }
        let largest = largest_scope(&text);
        assert!(largest <= MAX_VARIABLES, "{largest}");
    }
}

/// Below the diagonal of blocks, all entries of a chain's regressor are zero: a fill replaces
/// thousands of statements. The few zeros of a short chain are stored one by one.
#[test]
fn many_zeros_are_one_fill() {
    let lines = |text: &str| {
        let start = text.find("pub fn regressor<").unwrap();
        let body = text[start..].split("\n}\n").next().unwrap();
        body.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let long = lines(&emit(&chain()));
    assert_eq!(long.len(), 4, "{long:?}");
    assert_eq!(long[2], "    w.fill([zero; 50]);");
    let short = "name: short\nlimbs:\n  - name: arm\n    joints:\n      \
                 - {name: q1, type: revolute, dh: {a: 1}, body: 1, actuated: true}\n      \
                 - {name: q2, type: revolute, body: 2, actuated: true}\n";
    let short = lines(&emit(short));
    assert!(short.iter().all(|line| !line.contains("fill")), "{short:?}");
    assert!(
        short.iter().any(|line| line.contains("][1] = zero;")),
        "{short:?}"
    );
}

#[test]
fn generated_code_does_not_depend_on_earlier_derivations() {
    let paths = files("tests/fixtures/oracle");
    let specs: Vec<String> = paths
        .iter()
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect();
    let forwards: Vec<String> = specs.iter().map(|spec| emit(spec)).collect();
    let elsewhere = std::thread::spawn(move || {
        let backwards = specs.iter().rev().map(|spec| emit(spec));
        backwards.collect::<Vec<String>>()
    });
    let backwards = elsewhere.join().unwrap();
    assert!(forwards.iter().eq(backwards.iter().rev()));
}
