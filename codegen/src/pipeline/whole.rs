//! Derives a whole robot in one call.

use std::error::Error;
use std::fmt;

use super::Mechanism;
use crate::base::{self, StoreProblem};
use crate::diag::{Report, Source};
use crate::robot::{FunctionKind, Robot};
use crate::signature::{Needs, Trait};

/// Where [`derive_with`] gets the base parameters and their certificate from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BaseSource<'a> {
    /// Base parameters are neither derived nor read: the robot has no base parameters and none of
    /// the functions that need them.
    Skip,
    /// The base parameters are derived, however long that takes.
    Derivation,
    /// `Store(Some(text))`: the base parameters are read from the text that [`base::store`] wrote.
    ///
    /// `Store(None)`: there is no such text. The base parameters are then derived if that is quick;
    /// if [`base::is_slow_in_debug`], [`derive_with`] returns [`DeriveError::NotStored`].
    Store(Option<&'a str>),
}

/// Why a robot could not be derived.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum DeriveError {
    /// The spec has errors, or its mechanism has one of the problems that
    /// [`Mechanism::analysis`] reports.
    Spec(Box<Report>),
    /// The stored base parameters belong to another version of the spec, or are malformed.
    Store(StoreProblem),
    /// Deriving the base parameters takes long ([`base::is_slow_in_debug`]), and no stored ones
    /// were given.
    NotStored,
}

impl fmt::Display for DeriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Spec(report) => report.fmt(f),
            Self::Store(problem) => write!(f, "the file of stored base parameters {problem}"),
            Self::NotStored => f.write_str(
                "the base parameters of this robot take long to derive, and none are stored",
            ),
        }
    }
}

impl Error for DeriveError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Spec(report) => Some(report.as_ref()),
            Self::Store(problem) => Some(problem),
            Self::NotStored => None,
        }
    }
}

impl From<Report> for DeriveError {
    fn from(report: Report) -> Self {
        DeriveError::Spec(Box::new(report))
    }
}

/// Derives a robot with the functions of generated sources from the text of its spec
/// ([`Mechanism::functions`], [`Mechanism::source_robot`]). A robot with more than
/// [`base::MAX_PARAMETERS`] parameters gets no base parameters and none of the functions that need
/// them.
///
/// # Errors
/// A report with the place of every mistake of syntax, names and values in the spec, or of one of
/// the problems that [`Mechanism::analysis`] lists. Too many parameters are not an error here.
///
/// ```
/// use regen_codegen::diag::Source;
/// use regen_codegen::pipeline::derive;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let robot = derive(&Source::new("arm.yaml", text))?;
/// assert_eq!(robot.coordinates, ["q1"]);
/// assert_eq!(robot.independent, [0]);
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn derive(source: &Source) -> Result<Robot, Report> {
    let mechanism = Mechanism::open(source)?;
    mechanism.source_robot(&mechanism.functions())
}

/// Derives a robot from the text of its spec, with the base parameters from the source `from`. A
/// robot with more than [`base::MAX_PARAMETERS`] parameters gets none, whatever the source.
///
/// # Errors
/// [`DeriveError::Spec`] as [`derive()`], [`DeriveError::Store`] if the stored base parameters
/// cannot be used, [`DeriveError::NotStored`] if there are none and deriving them takes long.
pub fn derive_with(source: &Source, from: BaseSource<'_>) -> Result<Robot, DeriveError> {
    let mut mechanism = Mechanism::open(source)?;
    // report mistakes in the spec before those in the stored base parameters
    mechanism.closed()?;
    let few_enough_parameters =
        base::has_few_enough_parameters(&mechanism.model) && mechanism.spec.adjustable.is_empty();
    match from {
        BaseSource::Skip => {
            let mut functions = mechanism.functions();
            functions.retain(|kind| kind.signature().needs != Needs::Base);
            return Ok(mechanism.source_robot(&functions)?);
        }
        BaseSource::Store(Some(text)) if few_enough_parameters => {
            mechanism.load_base(text).map_err(DeriveError::Store)?;
        }
        BaseSource::Store(None)
            if few_enough_parameters && base::is_slow_in_debug(&mechanism.model) =>
        {
            return Err(DeriveError::NotStored);
        }
        BaseSource::Store(_) | BaseSource::Derivation => {}
    }
    Ok(mechanism.source_robot(&mechanism.functions())?)
}

/// The kinds of the functions that every robot has: those of the trait `Model`.
pub fn functions_without_base() -> Vec<FunctionKind> {
    let all = FunctionKind::ALL.into_iter();
    all.filter(|kind| kind.signature().of == Trait::Model)
        .collect()
}
