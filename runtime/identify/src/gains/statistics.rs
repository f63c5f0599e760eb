//! The result of a fit: rank at the solution, deviations, gains and payloads.

use super::payload::{Load, Told};
use super::problem::{GainKind, Point, Problem, spread};
use super::rows::{Rows, Sample};
use super::{Free, GainError, GainFit, GainOptions, Plan, in_si};
use crate::data::DataError;
use crate::estimate::{
    Autoregression, Blocks, Deviations, Estimate, EstimateError, ORDER, QrFactor, Residuals,
    Scores, quantile,
};
use crate::identify::Source;
use crate::model::{
    Covariance, Gain, IdentifiedModel, IdentifiedPayload, Interval, Intervals, PayloadValue,
};
use crate::qr_update::substitute;
use crate::session::describe;
use crate::status::EffortContributions;
use regen_runtime::BaseModel;

/// Singular values below this part of the largest, columns scaled, count as zero: a scale that
/// nothing fixes is one of the equations themselves, and zero up to rounding.
const RANK_TOLERANCE: f64 = 1e-11;
/// Entries of a direction below this part of the largest, columns scaled, take no part in it.
const LEAST_PART: f64 = 1e-6;

/// A solved fit, of which the deviations are computed.
pub(super) struct Solved<'a> {
    pub(super) problem: &'a Problem<'a>,
    pub(super) point: &'a Point,
    pub(super) weights: &'a [f64],
    /// The places of the robot's base parameters, also where they are known.
    pub(super) of_robot: &'a [usize],
    pub(super) plan: &'a Plan,
    pub(super) options: &'a GainOptions,
}

/// An unknown of the linearised equations.
#[derive(Clone, Copy, PartialEq)]
enum Column {
    /// A base parameter of the robot, by its place.
    Robot(usize),
    /// An unknown of a payload: the payload, and its unknown.
    Load(usize, usize),
    /// The gain k of an effort.
    Gain(usize),
}

impl Column {
    fn is_gain(self) -> bool {
        matches!(self, Self::Gain(_))
    }
}

/// The linearised equations: what the entries of a row are made of.
struct Linear<'a> {
    solved: &'a Solved<'a>,
    columns: Vec<Column>,
    /// The derivatives of each payload's base parameters by its unknowns.
    of_loads: Vec<Vec<Vec<f64>>>,
    x: Vec<f64>,
}

