//! Conversion of the file's names into names of a spec.

use std::collections::BTreeSet;

/// Words that have another meaning where a spec expects names.
const RESERVED_WORDS: [&str; 12] = [
    "world", "pi", "sqrt", "sin", "cos", "tan", "deg", "null", "true", "false", "Null", "NULL",
];

/// Rust's keywords, which cannot be names of modules.
const KEYWORDS: [&str; 52] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
    "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
    "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "self", "Self", "static", "struct", "super", "trait", "true", "try", "type",
    "typeof", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

/// The closest valid name: letters, digits and underscores, not starting with a digit.
pub(crate) fn spec_name(name: &str) -> String {
    let keep = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let mut spec_name: String = name.chars().map(keep).collect();
    if spec_name.is_empty() || spec_name.starts_with(|c: char| c.is_ascii_digit()) {
        spec_name.insert(0, '_');
    }
    if RESERVED_WORDS.contains(&spec_name.as_str()) {
        spec_name.push('_');
    }
    spec_name
}

/// The closest valid name of a module.
pub(crate) fn module(name: &str) -> String {
    let mut spec_name = spec_name(name);
    if KEYWORDS.contains(&spec_name.as_str()) || spec_name.chars().all(|c| c == '_') {
        spec_name.insert_str(0, "robot_");
    }
    spec_name
}

/// Names used so far; each is used once.
#[derive(Debug, Default)]
pub(crate) struct Names(BTreeSet<String>);

impl Names {
    /// The closest valid name that is not used yet.
    pub(crate) fn give(&mut self, name: &str) -> String {
        let first = spec_name(name);
        let mut given = first.clone();
        let mut count = 1;
        while !self.0.insert(given.clone()) {
            count += 1;
            given = format!("{first}_{count}");
        }
        given
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_valid_and_unique() {
        let mut names = Names::default();
        assert_eq!(names.give("robot0:WRJ-1"), "robot0_WRJ_1");
        assert_eq!(names.give("robot0 WRJ 1"), "robot0_WRJ_1_2");
        assert_eq!(names.give("2f85"), "_2f85");
        assert_eq!(names.give("world"), "world_");
        assert_eq!(module("match"), "robot_match");
        assert_eq!(module("2f85"), "_2f85");
    }
}
