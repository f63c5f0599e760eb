//! Samples that wait until the regressors of many of them are computed at once.

use crate::estimate::EstimateError;
use crate::states::StateSample;
use crate::turned::turn;
use regen_batch::eval_base_many;
use regen_runtime::{Arguments, BaseFunction, BaseModel};

/// The largest number of samples that wait.
const MAX_WAITING: usize = 256;

/// Waiting samples, and their base regressors.
#[derive(Debug, Default)]
pub(super) struct Pending {
    samples: Vec<OwnedSample>,
    /// The number of `samples` that wait; the others keep their memory for later ones.
    count: usize,
    /// Coordinates, velocities and accelerations of the samples that wait, those of one sample one after
    /// the other.
    motion: [Vec<f64>; 3],
    /// The same, those of one coordinate one after the other.
    turned: [Vec<f64>; 3],
    /// The entries of the base regressors, those of one entry at all samples one after the other.
    series: Vec<f64>,
    /// The base regressors of the samples, each column by column.
    w: Vec<f64>,
    /// The number of entries of a base regressor.
    size: usize,
    pivots: Vec<f64>,
}

/// The fields of [`StateSample`] but for the motion, owned.
#[derive(Debug, Default)]
struct OwnedSample {
    time: f64,
    tau: Vec<f64>,
    efforts: Vec<f64>,
    held: Vec<f64>,
    at_standstill: Vec<bool>,
    weights: Vec<f64>,
    follows: bool,
    bridged: bool,
}

/// Replaces the entries, and reuses the memory.
fn assign<T: Copy>(to: &mut Vec<T>, from: &[T]) {
    to.clear();
    to.extend_from_slice(from);
}

impl Pending {
    /// Adds a sample, whose motion has the model's length; returns whether the buffer is full.
    pub(super) fn push(&mut self, sample: &StateSample<'_>) -> bool {
        if self.count == self.samples.len() {
            self.samples.push(OwnedSample::default());
        }
        if let Some(own) = self.samples.get_mut(self.count) {
            own.time = sample.time;
            own.follows = sample.follows;
            own.bridged = sample.bridged;
            assign(&mut own.tau, sample.tau);
            assign(&mut own.efforts, sample.efforts);
            assign(&mut own.held, sample.held);
            assign(&mut own.at_standstill, sample.at_standstill);
            assign(&mut own.weights, sample.weights);
        }
        let parts = [sample.q, sample.qd, sample.qdd];
        for (all, own) in self.motion.iter_mut().zip(parts) {
            all.extend_from_slice(own);
        }
        self.count += 1;
        self.count >= MAX_WAITING
    }

    /// Computes the base regressors of the waiting samples.
    ///
    /// # Errors
    /// When a length does not fit.
    pub(super) fn compute<M: BaseModel<f64> + ?Sized>(
        &mut self,
        model: &M,
    ) -> Result<(), EstimateError> {
        let info = model.info();
        let (n, count) = (info.coordinates.len(), self.count);
        let size = info.dof() * model.base_info().base.len();
        self.series.resize(size * count, 0.0);
        self.pivots.clear();
        self.pivots.resize(count, 1.0);
        for (samples, series) in self.motion.iter().zip(&mut self.turned) {
            series.resize(n * count, 0.0);
            turn(samples, n, series, count);
        }
        let [q, qd, qdd] = &self.turned;
        let arguments = Arguments {
            q,
            qd,
            qdd,
            ..Arguments::EMPTY
        };
        let function = BaseFunction::BaseRegressor;
        eval_base_many(
            model,
            function,
            count,
            arguments,
            &mut self.series,
            &mut self.pivots,
        )?;
        self.size = size;
        self.w.resize(size * count, 0.0);
        turn(&self.series, count, &mut self.w, size);
        Ok(())
    }

    /// The number of waiting samples.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// A waiting sample with the entries of its base regressor, column by column, and its pivot.
    pub(super) fn at(&self, index: usize) -> Option<(StateSample<'_>, &[f64], f64)> {
        let own = self.samples.get(index).filter(|_| index < self.count)?;
        let [q, qd, qdd] = self.motion.each_ref().map(|all| {
            let n = all.len() / self.count;
            all.get(index * n..(index + 1) * n).unwrap_or_default()
        });
        let sample = StateSample {
            time: own.time,
            q,
            qd,
            qdd,
            tau: &own.tau,
            efforts: &own.efforts,
            held: &own.held,
            at_standstill: &own.at_standstill,
            weights: &own.weights,
            follows: own.follows,
            bridged: own.bridged,
        };
        let w = self.w.get(index * self.size..(index + 1) * self.size)?;
        Some((sample, w, self.pivots.get(index).copied()?))
    }

    /// Forgets the waiting samples.
    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.motion.iter_mut().for_each(Vec::clear);
    }
}
