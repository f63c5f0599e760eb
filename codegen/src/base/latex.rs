//! Writes coefficients and parameters as LaTeX, for math mode.

use crate::model::{Parameter, ParameterKind};
use crate::spec::Function;
use crate::sym::print::sign;

use super::Coefficient;

/// A parameter as in textbooks, with the body or coordinate that it belongs to: `I_{xx,3}`,
/// `m_{3} x_{3}`, `m_{3}`, `F_{v}(q_{2})`.
pub fn parameter(parameter: &Parameter) -> String {
    let symbol = parameter.symbol();
    let owner = name(&parameter.owner);
    match parameter.kind {
        ParameterKind::Inertial { .. } => match symbol.split_at_checked(1) {
            Some(("I", axes)) => format!("I_{{{axes},{owner}}}"),
            Some(("m", "")) => format!("m_{{{owner}}}"),
            Some(("m", axis)) => format!("m_{{{owner}}} {axis}_{{{owner}}}"),
            _ => format!("{}({owner})", upright(symbol)),
        },
        ParameterKind::Friction { .. }
        | ParameterKind::Offset { .. }
        | ParameterKind::PointSpring { .. } => format!("{}({owner})", indexed(symbol)),
        ParameterKind::JointSpring { .. } | ParameterKind::Rotor { .. } => {
            format!("{symbol}({owner})")
        }
        ParameterKind::EffortTerm { .. } => format!("{}({owner})", name(symbol)),
    }
}

/// A letter with its index, and with a trailing sign as an exponent: `Fc+` becomes `F_{c}^{+}`.
fn indexed(symbol: &str) -> String {
    let stem = symbol.trim_end_matches(['+', '-']);
    let sign = match symbol.strip_prefix(stem) {
        None | Some("") => String::new(),
        Some(sign) => format!("^{{{sign}}}"),
    };
    match stem.split_at_checked(1) {
        Some((head, index)) if !index.is_empty() => format!("{head}_{{{index}}}{sign}"),
        _ => upright(symbol),
    }
}

/// The names of Greek letters, which are commands of LaTeX.
pub const GREEK: [&str; 22] = [
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa",
    "lambda", "mu", "nu", "xi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega", "pi",
];

/// A name: a letter or the name of a Greek letter, with an index; anything else upright.
fn name(text: &str) -> String {
    let digits = |t: &str| !t.is_empty() && t.bytes().all(|b| b.is_ascii_digit() || b == b'.');
    if digits(text) {
        return text.to_owned();
    }
    let letters = text.bytes().take_while(u8::is_ascii_alphabetic).count();
    let (stem, rest) = text.split_at(letters);
    let index = rest.strip_prefix('_').unwrap_or(rest);
    let plain = index
        .bytes()
        .all(|b| b.is_ascii_alphanumeric() || b == b'.');
    let stem = match stem {
        _ if !plain || (rest.is_empty() != index.is_empty()) => return upright(text),
        _ if GREEK.contains(&stem) => format!("\\{stem}"),
        _ if stem.len() == 1 => stem.to_owned(),
        _ => return upright(text),
    };
    match index {
        "" => stem,
        _ if digits(index) || index.len() == 1 => format!("{stem}_{{{index}}}"),
        _ => format!("{stem}_{{\\mathrm{{{index}}}}}"),
    }
}

/// A text in upright letters.
fn upright(text: &str) -> String {
    format!("\\mathrm{{{}}}", escaped(text))
}

/// A text for use outside math mode, with the characters escaped that LaTeX would interpret.
pub fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '\\' => out.push_str("\\textbackslash{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            '~' => out.push_str("\\textasciitilde{}"),
            '_' | '%' | '&' | '#' | '$' | '{' | '}' => {
                out.push('\\');
                out.push(c);
            }
            _ => out.push(c),
        }
    }
    out
}

/// A number: `1.5e-3` becomes a product with a power of ten.
pub fn number(digits: &str) -> String {
    match digits.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => {
            let exponent = exponent.trim_start_matches('+');
            format!("{mantissa} \\cdot 10^{{{exponent}}}")
        }
        None => digits.to_owned(),
    }
}

/// An expression as LaTeX.
pub fn expression(tree: &Coefficient) -> String {
    match tree {
        Coefficient::Number(digits) => number(digits),
        Coefficient::Name(text) => name(text),
        Coefficient::Neg(inner) => format!("-{}", factor(inner)),
        Coefficient::Sum(terms) => {
            let mut out = String::new();
            for (negative, term) in terms {
                out.push_str(sign(out.is_empty(), *negative));
                out.push_str(&factor(term));
            }
            out
        }
        Coefficient::Product(factors) => {
            let mut out = String::new();
            let join = if is_wide(tree) { " \\allowbreak " } else { " " };
            for each in factors {
                let text = factor(each);
                if text.starts_with(|c: char| c.is_ascii_digit()) && !out.is_empty() {
                    out.push_str(" \\cdot ");
                } else if !out.is_empty() {
                    out.push_str(join);
                }
                out.push_str(&text);
            }
            out
        }
        Coefficient::Quotient(above, below) if is_wide(above) || is_wide(below) => {
            let below = match **below {
                Coefficient::Product(_) | Coefficient::Quotient(..) => {
                    format!("\\bigl({}\\bigr)", expression(below))
                }
                _ => factor(below),
            };
            format!("{} / \\allowbreak {below}", factor(above))
        }
        Coefficient::Quotient(above, below) => {
            format!("\\frac{{{}}}{{{}}}", expression(above), expression(below))
        }
        Coefficient::Power(base, exponent) => {
            // the square of a named angle's sine as in textbooks
            if let Coefficient::Call(function @ (Function::Sin | Function::Cos), angle) = &**base
                && angle.mentions_names()
            {
                let (name, angle) = (function.name(), expression(angle));
                return format!("\\{name}^{{{}}}\\bigl({angle}\\bigr)", expression(exponent));
            }
            let text = match **base {
                Coefficient::Number(_) | Coefficient::Name(_) => expression(base),
                _ => format!("\\bigl({}\\bigr)", expression(base)),
            };
            format!("{text}^{{{}}}", expression(exponent))
        }
        Coefficient::Call(function, inner) => match function {
            Function::Sqrt if is_wide(inner) => {
                format!("\\bigl({}\\bigr)^{{1/2}}", expression(inner))
            }
            Function::Sqrt => format!("\\sqrt{{{}}}", expression(inner)),
            Function::Deg => format!("{}^{{\\circ}}", factor(inner)),
            Function::Abs => format!("\\left|{}\\right|", expression(inner)),
            Function::Sign => format!("\\operatorname{{sgn}}\\bigl({}\\bigr)", expression(inner)),
            Function::Sin | Function::Cos | Function::Tan => {
                format!("\\{}\\bigl({}\\bigr)", function.name(), expression(inner))
            }
        },
    }
}

