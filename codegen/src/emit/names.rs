//! Identifiers from names and labels.

use std::collections::BTreeSet;

/// Rust keywords, strict and reserved, and the names of every emitted body.
const TAKEN: [&str; 58] = [
    "as",
    "async",
    "await",
    "box",
    "break",
    "const",
    "continue",
    "crate",
    "dyn",
    "else",
    "enum",
    "extern",
    "false",
    "fn",
    "for",
    "gen",
    "if",
    "impl",
    "in",
    "let",
    "loop",
    "match",
    "mod",
    "move",
    "mut",
    "pub",
    "ref",
    "return",
    "self",
    "static",
    "struct",
    "super",
    "trait",
    "true",
    "try",
    "type",
    "union",
    "unsafe",
    "use",
    "where",
    "while",
    "yield",
    "abstract",
    "become",
    "do",
    "final",
    "macro",
    "override",
    "priv",
    "typeof",
    "unsized",
    "virtual",
    "like",
    "condition",
    "margin",
    "found",
    "kept",
    "solved",
];

/// A snake-case identifier that resembles a label: `Fc+(s1.2)` becomes `fc_plus_s1_2`.
pub(super) fn identifier(label: &str) -> String {
    let mut name = String::new();
    for c in label.chars() {
        match c {
            'a'..='z' | '0'..='9' => name.push(c),
            'A'..='Z' => name.push(c.to_ascii_lowercase()),
            '+' => name.push_str("_plus"),
            '-' => name.push_str("_minus"),
            _ if name.ends_with('_') => {}
            _ => name.push('_'),
        }
    }
    let name = name.trim_matches('_');
    match name.chars().next() {
        None => "v".to_owned(),
        Some('0'..='9') => format!("v{name}"),
        Some(_) => name.to_owned(),
    }
}

/// A type's name from a module's: `rps3` becomes `Rps3`, `puma_560` `Puma560`.
pub(super) fn type_name(module: &str) -> String {
    let parts = module.split('_').filter(|p| !p.is_empty());
    let name: String = parts
        .map(|part| {
            let mut chars = part.chars();
            let first = chars.next().map(|c| c.to_ascii_uppercase());
            first.into_iter().chain(chars).collect::<String>()
        })
        .collect();
    if IMPORTED.contains(&name.as_str()) {
        format!("{name}Robot")
    } else if name.is_empty() {
        "Robot".to_owned()
    } else {
        name
    }
}

/// What a module imports, and its type parameter.
const IMPORTED: [&str; 12] = [
    "BaseInfo",
    "BaseModel",
    "BaseParameter",
    "BaseTerm",
    "Certificate",
    "Condition",
    "Cut",
    "Info",
    "Model",
    "Scalar",
    "SizeError",
    "T",
];

/// A number as Rust text; exact constants may be too large for a double.
pub(super) fn literal(value: f64) -> String {
    if value.is_finite() {
        format!("{value:?}")
    } else if value.is_nan() {
        "f64::NAN".to_owned()
    } else if value > 0.0 {
        "f64::INFINITY".to_owned()
    } else {
        "f64::NEG_INFINITY".to_owned()
    }
}

/// Hands out each identifier once.
#[derive(Debug)]
pub(super) struct Names {
    used: BTreeSet<String>,
}

impl Names {
    pub(super) fn new() -> Self {
        Names {
            used: TAKEN.iter().map(|s| (*s).to_owned()).collect(),
        }
    }

    /// Keeps a name that stands already.
    pub(super) fn reserve(&mut self, name: &str) {
        self.used.insert(name.to_owned());
    }

    /// The wish itself, or with a number behind where it is taken.
    pub(super) fn unique(&mut self, wish: &str) -> String {
        let mut name = wish.to_owned();
        let mut number = 2;
        while !self.used.insert(name.clone()) {
            name = format!("{wish}_{number}");
            number += 1;
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_become_snake_case_identifiers() {
        for (label, name) in [
            ("Ixx(3)", "ixx_3"),
            ("Fc+(s1.2)", "fc_plus_s1_2"),
            ("s1.1'", "s1_1"),
            ("3", "v3"),
            ("()", "v"),
        ] {
            assert_eq!(identifier(label), name);
        }
    }

    #[test]
    fn every_number_is_rust() {
        let numbers = [1.0, -1e-300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
        assert_eq!(
            numbers.map(literal),
            [
                "1.0",
                "-1e-300",
                "f64::INFINITY",
                "f64::NEG_INFINITY",
                "f64::NAN"
            ]
        );
    }

    #[test]
    fn a_robot_named_like_an_import_gets_a_type_of_its_own() {
        assert_eq!(type_name("rps3"), "Rps3");
        assert_eq!(type_name("puma_560"), "Puma560");
        assert_eq!(type_name("scalar"), "ScalarRobot");
        assert_eq!(type_name("size_error"), "SizeErrorRobot");
        assert_eq!(type_name("_"), "Robot");
    }

    #[test]
    fn a_name_is_never_given_twice() {
        let mut names = Names::new();
        assert_eq!(names.unique("a"), "a");
        assert_eq!(names.unique("a"), "a_2");
        assert_eq!(names.unique("a"), "a_3");
        assert_eq!(names.unique("if"), "if_2");
    }
}
