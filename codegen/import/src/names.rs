//! Names of the file as names of a spec.

use std::collections::BTreeSet;

/// Words that mean something else where names stand.
const TAKEN: [&str; 12] = [
    "world", "pi", "sqrt", "sin", "cos", "tan", "deg", "null", "true", "false", "Null", "NULL",
];

/// Words that no module can be called.
const KEYWORDS: [&str; 52] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
    "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
    "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "self", "Self", "static", "struct", "super", "trait", "true", "try", "type",
    "typeof", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

/// The nearest name: letters, digits and underscores, no digit first.
pub(crate) fn mended(name: &str) -> String {
    let keep = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let mut mended: String = name.chars().map(keep).collect();
    if mended.is_empty() || mended.starts_with(|c: char| c.is_ascii_digit()) {
        mended.insert(0, '_');
    }
    if TAKEN.contains(&mended.as_str()) {
        mended.push('_');
    }
    mended
}

/// The nearest name of a module.
pub(crate) fn module(name: &str) -> String {
    let mut mended = mended(name);
    if KEYWORDS.contains(&mended.as_str()) || mended.chars().all(|c| c == '_') {
        mended.insert_str(0, "robot_");
    }
    mended
}

/// Names given so far, each once.
#[derive(Debug, Default)]
pub(crate) struct Names(BTreeSet<String>);

impl Names {
    /// The nearest name that is not given yet.
    pub(crate) fn give(&mut self, name: &str) -> String {
        let first = mended(name);
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
    fn names_are_mended_once_each() {
        let mut names = Names::default();
        assert_eq!(names.give("robot0:WRJ-1"), "robot0_WRJ_1");
        assert_eq!(names.give("robot0 WRJ 1"), "robot0_WRJ_1_2");
        assert_eq!(names.give("2f85"), "_2f85");
        assert_eq!(names.give("world"), "world_");
        assert_eq!(module("match"), "robot_match");
        assert_eq!(module("2f85"), "_2f85");
    }
}
