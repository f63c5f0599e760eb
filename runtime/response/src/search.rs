//! The Levenberg-Marquardt search over QR factors of all windows. The unknowns that belong to one
//! window are eliminated window by window.

use regen_identify::estimate::{EstimateError, QrFactor};
use regen_runtime::BaseModel;

use crate::residuals;
use crate::setup::SignalKind;
use crate::threads::spread;
use crate::window::{Experiment, Refused, Window};
use crate::{Number, ResponseError};

/// The first damping, relative to the squared lengths of the columns.
const FIRST_DAMPING: f64 = 1e-3;
/// The smallest damping, far below the curvature of every direction that the data determine.
const MIN_DAMPING: f64 = 1e-15;
/// The largest damping; beyond it steps are too short to change anything.
const MAX_DAMPING: f64 = 1e9;
/// The search ends with a step that moves the unknowns by less than this part of their standard
/// deviations, in the root mean square.
const TOLERANCE_DEVIATIONS: f64 = 1e-3;
/// A relative decrease of the sum of squares below this is rounding.
const ROUNDING: f64 = 1e-10;
/// Residuals below this part of the signal are rounding errors of the simulation.
const MIN_RESIDUAL_PART: f64 = 1e-14;

/// The triangular QR factors of all windows at one candidate.
pub(crate) struct Evaluated {
    /// For each window, one QR factor for each signal; columns: the window's own unknowns, then the
    /// shared ones.
    windows: Vec<Vec<QrFactor>>,
    /// For each signal, the sum of the squared residuals, and their number.
    pub(crate) squares: Vec<f64>,
    pub(crate) counts: Vec<usize>,
}

impl Evaluated {
    /// The factor on each signal's residuals: the inverse of their standard deviation.
    pub(crate) fn weights(&self, floors: &[f64]) -> Vec<f64> {
        let all = self.squares.iter().zip(&self.counts).zip(floors);
        all.map(|((squares, count), floor)| {
            1.0 / (squares / (*count).max(1) as f64).sqrt().max(*floor)
        })
        .collect()
    }

    /// -2 times the logarithm of the likelihood, with the noise of each signal unknown.
    fn cost(&self, floors: &[f64]) -> f64 {
        let all = self.counts.iter().zip(self.weights(floors));
        all.map(|(count, weight)| -2.0 * *count as f64 * libm::log(weight))
            .sum()
    }
}

/// The result of a search.
pub(crate) struct Searched {
    pub(crate) shared: Vec<f64>,
    pub(crate) windows: Vec<Window>,
    /// The factor on each signal's residuals.
    pub(crate) weights: Vec<f64>,
    /// The QR factor of the shared unknowns, those of the windows eliminated.
    pub(crate) factor: QrFactor,
    pub(crate) steps: usize,
    /// The number of candidates that could not be simulated.
    pub(crate) refused: usize,
    pub(crate) converged: bool,
}

/// The signals of a fit, with the size of each below which residuals are rounding errors.
pub(crate) struct Signals {
    pub(crate) kinds: Vec<SignalKind>,
    pub(crate) floors: Vec<f64>,
}

impl Signals {
    /// - `sizes`: the root mean square of each signal.
    pub(crate) fn new(kinds: Vec<SignalKind>, sizes: &[f64]) -> Self {
        let floor = |size: &f64| (MIN_RESIDUAL_PART * size).max(f64::MIN_POSITIVE.sqrt());
        Self {
            kinds,
            floors: sizes.iter().map(floor).collect(),
        }
    }
}

/// A step: of the shared unknowns, and of each window's own.
struct Step {
    shared: Vec<f64>,
    own: Vec<Vec<f64>>,
    /// The length of the step in standard deviations, root mean square over all unknowns.
    deviations: f64,
}

