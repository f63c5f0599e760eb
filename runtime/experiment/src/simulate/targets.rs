//! The states that the controllers follow: the reference, closed in blocks of samples ahead of time.

use regen_batch::{TrackedStates, TrajectoryClosure};
use regen_runtime::{ClosureError, Model, Outcome};

use super::settings::Reference;

/// The largest number of samples that are closed at a time.
const BLOCK: usize = 64;

/// The samples of the reference.
pub(super) struct Targets<'m, M: ?Sized, R: ?Sized> {
    reference: &'m R,
    closure: TrajectoryClosure<'m, M>,
    /// The time between samples, s.
    period: f64,
    /// The last sample of the run.
    last: usize,
    dof: usize,
    /// The first sample of the block.
    first: usize,
    states: TrackedStates,
    /// The independent positions, velocities and accelerations of the block, one after the other for
    /// each sample.
    rows: Vec<f64>,
    /// The same for the last sample at which the reference was evaluated.
    row: Vec<f64>,
    /// All coordinates at the sample that [`at`](Self::at) returned.
    q: Vec<f64>,
}

/// The reference at a sample.
pub(super) struct Target<'a> {
    /// All coordinates (n, rad or m).
    pub(super) q: &'a [f64],
    /// The independent positions, velocities and accelerations (dof each).
    pub(super) independent: [&'a [f64]; 3],
    /// Whether the loops close there.
    pub(super) outcome: Outcome,
}

impl<'m, M: Model<f64> + ?Sized, R: Reference + ?Sized> Targets<'m, M, R> {
    pub(super) fn new(
        model: &'m M,
        reference: &'m R,
        period: f64,
        last: usize,
    ) -> Result<Self, ClosureError> {
        let dof = model.info().dof();
        Ok(Self {
            reference,
            closure: TrajectoryClosure::new(model)?,
            period,
            last,
            dof,
            first: 0,
            states: TrackedStates::default(),
            rows: Vec::new(),
            row: vec![0.0; 3 * dof],
            q: vec![0.0; model.info().coordinates.len()],
        })
    }

    /// The reference at a sample; the samples must be requested in ascending order.
    ///
    /// # Errors
    /// When the position of the reference is not finite there.
    pub(super) fn at(&mut self, sample: usize) -> Result<Target<'_>, ClosureError> {
        if sample >= self.first + self.states.len() {
            self.fill(sample)?;
        }
        let state = sample - self.first;
        let of_state = self.states.at(&self.states.q, state);
        for (slot, value) in self.q.iter_mut().zip(of_state) {
            *slot = value;
        }
        let outcome = self.states.outcomes.get(state).copied();
        let width = 3 * self.dof;
        let row = self.rows.get(state * width..(state + 1) * width);
        let (q_i, rates) = row.unwrap_or(&self.row).split_at(self.dof);
        let (qd_i, qdd_i) = rates.split_at(self.dof);
        Ok(Target {
            q: &self.q,
            independent: [q_i, qd_i, qdd_i],
            outcome: outcome.unwrap_or(Outcome::BranchLost { at: 0.0 }),
        })
    }

    /// Closes the loops at the samples from `first` on.
    fn fill(&mut self, first: usize) -> Result<(), ClosureError> {
        self.first = first;
        self.rows.clear();
        let dof = self.dof;
        let mut count = 0;
        for sample in first..=self.last.min(first + BLOCK - 1) {
            let (q_i, rates) = self.row.split_at_mut(dof);
            let (qd_i, qdd_i) = rates.split_at_mut(dof);
            let t = sample as f64 * self.period;
            self.reference.at(t, q_i, qd_i, qdd_i);
            let finite = q_i.iter().all(|x| x.is_finite());
            // a sample without a position ends the run only when it is reached
            if finite || count == 0 {
                self.rows.extend(&self.row);
                count += 1;
            }
            if !finite {
                break;
            }
        }
        let width = (3 * dof).max(1);
        let q_i: Vec<f64> = (0..dof)
            .flat_map(|k| self.rows.iter().skip(k).step_by(width).copied())
            .collect();
        let still = vec![0.0; dof * count];
        self.states = self.closure.track(count, &q_i, &still, &still)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[allow(unreachable_pub, reason = "examples include the file too")]
    mod models {
        include!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../tests/models/pendulum.rs"
        ));
    }

    #[test]
    fn every_sample_has_the_positions_and_rates_of_the_reference_at_its_time() {
        let period = 0.25;
        let reference = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
            (q[0], qd[0], qdd[0]) = (0.01 * t * t, 0.02 * t, 0.02);
        };
        // two blocks and a half
        let last = 5 * BLOCK / 2;
        let mut targets = Targets::new(&models::Pendulum, &reference, period, last).unwrap();
        for sample in 0..=last {
            let t = 0.25 * sample as f64;
            let target = targets.at(sample).unwrap();
            assert!(target.outcome.is_closed());
            let [q_i, qd_i, qdd_i] = target.independent;
            for (found, wanted) in [
                (target.q, 0.01 * t * t),
                (q_i, 0.01 * t * t),
                (qd_i, 0.02 * t),
                (qdd_i, 0.02),
            ] {
                assert_eq!(found, [wanted], "{sample}");
            }
        }
    }
}
