//! Gram matrices of the equations of a sample, and least squares on them.

use super::{Reading, Sample};
use crate::states::{Completed, Completion, depends_on_direction};
use regen_runtime::{BaseModel, Info, Parameter, Status};

/// The Gram matrix of each equation's columns, in this order: the columns of the base regressor;
/// for each effort that acts on the equation, every measured effort multiplied by that effort's
/// transfer factor; for each acting effort, a constant multiplied by its factor; the effort of the
/// nominal bodies; and 1.
#[derive(Clone, Debug)]
pub(super) struct Grams {
    columns: usize,
    efforts: usize,
    /// The indices of the efforts that act on each equation.
    acting: Vec<Vec<usize>>,
    /// Whether each equation is left out, as an effort acts on it that is not measured; it has no error
    /// then.
    pub(super) left_out: Vec<bool>,
    matrices: Vec<Vec<f64>>,
    /// The number of states in the sums.
    count: f64,
    /// The number of states tried, including those at which the loops do not close.
    tried: usize,
    /// For each base parameter, the sum over the states of its power at value 1.
    pub(super) power: Vec<f64>,
    /// For each equation, the sum over the states of the absolute power of its effort.
    pub(super) spent: Vec<f64>,
    /// For each equation, the sum over the states of the squared acceleration of its coordinate.
    pub(super) accelerations: Vec<f64>,
    /// Whether nominal bodies are known.
    pub(super) nominal: bool,
    /// Some of the positions, of all coordinates.
    pub(super) postures: Vec<Vec<f64>>,
    /// The equations of each state; empty for a hypothesis.
    pub(super) stored: Vec<Stored>,
    /// The least error of each equation, see [`Sample::least_errors`].
    pub(super) least: Vec<f64>,
    /// The square of the least rms of an effort about its mean that errors are compared with, over its rms.
    least_spread: f64,
}

/// The equations of a state.
#[derive(Clone, Debug)]
pub(super) struct Stored {
    /// The index of the state in the sample.
    pub(super) state: usize,
    /// The base regressor, by columns.
    pub(super) w: Vec<f64>,
    /// The right-hand sides.
    pub(super) tau: Vec<f64>,
    /// For each effort, its factor in each equation.
    pub(super) transfer: Vec<f64>,
}

impl Stored {
    /// Whether equation `i` is used: it is not where its joint rests.
    pub(super) fn has(&self, i: usize) -> bool {
        let factors = self.transfer.iter().skip(i);
        factors.step_by(self.tau.len().max(1)).any(|t| *t != 0.0)
    }

    /// The measured right-hand side of equation `i` minus that of these base parameters.
    pub(super) fn residual(&self, i: usize, values: &[f64]) -> f64 {
        let row = self.w.iter().skip(i).step_by(self.tau.len().max(1));
        let predicted: f64 = row.zip(values).map(|(w, b)| w * b).sum();
        self.tau.get(i).map_or(0.0, |tau| tau - predicted)
    }
}

/// A least-squares solution.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// Base parameters, then offsets.
    pub(super) values: Vec<f64>,
    /// For each equation: rms of the residuals over rms of the efforts about their mean, at least that of noise of
    /// the motion alone.
    pub(super) errors: Vec<f64>,
    /// For each equation: rms of the efforts.
    pub(super) sizes: Vec<f64>,
    /// For each equation: rms of the efforts about their mean, at least a tenth of their rms.
    pub(super) spreads: Vec<f64>,
}

/// The number of reweighted passes: the errors settle to a few percent in three.
const REWEIGHTING_PASSES: usize = 4;
/// Ridge on the diagonal of the Gram matrix whose columns have unit length.
const RIDGE: f64 = 1e-10;
/// The part of the states in which a joint may rest for the equations of these to be left out.
const MAX_RESTING_PART: f64 = 0.7;
/// The square of the least rms of an effort about its mean that errors are compared with, over its rms: what is left of
/// a constant weight may be as large as its change, and is a small error.
pub(super) const LEAST_SPREAD: f64 = 1e-2;
/// The same where columns are exchanged or their signs flipped, which no weight hides.
const LEAST_SPREAD_OF_CHANGES: f64 = 1e-6;
/// The smallest relative error of an equation that its weight is computed from.
const MIN_RELATIVE_ERROR: f64 = 1e-3;
/// Of what an error is below that of noise alone so much counts: no change is made for it, and sizes of changes that are made
/// have their best value.
const COUNTED_PART: f64 = 0.01;
/// The number of postures at which inertias are looked at.
const POSTURES: usize = 16;
/// The smallest part of the states at which the loops must close.
const MIN_CLOSED_PART: f64 = 0.8;
/// The most continuation steps to a state: enough for a path of tens of rad. Columns that are wrong
/// lead to states that do not close, and a search to the end takes thousands of steps for each.
pub(super) const MAX_STEPS: usize = 200;
/// How many more states than the rest of [`MIN_CLOSED_PART`] may fail before a hypothesis is given up.
const SPARE_FAILURES: usize = 4;
/// The largest distance of measured coordinates, more than needed, from the closed state that is
/// nearest to them, over their spread: with more, a hypothesis contradicts itself.
const MAX_CONTRADICTION: f64 = 0.2;
/// The least spread of a coordinate, over the largest of its kind.
const MIN_SPREAD: f64 = 0.05;