impl Linear<'_> {
    fn inverse_gain(&self, effort: usize) -> f64 {
        self.solved.problem.inverse_gain(effort, self.solved.point)
    }

    fn load(&self, load: usize, unknown: usize) -> (&Load, &[f64]) {
        let column = &self.of_loads[load][unknown];
        (&self.solved.problem.loads[load], column)
    }

    /// The combination of base parameters that a column is for an effort.
    fn combination(&self, column: Column, effort: usize) -> Vec<f64> {
        let n = self.x.len();
        let g = self.inverse_gain(effort);
        match column {
            Column::Robot(place) => spread(n, &[place], &[g]),
            Column::Load(load, unknown) => {
                let (load, column) = self.load(load, unknown);
                let scaled: Vec<f64> = column.iter().map(|a| g * a).collect();
                spread(n, &load.base, &scaled)
            }
            Column::Gain(of) if of == effort => self.x.iter().map(|x| -g * g * x).collect(),
            Column::Gain(_) => vec![0.0; n],
        }
    }

    fn value(&self, column: Column) -> f64 {
        match column {
            Column::Robot(place) => self.x[place],
            Column::Load(load, unknown) => self.solved.point.loads[load][unknown],
            Column::Gain(effort) => 1.0 / self.inverse_gain(effort),
        }
    }

    fn label(&self, column: Column, labels: &[String], efforts: &[String]) -> String {
        match column {
            Column::Robot(place) => labels[place].clone(),
            Column::Load(load, unknown) => {
                let load = &self.solved.problem.loads[load];
                let symbol = regen_runtime::Symbol::INERTIAL[load.unknown[unknown]];
                format!("{}({})", symbol.name(), load.known.body)
            }
            Column::Gain(effort) => Covariance::gain(&efforts[effort]),
        }
    }

    /// The weighted triangle of the linearised equations, whose solution is the values of the
    /// columns.
    fn factor(&self, columns: &[Column], labels: Vec<String>) -> Result<QrFactor, EstimateError> {
        let set = self.solved.problem.set;
        let mut whole = QrFactor::new(labels.clone());
        for (effort, factor) in set.factors().iter().enumerate() {
            let g = self.inverse_gain(effort);
            // z - g R x + J values
            let mut target: Vec<f64> = self.x.iter().map(|x| -g * x).collect();
            let mut all = Vec::with_capacity(columns.len() * self.x.len());
            for column in columns {
                let own = self.combination(*column, effort);
                let value = self.value(*column);
                for (sum, t) in target.iter_mut().zip(&own) {
                    *sum += t * value;
                }
                all.extend(own);
            }
            let moved = factor.times_r(&target);
            let side = factor.z().iter().zip(&moved).map(|(z, m)| z + m).collect();
            let moved = QrFactor::from_parts(
                factor.labels().to_vec(),
                factor.r().to_vec(),
                side,
                factor.rss(),
                factor.rows(),
            )?;
            let own = moved.transformed(labels.clone(), &all)?;
            whole.merge(&own.scaled(self.solved.weights[effort]))?;
        }
        Ok(whole)
    }

    /// The entries of a sample's rows in these columns, efforts x columns, column-major; and the
    /// predicted efforts in the units in which they were measured.
    fn rows(&self, sample: &Sample<'_>, out: &mut Vec<f64>, fitted: &mut Vec<f64>) {
        let efforts = sample.measured.len();
        let entry = |place: usize, effort: usize| sample.w[place * efforts + effort];
        out.clear();
        fitted.clear();
        fitted.extend((0..efforts).map(|effort| {
            let terms = self.x.iter().enumerate();
            self.inverse_gain(effort) * terms.map(|(k, x)| entry(k, effort) * x).sum::<f64>()
        }));
        for column in &self.columns {
            for (effort, predicted) in fitted.iter().enumerate() {
                let g = self.inverse_gain(effort);
                out.push(match *column {
                    Column::Robot(place) => g * entry(place, effort),
                    Column::Load(load, unknown) => {
                        let (load, column) = self.load(load, unknown);
                        let terms = load.base.iter().zip(column);
                        g * terms.map(|(k, a)| entry(*k, effort) * a).sum::<f64>()
                    }
                    Column::Gain(of) if of == effort => -g * predicted,
                    Column::Gain(_) => 0.0,
                });
            }
        }
    }
}