impl<M, D> Experiment<'_, '_, M, D>
where
    M: BaseModel<f64> + ?Sized + Sync,
    D: BaseModel<Number> + ?Sized + Sync,
{
    /// Minimises the residuals, starting from these windows and shared unknowns.
    pub(crate) fn search(
        &self,
        signals: &Signals,
        mut windows: Vec<Window>,
        mut shared: Vec<f64>,
        progress: &mut dyn FnMut(usize, f64),
    ) -> Result<Searched, ResponseError> {
        let mut at = match self.evaluate(signals, &windows, &shared)? {
            Ok(at) => at,
            Err((window, why)) => {
                let run = windows.get(window).and_then(|w| self.runs.get(w.run));
                let row = windows.get(window).map_or(0, |w| w.rows.start);
                return Err(ResponseError::Start {
                    time: run.and_then(|r| r.times.get(row)).copied().unwrap_or(0.0),
                    why: why.words(),
                });
            }
        };
        let mut cost = at.cost(&signals.floors);
        let mut damping = FIRST_DAMPING;
        let (mut steps, mut refused, mut converged) = (0, 0, false);
        while steps < self.setup.steps && !converged {
            steps += 1;
            progress(steps, at.squares.iter().sum());
            let weights = at.weights(&signals.floors);
            loop {
                let step = self.step(&at, &weights, damping)?;
                let small = step.deviations < TOLERANCE_DEVIATIONS;
                let (next_windows, next_shared) = after_step(&windows, &shared, &step);
                // the cost of a candidate that cannot be simulated is infinite
                let next = self.evaluate(signals, &next_windows, &next_shared)?.ok();
                refused += usize::from(next.is_none());
                let next_cost = next
                    .as_ref()
                    .map_or(f64::INFINITY, |n| n.cost(&signals.floors));
                if let Some(next) = next
                    && next_cost <= cost
                {
                    let rows: usize = at.counts.iter().sum();
                    converged = small || cost - next_cost <= ROUNDING * rows as f64;
                    (at, cost) = (next, next_cost);
                    (windows, shared) = (next_windows, next_shared);
                    damping = (0.1 * damping).max(MIN_DAMPING);
                    break;
                }
                if small && next_cost.is_finite() {
                    // the sign of such a small decrease is decided by rounding
                    converged = true;
                    break;
                }
                damping *= 10.0;
                if damping > MAX_DAMPING {
                    return self.finish(signals, &at, windows, shared, [steps, refused], false);
                }
            }
        }
        self.finish(signals, &at, windows, shared, [steps, refused], converged)
    }

    fn finish(
        &self,
        signals: &Signals,
        at: &Evaluated,
        windows: Vec<Window>,
        shared: Vec<f64>,
        [steps, refused]: [usize; 2],
        converged: bool,
    ) -> Result<Searched, ResponseError> {
        let weights = at.weights(&signals.floors);
        let mut all = Reduced::new(&self.unknowns.labels);
        for factors in &at.windows {
            let whole = combined(factors, &weights)?;
            all.take(&whole, self.own())?;
        }
        let rows: usize = at.counts.iter().sum();
        let rows = rows.saturating_sub(windows.len() * self.own());
        let factor = QrFactor::from_parts(
            self.unknowns.labels.clone(),
            all.factor.r().to_vec(),
            all.factor.z().to_vec(),
            all.rss + all.factor.rss(),
            rows,
        )?;
        Ok(Searched {
            shared,
            windows,
            weights,
            factor,
            steps,
            refused,
            converged,
        })
    }

    /// Simulates all windows, on several threads; returns the index of the first window that cannot
    /// be simulated, if there is one.
    pub(crate) fn evaluate(
        &self,
        signals: &Signals,
        windows: &[Window],
        shared: &[f64],
    ) -> Result<Result<Evaluated, (usize, Refused)>, ResponseError> {
        let work = |k: usize| self.window_factors(signals, &windows[k], shared);
        let goes_on = |found: &Result<Result<_, Refused>, _>| matches!(found, Ok(Ok(_)));
        let found = spread(self.setup.threads, windows.len(), work, goes_on);
        let mut out = Evaluated {
            windows: Vec::with_capacity(found.len()),
            squares: vec![0.0; signals.kinds.len()],
            counts: vec![0; signals.kinds.len()],
        };
        for (k, window) in found {
            let window = match window? {
                Ok(window) => window,
                Err(why) => return Ok(Err((k, why))),
            };
            let mut factors = Vec::with_capacity(window.len());
            for (s, signal) in window.into_iter().enumerate() {
                out.squares[s] += signal.squares;
                out.counts[s] += signal.factor.rows();
                factors.push(signal.factor);
            }
            out.windows.push(factors);
        }
        Ok(if out.squares.iter().all(|x| x.is_finite()) {
            Ok(out)
        } else {
            Err((0, Refused::Diverged))
        })
    }

    /// The QR factors of one window.
    fn window_factors(
        &self,
        signals: &Signals,
        window: &Window,
        shared: &[f64],
    ) -> Result<Result<Vec<WindowFactor>, Refused>, ResponseError> {
        let trace = match self.simulate(window, shared)? {
            Ok(trace) => trace,
            Err(why) => return Ok(Err(why)),
        };
        let own = self.own();
        let mut labels = vec![String::new(); own];
        labels.extend_from_slice(&self.unknowns.labels);
        let rows = self.rows(signals, window, shared, &trace);
        let mut out = Vec::with_capacity(rows.len());
        for rows in rows {
            let finite = rows
                .slopes
                .iter()
                .chain(&rows.values)
                .all(|x| x.is_finite());
            if !finite || self.out_of_reach(shared) {
                return Ok(Err(Refused::Diverged));
            }
            out.push(WindowFactor {
                squares: rows.values.iter().map(|x| x * x).sum(),
                factor: residuals::factor(&rows, &labels)?,
            });
        }
        Ok(Ok(out))
    }

    /// The residuals of one window.
    pub(crate) fn rows(
        &self,
        signals: &Signals,
        window: &Window,
        shared: &[f64],
        trace: &crate::window::Trace,
    ) -> Vec<residuals::SignalRows> {
        let Some(run) = self.runs.get(window.run) else {
            return Vec::new();
        };
        let common = residuals::Common {
            kinds: &signals.kinds,
            unknowns: self.unknowns,
            shared,
            own: self.own(),
            margin: self.setup.greatest_delay,
        };
        residuals::of_window(trace, run, &window.rows, &common)
    }

    /// Whether an estimated delay of a measured signal is outside the range of the search.
    fn out_of_reach(&self, shared: &[f64]) -> bool {
        let runs = self.runs.iter().flat_map(residuals::measured);
        runs.map(|(kind, _)| self.unknowns.signal(kind, shared)[0])
            .any(|delay| delay.column.is_some() && delay.value.abs() > self.setup.greatest_delay)
    }

    /// The step with this damping.
    fn step(&self, at: &Evaluated, weights: &[f64], damping: f64) -> Result<Step, ResponseError> {
        let own = self.own();
        let mut wholes = Vec::with_capacity(at.windows.len());
        let mut squares = vec![0.0; self.unknowns.len()];
        for factors in &at.windows {
            let whole = combined(factors, weights)?;
            for (sum, norm) in squares
                .iter_mut()
                .zip(whole.column_norms().iter().skip(own))
            {
                *sum += norm * norm;
            }
            wholes.push(whole);
        }
        let scale: Vec<f64> = squares.iter().map(|s| unit(s.sqrt())).collect();
        let mut all = Reduced::new(&self.unknowns.labels);
        let mut damped = Vec::with_capacity(wholes.len());
        for whole in &wholes {
            let norms = whole.column_norms();
            let n = norms.len();
            let mut more = whole.clone();
            let mut rows = vec![0.0; own * n];
            for (k, norm) in norms.iter().take(own).enumerate() {
                rows[k * own + k] = damping.sqrt() * unit(*norm);
            }
            more.push_block(&rows, &vec![0.0; own])?;
            all.take(&more, own)?;
            damped.push(more);
        }
        let m = scale.len();
        let mut rows = vec![0.0; m * m];
        for (k, x) in scale.iter().enumerate() {
            rows[k * m + k] = damping.sqrt() * x;
        }
        all.factor.push_block(&rows, &vec![0.0; m])?;
        let shared = substitute(all.factor.r(), all.factor.z());
        let mut step = Step {
            own: Vec::with_capacity(damped.len()),
            shared,
            deviations: 0.0,
        };
        let mut length = 0.0;
        for (whole, damped) in wholes.iter().zip(&damped) {
            let n = own + m;
            let mut side = damped.z()[..own].to_vec();
            for (j, x) in step.shared.iter().enumerate() {
                let column = &damped.r()[(own + j) * n..(own + j) * n + own];
                for (s, r) in side.iter_mut().zip(column) {
                    *s -= r * x;
                }
            }
            let mut triangle = Vec::with_capacity(own * own);
            for j in 0..own {
                triangle.extend_from_slice(&damped.r()[j * n..j * n + own]);
            }
            let own_step = substitute(&triangle, &side);
            let together: Vec<f64> = own_step.iter().chain(&step.shared).copied().collect();
            // the change of the residuals by the step, in standard deviations
            length += change(whole, &together);
            step.own.push(own_step);
        }
        let count = m + wholes.len() * own;
        step.deviations = (length / count.max(1) as f64).sqrt();
        Ok(step)
    }
}

