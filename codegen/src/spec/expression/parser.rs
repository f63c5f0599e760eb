//! Parses tokens as syntax trees.

use super::lexer::{Token, TokenKind, tokens};
use super::{Ast, AstKind, Fault, MAX_HEIGHT, MAX_LENGTH, MAX_NESTING, Operator, Vocabulary};
use crate::diag::Span;
use crate::spec::suggest::did_you_mean;
use crate::sym::Number;

/// Parses an expression.
///
/// `whole` is its place in the file; `verbatim` is the offset of its text if the file contains the
/// text character by character, so that errors can point at parts of it.
pub(in crate::spec) fn parse(
    text: &str,
    whole: Span,
    verbatim: Option<usize>,
    vocabulary: Vocabulary,
) -> Result<Ast, Fault> {
    let place = Place { whole, verbatim };
    let characters = text.chars().count();
    if characters > MAX_LENGTH {
        let message =
            format!("the expression has {characters} characters; the limit is {MAX_LENGTH}");
        return Err(Fault::new(whole, message));
    }
    let tokens = tokens(text, vocabulary).map_err(|fault| Fault {
        span: place.span(fault.span.start, fault.span.end),
        ..fault
    })?;
    let mut parser = Parser {
        text,
        tokens,
        at: 0,
        place,
        vocabulary,
        nesting: 0,
    };
    let ast = parser.sum()?;
    match parser.peek() {
        None => Ok(ast),
        Some(token) => Err(parser.leftover(token)),
    }
}

/// Converts offsets in the expression to places in the file.
#[derive(Clone, Copy)]
struct Place {
    whole: Span,
    verbatim: Option<usize>,
}

impl Place {
    fn span(self, start: usize, end: usize) -> Span {
        self.verbatim
            .map_or(self.whole, |offset| Span::new(offset + start, offset + end))
    }
}

struct Parser<'a> {
    text: &'a str,
    tokens: Vec<Token>,
    at: usize,
    place: Place,
    vocabulary: Vocabulary,
    nesting: usize,
}

