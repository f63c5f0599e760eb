//! The search for the unknowns of a fit on the QR factors of all efforts.

use super::GainError;
use super::payload::Load;
use super::unknowns::{GainKind, Point, Unknowns, spread};
use crate::estimate::{EstimateError, FactorSet, QrFactor, Weighting, weights_from};
use crate::qr_update::substitute;

/// A fit of the unknowns to QR factors.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) set: &'a FactorSet,
    pub(super) unknowns: &'a Unknowns,
}

/// The largest number of steps of a search at fixed weights.
const MAX_STEPS: usize = 200;
/// A search ends when a step changes no unknown by more than this part of all of them, each in
/// units of its column.
const STEP_TOLERANCE: f64 = 1e-11;
/// It ends too when the cost cannot fall by more than this part of itself.
const COST_TOLERANCE: f64 = 1e-15;
/// The first damping, and the largest one at which a search goes on.
const DAMPING: f64 = 1e-3;
const MAX_DAMPING: f64 = 1e12;
/// Damping of the linear equations of the start, which may be singular.
const START_DAMPING: f64 = 1e-9;
/// The largest number of rounds of weights.
const MAX_ROUNDS: usize = 50;
/// The weights have settled when none changes by more than this part.
const WEIGHT_TOLERANCE: f64 = 1e-9;