impl Solved<'_> {
    fn linear(&self) -> Linear<'_> {
        let (problem, point) = (self.problem, self.point);
        let mut columns: Vec<Column> = problem.robot.iter().map(|k| Column::Robot(*k)).collect();
        let mut of_loads = Vec::new();
        for (k, (load, unknown)) in problem.loads.iter().zip(&point.loads).enumerate() {
            of_loads.push(load.columns(unknown));
            let independent = load.independent(unknown).into_iter();
            columns.extend(independent.map(|j| Column::Load(k, j)));
        }
        let gains = problem.gains.iter().enumerate();
        let unknown = gains.filter(|(_, kind)| matches!(kind, GainKind::Unknown(_)));
        columns.extend(unknown.map(|(effort, _)| Column::Gain(effort)));
        Linear {
            solved: self,
            columns,
            of_loads,
            x: problem.base(point),
        }
    }

    /// The rank at the solution, the deviations, and the result.
    pub(super) fn finish<M, S>(&self, rows: &mut Rows<'_, M, S>) -> Result<GainFit, GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let linear = self.linear();
        let (set, efforts) = (self.problem.set, rows.efforts.clone());
        let label = |column: &Column| linear.label(*column, set.labels(), &efforts);
        let labels: Vec<String> = linear.columns.iter().map(label).collect();
        let factor = linear.factor(&linear.columns, labels)?;
        require_rank(&linear, &factor)?;
        let mut estimate = Estimate::of(&factor)?;
        let gains: Vec<f64> = (0..efforts.len())
            .map(|effort| 1.0 / linear.inverse_gain(effort))
            .collect();
        let (errors, noise) = self.residuals(&linear, rows, &gains)?;
        let blocks = self.scores(&linear, rows, &noise, &estimate.values)?;
        let all: Vec<usize> = (0..linear.columns.len()).collect();
        let mut deviations = blocks.deviations(&factor, &all, &estimate.values, 1.0)?;
        let of_robot = self.of_robot(&linear, &factor, &efforts)?;
        let is_robot_exact = self.plan.robot.is_some() && of_robot.is_none();
        if let Some(more) = of_robot {
            for matrix in [&mut deviations.covariance, &mut estimate.covariance] {
                for (sum, x) in matrix.iter_mut().zip(&more) {
                    *sum += x;
                }
            }
        }
        let sigmas = self.problem.sigmas(self.point);
        let fits = efforts.iter().zip(set.factors()).zip(&sigmas);
        estimate.efforts = fits
            .zip(&gains)
            .map(|(((name, factor), sigma), gain)| in_si(name, factor.rows(), *sigma, *gain))
            .collect();
        let uncertainty = Uncertainty {
            estimate: &estimate,
            deviations: &deviations,
            confidence: self.options.confidence,
        };
        let exact = if is_robot_exact {
            "; the robot's parameters taken as exact"
        } else {
            ""
        };
        let method = format!(
            "least squares in units of measurement, {}{exact}",
            describe(&deviations)
        );
        let model = self.model(&linear, &uncertainty, &efforts, method);
        #[allow(clippy::cast_sign_loss, reason = "it is at least 1")]
        let bandwidth = blocks.correlation_length().round() as usize;
        Ok(GainFit {
            model,
            shares: self.shares(&linear)?,
            relative_absolute: errors.relative_absolute(),
            errors: errors.efforts(),
            estimate,
            deviations,
            bandwidth,
            left_out: rows.left_out(),
            is_robot_exact,
        })
    }

    /// The residuals in SI, and the noise of each effort's weighted residuals.
    fn residuals<M, S>(
        &self,
        linear: &Linear<'_>,
        rows: &mut Rows<'_, M, S>,
        gains: &[f64],
    ) -> Result<(Residuals, Vec<Autoregression>), GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let names = rows.efforts.clone();
        let means = self.problem.set.means();
        let means: Vec<f64> = means.iter().zip(gains).map(|(m, k)| m * k).collect();
        let mut errors = Residuals::new(&names, &means, self.options.lags);
        let zeros = vec![0.0; names.len()];
        let mut noise = Residuals::new(&names, &zeros, ORDER);
        let (mut out, mut fitted) = (Vec::new(), Vec::new());
        rows.visit(&mut |sample| {
            if !sample.follows {
                errors.interrupt();
                noise.interrupt();
            }
            linear.rows(sample, &mut out, &mut fitted);
            let used: Vec<bool> = sample.weights.iter().map(|w| *w > 0.0).collect();
            let psi = self.psi(sample, &fitted);
            let si = |values: &[f64]| -> Vec<f64> {
                values.iter().zip(gains).map(|(x, k)| x * k).collect()
            };
            errors.push_used(&si(sample.measured), &si(&fitted), &used)?;
            noise.push_used(&psi, &zeros, &used)
        })?;
        let noise = noise.efforts();
        let fits = noise
            .iter()
            .map(|e| Autoregression::fit(e.rms * e.rms, &e.autocorrelation, e.samples));
        Ok((errors, fits.collect()))
    }

    /// The weighted residuals of a sample.
    fn psi(&self, sample: &Sample<'_>, fitted: &[f64]) -> Vec<f64> {
        let pairs = sample.measured.iter().zip(fitted);
        let factors = sample.weights.iter().zip(self.weights);
        pairs
            .zip(factors)
            .map(|((i, f), (own, effort))| (i - f) * own * effort)
            .collect()
    }

    /// The scores of the linearised equations.
    fn scores<M, S>(
        &self,
        linear: &Linear<'_>,
        rows: &mut Rows<'_, M, S>,
        noise: &[Autoregression],
        values: &[f64],
    ) -> Result<Blocks, GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let mut scores = Scores::new(linear.columns.len(), noise);
        let (mut out, mut fitted) = (Vec::new(), Vec::new());
        let slopes = vec![1.0; self.weights.len()];
        rows.visit(&mut |sample| {
            if !sample.follows {
                scores.interrupt();
            }
            linear.rows(sample, &mut out, &mut fitted);
            let psi = self.psi(sample, &fitted);
            let pairs = sample.weights.iter().zip(self.weights);
            let weights: Vec<f64> = pairs.map(|(own, effort)| own * effort).collect();
            scores.push(&out, &weights, &psi, &slopes)
        })?;
        Ok(scores.finish(values)?)
    }

    /// The covariance of the unknowns that comes from that of a known robot; `None` where it is not
    /// known or nothing of the robot is.
    fn of_robot(
        &self,
        linear: &Linear<'_>,
        factor: &QrFactor,
        efforts: &[String],
    ) -> Result<Option<Vec<f64>>, EstimateError> {
        let robot = self.plan.robot.as_ref();
        let Some(covariance) = robot.and_then(|robot| robot.covariance.as_ref()) else {
            return Ok(None);
        };
        let mut fixed: Vec<Column> = self.of_robot.iter().map(|k| Column::Robot(*k)).collect();
        let gains = self.problem.gains.iter().enumerate();
        let found = gains.filter(|(_, kind)| matches!(kind, GainKind::Found(_)));
        fixed.extend(found.map(|(effort, _)| Column::Gain(effort)));
        let set = self.problem.set;
        let label = |column: &Column| linear.label(*column, set.labels(), efforts);
        let columns: Vec<Column> = linear.columns.iter().chain(&fixed).copied().collect();
        let labels: Vec<String> = columns.iter().map(label).collect();
        let places: Vec<Option<usize>> = fixed
            .iter()
            .map(|column| covariance.place(&label(column)))
            .collect();
        let whole = linear.factor(&columns, labels)?;
        // the first columns of the triangle are those of the unknowns alone
        let (n, m) = (factor.columns(), columns.len());
        let top = |column: usize| whole.r().get(column * m..column * m + n);
        let own: Vec<f64> = (0..n)
            .flat_map(|k| top(k).unwrap_or_default())
            .copied()
            .collect();
        let mut moved = Vec::with_capacity(fixed.len());
        for k in 0..fixed.len() {
            let step = substitute(&own, top(n + k).unwrap_or_default());
            moved.push(step.ok_or(EstimateError::NoConvergence)?);
        }
        let mut out = vec![0.0; n * n];
        for (a, first) in moved.iter().enumerate() {
            for (b, second) in moved.iter().enumerate() {
                let (Some(i), Some(j)) = (places[a], places[b]) else {
                    continue;
                };
                let own = covariance.entry(i, j);
                for (row, x) in out.chunks_exact_mut(n.max(1)).zip(first) {
                    for (sum, y) in row.iter_mut().zip(second) {
                        *sum += x * own * y;
                    }
                }
            }
        }
        Ok(Some(out))
    }

    /// The contributions of all base parameters to the measured efforts.
    fn shares(&self, linear: &Linear<'_>) -> Result<EffortContributions, EstimateError> {
        let set = self.problem.set;
        let mut whole = QrFactor::new(set.labels().to_vec());
        for (effort, factor) in set.factors().iter().enumerate() {
            let g = linear.inverse_gain(effort);
            // the sign of a gain does not matter, that of the diagonal is kept
            let r = factor.r().iter().map(|r| g.abs() * r).collect();
            let z = factor.z().iter().map(|z| g.signum() * z).collect();
            let (rss, rows) = (factor.rss(), factor.rows());
            let own = QrFactor::from_parts(set.labels().to_vec(), r, z, rss, rows)?;
            whole.merge(&own.scaled(self.weights[effort]))?;
        }
        Ok(EffortContributions::of(&whole))
    }

    /// The identified model.
    fn model(
        &self,
        linear: &Linear<'_>,
        uncertainty: &Uncertainty<'_>,
        efforts: &[String],
        method: String,
    ) -> IdentifiedModel {
        let columns = &linear.columns;
        let n = linear.x.len();
        // the gradient of each base parameter by the columns; nothing, or 0, where it is known
        let mut gradients: Vec<Vec<f64>> = vec![Vec::new(); n];
        for (k, column) in columns.iter().enumerate() {
            let mut add = |place: usize, by: f64| {
                let own = &mut gradients[place];
                own.resize(columns.len(), 0.0);
                own[k] = by;
            };
            match *column {
                Column::Robot(place) => add(place, 1.0),
                Column::Load(load, unknown) => {
                    let (load, slopes) = linear.load(load, unknown);
                    for (place, slope) in load.base.iter().zip(slopes) {
                        add(*place, *slope);
                    }
                }
                Column::Gain(_) => {}
            }
        }
        let before = self.plan.robot.as_ref().and_then(|r| r.covariance.as_ref());
        let labels = self.problem.set.labels();
        let base = gradients.iter().enumerate().map(|(k, gradient)| {
            let value = linear.x[k];
            if gradient.iter().any(|g| *g != 0.0) {
                return uncertainty.interval(value, gradient);
            }
            let covariance = before.filter(|_| self.of_robot.contains(&k))?;
            let place = covariance.place(&labels[k])?;
            let sigma = covariance.entry(place, place).sqrt();
            let half = quantile(f64::INFINITY, self.options.confidence) * sigma;
            Some(Interval {
                sigma,
                sigma_white: f64::NAN,
                low: value - half,
                high: value + half,
            })
        });
        let base: Vec<Option<Interval>> = base.collect();
        let mut gains = Vec::new();
        for (effort, kind) in self.problem.gains.iter().enumerate() {
            let value = 1.0 / linear.inverse_gain(effort);
            let place = columns.iter().position(|c| *c == Column::Gain(effort));
            let interval = place.and_then(|place| {
                let mut gradient = vec![0.0; columns.len()];
                gradient[place] = 1.0;
                uncertainty.interval(value, &gradient)
            });
            if *kind != GainKind::Known {
                gains.push(Gain {
                    effort: efforts[effort].clone(),
                    value,
                    interval,
                });
            }
        }
        let payloads = self.problem.loads.iter().zip(&self.point.loads).enumerate();
        let payloads = payloads.map(|(load, (own, unknown))| {
            let values = own.told(unknown).into_iter().map(|told: Told| {
                let gradient = columns.iter().map(|column| match *column {
                    Column::Load(of, k) if of == load => told.slope[k],
                    _ => 0.0,
                });
                let gradient: Vec<f64> = gradient.collect();
                let interval = uncertainty.interval(told.value, &gradient);
                PayloadValue {
                    name: told.name.to_owned(),
                    unit: told.unit.to_owned(),
                    value: told.value,
                    is_known: told.known,
                    interval: interval.filter(|_| !told.known),
                }
            });
            IdentifiedPayload {
                body: own.known.body.clone(),
                values: values.collect(),
            }
        });
        let covariance = self.plan.robot.is_none().then(|| {
            let mut of = gradients.clone();
            let mut names = labels.to_vec();
            for (k, column) in columns.iter().enumerate() {
                if let Column::Gain(effort) = *column {
                    let mut gradient = vec![0.0; columns.len()];
                    gradient[k] = 1.0;
                    of.push(gradient);
                    names.push(Covariance::gain(&efforts[effort]));
                }
            }
            uncertainty.covariance(names, &of)
        });
        IdentifiedModel {
            name: "least squares with gains and payloads".to_owned(),
            beta: linear.x.clone(),
            feasibility: "not judged".to_owned(),
            intervals: Intervals {
                base,
                method,
                ..Intervals::default()
            },
            gains,
            payloads: payloads.collect(),
            covariance,
            ..IdentifiedModel::default()
        }
    }
}

