//! Makes distinct names that are valid in Python and in the computer algebra of the scripts.

use std::collections::HashSet;

/// Words that cannot be names in the written scripts: Python's keywords, the functions and constants
/// of SymPy, and the scripts' own variables.
const RESERVED: [&str; 63] = [
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
    "Rational",
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

/// The names that are in use.
#[derive(Debug)]
pub(crate) struct Identifiers(HashSet<String>);

impl Default for Identifiers {
    fn default() -> Self {
        Self(RESERVED.iter().map(|word| (*word).to_owned()).collect())
    }
}

impl Identifiers {
    /// A new name like `wanted`: characters other than ASCII letters and digits become underscores,
    /// and a number is appended if the name is in use.
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
        assert_eq!(names.give("m{3}"), "m_3_3");
        assert_eq!(names.give("lambda"), "lambda_2");
        assert_eq!(names.give("3rps"), "x_3rps");
    }
}