/// The index, among all parameters, of the parameter that names a base parameter.
fn place<M: BaseModel<f64> + ?Sized>(model: &M, column: usize) -> Option<usize> {
    let base = model.base_info().base;
    Some(base.get(column)?.terms.first()?.index)
}

/// The parameter that names a base parameter.
pub(super) fn named<M: BaseModel<f64> + ?Sized>(model: &M, column: usize) -> Option<Parameter<'_>> {
    let parameters = model.info().parameters;
    parameters.get(place(model, column)?).copied()
}

/// Whether the parameter that names a base parameter is friction, or an offset or a rotor without a
/// nominal value.
fn lacks_nominal<M: BaseModel<f64> + ?Sized>(model: &M, column: usize) -> bool {
    let stated = place(model, column).and_then(|k| model.info().nominal.get(k));
    let unknown = stated.copied().flatten().is_none();
    named(model, column).is_some_and(|p| {
        p.is_friction() || ((p.is_rotor() || p.is_offset() || p.is_spring_or_term()) && unknown)
    })
}

/// The base parameters of the nominal bodies; friction, and offsets and rotors without a value,
/// count as 0.
fn nominal<M: BaseModel<f64> + ?Sized>(model: &M) -> Option<Vec<f64>> {
    let info = model.info();
    if info.nominal.len() != info.parameters.len() {
        return None;
    }
    let mut phi = Vec::with_capacity(info.parameters.len());
    for (value, parameter) in info.nominal.iter().zip(info.parameters) {
        // `compare_with_nominal` fits friction by separate columns
        let value = if parameter.is_friction() {
            Some(0.0)
        } else {
            *value
        };
        let of_joint =
            parameter.is_rotor() || parameter.is_offset() || parameter.is_spring_or_term();
        phi.push(value.or_else(|| of_joint.then_some(0.0))?);
    }
    let mut beta = vec![0.0; model.base_info().base.len()];
    model.to_base(&phi, &mut beta).ok()?;
    beta.iter().any(|b| *b != 0.0).then_some(beta)
}

/// The standard deviation of each measured coordinate as it is read; those that hardly move count with
/// a part of the largest one of their kind.
fn spreads<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    positions: &[Reading],
) -> Vec<f64> {
    let count = sample.states.len().max(1) as f64;
    let own = positions.iter().map(|reading| {
        let values = sample
            .states
            .iter()
            .filter_map(|state| state.motion[0].get(reading.from));
        let mean = values.clone().sum::<f64>() / count;
        let square = values.map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        square.sqrt() * reading.factor.abs()
    });
    let own: Vec<f64> = own.collect();
    let joints = model.info().joints;
    let kinds: Vec<_> = sample
        .measured
        .iter()
        .map(|c| joints.get(*c).map(|j| j.motion))
        .collect();
    let floor = |kind| {
        let same = own.iter().zip(&kinds).filter(|(_, other)| **other == kind);
        MIN_SPREAD * same.fold(0.0, |m: f64, (s, _)| m.max(*s))
    };
    own.iter()
        .zip(&kinds)
        .map(|(spread, kind)| spread.max(floor(*kind)))
        .collect()
}

/// For each equation, the column of the position of its joint if equations at which that rests are left out: its
/// friction may be anything there. A joint that rests most of the time has no others.
fn sticking(info: &Info<'_>, sample: &Sample, positions: &[Reading]) -> Vec<Option<usize>> {
    let one = |c: &usize| {
        let joint = info.joints.get(*c)?;
        let place = sample.measured.iter().position(|own| own == c)?;
        let from = positions.get(place)?.from;
        let states = sample.states.iter();
        let rests = states.filter(|own| own.resting.get(from) == Some(&true));
        let is_rare = rests.count() as f64 <= MAX_RESTING_PART * sample.states.len() as f64;
        (depends_on_direction(joint) && is_rare).then_some(from)
    };
    info.independent.iter().map(one).collect()
}

impl Grams {
    /// Sums over every `every`-th state, with the given readings of the positions. `None` if the
    /// loops close at no state.
    pub(super) fn of<M: BaseModel<f64> + ?Sized>(
        model: &M,
        sample: &Sample,
        positions: &[Reading],
        every: usize,
    ) -> Option<Self> {
        Self::sums(model, sample, positions, every, None)
    }

    /// As [`of`](Self::of), for readings that are likely to be wrong: `None` as soon as the loops close
    /// at too few of the first states, or coordinates that are measured beyond need contradict the
    /// others there.
    pub(super) fn of_hypothesis<M: BaseModel<f64> + ?Sized>(
        model: &M,
        sample: &Sample,
        positions: &[Reading],
        every: usize,
    ) -> Option<Self> {
        let spreads = spreads(model, sample, positions);
        Self::sums(model, sample, positions, every, Some(&spreads))
    }

