//! Scalars of the format: names, labels, expressions, flags.

use std::rc::Rc;

use super::json::{Definitions, Json, defined};
use super::{Reader, Shape};
use crate::diag::{Diagnostic, Span};
use crate::spec::expression::{Ast, Vocabulary, is_reserved, parse};
use crate::spec::yaml::{self, Kind, Node, shorten};

/// A word of the file, with its place and path for later errors about it.
#[derive(Clone, Debug)]
pub(in crate::spec) struct Word {
    pub(in crate::spec) text: String,
    pub(in crate::spec) span: Span,
    /// The path of the word, in words.
    pub(in crate::spec) path: Rc<str>,
}

impl Word {
    /// An error about this word.
    pub(in crate::spec) fn error(&self, message: impl Into<String>) -> Diagnostic {
        Diagnostic::new(self.span, message).path(&*self.path)
    }
}

/// The scalar in a node; reports an error if the node is not a scalar.
fn scalar<'a>(node: &'a Node, expected: &str, reader: &mut Reader) -> Option<&'a yaml::Scalar> {
    match &node.kind {
        Kind::Scalar(scalar) if !scalar.is_null() => Some(scalar),
        _ => {
            reader.mismatch(expected, node);
            None
        }
    }
}

/// Whether a text consists of letters, digits and underscores, and does not start with a digit.
fn is_identifier(text: &str) -> bool {
    !text.starts_with(|c: char| c.is_ascii_digit())
        && !text.is_empty()
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

fn is_label(text: &str) -> bool {
    is_identifier(text) || (!text.is_empty() && text.chars().all(|c| c.is_ascii_digit()))
}

fn is_coordinate(text: &str) -> bool {
    match text.split_once('.') {
        None => is_identifier(text),
        Some((joint, index)) => {
            is_identifier(joint) && !index.is_empty() && index.chars().all(|c| c.is_ascii_digit())
        }
    }
}

fn is_parameter(text: &str) -> bool {
    text.ends_with(')') && text.find('(').is_some_and(|open| open > 0)
}

/// The reason why a word is refused, and a hint.
type Refusal = (String, String);

/// Keywords of Rust, up to edition 2024.
const KEYWORDS: &[&str] = &[
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
    "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
    "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "self", "Self", "static", "struct", "super", "trait", "true", "try", "type",
    "typeof", "unsafe", "unsized", "use", "virtual", "where", "while", "yield", "_",
];

fn check_identifier(text: &str) -> Result<(), Refusal> {
    if is_identifier(text) {
        return Ok(());
    }
    Err((
        "must consist of ASCII letters, digits and '_' and not start with a digit".into(),
        format!("for instance '{}'", shorten(&similar_identifier(text))),
    ))
}

/// An identifier that resembles the text.
fn similar_identifier(text: &str) -> String {
    let mut similar_identifier: String = text
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    if similar_identifier.is_empty() || similar_identifier.starts_with(|c: char| c.is_ascii_digit())
    {
        similar_identifier.insert(0, '_');
    }
    similar_identifier
}

fn check_robot_name(text: &str) -> Result<(), Refusal> {
    check_identifier(text)?;
    if KEYWORDS.contains(&text) {
        return Err((
            "is a keyword of Rust".into(),
            "it names the generated module; choose another".into(),
        ));
    }
    Ok(())
}

fn check_constant(text: &str) -> Result<(), Refusal> {
    check_identifier(text)?;
    if is_reserved(text) {
        return Err((
            "means something else in expressions".into(),
            "choose a name other than pi, sqrt, sin, cos, tan and deg".into(),
        ));
    }
    Ok(())
}

fn check_label(text: &str) -> Result<(), Refusal> {
    if text == "world" {
        return Err(("is the world's own label".into(), "choose another".into()));
    }
    check_body_reference(text)
}

fn check_body_reference(text: &str) -> Result<(), Refusal> {
    if is_label(text) {
        return Ok(());
    }
    Err((
        "must be a whole number, or consist of ASCII letters, digits and '_'".into(),
        format!("for instance '{}'", shorten(&similar_identifier(text))),
    ))
}

fn check_coordinate(text: &str) -> Result<(), Refusal> {
    if is_coordinate(text) {
        return Ok(());
    }
    Err((
        "is not a coordinate".into(),
        "coordinates are joint names, with an axis at compound joints: 'q2', 's1.1'".into(),
    ))
}

fn check_parameter(text: &str) -> Result<(), Refusal> {
    if is_parameter(text) {
        return Ok(());
    }
    Err((
        "is not a parameter".into(),
        "parameters are written 'Ixx(1)', 'Fv(q2)', 'J(q2)'".into(),
    ))
}

/// Declares kinds of words: their documentation, type name, noun in messages, JSON type and
/// pattern, and the check of their text.
macro_rules! words {
    ($( $(#[doc = $doc:literal])+ $name:ident, $expected:literal, $json:tt, $pattern:literal, $check:path; )+) => {$(
        $(#[doc = $doc])+
        #[derive(Clone, Debug)]
        pub(in crate::spec) struct $name(pub(in crate::spec) Word);

        impl Shape for $name {
            const EXPECTED: &'static str = $expected;

            fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
                let text = &scalar(node, Self::EXPECTED, reader)?.text;
                if let Err((reason, hint)) = $check(text) {
                    let message = format!("'{}' {reason}", shorten(text));
                    reader.report(Diagnostic::new(node.span, message).hint(hint));
                    return None;
                }
                Some(Self(Word { text: text.clone(), span: node.span, path: reader.path() }))
            }

            fn schema(_: &mut Definitions) -> Json {
                let types = words!(@types $json);
                Json::object([("type", types), ("pattern", Json::text($pattern))])
            }
        }
    )+};
    (@types text) => { Json::text("string") };
    (@types number_or_text) => { Json::texts(["integer", "string"]) };
}

words! {
    /// The name of a joint, from which its coordinates are named.
    Name, "a name", text, "^[A-Za-z_][A-Za-z0-9_]*$", check_identifier;
    /// The name of the robot.
    RobotName, "a Rust identifier", text, "^[A-Za-z_][A-Za-z0-9_]*$", check_robot_name;
    /// The name of a geometry constant.
    ConstantName, "a name", text, "^(?!(pi|sqrt|sin|cos|tan|deg)$)[A-Za-z_][A-Za-z0-9_]*$", check_constant;
    /// The label of a body, a limb or a cut.
    Label, "a label", number_or_text, "^(?!world$)([0-9]+|[A-Za-z_][A-Za-z0-9_]*)$", check_label;
    /// The label of a body as a key, which JSON allows only as text.
    LabelKey, "a body label", text, "^(?!world$)([0-9]+|[A-Za-z_][A-Za-z0-9_]*)$", check_label;
    /// The label of a body, or the world.
    BodyReference, "a body label or 'world'", number_or_text, "^([0-9]+|[A-Za-z_][A-Za-z0-9_]*)$", check_body_reference;
    /// The name of a coordinate.
    CoordinateReference, "a coordinate", text, "^[A-Za-z_][A-Za-z0-9_]*(\\.[0-9]+)?$", check_coordinate;
    /// The label of a parameter.
    ParameterReference, "a parameter", text, "^[A-Za-z]+[0-9]*[+-]?\\s*\\(.+\\)$", check_parameter;
    /// The symbol of a parameter of a joint or of a spring.
    ParameterSymbol, "a parameter's symbol", text, "^[A-Za-z_][A-Za-z0-9_]*[+-]?$", accept_any;
    /// The name of an effort term, with which the label of its parameter begins.
    TermName, "a name", text, "^[A-Za-z_][A-Za-z0-9_]*$", check_term_name;
}

/// The symbols of parameters, which no effort term may be called.
const SYMBOLS: &[&str] = &[
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m", "Fv", "Fc", "Fs", "Fv1",
    "Fv2", "Fv3", "vs", "delta", "Fo", "J", "K", "k", "kl", "f",
];

fn check_term_name(text: &str) -> Result<(), Refusal> {
    check_identifier(text)?;
    if SYMBOLS.contains(&text) {
        return Err((
            "is the symbol of another parameter".into(),
            "choose another name for the term, such as 'cable' or 'cogging'".into(),
        ));
    }
    Ok(())
}

/// Accepts any text. A later stage checks it, when the rest of the spec is known.
#[allow(
    clippy::unnecessary_wraps,
    reason = "it has the signature of the checks that can refuse a text"
)]
fn accept_any(_: &str) -> Result<(), Refusal> {
    Ok(())
}

