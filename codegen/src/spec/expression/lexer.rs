//! Splits expressions into tokens.

use super::{FUNCTIONS, Fault, Vocabulary};
use crate::diag::Span;

/// The symbols of a body's inertial parameters, in order.
pub(in crate::spec) const INERTIAL: [&str; 10] = [
    "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m",
];

/// The kind of a token; its span gives its text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TokenKind {
    /// A number such as `0.5e-3`.
    Number,
    /// A name such as `a`.
    Name,
    /// A coordinate of a joint with several, such as `s1.1`.
    Dotted,
    /// A parameter with its label, such as `Ixy(3)`.
    Parameter,
    /// One of `+ - * / ^ ( )`.
    Symbol(char),
}

/// A token, with byte offsets in the expression's text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token {
    pub(super) kind: TokenKind,
    pub(super) start: usize,
    pub(super) end: usize,
}

/// Splits an expression into tokens.
pub(super) fn tokens(text: &str, vocabulary: Vocabulary) -> Result<Vec<Token>, Fault> {
    let mut lexer = Lexer {
        text,
        at: 0,
        vocabulary,
    };
    let mut tokens = Vec::new();
    while let Some(token) = lexer.next()? {
        tokens.push(token);
    }
    Ok(tokens)
}

struct Lexer<'a> {
    text: &'a str,
    at: usize,
    vocabulary: Vocabulary,
}

impl Lexer<'_> {
    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    /// Skips characters while they fit; returns the number of bytes skipped.
    fn skip(&mut self, fits: impl Fn(char) -> bool) -> usize {
        let rest = &self.text[self.at..];
        let length = rest.find(|c| !fits(c)).unwrap_or(rest.len());
        self.at += length;
        length
    }

    fn next(&mut self) -> Result<Option<Token>, Fault> {
        self.skip(char::is_whitespace);
        let start = self.at;
        let Some(c) = self.peek() else {
            return Ok(None);
        };
        let kind = match c {
            '0'..='9' | '.' => self.number(start)?,
            _ if is_name_start(c) => self.name(start)?,
            '+' | '-' | '*' | '/' | '^' | '(' | ')' => {
                self.at += 1;
                if c == '*' && self.peek() == Some('*') {
                    return Err(
                        Fault::new(Span::new(start, self.at + 1), "unknown operator '**'")
                            .hint("powers are written with '^'"),
                    );
                }
                TokenKind::Symbol(c)
            }
            _ => return Err(unexpected(c, start)),
        };
        Ok(Some(Token {
            kind,
            start,
            end: self.at,
        }))
    }

    fn number(&mut self, start: usize) -> Result<TokenKind, Fault> {
        let mut digits = self.skip(|c| c.is_ascii_digit());
        if self.peek() == Some('.') {
            self.at += 1;
            digits += self.skip(|c| c.is_ascii_digit());
        }
        if digits == 0 {
            self.skip(is_name_part);
            let text = &self.text[start..self.at];
            let fault = Fault::new(
                Span::new(start, self.at),
                format!("'{text}' is not a number"),
            );
            return Err(match text {
                ".inf" | ".nan" | ".Inf" | ".NaN" | ".INF" | ".NAN" => {
                    fault.hint("every value must be finite")
                }
                _ => fault,
            });
        }
        self.exponent();
        Ok(TokenKind::Number)
    }

    /// Skips an exponent such as `e-3`, if one follows.
    fn exponent(&mut self) {
        let back = self.at;
        if matches!(self.peek(), Some('e' | 'E')) {
            self.at += 1;
            if matches!(self.peek(), Some('+' | '-')) {
                self.at += 1;
            }
            if self.skip(|c| c.is_ascii_digit()) == 0 {
                self.at = back;
            }
        }
    }

    fn name(&mut self, start: usize) -> Result<TokenKind, Fault> {
        self.skip(is_name_part);
        let name = &self.text[start..self.at];
        let rest = &self.text[self.at..];
        if rest.starts_with('.') {
            self.at += 1;
            self.skip(is_name_part);
            return Ok(TokenKind::Dotted);
        }
        if self.vocabulary != Vocabulary::Parameters
            || FUNCTIONS.iter().any(|(function, _)| *function == name)
        {
            return Ok(TokenKind::Name);
        }
        // `Fc+(q2)` is a parameter's label; `Fc + (q2)` is a sum
        let signed =
            matches!(name, "Fv" | "Fc") && (rest.starts_with("+(") || rest.starts_with("-("));
        let rest = if signed { &rest[1..] } else { rest };
        if !rest.trim_start().starts_with('(') {
            return Ok(TokenKind::Name);
        }
        match rest.find(')') {
            Some(close) => {
                self.at += usize::from(signed) + close + 1;
                Ok(TokenKind::Parameter)
            }
            None => Err(Fault::new(
                Span::new(start, self.text.len()),
                "missing ')' after the label",
            )),
        }
    }
}

fn is_name_start(c: char) -> bool {
    c.is_ascii_alphabetic() || c == '_'
}

fn is_name_part(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// The error about an unexpected character, with a hint for characters that people write instead of
/// the right ones.
fn unexpected(c: char, start: usize) -> Fault {
    let fault = Fault::new(
        Span::new(start, start + c.len_utf8()),
        format!("unexpected character '{c}'"),
    );
    match c {
        '−' | '–' | '—' => fault.hint("write the minus sign as '-'"),
        '×' | '·' | '⋅' => fault.hint("multiplication is written '*'"),
        '÷' | ':' => fault.hint("division is written '/'"),
        'π' => fault.hint("write 'pi'"),
        '√' => fault.hint("write 'sqrt(...)'"),
        '²' => fault.hint("powers are written with '^', as in 'a^2'"),
        '°' => fault.hint("angles are in radians; 'deg(30)' converts degrees"),
        ',' => fault.hint("decimals are written with a point; functions take one argument"),
        _ if c.is_alphabetic() => fault.hint("names consist of ASCII letters, digits and '_'"),
        _ => fault,
    }
}
