//! One QR factor for each effort of a robot. The factors stay separate until the noise of the
//! efforts is known, and can be stored as a file.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::factor::size;
use super::row_block::RowBlock;
use super::solution::inverse_gram;
use super::{EstimateError, QrFactor};

/// The version of the file format.
const VERSION: u32 = 1;
/// The value of the field `format` in the file.
const FORMAT: &str = "regen observation factors";
/// The size of an effort is this part of its rms at least.
const LEAST_PART: f64 = 0.1;

/// One factor per effort (a row of the regressor). The efforts stay separate, so that logs can be
/// merged first and the weights of the efforts chosen later, when the residuals are known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FactorSet {
    format: String,
    version: u32,
    /// The robot's name.
    pub robot: String,
    /// The model's digest, which differs between models that share a name; see
    /// [`digest`](crate::identify::digest).
    pub model: String,
    /// How the equations were formed: `forces` or `energy`.
    pub kind: String,
    /// Names of the efforts (joint torques or forces), one for each factor.
    pub efforts: Vec<String>,
    /// Sum of each effort over its rows, N or N m, from which its mean is computed.
    sums: Vec<f64>,
    factors: Vec<QrFactor>,
    /// What the logs tell of the errors of their estimate; `None` where they determine none, or do not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    errors: Option<LogErrors>,
}

/// The errors of the estimate from logs, which factors do not know: the order of the rows in time is gone, and so
/// is the noise of the motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogErrors {
    /// The weight of each effort that the estimate is of, 1/N or 1/(N m).
    pub weights: Vec<f64>,
    /// The covariance of the n parameters, n x n, symmetric, column-major; in a file its columns down from the
    /// diagonal.
    #[serde(with = "lower")]
    pub covariance: Vec<f64>,
    /// The degrees of freedom of each parameter's deviation.
    pub degrees_of_freedom: Vec<f64>,
    /// What is added to each parameter, since noise of the motion biases it.
    pub correction: Vec<f64>,
    /// What noise of the motion and delays move of each parameter, in its unit, see
    /// [`Intervals::bias`](crate::model::Intervals::bias).
    pub bias: Vec<f64>,
    /// The number of cosines, see [`Deviations::terms`](super::Deviations::terms).
    pub terms: usize,
    /// The number of samples.
    pub samples: usize,
    /// The number of samples that carry as much information as one independent sample.
    pub memory: f64,
}

impl LogErrors {
    fn fits(&self, parameters: usize, efforts: usize) -> bool {
        self.covariance.len() == parameters * parameters
            && self.weights.len() == efforts
            && [&self.degrees_of_freedom, &self.correction, &self.bias]
                .iter()
                .all(|own| own.len() == parameters)
    }

    fn sigma(&self, parameter: usize) -> f64 {
        let n = self.bias.len();
        let variance = self.covariance.get(parameter * n + parameter);
        variance.map_or(f64::NAN, |v| v.sqrt())
    }

