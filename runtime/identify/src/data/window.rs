//! Computes states of motion from the rows of a log, one window of rows after another.

use super::fewer_states::FewerStates;
use super::held::{held_part, held_residuals};
use super::logs::{Log, reach, signal};
use super::motion;
use super::policy::Policy;
use super::problem::{DataError, Fault, Problem, Problems};
use super::reader::LogRow;
use super::settings::Settings;
use super::shift;
use super::standstill::{Encoder, resting};
use super::stretch::{Stretch, spread};
use super::unmeasured::Unmeasured;
use crate::estimate::EstimateError;
use crate::signals::{Method, SignalError, Smoothing};
use crate::states::{Completeness, Completion, StateSample, depends_on_direction};
use crate::turned::turn;
use regen_batch::eval_many;
use regen_runtime::{Arguments, Condition, Function, Model, Outcome, Status};

/// The number of rows that are differentiated at a time, not counting those that filters need on both
/// sides.
const WINDOW_ROWS: usize = 8192;
/// The number of rows whose states are computed at a time.
const STATES: usize = 512;
/// How far the error of an interpolated gap may matter on either side of it, in times that the
/// differentiation reaches to one side: two rise times of the filter, behind which the error of the
/// acceleration has decayed to the noise, also for the longest gaps.
const BRIDGE_REACHES: f64 = 2.0;

/// The current window of rows of one file, and what is needed to compute states from it.
pub(super) struct Window<'a, 'm, M: ?Sized> {
    pub(super) log: &'a Log,
    pub(super) settings: &'a Settings,
    pub(super) completion: Completion<'m, M>,
    pub(super) model: &'m M,
    /// Which states are computed, if not all.
    pub(super) fewer: Option<FewerStates>,
    /// Rows on either side of a row that its state depends on.
    pub(super) support: usize,
    /// The speed of each measured coordinate below which noise may turn its sign, rad/s or m/s.
    pub(super) sign_thresholds: Vec<f64>,
    /// The coordinates that follow measured ones by constant factors.
    pub(super) unmeasured: Vec<Unmeasured>,
    /// The equations in which an effort acts that is not measured.
    pub(super) left_out: Vec<bool>,
    /// The delay of each actuated joint's effort, s.
    pub(super) delays: Vec<f64>,
    pub(super) rows: Stretch,
    pub(super) weights: Vec<Option<Vec<f64>>>,
    /// Number of rows at the start that only the filter needs; 0 at the start of a segment.
    pub(super) before: usize,
    /// Number of valid rows of the segment so far, for decimation.
    pub(super) count: usize,
    /// Whether the next state follows the last one without a gap.
    pub(super) follows: bool,
    pub(super) states: usize,
    /// The sum of the squared accelerations of each measured coordinate, over `rows_moved` rows.
    pub(super) accelerations: Vec<f64>,
    pub(super) rows_moved: usize,
    pub(super) problems: &'a mut Problems,
    /// Receives each state.
    pub(super) each: &'a mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
}

impl<M: Model<f64> + ?Sized> Window<'_, '_, M> {
    /// Adds the next row; `follows` says whether it comes after the last one without a gap.
    pub(super) fn take(
        &mut self,
        row: &LogRow,
        weights: Option<Vec<f64>>,
        follows: bool,
    ) -> Result<(), DataError> {
        if !follows && !self.bridged(row) {
            self.process(true)?;
        }
        self.rows.push(row);
        self.weights.push(weights);
        if self.rows.len() >= self.before + WINDOW_ROWS + self.support {
            self.process(false)?;
        }
        Ok(())
    }

    /// Computes the states of the rows that remain.
    pub(super) fn finish(&mut self) -> Result<(), DataError> {
        self.process(true)
    }

    /// Whether rows on both sides of a gap are differentiated together: only a local regression
    /// does so, over gaps shorter than half its half width.
    fn bridged(&self, row: &LogRow) -> bool {
        let Some(last) = self.rows.times().last() else {
            return true;
        };
        match self.settings.method {
            _ if self.log.file.layout.derivatives || self.log.series.is_some() => false,
            Method::Local { half_width } => row.values[0] - last < 0.5 * half_width,
            _ => false,
        }
    }

    /// The time before and after a reversal of a coordinate, s, within which its derivatives mix
    /// both directions: as far as the differentiation reaches to either side of a sample, and at
    /// least one step, as the reversal itself lies between samples.
    fn reach(&self, encoder: Encoder) -> f64 {
        let step = self.log.survey.time_step();
        reach(self.log, self.settings.method.of_states(step), encoder)
    }

