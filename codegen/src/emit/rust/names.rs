//! Names in emitted Rust: reserved words, the robot's type, and what modules import.

/// Rust keywords, strict and reserved, and the names that every emitted body uses.
pub(super) const RESERVED: [&str; 58] = [
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
    "proto",
    "condition",
    "margin",
    "found",
    "kept",
    "solved",
];

/// The name of a robot's type, from the name of its module: `rps3` becomes `Rps3`, `puma_560`
/// becomes `Puma560`. `Robot` is appended if the name would collide with another one in the module
/// (`joint` becomes `JointRobot`), and put before a name that would begin with a digit.
pub(super) fn type_name(module: &str) -> String {
    let parts = module.split('_').filter(|p| !p.is_empty());
    let name: String = parts
        .map(|part| {
            let mut chars = part.chars();
            let first = chars.next().map(|c| c.to_ascii_uppercase());
            first.into_iter().chain(chars).collect::<String>()
        })
        .collect();
    if is_taken(&name) {
        format!("{name}Robot")
    } else if name.starts_with(|c: char| c.is_ascii_digit()) || name.is_empty() {
        format!("Robot{name}")
    } else {
        name
    }
}

/// Whether a name inside a module refers to something other than the robot's type.
fn is_taken(name: &str) -> bool {
    let lists: [&[&str]; 4] = [&IMPORTS, &BASE_IMPORTS, &CONSTANTS, &LANGUAGE];
    lists.iter().any(|list| list.contains(&name))
}

/// Names that modules import from the runtime; each module imports those that it uses.
pub(super) const IMPORTS: [&str; 16] = [
    "Arguments",
    "Condition",
    "ControlFunction",
    "ControlModel",
    "SwingLimit",
    "Cut",
    "Friction",
    "Function",
    "Info",
    "Joint",
    "Limits",
    "Model",
    "Parameter",
    "Scalar",
    "SizeError",
    "Symbol",
];

/// Further names that modules with base parameters import.
pub(super) const BASE_IMPORTS: [&str; 7] = [
    "BaseFunction",
    "BaseInfo",
    "BaseKernel",
    "BaseModel",
    "BaseParameter",
    "BaseTerm",
    "Certificate",
];

/// Constants of a module that could also be the name of a type, and its type of a geometry. Names with `_` between two letters
/// are missing, because no type has such a name.
const CONSTANTS: [&str; 18] = [
    "ACTUATED",
    "BASE",
    "BODIES",
    "CONES",
    "COORDINATES",
    "DEPENDENT",
    "DIGEST",
    "FRAMES",
    "FREE",
    "GEOMETRY",
    "Geometry",
    "HOME",
    "INDEPENDENT",
    "INFO",
    "JOINTS",
    "NOMINAL",
    "PARAMETERS",
    "ZEROS",
];

/// The type parameter, the keyword that is written like a type, the prelude of the standard library
/// in its newest edition, and the derived traits.
const LANGUAGE: [&str; 47] = [
    "T",
    "Self",
    "AsMut",
    "AsRef",
    "AsyncFn",
    "AsyncFnMut",
    "AsyncFnOnce",
    "Box",
    "Clone",
    "Copy",
    "Debug",
    "Default",
    "DoubleEndedIterator",
    "Drop",
    "Eq",
    "Err",
    "ExactSizeIterator",
    "Extend",
    "Fn",
    "FnMut",
    "FnOnce",
    "From",
    "FromIterator",
    "Future",
    "Hash",
    "Into",
    "IntoFuture",
    "IntoIterator",
    "Iterator",
    "None",
    "Ok",
    "Option",
    "Ord",
    "PartialEq",
    "PartialOrd",
    "Result",
    "Send",
    "Sized",
    "Some",
    "String",
    "Sync",
    "ToOwned",
    "ToString",
    "TryFrom",
    "TryInto",
    "Unpin",
    "Vec",
];

/// A number as Rust text; exact constants may be too large for an `f64`.
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

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(type_name("joint"), "JointRobot");
        assert_eq!(type_name("some"), "SomeRobot");
        assert_eq!(type_name("_self"), "SelfRobot");
        assert_eq!(type_name("HOME"), "HOMERobot");
    }

    #[test]
    fn a_type_s_name_is_an_identifier_whatever_the_robot_s_is() {
        assert_eq!(type_name("_"), "Robot");
        assert_eq!(type_name("_3rps"), "Robot3rps");
    }
}
