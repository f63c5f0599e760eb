//! Loop closure of many states along a trajectory, blocks of them at a time.

use regen_runtime::{Arguments, ClosureError, Function, LoopClosure, Model, Outcome, SizeError};

use crate::eval_many;
use crate::inverse::{Reference, largest};

/// The most states that are solved at a time.
const BLOCK: usize = 64;
/// Bound on |f| of a closed state, relative to the size of the rows' terms: that of [`LoopClosure`].
pub(super) const RELATIVE_TOLERANCE: f64 = 1e-12;
/// A Newton step below this, relative to 1 + the size of the dependent coordinates, has converged.
pub(super) const CONVERGED_STEP: f64 = 1e-9;
/// The same for the states that are only predecessors: the error that remains is its square.
const ROUGH_STEP: f64 = 1e-5;
/// The most that a coordinate moves from one state to the next, and that the corrector moves
/// relative to that: those of [`LoopClosure`].
pub(super) const MAX_PREDICTOR_MOVE: f64 = 0.25;
pub(super) const MAX_CORRECTION_RATIO: f64 = 0.25;
/// Both solutions of a state, from the block's start and from the state before it, differ by less:
/// each is within the square of its last step of the exact one, 1e-10 at most, and other solutions
/// are far from it where A is regular.
const SAME_SOLUTION: f64 = 1e-8;
/// Below this pivot, states are solved one by one, with the condition number of A_e.
pub(super) const SUSPECT_PIVOT: f64 = 0.1;
/// Newton steps per solution; from the state before it, two or three are enough.
pub(super) const MAX_STEPS: usize = 8;

/// States of motion along a trajectory. Series are stored entry by entry: those of coordinate c
/// from `c * len()` on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackedStates {
    /// All n coordinates, rad or m; NaN where the loops were not closed.
    pub q: Vec<f64>,
    /// All n velocities, rad/s or m/s.
    pub qd: Vec<f64>,
    /// All n accelerations, rad/s^2 or m/s^2.
    pub qdd: Vec<f64>,
    /// Whether the loops were closed, or why not.
    pub outcomes: Vec<Outcome>,
}

impl TrackedStates {
    /// The number of states.
    pub fn len(&self) -> usize {
        self.outcomes.len()
    }

    /// Whether there are no states.
    pub fn is_empty(&self) -> bool {
        self.outcomes.is_empty()
    }

    /// The entries of one state of a series of `q`, `qd` or `qdd`.
    pub fn at<'a>(&self, series: &'a [f64], state: usize) -> impl Iterator<Item = f64> + 'a {
        series
            .iter()
            .skip(state)
            .step_by(self.len().max(1))
            .copied()
    }
}

/// Follows trajectories in the independent coordinates as [`LoopClosure::track_state`] does, with
/// functions that are computed at many states at once.
///
/// The states of a block are first solved by Newton's method from the state before the block. Then
/// each is solved again from its predecessor by the rule of [`LoopClosure`]: a predictor along the
/// tangent, steps that halve and are short compared to the predictor, an A that changes by at most
/// half of what could make it singular (here since the state before the block). The states up to
/// the first one that breaks the rule are accepted; that one is left to [`LoopClosure`], and so are
/// states near singularities. So no state is closed here that it would not close.
#[derive(Debug)]
pub struct TrajectoryClosure<'m, M: ?Sized> {
    model: &'m M,
    closure: LoopClosure<'m, M>,
    /// The last closed state; `None` before the first.
    last: Option<Vec<f64>>,
    /// Whether `closure` was left at an earlier state than `last`.
    behind: bool,
    units: Vec<f64>,
    row_units: Vec<f64>,
}

/// The trajectory of the independent coordinates: position, velocity, acceleration, each `dof`
/// series of `count` states.
#[derive(Clone, Copy)]
struct Trajectory<'a> {
    count: usize,
    parts: [&'a [f64]; 3],
}

impl Trajectory<'_> {
    /// The values of one part at one state.
    fn at(&self, part: usize, state: usize) -> Vec<f64> {
        let values = self.parts[part].iter().skip(state);
        values.step_by(self.count).copied().collect()
    }

    /// The series of one part at the states from `first` on.
    fn block(&self, part: usize, first: usize, len: usize) -> Vec<f64> {
        let series = self.parts[part].chunks_exact(self.count);
        let block = series.filter_map(|series| series.get(first..first + len));
        block.flatten().copied().collect()
    }
}

