//! What sampling leaves unknown of the efforts, and so of the parameters.

use std::collections::VecDeque;

use super::equation_builder::Equations;
use super::filtering::Filtering;
use crate::estimate::{QrFactor, changed_by};

/// How much the two steps around a sample may differ to count as equal, relative.
const EQUAL_STEPS: f64 = 0.01;

/// Sums the scores of the change of the efforts if they were held between the rows of the log.
///
/// A controller that runs at the rate of the log holds its efforts from row to row, and the row has
/// the mean of both sides. The second difference of the positions over one step h is then the mean
/// acceleration exactly, but the other forces f count with their mean over that step:
/// `M D q = tau - f - h^2/12 f''`. Accurate derivatives of the same positions are `D q - h^2/12 (D q)''`,
/// so that with the right parameters x
///
/// ```text
/// tau - W x = h^2/12 tau''
/// ```
///
/// With a controller that is much faster than the log the left side is 0. No log tells which it is, so
/// that the change `(W^T W)^-1 W^T h^2/12 tau''` counts as one standard deviation.
#[derive(Debug)]
pub(crate) struct HeldEfforts {
    /// `W^T h^2/12 tau''`; with instruments `Z^T` times the same.
    scores: Vec<f64>,
    /// Whether the equations are behind a low-pass filter.
    filtered: bool,
    /// The last samples, three at most.
    samples: VecDeque<Sample>,
}

/// The equations of one sample.
#[derive(Debug, Default)]
struct Sample {
    time: f64,
    columns: Vec<f64>,
    efforts: Vec<f64>,
    weights: Vec<f64>,
}

impl HeldEfforts {
    /// - `parameters`: their number; `filtering`: that of the equations.
    pub(crate) fn new(parameters: usize, filtering: Filtering) -> Self {
        Self {
            scores: vec![0.0; parameters],
            filtered: !filtering.smoothing.is_none(),
            samples: VecDeque::new(),
        }
    }

    /// Adds the equations of the next sample.
    ///
    /// - `equations`: columns of the regressor or of the instruments, and the measured efforts;
    /// - `weights`: of the efforts.
    pub(crate) fn push(&mut self, equations: &Equations<'_>, weights: &[f64]) {
        if equations.tau.is_empty() {
            return;
        }
        if !equations.follows {
            self.samples.clear();
        }
        let mut next = match self.samples.len() {
            3 => self.samples.pop_front().unwrap_or_default(),
            _ => Sample::default(),
        };
        next.time = equations.time;
        next.columns.clear();
        next.columns.extend_from_slice(equations.w);
        next.efforts.clear();
        next.efforts.extend_from_slice(equations.tau);
        next.weights.clear();
        let both = weights.iter().zip(equations.weights);
        next.weights.extend(both.map(|(effort, row)| effort * row));
        self.samples.push_back(next);
        self.add(equations.rows_between);
    }

    /// Adds the scores of the middle one of three samples.
    fn add(&mut self, rows_between: usize) {
        let mut samples = self.samples.iter();
        let (Some(a), Some(b), Some(c)) = (samples.next(), samples.next(), samples.next()) else {
            return;
        };
        let (before, after) = (b.time - a.time, c.time - b.time);
        if (before - after).abs() > EQUAL_STEPS * after {
            return;
        }
        let count = b.efforts.len();
        let part = 1.0 / (12.0 * (rows_between * rows_between) as f64);
        for i in 0..count {
            let of = |sample: &Sample| {
                let effort = sample.efforts.get(i).copied();
                (effort, sample.weights.get(i).copied().unwrap_or(0.0))
            };
            let ((Some(first), w_a), (Some(middle), w_b), (Some(last), w_c)) =
                (of(a), of(b), of(c))
            else {
                continue;
            };
            // without a filter, friction jumps from a neighbour at rest
            if w_b == 0.0 || !self.filtered && (w_a == 0.0 || w_c == 0.0) {
                continue;
            }
            let change = part * (first - 2.0 * middle + last);
            let entries = b.columns.iter().skip(i).step_by(count.max(1));
            for (sum, w) in self.scores.iter_mut().zip(entries) {
                *sum += w_b * w_b * w * change;
            }
        }
    }

    /// `W^T h^2/12 tau''`, with instruments `Z^T h^2/12 tau''`: one entry for each parameter.
    pub(crate) fn into_scores(self) -> Vec<f64> {
        self.scores
    }

    /// The change of each parameter, in its unit; 0 if the factor is singular.
    ///
    /// - `factor`: the weighted QR factor of W.
    pub(crate) fn change(self, factor: &QrFactor) -> Vec<f64> {
        changed_by(factor, &self.scores).unwrap_or_else(|| vec![0.0; self.scores.len()])
    }
}