    /// For each row, whether its state depends on values that are interpolated across a gap.
    fn near_bridged(&self) -> Vec<bool> {
        if !self.rows.bridged().contains(&true) {
            return vec![false; self.rows.len()];
        }
        let late = self.log.late().chain(self.delays.iter().copied());
        let longest = late.fold(0.0, |m: f64, d| m.max(d.abs()));
        let reach = BRIDGE_REACHES * self.reach(Encoder::default()) + longest;
        #[allow(clippy::cast_sign_loss, reason = "neither is negative")]
        let rows = (reach / self.log.survey.time_step()).ceil() as usize;
        self.rows.near_bridged(rows.min(self.support))
    }

    /// For each effort the rows whose equations it makes unknown, as its value there or near by is not used; empty
    /// where it is known at all rows.
    fn near_unknown(&self) -> Vec<Vec<bool>> {
        let step = self.log.survey.time_step();
        // an effort that is moved in time, or filtered, is a sum of those of rows around
        let filtered = self.fewer.as_ref().map_or(0, |own| 2 * own.every);
        #[allow(clippy::cast_sign_loss, reason = "neither is negative")]
        let moved = |delay: &f64| (delay.abs() / step).ceil() as usize;
        let late = self.log.late().skip(self.log.file.layout.efforts().start);
        let late = self.delays.iter().zip(late);
        let reaches = late.map(|(own, late)| filtered + moved(own) + moved(&late));
        reaches
            .enumerate()
            .map(|(effort, reach)| self.rows.near_unknown(effort, reach))
            .collect()
    }

