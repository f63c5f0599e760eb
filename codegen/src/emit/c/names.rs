//! Names, numbers and texts in emitted C: valid in C99 and in C++.

use std::fmt::Write as _;

/// Words that C or C++ does not permit as names, macros of compilers, and names that emitted bodies
/// use.
pub(super) const RESERVED: &[&str] = &[
    // C99 to C23
    "alignas",
    "alignof",
    "asm",
    "auto",
    "bool",
    "break",
    "case",
    "char",
    "const",
    "constexpr",
    "continue",
    "default",
    "do",
    "double",
    "else",
    "enum",
    "extern",
    "false",
    "float",
    "for",
    "goto",
    "if",
    "inline",
    "int",
    "long",
    "nullptr",
    "register",
    "restrict",
    "return",
    "short",
    "signed",
    "sizeof",
    "static",
    "static_assert",
    "struct",
    "switch",
    "thread_local",
    "true",
    "typedef",
    "typeof",
    "typeof_unqual",
    "union",
    "unsigned",
    "void",
    "volatile",
    "while",
    // C++
    "and",
    "and_eq",
    "atomic_cancel",
    "atomic_commit",
    "atomic_noexcept",
    "bitand",
    "bitor",
    "catch",
    "char16_t",
    "char32_t",
    "char8_t",
    "class",
    "co_await",
    "co_return",
    "co_yield",
    "compl",
    "concept",
    "const_cast",
    "consteval",
    "constinit",
    "decltype",
    "delete",
    "dynamic_cast",
    "explicit",
    "export",
    "friend",
    "module",
    "mutable",
    "namespace",
    "new",
    "noexcept",
    "not",
    "not_eq",
    "operator",
    "or",
    "or_eq",
    "private",
    "protected",
    "public",
    "reflexpr",
    "reinterpret_cast",
    "requires",
    "static_cast",
    "synchronized",
    "template",
    "this",
    "throw",
    "try",
    "typeid",
    "typename",
    "using",
    "virtual",
    "wchar_t",
    "xor",
    "xor_eq",
    "import",
    "override",
    "final",
    // macros of compilers and of <math.h>, types of <stdint.h>
    "linux",
    "unix",
    "i386",
    "arm",
    "mips",
    "sparc",
    "sun",
    "near",
    "far",
    "errno",
    "int8_t",
    "int16_t",
    "int32_t",
    "int64_t",
    "uint8_t",
    "uint16_t",
    "uint32_t",
    "uint64_t",
    "isnan",
    "isinf",
    "isfinite",
    "isnormal",
    "signbit",
    "fpclassify",
    "isgreater",
    "isless",
    "isunordered",
    // functions and names of emitted bodies
    "sin",
    "cos",
    "sqrt",
    "sinf",
    "cosf",
    "sqrtf",
    "condition",
];

/// Headers of the C library: compilers would include a robot's header of such a name instead.
const HEADERS: [&str; 29] = [
    "assert",
    "complex",
    "ctype",
    "errno",
    "fenv",
    "float",
    "inttypes",
    "iso646",
    "limits",
    "locale",
    "math",
    "setjmp",
    "signal",
    "stdalign",
    "stdarg",
    "stdatomic",
    "stdbit",
    "stdbool",
    "stdckdint",
    "stddef",
    "stdint",
    "stdio",
    "stdlib",
    "stdnoreturn",
    "string",
    "tgmath",
    "threads",
    "time",
    "uchar",
];

/// What the names of a robot's functions and files begin with: the robot's name in snake case.
/// Names that C reserves, with `_` at the beginning or twice, are avoided.
pub(super) fn prefix(robot: &str) -> String {
    let parts = robot.split('_').filter(|part| !part.is_empty());
    let name = parts.collect::<Vec<_>>().join("_").to_ascii_lowercase();
    if name.is_empty() {
        "robot".to_owned()
    } else if robot.starts_with('_') {
        format!("robot_{name}")
    } else {
        name
    }
}

/// Whether a header of this name would hide one of the C library.
pub(super) fn hides_header(stem: &str) -> bool {
    HEADERS.contains(&stem) || matches!(stem, "wchar" | "wctype")
}

/// A number as C text: `INFINITY` for exact constants that are too large for a `double`.
pub(super) fn literal(value: f64) -> String {
    if value.is_finite() {
        format!("{value:?}")
    } else {
        beyond(value)
    }
}

/// A number in single precision as C text, rounded from double precision.
pub(super) fn literal_f(value: f64) -> String {
    let value = value as f32;
    if value.is_finite() {
        format!("{value:?}f")
    } else {
        beyond(f64::from(value))
    }
}

/// The macros of `<math.h>` for what is not a finite number.
fn beyond(value: f64) -> String {
    let name = if value.is_nan() {
        "NAN"
    } else if value > 0.0 {
        "INFINITY"
    } else {
        "-INFINITY"
    };
    name.to_owned()
}

/// A text as a string literal. Bytes that are not printable ASCII are escaped, and so are question
/// marks, which begin trigraphs.
pub(super) fn string(text: &str) -> String {
    let mut out = String::from("\"");
    for byte in text.bytes() {
        match byte {
            b'"' | b'\\' | b'?' => {
                out.push('\\');
                out.push(char::from(byte));
            }
            b' '..=b'~' => out.push(char::from(byte)),
            _ => {
                let _ = write!(out, "\\{byte:03o}");
            }
        }
    }
    out.push('"');
    out
}

/// A text that can stand in a comment, on one line.
pub(super) fn comment(text: &str) -> String {
    let line: String = text
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    line.replace('\\', "/")
        .replace("??", "? ?")
        .replace("*/", "* /")
        .replace("/*", "/ *")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_are_snake_case_and_not_reserved() {
        for (robot, name) in [
            ("rps3", "rps3"),
            ("HOME", "home"),
            ("_3rps", "robot_3rps"),
            ("_", "robot"),
            ("a__b_", "a_b"),
        ] {
            assert_eq!(prefix(robot), name);
        }
    }

    #[test]
    fn every_number_is_c_in_both_precisions() {
        let numbers = [1.0, -1e-300, 0.1, f64::INFINITY, f64::NAN];
        assert_eq!(
            numbers.map(literal),
            ["1.0", "-1e-300", "0.1", "INFINITY", "NAN"]
        );
        assert_eq!(
            numbers.map(literal_f),
            ["1.0f", "-0.0f", "0.1f", "INFINITY", "NAN"]
        );
    }

    #[test]
    fn no_text_ends_its_comment_or_its_string() {
        assert_eq!(comment("a */ b\n??/\\"), "a * / b ? ?//");
        assert_eq!(string("\"\\??é\n"), r#""\"\\\?\?\303\251\012""#);
    }
}
