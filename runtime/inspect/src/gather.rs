//! The second pass over a log, with its clock known: spectra, rows at rest, stretches of rows, and
//! the trace for figures.

use regen_identify::data::{DataError, Differences, RawLog, rest_context, resting};

use crate::clock::{Clock, ClockPass};
use crate::columns::Surveyed;
use crate::regrid::Regrid;
use crate::spectrum::{Density, Welch, block_rows};

/// The approximate rate of the values of a stretch, Hz; each is the mean of several rows.
const STRETCH_RATE: f64 = 250.0;
/// The largest number of values in all stretches together.
const STRETCH_VALUES: usize = 16_384;
/// The number of stretches, evenly spaced, of a log with more values than that.
const STRETCHES: usize = 8;
/// The least number of values of a stretch; shorter ones between gaps are dropped.
const MIN_STRETCH: usize = 64;
/// The number of rows that are judged at a time for being at rest.
const REST_ROWS: usize = 4096;
/// The largest number of points of the trace.
const TRACE_POINTS: usize = 4096;

/// A log is divided into at least three blocks, so that the longest part without a gap contains a
/// block of the log that is so much longer.
const BLOCKS_IN_STRETCH: usize = 2;

/// Where the times of the rows come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Times {
    /// The entry of a row at this index, multiplied by this factor, is its time in s.
    Entry(usize, f64),
    /// The rows have this rate, Hz.
    Rate(f64),
}

/// Consecutive values of all columns, at equal steps.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stretch {
    pub(crate) times: Vec<f64>,
    /// The values of each column.
    pub(crate) columns: Vec<Vec<f64>>,
}

/// The means of the time and the columns over as many rows at a time as `every` says.
#[derive(Clone, Debug, Default)]
pub(crate) struct Means {
    every: usize,
    /// The sums over the rows of the next mean.
    sums: Vec<f64>,
    /// The number of these rows.
    count: usize,
}

impl Means {
    /// Adds a row; adds the means to the times and columns when they are complete.
    fn push(
        &mut self,
        time: f64,
        values: &[f64],
        times: &mut Vec<f64>,
        columns: &mut Vec<Vec<f64>>,
    ) {
        self.sums.resize(values.len() + 1, 0.0);
        let all = std::iter::once(&time).chain(values);
        for (sum, value) in self.sums.iter_mut().zip(all) {
            *sum += value;
        }
        self.count += 1;
        if self.count < self.every {
            return;
        }
        let n = self.count as f64;
        let mut means = self.sums.iter().map(|sum| sum / n);
        times.extend(means.next());
        columns.resize(values.len(), Vec::new());
        for (column, mean) in columns.iter_mut().zip(means) {
            column.push(mean);
        }
        self.clear();
    }

    fn clear(&mut self) {
        self.sums.fill(0.0);
        self.count = 0;
    }
}

/// All columns over the whole log, averaged to at most [`TRACE_POINTS`] points.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    pub(crate) times: Vec<f64>,
    pub(crate) columns: Vec<Vec<f64>>,
    /// The means of the next point; they are over twice as many rows when the trace is full.
    pub(crate) means: Means,
    /// The beginning of the log, before each doubling, the finest first: the whole is too coarse for
    /// what is fast.
    pub(crate) finer: Vec<Trace>,
}

impl Trace {
    pub(crate) fn push(&mut self, time: f64, values: &[f64]) {
        self.means.every = self.means.every.max(1);
        self.means
            .push(time, values, &mut self.times, &mut self.columns);
        if self.times.len() == TRACE_POINTS {
            self.finer.push(Self {
                times: self.times.clone(),
                columns: self.columns.clone(),
                ..Self::default()
            });
            self.means.every *= 2;
            halve(&mut self.times);
            self.columns.iter_mut().for_each(halve);
        }
    }
}

/// Replaces each pair of values by its mean.
fn halve(values: &mut Vec<f64>) {
    *values = values
        .chunks_exact(2)
        .map(|pair| 0.5 * (pair[0] + pair[1]))
        .collect();
}

