//! Stores a log's equations for repeated passes over them.

use super::equation_builder::{EquationBuilder, EquationKind, Equations};
use super::stored::StoredEquations;
use super::stream::{Columns, LeftOut, NoColumns, equations_with_friction};
use crate::estimate::{EstimateError, FilteredNoise, Origin};
use crate::states::Source;
use regen_runtime::BaseModel;

/// The largest number of values that are stored: 512 MiB. The equations of longer logs are computed again in each
/// pass.
const MAX_NUMBERS: usize = 1 << 26;

/// The equations of a log: computed in the first pass and stored, unless there are too many.
pub(crate) struct Replay<'a, M: ?Sized, S: ?Sized> {
    model: &'a M,
    kind: EquationKind,
    source: &'a mut S,
    columns: Box<dyn Columns + 'a>,
    /// The labels of the additional columns that have parameters of their own, see
    /// [`with_parameters`](Self::with_parameters).
    more: Vec<String>,
    /// The base parameters around which the right-hand sides are linearised; see
    /// [`linearised`](Self::linearised).
    around: Option<&'a [f64]>,
    /// For each effort the deviation of static friction over that of the other errors; empty if not known.
    static_friction: Vec<f64>,
    /// The largest number of values that are stored.
    most: usize,
    state: State,
    stored: StoredEquations,
    left_out: LeftOut,
    spacing: Spacing,
}

/// The time between equations that follow each other.
#[derive(Clone, Copy, Debug, Default)]
struct Spacing {
    /// The time of the last equation, s.
    last: Option<f64>,
    sum: f64,
    count: usize,
    least: f64,
    most: f64,
}

/// Equations are evenly spaced if no two of them are so many times further apart than others.
const MAX_UNEVEN: f64 = 1.5;

impl Spacing {
    fn push(&mut self, time: f64, follows: bool) {
        if let (true, Some(last)) = (follows, self.last) {
            let own = time - last;
            self.least = if self.count == 0 {
                own
            } else {
                own.min(self.least)
            };
            self.most = own.max(self.most);
            self.sum += own;
            self.count += 1;
        }
        self.last = Some(time);
    }

    /// Their mean, s; `None` if there are no two such equations, or they are not evenly spaced.
    fn even(&self) -> Option<f64> {
        let is_even = self.count > 0 && self.most <= MAX_UNEVEN * self.least;
        is_even.then(|| self.sum / self.count as f64)
    }
}