    /// The errors of the estimate from the logs of two sets, whose noises are independent; `None` where the equations
    /// of both are singular.
    fn of_both(a: (&FactorSet, &Self), b: (&FactorSet, &Self)) -> Option<Self> {
        let n = a.1.bias.len();
        let rows = |set: &FactorSet, effort: usize| {
            set.factors.get(effort).map_or(0, QrFactor::rows) as f64
        };
        let pairs = a.1.weights.iter().zip(&b.1.weights).enumerate();
        let weights: Vec<f64> = pairs
            .map(|(k, (x, y))| {
                let (of_a, of_b) = (rows(a.0, k), rows(b.0, k));
                ((of_a + of_b) / (of_a / (x * x) + of_b / (y * y))).sqrt()
            })
            .collect();
        let mut whole = a.0.combined(&weights).ok()?;
        let grams = [gram(&whole), gram(&b.0.combined(&weights).ok()?)];
        whole.merge(&b.0.combined(&weights).ok()?).ok()?;
        let inverse = inverse_gram(&whole)?;
        let (mut covariance, mut correction) = (vec![0.0; n * n], vec![0.0; n]);
        let (mut variances, mut fourths) = (vec![0.0; n], vec![0.0; n]);
        for (own, gram) in [a.1, b.1].into_iter().zip(&grams) {
            // how the estimate from both moves with the one from these logs
            let map = product(&inverse, gram, n);
            let part = product(&product(&map, &own.covariance, n), &transposed(&map, n), n);
            for (k, freedom) in own.degrees_of_freedom.iter().enumerate() {
                let variance = part.get(k * n + k).copied().unwrap_or(0.0);
                variances[k] += variance;
                fourths[k] += variance * variance / freedom;
            }
            for (sum, x) in covariance.iter_mut().zip(part) {
                *sum += x;
            }
            for (row, sum) in correction.iter_mut().enumerate() {
                let column = own.correction.iter().enumerate();
                *sum += column.map(|(k, x)| map[k * n + row] * x).sum::<f64>();
            }
        }
        let samples = a.1.samples + b.1.samples;
        let memory = |own: &Self| own.memory * own.samples as f64;
        let mut out = Self {
            weights,
            covariance,
            // Welch and Satterthwaite
            degrees_of_freedom: (variances.iter().zip(&fourths))
                .map(|(v, f)| {
                    if *f > 0.0 {
                        v * v / f
                    } else {
                        f64::from(u32::MAX)
                    }
                })
                .collect(),
            correction,
            bias: Vec::new(),
            terms: a.1.terms + b.1.terms,
            samples,
            memory: (memory(a.1) + memory(b.1)) / samples.max(1) as f64,
        };
        out.bias = vec![0.0; n];
        // the same noise biases both
        out.bias = (0..n)
            .map(|k| {
                let part = |own: &Self| own.bias.get(k).map_or(0.0, |x| x / own.sigma(k));
                out.sigma(k) * part(a.1).max(part(b.1))
            })
            .collect();
        Some(out)
    }
}

/// Symmetric matrices in files: the columns down from the diagonal.
mod lower {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(matrix: &[f64], to: S) -> Result<S::Ok, S::Error> {
        let n = matrix.len().isqrt();
        let columns = matrix.chunks_exact(n.max(1)).enumerate();
        let below: Vec<f64> = columns
            .flat_map(|(k, column)| column.iter().skip(k).copied())
            .collect();
        below.serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
        let below = Vec::<f64>::deserialize(from)?;
        let n = ((8 * below.len() + 1).isqrt() - 1) / 2;
        let mut matrix = vec![0.0; n * n];
        let places = (0..n).flat_map(|k| (k..n).map(move |row| (k, row)));
        for ((k, row), value) in places.zip(&below) {
            for place in [k * n + row, row * n + k] {
                if let Some(entry) = matrix.get_mut(place) {
                    *entry = *value;
                }
            }
        }
        Ok(matrix)
    }
}

/// The Gram matrix of a factor's rows, n x n, column-major.
fn gram(factor: &QrFactor) -> Vec<f64> {
    let n = factor.columns();
    let r = factor.r();
    let column = |k: usize| r.get(k * n..(k + 1) * n).unwrap_or_default();
    let entry = |k: usize| {
        let pairs = column(k % n).iter().zip(column(k / n));
        pairs.map(|(x, y)| x * y).sum()
    };
    (0..n * n).map(entry).collect()
}

/// The product of two matrices, n x n, column-major.
fn product(left: &[f64], right: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    for (sums, column) in out
        .chunks_exact_mut(n.max(1))
        .zip(right.chunks_exact(n.max(1)))
    {
        for (own, factor) in left.chunks_exact(n.max(1)).zip(column) {
            for (sum, x) in sums.iter_mut().zip(own) {
                *sum += x * factor;
            }
        }
    }
    out
}

/// A matrix with rows for columns, n x n.
fn transposed(matrix: &[f64], n: usize) -> Vec<f64> {
    let entry = |k: usize| matrix.get(k % n * n + k / n).copied().unwrap_or(0.0);
    (0..n * n).map(entry).collect()
}

