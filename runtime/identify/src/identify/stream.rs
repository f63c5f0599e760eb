//! Streams the equations of a log: set up at every state, then filtered and decimated.

use serde::{Deserialize, Serialize};

use super::equation_builder::{EquationBuilder, EquationKind, Equations};
use super::pending::Pending;
use crate::estimate::EstimateError;
use crate::signals::{SignalError, Smoothing};
use crate::states::Source;
use crate::states::StateSample;
use crate::states::depends_on_direction;
use crate::states::directions;
use crate::states::{Filtering, Standstill};
use regen_runtime::{BaseModel, Condition};

/// How many samples and equations a pass used and left out.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// The number of samples that gave equations.
    pub samples: usize,
    /// The number of samples without equations because A_e is singular there.
    pub singular: usize,
    /// The number of samples at the ends of runs, where the filter has not settled.
    pub unsettled: usize,
    /// For each effort, the number of equations left out because its coordinate rested.
    pub resting: Vec<usize>,
    /// The number of samples left out because most of what the filter averages there lies in a gap that
    /// was bridged.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub bridged: usize,
}

#[allow(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// Columns in addition to those of the base parameters, such as those of nonlinear friction. They
/// are filled at every state and filtered like efforts and regressor.
pub trait Columns {
    /// The number of these columns.
    fn count(&self) -> usize;

    /// Fills the columns at a state.
    ///
    /// - `w`: the base regressor at the state, dof x r, column-major;
    /// - `out`: dof x [`count`](Self::count), column-major;
    /// - returns: whether the state is regular; otherwise it gives no equation.
    ///
    /// # Errors
    /// When a length does not fit the model.
    fn fill(
        &mut self,
        row: &StateSample<'_>,
        w: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError>;

    /// Called before the first state of each pass over the log.
    fn restart(&mut self) {}

    /// Called for a state that gave no equation, in the order of the source's states, between calls
    /// of [`fill`](Self::fill). The source may be some states ahead.
    fn skip(&mut self) {}
}

impl<C: Columns + ?Sized> Columns for &mut C {
    fn count(&self) -> usize {
        (**self).count()
    }

    fn fill(
        &mut self,
        row: &StateSample<'_>,
        w: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        (**self).fill(row, w, out)
    }

    fn restart(&mut self) {
        (**self).restart();
    }

    fn skip(&mut self) {
        (**self).skip();
    }
}

/// No additional columns.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoColumns;

impl Columns for NoColumns {
    fn count(&self) -> usize {
        0
    }

    fn fill(
        &mut self,
        _: &StateSample<'_>,
        _: &[f64],
        _: &mut [f64],
    ) -> Result<bool, EstimateError> {
        Ok(true)
    }
}

/// The number of rows filtered at a time, not counting those that the filter needs on both sides.
const BLOCK_ROWS: usize = 2048;
/// The largest part of the filter's memory in which a coordinate may have rested for its equation to
/// be used, and with it the largest part of the static friction in a residual: a tenth put friction and
/// inertia of simulated arms two standard deviations off. A sinusoidal motion is slower than a
/// twentieth of its rms value in a part of 0.0225, so that of fast motion not everything is left out.
pub(super) const MAX_RESTED_PART: f64 = 0.03;

/// The least part of the filter's weights that lies at samples where an equation is known for it to be used.
const MIN_KNOWN_PART: f64 = 0.5;
/// Where the filter's weights add up to 1 but for this, no sample was left out.
const WHOLE: f64 = 1e-9;

/// Divides filtered values of samples, of which those that are not known were set to 0, by the part of the
/// filter's weights that lies at the others. Both sides of an equation are treated so, and one that holds at
/// every sample then holds for the result too. Where that part does not suffice, the values stay.
///
/// - `known`: that part, for each equation;
/// - `rows`: the equation of each value.
pub(crate) fn normalise(values: &mut [f64], known: &[f64], rows: impl Iterator<Item = usize>) {
    if known.iter().all(|known| (known - 1.0).abs() <= WHOLE) {
        return;
    }
    for (value, row) in values.iter_mut().zip(rows) {
        match known.get(row) {
            Some(known) if is_known(*known) && (known - 1.0).abs() > WHOLE => *value /= known,
            _ => {}
        }
    }
}

/// Whether enough of what the filter averages is known for an equation to be used.
fn is_known(part: f64) -> bool {
    part >= MIN_KNOWN_PART
}

/// Factors of couplings are larger than this.
const NO_FACTOR: f64 = 1e-9;

/// Passes the equations of a log to `each` in order of time: the base regressor at every state,
/// then the additional columns, all filtered according to [`Source::filtering`] (energy balances
/// are not filtered: their integrals smooth them already). Equations at standstill have the weight
/// 0.
///
/// # Errors
/// When the log cannot be read, does not fit the model, or is sampled in a way that does not suit
/// the filter.
pub fn equations<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: EquationKind,
    source: &mut S,
    columns: &mut dyn Columns,
    each: &mut dyn FnMut(&Equations<'_>) -> Result<(), EstimateError>,
) -> Result<LeftOut, S::Error> {
    equations_with_friction(&[], model, kind, source, columns, each)
}

/// As [`equations`], where the error of an effort's equation is known to grow with the part of the filter's
/// memory in which its coordinate rested.
///
/// - `friction`: for each effort the deviation of static friction over that of the other errors.
pub(super) fn equations_with_friction<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    friction: &[f64],
    model: &M,
    kind: EquationKind,
    source: &mut S,
    columns: &mut dyn Columns,
    each: &mut dyn FnMut(&Equations<'_>) -> Result<(), EstimateError>,
) -> Result<LeftOut, S::Error> {
    // energies are integrals over all states
    let every = source.allow_fewer_states(kind == EquationKind::Forces);
    let filtering = source.filtering();
    columns.restart();
    let mut stream = Stream::new(model, kind, filtering, columns.count());
    stream.static_friction = friction.to_vec();
    let visited = source.visit(&mut |row| stream.take(row, columns, each));
    source.allow_fewer_states(false);
    visited?;
    stream.flush(columns, each)?;
    stream.end_run(each)?;
    let mut left = stream.left;
    left.singular = every * (stream.builder.singular() + stream.irregular);
    left.unsettled = every * (stream.taken - stream.settled);
    Ok(left)
}

/// Callback that receives the equations of each sample.
type EquationSink<'a> = dyn FnMut(&Equations<'_>) -> Result<(), EstimateError> + 'a;

