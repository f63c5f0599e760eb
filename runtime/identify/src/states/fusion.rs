//! Fuses more measured coordinates than needed to states of motion, blocks of samples at a time.

use super::completion::{CompletedStates, Completeness, Completion, MAX_STEPS, STEP_TOLERANCE};
use regen_batch::{TrackedStates, eval_many};
use regen_runtime::{Arguments, ClosureError, Function, Model, Outcome, SizeError};

/// The series of the measured coordinates at the samples of a block, divided into positions,
/// velocities and accelerations; those of coordinate m from `m * count` on.
struct Measured {
    count: usize,
    parts: [Vec<f64>; 3],
}

impl Measured {
    /// The values of all measured coordinates at one sample.
    fn at(&self, part: usize, sample: usize) -> Vec<f64> {
        let values = self.parts[part].iter().skip(sample);
        values.step_by(self.count).copied().collect()
    }
}

/// How all coordinates move with the independent ones, at the states of a block.
struct Columns {
    /// For each independent coordinate, the velocities of all at its unit velocity, one series for
    /// each.
    rates: Vec<Vec<f64>>,
    /// For each state, the weighted Jacobian of the measured coordinates, column-major.
    weighted: Vec<Vec<f64>>,
}

impl<M: Model<f64> + ?Sized> Completion<'_, M> {
    /// The states of consecutive samples, as single ones are fused; `None` where an independent
    /// coordinate is not measured, so that nothing says where to begin.
    ///
    /// The iterations of all samples begin at the measured independent coordinates and run side by
    /// side; a sample that has converged is not changed any more. One that cannot be closed waits at the
    /// closed one before it, so that it is not searched for in each iteration.
    pub(super) fn fuse_many(
        &mut self,
        motion: &[[Vec<f64>; 3]],
        samples: &[usize],
    ) -> Result<Option<CompletedStates>, ClosureError> {
        let info = self.model.info();
        let place = |c: &usize| self.measured.iter().position(|m| m == c);
        let places: Option<Vec<usize>> = info.independent.iter().map(place).collect();
        let Some(places) = places.filter(|_| !samples.is_empty()) else {
            return Ok(None);
        };
        let count = samples.len();
        let series = |part: usize| -> Vec<f64> {
            let value = |m: &[Vec<f64>; 3], k: &usize| m[part].get(*k).copied().unwrap_or(f64::NAN);
            let own = motion
                .iter()
                .flat_map(|m| samples.iter().map(move |k| value(m, k)));
            own.collect()
        };
        let measured = Measured {
            count,
            parts: [series(0), series(1), series(2)],
        };
        for (argument, values) in ["q", "qd", "qdd"].into_iter().zip(&measured.parts) {
            if values.len() != count * self.measured.len() {
                return Err(ClosureError::Size(SizeError {
                    argument,
                    expected: count * self.measured.len(),
                    got: values.len(),
                }));
            }
        }
        let begin = self.closure.last_state();
        let dof = places.len();
        let entries = places
            .iter()
            .flat_map(|p| &measured.parts[0][p * count..(p + 1) * count]);
        let mut q_i: Vec<f64> = entries.copied().collect();
        let mut found = vec![Completeness::Closed; count];
        let mut done = vec![false; count];
        let mut states = self.closed(begin.as_deref(), &q_i)?;
        let mut columns = self.columns_at(&states)?;
        for _ in 0..MAX_STEPS {
            let mut steps = vec![0.0; q_i.len()];
            // the independent coordinates of the closed state before the sample
            let mut waiting = match &begin {
                Some(q) => info.independent.iter().map(|c| q[*c]).collect(),
                None => self.last.clone(),
            };
            for sample in 0..count {
                if states.outcomes[sample].is_closed() {
                    let own = q_i.iter().skip(sample).step_by(count);
                    waiting = own.copied().collect();
                }
                if done[sample] {
                    continue;
                }
                if let outcome @ (Outcome::NotClosed { .. }
                | Outcome::Singular { .. }
                | Outcome::BranchLost { .. }) = states.outcomes[sample]
                {
                    (found[sample], done[sample]) = (Completeness::Open(outcome), true);
                    for (k, own) in waiting.iter().enumerate() {
                        q_i[k * count + sample] = *own;
                    }
                    continue;
                }
                let own: Vec<f64> = states.at(&states.q, sample).collect();
                let off: Vec<f64> = measured
                    .at(0, sample)
                    .iter()
                    .zip(&self.measured)
                    .map(|(y, m)| y - own[*m])
                    .collect();
                let Some(step) = self.least_squares(&columns.weighted[sample], &off) else {
                    (found[sample], done[sample]) = (Completeness::Unmeasured, true);
                    continue;
                };
                for (k, step) in step.iter().enumerate() {
                    steps[k * count + sample] = *step;
                    q_i[k * count + sample] += step;
                }
                done[sample] = step.iter().all(|s| s.abs() < STEP_TOLERANCE);
            }
            if done.iter().all(|done| *done) {
                // the dependent coordinates move along the tangent by so little that its error is
                // below rounding
                for (steps, rates) in steps.chunks_exact(count).zip(&columns.rates) {
                    let rates = rates.chunks_exact(count);
                    for (q, rates) in states.q.chunks_exact_mut(count).zip(rates) {
                        for ((q, rate), step) in q.iter_mut().zip(rates).zip(steps) {
                            *q += rate * step;
                        }
                    }
                }
                break;
            }
            states = self.closed(begin.as_deref(), &q_i)?;
            columns = self.columns_at(&states)?;
        }
        for (found, outcome) in found.iter_mut().zip(&states.outcomes) {
            if *found == Completeness::Closed && !outcome.is_closed() {
                *found = Completeness::Open(*outcome);
            }
        }
        for (sample, _) in found
            .iter()
            .enumerate()
            .filter(|(_, found)| matches!(found, Completeness::Open(_)))
        {
            let own = states.q.iter_mut().skip(sample).step_by(count);
            own.for_each(|q| *q = f64::NAN);
        }
        // the rates at the states that were found
        let mut rates = [vec![0.0; q_i.len()], vec![0.0; q_i.len()]];
        for order in 0..2 {
            // velocities are measured as they are; accelerations less those of a constant velocity
            let without = match order {
                0 => vec![0.0; states.q.len()],
                _ => self.accelerations_at(&states, &rates[1])?,
            };
            for sample in 0..count {
                if found[sample] != Completeness::Closed {
                    continue;
                }
                let known: Vec<f64> = without
                    .iter()
                    .skip(sample)
                    .step_by(count)
                    .copied()
                    .collect();
                let rest: Vec<f64> = measured
                    .at(1 + order, sample)
                    .iter()
                    .zip(&self.measured)
                    .map(|(y, m)| y - known[*m])
                    .collect();
                match self.least_squares(&columns.weighted[sample], &rest) {
                    Some(own) => {
                        for (k, rate) in own.iter().enumerate() {
                            rates[order][k * count + sample] = *rate;
                        }
                    }
                    None => found[sample] = Completeness::Unmeasured,
                }
            }
            if order == 0 {
                states.qd = self.velocities_at(&states, &rates[0])?;
            }
        }
        states.qdd = self.accelerations_at(&states, &rates[1])?;
        if let Some(last) = found.iter().rposition(|f| *f == Completeness::Closed) {
            self.last = (0..dof).map(|k| q_i[k * count + last]).collect();
        }
        let n = info.coordinates.len();
        let by_state = |series: &[f64]| -> Vec<f64> {
            let state = |sample: usize| series.iter().skip(sample).step_by(count).copied();
            (0..count).flat_map(state).collect()
        };
        Ok(Some(CompletedStates {
            coordinates: n,
            q: by_state(&states.q),
            qd: by_state(&states.qd),
            qdd: by_state(&states.qdd),
            outcomes: found,
        }))
    }

    /// Closes the loops along the block, from the state at which it begins.
    fn closed(
        &mut self,
        begin: Option<&[f64]>,
        q_i: &[f64],
    ) -> Result<TrackedStates, ClosureError> {
        self.closure.resume(begin);
        let count = q_i.len() / self.last.len().max(1);
        let still = vec![0.0; q_i.len()];
        self.closure.track(count, q_i, &still, &still)
    }

    /// The rates of the coordinates by the independent ones, and those that are measured for the
    /// least squares of each state.
    fn columns_at(&self, states: &TrackedStates) -> Result<Columns, ClosureError> {
        let (dof, count) = (self.last.len(), states.len());
        let mut columns = Columns {
            rates: Vec::with_capacity(dof),
            weighted: vec![Vec::with_capacity(dof * self.measured.len()); count],
        };
        for k in 0..dof {
            let mut unit = vec![0.0; dof * count];
            unit[k * count..(k + 1) * count].fill(1.0);
            let all = self.velocities_at(states, &unit)?;
            for (sample, own) in columns.weighted.iter_mut().enumerate() {
                let entries = self.measured.iter().zip(&self.weights);
                own.extend(entries.map(|(m, weight)| all[m * count + sample] * weight));
            }
            columns.rates.push(all);
        }
        Ok(columns)
    }

    /// The velocities of all coordinates at these independent ones.
    fn velocities_at(
        &self,
        states: &TrackedStates,
        qd_i: &[f64],
    ) -> Result<Vec<f64>, ClosureError> {
        let arguments = Arguments {
            q: &states.q,
            qd_i,
            ..Arguments::EMPTY
        };
        self.rates_at(Function::Velocities, states, arguments)
    }

    /// The accelerations of all coordinates at the states' velocities and these independent ones.
    fn accelerations_at(
        &self,
        states: &TrackedStates,
        qdd_i: &[f64],
    ) -> Result<Vec<f64>, ClosureError> {
        let arguments = Arguments {
            q: &states.q,
            qd: &states.qd,
            qdd_i,
            ..Arguments::EMPTY
        };
        self.rates_at(Function::Accelerations, states, arguments)
    }

    fn rates_at(
        &self,
        function: Function,
        states: &TrackedStates,
        arguments: Arguments<'_, f64>,
    ) -> Result<Vec<f64>, ClosureError> {
        let mut pivots = vec![1.0; states.len()];
        let mut out = vec![0.0; states.q.len()];
        eval_many(
            self.model,
            function,
            states.len(),
            arguments,
            &mut out,
            &mut pivots,
        )?;
        Ok(out)
    }
}