/// The states of a block.
struct Block {
    len: usize,
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    /// The number of states at its start that were accepted.
    accepted: usize,
}

impl<'m, M: Model<f64> + ?Sized> TrajectoryClosure<'m, M> {
    /// Closes the model at home.
    ///
    /// # Errors
    /// When the model's `Info` is inconsistent; see [`LoopClosure::new`].
    pub fn new(model: &'m M) -> Result<Self, ClosureError> {
        let closure = LoopClosure::new(model)?;
        let (units, row_units) = closure.units();
        let (units, row_units) = (units.to_vec(), row_units.to_vec());
        Ok(Self {
            model,
            closure,
            last: None,
            behind: false,
            units,
            row_units,
        })
    }

    /// Starts the next trajectory from home.
    pub fn restart(&mut self) {
        self.closure.restart();
        (self.last, self.behind) = (None, false);
    }

    /// The state from which the next trajectory goes on; `None` for home.
    pub fn place(&self) -> Option<Vec<f64>> {
        self.last.clone()
    }

    /// Makes the next trajectory go on from a state that [`place`](Self::place) gave.
    pub fn go_back(&mut self, place: Option<&[f64]>) {
        match place {
            None => self.restart(),
            Some(q) => {
                self.last = Some(q.to_vec());
                self.behind = true;
            }
        }
    }