/// Filter and decimation of equations, with the samples that the filter still needs.
struct Stream<'m, M: ?Sized> {
    model: &'m M,
    builder: EquationBuilder<'m, M>,
    kind: EquationKind,
    filtering: Filtering,
    /// See [`equations_with_friction`].
    static_friction: Vec<f64>,
    friction: Direction,
    dof: usize,
    /// The number of columns in addition to those of the base regressor.
    extra: usize,
    /// The number of entries of a sample in `values`: dof for each column, dof for the efforts, dof
    /// for those that are held, dof for the flags of coordinates that move, and dof for the flags of
    /// equations that are known, as neither the motion is interpolated nor an effort in them without a value.
    width: usize,
    times: Vec<f64>,
    values: Vec<f64>,
    weights: Vec<f64>,
    filtered: Vec<f64>,
    /// The weights of the sample that is passed on, one for each effort.
    own_weights: Vec<f64>,
    /// The numbers of samples, after averaging, that the filter depends on and that it needs to settle;
    /// `None` until the sampling rate of this run is known.
    reach: Option<(usize, usize)>,
    /// The number of equations of this run that are averaged, once its sampling is known.
    averaged: Option<usize>,
    /// The number of equations that have been added to the last entry of `times`, an average.
    summed: usize,
    /// The number of samples at the start of `times` that only the filter needs.
    before: usize,
    /// The number of settled samples of the run so far, for decimation.
    count: usize,
    /// Whether the next sample follows the last one that was passed on.
    follows: bool,
    /// Samples whose equations are not yet set up.
    pending: Pending,
    taken: usize,
    settled: usize,
    irregular: usize,
    left: LeftOut,
}

/// Which coordinates have friction that depends on the direction.
struct Direction {
    independent: Vec<(usize, bool)>,
    dependent: bool,
    /// The dependent ones of a model without cuts, each with the independent coordinates that it
    /// follows by constant factors.
    coupled: Vec<(usize, Vec<bool>)>,
}

impl Direction {
    fn of<M: BaseModel<f64> + ?Sized>(model: &M) -> Self {
        let info = model.info();
        let signed = |c: &usize| info.joints.get(*c).is_some_and(depends_on_direction);
        let mut coupled: Vec<usize> = info.dependent.iter().copied().filter(signed).collect();
        let dependent = !coupled.is_empty();
        if !info.cuts.is_empty() {
            coupled.clear();
        }
        // a model whose velocities cannot be computed gives no equations, and so the error
        let factors = directions(model, info.home, &coupled).map_or_else(|_| Vec::new(), |d| d.0);
        let rows = factors.chunks_exact(info.dof().max(1));
        let rows = rows.map(|row| row.iter().map(|x| x.abs() > NO_FACTOR).collect());
        Self {
            independent: info.independent.iter().map(|c| (*c, signed(c))).collect(),
            dependent,
            coupled: coupled.into_iter().zip(rows).collect(),
        }
    }