/// Counts the rows at which each column is at rest, in blocks of rows.
struct Rests {
    times: Vec<f64>,
    columns: Vec<Vec<f64>>,
    /// The number of rows at the beginning of the block that are judged already; they are the
    /// context of the next ones.
    judged: usize,
    /// The number of rows on either side that decide whether a row is at rest.
    context: usize,
    /// The number of rows at rest, by column.
    counts: Vec<usize>,
}

impl Rests {
    fn push(&mut self, time: f64, values: &[f64], surveyed: &Surveyed) {
        self.times.push(time);
        for (column, value) in self.columns.iter_mut().zip(values) {
            column.push(*value);
        }
        if self.times.len() >= REST_ROWS + 2 * self.context {
            self.judge(self.times.len() - self.context, surveyed);
            let gone = self.times.len().saturating_sub(2 * self.context);
            self.times.drain(..gone);
            for column in &mut self.columns {
                column.drain(..gone);
            }
            self.judged -= gone;
        }
    }

    /// Judges the rows before the index `end` that are not judged yet.
    fn judge(&mut self, end: usize, surveyed: &Surveyed) {
        for (k, column) in self.columns.iter().enumerate() {
            let Some(survey) = surveyed.columns.get(k + 1) else {
                continue;
            };
            let found = resting(&self.times, column, survey.encoder);
            let found = found.get(self.judged..end).unwrap_or_default();
            self.counts[k] += found.iter().filter(|rest| **rest).count();
        }
        self.judged = end;
    }

    /// Judges all rows and forgets them: at a gap, or at the end of the log.
    fn end(&mut self, surveyed: &Surveyed) {
        self.judge(self.times.len(), surveyed);
        self.times.clear();
        self.columns.iter_mut().for_each(Vec::clear);
        self.judged = 0;
    }
}

/// The results of the second pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gathered {
    pub(crate) clock: Clock,
    /// The spectral density of each column.
    pub(crate) densities: Vec<Option<Density>>,
    /// The share of rows at rest, by column.
    pub(crate) resting: Vec<f64>,
    pub(crate) stretches: Vec<Stretch>,
    /// The time between the values of a stretch, s.
    pub(crate) step: f64,
    pub(crate) trace: Trace,
}

/// Collects stretches of means: the one that grows, and the finished ones.
struct Stretches {
    present: Stretch,
    done: Vec<Stretch>,
    means: Means,
}

impl Stretches {
    fn push(&mut self, time: f64, values: &[f64]) {
        let Stretch { times, columns } = &mut self.present;
        self.means.push(time, values, times, columns);
    }

    fn end(&mut self) {
        let present = core::mem::take(&mut self.present);
        if present.times.len() >= MIN_STRETCH {
            self.done.push(present);
        }
        self.means.clear();
    }
}

impl Times {
    /// The time of a row, s.
    ///
    /// - `place`: the number of rows before it; `row`: its entries.
    fn of(self, place: usize, row: &[f64]) -> f64 {
        match self {
            Self::Entry(entry, factor) => row.get(entry).copied().unwrap_or(0.0) * factor,
            Self::Rate(rate) => place as f64 / rate,
        }
    }
}

/// An even grid onto which rows are brought, see [`Regrid`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Grid {
    /// Its step, s.
    step: f64,
    /// The number of its points between the two gaps that are farthest apart.
    longest: usize,
    /// The noise of each column from point to point.
    pub(crate) noise: Vec<f64>,
}

/// Finds what the rows are on an even grid of times.
///
/// - `times`, `usual`: as for [`gather`]; `step`: the step of the grid, s.
///
/// # Errors
/// If a file can no longer be read.
pub(crate) fn on_grid(
    log: &RawLog,
    (times, usual): (Times, f64),
    step: f64,
) -> Result<Grid, DataError> {
    let mut columns = vec![Differences::default(); log.numbers().len()];
    let (mut present, mut longest) = (0, 0);
    let mut receive = |_: u64, follows: bool, _: f64, values: &[f64]| {
        present = if follows { present + 1 } else { 1 };
        longest = present.max(longest);
        for (column, value) in columns.iter_mut().zip(values) {
            column.push(*value, follows);
        }
    };
    let mut clock = ClockPass::new(usual);
    let mut grid = Regrid::new(step);
    let mut place = 0;
    log.visit(&mut |row| {
        let Ok((line, values)) = row else {
            return;
        };
        let time = times.of(place, values);
        let follows = clock.push(line, time);
        let values = values.get(1..).unwrap_or_default();
        grid.push(line, follows, time, values, &mut receive);
        place += 1;
    })?;
    grid.finish(&mut receive);
    let noise = columns.into_iter().map(|c| c.finish().noise).collect();
    Ok(Grid {
        step,
        longest,
        noise,
    })
}