/// The covariance of the unknowns.
struct Uncertainty<'a> {
    estimate: &'a Estimate,
    deviations: &'a Deviations,
    confidence: f64,
}

impl Uncertainty<'_> {
    /// The interval of a value with this gradient by the unknowns; `None` where it is not finite.
    fn interval(&self, value: f64, gradient: &[f64]) -> Option<Interval> {
        let sigma = form(&self.deviations.covariance, gradient, gradient).sqrt();
        let freedom = self.deviations.degrees_of_freedom.iter().zip(gradient);
        let freedom = freedom.filter(|(_, g)| **g != 0.0).map(|(f, _)| *f);
        let half = quantile(freedom.fold(f64::INFINITY, f64::min), self.confidence) * sigma;
        (sigma.is_finite() && half.is_finite()).then(|| Interval {
            sigma,
            sigma_white: form(&self.estimate.covariance, gradient, gradient).sqrt(),
            low: value - half,
            high: value + half,
        })
    }

    /// The covariance of values with these gradients; 0 where a gradient is empty.
    fn covariance(&self, labels: Vec<String>, gradients: &[Vec<f64>]) -> Covariance {
        let mut values = Vec::with_capacity(gradients.len() * gradients.len());
        for a in gradients {
            values.extend(
                gradients
                    .iter()
                    .map(|b| form(&self.deviations.covariance, a, b)),
            );
        }
        Covariance { labels, values }
    }
}