    /// Appends for each independent coordinate 1, or 0 if friction at rest affects its equation.
    fn moved(&self, still: &[bool], out: &mut Vec<f64>) {
        let rests = |c: usize| still.get(c).copied().unwrap_or(false);
        // a dependent coordinate certainly rests only if all independent ones do
        let all = self.dependent && self.independent.iter().all(|(c, _)| rests(*c));
        let coupled = |row: usize| {
            let own = self.coupled.iter();
            let mut own = own.filter(|(_, follows)| follows.get(row).copied().unwrap_or(false));
            own.any(|(c, _)| rests(*c))
        };
        let rows = self.independent.iter().enumerate();
        let rests = |(row, (c, signed)): (usize, &(usize, bool))| {
            all || *signed && rests(*c) || coupled(row)
        };
        out.extend(rows.map(|row| f64::from(!rests(row))));
    }
}

impl<'m, M: BaseModel<f64> + ?Sized> Stream<'m, M> {
    fn new(model: &'m M, kind: EquationKind, filtering: Filtering, extra: usize) -> Self {
        let dof = match kind {
            EquationKind::Forces => model.info().dof(),
            EquationKind::Energy { .. } => 1,
        };
        let columns = model.base_info().base.len() + extra;
        Self {
            model,
            builder: EquationBuilder::new(model, kind),
            kind,
            filtering,
            static_friction: Vec::new(),
            friction: Direction::of(model),
            dof,
            extra,
            width: dof * (columns + 4),
            times: Vec::new(),
            values: Vec::new(),
            weights: Vec::new(),
            filtered: Vec::new(),
            own_weights: vec![0.0; dof],
            reach: None,
            averaged: None,
            summed: 0,
            before: 0,
            count: 0,
            follows: false,
            pending: Pending::default(),
            taken: 0,
            settled: 0,
            irregular: 0,
            left: LeftOut {
                resting: vec![0; dof],
                ..LeftOut::default()
            },
        }
    }

    fn take(
        &mut self,
        row: &StateSample<'_>,
        columns: &mut dyn Columns,
        each: &mut EquationSink<'_>,
    ) -> Result<(), EstimateError> {
        if matches!(self.kind, EquationKind::Energy { .. }) {
            return self.balance(row, each);
        }
        let n = self.model.info().coordinates.len();
        if [row.q, row.qd, row.qdd].iter().any(|part| part.len() != n) {
            // gives the error that names the length
            return self.builder.observe(row).map(drop);
        }
        if self.pending.push(row) {
            self.flush(columns, each)?;
        }
        Ok(())
    }

    /// Sets up the equations of the waiting samples and takes them one after the other.
    fn flush(
        &mut self,
        columns: &mut dyn Columns,
        each: &mut EquationSink<'_>,
    ) -> Result<(), EstimateError> {
        let mut pending = core::mem::take(&mut self.pending);
        pending.compute(self.model)?;
        for index in 0..pending.len() {
            if let Some((row, w, pivot)) = pending.at(index) {
                self.take_computed(&row, w, Condition { pivot }, columns, each)?;
            }
        }
        pending.clear();
        self.pending = pending;
        Ok(())
    }

    /// Takes a sample whose base regressor is known.
    fn take_computed(
        &mut self,
        row: &StateSample<'_>,
        w: &[f64],
        condition: Condition<f64>,
        columns: &mut dyn Columns,
        each: &mut EquationSink<'_>,
    ) -> Result<(), EstimateError> {
        if !row.follows {
            self.end_run(each)?;
        }
        if row.bridged && self.filtering.smoothing.is_none() {
            columns.skip();
            return self.end_run(each);
        }
        if !self.observe(row, w, condition, columns)? {
            return self.end_run(each);
        }
        self.taken += 1;
        if self.filtering.smoothing.is_none() {
            self.settled += 1;
            core::mem::swap(&mut self.filtered, &mut self.values);
            self.values.clear();
            self.hand_over(0..1, each)?;
            self.times.clear();
            self.weights.clear();
            return Ok(());
        }
        self.average();
        if self.times.len() <= BLOCK_ROWS || self.summed > 0 {
            return Ok(());
        }
        let (support, settling) = self.reach()?;
        if self.times.len() < self.before + BLOCK_ROWS + support {
            return Ok(());
        }
        let n = self.times.len();
        let start = self.before.max(if self.before == 0 { settling } else { 0 });
        self.filter(start..n - support, each)?;
        let keep = (2 * support).min(n);
        self.times.drain(..n - keep);
        self.values.drain(..(n - keep) * self.width);
        self.weights.drain(..(n - keep) * self.dof);
        self.before = keep - support.min(keep);
        Ok(())
    }

