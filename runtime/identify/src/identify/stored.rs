//! The equations of a log in memory.

use super::equation_builder::Equations;
use super::passes::predictions;
use crate::estimate::{EstimateError, Residuals};

/// The equations of all samples of a log, in order of time.
#[derive(Clone, Debug, Default)]
pub struct StoredEquations {
    /// Sample by sample: `w`, `tau`, `weights`, `held`.
    values: Vec<f64>,
    samples: Vec<Sample>,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    time: f64,
    /// The number of equations.
    rows: usize,
    /// The number of entries of `held`.
    held: usize,
    /// The end of the sample's numbers in `values`.
    end: usize,
    follows: bool,
}

impl StoredEquations {
    /// How many numbers are stored.
    pub(super) fn numbers(&self) -> usize {
        self.values.len()
    }

    pub(super) fn push(&mut self, equations: &Equations<'_>) {
        let Equations {
            w,
            tau,
            weights,
            held,
            ..
        } = equations;
        for part in [w, tau, weights, held] {
            self.values.extend_from_slice(part);
        }
        self.samples.push(Sample {
            time: equations.time,
            rows: tau.len(),
            held: held.len(),
            end: self.values.len(),
            follows: equations.follows,
        });
    }

    /// Passes the equations of all samples to `each` in order of time.
    pub(crate) fn visit(
        &self,
        each: &mut dyn FnMut(&Equations<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), EstimateError> {
        let mut start = 0;
        for sample in &self.samples {
            let values = &self.values[start..sample.end];
            start = sample.end;
            let (values, held) = values.split_at(values.len() - sample.held);
            let (w, rest) = values.split_at(values.len() - 2 * sample.rows);
            let (tau, weights) = rest.split_at(sample.rows);
            each(&Equations {
                time: sample.time,
                w,
                tau,
                weights,
                follows: sample.follows,
                held,
            })?;
        }
        Ok(())
    }

    /// The statistics of the residuals: measured minus predicted right-hand sides.
    ///
    /// - `efforts`: the names of the efforts; `values`: base parameters, SI;
    /// - `lags`: the number of autocorrelations to compute.
    ///
    /// # Errors
    /// When the equations are not those of these efforts.
    pub fn residuals(
        &self,
        efforts: &[String],
        values: &[f64],
        lags: usize,
    ) -> Result<Residuals, EstimateError> {
        let mut means = Means::new(efforts.len());
        self.visit(&mut |equations| {
            means.push(equations.tau, equations.weights);
            Ok(())
        })?;
        let mut out = Residuals::new(efforts, &means.finish(), lags);
        let (mut fitted, mut used) = (Vec::new(), Vec::new());
        self.visit(&mut |equations| {
            if equations.tau.is_empty() {
                return Ok(());
            }
            if !equations.follows {
                out.interrupt();
            }
            predictions(equations, values, &mut fitted);
            used.clear();
            used.extend(equations.weights.iter().map(|w| *w > 0.0));
            out.push_used(equations.tau, &fitted, &used)
        })?;
        Ok(out)
    }
}

/// The mean of each effort over the equations that are used, as
/// [`FactorSet::means`](crate::estimate::FactorSet::means) computes it.
pub(crate) struct Means {
    sums: Vec<f64>,
    rows: Vec<usize>,
}

impl Means {
    pub(crate) fn new(efforts: usize) -> Self {
        Self {
            sums: vec![0.0; efforts],
            rows: vec![0; efforts],
        }
    }

    /// Adds the right-hand sides of a sample, and their weights.
    pub(crate) fn push(&mut self, tau: &[f64], weights: &[f64]) {
        let sums = self.sums.iter_mut().zip(&mut self.rows);
        for ((sum, rows), (tau, weight)) in sums.zip(tau.iter().zip(weights)) {
            if *weight != 0.0 {
                *sum += tau;
                *rows += 1;
            }
        }
    }

    pub(crate) fn finish(self) -> Vec<f64> {
        let pairs = self.sums.iter().zip(&self.rows);
        pairs
            .map(|(sum, rows)| sum / (*rows).max(1) as f64)
            .collect()
    }
}
