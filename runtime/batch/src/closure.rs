//! Loop closure of many states along a trajectory, blocks of them at a time.

mod block;
mod series;

use regen_runtime::{Arguments, ClosureError, Function, LoopClosure, Model, Outcome, SizeError};

use series::{copy, difference, repeated, set, shifted};

/// The largest number of states that are solved at a time.
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
/// The most continuation steps to a state after the first, where steps are counted: they reach 125 rad.
const LATER_STEPS: usize = 500;
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
    /// The continuation steps that states may still take; `None` without a limit.
    allowance: Option<usize>,
    /// How many of the steps that `closure` took are no longer in the allowance.
    charged: usize,
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

/// Checks the lengths of positions, velocities and accelerations of `dof` coordinates at `count`
/// states, and that they are finite.
fn check_series(dof: usize, count: usize, parts: [&[f64]; 3]) -> Result<(), ClosureError> {
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
    Ok(())
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
            allowance: None,
            charged: 0,
            units,
            row_units,
        })
    }

    /// Adds to the continuation steps that all states together may take; without a call there is no
    /// limit. The first state, which may be far from home, may take half of them, and each later one half
    /// of what is left and at most 500 steps, so that something remains for the others, and at least one,
    /// which is enough where it is near the state before. A block of states that are near each other takes
    /// none.
    pub fn allow_steps(&mut self, steps: usize) {
        self.allowance = Some(self.allowance.unwrap_or(0).saturating_add(steps));
    }

    /// The number of continuation steps of all states so far.
    pub fn steps_taken(&self) -> usize {
        self.closure.steps_taken()
    }

    /// The number of states so far that were given up because they would have taken more steps than
    /// they may.
    pub fn given_up(&self) -> usize {
        self.closure.given_up()
    }

    /// Takes the steps since the last call off the allowance, and limits the next state to its part
    /// of the rest.
    fn limit_next(&mut self) {
        let taken = self.closure.steps_taken();
        if let Some(left) = &mut self.allowance {
            *left = left.saturating_sub(taken - self.charged);
            let most = if taken == 0 { *left } else { LATER_STEPS };
            self.closure.limit_steps(most.min(*left / 2).max(1));
        }
        self.charged = taken;
    }

    /// Starts the next trajectory from home.
    pub fn restart(&mut self) {
        self.closure.restart();
        (self.last, self.behind) = (None, false);
    }

    /// The state from which the next trajectory continues; `None` for home.
    pub fn last_state(&self) -> Option<Vec<f64>> {
        self.last.clone()
    }

    /// Makes the next trajectory continue from a state that [`last_state`](Self::last_state)
    /// returned.
    pub fn resume(&mut self, state: Option<&[f64]>) {
        match state {
            None => self.restart(),
            Some(q) => {
                self.last = Some(q.to_vec());
                self.behind = true;
            }
        }
    }

    /// The closure of single states, at the last state of the trajectory; the next trajectory
    /// continues from the last state that it solves.
    ///
    /// # Errors
    /// When the model is inconsistent.
    pub fn single(&mut self) -> Result<&mut LoopClosure<'m, M>, ClosureError> {
        self.catch_up()?;
        self.limit_next();
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

    /// Closes the loops along a trajectory that continues where the last one ended, or from home.
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
        check_series(dof, count, parts)?;
        let mut states = TrackedStates {
            q: vec![f64::NAN; n * count],
            qd: vec![f64::NAN; n * count],
            qdd: vec![f64::NAN; n * count],
            outcomes: Vec::with_capacity(count),
        };
        let trajectory = Trajectory { count, parts };
        // how many states are solved one by one after a block of which none was accepted
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

    /// Closes the loops at states each of which is near a closed state of another trajectory, from
    /// that state: by a predictor along the tangent and steps that halve and are short compared to
    /// it. `None` where a state breaks this rule or is near a singularity.
    ///
    /// This takes less time than [`track`](Self::track), but does not check whether the
    /// states are on the same branch as each other: an optimiser that varies a trajectory uses it,
    /// and follows the result by `track`.
    ///
    /// - `from`: the states of the other trajectory, as many; other arguments as for `track`.
    ///
    /// # Errors
    /// When an argument has a wrong length or an entry that is not finite.
    ///
    /// ```
    /// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/slider_crank.rs")); }
    /// # use models::SliderCrank;
    /// use regen_batch::TrajectoryClosure;
    ///
    /// // crank 1 m, rod 2 m: half a turn, then the same motion 0.1 rad ahead
    /// let model = SliderCrank::default();
    /// let mut closure = TrajectoryClosure::new(&model)?;
    /// let crank = |ahead: f64| (0..51).map(|k| 0.06 * f64::from(k) + ahead).collect::<Vec<f64>>();
    /// let (qd, qdd) = ([1.0; 51], [0.5; 51]);
    /// let from = closure.track(51, &crank(0.0), &qd, &qdd)?;
    /// let moved = closure.moved(&from, &crank(0.1), &qd, &qdd)?.expect("all are near");
    /// closure.restart();
    /// let tracked = closure.track(51, &crank(0.1), &qd, &qdd)?;
    /// for (moved, tracked) in [(&moved.q, &tracked.q), (&moved.qdd, &tracked.qdd)] {
    ///     assert!(moved.iter().zip(tracked).all(|(a, b)| (a - b).abs() < 1e-12));
    /// }
    /// assert!(closure.moved(&from, &crank(1.5), &qd, &qdd)?.is_none());
    /// # Ok::<(), regen_runtime::ClosureError>(())
    /// ```
    pub fn moved(
        &self,
        from: &TrackedStates,
        q_i: &[f64],
        qd_i: &[f64],
        qdd_i: &[f64],
    ) -> Result<Option<TrackedStates>, ClosureError> {
        let (info, len) = (self.model.info(), from.len());
        check_series(info.dof(), len, [q_i, qd_i, qdd_i])?;
        if len == 0 || from.q.len() != info.coordinates.len() * len {
            return Ok(None);
        }
        let mut ok = vec![true; len];
        let line = difference(q_i, &from.q, info.independent, len);
        let (mut q, moves) = self.predicted(&from.q, &line, q_i, len)?;
        for (ok, moved) in ok.iter_mut().zip(&moves) {
            *ok &= *moved <= MAX_PREDICTOR_MOVE;
        }
        if !info.dependent.is_empty() && ok.iter().all(|ok| *ok) {
            self.newton(&mut q, &mut ok, Some(&moves), len)?;
        }
        if !ok.iter().all(|ok| *ok) {
            return Ok(None);
        }
        let (qd, qdd) = self.rates(&q, qd_i, qdd_i, &mut ok)?;
        let outcomes = vec![Outcome::Closed; len];
        let states = TrackedStates {
            q,
            qd,
            qdd,
            outcomes,
        };
        Ok(ok.iter().all(|ok| *ok).then_some(states))
    }

    /// The velocities and accelerations of closed states; states with a small pivot are no longer
    /// `ok`.
    fn rates(
        &self,
        q: &[f64],
        qd_i: &[f64],
        qdd_i: &[f64],
        ok: &mut [bool],
    ) -> Result<(Vec<f64>, Vec<f64>), ClosureError> {
        let (mut qd, mut qdd) = (vec![0.0; q.len()], vec![0.0; q.len()]);
        let arguments = Arguments {
            q,
            qd_i,
            ..Arguments::EMPTY
        };
        self.eval(Function::Velocities, arguments, &mut qd, ok)?;
        let arguments = Arguments {
            q,
            qd: &qd,
            qdd_i,
            ..Arguments::EMPTY
        };
        self.eval(Function::Accelerations, arguments, &mut qdd, ok)?;
        Ok((qd, qdd))
    }

    /// Solves one state by [`LoopClosure`].
    fn one(
        &mut self,
        trajectory: &Trajectory<'_>,
        state: usize,
        states: &mut TrackedStates,
    ) -> Result<(), ClosureError> {
        self.catch_up()?;
        self.limit_next();
        let [q_i, qd_i, qdd_i] = [0, 1, 2].map(|part| trajectory.at(part, state));
        let solved = self.closure.track_state(&q_i, &qd_i, &qdd_i)?;
        if solved.outcome.is_closed() {
            let count = trajectory.count;
            for (series, values) in [
                (&mut states.q, &solved.q),
                (&mut states.qd, &solved.qd),
                (&mut states.qdd, &solved.qdd),
            ] {
                for (slot, value) in series.iter_mut().skip(state).step_by(count).zip(values) {
                    *slot = *value;
                }
            }
            self.last = Some(solved.q);
        }
        states.outcomes.push(solved.outcome);
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
            let mut rough = self.predicted_from(last, &line, &targets, len)?;
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
        let (qd, qdd) = self.rates(&q, &qd_i, &qdd_i, &mut ok)?;
        let accepted = ok.iter().take_while(|ok| **ok).count();
        Ok(Some(Block {
            len,
            q,
            qd,
            qdd,
            accepted,
        }))
    }
}