    /// - `spreads`: of the measured coordinates, for a hypothesis.
    fn sums<M: BaseModel<f64> + ?Sized>(
        model: &M,
        sample: &Sample,
        positions: &[Reading],
        every: usize,
        spreads: Option<&[f64]>,
    ) -> Option<Self> {
        let info = model.info();
        let (dof, efforts) = (info.dof(), info.actuated.len());
        let columns = model.base_info().base.len();
        let ones = vec![1.0; sample.measured.len()];
        let completion = Completion::new(model, &sample.measured, &ones).ok()?;
        let mut completion = completion.limited(MAX_STEPS);
        let beta = nominal(model);
        let mut out = Self {
            columns,
            efforts,
            acting: Vec::new(),
            left_out: vec![false; dof],
            matrices: Vec::new(),
            count: 0.0,
            tried: 0,
            power: vec![0.0; columns],
            spent: vec![0.0; dof],
            accelerations: vec![0.0; dof],
            nominal: beta.is_some(),
            postures: Vec::new(),
            stored: Vec::new(),
            least: sample.least_errors.clone(),
            least_spread: LEAST_SPREAD,
        };
        let apart = (sample.states.len() / every.max(1) / POSTURES).max(1);
        let sticking = sticking(&info, sample, positions);
        let mut w = vec![0.0; dof * columns];
        let mut transfer = vec![0.0; dof * efforts];
        let mut own = vec![0.0; dof];
        let mut entries = Vec::new();
        for (place, state) in sample.states.iter().enumerate().step_by(every.max(1)) {
            out.tried += 1;
            let read = |d: usize| -> Option<Vec<f64>> {
                let column = &state.motion[d];
                let offset = |r: &Reading| if d == 0 { r.offset } else { 0.0 };
                let one = |r: &Reading| Some(column.get(r.from)? * r.factor + offset(r));
                positions.iter().map(one).collect()
            };
            let measured = read(0)?;
            let completed = completion.complete(&measured, &read(1)?, &read(2)?).ok()?;
            let state_of_loops = match completed {
                Completed::State(full) => Some(full),
                Completed::Open(_) | Completed::Unmeasured => None,
            };
            let contradicts = |q: &[f64]| match spreads {
                Some(spreads) if measured.len() > dof => {
                    let places = sample.measured.iter().zip(&measured).zip(spreads);
                    let squares = places.map(|((c, y), spread)| ((y - q[*c]) / spread).powi(2));
                    squares.sum::<f64>() > measured.len() as f64 * MAX_CONTRADICTION.powi(2)
                }
                _ => false,
            };
            let Some(full) = state_of_loops.filter(|full| !contradicts(&full.q)) else {
                let failed = out.tried as f64 - out.count;
                let usual = (1.0 - MIN_CLOSED_PART) * out.tried as f64;
                if spreads.is_some() && failed > usual + SPARE_FAILURES as f64 {
                    return None;
                }
                // the loops close at none of the first states: give up
                if out.count == 0.0 && out.tried >= 20 {
                    return None;
                }
                continue;
            };
            let condition = model
                .base_regressor(&full.q, &full.qd, &full.qdd, &mut w)
                .ok()?;
            if condition.status() == Status::Singular || w.iter().any(|x| !x.is_finite()) {
                continue;
            }
            for k in 0..efforts {
                let mut unit = vec![0.0; efforts];
                unit[k] = 1.0;
                let _ = model.generalized_forces(&full.q, &unit, &mut own).ok()?;
                transfer[k * dof..(k + 1) * dof].copy_from_slice(&own);
            }
            if out.acting.is_empty() {
                let acts = |i: usize| {
                    let entries = (0..efforts).filter(|k| transfer[k * dof + i] != 0.0);
                    entries.collect::<Vec<_>>()
                };
                // where the actuated joints are not the independent ones, each effort acts on each
                // equation
                let whole = info.independent.iter().all(|c| info.actuated.contains(c))
                    && info.independent.len() == efforts;
                let all: Vec<usize> = (0..efforts).collect();
                out.acting = (0..dof)
                    .map(|i| if whole { acts(i) } else { all.clone() })
                    .collect();
                for (acting, left_out) in out.acting.iter_mut().zip(&mut out.left_out) {
                    *left_out = acting.iter().any(|k| sample.unmeasured.contains(k));
                    if *left_out {
                        acting.clear();
                    }
                }
                let sizes = (0..dof).map(|i| out.size(i));
                out.matrices = sizes.map(|n| vec![0.0; n * n]).collect();
            }
            if (out.tried - 1).is_multiple_of(apart) {
                out.postures.push(full.q.clone());
            }
            out.count += 1.0;
            let mut sides = Vec::with_capacity(dof);
            for i in 0..dof {
                let place = sticking.get(i).copied().flatten();
                let sticks = place.is_some_and(|k| state.resting.get(k) == Some(&true));
                if out.left_out[i] || sticks {
                    // nothing is left of an equation that is not there
                    sides.push(0.0);
                    for of in [&mut w, &mut transfer] {
                        of.iter_mut().skip(i).step_by(dof).for_each(|x| *x = 0.0);
                    }
                    continue;
                }
                entries.clear();
                entries.extend(w.iter().skip(i).step_by(dof));
                let mut tau = 0.0;
                for &k in &out.acting[i] {
                    let t = transfer[k * dof + i];
                    entries.extend(state.efforts.iter().map(|u| t * u));
                    tau += t * state.efforts.get(k)?;
                }
                entries.extend(out.acting[i].iter().map(|k| transfer[k * dof + i]));
                sides.push(tau);
                let predicted = beta.as_ref().map_or(0.0, |beta| {
                    let pairs = entries.iter().zip(beta);
                    pairs.map(|(w, b)| w * b).sum()
                });
                entries.push(predicted);
                entries.push(1.0);
                let n = entries.len();
                let gram = &mut out.matrices[i];
                for (a, x) in entries.iter().enumerate() {
                    for (b, y) in entries[..=a].iter().enumerate() {
                        gram[a * n + b] += x * y;
                    }
                }
                let rate = full.qd[info.independent[i]];
                out.accelerations[i] += full.qdd[info.independent[i]].powi(2);
                for (power, w) in out.power.iter_mut().zip(&entries) {
                    *power += w * rate;
                }
                out.spent[i] += (tau * rate).abs();
            }
            if spreads.is_none() {
                out.stored.push(Stored {
                    state: place,
                    w: w.clone(),
                    tau: sides,
                    transfer: transfer.clone(),
                });
            }
        }
        for gram in &mut out.matrices {
            let n = gram.len().isqrt();
            for a in 0..n {
                for b in 0..a {
                    gram[b * n + a] = gram[a * n + b];
                }
            }
        }
        (out.count > 0.0).then_some(out)
    }

