//! Reads YAML and validates it as a robot spec.
//!
//! Reading has phases, each of which reports all its errors before the next one starts: the YAML
//! itself; the shape of the records (`raw.rs` lists their keys); names, labels and references;
//! values. Nothing here depends on dynamics.
//!
//! Files may come from untrusted sources, so everything has a limit, and an error reports it if it
//! is exceeded: 1 MiB of text, 64 levels and 20,000 nodes with aliases expanded (`yaml.rs`); 10,000
//! characters, 100 levels and 500 operations in a chain for an expression, every value between the
//! smallest and the largest double (`expression`); 256 coordinates, 384 bodies, 640 equations of
//! cuts and couplings (`check/limits.rs`); base parameters are derived for up to 1500 parameters
//! (`crate::base::MAX_PARAMETERS`).

mod brackets;
mod check;
mod drives;
pub mod edit;
mod expression;
mod friction;
mod joints;
mod labels;
mod payloads;
mod physical;
mod raw;
mod resolve;
mod schema;
mod shape;
mod springs;
mod suggest;
mod types;
mod yaml;

pub(crate) use expression::{Ast, AstKind, Operator};
pub use joints::{CutRow, MotionKind};
pub use payloads::Payloads;
pub use physical::{Flaw, flaw};
pub(crate) use resolve::adjustable::possible as possible_arguments;
pub use schema::schema;
pub use suggest::nearest;
pub use types::*;
pub use yaml::MAX_BYTES;

use crate::diag::{Diagnostic, Report, Sink, Source, Span};
use shape::{Reader, Shape};

/// Reads and validates a spec.
///
/// # Errors
/// A report with all errors of the first phase that finds some.
///
/// ```
/// use regen_codegen::diag::Source;
/// use regen_codegen::spec::parse;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let spec = parse(&Source::new("arm.yaml", text))?;
/// assert_eq!(spec.limbs[0].joints.len(), 1);
/// assert!(parse(&Source::new("arm.yaml", "name: arm")).is_err());
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn parse(source: &Source) -> Result<Spec, Report> {
    let document = yaml::load(source)?;
    let mut reader = Reader::new();
    let raw = raw::RawSpec::read(&document, &mut reader);
    let raw = complete(raw, reader.into_sink(), source)?;
    let mut sink = Sink::new();
    check::check(&raw, &mut sink);
    sink.finish(source)?;
    let mut sink = Sink::new();
    let spec = resolve::resolve(&raw, &mut sink);
    complete(spec, sink, source)
}

/// The result of a phase: its errors if there are any, else its value.
fn complete<T>(result: Option<T>, sink: Sink, source: &Source) -> Result<T, Report> {
    sink.finish(source)?;
    result.ok_or_else(|| {
        let unexplained = Diagnostic::new(Span::default(), "the file cannot be read as a robot");
        Report::new(source.clone(), vec![unexplained])
    })
}

/// The syntax tree of an expression in numbers and names, with places counted from the start of the
/// text; `None` if the text is not an expression.
pub(crate) fn syntax(text: &str) -> Option<Ast> {
    let whole = Span::new(0, text.len());
    expression::parse(text, whole, Some(0), expression::Vocabulary::Constants).ok()
}

impl Spec {
    /// The exact value of an expression in numbers and geometry names; `None` if the text is not an
    /// expression or has no such value.
    pub fn evaluate(&self, text: &str) -> Option<crate::sym::Number> {
        let ast = syntax(text)?;
        let geometry = &self.geometry;
        let lookup = |name: &str| {
            let found = geometry.iter().find(|(n, _)| n.value == name);
            found.map(|(_, quantity)| quantity.value.clone())
        };
        expression::evaluate(&ast, &lookup).ok()
    }
}