/// The QR factor of one signal in one window.
struct WindowFactor {
    squares: f64,
    factor: QrFactor,
}

/// `||R x||^2`.
fn change(factor: &QrFactor, x: &[f64]) -> f64 {
    let n = x.len();
    let mut out = vec![0.0; n];
    for (column, value) in factor.r().chunks_exact(n.max(1)).zip(x) {
        for (sum, r) in out.iter_mut().zip(column) {
            *sum += r * value;
        }
    }
    out.iter().map(|x| x * x).sum()
}

/// The QR factor of all signals of a window, each with its weight.
fn combined(factors: &[QrFactor], weights: &[f64]) -> Result<QrFactor, EstimateError> {
    let labels = factors.first().map_or(&[][..], QrFactor::labels);
    let mut out = QrFactor::new(labels.to_vec());
    for (factor, weight) in factors.iter().zip(weights) {
        out.merge(&factor.scaled(*weight))?;
    }
    Ok(out)
}

/// The QR factor of the shared unknowns: the equations that remain after the elimination of the
/// windows' own unknowns.
struct Reduced {
    factor: QrFactor,
    rss: f64,
}

impl Reduced {
    fn new(labels: &[String]) -> Self {
        Self {
            factor: QrFactor::new(labels.to_vec()),
            rss: 0.0,
        }
    }

