//! Expressions of the spec's grammar and parameter labels as LaTeX, in math mode.

/// What an expression is made of.
#[derive(Clone, Debug, PartialEq)]
enum Tree {
    Number(String),
    Name(String),
    Neg(Box<Tree>),
    Sum(Vec<(bool, Tree)>),
    Product(Vec<Tree>),
    Quotient(Box<Tree>, Box<Tree>),
    Power(Box<Tree>, Box<Tree>),
    Call(String, Box<Tree>),
}

/// An expression in math mode; what is not in the grammar comes out as upright text.
pub(crate) fn expression(text: &str) -> String {
    parse(text).map_or_else(|| upright(text), |tree| tree.text())
}

/// A parameter's label: `Ixx(3)`, `Fc+(q2)`.
pub(crate) fn label(text: &str) -> String {
    let Some((kind, of)) = text.strip_suffix(')').and_then(|t| t.split_once('(')) else {
        return upright(text);
    };
    let kind = match kind {
        "mx" | "my" | "mz" | "m" | "J" => kind.to_owned(),
        _ => {
            let (stem, sign) = match kind.strip_suffix(['+', '-']) {
                Some(stem) => (stem, format!("^{{{}}}", &kind[stem.len()..])),
                None => (kind, String::new()),
            };
            match stem.split_at_checked(1) {
                Some((head, index)) if !index.is_empty() => format!("{head}_{{{index}}}{sign}"),
                _ => upright(kind),
            }
        }
    };
    format!("{kind}({})", name(of))
}

/// A name: a letter or a Greek letter's name with an index, or else upright.
fn name(text: &str) -> String {
    const GREEK: [&str; 22] = [
        "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa",
        "lambda", "mu", "nu", "xi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega", "pi",
    ];
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

fn upright(text: &str) -> String {
    format!("\\mathrm{{{}}}", escaped(text))
}

/// Text outside math mode, with what LaTeX would read as commands written out.
pub(crate) fn escaped(text: &str) -> String {
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

impl Tree {
    fn text(&self) -> String {
        match self {
            Tree::Number(digits) => number(digits),
            Tree::Name(text) => name(text),
            Tree::Neg(inner) => format!("-{}", inner.factor()),
            Tree::Sum(terms) => {
                let mut out = String::new();
                for (negative, term) in terms {
                    out.push_str(match (out.is_empty(), negative) {
                        (true, true) => "-",
                        (true, false) => "",
                        (false, true) => " - ",
                        (false, false) => " + ",
                    });
                    out.push_str(&match term {
                        Tree::Sum(_) | Tree::Neg(_) => term.factor(),
                        _ => term.text(),
                    });
                }
                out
            }
            Tree::Product(factors) => {
                let mut out = String::new();
                for factor in factors {
                    let text = factor.factor();
                    if text.starts_with(|c: char| c.is_ascii_digit()) && !out.is_empty() {
                        out.push_str(" \\cdot ");
                    } else if !out.is_empty() {
                        out.push(' ');
                    }
                    out.push_str(&text);
                }
                out
            }
            Tree::Quotient(above, below) => {
                format!("\\frac{{{}}}{{{}}}", above.text(), below.text())
            }
            Tree::Power(base, exponent) => {
                let text = match **base {
                    Tree::Number(_) | Tree::Name(_) => base.text(),
                    _ => format!("\\bigl({}\\bigr)", base.text()),
                };
                format!("{text}^{{{}}}", exponent.text())
            }
            Tree::Call(function, inner) => match function.as_str() {
                "sqrt" => format!("\\sqrt{{{}}}", inner.text()),
                "deg" => format!("{}^{{\\circ}}", inner.factor()),
                _ => format!("\\{function}\\bigl({}\\bigr)", inner.text()),
            },
        }
    }

    /// As a factor: sums and signs in parentheses.
    fn factor(&self) -> String {
        match self {
            Tree::Sum(_) | Tree::Neg(_) => format!("\\bigl({}\\bigr)", self.text()),
            _ => self.text(),
        }
    }

    fn negated(self) -> Tree {
        match self {
            Tree::Neg(inner) => *inner,
            other => Tree::Neg(Box::new(other)),
        }
    }
}

fn number(digits: &str) -> String {
    match digits.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => {
            let exponent = exponent.trim_start_matches('+');
            format!("{mantissa} \\cdot 10^{{{exponent}}}")
        }
        None => digits.to_owned(),
    }
}

fn parse(text: &str) -> Option<Tree> {
    let mut parser = Parser { rest: text };
    let tree = parser.sum()?;
    parser.rest.trim_start().is_empty().then_some(tree)
}

/// What is left to read. The texts come from the derivation, which nests them a few deep.
struct Parser<'a> {
    rest: &'a str,
}

