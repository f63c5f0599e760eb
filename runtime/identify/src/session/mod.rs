//! An identification session: the steps from logs to the adopted model.
//!
//! [`Session`] holds the model and the settings that all steps share. [`from_logs`],
//! [`from_factors`] or [`with_friction`] computes a least-squares estimate, [`with_gains`] one with
//! unknown gains and payloads; the other estimators
//! ([`physical()`], [`reduction()`]) start from it. [`compare()`] and [`cross()`] compute errors of
//! prediction.

mod alternatives;
mod choice;
mod compare;
mod cross;
mod cutoffs;
mod delays;
mod error;
mod knowledge;
mod loads;
mod motion_noise;
mod physical;
mod reduction;
mod start;
mod watch;

use regen_runtime::BaseModel;

use crate::data::{DataError, Logs, Run, Settings, ValuesFrom};
use crate::identify::{EquationKind, Options};

pub use alternatives::HUBER_BOUND;
pub use choice::{OpenChoices, chosen};
pub use compare::{LogError, compare, errors_with_columns, residuals_of};
pub use cross::{CrossValidation, cross};
pub use delays::{identified, settled_delays, settled_delays_within};
pub use error::SessionError;
pub use knowledge::{NominalTrust, PriorKnowledge};
pub use loads::{LoadedFits, gain_options, loaded_residuals, with_gains};
pub use physical::{physical, scale};
pub use reduction::{adopt, reduction};
pub use start::{LeastSquaresStart, delay_changes, from_factors, from_logs, with_friction};
pub use watch::{Monitor, MonitoredLogs, Silent};

/// Model and settings that all steps of an identification share.
pub struct Session<'a, M: ?Sized> {
    /// The robot whose base parameters are identified.
    pub model: &'a M,
    /// The settings for reading logs.
    pub reading: Settings,
    /// Whether least squares uses the equations of motion or energy balances.
    pub kind: EquationKind,
    /// The options of least squares.
    pub options: Options,
    /// The level of confidence intervals, in (0, 1), such as 0.95.
    pub confidence: f64,
    /// Receives the progress of long work.
    pub watch: &'a dyn Monitor,
}

impl<'a, M: ?Sized> Session<'a, M> {
    /// A session of the equations of motion with the default options, intervals of 95 % and no word of its progress.
    pub fn new(model: &'a M, reading: Settings) -> Self {
        Self {
            model,
            reading,
            kind: EquationKind::Forces,
            options: Options::default(),
            confidence: 0.95,
            watch: &Silent,
        }
    }
}

impl<M: ?Sized> Session<'_, M> {
    /// The same session, in which currents of unknown gain are read in A.
    #[must_use]
    pub fn in_amperes(&self) -> Self {
        self.with_reading(self.reading.clone().with_gains(&[]))
    }

    /// The same session with other settings for reading logs.
    pub(crate) fn with_reading(&self, reading: Settings) -> Self {
        Self { reading, ..*self }
    }
}

impl<'a, M: BaseModel<f64> + ?Sized> Session<'a, M> {
    /// Opens runs, or the paths of whole logs, and checks their rows. Whenever a later step reads the
    /// returned logs, it reports its progress to `watch`.
    ///
    /// # Errors
    /// When a log cannot be read or has faulty rows, see [`Logs::open`].
    pub fn open<R: Clone + Into<Run>>(
        &self,
        runs: &[R],
    ) -> Result<MonitoredLogs<'a, M>, DataError> {
        let names = runs.iter().map(|run| run.clone().into().to_string());
        let names: Vec<String> = names.collect();
        let mut columns = self.reading.columns.iter();
        let unmeasured = columns.find(|own| own.from == ValuesFrom::Unmeasured);
        if let (EquationKind::Energy { .. }, Some(own)) = (self.kind, unmeasured) {
            return Err(DataError::ColumnLayout {
                file: names.join(", "),
                why: format!(
                    "an energy balance needs the power of every effort, and {} is not measured: use the \
                     equations of motion",
                    own.quantity
                ),
            });
        }
        if matches!(self.kind, EquationKind::Energy { .. }) && self.reading.poses {
            return Err(DataError::ColumnLayout {
                file: names.join(", "),
                why: "poses at rest exchange no energy: use the equations of motion".to_owned(),
            });
        }
        self.watch.phase(&format!("checking {}", names.join(", ")));
        let logs = Logs::open(self.model, runs, &self.reading);
        self.watch.finished();
        Ok(MonitoredLogs::new(
            logs?,
            self.reading.decimation,
            self.watch,
        ))
    }
}