/// a^T C b.
fn form(covariance: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().max(b.len()).max(1);
    let rows = covariance.chunks_exact(n).zip(a);
    rows.filter(|(_, x)| **x != 0.0)
        .map(|(row, x)| x * row.iter().zip(b).map(|(c, y)| c * y).sum::<f64>())
        .sum()
}

/// Returns an error that names the directions which the equations leave open.
fn require_rank(linear: &Linear<'_>, factor: &QrFactor) -> Result<(), GainError> {
    let spectrum = factor.spectrum()?;
    let n = factor.columns();
    let mut null = spectrum.null_directions(RANK_TOLERANCE);
    if null.is_empty() {
        return Ok(());
    }
    // gains first, so that each direction is the scale of as few gains as possible
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|k| !linear.columns[*k].is_gain());
    let mut done = 0;
    for column in order {
        let size = |direction: &Vec<f64>| direction[column].abs();
        let rest = null.iter().enumerate().skip(done);
        let Some(best) = rest.max_by(|a, b| size(a.1).total_cmp(&size(b.1))) else {
            break;
        };
        let (best, largest) = (best.0, size(best.1));
        if largest < LEAST_PART {
            continue;
        }
        null.swap(done, best);
        let pivot = null[done].clone();
        for (k, direction) in null.iter_mut().enumerate() {
            if k != done {
                let factor = direction[column] / pivot[column];
                for (x, p) in direction.iter_mut().zip(&pivot) {
                    *x -= factor * p;
                }
            }
        }
        done += 1;
    }
    let free = null.iter().map(|direction| {
        let largest = direction.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let part = |k: &usize| direction[*k].abs() > LEAST_PART * largest;
        let mut places: Vec<usize> = (0..n).filter(part).collect();
        places.sort_by_key(|k| !linear.columns[*k].is_gain());
        Free {
            names: places.iter().map(|k| factor.labels()[*k].clone()).collect(),
            is_scale: places.iter().any(|k| linear.columns[*k].is_gain()),
        }
    });
    Err(GainError::Undetermined {
        rank: n - null.len(),
        unknowns: n,
        free: free.collect(),
    })
}
