//! Logs held in memory.

use super::{Filtering, Source, StateSample};
use crate::estimate::EstimateError;

/// A log whose rows are held in memory: a [`Source`] for data that no file contains, such as
/// simulated motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recorded {
    rows: Vec<RecordedSample>,
    filtering: Filtering,
}

/// One row: the fields of [`StateSample`], owned.
#[derive(Clone, Debug, PartialEq)]
struct RecordedSample {
    time: f64,
    /// q, qd and qdd of all coordinates.
    motion: [Vec<f64>; 3],
    tau: Vec<f64>,
    efforts: Vec<f64>,
    held: Vec<f64>,
    /// [`StateSample::at_standstill`].
    still: Vec<bool>,
    weights: Vec<f64>,
    follows: bool,
    bridged: bool,
}

impl Recorded {
    /// Creates a log without rows, with the default [`Filtering`]: no filter, no decimation,
    /// equations at standstill left out.
    pub fn new() -> Self {
        Self::default()
    }

    /// Replaces the settings by which the log's equations are filtered.
    #[must_use]
    pub fn filtered(self, filtering: Filtering) -> Self {
        Self { filtering, ..self }
    }

    /// Adds a row that follows the last one without a gap. Its weights are 1; the measured efforts
    /// and the coordinates at standstill are not known.
    ///
    /// - `time`: s;
    /// - `q`, `qd`, `qdd`: all n coordinates with their velocities and accelerations, in rad or m,
    ///   and s;
    /// - `tau`: the generalized forces of the dof independent coordinates, N m or N, see
    ///   [`StateSample::tau`].
    ///
    /// The lengths are checked when the log is used, not here.
    pub fn push(&mut self, time: f64, q: &[f64], qd: &[f64], qdd: &[f64], tau: &[f64]) {
        self.rows.push(RecordedSample {
            time,
            motion: [q.to_vec(), qd.to_vec(), qdd.to_vec()],
            tau: tau.to_vec(),
            efforts: Vec::new(),
            held: Vec::new(),
            still: Vec::new(),
            weights: vec![1.0; tau.len()],
            follows: !self.rows.is_empty(),
            bridged: false,
        });
    }

    /// Adds a copy of a row with all its fields; `row.follows` is true if it follows the last one
    /// without a gap.
    pub fn push_row(&mut self, row: &StateSample<'_>) {
        self.rows.push(RecordedSample {
            time: row.time,
            motion: [row.q.to_vec(), row.qd.to_vec(), row.qdd.to_vec()],
            tau: row.tau.to_vec(),
            efforts: row.efforts.to_vec(),
            held: row.held.to_vec(),
            still: row.at_standstill.to_vec(),
            weights: row.weights.to_vec(),
            follows: row.follows,
            bridged: row.bridged,
        });
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

impl Source for Recorded {
    type Error = EstimateError;

    fn filtering(&self) -> Filtering {
        self.filtering
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), EstimateError> {
        for row in &self.rows {
            let [q, qd, qdd] = &row.motion;
            each(&StateSample {
                time: row.time,
                q,
                qd,
                qdd,
                tau: &row.tau,
                efforts: &row.efforts,
                held: &row.held,
                at_standstill: &row.still,
                weights: &row.weights,
                follows: row.follows,
                bridged: row.bridged,
            })?;
        }
        Ok(())
    }
}