/// The robot, model and kind of equations that a [`FactorSet`] was made from: sets whose origins
/// differ cannot be merged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// The robot's name.
    pub robot: String,
    /// The model's digest.
    pub model: String,
    /// How the equations are formed: `forces` or `energy`.
    pub kind: String,
    /// Names of the efforts.
    pub efforts: Vec<String>,
    /// Labels of the parameters.
    pub labels: Vec<String>,
}

impl FactorSet {
    /// Whether another set is of the same equations.
    pub fn is_of_logs_of(&self, other: &Self) -> bool {
        let is_empty = self.factors.iter().all(|own| own.rows() == 0);
        !is_empty && self.efforts == other.efforts && self.factors == other.factors
    }

    /// A set without rows.
    pub fn new(origin: &Origin) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            robot: origin.robot.clone(),
            model: origin.model.clone(),
            kind: origin.kind.clone(),
            efforts: origin.efforts.clone(),
            sums: vec![0.0; origin.efforts.len()],
            factors: vec![QrFactor::new(origin.labels.clone()); origin.efforts.len()],
            errors: None,
        }
    }

    /// The errors of the estimate from the logs of the set; `None` where they are not known.
    pub fn errors(&self) -> Option<&LogErrors> {
        self.errors.as_ref()
    }

    /// The set with the errors of the estimate from its logs.
    ///
    /// # Errors
    /// When their sizes are not those of the set.
    pub fn with_errors(self, errors: Option<LogErrors>) -> Result<Self, EstimateError> {
        if let Some(own) = &errors
            && !own.fits(self.labels().len(), self.efforts.len())
        {
            size("errors", self.labels().len(), own.bias.len())?;
            size("weights", self.efforts.len(), own.weights.len())?;
            size(
                "covariance",
                self.labels().len().pow(2),
                own.covariance.len(),
            )?;
        }
        Ok(Self { errors, ..self })
    }

    /// Whether there are no rows.
    fn is_empty(&self) -> bool {
        self.factors.iter().all(|own| own.rows() == 0)
    }

    /// The factors, one for each effort.
    pub fn factors(&self) -> &[QrFactor] {
        &self.factors
    }

    /// The labels of the parameters.
    pub fn labels(&self) -> &[String] {
        self.factors.first().map_or(&[], QrFactor::labels)
    }

    /// The mean of each effort, N or N m; 0 where there are no rows.
    pub fn means(&self) -> Vec<f64> {
        let mean = |(sum, factor): (&f64, &QrFactor)| sum / factor.rows().max(1) as f64;
        self.sums.iter().zip(&self.factors).map(mean).collect()
    }

    /// For each effort, the rms of its residuals over its own about its mean, percent; over a tenth of its rms if that
    /// is more, as for one that is a weight. NaN where there are no rows.
    ///
    /// - `values`: the parameters, SI.
    ///
    /// # Errors
    /// When the number of parameters does not fit.
    ///
    /// ```
    /// use regen_identify::estimate::{Accumulator, Origin};
    ///
    /// let origin = Origin {
    ///     robot: "lift".to_owned(),
    ///     model: String::new(),
    ///     kind: "forces".to_owned(),
    ///     efforts: vec!["q1".to_owned(), "q2".to_owned()],
    ///     labels: vec!["m".to_owned()],
    /// };
    /// let mut rows = Accumulator::new(&origin);
    /// for (moving, weight) in [(1.0, 5.0), (3.0, 5.0)] {
    ///     rows.push(0, &[1.0], 1, moving, 1.0)?;
    ///     rows.push(1, &[1.0], 1, weight, 1.0)?;
    /// }
    /// let errors = rows.finish()?.relative_errors(&[2.0])?;
    /// assert!((errors[0] - 100.0).abs() < 1e-9);
    /// assert!((errors[1] - 600.0).abs() < 1e-9);
    /// # Ok::<(), regen_identify::estimate::EstimateError>(())
    /// ```
    pub fn relative_errors(&self, values: &[f64]) -> Result<Vec<f64>, EstimateError> {
        let none = vec![0.0; values.len()];
        let one = |(mean, factor): (f64, &QrFactor)| {
            let whole = factor.squared_residual(&none)?;
            let about_mean = whole - factor.rows() as f64 * mean * mean;
            let size = about_mean.max(LEAST_PART * LEAST_PART * whole);
            Ok(100.0 * (factor.squared_residual(values)? / size).sqrt())
        };
        self.means()
            .into_iter()
            .zip(&self.factors)
            .map(one)
            .collect()
    }

    /// Adds the rows of another set.
    ///
    /// # Errors
    /// When the other set differs in robot, model, kind, efforts or parameters.
    pub fn merge(&mut self, other: &Self) -> Result<(), EstimateError> {
        for (what, left, right) in [
            ("robots", &self.robot, &other.robot),
            ("models", &self.model, &other.model),
            ("kinds of observation", &self.kind, &other.kind),
        ] {
            same(what, left, right)?;
        }
        same("efforts", &self.efforts.join(" "), &other.efforts.join(" "))?;
        self.errors = match (&self.errors, &other.errors) {
            (Some(a), Some(b)) => LogErrors::of_both((self, a), (other, b)),
            (own, None) if other.is_empty() => own.clone(),
            (None, other) if self.is_empty() => other.clone(),
            _ => None,
        };
        for (sum, more) in self.sums.iter_mut().zip(&other.sums) {
            *sum += more;
        }
        for (factor, more) in self.factors.iter_mut().zip(&other.factors) {
            factor.merge(more)?;
        }
        Ok(())
    }

    /// Merges any number of sets; the same sets give the same bits in any order.
    ///
    /// # Errors
    /// When `sets` is empty, or two sets cannot be merged.
    pub fn merged(mut sets: Vec<Self>) -> Result<Self, EstimateError> {
        sets.sort_by(Self::order);
        let mut sets = sets.into_iter();
        let mut first = sets.next().ok_or(EstimateError::TooShort {
            rows: 0,
            parameters: 0,
            labels: Vec::new(),
            resting: 0,
        })?;
        for set in sets {
            first.merge(&set)?;
        }
        Ok(first)
    }

    /// A total order of sets: by their number of rows, then by the entries of their factors.
    fn order(a: &Self, b: &Self) -> core::cmp::Ordering {
        let rows = |set: &Self| set.factors.iter().map(QrFactor::rows).sum::<usize>();
        let numbers = |set: &Self| -> Vec<f64> {
            let factors = set.factors.iter();
            factors
                .flat_map(|f| {
                    f.z()
                        .iter()
                        .chain(f.r())
                        .chain([&f.rss()])
                        .copied()
                        .collect::<Vec<_>>()
                })
                .collect()
        };
        rows(a).cmp(&rows(b)).then_with(|| {
            let (a, b) = (numbers(a), numbers(b));
            let pairs = a.iter().zip(&b).map(|(x, y)| x.total_cmp(y));
            pairs
                .into_iter()
                .find(|o| o.is_ne())
                .unwrap_or(core::cmp::Ordering::Equal)
        })
    }

    /// Merges all efforts into one factor, the rows of each effort multiplied by its weight
    /// (1/sigma).
    ///
    /// # Errors
    /// When the number of weights differs from the number of efforts.
    pub fn combined(&self, weights: &[f64]) -> Result<QrFactor, EstimateError> {
        size("weights", self.factors.len(), weights.len())?;
        let mut whole = QrFactor::new(self.labels().to_vec());
        for (factor, weight) in self.factors.iter().zip(weights) {
            whole.merge(&factor.scaled(*weight))?;
        }
        Ok(whole)
    }

    /// Writes the set as the text of a file: JSON, with numbers that read back to the same doubles.
    pub fn to_text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }

    /// Reads a set from the text of a file.
    ///
    /// # Errors
    /// When the text is not a set of factors of this version; errors of syntax give line and
    /// column.
    pub fn from_text(text: &str) -> Result<Self, FileError> {
        let set: Self =
            serde_json::from_str(text).map_err(|error| FileError(format!("{error}")))?;
        if set.format != FORMAT || set.version != VERSION {
            return Err(FileError(format!(
                "is `{}` version {}, not `{FORMAT}` version {VERSION}",
                set.format, set.version
            )));
        }
        for (names, what) in [(&set.efforts[..], "effort"), (set.labels(), "label")] {
            if let Some(name) = repeated(names) {
                return Err(FileError(format!("has the {what} `{name}` twice")));
            }
        }
        let labels = set.labels();
        let errors = set.errors.as_ref();
        if errors.is_some_and(|own| !own.fits(labels.len(), set.efforts.len())) {
            return Err(FileError(
                "has errors of other parameters or efforts".to_owned(),
            ));
        }
        let fits = set.factors.len() == set.efforts.len()
            && set.sums.len() == set.efforts.len()
            && set.factors.iter().all(|f| f.labels() == labels);
        if !fits {
            return Err(FileError(
                "has not one factor of the same labels for each effort".to_owned(),
            ));
        }
        Ok(set)
    }
}

