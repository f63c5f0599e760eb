//! Reports mistakes in JSON files at their places, with a remedy.

use regen_codegen::diag::{Diagnostic, Report, Source, Span};
use regen_identify::files::{Mistake, Mistakes, Remedy};

use crate::exit::Failure;

/// The failure of a file with mistakes; `other_file` is the hint for a file of another kind, and
/// names the file to give instead.
pub(crate) fn failure(source: Source, mistakes: Mistakes, other_file: &str) -> Failure {
    let shown = |mistake: Mistake| {
        let span = Span::new(mistake.at, mistake.at + 1);
        let shown = Diagnostic::new(span, mistake.message).path(mistake.path);
        match mistake.remedy {
            Some(Remedy::Words(words)) => shown.hint(words),
            Some(_) => shown.hint(other_file),
            None => shown,
        }
    };
    let shown = mistakes.0.into_iter().map(shown).collect();
    Report::new(source, shown).into()
}