    /// The closure of single states, at the last state of the trajectory; the next trajectory goes on
    /// from the last state that it solves.
    ///
    /// # Errors
    /// When the model is inconsistent.
    pub fn single(&mut self) -> Result<&mut LoopClosure<'m, M>, ClosureError> {
        self.catch_up()?;
        self.last = None;
        Ok(&mut self.closure)
    }

    /// Brings the closure of single states to the last state that was accepted.
    fn catch_up(&mut self) -> Result<(), ClosureError> {
        if let (true, Some(last)) = (self.behind, &self.last) {
            // the blocks accept no state that is open or singular
            let _ = self.closure.resume(last)?;
        }
        self.behind = false;
        Ok(())
    }

    /// Closes the loops along a trajectory that goes on where the last one ended, or at home.
    ///
    /// - `q_i`, `qd_i`, `qdd_i`: `dof` series of `count` states each, one after the other, in the
    ///   order of `Info::independent`; rad or m, and s.
    ///
    /// # Errors
    /// When an argument has a wrong length or an entry that is not finite.
    ///
    /// ```
    /// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/slider_crank.rs")); }
    /// # use models::SliderCrank;
    /// use regen_batch::TrajectoryClosure;
    ///
    /// // crank 1 m, rod 2 m: a quarter turn at 1 rad/s
    /// let model = SliderCrank::default();
    /// let mut closure = TrajectoryClosure::new(&model)?;
    /// let crank: Vec<f64> = (0..=100).map(|k| 0.005 * core::f64::consts::PI * f64::from(k)).collect();
    /// let states = closure.track(101, &crank, &[1.0; 101], &[0.0; 101])?;
    /// assert!(states.outcomes.iter().all(|o| o.is_closed()));
    /// let slider = &states.q[2 * 101..];
    /// assert!((slider[100] - 3.0_f64.sqrt()).abs() < 1e-14);
    /// # Ok::<(), regen_runtime::ClosureError>(())
    /// ```
    pub fn track(
        &mut self,
        count: usize,
        q_i: &[f64],
        qd_i: &[f64],
        qdd_i: &[f64],
    ) -> Result<TrackedStates, ClosureError> {
        let info = self.model.info();
        let (n, dof) = (info.coordinates.len(), info.dof());
        let parts = [q_i, qd_i, qdd_i];
        for (argument, series) in ["q_i", "qd_i", "qdd_i"].into_iter().zip(parts) {
            if series.len() != dof * count {
                return Err(ClosureError::Size(SizeError {
                    argument,
                    expected: dof * count,
                    got: series.len(),
                }));
            }
            if let Some(index) = series.iter().position(|x| !x.is_finite()) {
                return Err(ClosureError::NotFinite { argument, index });
            }
        }
        let mut states = TrackedStates {
            q: vec![f64::NAN; n * count],
            qd: vec![f64::NAN; n * count],
            qdd: vec![f64::NAN; n * count],
            outcomes: Vec::with_capacity(count),
        };
        let trajectory = Trajectory { count, parts };
        // where a block accepts nothing, so many states are solved one by one before the next one
        let mut alone = 1;
        while states.len() < count {
            let first = states.len();
            let block = self.block(&trajectory, first, BLOCK.min(count - first))?;
            let accepted = block.as_ref().map_or(0, |b| b.accepted);
            if let Some(block) = block.filter(|b| b.accepted > 0) {
                copy(&block.q, block.len, &mut states.q, count, first, accepted);
                copy(&block.qd, block.len, &mut states.qd, count, first, accepted);
                copy(
                    &block.qdd,
                    block.len,
                    &mut states.qdd,
                    count,
                    first,
                    accepted,
                );
                states
                    .outcomes
                    .extend((0..accepted).map(|_| Outcome::Closed));
                let end = block.q.iter().skip(accepted - 1).step_by(block.len);
                self.last = Some(end.copied().collect());
                self.behind = true;
                alone = 1;
                continue;
            }
            for state in first..count.min(first + alone) {
                self.one(&trajectory, state, &mut states)?;
            }
            alone = BLOCK.min(2 * alone);
        }
        Ok(states)
    }

    /// Solves one state by [`LoopClosure`].
    fn one(
        &mut self,
        trajectory: &Trajectory<'_>,
        state: usize,
        states: &mut TrackedStates,
    ) -> Result<(), ClosureError> {
        self.catch_up()?;
        let [q_i, qd_i, qdd_i] = [0, 1, 2].map(|part| trajectory.at(part, state));
        let found = self.closure.track_state(&q_i, &qd_i, &qdd_i)?;
        if found.outcome.is_closed() {
            let count = trajectory.count;
            for (series, values) in [
                (&mut states.q, &found.q),
                (&mut states.qd, &found.qd),
                (&mut states.qdd, &found.qdd),
            ] {
                for (slot, value) in series.iter_mut().skip(state).step_by(count).zip(values) {
                    *slot = *value;
                }
            }
            self.last = Some(found.q);
        }
        states.outcomes.push(found.outcome);
        Ok(())
    }

    /// Solves the states of a block; `None` where there is no state to start from, or the
    /// mechanism is near a singularity there.
    fn block(
        &self,
        trajectory: &Trajectory<'_>,
        first: usize,
        len: usize,
    ) -> Result<Option<Block>, ClosureError> {
        let info = self.model.info();
        let Some(last) = &self.last else {
            return Ok(None);
        };
        let targets = trajectory.block(0, first, len);
        let mut ok = vec![true; len];
        let mut q = repeated(last, len);
        if info.dependent.is_empty() {
            set(&mut q, info.independent, &targets, len);
        } else {
            let Some(reference) = self.reference(last)? else {
                return Ok(None);
            };
            let line = difference(&targets, &q, info.independent, len);
            let mut rough = self.predicted(&q, &line, &targets, len)?.0;
            self.newton(&mut rough, &mut ok, None, len)?;
            // each state again from the one before it
            let before = shifted(last, &rough, len);
            let line = difference(&targets, &before, info.independent, len);
            let (predicted, moves) = self.predicted(&before, &line, &targets, len)?;
            q = predicted;
            for (ok, moved) in ok.iter_mut().zip(&moves) {
                *ok &= *moved <= MAX_PREDICTOR_MOVE;
            }
            self.newton(&mut q, &mut ok, Some(&moves), len)?;
            for (c, unit) in info.dependent.iter().map(|c| (*c, self.units[*c])) {
                let pairs = q[c * len..].iter().zip(&rough[c * len..]);
                for (ok, (a, b)) in ok.iter_mut().zip(pairs) {
                    *ok &= ((a - b) / unit).abs() <= SAME_SOLUTION;
                }
            }
            self.check_closed(&reference, &q, &mut ok, len)?;
        }
        let (qd_i, qdd_i) = (
            trajectory.block(1, first, len),
            trajectory.block(2, first, len),
        );
        let (mut qd, mut qdd) = (vec![0.0; q.len()], vec![0.0; q.len()]);
        let arguments = Arguments {
            q: &q,
            qd_i: &qd_i,
            ..Arguments::EMPTY
        };
        self.eval(Function::Velocities, arguments, &mut qd, &mut ok)?;
        let arguments = Arguments {
            q: &q,
            qd: &qd,
            qdd_i: &qdd_i,
            ..Arguments::EMPTY
        };
        self.eval(Function::Accelerations, arguments, &mut qdd, &mut ok)?;
        let accepted = ok.iter().take_while(|ok| **ok).count();
        Ok(Some(Block {
            len,
            q,
            qd,
            qdd,
            accepted,
        }))
    }

    /// The inverse of A at a closed state; `None` where it is near a singularity.
    fn reference(&self, q: &[f64]) -> Result<Option<Reference>, ClosureError> {
        let info = self.model.info();
        let mut a = vec![0.0; info.rows * q.len()];
        self.model.jacobian(q, &mut a)?;
        Ok(Reference::new(&a, q.len(), info.dependent))
    }

    /// Computes a function at the states of a block; states with a small pivot are no longer `ok`.
    fn eval(
        &self,
        function: Function,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
        ok: &mut [bool],
    ) -> Result<(), ClosureError> {
        let mut pivots = vec![1.0; ok.len()];
        eval_many(self.model, function, ok.len(), arguments, out, &mut pivots)?;
        for (ok, pivot) in ok.iter_mut().zip(&pivots) {
            *ok &= *pivot >= SUSPECT_PIVOT;
        }
        Ok(())
    }

    /// The states along the tangents from `q`, and how far any coordinate moves there, in units.
    fn predicted(
        &self,
        q: &[f64],
        line: &[f64],
        targets: &[f64],
        len: usize,
    ) -> Result<(Vec<f64>, Vec<f64>), ClosureError> {
        let info = self.model.info();
        let mut tangent = vec![0.0; q.len()];
        let arguments = Arguments {
            q,
            qd_i: line,
            ..Arguments::EMPTY
        };
        let mut pivots = vec![1.0; len];
        eval_many(
            self.model,
            Function::Velocities,
            len,
            arguments,
            &mut tangent,
            &mut pivots,
        )?;
        let mut moves = vec![0.0; len];
        for (series, unit) in tangent.chunks_exact(len).zip(&self.units) {
            for (moved, step) in moves.iter_mut().zip(series) {
                *moved = largest(*moved, (step / unit).abs());
            }
        }
        for (step, q) in tangent.iter_mut().zip(q) {
            *step += q;
        }
        set(&mut tangent, info.independent, targets, len);
        Ok((tangent, moves))
    }

    /// Newton's method for the dependent coordinates of each state. With `moves` the steps must
    /// halve and stay short compared to these predictors; states that break that, or do not
    /// converge, are no longer `ok`.
    fn newton(
        &self,
        q: &mut [f64],
        ok: &mut [bool],
        moves: Option<&[f64]>,
        len: usize,
    ) -> Result<(), ClosureError> {
        let info = self.model.info();
        let mut step = vec![0.0; info.dependent.len() * len];
        let mut pivots = vec![1.0; len];
        let floor: Vec<f64> = self
            .sizes(q, info.dependent, len)
            .iter()
            .map(|size| {
                (1.0 + size)
                    * if moves.is_some() {
                        CONVERGED_STEP
                    } else {
                        ROUGH_STEP
                    }
            })
            .collect();
        let mut moved = vec![0.0; len];
        let mut before = vec![f64::INFINITY; len];
        let mut done: Vec<bool> = ok.iter().map(|ok| !ok).collect();
        for _ in 0..MAX_STEPS {
            let arguments = Arguments {
                q,
                ..Arguments::EMPTY
            };
            eval_many(
                self.model,
                Function::NewtonStep,
                len,
                arguments,
                &mut step,
                &mut pivots,
            )?;
            let sizes = self.step_sizes(&step, len);
            for (state, size) in sizes.into_iter().enumerate() {
                if done[state] {
                    continue;
                }
                moved[state] += size;
                let refused = moves.is_some_and(|moves| {
                    moved[state] > MAX_CORRECTION_RATIO * moves[state] + floor[state]
                        || size > 0.5 * before[state]
                });
                if refused || !size.is_finite() {
                    (ok[state], done[state]) = (false, true);
                    continue;
                }
                for (k, c) in info.dependent.iter().enumerate() {
                    q[c * len + state] += step[k * len + state];
                }
                before[state] = size;
                done[state] = size <= floor[state];
            }
            if done.iter().all(|done| *done) {
                return Ok(());
            }
        }
        for (ok, done) in ok.iter_mut().zip(&done) {
            *ok &= done;
        }
        Ok(())
    }

    /// Checks that the residuals are within the tolerance, and A near that of the reference. After
    /// the last Newton step the residuals are rounding errors: a state where they are larger is left
    /// to [`LoopClosure`].
    fn check_closed(
        &self,
        reference: &Reference,
        q: &[f64],
        ok: &mut [bool],
        len: usize,
    ) -> Result<(), ClosureError> {
        let info = self.model.info();
        let residuals = self.residuals(q, len)?;
        let mut a = vec![0.0; info.rows * q.len()];
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval(Function::Jacobian, arguments, &mut a, ok)?;
        let tolerances = self.tolerances(&a, q, len);
        let near = reference.is_near(&a, len);
        for (state, ok) in ok.iter_mut().enumerate() {
            *ok &= residuals[state] <= tolerances[state] && near[state];
        }
        Ok(())
    }

    /// The largest |f| of each state, in units of the rows; NaN if any entry is.
    fn residuals(&self, q: &[f64], len: usize) -> Result<Vec<f64>, ClosureError> {
        let mut f = vec![0.0; self.row_units.len() * len];
        let mut pivots = vec![1.0; len];
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        eval_many(
            self.model,
            Function::Constraints,
            len,
            arguments,
            &mut f,
            &mut pivots,
        )?;
        let mut out = vec![0.0; len];
        for (series, unit) in f.chunks_exact(len).zip(&self.row_units) {
            for (out, f) in out.iter_mut().zip(series) {
                *out = largest(*out, (f / unit).abs());
            }
        }
        Ok(out)
    }

    /// The largest residual of each state that counts as closed: the size of the terms of the
    /// largest row, `|A| max(1, |q|)`, times a constant.
    fn tolerances(&self, a: &[f64], q: &[f64], len: usize) -> Vec<f64> {
        let mut out = vec![0.0; len];
        for (row, row_unit) in a.chunks_exact(q.len().max(1)).zip(&self.row_units) {
            let mut sums = vec![0.0; len];
            let entries = row.chunks_exact(len).zip(q.chunks_exact(len));
            for ((entries, q), unit) in entries.zip(&self.units) {
                for (sum, (a, q)) in sums.iter_mut().zip(entries.iter().zip(q)) {
                    *sum += (a * unit / row_unit).abs() * (q / unit).abs().max(1.0);
                }
            }
            for (out, sum) in out.iter_mut().zip(&sums) {
                *out = largest(*out, RELATIVE_TOLERANCE * sum);
            }
        }
        out
    }

    /// The largest of these coordinates of each state, in units.
    fn sizes(&self, q: &[f64], which: &[usize], len: usize) -> Vec<f64> {
        let mut out = vec![0.0; len];
        for c in which {
            for (out, q) in out.iter_mut().zip(&q[c * len..(c + 1) * len]) {
                *out = largest(*out, (q / self.units[*c]).abs());
            }
        }
        out
    }

    /// The largest entry of each state's Newton step, in units.
    fn step_sizes(&self, step: &[f64], len: usize) -> Vec<f64> {
        let mut out = vec![0.0; len];
        let dependent = self.model.info().dependent.iter();
        for (series, c) in step.chunks_exact(len).zip(dependent) {
            for (out, step) in out.iter_mut().zip(series) {
                *out = largest(*out, (step / self.units[*c]).abs());
            }
        }
        out
    }
}