impl Problem<'_> {
    /// The residuals z - g R x of one effort's QR factor.
    fn residuals(&self, effort: usize, factor: &QrFactor, x: &[f64], point: &Point) -> Vec<f64> {
        let g = self.unknowns.inverse_gain(effort, point);
        let fitted = factor.times_r(x);
        let pairs = factor.z().iter().zip(&fitted);
        pairs.map(|(z, f)| z - g * f).collect()
    }

    /// The weighted sum of squared residuals.
    pub(super) fn cost(&self, point: &Point, weights: &[f64]) -> f64 {
        let x = self.unknowns.base(point);
        let factors = self.set.factors().iter().zip(weights).enumerate();
        let one = |(effort, (factor, weight)): (usize, (&QrFactor, &f64))| {
            let residuals = self.residuals(effort, factor, &x, point);
            let squares: f64 = residuals.iter().map(|r| r * r).sum();
            weight * weight * (squares + factor.rss())
        };
        factors.map(one).sum()
    }

    /// The QR factor of the residuals' derivatives by all unknowns, whose right side is the
    /// residuals.
    fn linear(&self, point: &Point, weights: &[f64]) -> Result<QrFactor, EstimateError> {
        let n = self.set.labels().len();
        let x = self.unknowns.base(point);
        let columns: Vec<Vec<Vec<f64>>> = self
            .unknowns
            .loads
            .iter()
            .zip(&point.loads)
            .map(|(load, unknown)| load.columns(unknown))
            .collect();
        let mut whole = QrFactor::new(vec![String::new(); self.unknowns.count()]);
        for (effort, (factor, weight)) in self.set.factors().iter().zip(weights).enumerate() {
            let g = self.unknowns.inverse_gain(effort, point);
            let mut block = Vec::with_capacity(n * self.unknowns.count());
            for place in &self.unknowns.robot {
                let column = factor.r().get(place * n..(place + 1) * n);
                block.extend(column.unwrap_or_default().iter().map(|r| weight * g * r));
            }
            for (load, columns) in self.unknowns.loads.iter().zip(&columns) {
                for column in columns {
                    let moved = factor.times_r(&spread(n, &load.base, column));
                    block.extend(moved.iter().map(|r| weight * g * r));
                }
            }
            let fitted = factor.times_r(&x);
            for k in 0..self.unknowns.unknown_gains() {
                let own = self.unknowns.gains.get(effort) == Some(&GainKind::Unknown(k));
                let factor = if own { *weight } else { 0.0 };
                block.extend(fitted.iter().map(|f| factor * f));
            }
            let pairs = factor.z().iter().zip(&fitted);
            let side: Vec<f64> = pairs.map(|(z, f)| weight * (z - g * f)).collect();
            whole.push_block(&block, &side)?;
        }
        Ok(whole)
    }

    /// A bound on how many standard deviations, for white residuals, any unknown changes between two
    /// points near the optimum.
    pub(super) fn deviations_between(
        &self,
        from: &Point,
        to: &Point,
        weights: &[f64],
    ) -> Result<f64, EstimateError> {
        let pairs = to.to_vec().into_iter().zip(from.to_vec());
        let step: Vec<f64> = pairs.map(|(b, a)| b - a).collect();
        let moved = self.linear(to, weights)?.times_r(&step);
        let rows: usize = self.set.factors().iter().map(QrFactor::rows).sum();
        let freedom = rows.saturating_sub(self.unknowns.count()).max(1) as f64;
        let variance = self.cost(to, weights) / freedom;
        let squares: f64 = moved.iter().map(|x| x * x).sum();
        Ok((squares / variance.max(f64::MIN_POSITIVE)).sqrt())
    }

    /// Levenberg and Marquardt's search at fixed weights: where it ended, and whether it converged.
    pub(super) fn search(
        &self,
        start: Point,
        weights: &[f64],
    ) -> Result<(Point, bool), EstimateError> {
        let mut point = start;
        let mut cost = self.cost(&point, weights);
        let mut damping = DAMPING;
        let mut sizes = vec![0.0_f64; self.unknowns.count()];
        for _ in 0..MAX_STEPS {
            if !cost.is_finite() {
                return Ok((point, false));
            }
            let linear = self.linear(&point, weights)?;
            for (size, norm) in sizes.iter_mut().zip(linear.column_norms()) {
                *size = size.max(norm);
            }
            let largest = sizes.iter().copied().fold(0.0, f64::max);
            if largest == 0.0 {
                return Ok((point, true));
            }
            let values = point.to_vec();
            loop {
                let damped = damped(&linear, &sizes, damping.sqrt(), largest)?;
                let Some(step) = substitute(damped.r(), damped.z()) else {
                    return Ok((point, false));
                };
                let scaled = |v: &[f64]| -> f64 {
                    let parts = v.iter().zip(&sizes).map(|(x, s)| (x * s).powi(2));
                    parts.sum::<f64>().sqrt()
                };
                let next = point.moved(&step);
                let next_cost = self.cost(&next, weights);
                let is_short = scaled(&step) <= STEP_TOLERANCE * scaled(&values);
                let falls = next_cost < cost;
                let is_flat = (cost - next_cost).abs() <= COST_TOLERANCE * cost;
                if falls {
                    point = next;
                    cost = next_cost;
                    damping = (damping / 10.0).max(1e-14);
                }
                if is_short || is_flat {
                    return Ok((point, true));
                }
                if falls {
                    break;
                }
                damping *= 10.0;
                if damping > MAX_DAMPING {
                    return Ok((point, false));
                }
            }
        }
        Ok((point, false))
    }

    /// The point from which gains and parameters are found by linear equations in N m and N, where
    /// a known part gives them a right side; `None` if there is none.
    fn linear_start(&self) -> Result<Option<Point>, EstimateError> {
        let n = self.set.labels().len();
        let loads: Vec<Load> = self.unknowns.loads.iter().map(Load::affine).collect();
        let mut x = self.unknowns.known.clone();
        for load in &loads {
            let zero = vec![0.0; load.unknown.len()];
            for (place, value) in load.base.iter().zip(load.values(&zero)) {
                x[*place] = value;
            }
        }
        let count: usize =
            self.unknowns.robot.len() + loads.iter().map(|l| l.unknown.len()).sum::<usize>();
        let gains = self.unknowns.unknown_gains();
        let mut whole = QrFactor::new(vec![String::new(); count + gains]);
        for (effort, factor) in self.set.factors().iter().enumerate() {
            let squares: f64 = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
            if squares == 0.0 {
                continue;
            }
            let weight = (factor.rows() as f64 / squares).sqrt();
            let mut block = Vec::with_capacity((n + 1) * (count + gains));
            // the last row is what no parameters explain
            let mut push = |column: &[f64], factor: f64, last: f64| {
                block.extend(column.iter().map(|r| factor * r));
                block.push(factor * last);
            };
            for place in &self.unknowns.robot {
                let column = factor.r().get(place * n..(place + 1) * n);
                push(column.unwrap_or_default(), weight, 0.0);
            }
            for load in &loads {
                for column in load.columns(&vec![0.0; load.unknown.len()]) {
                    let moved = factor.times_r(&spread(n, &load.base, &column));
                    push(&moved, weight, 0.0);
                }
            }
            let rest = factor.rss().sqrt();
            for k in 0..gains {
                let own = self.unknowns.gains.get(effort) == Some(&GainKind::Unknown(k));
                push(factor.z(), if own { -weight } else { 0.0 }, rest);
            }
            let known = match self.unknowns.gains.get(effort) {
                Some(GainKind::Known) => 1.0,
                Some(GainKind::Found(gain)) => *gain,
                _ => 0.0,
            };
            let fitted = factor.times_r(&x);
            let pairs = factor.z().iter().zip(&fitted);
            let mut side: Vec<f64> = pairs.map(|(z, f)| weight * (known * z - f)).collect();
            side.push(weight * known * rest);
            whole.push_block(&block, &side)?;
        }
        let sizes = whole.column_norms();
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        let damped = damped(&whole, &sizes, START_DAMPING, largest)?;
        let Some(values) = substitute(damped.r(), damped.z()) else {
            return Ok(None);
        };
        let (robot, rest) = values.split_at(self.unknowns.robot.len());
        let (mut of_loads, gains) = rest.split_at(count - self.unknowns.robot.len());
        let largest = gains.iter().fold(0.0, |m: f64, k| m.max(k.abs()));
        let is_gain = |k: &f64| k.abs() > 1e-9 * largest;
        if !gains.iter().all(is_gain) {
            return Ok(None);
        }
        let mut starts = Vec::new();
        for (affine, load) in loads.iter().zip(&self.unknowns.loads) {
            let (own, others) = of_loads.split_at(affine.unknown.len());
            of_loads = others;
            let ten = affine.inertial_parameters(own);
            starts.push(load.unknown.iter().map(|place| ten[*place]).collect());
        }
        Ok(Some(Point {
            robot: robot.to_vec(),
            loads: starts,
            inverse_gains: gains.iter().map(|k| 1.0 / k).collect(),
        }))
    }

    /// Finds the unknowns and the weights of the efforts, and whether the search converged: where
    /// nothing fixes a scale, it need not.
    pub(super) fn solve(&self, weighting: Weighting) -> Result<(Point, Vec<f64>, bool), GainError> {
        let rms = |factor: &QrFactor| {
            let squares: f64 = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
            (squares / factor.rows().max(1) as f64).sqrt()
        };
        let weights: Vec<f64> = match weighting {
            Weighting::Equal => vec![1.0; self.unknowns.gains.len()],
            Weighting::PerEffort => {
                let sizes = self.set.factors().iter().map(rms);
                sizes
                    .map(|rms| if rms > 0.0 { 1.0 / rms } else { 1.0 })
                    .collect()
            }
        };
        let plain = Point {
            robot: vec![0.0; self.unknowns.robot.len()],
            loads: self.unknowns.loads.iter().map(Load::initial).collect(),
            inverse_gains: vec![1.0; self.unknowns.unknown_gains()],
        };
        let mut point = None;
        for start in [self.linear_start()?, Some(plain)].into_iter().flatten() {
            let (reached, converged) = self.search(start, &weights)?;
            point = Some((reached, converged));
            if converged {
                break;
            }
        }
        let (point, converged) = point.ok_or(GainError::NotConverged)?;
        if !converged {
            return Ok((point, weights, false));
        }
        Ok(self.refined(point, weights, weighting)?)
    }

    /// As [`solve`](Self::solve), from a point near the solution.
    pub(super) fn solve_from(
        &self,
        start: Point,
        weighting: Weighting,
    ) -> Result<(Point, Vec<f64>, bool), EstimateError> {
        let weights = match weighting {
            Weighting::Equal => vec![1.0; self.unknowns.gains.len()],
            Weighting::PerEffort => weights_from(&self.sigmas(&start), self.set),
        };
        let (point, converged) = self.search(start, &weights)?;
        if !converged {
            return Ok((point, weights, false));
        }
        self.refined(point, weights, weighting)
    }

    /// Searches again with weights that follow from the residuals, until these settle.
    fn refined(
        &self,
        mut point: Point,
        mut weights: Vec<f64>,
        weighting: Weighting,
    ) -> Result<(Point, Vec<f64>, bool), EstimateError> {
        if weighting == Weighting::PerEffort && self.unknowns.gains.len() > 1 {
            for _ in 0..MAX_ROUNDS {
                let next = weights_from(&self.sigmas(&point), self.set);
                let pairs = next.iter().zip(&weights);
                let change = pairs.fold(0.0, |m: f64, (a, b)| m.max((a / b - 1.0).abs()));
                weights = next;
                let (reached, converged) = self.search(point, &weights)?;
                if !converged {
                    return Ok((reached, weights, false));
                }
                point = reached;
                if change < WEIGHT_TOLERANCE {
                    break;
                }
            }
        }
        Ok((point, weights, true))
    }

    /// The standard deviation of each effort's residuals, in its own unit.
    pub(super) fn sigmas(&self, point: &Point) -> Vec<f64> {
        let x = self.unknowns.base(point);
        let rows: usize = self.set.factors().iter().map(QrFactor::rows).sum();
        let free = (1.0 - self.unknowns.count() as f64 / rows.max(1) as f64).max(f64::EPSILON);
        let one = |(effort, factor): (usize, &QrFactor)| {
            let residuals = self.residuals(effort, factor, &x, point);
            let squares: f64 = residuals.iter().map(|r| r * r).sum::<f64>() + factor.rss();
            let whole: f64 = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
            let rows = factor.rows().max(1) as f64;
            // smaller residuals are rounding errors
            let least = (1e-14 * (whole / rows).sqrt()).max(f64::MIN_POSITIVE.sqrt());
            (squares / (rows * free)).sqrt().max(least)
        };
        self.set.factors().iter().enumerate().map(one).collect()
    }
}

/// A QR factor with a row for each unknown that keeps it where it is: a factor times the length of
/// its column, or times the longest where it has none.
fn damped(
    linear: &QrFactor,
    sizes: &[f64],
    factor: f64,
    largest: f64,
) -> Result<QrFactor, EstimateError> {
    let n = sizes.len();
    let mut rows = vec![0.0; n * n];
    for (k, size) in sizes.iter().enumerate() {
        rows[k * n + k] = factor * if *size > 0.0 { *size } else { largest };
    }
    let mut out = linear.clone();
    out.push_block(&rows, &vec![0.0; n])?;
    Ok(out)
}
