//! Makes identifiers from names and labels.

use std::collections::BTreeSet;

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

/// The identifiers in use, so that each value gets its own.
#[derive(Debug)]
pub(super) struct Names {
    used: BTreeSet<String>,
}

impl Names {
    /// `reserved`: the words that a language does not permit as names, and the names that every
    /// emitted body uses.
    pub(super) fn new(reserved: &[&str]) -> Self {
        Names {
            used: reserved.iter().map(|s| (*s).to_owned()).collect(),
        }
    }

    /// Reserves a name that is used already.
    pub(super) fn reserve(&mut self, name: &str) {
        self.used.insert(name.to_owned());
    }

    /// The name `preferred`, with a number appended if it is taken.
    pub(super) fn unique(&mut self, preferred: &str) -> String {
        let mut name = preferred.to_owned();
        let mut number = 2;
        while !self.used.insert(name.clone()) {
            name = format!("{preferred}_{number}");
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
    fn a_name_is_never_given_twice() {
        let mut names = Names::new(&["if"]);
        assert_eq!(names.unique("a"), "a");
        assert_eq!(names.unique("a"), "a_2");
        assert_eq!(names.unique("a"), "a_3");
        assert_eq!(names.unique("if"), "if_2");
    }
}