/// Makes the second pass over a log.
///
/// - `surveyed`: the results of the first pass;
/// - `times`: where the times of the rows come from;
/// - `usual`: the median step of its first rows, s;
/// - `grid`: an even grid onto which the rows are brought first; all but the clock is then that of the
///   grid.
///
/// # Errors
/// If a file can no longer be read.
pub(crate) fn gather(
    log: &RawLog,
    surveyed: &Surveyed,
    (times, usual): (Times, f64),
    grid: Option<&Grid>,
) -> Result<Gathered, DataError> {
    let count = log.numbers().len();
    let rows = surveyed.rows;
    // a block has no gap, and a spectrum is the mean of several blocks
    let whole = grid.map_or(rows, |grid| rows.min(BLOCKS_IN_STRETCH * grid.longest));
    let block = block_rows(whole, usual);
    let mut clock = ClockPass::new(usual);
    let mut welches = vec![Welch::new(block); count];
    let mut rests = Rests {
        times: Vec::new(),
        columns: vec![Vec::new(); count],
        judged: 0,
        context: rest_context(usual),
        counts: vec![0; count],
    };
    #[allow(clippy::cast_sign_loss, reason = "clamped")]
    let every = (1.0 / usual / STRETCH_RATE).floor().clamp(1.0, 1e6) as usize;
    let mut stretches = Stretches {
        present: Stretch::default(),
        done: Vec::new(),
        means: Means {
            every,
            ..Means::default()
        },
    };
    let (parts, length) = if rows <= STRETCH_VALUES * every {
        (1, rows)
    } else {
        (STRETCHES, STRETCH_VALUES * every / STRETCHES)
    };
    let mut trace = Trace::default();
    let mut place = 0;
    let mut receive = |_: u64, follows: bool, time: f64, values: &[f64]| {
        if !follows {
            welches.iter_mut().for_each(Welch::restart);
            rests.end(surveyed);
        }
        for (welch, value) in welches.iter_mut().zip(values) {
            welch.push(*value);
        }
        rests.push(time, values, surveyed);
        trace.push(time, values);
        // of each of the equal parts of the log, the first `length` rows belong to a stretch
        let within = place < (place * parts / rows.max(1)) * rows / parts + length;
        if !follows || !within {
            stretches.end();
        }
        if within {
            stretches.push(time, values);
        }
        place += 1;
    };
    let mut regrid = grid.map(|grid| Regrid::new(grid.step));
    let mut read = 0;
    log.visit(&mut |row| {
        let Ok((line, values)) = row else {
            return;
        };
        let time = times.of(read, values);
        let follows = clock.push(line, time);
        let values = values.get(1..).unwrap_or_default();
        match &mut regrid {
            Some(regrid) => regrid.push(line, follows, time, values, &mut receive),
            None => receive(line, follows, time, values),
        }
        read += 1;
    })?;
    if let Some(regrid) = &mut regrid {
        regrid.finish(&mut receive);
    }
    rests.end(surveyed);
    stretches.end();
    let clock = clock.finish();
    let rate = if clock.rate > 0.0 {
        clock.rate
    } else {
        1.0 / usual
    };
    Ok(Gathered {
        densities: welches.into_iter().map(|w| w.finish(rate)).collect(),
        resting: rests
            .counts
            .iter()
            .map(|n| *n as f64 / rows.max(1) as f64)
            .collect(),
        stretches: stretches.done,
        step: every as f64 / rate,
        trace,
        clock,
    })
}