    /// Computes the states of all rows that have enough neighbours, or, at the `end` of a segment, of
    /// all rows that remain.
    fn process(&mut self, end: bool) -> Result<(), DataError> {
        let n = self.rows.len();
        let layout = &self.log.file.layout;
        let m = layout.measured.len();
        let mut valid = self.before..if end { n } else { n - self.support };
        let on_time = self.rows.on_time(self.log.late());
        let rows = on_time.as_ref().map_or(&self.rows, |own| &own.0);
        let known = on_time.as_ref().map_or(0..n, |own| own.1.clone());
        let times = rows.times();
        // for each measured coordinate: position, velocity, acceleration
        let mut motion: Vec<[Vec<f64>; 3]> = Vec::with_capacity(m);
        let efforts = layout.efforts();
        let mut efforts: Vec<Vec<f64>> = efforts.map(|entry| rows.column(entry).to_vec()).collect();
        let file = &self.log.file;
        if n > 0 {
            let method = self.settings.method.of_states(self.log.survey.time_step());
            let derivatives = match &self.fewer {
                None => motion::all_derivatives(self.log, method, rows),
                Some(fewer) => (rows.passed(&fewer.filter))
                    .and_then(|rows| motion::all_derivatives(self.log, method, &rows)),
            };
            match derivatives {
                Ok(of_all) => {
                    for mut found in of_all {
                        found.valid = shift::within(&found.valid, &known, n);
                        // within a segment the support already bounds the valid rows
                        let start = if self.before > 0 {
                            0
                        } else {
                            found.valid.start
                        };
                        let stop = if end { found.valid.end } else { n };
                        valid = valid.start.max(start)..valid.end.min(stop);
                        motion.push([found.value, found.rate, found.acceleration]);
                    }
                }
                // a segment between two faults may be too short, a whole log may not
                Err(SignalError::TooFew { .. })
                    if self.log.divided || self.settings.policy != Policy::Fail =>
                {
                    valid = 0..0;
                }
                Err(why) => return Err(signal(file, why)),
            }
        }
        for (effort, delay) in efforts.iter_mut().zip(&self.delays) {
            if *delay != 0.0 && !valid.is_empty() {
                let inside = shift::later(times, effort, *delay);
                // within a segment the support already bounds the valid rows
                let start = if self.before > 0 { 0 } else { inside.start };
                let stop = if end { inside.end } else { n };
                valid = valid.start.max(start)..valid.end.min(stop);
            }
        }
        for (sum, [_, _, own]) in self.accelerations.iter_mut().zip(&motion) {
            let own = own.get(valid.clone()).unwrap_or_default();
            *sum += own.iter().map(|a| a * a).sum::<f64>();
        }
        self.rows_moved += valid.len();
        let mut still: Vec<Vec<bool>> = Vec::with_capacity(m);
        let entries = layout.positions().zip(&self.log.encoders);
        for ((entry, encoder), [_, rate, acceleration]) in entries.zip(&mut motion) {
            let positions = rows.column(entry);
            // a joint that creeps has a velocity, but not the friction of sliding
            // A filter gives a position that does not change no velocity by itself, and so does a series; beside
            // such a rest its output is that of the motion that begins, and zeros there would bias the inertia.
            if self.settings.method.smoothing().is_none() && self.log.series.is_none() {
                let unmoved = resting(times, positions, encoder.without_creep());
                for (k, unmoved) in unmoved.into_iter().enumerate() {
                    if unmoved {
                        (rate[k], acceleration[k]) = (0.0, 0.0);
                    }
                }
            }
            let mut rests = resting(times, positions, *encoder);
            if self.settings.poses {
                // what friction there is at rest was averaged out
                rests.fill(false);
                still.push(rests);
                continue;
            }
            let slowest = self
                .sign_thresholds
                .get(still.len())
                .copied()
                .unwrap_or(0.0);
            let reach = self.reach(*encoder);
            for ((rests, rate), acceleration) in rests.iter_mut().zip(rate).zip(acceleration) {
                // near a reversal the derivatives mix samples of both directions
                *rests |= rate.abs() < slowest.max(acceleration.abs() * reach);
            }
            still.push(rests);
        }
        let mut held = self.held(&efforts, &still);
        let bridged = self.near_bridged();
        let unknown = self.near_unknown();
        // if the equations are filtered, they are decimated after the filter instead
        let every = match (&self.fewer, self.settings.method.smoothing()) {
            (Some(fewer), _) => fewer.every,
            (None, Smoothing::None) => self.settings.decimation.max(1),
            _ => 1,
        };
        if let Some(fewer) = &self.fewer {
            let settling = fewer.filter.settling();
            let all = shift::within(&(settling..n.saturating_sub(settling)), &known, n);
            let start = if self.before > 0 { 0 } else { all.start };
            let stop = if end { all.end } else { n };
            valid = valid.start.max(start)..valid.end.min(stop);
            for own in efforts.iter_mut().chain(&mut held) {
                match fewer.filter.zero_phase(own) {
                    Ok(passed) => *own = passed,
                    // too few rows for the filter have no state
                    Err(_) => valid = 0..0,
                }
            }
            for rests in &mut still {
                *rests = spread(rests, fewer.every / 2);
            }
        }
        let mut used = Vec::with_capacity(valid.len() / every + 1);
        for k in valid {
            if self.count.is_multiple_of(every) {
                used.push(k);
            }
            self.count += 1;
        }
        for samples in used.chunks(STATES) {
            self.emit(
                samples,
                &motion,
                (&efforts, &held),
                (&still, &bridged, &unknown),
            )?;
        }
        if end {
            self.rows.clear();
            self.weights.clear();
            self.before = 0;
            self.count = 0;
            self.follows = false;
        } else {
            let keep = (2 * self.support).min(n);
            self.rows.keep_last(keep);
            self.weights.drain(..n - keep);
            self.before = keep - self.support.min(keep);
        }
        Ok(())
    }

    /// The residuals of the efforts at all rows if the controller holds them, see [`held_residuals`]; none
    /// where all accelerations are measured.
    ///
    /// - `still`: for each measured coordinate, the rows at which it rests.
    fn held(&self, efforts: &[Vec<f64>], still: &[Vec<bool>]) -> Vec<Vec<f64>> {
        let layout = &self.log.file.layout;
        let part = held_part(layout, self.log.series.is_some());
        if part == 0.0 {
            return Vec::new();
        }
        let scale = part * self.log.survey.raw_step.powi(2);
        let times = self.rows.times();
        let mut all: Vec<Vec<f64>> = efforts
            .iter()
            .map(|effort| held_residuals(times, effort, scale))
            .collect();
        if self.settings.method.smoothing().is_none() {
            // an effort jumps by twice the friction where its joint turns, and no filter removes that
            let info = self.model.info();
            for (joint, own) in info.actuated.iter().zip(&mut all) {
                if !info.joints.get(*joint).is_some_and(depends_on_direction) {
                    continue;
                }
                let place = layout.measured.iter().position(|c| c == joint);
                let rests = |k: usize| match place.and_then(|place| still.get(place)) {
                    Some(rests) => rests.get(k).copied().unwrap_or(true),
                    None => still.iter().any(|rests| rests.get(k) == Some(&true)),
                };
                for (k, x) in own.iter_mut().enumerate() {
                    if (k.saturating_sub(1)..=k + 1).any(rests) {
                        *x = 0.0;
                    }
                }
            }
        }
        all
    }

