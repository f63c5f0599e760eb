//! Collects the errors of a phase.

use super::{Diagnostic, Report, Source};

/// Number of errors after which costly checks may stop.
const MAX_ERRORS: usize = 500;

/// Collects every error of a phase.
///
/// [`Sink::finish`] must be called to get the errors: losing them is a bug of the caller, so builds
/// with debug assertions panic if a sink with errors is dropped.
#[derive(Debug, Default)]
#[must_use = "errors are lost unless `finish` is called"]
pub struct Sink {
    diagnostics: Vec<Diagnostic>,
}

impl Sink {
    /// An empty sink.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an error.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        self.diagnostics.push(diagnostic);
    }

    /// Number of errors so far.
    pub fn len(&self) -> usize {
        self.diagnostics.len()
    }

    /// Whether there is no error so far.
    pub fn is_empty(&self) -> bool {
        self.diagnostics.is_empty()
    }

    /// Whether there are so many errors that costly checks may stop: nobody reads that many.
    pub fn is_full(&self) -> bool {
        self.diagnostics.len() >= MAX_ERRORS
    }

    /// Ends the phase.
    ///
    /// # Errors
    /// A report with all errors, if there are any.
    pub fn finish(mut self, source: &Source) -> Result<(), Report> {
        let diagnostics = std::mem::take(&mut self.diagnostics);
        if diagnostics.is_empty() {
            Ok(())
        } else {
            Err(Report::new(source.clone(), diagnostics))
        }
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        if cfg!(debug_assertions) && !std::thread::panicking() {
            assert!(
                self.diagnostics.is_empty(),
                "errors dropped without being reported: {:?}",
                self.diagnostics
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::Span;

    #[test]
    fn an_empty_sink_finishes_without_error() {
        assert_eq!(Sink::new().finish(&Source::new("f", "")), Ok(()));
    }

    #[test]
    fn finish_returns_errors_in_the_order_of_the_file() {
        let mut sink = Sink::new();
        sink.push(Diagnostic::new(Span::new(3, 4), "later"));
        sink.push(Diagnostic::new(Span::new(1, 2), "earlier"));
        let report = sink.finish(&Source::new("f", "abcdef"));
        let messages = report.map_err(|report| {
            report
                .diagnostics
                .iter()
                .map(|diagnostic| diagnostic.message.clone())
                .collect::<Vec<_>>()
        });
        assert_eq!(messages, Err(vec!["earlier".into(), "later".into()]));
    }

    #[test]
    #[cfg(debug_assertions)]
    #[should_panic(expected = "errors dropped without being reported")]
    fn dropping_unreported_errors_panics() {
        let mut sink = Sink::new();
        sink.push(Diagnostic::new(Span::default(), "lost"));
    }
}