/// Longer expressions, in characters, are written such that a line can break within them: LaTeX
/// breaks no line within a fraction or below a root.
const WIDE: usize = 24;

/// Whether an expression is so long that a line must be able to break within it.
fn is_wide(tree: &Coefficient) -> bool {
    tree.to_string().len() > WIDE
}

/// An expression as a factor: sums and negations in parentheses.
fn factor(tree: &Coefficient) -> String {
    match tree {
        Coefficient::Sum(_) | Coefficient::Neg(_) => {
            format!("\\bigl({}\\bigr)", expression(tree))
        }
        _ => expression(tree),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::FrictionColumn;

    #[test]
    fn expressions_become_fractions_roots_and_powers() {
        for (text, latex) in [
            ("2*sqrt(3)/(3*a)", r"\frac{2 \sqrt{3}}{3 a}"),
            ("-2*sqrt(3)/(3*a)", r"-\frac{2 \sqrt{3}}{3 a}"),
            ("a^2", "a^{2}"),
            ("-a^2", "-a^{2}"),
            ("d4^2 + a3^2", "d_{4}^{2} + a_{3}^{2}"),
            ("sqrt(3)*a/2", r"\frac{\sqrt{3} a}{2}"),
            ("sqrt(3)/2*a", r"\frac{\sqrt{3}}{2} a"),
            ("a*(b - c)", r"a \bigl(b - c\bigr)"),
            ("(a - b)/(a + b)", r"\frac{a - b}{a + b}"),
            ("1 - -a", "1 + a"),
            ("a - (b + c)", r"a - \bigl(b + c\bigr)"),
            ("a*2*3", r"a \cdot 2 \cdot 3"),
            ("(a + b)^2", r"\bigl(a + b\bigr)^{2}"),
            ("2^-1", "2^{-1}"),
            (
                "a*sin(alpha/2)^2",
                r"a \sin^{2}\bigl(\frac{\alpha}{2}\bigr)",
            ),
            (
                "cos(0.3)*sin(3/10)",
                r"\cos\bigl(0.3\bigr) \sin\bigl(\frac{3}{10}\bigr)",
            ),
            ("1.5e-3", r"1.5 \cdot 10^{-3}"),
            ("5*pi/6", r"\frac{5 \pi}{6}"),
            ("l_arm", r"l_{\mathrm{arm}}"),
            ("reach", r"\mathrm{reach}"),
            ("upper_arm_2", r"\mathrm{upper\_arm\_2}"),
            ("alpha2", r"\alpha_{2}"),
            ("a^b^c", "a^{b^{c}}"),
            ("a/b/c", r"\frac{\frac{a}{b}}{c}"),
        ] {
            let tree = Coefficient::parse(text).unwrap();
            assert_eq!(expression(&tree), latex, "{text}");
        }
    }

    #[test]
    fn what_latex_would_read_as_commands_is_written_out() {
        for (text, latex) in [
            ("50%", r"\mathrm{50\%}"),
            ("2 $ 3", r"\mathrm{2 \$ 3}"),
            ("a_b_c", r"\mathrm{a\_b\_c}"),
        ] {
            assert_eq!(name(text), latex);
        }
        assert_eq!(
            escaped(r"\^~"),
            r"\textbackslash{}\textasciicircum{}\textasciitilde{}"
        );
        assert_eq!(number("1.235e4"), r"1.235 \cdot 10^{4}");
    }

    #[test]
    fn parameters_are_set_as_in_textbooks() {
        let inertial = |entry| ParameterKind::Inertial { body: 0, entry };
        let friction = |column| ParameterKind::Friction {
            coordinate: 0,
            column,
        };
        for (kind, owner, latex) in [
            (inertial(0), "3", "I_{xx,3}"),
            (inertial(6), "3", "m_{3} x_{3}"),
            (inertial(9), "platform_1", r"m_{\mathrm{platform\_1}}"),
            (friction(FrictionColumn::Viscous), "q2", "F_{v}(q_{2})"),
            (
                friction(FrictionColumn::CoulombPositive),
                "q2",
                "F_{c}^{+}(q_{2})",
            ),
            (
                friction(FrictionColumn::ViscousNegative),
                "s1.2",
                "F_{v}^{-}(s_{1.2})",
            ),
            (ParameterKind::Rotor { coordinate: 0 }, "q12", "J(q_{12})"),
        ] {
            let own = Parameter::new(kind, owner);
            assert_eq!(parameter(&own), latex, "{}", own.label);
        }
    }
}
