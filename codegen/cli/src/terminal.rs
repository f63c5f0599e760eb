//! Standard output and standard error.

use std::borrow::Cow;
use std::io::{self, IsTerminal, Write};

use crate::call;
use crate::exit::Failure;

/// Writes a result to standard output.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let text = &*visible(text);
    if call::print(text) {
        return Ok(());
    }
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .map_err(|error| match error.kind() {
            io::ErrorKind::BrokenPipe => Failure::BrokenPipe,
            _ => Failure::Io(format!("cannot write to standard output: {error}")),
        })
}

/// Writes a message to standard error; a failure to write is ignored, since nothing can be done.
pub(crate) fn note(text: &str) {
    colored_note(&visible(text));
}

/// Writes a message that may have colours.
fn colored_note(text: &str) {
    if call::note(text) {
        return;
    }
    let _ = writeln!(io::stderr(), "{text}");
}

/// The message of an error: a path or a name of any length may be in it, and a terminal is not to be filled with it.
fn readable(text: &str) -> String {
    /// The longest word of a message, in characters; the longest path of most systems.
    const LONGEST: usize = 4096;
    /// What is kept of a longer one.
    const KEPT: usize = 80;
    let words = text.split_inclusive(char::is_whitespace);
    let cut = words.map(|word| {
        if word.len() <= LONGEST {
            return Cow::Borrowed(word);
        }
        let kept: String = word.chars().take(KEPT).collect();
        let space: String = word
            .chars()
            .next_back()
            .filter(|c| c.is_whitespace())
            .into_iter()
            .collect();
        Cow::Owned(format!(
            "{kept}... ({} characters){space}",
            word.chars().count()
        ))
    });
    visible(&cut.collect::<String>()).into_owned()
}

/// A text whose control characters, but for the ends of lines and tabs, are written as escapes: names of
/// files may contain them, and a terminal would obey.
fn visible(text: &str) -> Cow<'_, str> {
    let obeyed = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if !text.contains(obeyed) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if obeyed(c) {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

/// Prints on standard error why the run ended.
pub(crate) fn complain(failure: &Failure) {
    let color = colored();
    match failure {
        Failure::BrokenPipe => {}
        Failure::Interrupted(text) => note(text),
        Failure::Spec(reports) => {
            for report in reports {
                colored_note(report.render(color).trim_end());
            }
        }
        other if color => colored_note(&format!(
            "\x1b[1;31merror\x1b[0m\x1b[1m:\x1b[0m {}",
            readable(&other.to_string())
        )),
        other => note(&readable(&format!("error: {other}"))),
    }
}

/// Whether messages are coloured: on a terminal that supports it, unless `NO_COLOR` is set.
fn colored() -> bool {
    let wanted = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let supported = std::env::var_os("TERM").is_none_or(|term| term != "dumb");
    wanted && supported && io::stderr().is_terminal()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_of_names_are_shown_and_not_obeyed() {
        assert_eq!(
            visible("a\u{1b}[31mb\r.csv\n\tc"),
            "a\\u{1b}[31mb\\r.csv\n\tc"
        );
        assert_eq!(visible("q\u{9b}2J"), "q\\u{9b}2J");
        assert!(matches!(visible("Gelenk äöü 关节\n"), Cow::Borrowed(_)));
    }

    #[test]
    fn a_name_of_any_length_leaves_a_message_short_and_whole_words() {
        let long = "x".repeat(100_000);
        let text = readable(&format!("cannot read {long} here\nthere"));
        assert!(
            text.len() < 200 && text.ends_with("... (100001 characters) here\nthere"),
            "{text}"
        );
        let usual = format!("cannot read {}: no file\n", "d/".repeat(1000));
        assert_eq!(readable(&usual), usual);
    }
}
