//! Estimates the delays of logged efforts relative to the motion that they belong to.

use serde::{Deserialize, Serialize};

use super::equation_builder::Equations;
use super::passes::{Source, predicted};
use super::replay::Replay;
use crate::estimate::{Autocorrelated, EstimateError, QrFactor};
use regen_runtime::BaseModel;

/// The delay of one effort.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Delay {
    /// The effort's name.
    pub effort: String,
    /// The time by which the effort is logged after the motion that it belongs to, s; negative if
    /// it is logged before.
    pub seconds: f64,
    /// The standard deviation of the delay, s; it accounts for the residuals' correlation in time.
    pub sigma: f64,
}

impl Delay {
    /// Whether the delay differs from zero by more than three standard deviations.
    pub fn is_significant(&self) -> bool {
        self.seconds.abs() > 3.0 * self.sigma
    }
}

/// The delays of all efforts, one by one and in common.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Delays {
    /// The delay of each effort.
    pub efforts: Vec<Delay>,
    /// The common delay of all efforts that fits best; `None` if no effort determines a delay.
    pub common: Option<Delay>,
}

/// Estimates the delays together with the parameters: an effort that is logged late by d is
/// `tau(t - d) = tau(t) - d dtau/dt` to first order, so minus the rate of the predicted effort is
/// an additional column of the regressor.
///
/// - `labels`, `values`: the base parameters, with which the efforts are predicted;
/// - `names`, `weights`: those of the efforts;
/// - `bandwidth`: the number of samples in which the residuals are correlated.
///
/// Returns no delays where the data do not determine them.
pub(super) fn delays<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    labels: &[String],
    values: &[f64],
    names: &[String],
    weights: &[f64],
    bandwidth: usize,
) -> Result<Delays, S::Error> {
    let (n, efforts) = (values.len(), names.len());
    let mut all = labels.to_vec();
    all.extend(names.iter().map(|name| format!("delay {name}")));
    let mut factor = QrFactor::new(all);
    let mut block = Block::default();
    with_rates(replay, values, &mut |found, rates| {
        for (e, (tau, own)) in found.tau.iter().zip(found.weights).enumerate() {
            let weight = own * weights.get(e).copied().unwrap_or(1.0);
            if weight > 0.0 {
                let row = found.w.iter().skip(e).step_by(found.tau.len());
                block.push(row, (e, -rates[e]), efforts, *tau, weight);
                block.flush(&mut factor, BLOCK_ROWS)?;
            }
        }
        Ok(())
    })?;
    block.flush(&mut factor, 1)?;
    let Some((extended, fit)) = solve(&factor) else {
        return Ok(Delays::default());
    };

    let mut scores = Autocorrelated::new(extended.len(), bandwidth);
    let mut score = vec![0.0; extended.len()];
    with_rates(replay, values, &mut |found, rates| {
        if !found.follows {
            scores.interrupt();
        }
        score.fill(0.0);
        for (e, (tau, own)) in found.tau.iter().zip(found.weights).enumerate() {
            let weight = own * weights.get(e).copied().unwrap_or(1.0);
            let residual = tau - predicted(found, e, &extended) + rates[e] * extended[n + e];
            let psi = weight * weight * residual;
            let row = found.w.iter().skip(e).step_by(found.tau.len());
            for (sum, w) in score.iter_mut().zip(row.take(n)) {
                *sum += w * psi;
            }
            score[n + e] -= rates[e] * psi;
        }
        scores.push(&score)
    })?;
    let Ok(covariance) = scores.covariance(&fit) else {
        return Ok(Delays::default());
    };
    let size = extended.len();
    let entry = |i: usize, j: usize| covariance[(n + j) * size + n + i];
    let one = |(e, name): (usize, &String)| Delay {
        effort: name.clone(),
        seconds: extended[n + e],
        sigma: entry(e, e).max(0.0).sqrt(),
    };
    let found: Vec<Delay> = names.iter().enumerate().map(one).collect();
    let common = common(&found, &entry);
    Ok(Delays {
        efforts: found,
        common,
    })
}

