//! The rows of a table: combinations of parameters, as plain text.

use crate::base::{Exactness, Provenance};

use super::factor::{Factor, Signed};
use super::words::{layer, mark};

/// A term of a combination: a factor, and the parameter's label as plain text and as LaTeX.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) signed: Signed,
    pub(super) label: String,
    pub(super) latex: String,
}

/// A combination, with the layer of the derivation that proved it and the exactness of its factors.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// The payload that the combination belongs to; `None` for the robot's own.
    pub(super) payload: Option<String>,
    pub(super) parts: Vec<Part>,
    pub(super) layer: Provenance,
    pub(super) exactness: Exactness,
}

impl Part {
    /// The sign before the term at index `k`; none before a first, positive term.
    pub(super) fn sign(&self, k: usize) -> &'static str {
        match (k, self.signed.negative) {
            (0, false) => "",
            (0, true) => "-",
            (_, false) => " + ",
            (_, true) => " - ",
        }
    }

    pub(super) fn plain(&self, k: usize) -> String {
        let factor = match &self.signed.factor {
            Factor::One => String::new(),
            Factor::Expression(sum) if sum.is_sum() => format!("({sum}) "),
            Factor::Expression(expression) => format!("{expression} "),
            Factor::Number(text) => format!("{text} "),
            Factor::Instead(text) => format!("~{text} "),
        };
        format!("{}{factor}{}", self.sign(k), self.label)
    }
}

impl Row {
    /// The layer, with a mark if the factors are not known as functions of the geometry names.
    pub(super) fn provenance(&self) -> String {
        format!("{}{}", layer(self.layer), mark(self.exactness))
    }

    pub(super) fn plain(&self) -> String {
        let parts = self.parts.iter().enumerate();
        parts.map(|(k, part)| part.plain(k)).collect()
    }

    /// The combination in lines of at most this width, broken between terms or, where a term is
    /// longer than a line, within it.
    pub(super) fn lines(&self, width: usize) -> Vec<String> {
        let mut lines = vec![String::new()];
        let mut append = |piece: &str, joint: &str| {
            let fits = |line: &String| {
                line.is_empty() || line.chars().count() + (joint.len() + piece.len()) <= width
            };
            match lines.last_mut() {
                Some(line) if fits(line) => {
                    if !line.is_empty() {
                        line.push_str(joint);
                    }
                    line.push_str(piece);
                }
                _ => lines.push(piece.to_owned()),
            }
        };
        for (k, part) in self.parts.iter().enumerate() {
            let text = part.plain(k);
            let text = text.trim_start();
            if text.len() <= width {
                append(text, " ");
                continue;
            }
            let mut sign = String::new();
            for word in text.split(' ') {
                if matches!(word, "+" | "-") {
                    // a sign stays on the line of the term that it belongs to
                    word.clone_into(&mut sign);
                    sign.push(' ');
                    continue;
                }
                let word = std::mem::take(&mut sign) + word;
                for (n, piece) in pieces(&word, width).into_iter().enumerate() {
                    append(piece, if n == 0 { " " } else { "" });
                }
            }
        }
        lines
    }
}

/// Splits a word into pieces of at most this width, after an operator where possible.
fn pieces(word: &str, width: usize) -> Vec<&str> {
    let mut pieces = Vec::new();
    let mut rest = word;
    while rest.chars().count() > width {
        let limit = rest
            .char_indices()
            .nth(width)
            .map_or(rest.len(), |(at, _)| at);
        let end = rest[..limit]
            .rfind(['*', '/', '('])
            .map_or(limit, |at| at + 1);
        let (piece, after) = rest.split_at(end);
        pieces.push(piece);
        rest = after;
    }
    pieces.push(rest);
    pieces
}
