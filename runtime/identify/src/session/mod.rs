//! One identification, from logs to the model that is adopted: what all estimators share, and the
//! models that are found from one start.

mod compare;
mod cross;
mod delays;
mod error;
mod knowledge;
mod physical;
mod reduction;
mod start;
mod watch;

use std::path::PathBuf;

use regen_runtime::BaseModel;

use crate::data::{DataError, Logs, Settings};
use crate::identify::{EquationKind, Options};

pub use compare::{LogError, compare, residuals_of};
pub use cross::{CrossValidation, cross};
pub use delays::settled_delays;
pub use error::SessionError;
pub use knowledge::{PriorKnowledge, Trust};
pub use physical::{physical, scale};
pub use reduction::{adopt, reduction};
pub use start::{Start, describe, from_factors, from_logs, with_friction};
pub use watch::{Monitor, MonitoredLogs, Silent};

/// What every step of an identification shares.
pub struct Session<'a, M: ?Sized> {
    /// The model.
    pub model: &'a M,
    /// How logs are read.
    pub reading: Settings,
    /// Which equations are used.
    pub kind: EquationKind,
    /// How least squares is solved.
    pub options: Options,
    /// The level of confidence intervals.
    pub confidence: f64,
    /// Who follows long work.
    pub watch: &'a dyn Monitor,
}

impl<'a, M: BaseModel<f64> + ?Sized> Session<'a, M> {
    /// Opens logs, which are checked first; passes over them are watched.
    ///
    /// # Errors
    /// What keeps a log from being read.
    pub fn open(&self, paths: &[PathBuf]) -> Result<MonitoredLogs<'a, M>, DataError> {
        let names: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
        self.watch.work(&format!("checking {}", names.join(", ")));
        let logs = Logs::open(self.model, paths, &self.reading);
        self.watch.rest();
        Ok(MonitoredLogs::new(
            logs?,
            self.reading.decimation,
            self.watch,
        ))
    }
}
