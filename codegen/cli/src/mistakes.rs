//! Reports mistakes in JSON files at their places, with a remedy.

use regen_codegen::diag::{Diagnostic, Report, Source, Span};
use regen_identify::files::{Mistake, Mistakes, Remedy};

use crate::exit::Failure;

/// The failure of a file with mistakes; `other_file` is the hint for a file of another kind, and
/// names the file to give instead.
pub(crate) fn failure(source: Source, mistakes: Mistakes, other_file: &str) -> Failure {
    let diagnostic = |mistake: Mistake| {
        let span = Span::new(mistake.at, mistake.at + 1);
        let diagnostic = Diagnostic::new(span, mistake.message).path(mistake.path);
        match mistake.remedy {
            Some(Remedy::Words(words)) => diagnostic.hint(words),
            Some(_) => diagnostic.hint(other_file),
            None => diagnostic,
        }
    };
    let diagnostics = mistakes.0.into_iter().map(diagnostic).collect();
    Report::new(source, diagnostics).into()
}
