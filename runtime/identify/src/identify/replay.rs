//! Stores a log's equations for repeated passes over them.

use super::equation_builder::{EquationKind, Equations};
use super::passes::Source;
use super::stream::{Columns, LeftOut, NoColumns, equations};
use crate::estimate::EstimateError;
use regen_runtime::BaseModel;

/// Most numbers that are stored: 64 MiB. Longer logs are read again in each pass, so that memory
/// does not grow with them.
const MAX_NUMBERS: usize = 1 << 23;

/// The equations of a log: computed in the first pass and stored, unless there are too many.
pub(crate) struct Replay<'a, M: ?Sized, S: ?Sized> {
    model: &'a M,
    kind: EquationKind,
    source: &'a mut S,
    columns: Box<dyn Columns + 'a>,
    /// The most numbers that are stored.
    most: usize,
    stored: ReplayBlock,
    left_out: LeftOut,
}

/// Stored equations.
#[derive(Default)]
struct ReplayBlock {
    state: State,
    /// Sample by sample: `w`, `tau`, `weights`.
    values: Vec<f64>,
    samples: Vec<Sample>,
}

#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum State {
    #[default]
    Empty,
    Complete,
    TooMany,
}

struct Sample {
    time: f64,
    /// The number of equations.
    rows: usize,
    /// The end of the sample's numbers in `values`.
    end: usize,
    follows: bool,
}

impl ReplayBlock {
    fn push(&mut self, equations: &Equations<'_>, most: usize) {
        let Equations {
            w, tau, weights, ..
        } = equations;
        if self.state == State::TooMany {
            return;
        }
        if self.values.len() + w.len() + 2 * tau.len() > most {
            self.state = State::TooMany;
            (self.values, self.samples) = (vec![], vec![]);
            return;
        }
        for part in [w, tau, weights] {
            self.values.extend_from_slice(part);
        }
        self.samples.push(Sample {
            time: equations.time,
            rows: tau.len(),
            end: self.values.len(),
            follows: equations.follows,
        });
    }
}

impl<'a, M: BaseModel<f64> + ?Sized, S: Source + ?Sized> Replay<'a, M, S> {
    pub(crate) fn new(model: &'a M, kind: EquationKind, source: &'a mut S) -> Self {
        Self::with_columns(model, kind, source, Box::new(NoColumns))
    }

    /// As [`new`](Self::new), with columns in addition to those of the base parameters.
    pub(crate) fn with_columns(
        model: &'a M,
        kind: EquationKind,
        source: &'a mut S,
        columns: Box<dyn Columns + 'a>,
    ) -> Self {
        Self {
            model,
            kind,
            source,
            columns,
            most: MAX_NUMBERS,
            stored: ReplayBlock::default(),
            left_out: LeftOut::default(),
        }
    }

    /// Limits the memory to the share of one of several logs.
    pub(crate) fn shared(self, logs: usize) -> Self {
        Self {
            most: MAX_NUMBERS / logs.max(1),
            ..self
        }
    }

    pub(crate) fn model(&self) -> &'a M {
        self.model
    }

    pub(crate) fn kind(&self) -> EquationKind {
        self.kind
    }

    /// The samples and equations that the last pass over the log left out.
    pub(crate) fn left_out(&self) -> &LeftOut {
        &self.left_out
    }

    /// Passes the equations of all samples to `each` in order of time.
    pub(crate) fn visit(
        &mut self,
        each: &mut dyn FnMut(&Equations<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), S::Error> {
        if self.stored.state == State::Complete {
            let mut start = 0;
            for sample in &self.stored.samples {
                let values = &self.stored.values[start..sample.end];
                start = sample.end;
                let (w, rest) = values.split_at(values.len() - 2 * sample.rows);
                let (tau, weights) = rest.split_at(sample.rows);
                each(&Equations {
                    time: sample.time,
                    w,
                    tau,
                    weights,
                    follows: sample.follows,
                })?;
            }
            return Ok(());
        }
        let (stored, most) = (&mut self.stored, self.most);
        self.left_out = equations(
            self.model,
            self.kind,
            self.source,
            &mut *self.columns,
            &mut |rows| {
                stored.push(rows, most);
                each(rows)
            },
        )?;
        if stored.state == State::Empty {
            stored.state = State::Complete;
        }
        Ok(())
    }
}