/// Copies the first `accepted` states of a block.
fn copy(from: &[f64], len: usize, to: &mut [f64], count: usize, first: usize, accepted: usize) {
    for (from, to) in from.chunks_exact(len).zip(to.chunks_exact_mut(count)) {
        if let (Some(from), Some(to)) = (from.get(..accepted), to.get_mut(first..first + accepted))
        {
            to.copy_from_slice(from);
        }
    }
}

/// Series of one value each.
fn repeated(values: &[f64], len: usize) -> Vec<f64> {
    values
        .iter()
        .flat_map(|x| core::iter::repeat_n(*x, len))
        .collect()
}

/// The series, each one state later; `first` are the values at the first one.
fn shifted(first: &[f64], series: &[f64], len: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(series.len());
    for (first, series) in first.iter().zip(series.chunks_exact(len)) {
        out.push(*first);
        out.extend_from_slice(&series[..len - 1]);
    }
    out
}

/// Replaces the series of these coordinates.
fn set(q: &mut [f64], which: &[usize], values: &[f64], len: usize) {
    for (c, values) in which.iter().zip(values.chunks_exact(len)) {
        q[c * len..(c + 1) * len].copy_from_slice(values);
    }
}

/// The targets minus the values of these coordinates.
fn difference(targets: &[f64], q: &[f64], which: &[usize], len: usize) -> Vec<f64> {
    let own = which.iter().flat_map(|c| &q[c * len..(c + 1) * len]);
    targets
        .iter()
        .zip(own)
        .map(|(to, from)| to - from)
        .collect()
}