    /// Adds the rows of a window's QR factor below its own unknowns.
    fn take(&mut self, whole: &QrFactor, own: usize) -> Result<(), EstimateError> {
        let n = whole.columns();
        let mut rows = Vec::with_capacity((n - own) * (n - own));
        for column in whole.r().chunks_exact(n.max(1)).skip(own) {
            rows.extend_from_slice(&column[own..]);
        }
        self.rss += whole.rss();
        self.factor.push_block(&rows, &whole.z()[own..])
    }
}

/// The candidate after a step.
fn after_step(windows: &[Window], shared: &[f64], step: &Step) -> (Vec<Window>, Vec<f64>) {
    let shared = shared.iter().zip(&step.shared).map(|(x, d)| x + d);
    let windows = windows.iter().zip(&step.own).map(|(window, step)| {
        let mut window = window.clone();
        for (x, d) in window.own.iter_mut().zip(step) {
            *x += d;
        }
        window
    });
    (windows.collect(), shared.collect())
}

/// A divisor: 1 instead of 0.
fn unit(norm: f64) -> f64 {
    if norm > 0.0 { norm } else { 1.0 }
}

/// Solves R x = z; an unknown whose pivot is zero becomes 0.
pub(crate) fn substitute(r: &[f64], z: &[f64]) -> Vec<f64> {
    let n = z.len();
    let mut x = z.to_vec();
    for k in (0..n).rev() {
        let pivot = r[k * n + k];
        x[k] = if pivot == 0.0 { 0.0 } else { x[k] / pivot };
        let value = x[k];
        for i in 0..k {
            x[i] -= r[k * n + i] * value;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_is_divided_by_its_length_has_length_one_or_is_zero() {
        for (length, wanted) in [(0.0, 0.0), (1e-300, 1.0), (0.25, 1.0), (7.0, 1.0)] {
            let found: f64 = length / unit(length);
            assert!((found - wanted).abs() < 1e-15, "{length}");
        }
    }
}