/// The mean of the delays, each weighted by the inverse of its variance, with the standard
/// deviation that follows from their covariance.
fn common(delays: &[Delay], covariance: &dyn Fn(usize, usize) -> f64) -> Option<Delay> {
    let parts: Vec<f64> = delays
        .iter()
        .map(|d| {
            let part = 1.0 / (d.sigma * d.sigma);
            if part.is_finite() { part } else { 0.0 }
        })
        .collect();
    let whole: f64 = parts.iter().sum();
    if whole <= 0.0 {
        return None;
    }
    let pairs = delays.iter().zip(&parts);
    let seconds = pairs.map(|(d, part)| d.seconds * part).sum::<f64>() / whole;
    let mut variance = 0.0;
    for (i, a) in parts.iter().enumerate() {
        for (j, b) in parts.iter().enumerate() {
            variance += a * b * covariance(i, j);
        }
    }
    Some(Delay {
        effort: "all".to_owned(),
        seconds,
        sigma: variance.max(0.0).sqrt() / whole,
    })
}

fn solve(factor: &QrFactor) -> Option<(Vec<f64>, QrFactor)> {
    let values = factor.solve().ok()?;
    Some((values, factor.clone()))
}

/// Number of rows that are reduced into the QR factor at a time.
const BLOCK_ROWS: usize = 256;

/// Rows that are still to be reduced into a QR factor.
#[derive(Default)]
struct Block {
    rows: Vec<Vec<f64>>,
    side: Vec<f64>,
}

impl Block {
    fn push<'v>(
        &mut self,
        row: impl Iterator<Item = &'v f64>,
        (effort, rate): (usize, f64),
        efforts: usize,
        tau: f64,
        weight: f64,
    ) {
        let mut entries: Vec<f64> = row.map(|w| w * weight).collect();
        entries.extend((0..efforts).map(|e| if e == effort { rate * weight } else { 0.0 }));
        self.rows.push(entries);
        self.side.push(tau * weight);
    }

    fn flush(&mut self, factor: &mut QrFactor, at_least: usize) -> Result<(), EstimateError> {
        if self.rows.len() < at_least {
            return Ok(());
        }
        let columns = factor.columns();
        let mut w = Vec::with_capacity(columns * self.rows.len());
        for column in 0..columns {
            w.extend(self.rows.iter().map(|row| row[column]));
        }
        factor.push_block(&w, &self.side)?;
        self.rows.clear();
        self.side.clear();
        Ok(())
    }
}

/// Callback that receives a sample's equations and the time derivatives of its predicted efforts.
type EquationRateSink<'a> = dyn FnMut(&Equations<'_>, &[f64]) -> Result<(), EstimateError> + 'a;

/// A copy of a sample's equations, for differences with its neighbours.
#[derive(Default)]
struct BufferedEquations {
    time: f64,
    w: Vec<f64>,
    tau: Vec<f64>,
    weights: Vec<f64>,
    predicted: Vec<f64>,
}

/// Passes every sample that has neighbours on both sides to `each`, with the time derivatives of
/// its predicted efforts by central differences.
fn with_rates<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    values: &[f64],
    each: &mut EquationRateSink<'_>,
) -> Result<(), S::Error> {
    let (mut before, mut at) = (BufferedEquations::default(), BufferedEquations::default());
    let mut run = 0;
    let mut rates = Vec::new();
    let mut first = true;
    replay.visit(&mut |found| {
        if !found.follows {
            run = 0;
        }
        if found.tau.is_empty() {
            return Ok(());
        }
        let predicted: Vec<f64> = (0..found.tau.len())
            .map(|e| predicted(found, e, values))
            .collect();
        if run >= 2 {
            let span = found.time - before.time;
            rates.clear();
            let ends = predicted.iter().zip(&before.predicted);
            rates.extend(ends.map(|(after, before)| (after - before) / span));
            let own = Equations {
                time: at.time,
                w: &at.w,
                tau: &at.tau,
                weights: &at.weights,
                follows: !first,
            };
            each(&own, &rates)?;
            first = false;
        } else {
            first = true;
        }
        core::mem::swap(&mut before, &mut at);
        at = BufferedEquations {
            time: found.time,
            w: found.w.to_vec(),
            tau: found.tau.to_vec(),
            weights: found.weights.to_vec(),
            predicted,
        };
        run += 1;
        Ok(())
    })
}