    /// The same sums, whose errors are compared with what changes of the efforts, however large their means are.
    pub(super) fn of_changes(&self) -> Self {
        Self {
            least_spread: LEAST_SPREAD_OF_CHANGES,
            ..self.clone()
        }
    }

    /// The number of columns of equation `i`.
    fn size(&self, i: usize) -> usize {
        self.columns + self.acting[i].len() * (self.efforts + 1) + 2
    }

    /// The number of efforts.
    pub(super) fn efforts(&self) -> usize {
        self.efforts
    }

    /// The number of base parameters.
    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// Whether the loops close at nearly all states.
    pub(super) fn closes(&self) -> bool {
        self.count >= MIN_CLOSED_PART * self.tried as f64
    }

    /// The number of states at which equation `i` is used.
    fn count(&self, i: usize) -> f64 {
        let last = self.size(i) - 1;
        self.entry(i, last, last).max(1.0)
    }

    /// The number of equations.
    pub(super) fn rows(&self) -> usize {
        self.acting.len()
    }

    /// The effort that acts on an equation, if it is the only one.
    pub(super) fn only_effort(&self, i: usize) -> Option<usize> {
        match self.acting.get(i).map(Vec::as_slice) {
            Some([k]) => Some(*k),
            _ => None,
        }
    }

    fn entry(&self, i: usize, a: usize, b: usize) -> f64 {
        self.matrices[i][a * self.size(i) + b]
    }

    /// The columns of equation `i` whose sum is its right-hand side, with their factors.
    fn side(&self, i: usize, read: &[Reading]) -> Vec<(usize, f64)> {
        let acting = self.acting[i].iter().enumerate();
        let place = |(a, k): (usize, &usize)| {
            let read = read.get(*k)?;
            Some((self.columns + a * self.efforts + read.from, read.factor))
        };
        acting.filter_map(place).collect()
    }

    /// The column of an effort's offset in equation `i`, if the effort acts on it.
    fn constant(&self, i: usize, effort: usize) -> Option<usize> {
        let acting = &self.acting[i];
        let place = acting.iter().position(|k| *k == effort)?;
        Some(self.columns + acting.len() * self.efforts + place)
    }

    /// The inner product of two sums of columns.
    fn product(&self, i: usize, a: &[(usize, f64)], b: &[(usize, f64)]) -> f64 {
        let one = |(x, f): &(usize, f64)| -> f64 {
            let terms = b.iter().map(|(y, g)| self.entry(i, *x, *y) * g);
            f * terms.sum::<f64>()
        };
        a.iter().map(one).sum()
    }

    /// Least squares with the given readings of the efforts and free offsets of some; every
    /// equation is weighted by its own error. `None` if an effort does not change.
    pub(super) fn fit(&self, read: &[Reading], offsets: &[usize]) -> Option<Fit> {
        self.solve(read, offsets, None)
    }

    /// As [`fit`](Self::fit) without offsets, with one base parameter fixed at zero.
    pub(super) fn fit_without(&self, read: &[Reading], column: usize) -> Option<Fit> {
        self.solve(read, &[], Some(column))
    }