    /// Computes the states of these rows and passes them on.
    fn emit(
        &mut self,
        samples: &[usize],
        motion: &[[Vec<f64>; 3]],
        (efforts, held): (&[Vec<f64>], &[Vec<f64>]),
        (still, bridged, unknown): (&[Vec<bool>], &[bool], &[Vec<bool>]),
    ) -> Result<(), DataError> {
        let before = self.completion.given_up();
        let states = self.completion.complete_many(motion, samples)?;
        let given_up = self.completion.given_up() > before;
        let reversals: Vec<(usize, f64, f64)> = self
            .unmeasured
            .iter()
            .map(|own| {
                let reach = self.log.encoders.iter().map(|encoder| self.reach(*encoder));
                let slowest = own.combined(&self.sign_thresholds);
                (own.coordinate, slowest, own.largest(reach))
            })
            .collect();
        let info = self.model.info();
        let (n, dof, count) = (info.coordinates.len(), info.dof(), samples.len());
        // ordered entry by entry, as functions at many states require
        let mut q = vec![0.0; n * count];
        turn(&states.q, n, &mut q, count);
        let measured = efforts.iter();
        let measured: Vec<f64> = measured
            .flat_map(|effort| samples.iter().map(|k| effort[*k]))
            .collect();
        let (tau, pivots) = self.forces(&measured, &q, count)?;
        self.leave_out(&q, count)?;
        // the rows at which efforts are not known, with the equations in which they act
        let mut doubtful = Vec::new();
        for (effort, rows) in unknown.iter().enumerate() {
            if samples.iter().any(|k| rows.get(*k) == Some(&true)) {
                doubtful.push((rows, self.equations_of(effort, &q, count)?));
            }
        }
        // the weight of an effort applies to the equation of the same coordinate
        let place = |c: &usize| info.actuated.iter().position(|a| a == c);
        let places: Vec<Option<usize>> = info.independent.iter().map(place).collect();
        let mut own = vec![0.0; efforts.len()];
        let mut own_held = vec![0.0; held.len()];
        let mut forces = vec![0.0; dof];
        let mut weights = vec![1.0; dof];
        let mut rests = vec![false; n];
        for (at, k) in samples.iter().copied().enumerate() {
            match states.outcomes[at] {
                Completeness::Closed => {}
                Completeness::Open(outcome) => {
                    self.skip(k, &outcome, given_up);
                    continue;
                }
                Completeness::Unmeasured => {
                    return Err(DataError::ColumnLayout {
                        file: self.log.file.name.clone(),
                        why: "the measured coordinates do not determine the robot's state: log \
                              the actuated ones"
                            .to_owned(),
                    });
                }
            }
            let condition = Condition { pivot: pivots[at] };
            if condition.status() == Status::Singular {
                self.skip(k, &Outcome::Singular { at: 1.0, condition }, false);
                continue;
            }
            for (slot, effort) in own.iter_mut().zip(efforts) {
                *slot = effort[k];
            }
            for (slot, held) in own_held.iter_mut().zip(held) {
                *slot = held[k];
            }
            for (slot, series) in forces.iter_mut().zip(tau.chunks_exact(count)) {
                *slot = series[at];
            }
            let given = self.weights[k].as_ref();
            let equations = places.iter().zip(&self.left_out);
            for (weight, (place, left_out)) in weights.iter_mut().zip(equations) {
                let own = given.zip(*place).and_then(|(w, p)| w.get(p).copied());
                *weight = if *left_out { 0.0 } else { own.unwrap_or(1.0) };
            }
            for (_, equations) in doubtful.iter().filter(|(rows, _)| rows[k]) {
                let own = weights.iter_mut().zip(equations);
                own.filter(|(_, acts)| **acts).for_each(|(w, _)| *w = 0.0);
            }
            // a coordinate that is not measured rests when all measured ones do
            rests.fill(still.iter().all(|rests| rests[k]));
            for (c, own) in self.log.file.layout.measured.iter().zip(still) {
                rests[*c] = own[k];
            }
            let [q, qd, qdd] = states.state(at);
            for (c, slowest, reach) in &reversals {
                rests[*c] |= qd[*c].abs() < slowest.max(qdd[*c].abs() * reach);
            }
            let row = StateSample {
                time: self.rows.times()[k],
                q,
                qd,
                qdd,
                tau: &forces,
                efforts: &own,
                held: &own_held,
                at_standstill: &rests,
                weights: &weights,
                follows: self.follows,
                bridged: bridged.get(k).copied().unwrap_or(false),
            };
            (self.each)(&row)?;
            self.follows = true;
            self.states += self.fewer.as_ref().map_or(1, |own| own.every);
        }
        Ok(())
    }

