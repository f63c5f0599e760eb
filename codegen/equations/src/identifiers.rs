//! Names that are valid in Python, each given once.

use std::collections::HashSet;

/// Words that are no names in the written scripts.
const TAKEN: [&str; 62] = [
    "False",
    "None",
    "True",
    "and",
    "as",
    "assert",
    "async",
    "await",
    "break",
    "class",
    "continue",
    "def",
    "del",
    "elif",
    "else",
    "except",
    "finally",
    "for",
    "from",
    "global",
    "if",
    "import",
    "in",
    "is",
    "lambda",
    "nonlocal",
    "not",
    "or",
    "pass",
    "raise",
    "return",
    "try",
    "while",
    "with",
    "yield",
    "sin",
    "cos",
    "sqrt",
    "sign",
    "Heaviside",
    "Matrix",
    "Symbol",
    "Float",
    "Piecewise",
    "result",
    "terms",
    "lengths",
    "symbols",
    "evaluate",
    "values",
    "print",
    "pi",
    "I",
    "E",
    "S",
    "N",
    "O",
    "Q",
    "C",
    "zoo",
    "nan",
    "oo",
];

/// The names given so far.
#[derive(Debug)]
pub(crate) struct Identifiers(HashSet<String>);

impl Default for Identifiers {
    fn default() -> Self {
        Self(TAKEN.iter().map(|word| (*word).to_owned()).collect())
    }
}

impl Identifiers {
    /// A new name like `wanted`: other characters become underscores, and a number is appended where
    /// the name is taken.
    pub(crate) fn give(&mut self, wanted: &str) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let mut name: String = wanted.chars().map(plain).collect();
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            name.insert_str(0, "x_");
        }
        while name.ends_with('_') && name.len() > 1 {
            name.pop();
        }
        let mut given = name.clone();
        let mut number = 2;
        while !self.0.insert(given.clone()) {
            given = format!("{name}_{number}");
            number += 1;
        }
        given
    }
}

#[cfg(test)]
mod tests {
    use super::Identifiers;

    #[test]
    fn names_are_given_once() {
        let mut names = Identifiers::default();
        assert_eq!(names.give("m(3)"), "m_3");
        assert_eq!(names.give("m[3]"), "m_3_2");
        assert_eq!(names.give("lambda"), "lambda_2");
        assert_eq!(names.give("3rps"), "x_3rps");
    }
}