    /// The error of equation `i`, solved alone with a constant, if its effort is read from the column of the effort
    /// `from`.
    pub(super) fn error_of(&self, i: usize, from: usize) -> Option<f64> {
        let own = self.only_effort(i)?;
        let mut read = Reading::plain(self.efforts);
        read.get_mut(own)?.from = from;
        let side = self.side(i, &read);
        let last = self.size(i) - 1;
        let places: Vec<usize> = (0..self.columns).chain(self.constant(i, own)).collect();
        let n = places.len();
        let mut gram = vec![0.0; n * n];
        for (a, p) in places.iter().enumerate() {
            for (b, q) in places[..=a].iter().enumerate() {
                gram[a * n + b] = self.entry(i, *p, *q);
            }
        }
        let right: Vec<f64> = places
            .iter()
            .map(|p| self.product(i, &[(*p, 1.0)], &side))
            .collect();
        let square = self.product(i, &side, &side);
        let mean = self.product(i, &side, &[(last, 1.0)]);
        let spread = (square - mean * mean / self.count(i)).max(self.least_spread * square);
        let values = solve(&mut gram, &right)?;
        let places: Vec<Option<usize>> = places.into_iter().map(Some).collect();
        let left = self.squared_residuals(i, &places, &values, square, &right);
        (spread > 0.0).then(|| (left / spread).sqrt())
    }

    /// The factors on the efforts, read from the columns of others in this order, with which the equations agree
    /// best if that of effort `one` is 1 and each may have a constant; 0 where nothing tells it. `None` where an
    /// equation has several efforts.
    pub(super) fn factors(&self, order: &[usize], one: usize) -> Option<Vec<f64>> {
        // the unknowns are the parameters, the constants and the factors
        let (n, count) = (self.columns, order.len());
        let m = n + 2 * count;
        let mut gram = vec![0.0; m * m];
        for i in (0..self.rows()).filter(|i| !self.left_out[*i]) {
            let own = self.only_effort(i)?;
            let side = n + order.get(own)?;
            let square = self.entry(i, side, side);
            let mean = self.entry(i, side, self.size(i) - 1);
            let spread = (square - mean * mean / self.count(i)).max(self.least_spread * square);
            let mut places: Vec<(usize, usize, f64)> = (0..n).map(|k| (k, k, 1.0)).collect();
            places.push((n + own, self.constant(i, own)?, 1.0));
            places.push((n + count + own, side, -1.0));
            for (a, p, x) in &places {
                for (b, q, y) in places.iter().filter(|(b, ..)| b <= a) {
                    gram[a * m + b] += x * y * self.entry(i, *p, *q) / spread;
                }
            }
        }
        let fixed = n + count + one;
        let rest: Vec<usize> = (0..m).filter(|k| *k != fixed).collect();
        let mut left = vec![0.0; rest.len() * rest.len()];
        for (a, x) in rest.iter().enumerate() {
            for (b, y) in rest[..=a].iter().enumerate() {
                left[a * rest.len() + b] = gram[x * m + y];
            }
        }
        let right = |x: &usize| -gram[(*x).max(fixed) * m + (*x).min(fixed)];
        let right: Vec<f64> = rest.iter().map(right).collect();
        let mut solved = solve(&mut left, &right)?.split_off(n + count);
        solved.insert(one, 1.0);
        Some(solved)
    }

