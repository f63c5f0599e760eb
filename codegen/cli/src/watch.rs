//! A bar on a terminal's standard error while logs are read.

use indicatif::ProgressBar;
use regen_identify::data::{DataError, Logs};
use regen_identify::estimate::EstimateError;
use regen_identify::identify::{Filtering, Row, Source};

use crate::progress;
use regen_interpreted::Interpreted;

/// Rows between two steps of a bar.
const EVERY: u64 = 64;

/// Logs that show how far a pass over them is, and the time it has left.
pub(crate) struct Watched<'m> {
    logs: Logs<'m, Interpreted<'m>>,
    bar: ProgressBar,
    passes: usize,
}

impl<'m> Watched<'m> {
    /// Watches logs whose states are taken with this decimation.
    pub(crate) fn new(logs: Logs<'m, Interpreted<'m>>, decimation: usize) -> Self {
        let rows: usize = logs.reports().iter().map(|report| report.rows).sum();
        let length = (rows / decimation.max(1)) as u64;
        let bar = progress::bar(length, "{msg} {bar:24} {pos}/{len} rows, {eta} left");
        Self {
            logs,
            bar,
            passes: 0,
        }
    }

    /// The logs.
    pub(crate) fn logs(&self) -> &Logs<'m, Interpreted<'m>> {
        &self.logs
    }
}

impl Source for Watched<'_> {
    type Error = DataError;

    fn filtering(&self) -> Filtering {
        self.logs.filtering()
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&Row<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError> {
        self.passes += 1;
        self.bar.reset();
        self.bar.set_message(format!("pass {}", self.passes));
        let mut rows = 0;
        let bar = &self.bar;
        self.logs.visit(&mut |row| {
            rows += 1;
            if rows % EVERY == 0 {
                bar.set_position(rows);
            }
            each(row)
        })
    }
}

impl Drop for Watched<'_> {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