/// One line of text.
#[derive(Clone, Debug)]
pub(in crate::spec) struct Text(pub(in crate::spec) String);

impl Shape for Text {
    const EXPECTED: &'static str = "a text";

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let text = &scalar(node, Self::EXPECTED, reader)?.text;
        // folded and literal blocks become one line
        let words: Vec<&str> = text.split_whitespace().collect();
        Some(Self(words.join(" ")))
    }

    fn schema(_: &mut Definitions) -> Json {
        Json::object([("type", Json::text("string"))])
    }
}

/// A flag, `true` or `false`.
#[derive(Clone, Copy, Debug)]
pub(in crate::spec) struct Flag {
    pub(in crate::spec) value: bool,
    pub(in crate::spec) span: Span,
}

impl Shape for Flag {
    const EXPECTED: &'static str = "'true' or 'false'";

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let text = &scalar(node, Self::EXPECTED, reader)?.text;
        let value = match text.as_str() {
            "true" => true,
            "false" => false,
            other => {
                let message = format!("expected {}, found '{other}'", Self::EXPECTED);
                let meant = match other.to_ascii_lowercase().as_str() {
                    "yes" | "on" | "y" | "1" | "true" => Some("true"),
                    "no" | "off" | "n" | "0" | "false" => Some("false"),
                    _ => None,
                };
                let fault = Diagnostic::new(node.span, message);
                reader.report(match meant {
                    Some(word) => fault.hint(format!("write `{word}`")),
                    None => fault,
                });
                return None;
            }
        };
        Some(Self {
            value,
            span: node.span,
        })
    }

    fn schema(_: &mut Definitions) -> Json {
        Json::object([("type", Json::text("boolean"))])
    }
}