    /// What the base parameters do not explain of a quantity at some states, given equation by equation with
    /// these weights in it.
    pub(super) fn without_parameters(
        &self,
        states: &[&Stored],
        weights: &[f64],
        quantity: &[f64],
    ) -> Option<Vec<f64>> {
        let (n, rows) = (self.columns, self.rows());
        let (mut gram, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        let weighted = |place: usize| {
            let (state, i) = (states[place / rows], place % rows);
            let row = state.w.iter().skip(i).step_by(rows);
            row.map(|w| w * weights[i]).collect::<Vec<f64>>()
        };
        for (place, y) in quantity.iter().enumerate() {
            let row = weighted(place);
            for (a, x) in row.iter().enumerate() {
                right[a] += x * y;
                for (b, z) in row[..=a].iter().enumerate() {
                    gram[a * n + b] += x * z;
                }
            }
        }
        let values = solve(&mut gram, &right)?;
        let left = quantity.iter().enumerate().map(|(place, y)| {
            let row = weighted(place);
            y - row.iter().zip(&values).map(|(w, b)| w * b).sum::<f64>()
        });
        Some(left.collect())
    }

    fn solve(&self, read: &[Reading], offsets: &[usize], zero: Option<usize>) -> Option<Fit> {
        let n = self.columns + offsets.len();
        let rows = self.rows();
        // the index of each of the n unknowns' columns in each equation
        let mut places = Vec::with_capacity(rows);
        let (mut squares, mut spreads, mut sides) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..rows {
            if self.left_out[i] {
                places.push(vec![None; n]);
                squares.push(0.0);
                spreads.push(1.0);
                sides.push(vec![0.0; n]);
                continue;
            }
            let mut place: Vec<Option<usize>> = (0..self.columns)
                .map(|c| (Some(c) != zero).then_some(c))
                .collect();
            place.extend(offsets.iter().map(|k| self.constant(i, *k)));
            let side = self.side(i, read);
            let one = [(self.size(i) - 1, 1.0)];
            let square = self.product(i, &side, &side);
            let mean = self.product(i, &side, &one);
            let spread = (square - mean * mean / self.count(i)).max(self.least_spread * square);
            if spread.partial_cmp(&0.0) != Some(core::cmp::Ordering::Greater) {
                return None;
            }
            let right: Vec<f64> = place
                .iter()
                .map(|p| p.map_or(0.0, |p| self.product(i, &[(p, 1.0)], &side)))
                .collect();
            places.push(place);
            squares.push(square);
            spreads.push(spread);
            sides.push(right);
        }
        let mut residuals = spreads.clone();
        let mut values = vec![0.0; n];
        for _ in 0..REWEIGHTING_PASSES {
            let (mut gram, mut right) = (vec![0.0; n * n], vec![0.0; n]);
            for i in 0..rows {
                let weight = self.count(i)
                    / residuals[i].max(MIN_RELATIVE_ERROR * MIN_RELATIVE_ERROR * spreads[i]);
                let (size, own, place) = (self.size(i), &self.matrices[i], &places[i]);
                for (a, p) in place.iter().enumerate() {
                    let Some(p) = p else { continue };
                    right[a] += weight * sides[i][a];
                    for (b, q) in place[..=a].iter().enumerate() {
                        if let Some(q) = q {
                            gram[a * n + b] += weight * own[p * size + q];
                        }
                    }
                }
            }
            values = solve(&mut gram, &right)?;
            for i in 0..rows {
                residuals[i] =
                    self.squared_residuals(i, &places[i], &values, squares[i], &sides[i]);
            }
        }
        let rms = |squares: &[f64]| {
            let each = squares.iter().enumerate();
            each.map(|(i, s)| (s / self.count(i)).sqrt()).collect()
        };
        let least = self.least.iter().copied().chain(core::iter::repeat(0.0));
        let pairs = residuals.iter().zip(&spreads).zip(least);
        Some(Fit {
            values,
            errors: pairs
                .map(|((r, s), least)| {
                    let own = (r / s).sqrt();
                    own.max(least + COUNTED_PART * (own - least))
                })
                .collect(),
            sizes: rms(&squares),
            spreads: rms(&spreads),
        })
    }

    /// The sum of the squared residuals of an equation.
    fn squared_residuals(
        &self,
        i: usize,
        place: &[Option<usize>],
        values: &[f64],
        square: f64,
        right: &[f64],
    ) -> f64 {
        let (size, own) = (self.size(i), &self.matrices[i]);
        let mut out = square;
        for ((p, x), side) in place.iter().zip(values).zip(right) {
            let Some(p) = p else { continue };
            let row = &own[p * size..(p + 1) * size];
            let fitted: f64 = place
                .iter()
                .zip(values)
                .filter_map(|(q, y)| q.map(|q| row[q] * y))
                .sum();
            out += x * (fitted - 2.0 * side);
        }
        out.max(0.0)
    }

    /// For each equation, the rms of what the nominal bodies do not need of the effort, over the rms
    /// of the effort about its mean. Friction, and what has no nominal value, is fitted.
    ///
    /// - `offsets`: the efforts with a free constant.
    pub(super) fn errors_of_nominal<M: BaseModel<f64> + ?Sized>(
        &self,
        model: &M,
        read: &[Reading],
        offsets: &[usize],
    ) -> Option<Vec<f64>> {
        let one = |i: usize| {
            if self.left_out[i] {
                return Some(0.0);
            }
            let last = self.size(i) - 1;
            let constants = offsets.iter().filter_map(|k| self.constant(i, *k));
            let separate: Vec<usize> = (0..self.columns)
                .filter(|c| lacks_nominal(model, *c))
                .chain(constants)
                .filter(|c| self.entry(i, *c, *c) > 0.0)
                .collect();
            let side = self.side(i, read);
            let mean = self.product(i, &side, &[(last, 1.0)]);
            let square = self.product(i, &side, &side);
            let spread = square - mean * mean / self.count(i);
            let mut rest = side;
            rest.push((last - 1, -1.0));
            let n = separate.len();
            let mut gram = vec![0.0; n * n];
            for (a, p) in separate.iter().enumerate() {
                for (b, q) in separate[..=a].iter().enumerate() {
                    gram[a * n + b] = self.entry(i, *p, *q);
                }
            }
            let right: Vec<f64> = separate
                .iter()
                .map(|p| self.product(i, &[(*p, 1.0)], &rest))
                .collect();
            let solved = solve(&mut gram, &right)?;
            let explained: f64 = solved.iter().zip(&right).map(|(a, b)| a * b).sum();
            let left = (self.product(i, &rest, &rest) - explained).max(0.0);
            (spread > 0.0).then(|| (left / spread).sqrt())
        };
        if !self.nominal {
            return None;
        }
        (0..self.rows()).map(one).collect()
    }

    /// The standard deviation of what the nominal bodies need in equation `i`, N or N m.
    pub(super) fn needed(&self, i: usize) -> f64 {
        let last = self.size(i) - 1;
        let mean = self.entry(i, last - 1, last) / self.count(i);
        let square = self.entry(i, last - 1, last - 1) / self.count(i);
        (square - mean * mean).max(0.0).sqrt()
    }

    /// The constant that the effort of equation `i` lacks of what the nominal bodies need, over the rms of what they
    /// need.
    pub(super) fn lacking_part(&self, i: usize, read: &[Reading]) -> f64 {
        let last = self.size(i) - 1;
        let mut rest = self.side(i, read);
        rest.push((last - 1, -1.0));
        let lacking = self.product(i, &rest, &[(last, 1.0)]) / self.count(i);
        let needed = self.entry(i, last - 1, last - 1) / self.count(i);
        (lacking * lacking / needed.max(f64::MIN_POSITIVE)).sqrt()
    }

    /// Compares the effort of equation `i` with the one that the nominal bodies need, after
    /// subtracting from both what friction, offsets and rotors without nominal values and a constant
    /// explain.
    /// Returns the correlation, the slope, and the remaining part of the effort's rms.
    pub(super) fn compare_with_nominal<M: BaseModel<f64> + ?Sized>(
        &self,
        model: &M,
        i: usize,
        read: &[Reading],
    ) -> Option<(f64, f64, f64)> {
        let last = self.size(i) - 1;
        let separate: Vec<usize> = (0..self.columns)
            .filter(|c| lacks_nominal(model, *c))
            .filter(|c| self.entry(i, *c, *c) > 0.0)
            .chain([last])
            .collect();
        let n = separate.len();
        let mut gram = vec![0.0; n * n];
        for (a, p) in separate.iter().enumerate() {
            for (b, q) in separate[..=a].iter().enumerate() {
                gram[a * n + b] = self.entry(i, *p, *q);
            }
        }
        let side = self.side(i, read);
        let nominal = [(last - 1, 1.0)];
        let of = |what: &[(usize, f64)]| -> Vec<f64> {
            let one = |p: &usize| self.product(i, &[(*p, 1.0)], what);
            separate.iter().map(one).collect()
        };
        let (tau, own) = (of(&side), of(&nominal));
        let solved = solve(&mut gram, &own)?;
        let explained =
            |other: &[f64]| -> f64 { solved.iter().zip(other).map(|(a, b)| a * b).sum() };
        let pp = self.product(i, &nominal, &nominal) - explained(&own);
        let pt = self.product(i, &nominal, &side) - explained(&tau);
        let mut again = vec![0.0; n * n];
        for (a, p) in separate.iter().enumerate() {
            for (b, q) in separate[..=a].iter().enumerate() {
                again[a * n + b] = self.entry(i, *p, *q);
            }
        }
        let both = solve(&mut again, &tau)?;
        let tt =
            self.product(i, &side, &side) - both.iter().zip(&tau).map(|(a, b)| a * b).sum::<f64>();
        let whole = self.product(i, &side, &side);
        (pp > 0.0 && tt > 0.0).then(|| (pt / (pp * tt).sqrt(), pt / pp, (tt / whole).sqrt()))
    }
}

/// Solves with a Gram matrix, given by its lower triangle, by Cholesky's factorisation after
/// scaling its columns to unit length and adding a ridge.
pub(super) fn solve(gram: &mut [f64], right: &[f64]) -> Option<Vec<f64>> {
    let n = right.len();
    let scale: Vec<f64> = (0..n)
        .map(|k| match gram[k * n + k] {
            d if d > 0.0 => 1.0 / d.sqrt(),
            _ => 0.0,
        })
        .collect();
    for a in 0..n {
        for b in 0..=a {
            let scaled = gram[a * n + b] * scale[a] * scale[b];
            gram[a * n + b] = if a == b { 1.0 + RIDGE } else { scaled };
        }
    }
    for a in 0..n {
        for b in 0..=a {
            let (upper, lower) = gram.split_at(a * n);
            let row = if a == b {
                &lower[..a]
            } else {
                &upper[b * n..b * n + b]
            };
            let dot: f64 = row.iter().zip(&lower[..b]).map(|(x, y)| x * y).sum();
            let value = gram[a * n + b] - dot;
            gram[a * n + b] = if a == b {
                // the ridge bounds the pivots of linearly dependent columns
                value.max(RIDGE).sqrt()
            } else {
                value / gram[b * n + b]
            };
        }
    }
    let mut x: Vec<f64> = right.iter().zip(&scale).map(|(r, s)| r * s).collect();
    for a in 0..n {
        let dot: f64 = (0..a).map(|b| gram[a * n + b] * x[b]).sum();
        x[a] = (x[a] - dot) / gram[a * n + a];
    }
    for a in (0..n).rev() {
        let dot: f64 = (a + 1..n).map(|b| gram[b * n + a] * x[b]).sum();
        x[a] = (x[a] - dot) / gram[a * n + a];
    }
    for (x, s) in x.iter_mut().zip(&scale) {
        *x *= s;
    }
    x.iter().all(|x| x.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::super::swings_for_tests::{sample, swings, with};
    use super::*;

    #[test]
    fn normal_equations_are_solved_whatever_the_units_of_their_unknowns_are() {
        let rows = [
            [2.0, 0.3, -1.0],
            [0.5, 1.5, 0.2],
            [-0.7, 0.4, 3.0],
            [1.0, 1.0, 1.0],
        ];
        let (units, expected) = ([1e3, 1.0, 1e-4], [5e-4, -2.0, 4e4]);
        let (mut gram, mut right) = (vec![0.0; 9], vec![0.0; 3]);
        for row in rows {
            let row: Vec<f64> = row.iter().zip(units).map(|(w, u)| w * u).collect();
            let y: f64 = row.iter().zip(expected).map(|(w, x)| w * x).sum();
            for a in 0..3 {
                right[a] += row[a] * y;
                for b in 0..=a {
                    gram[3 * a + b] += row[a] * row[b];
                }
            }
        }
        let found = solve(&mut gram, &right).unwrap_or_default();
        assert_eq!(found.len(), 3);
        for (own, expected) in found.iter().zip(expected) {
            assert!((own / expected - 1.0).abs() < 1e-6, "{found:?}");
        }
        // a column of zeros has the value 0
        let of_zeros = solve(&mut [4.0, 0.0, 0.0, 0.0], &[8.0, 0.0]).unwrap_or_default();
        assert!((of_zeros[0] - 2.0).abs() < 1e-9 && of_zeros[1].abs() <= 0.0);
    }

    #[test]
    fn a_coordinate_that_hardly_moves_has_the_spread_of_its_kind() {
        let moved = with(|s| {
            s.motion[0] = vec![7.0 + (2.0 * s.time).sin(), -3.0, 0.4];
        });
        let model = swings(false);
        let found = spreads(&model, &moved, &Reading::plain(3));
        let deviation = 0.5_f64.sqrt();
        assert!((found[0] / deviation - 1.0).abs() < 0.05, "{found:?}");
        assert!(
            (found[1] / (MIN_SPREAD * found[0]) - 1.0).abs() < 1e-9,
            "{found:?}"
        );
        // no other one slides
        assert!(found[2] < 1e-9, "{found:?}");
    }

    #[test]
    fn an_effort_that_is_zero_is_explained_by_nothing() {
        let model = swings(false);
        let of = |sample: &Sample| Grams::of(&model, sample, &Reading::plain(3), 1);
        let usual = of(&sample()).and_then(|own| own.error_of(1, 1));
        assert!(usual.is_some_and(|error| error < 0.05), "{usual:?}");
        let zero = of(&with(|s| s.efforts[1] = 0.0)).and_then(|own| own.error_of(1, 1));
        assert_eq!(zero, None);
    }

    #[test]
    fn equations_of_a_joint_that_rests_are_left_out_unless_it_rests_mostly() {
        let mut model = swings(false);
        model.joints[1].friction = regen_runtime::Friction::Coulomb;
        let error = |one_of: usize, model: &super::super::swings_for_tests::Swings| {
            let mut sticking = sample();
            for (k, own) in sticking.states.iter_mut().enumerate() {
                own.resting = vec![false, k.is_multiple_of(one_of), false];
                own.efforts[1] += if own.resting[1] { 5.0 } else { 0.0 };
            }
            let plain = Reading::plain(3);
            let grams = Grams::of(model, &sticking, &plain, 1);
            grams
                .and_then(|own| own.fit(&plain, &[]))
                .map_or(1.0, |fit| fit.errors[1])
        };
        assert!(error(3, &model) < 0.02, "{}", error(3, &model));
        assert!(error(1, &model) > 0.2);
        // without friction there is nothing that sticks
        assert!(error(3, &swings(false)) > 0.2);
    }

    #[test]
    fn equations_that_share_a_parameter_tell_the_factors_of_their_efforts() {
        let model = swings(false);
        let scaled = with(|s| {
            s.efforts[1] *= 10.0;
            s.efforts[2] = -3.0 * s.efforts[2] + 1.0;
        });
        let found = Grams::of(&model, &scaled, &Reading::plain(3), 1);
        let found = found
            .and_then(|own| own.factors(&[0, 1, 2], 0))
            .unwrap_or_default();
        for (own, expected) in found.iter().zip([1.0, 0.1, -1.0 / 3.0]) {
            assert!((own / expected - 1.0).abs() < 0.05, "{found:?}");
        }
        assert_eq!(found.len(), 3);
    }
}