    /// Adds the equations at a state to the buffer; returns whether there are any.
    fn observe(
        &mut self,
        row: &StateSample<'_>,
        w: &[f64],
        condition: Condition<f64>,
        columns: &mut dyn Columns,
    ) -> Result<bool, EstimateError> {
        let found = self.builder.observe_computed(row, w, condition)?;
        let Some(equations) = found.filter(|found| !found.tau.is_empty()) else {
            columns.skip();
            return Ok(false);
        };
        let start = self.values.len();
        self.values.extend_from_slice(equations.w);
        let base = self.values.len();
        self.values.resize(base + self.dof * self.extra, 0.0);
        let (w, more) = self.values.split_at_mut(base);
        let regular = columns.fill(row, &w[start..], more)?;
        if !regular || more.iter().any(|x| !x.is_finite()) {
            self.values.truncate(start);
            self.irregular += 1;
            return Ok(false);
        }
        self.values.extend_from_slice(equations.tau);
        self.add_held(row)?;
        if self.filtering.standstill == Standstill::Keep {
            self.values.extend(core::iter::repeat_n(1.0, self.dof));
        } else {
            self.friction.moved(row.at_standstill, &mut self.values);
        }
        self.values.extend(core::iter::repeat_n(1.0, self.dof));
        for e in 0..self.dof {
            // an equation without a weight has an effort without a value
            if row.bridged || row.weights.get(e) == Some(&0.0) {
                let own = self.values.iter_mut().skip(start + e);
                own.step_by(self.dof).for_each(|value| *value = 0.0);
            }
        }
        self.times.push(row.time);
        self.weights.extend_from_slice(row.weights);
        Ok(true)
    }

    /// Adds the generalized forces of held efforts; 0 where they are not known.
    fn add_held(&mut self, row: &StateSample<'_>) -> Result<(), EstimateError> {
        let start = self.values.len();
        self.values.resize(start + self.dof, 0.0);
        if !row.held.is_empty() {
            let out = self.values.get_mut(start..).unwrap_or_default();
            // the row's efforts were transformed at the same positions, which are not singular
            let _ = self.model.generalized_forces(row.q, row.held, out)?;
        }
        Ok(())
    }

    /// Adds the last sample of the buffer to the average before it.
    fn average(&mut self) {
        let last = self.times.len() - 1;
        let averaged = match (self.averaged, last) {
            (Some(averaged), _) => averaged,
            // a single sample has no time step
            (None, 0) => return,
            (None, _) => {
                let averaged = self.filtering.averaged(self.times[last] - self.times[0]);
                self.averaged = Some(averaged);
                self.summed = usize::from(averaged > 1);
                averaged
            }
        };
        if averaged == 1 {
            return;
        }
        if self.summed == 0 {
            self.summed = 1;
            return;
        }
        let add = |all: &mut Vec<f64>, width: usize| {
            let (before, own) = all.split_at_mut(last * width);
            let sums = &mut before[(last - 1) * width..];
            for (sum, own) in sums.iter_mut().zip(own) {
                *sum += *own;
            }
            all.truncate(last * width);
        };
        add(&mut self.times, 1);
        add(&mut self.values, self.width);
        add(&mut self.weights, self.dof);
        self.summed += 1;
        if self.summed < averaged {
            return;
        }
        self.summed = 0;
        let place = last - 1;
        let sums = (self.times[place..].iter_mut())
            .chain(&mut self.values[place * self.width..])
            .chain(&mut self.weights[place * self.dof..]);
        for sum in sums {
            *sum /= averaged as f64;
        }
    }

    /// Removes the last average of a run if it has too few equations.
    fn drop_incomplete(&mut self) {
        if self.summed > 0 {
            let whole = self.times.len() - 1;
            self.times.truncate(whole);
            self.values.truncate(whole * self.width);
            self.weights.truncate(whole * self.dof);
            self.summed = 0;
        }
    }

