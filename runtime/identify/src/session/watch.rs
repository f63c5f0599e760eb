//! Progress reports of long work, for example to a progress bar on a terminal.

use regen_runtime::BaseModel;

use crate::data::{DataError, Logs};
use crate::estimate::EstimateError;
use crate::states::{ChangedEfforts, Filtering, MotionSeries, Source, StateSample};

/// Number of rows between two reports of a pass.
const REPORT_INTERVAL_ROWS: u64 = 64;

/// Receives the progress of long work.
pub trait Monitor {
    /// Called when work of unknown length begins or reaches its next step; `what` describes the
    /// work in words.
    fn phase(&self, what: &str);
    /// Called when the work that [`phase`](Self::phase) or [`rows`](Self::rows) reported has ended.
    fn finished(&self);
    /// Called during a pass over logs when it has read `done` of `all` rows; `pass` counts from 1.
    fn rows(&self, pass: usize, done: u64, all: u64);
}

/// A monitor that ignores all reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Monitor for Silent {
    fn phase(&self, _what: &str) {}
    fn finished(&self) {}
    fn rows(&self, _pass: usize, _done: u64, _all: u64) {}
}

/// Logs whose passes report their progress to a monitor.
pub struct MonitoredLogs<'a, M: ?Sized> {
    logs: Logs<'a, M>,
    watch: &'a dyn Monitor,
    all: u64,
    passes: usize,
}

impl<'a, M: BaseModel<f64> + ?Sized> MonitoredLogs<'a, M> {
    /// Adds progress reports to logs; `decimation`: one of this many rows becomes a state.
    pub fn new(logs: Logs<'a, M>, decimation: usize, watch: &'a dyn Monitor) -> Self {
        let rows: usize = logs.reports().iter().map(|report| report.rows).sum();
        Self {
            logs,
            watch,
            all: (rows / decimation.max(1)) as u64,
            passes: 0,
        }
    }

    /// The logs.
    pub fn logs(&self) -> &Logs<'a, M> {
        &self.logs
    }
}

impl<M: BaseModel<f64> + ?Sized> Source for MonitoredLogs<'_, M> {
    type Error = DataError;

    fn filtering(&self) -> Filtering {
        self.logs.filtering()
    }

    fn effort_densities(&self) -> Result<Vec<f64>, DataError> {
        self.logs.effort_densities()
    }

    fn allow_fewer_states(&mut self, are_allowed: bool) -> usize {
        self.logs.allow_fewer_states(are_allowed)
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError> {
        self.passes += 1;
        self.watch.rows(self.passes, 0, self.all);
        let (mut states, watch, passes, all) = (0, self.watch, self.passes, self.all);
        let every = self.logs.states_every() as u64;
        let result = self.logs.visit(&mut |row| {
            states += 1;
            if states % REPORT_INTERVAL_ROWS == 0 {
                watch.rows(passes, states * every, all);
            }
            each(row)
        });
        self.watch.finished();
        result
    }

    fn changed_efforts(
        &mut self,
        beta: &[f64],
        motion: Option<&MotionSeries>,
        each: &mut dyn FnMut(&ChangedEfforts<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError> {
        self.watch.phase("comparing derivatives");
        let result = self.logs.changed_efforts(beta, motion, each);
        self.watch.finished();
        result
    }
}