/// A name that is given more than once.
fn repeated(names: &[String]) -> Option<&String> {
    let mut seen = std::collections::BTreeSet::new();
    names.iter().find(|name| !seen.insert(*name))
}

fn same(what: &'static str, left: &str, right: &str) -> Result<(), EstimateError> {
    if left == right {
        return Ok(());
    }
    Err(EstimateError::Mismatch {
        what,
        left: left.to_owned(),
        right: right.to_owned(),
    })
}

/// Why a text is not a set of factors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError(String);

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for FileError {}

/// Collects rows sample by sample and reduces them in blocks that fit a cache.
///
/// ```
/// use regen_identify::estimate::{Accumulator, Estimate, Origin, Weighting};
///
/// let origin = Origin {
///     robot: "slide".to_owned(),
///     model: String::new(),
///     kind: "forces".to_owned(),
///     efforts: vec!["q1".to_owned()],
///     labels: vec!["m".to_owned()],
/// };
/// let mut rows = Accumulator::new(&origin);
/// for (acceleration, force) in [(1.0, 2.1), (2.0, 3.9), (3.0, 6.0)] {
///     rows.push(0, &[acceleration], 1, force, 1.0)?;
/// }
/// let estimate = Estimate::new(&rows.finish()?, Weighting::default())?;
/// assert!((estimate.values[0] - 27.9 / 14.0).abs() < 1e-12);
/// # Ok::<(), regen_identify::estimate::EstimateError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Accumulator {
    set: FactorSet,
    /// The rows of each effort that are not yet reduced.
    pending: Vec<RowBlock>,
}