#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum State {
    #[default]
    Empty,
    Complete,
    TooMany,
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
            more: Vec::new(),
            around: None,
            static_friction: Vec::new(),
            most: MAX_NUMBERS,
            state: State::Empty,
            stored: StoredEquations::default(),
            left_out: LeftOut::default(),
            spacing: Spacing::default(),
        }
    }

    /// As [`with_columns`](Self::with_columns), with a parameter for each of these columns.
    ///
    /// - `labels`: one for each column.
    pub(super) fn with_parameters(
        model: &'a M,
        source: &'a mut S,
        columns: Box<dyn Columns + 'a>,
        labels: &[String],
    ) -> Self {
        Self {
            more: labels.to_vec(),
            ..Self::with_columns(model, EquationKind::Forces, source, columns)
        }
    }

    /// The robot, the model, the kind and the labels of the equations.
    pub(super) fn origin(&self) -> Origin {
        let mut origin = EquationBuilder::new(self.model, self.kind).origin();
        origin.labels.extend(self.more.iter().cloned());
        origin
    }

    /// The log, and the additional columns.
    pub(super) fn source_and_columns(&mut self) -> (&mut S, &mut dyn Columns) {
        (self.source, &mut *self.columns)
    }

    /// Passes on, in place of the equations `tau = W x`, those of the additional columns, `e + J around =
    /// J x`: first the derivatives J of predicted right-hand sides at the base parameters `around`, then
    /// the difference e of measured and predicted ones.
    pub(super) fn linearised(self, around: &'a [f64]) -> Self {
        Self {
            around: Some(around),
            ..self
        }
    }

    /// Replaces the additional columns; the equations are computed again in the next pass.
    pub(crate) fn set_columns(&mut self, columns: Box<dyn Columns + 'a>) {
        self.columns = columns;
        self.state = State::Empty;
        self.stored = StoredEquations::default();
    }

    /// See [`set_static_friction`](Self::set_static_friction).
    pub(super) fn static_friction(&self) -> &[f64] {
        &self.static_friction
    }

    /// States, for each effort, the deviation of static friction over that of the other errors; the equations
    /// are computed again in the next pass.
    pub(super) fn set_static_friction(&mut self, ratios: Vec<f64>) {
        self.static_friction = ratios;
        self.state = State::Empty;
        self.stored = StoredEquations::default();
    }

    /// Limits the memory to the share of one of several logs.
    pub(crate) fn shared(self, logs: usize) -> Self {
        Self {
            most: MAX_NUMBERS / logs.max(1),
            ..self
        }
    }

    /// Stores nothing, for a single pass.
    pub(crate) fn once(self) -> Self {
        Self { most: 0, ..self }
    }

    pub(crate) fn model(&self) -> &'a M {
        self.model
    }

    pub(crate) fn kind(&self) -> EquationKind {
        self.kind
    }

    /// The log that the equations come from.
    pub(crate) fn source(&mut self) -> &mut S {
        self.source
    }

    /// What the filter makes of white noise of the efforts, at the equations of the last pass over the log.
    pub(crate) fn filtered_noise(&self) -> FilteredNoise {
        match (self.kind, self.spacing.even()) {
            (EquationKind::Forces, Some(spacing)) => self.source.filtering().noise(spacing),
            _ => FilteredNoise::unfiltered(),
        }
    }

    /// The variances of white noise that is as dense as that of the efforts, in each of the equations of the last pass
    /// over the log; none where they are not known.
    ///
    /// # Errors
    /// When the log cannot be read.
    pub(super) fn white_noise(&self) -> Result<Vec<f64>, S::Error> {
        let info = self.model.info();
        let are_efforts = self.kind == EquationKind::Forces && info.actuated == info.independent;
        match self.spacing.even().filter(|_| are_efforts) {
            Some(spacing) => {
                let densities = self.source.effort_densities()?;
                Ok(densities.iter().map(|own| own / spacing).collect())
            }
            None => Ok(Vec::new()),
        }
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
        if self.state == State::Complete {
            return Ok(self.stored.visit(each)?);
        }
        let (state, stored, most) = (&mut self.state, &mut self.stored, self.most);
        self.spacing = Spacing::default();
        let spacing = &mut self.spacing;
        let around = self.around;
        let mut sides = Vec::new();
        self.left_out = equations_with_friction(
            &self.static_friction,
            self.model,
            self.kind,
            self.source,
            &mut *self.columns,
            &mut |found| {
                spacing.push(found.time, found.follows);
                let linearised = around.map(|around| linearised(found, around, &mut sides));
                let found = linearised.as_ref().unwrap_or(found);
                if *state == State::Empty {
                    if stored.numbers() + found.w.len() + 2 * found.tau.len() > most {
                        *state = State::TooMany;
                        *stored = StoredEquations::default();
                    } else {
                        stored.push(found);
                    }
                }
                each(found)
            },
        )?;
        if *state == State::Empty {
            *state = State::Complete;
        }
        Ok(())
    }

    /// The stored equations; `None` if there were too many, or no pass yet.
    pub(crate) fn into_stored(self) -> Option<StoredEquations> {
        (self.state == State::Complete).then_some(self.stored)
    }
}

/// The equations of the additional columns of others; see [`Replay::linearised`].
///
/// - `sides`: receives the right-hand sides.
fn linearised<'s>(found: &Equations<'s>, around: &[f64], sides: &'s mut Vec<f64>) -> Equations<'s> {
    let count = found.tau.len();
    let size = count * around.len();
    let (_, more) = found.w.split_at(size.min(found.w.len()));
    let (derivatives, difference) = more.split_at(size.min(more.len()));
    sides.clear();
    sides.extend_from_slice(difference);
    for (column, x) in derivatives.chunks_exact(count.max(1)).zip(around) {
        for (side, j) in sides.iter_mut().zip(column) {
            *side += j * x;
        }
    }
    Equations {
        w: derivatives,
        tau: sides,
        ..*found
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::states::{Recorded, StateSample};

    #[allow(unreachable_pub, dead_code, reason = "a model of other tests")]
    mod models {
        include!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../tests/models/pendulum.rs"
        ));
        include!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../tests/models/pendulum_base.rs"
        ));
    }

    /// A column that knows which row it fills.
    #[derive(Default)]
    struct Numbers {
        row: u32,
    }

    impl Columns for Numbers {
        fn count(&self) -> usize {
            1
        }

        fn fill(
            &mut self,
            _: &StateSample<'_>,
            _: &[f64],
            out: &mut [f64],
        ) -> Result<bool, EstimateError> {
            out.fill(f64::from(self.row));
            self.row += 1;
            Ok(true)
        }

        fn restart(&mut self) {
            self.row = 0;
        }
    }

    #[test]
    fn columns_begin_again_in_each_pass_over_a_log_that_is_not_stored() {
        let mut log = Recorded::new();
        for k in 0..5 {
            log.push(0.1 * f64::from(k), &[0.1], &[0.2], &[0.3], &[1.0]);
        }
        let columns = Box::new(Numbers::default());
        let mut replay =
            Replay::with_columns(&models::Pendulum, EquationKind::Forces, &mut log, columns).once();
        for _ in 0..2 {
            let mut rows = Vec::new();
            replay
                .visit(&mut |found| {
                    rows.push(found.w[found.w.len() - 1]);
                    Ok(())
                })
                .unwrap();
            assert_eq!(rows, [0.0, 1.0, 2.0, 3.0, 4.0]);
        }
    }
}