    /// The generalized forces of efforts at some states, and the pivots of their conditions.
    ///
    /// - `efforts`, `q`: one series for each effort and coordinate, and so is the result for each equation.
    fn forces(
        &self,
        efforts: &[f64],
        q: &[f64],
        count: usize,
    ) -> Result<(Vec<f64>, Vec<f64>), DataError> {
        let mut tau = vec![0.0; self.model.info().dof() * count];
        let mut pivots = vec![1.0; count];
        let arguments = Arguments {
            q,
            tau_actuated: efforts,
            ..Arguments::EMPTY
        };
        let function = Function::GeneralizedForces;
        eval_many(
            self.model,
            function,
            count,
            arguments,
            &mut tau,
            &mut pivots,
        )?;
        Ok((tau, pivots))
    }

    /// Whether an effort acts in each equation at some of these states.
    ///
    /// - `q`: their coordinates, one series for each.
    fn equations_of(&self, effort: usize, q: &[f64], count: usize) -> Result<Vec<bool>, DataError> {
        let info = self.model.info();
        let mut unit = vec![0.0; info.actuated.len() * count];
        let own = unit.iter_mut().skip(effort * count).take(count);
        own.for_each(|x| *x = 1.0);
        let (tau, _) = self.forces(&unit, q, count)?;
        // where the loops do not close there are no numbers
        let acts = |series: &[f64]| series.iter().any(|t| t.is_finite() && *t != 0.0);
        Ok(tau.chunks_exact(count.max(1)).map(acts).collect())
    }

    /// Finds the equations in which an effort acts that is not measured, at these states.
    ///
    /// - `q`: their coordinates, one series for each.
    fn leave_out(&mut self, q: &[f64], count: usize) -> Result<(), DataError> {
        let layout = &self.log.file.layout;
        let info = self.model.info();
        for effort in &layout.unmeasured {
            let acts = self.equations_of(*effort, q, count)?;
            for (left_out, acts) in self.left_out.iter_mut().zip(acts) {
                *left_out |= acts;
            }
        }
        if !self.left_out.contains(&false) && !layout.unmeasured.is_empty() {
            let name = |k: &usize| {
                let own = info.actuated.get(*k).and_then(|c| info.coordinates.get(*c));
                format!("tau_{}", own.copied().unwrap_or_default())
            };
            let names: Vec<String> = layout.unmeasured.iter().map(name).collect();
            return Err(DataError::ColumnLayout {
                file: self.log.file.name.clone(),
                why: format!(
                    "every equation contains an effort that is not measured ({}): measure it, or \
                     choose independent coordinates in the spec on which it does not act",
                    names.join(", ")
                ),
            });
        }
        Ok(())
    }

    /// - `given_up`: whether the search for a state of the same samples was ended early.
    fn skip(&mut self, k: usize, outcome: &Outcome, given_up: bool) {
        self.follows = false;
        let why = match outcome {
            Outcome::NotClosed { at, .. } if given_up && *at < 1.0 => {
                "the loops were not followed so far, as too many rows took long searches that failed: \
                 positions contradict each other or jump"
            }
            Outcome::NotClosed { .. } => "the loops cannot be closed there",
            Outcome::Singular { .. } => "the robot is singular there",
            _ => "the assembly branch is lost there",
        };
        let why = why.to_owned();
        self.problems
            .add(Problem::of(self.rows.line(k), Fault::Open { why }));
    }
}

#[cfg(test)]
mod tests {
    use crate::data::stretch::spread;

    #[test]
    fn a_rest_is_that_of_the_rows_around_it() {
        let rests = [false, false, false, true, false, false];
        assert_eq!(spread(&rests, 1), [false, false, true, true, true, false]);
        assert_eq!(spread(&rests, 0), rests);
    }
}