impl<'a> Parser<'a> {
    /// Takes the next character if it is one of these.
    fn take(&mut self, any: &[char]) -> Option<char> {
        let rest = self.rest.trim_start();
        let c = rest.chars().next().filter(|c| any.contains(c))?;
        self.rest = &rest[c.len_utf8()..];
        Some(c)
    }

    fn while_(&mut self, holds: impl Fn(char) -> bool) -> &'a str {
        let end = self.rest.find(|c| !holds(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        word
    }

    fn sum(&mut self) -> Option<Tree> {
        let split = |tree: Tree, minus: bool| match tree {
            Tree::Neg(inner) => (!minus, *inner),
            other => (minus, other),
        };
        let first = self.product()?;
        let mut terms = vec![split(first, false)];
        while let Some(sign) = self.take(&['+', '-']) {
            let term = self.product()?;
            terms.push(split(term, sign == '-'));
        }
        Some(match terms.as_slice() {
            [_] => {
                let (negative, tree) = terms.pop()?;
                if negative { tree.negated() } else { tree }
            }
            _ => Tree::Sum(terms),
        })
    }

    /// A product with its sign in front.
    fn product(&mut self) -> Option<Tree> {
        let mut negative = false;
        let mut unsigned = |tree: Tree| match tree {
            Tree::Neg(inner) => {
                negative = !negative;
                *inner
            }
            other => other,
        };
        let mut tree = unsigned(self.sign()?);
        while let Some(operator) = self.take(&['*', '/']) {
            let factor = unsigned(self.sign()?);
            tree = match (operator, tree) {
                ('/', above) => Tree::Quotient(Box::new(above), Box::new(factor)),
                (_, Tree::Product(mut factors)) => {
                    factors.push(factor);
                    Tree::Product(factors)
                }
                (_, other) => Tree::Product(vec![other, factor]),
            };
        }
        Some(if negative { tree.negated() } else { tree })
    }

    fn sign(&mut self) -> Option<Tree> {
        match self.take(&['-', '+']) {
            Some('-') => Some(self.sign()?.negated()),
            Some(_) => self.sign(),
            None => self.power(),
        }
    }

    fn power(&mut self) -> Option<Tree> {
        let base = self.atom()?;
        if self.take(&['^']).is_none() {
            return Some(base);
        }
        let exponent = self.sign()?;
        Some(Tree::Power(Box::new(base), Box::new(exponent)))
    }

    fn atom(&mut self) -> Option<Tree> {
        if self.take(&['(']).is_some() {
            let inner = self.sum()?;
            self.take(&[')'])?;
            return Some(inner);
        }
        self.rest = self.rest.trim_start();
        let first = self.rest.chars().next()?;
        if first.is_ascii_digit() || first == '.' {
            let start = self.rest;
            self.while_(|c| c.is_ascii_digit() || c == '.');
            let exponent = self.rest.strip_prefix(['e', 'E']);
            let unsigned = exponent.map(|e| e.strip_prefix(['+', '-']).unwrap_or(e));
            if let Some(digits) = unsigned.filter(|d| d.starts_with(|c: char| c.is_ascii_digit())) {
                self.rest = digits;
                self.while_(|c| c.is_ascii_digit());
            }
            let length = start.len() - self.rest.len();
            return Some(Tree::Number(start[..length].to_owned()));
        }
        if !(first.is_alphabetic() || first == '_') {
            return None;
        }
        let word = self.while_(|c| c.is_alphanumeric() || c == '_');
        let function = matches!(word, "sqrt" | "sin" | "cos" | "tan" | "deg");
        if function && self.take(&['(']).is_some() {
            let inner = self.sum()?;
            self.take(&[')'])?;
            return Some(Tree::Call(word.to_owned(), Box::new(inner)));
        }
        Some(Tree::Name(word.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            assert_eq!(expression(text), latex, "{text}");
        }
    }

    #[test]
    fn what_is_no_expression_is_text() {
        for text in ["?", "a +", "(a", "a b", "", "2 $ 3"] {
            assert!(expression(text).starts_with("\\mathrm{"), "{text}");
        }
        assert_eq!(expression("50%"), "\\mathrm{50\\%}");
    }

    #[test]
    fn labels_are_set_as_in_textbooks() {
        for (text, latex) in [
            ("Ixx(3)", "I_{xx}(3)"),
            ("mx(3)", "mx(3)"),
            ("m(platform_1)", r"m(\mathrm{platform\_1})"),
            ("Fv(q2)", "F_{v}(q_{2})"),
            ("Fc+(q2)", "F_{c}^{+}(q_{2})"),
            ("Fv-(s1.2)", "F_{v}^{-}(s_{1.2})"),
            ("J(q12)", "J(q_{12})"),
        ] {
            assert_eq!(label(text), latex, "{text}");
        }
    }
}