impl Accumulator {
    /// Starts with a set without rows.
    pub fn new(origin: &Origin) -> Self {
        Self {
            set: FactorSet::new(origin),
            pending: vec![RowBlock::new(origin.labels.len()); origin.efforts.len()],
        }
    }

    /// Adds one row of one effort.
    ///
    /// - `entries`: the row, one entry per parameter, read with a stride: entry j is
    ///   `entries[j * stride]`;
    /// - `tau`: the effort, N or N m; `weight`: the factor that row and effort are multiplied by
    ///   (1/sigma).
    ///
    /// # Errors
    /// When there is no such effort, the length does not fit, or an entry is not finite.
    pub fn push(
        &mut self,
        effort: usize,
        entries: &[f64],
        stride: usize,
        tau: f64,
        weight: f64,
    ) -> Result<(), EstimateError> {
        let n = self.set.labels().len();
        let got = self.pending.len();
        let Some(block) = self.pending.get_mut(effort) else {
            return Err(EstimateError::Size {
                what: "effort",
                expected: got,
                got: effort + 1,
            });
        };
        let stride = stride.max(1);
        size("row", n, entries.len().div_ceil(stride).min(n))?;
        let row = entries.chunks(stride).map(|column| column[0] * weight);
        block.push(row, tau * weight);
        self.set.sums[effort] += tau;
        if block.is_full() {
            block.flush(&mut self.set.factors[effort])?;
        }
        Ok(())
    }

    /// Reduces the rows that are still pending and returns the set.
    ///
    /// # Errors
    /// When an entry is not finite.
    pub fn finish(mut self) -> Result<FactorSet, EstimateError> {
        for (block, factor) in self.pending.iter_mut().zip(&mut self.set.factors) {
            block.flush(factor)?;
        }
        Ok(self.set)
    }
}