/// A number, or an expression in geometry names.
#[derive(Clone, Debug)]
pub(in crate::spec) struct Scalar {
    pub(in crate::spec) ast: Ast,
    pub(in crate::spec) path: Rc<str>,
}

fn expression(
    node: &Node,
    expected: &str,
    vocabulary: Vocabulary,
    reader: &mut Reader,
) -> Option<Scalar> {
    let scalar = scalar(node, expected, reader)?;
    match parse(&scalar.text, node.span, scalar.verbatim, vocabulary) {
        Ok(ast) => Some(Scalar {
            ast,
            path: reader.path(),
        }),
        Err(fault) => {
            let path = reader.path();
            reader.sink.push(fault.at(&path));
            None
        }
    }
}

fn expression_schema(name: &str, doc: &str, definitions: &mut Definitions) -> Json {
    defined(name, definitions, |_| {
        Json::object([
            ("type", Json::texts(["number", "string"])),
            ("minLength", Json::Integer(1)),
            ("description", Json::text(doc)),
        ])
    })
}

impl Shape for Scalar {
    const EXPECTED: &'static str = "a number or an expression";

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        expression(node, Self::EXPECTED, Vocabulary::Constants, reader)
    }

    fn schema(definitions: &mut Definitions) -> Json {
        let doc =
            "A number, or an expression in geometry names: pi, + - * / ^, sqrt, sin, cos, tan, deg";
        expression_schema("expression", doc, definitions)
    }
}

/// A linear form in coordinates.
#[derive(Clone, Debug)]
pub(in crate::spec) struct CouplingForm(pub(in crate::spec) Scalar);

impl Shape for CouplingForm {
    const EXPECTED: &'static str = "an expression in coordinates";

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        expression(node, Self::EXPECTED, Vocabulary::Coordinates, reader).map(Self)
    }

    fn schema(definitions: &mut Definitions) -> Json {
        let doc = "A constant plus constant multiples of coordinates, such as -q2 + pi";
        expression_schema("coupling", doc, definitions)
    }
}

/// The factor of an effort term: an expression in the joint's own `q` and `qd`.
#[derive(Clone, Debug)]
pub(in crate::spec) struct TermExpression(pub(in crate::spec) Scalar);

impl Shape for TermExpression {
    const EXPECTED: &'static str = "an expression in q and qd";

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        expression(node, Self::EXPECTED, Vocabulary::EffortTerms, reader).map(Self)
    }

    fn schema(definitions: &mut Definitions) -> Json {
        let doc = "An expression in the joint's own q and qd and in geometry names, such as q^2, sin(16*q) or abs(qd)*qd";
        expression_schema("effort_term", doc, definitions)
    }
}

/// A linear form in parameters.
#[derive(Clone, Debug)]
pub(in crate::spec) struct ParameterForm(pub(in crate::spec) Scalar);

impl Shape for ParameterForm {
    const EXPECTED: &'static str = "a parameter or a linear form in parameters";

    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        expression(node, Self::EXPECTED, Vocabulary::Parameters, reader).map(Self)
    }

    fn schema(definitions: &mut Definitions) -> Json {
        let doc = "Constant multiples of parameters, such as Ixy(3) + a/2*my(3)";
        expression_schema("parameter_form", doc, definitions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_labels_and_coordinates_are_told_apart() {
        assert!(
            is_identifier("q_1")
                && !is_identifier("1q")
                && !is_identifier("")
                && !is_identifier("a-b")
        );
        assert!(is_label("01") && is_label("torso") && !is_label("1a") && !is_label("s1.1"));
        assert!(
            is_coordinate("s1.1")
                && is_coordinate("q2")
                && !is_coordinate("s1.")
                && !is_coordinate("1.1")
        );
        assert!(is_parameter("Fc+(q2)") && !is_parameter("Ixx") && !is_parameter("(1)"));
    }

    #[test]
    fn robot_names_are_rust_identifiers() {
        assert!(check_robot_name("rps3").is_ok());
        for bad in ["3rps", "my-robot", "match", "gen", "_", "größe"] {
            assert!(check_robot_name(bad).is_err(), "{bad}");
        }
    }
}