    /// Passes an energy balance on unfiltered.
    fn balance(
        &mut self,
        row: &StateSample<'_>,
        each: &mut EquationSink<'_>,
    ) -> Result<(), EstimateError> {
        let equations = self.builder.observe(row)?;
        if !equations.tau.is_empty() {
            self.left.samples += 1;
        }
        each(&equations)
    }

    /// The number of samples that the filter depends on, and that it needs to settle.
    fn reach(&mut self) -> Result<(usize, usize), EstimateError> {
        if let Some(reach) = self.reach {
            return Ok(reach);
        }
        let span = self.times.last().zip(self.times.first());
        let span = span.map_or(f64::NAN, |(last, first)| last - first);
        let step = span / (self.times.len().max(2) - 1) as f64;
        let smoothing = self.filtering.smoothing;
        let reach = (smoothing.support(step)?, smoothing.settling(step)?);
        self.reach = Some(reach);
        Ok(reach)
    }

    /// Filters and passes on the rest of a run of consecutive samples.
    fn end_run(&mut self, each: &mut EquationSink<'_>) -> Result<(), EstimateError> {
        self.drop_incomplete();
        let n = self.times.len();
        // a single sample has no time step
        if n > 1 {
            let (_, settling) = self.reach()?;
            let start = self.before.max(if self.before == 0 { settling } else { 0 });
            self.filter(start..n.saturating_sub(settling), each)?;
        }
        self.times.clear();
        self.values.clear();
        self.weights.clear();
        self.reach = None;
        self.averaged = None;
        self.before = 0;
        self.count = 0;
        self.follows = false;
        Ok(())
    }

    /// Filters all buffered samples and passes on those of a range.
    fn filter(
        &mut self,
        range: core::ops::Range<usize>,
        each: &mut EquationSink<'_>,
    ) -> Result<(), EstimateError> {
        if range.is_empty() {
            return Ok(());
        }
        let smoothing = self.filtering.smoothing;
        let filtered = &mut self.filtered;
        match smoothing.apply_to(&self.times, &self.values, self.width, filtered) {
            Ok(()) => {}
            // a run shorter than the filter gives no equation
            Err(SignalError::TooFew { .. }) => return Ok(()),
            Err(why) => return Err(why.into()),
        }
        self.settled += range.len() * self.averaged.unwrap_or(1);
        self.hand_over(range, each)
    }

    /// Decimates a range of filtered samples and passes on the equations that remain.
    fn hand_over(
        &mut self,
        range: core::ops::Range<usize>,
        each: &mut EquationSink<'_>,
    ) -> Result<(), EstimateError> {
        // without a filter, the states of the log are already decimated
        let every = match self.filtering.smoothing {
            Smoothing::None => 1,
            _ => self.filtering.every(self.averaged.unwrap_or(1)),
        };
        let dof = self.dof;
        for k in range {
            self.count += 1;
            if !(self.count - 1).is_multiple_of(every) {
                continue;
            }
            let sample = &mut self.filtered[k * self.width..(k + 1) * self.width];
            let (sample, known) = sample.split_at_mut(self.width - dof);
            normalise(sample, known, (0..dof).cycle());
            let is_bridged = !known.iter().any(|part| is_known(*part));
            self.left.bridged += usize::from(is_bridged);
            let (w, rest) = sample.split_at(self.width - 4 * dof);
            let (tau, rest) = rest.split_at(dof);
            let (held, moved) = rest.split_at(dof);
            let own = &self.weights[k * dof..(k + 1) * dof];
            let weights = &mut self.own_weights;
            let known = known.iter().map(|part| is_known(*part));
            for (e, ((weight, moved), is_known)) in
                weights.iter_mut().zip(moved).zip(known).enumerate()
            {
                let part = if self.filtering.standstill == Standstill::Weigh {
                    moved.clamp(0.0, 1.0)
                } else {
                    // above 1 the filter weighs a rest near by negatively
                    let rested = (1.0 - moved).abs();
                    let friction = self.static_friction.get(e).copied().unwrap_or(0.0);
                    let is_used = f64::from(rested <= MAX_RESTED_PART);
                    is_used / libm::hypot(1.0, rested * friction)
                };
                *weight = own[e] * part * f64::from(is_known);
                let rests = is_known && own[e] != 0.0 && *weight == 0.0;
                self.left.resting[e] += usize::from(rests);
            }
            self.left.samples += 1;
            each(&Equations {
                time: self.times[k],
                w,
                tau,
                weights: &self.own_weights,
                follows: self.follows,
                held,
            })?;
            self.follows = true;
        }
        Ok(())
    }
}