impl Parser<'_> {
    fn peek(&self) -> Option<Token> {
        self.tokens.get(self.at).copied()
    }

    /// Consumes the next token if it is one of these symbols.
    fn take(&mut self, symbols: &[char]) -> Option<(char, Token)> {
        match self.peek() {
            Some(token) => match token.kind {
                TokenKind::Symbol(c) if symbols.contains(&c) => {
                    self.at += 1;
                    Some((c, token))
                }
                _ => None,
            },
            None => None,
        }
    }

    fn text_of(&self, token: Token) -> &str {
        &self.text[token.start..token.end]
    }

    fn span_of(&self, token: Token) -> Span {
        self.place.span(token.start, token.end)
    }

    fn make(&self, kind: AstKind, span: Span) -> Result<Ast, Fault> {
        let ast = Ast::new(kind, span);
        if ast.height > MAX_HEIGHT {
            let message = format!("the expression chains more than {MAX_HEIGHT} operations");
            return Err(
                Fault::new(self.place.whole, message).hint("split it with names in `geometry`")
            );
        }
        Ok(ast)
    }

    fn binary(&self, operator: Operator, a: Ast, b: Ast) -> Result<Ast, Fault> {
        let span = a.span.to(b.span);
        self.make(AstKind::Binary(operator, Box::new(a), Box::new(b)), span)
    }

    fn sum(&mut self) -> Result<Ast, Fault> {
        let mut left = self.product()?;
        while let Some((symbol, _)) = self.take(&['+', '-']) {
            let right = self.product()?;
            let operator = if symbol == '+' {
                Operator::Add
            } else {
                Operator::Sub
            };
            left = self.binary(operator, left, right)?;
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Ast, Fault> {
        let mut left = self.sign()?;
        while let Some((symbol, _)) = self.take(&['*', '/']) {
            let right = self.sign()?;
            let operator = if symbol == '*' {
                Operator::Mul
            } else {
                Operator::Div
            };
            left = self.binary(operator, left, right)?;
        }
        Ok(left)
    }

    fn sign(&mut self) -> Result<Ast, Fault> {
        self.nesting += 1;
        if self.nesting > MAX_NESTING {
            let span = self
                .peek()
                .map_or(self.place.whole, |token| self.span_of(token));
            let message = format!("the expression is nested deeper than {MAX_NESTING}");
            return Err(Fault::new(span, message).hint("split it with names in `geometry`"));
        }
        let ast = match self.take(&['-', '+']) {
            Some(('-', token)) => {
                let inner = self.sign()?;
                let span = self.span_of(token).to(inner.span);
                self.make(AstKind::Neg(Box::new(inner)), span)
            }
            Some(_) => self.sign(),
            None => self.power(),
        };
        self.nesting -= 1;
        ast
    }

    fn power(&mut self) -> Result<Ast, Fault> {
        let base = self.atom()?;
        if self.take(&['^']).is_none() {
            return Ok(base);
        }
        let exponent = self.sign()?;
        self.binary(Operator::Pow, base, exponent)
    }

    fn atom(&mut self) -> Result<Ast, Fault> {
        let Some(token) = self.peek() else {
            let end = self.text.len();
            return Err(match self.text.trim() {
                "" => Fault::new(self.place.whole, "an empty expression"),
                _ => Fault::new(self.place.span(end, end), "the expression ends too early"),
            });
        };
        self.at += 1;
        let span = self.span_of(token);
        let text = self.text_of(token);
        match token.kind {
            TokenKind::Number => match Number::parse_decimal(text) {
                Some(value) => Ok(Ast::number(value, span)),
                None => Err(Fault::new(span, "a number out of range")),
            },
            TokenKind::Dotted => self.dotted(token),
            TokenKind::Parameter => {
                let label: String = text.chars().filter(|c| !c.is_whitespace()).collect();
                Ok(Ast::new(AstKind::Variable(label), span))
            }
            TokenKind::Symbol('(') => {
                let inner = self.sum()?;
                let end = self.close(token)?;
                // errors underline the parentheses too
                Ok(Ast {
                    span: span.to(end),
                    ..inner
                })
            }
            TokenKind::Symbol(c) => Err(Fault::new(
                span,
                format!("expected a number, a name or '(', found '{c}'"),
            )),
            TokenKind::Name => self.name(token),
        }
    }

    fn close(&mut self, open: Token) -> Result<Span, Fault> {
        match (self.take(&[')']), self.peek()) {
            (Some((_, token)), _) => Ok(self.span_of(token)),
            (None, Some(token)) => Err(self.leftover(token)),
            (None, None) => Err(Fault::new(self.span_of(open), "this '(' is never closed")),
        }
    }

    fn name(&mut self, token: Token) -> Result<Ast, Fault> {
        let span = self.span_of(token);
        let name = self.text_of(token).to_owned();
        let mut functions = self.vocabulary.functions();
        let function = functions.find(|(known, _)| *known == name);
        let called = self.take(&['(']);
        match (function, called) {
            (Some((_, function)), Some((_, open))) => {
                let argument = self.sum()?;
                let end = self.close(open)?;
                self.make(AstKind::Call(*function, Box::new(argument)), span.to(end))
            }
            (Some(_), None) => Err(Fault::new(span, format!("'{name}' is a function"))
                .hint(format!("write its argument in parentheses: '{name}(...)'"))),
            (None, Some(_)) if name == "pi" => Err(missing_operator(span, "pi")),
            (None, Some(_)) => {
                let known = self.vocabulary.functions().map(|(known, _)| *known);
                let near = did_you_mean(&name, known.clone());
                let fault = Fault::new(span, format!("unknown function '{name}'{near}"));
                Err(if near.is_empty() {
                    let known = known.collect::<Vec<_>>().join(", ");
                    fault.hint(format!(
                        "the functions are {known}; a product is written '{name}*(...)'"
                    ))
                } else {
                    fault
                })
            }
            (None, None) if name == "pi" => Ok(Ast::new(AstKind::Pi, span)),
            (None, None) => Ok(Ast::new(AstKind::Name(name), span)),
        }
    }

    fn dotted(&self, token: Token) -> Result<Ast, Fault> {
        let (span, text) = (self.span_of(token), self.text_of(token));
        if self.vocabulary == Vocabulary::Coordinates {
            return Ok(Ast::new(AstKind::Variable(text.to_owned()), span));
        }
        Err(Fault::new(span, format!("'{text}' is not allowed here"))
            .hint("names consist of letters, digits and '_'; only couplings contain coordinates such as 's1.1'"))
    }

    /// The error about a token where an operator is expected.
    fn leftover(&self, token: Token) -> Fault {
        let (span, text) = (self.span_of(token), self.text_of(token));
        match token.kind {
            TokenKind::Symbol('(') => missing_operator(span, text),
            TokenKind::Symbol(')') => Fault::new(span, "this ')' closes nothing"),
            TokenKind::Symbol(_) => Fault::new(span, format!("unexpected '{text}'")),
            _ => missing_operator(span, text),
        }
    }
}

fn missing_operator(span: Span, text: &str) -> Fault {
    let hint = match text {
        "deg" => "angles are in rad; one in degrees is written 'deg(90)'",
        "mm" => "lengths are in m: 5 mm are '5/1000'",
        "m" | "rad" | "kg" => "units are not written; lengths are in m, angles in rad",
        _ => "products are written with '*', as in '2*a'",
    };
    Fault::new(span, format!("an operator is missing at '{text}'")).hint(hint)
}
