//! Spells the documentation of functions and arguments in C's names.

use crate::robot::Robot;

use super::names::prefix;

/// How the names of a robot are spelled.
#[derive(Debug)]
pub(super) struct Spelling {
    /// What names of functions and constants begin with.
    pub(super) prefix: String,
    /// What names of macros begin with.
    pub(super) macros: String,
}

impl Spelling {
    pub(super) fn of(robot: &Robot) -> Self {
        let prefix = prefix(&robot.name);
        Self {
            macros: prefix.to_ascii_uppercase(),
            prefix,
        }
    }

    /// The documentation of a function, whose constants are written in capitals between back quotes
    /// and whose entries of matrices have two subscripts: constants get the robot's prefix, and
    /// `w[c][r]` the one subscript that it has in an array whose inner length is `inner`.
    pub(super) fn spell(&self, doc: &str, inner: Option<usize>) -> String {
        let mut out = String::new();
        for (index, part) in doc.split('`').enumerate() {
            if index % 2 == 0 {
                out.push_str(part);
            } else {
                out.push_str(&self.code(part, inner));
            }
        }
        out
    }

    fn code(&self, code: &str, inner: Option<usize>) -> String {
        let word = code.split('[').next().unwrap_or(code);
        if word == "INFO.cones" {
            return format!("{}_cone_names", self.prefix);
        }
        if word.len() > 1 && word.chars().all(|c| c.is_ascii_uppercase() || c == '_') {
            let rest = code.get(word.len()..).unwrap_or("");
            return format!("{}_{}{rest}", self.prefix, word.to_ascii_lowercase());
        }
        if let (Some(inner), Some((array, subscripts))) = (inner, code.split_once('['))
            && let Some((outer, last)) = subscripts.split_once("][")
        {
            return format!("{array}[{inner} * {outer} + {last}");
        }
        code.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signature::{Argument, FunctionKind};

    fn spelling() -> Spelling {
        Spelling {
            prefix: "arm".to_owned(),
            macros: "ARM".to_owned(),
        }
    }

    #[test]
    fn constants_and_subscripts_are_those_of_c() {
        let doc = "`w[c][r]` multiplies `PARAMETERS[c]` in the order of `INFO.cones` and `BASE`";
        assert_eq!(
            spelling().spell(doc, Some(6)),
            "w[6 * c + r] multiplies arm_parameters[c] in the order of arm_cone_names and arm_base"
        );
        assert_eq!(spelling().spell("C(q, qd) `phi`", None), "C(q, qd) phi");
    }

    #[test]
    fn no_documentation_keeps_a_name_of_another_language() {
        let mut docs: Vec<&str> = Argument::ALL.iter().map(|a| a.row().doc).collect();
        for kind in FunctionKind::ALL {
            let signature = kind.signature();
            docs.extend([signature.formula, signature.output_doc]);
        }
        for doc in docs {
            let spelled = spelling().spell(doc, Some(3));
            for name in [
                "PARAMETERS",
                "DEPENDENT",
                "ACTUATED",
                "BASE",
                "FREE",
                "BODIES",
                "INFO",
                "][",
                "`",
            ] {
                assert!(!spelled.contains(name), "{spelled}");
            }
        }
    }
}
