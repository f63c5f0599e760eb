//! The criteria of exciting trajectories, as functions of the observation matrix.

use regen_identify::SingularValues;

/// The criterion that the search optimises.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Criterion {
    /// Minimises the condition number of `W_red` with its columns scaled to unit length (Eq. 24,
    /// 27).
    #[default]
    ScaledCondition,
    /// Minimises the condition number of `W_red` without scaling (Eq. 24).
    Condition,
    /// Minimises `-log det(W^T Sigma^-1 W)` (Eq. 26), Sigma the diagonal matrix of the efforts'
    /// variances.
    Determinant,
    /// Maximises the smallest singular value of `W_red`.
    SmallestSingular,
}

/// The values of all criteria for one observation matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// The condition number with columns scaled to unit length (Eq. 27).
    pub scaled_condition: f64,
    /// The condition number (Eq. 24).
    pub condition: f64,
    /// `-log det(W^T Sigma^-1 W)` (Eq. 26).
    pub determinant: f64,
    /// The smallest singular value.
    pub smallest_singular: f64,
}

/// The value of an objective, and its derivatives by the entries of W.
#[derive(Clone, Debug)]
pub(super) struct Objective {
    pub(super) value: f64,
    /// The derivatives, column-major as W.
    pub(super) slope: Vec<f64>,
}

/// The Euclidean length of each column; 1 for a zero column.
fn column_lengths(w: &[f64], rows: usize) -> Vec<f64> {
    let columns = w.chunks_exact(rows.max(1));
    columns
        .map(|column| {
            let length = column.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length > 0.0 { length } else { 1.0 }
        })
        .collect()
}

/// The matrix with each column divided by its length.
fn scaled(w: &[f64], rows: usize, lengths: &[f64]) -> Vec<f64> {
    let columns = w.chunks_exact(rows.max(1)).zip(lengths);
    columns
        .flat_map(|(column, length)| column.iter().map(move |x| x / length))
        .collect()
}

impl Criterion {
    /// The smooth objective that the search minimises: the logarithm of the condition number, with
    /// the largest and the smallest singular values replaced by the means `(sum s_i^2p)^(1/2p)` and
    /// `(sum s_i^-2p)^(-1/2p)`, which are smooth where singular values coincide and tend to the
    /// largest and the smallest value as `sharpness` p grows; or -log of the smallest value,
    /// replaced likewise.
    ///
    /// - `w`: n columns, column-major; its rows divided by the efforts' standard deviations if
    ///   the criterion [weights](Self::is_weighted) them.
    pub(super) fn objective(self, w: &[f64], n: usize, sharpness: f64) -> Objective {
        let rows = w.len().checked_div(n).unwrap_or(0);
        let lengths = match self {
            Criterion::ScaledCondition => Some(column_lengths(w, rows)),
            _ => None,
        };
        let scaled = lengths.as_ref().map(|l| scaled(w, rows, l));
        let w = scaled.as_deref().unwrap_or(w);
        let spectrum = SingularValues::new(w, n);
        let (value, weights) = self.of_values(&spectrum.values, sharpness);
        // dF/dW = W N with N = sum of weights v v^T, F a function of the values
        let mut inner = vec![0.0; n * n];
        for (k, weight) in weights.iter().enumerate() {
            let v = &spectrum.vectors[k * n..(k + 1) * n];
            for j in 0..n {
                for i in 0..n {
                    inner[j * n + i] += weight * v[i] * v[j];
                }
            }
        }
        let mut slope = vec![0.0; w.len()];
        for (j, column) in slope.chunks_exact_mut(rows.max(1)).enumerate() {
            for (i, other) in w.chunks_exact(rows.max(1)).enumerate() {
                let factor = inner[j * n + i];
                for (s, x) in column.iter_mut().zip(other) {
                    *s += factor * x;
                }
            }
        }
        if let Some(lengths) = lengths {
            // the chain rule through the scaling w_j / |w_j|
            let columns = slope.chunks_exact_mut(rows.max(1));
            let pairs = columns.zip(w.chunks_exact(rows.max(1))).zip(&lengths);
            for ((column, unit), length) in pairs {
                let along: f64 = column.iter().zip(unit).map(|(s, u)| s * u).sum();
                for (s, u) in column.iter_mut().zip(unit) {
                    *s = (*s - along * u) / length;
                }
            }
        }
        Objective { value, slope }
    }

    /// The objective F as a function of the singular values s, and dF/ds_i / s_i.
    fn of_values(self, values: &[f64], p: f64) -> (f64, Vec<f64>) {
        let largest = values.first().copied().unwrap_or(1.0);
        // a smallest singular value of zero would make the objective infinite
        let floor = 1e-14 * largest.max(f64::MIN_POSITIVE);
        let s: Vec<f64> = values.iter().map(|s| s.max(floor)).collect();
        let smallest = s.last().copied().unwrap_or(1.0);
        let high: Vec<f64> = s.iter().map(|s| libm::pow(s / largest, 2.0 * p)).collect();
        let low: Vec<f64> = s.iter().map(|s| libm::pow(smallest / s, 2.0 * p)).collect();
        let (high_sum, low_sum) = (high.iter().sum::<f64>(), low.iter().sum::<f64>());
        let log_high = libm::log(largest) + libm::log(high_sum) / (2.0 * p);
        let log_low = libm::log(smallest) - libm::log(low_sum) / (2.0 * p);
        match self {
            Criterion::ScaledCondition | Criterion::Condition => {
                let rows = high.iter().zip(&low).zip(&s);
                let weights = rows
                    .map(|((h, l), s)| (h / high_sum - l / low_sum) / (s * s))
                    .collect();
                (log_high - log_low, weights)
            }
            Criterion::SmallestSingular => {
                let rows = low.iter().zip(&s);
                let weights = rows.map(|(l, s)| -l / low_sum / (s * s)).collect();
                (-log_low, weights)
            }
            Criterion::Determinant => {
                let value = -2.0 * s.iter().map(|s| libm::log(*s)).sum::<f64>();
                (value, s.iter().map(|s| -2.0 / (s * s)).collect())
            }
        }
    }

    /// The criterion's value without smoothing, for comparing trajectories: smaller is better, so
    /// that the smallest singular value has its sign changed.
    pub fn of(self, figures: &Figures) -> f64 {
        match self {
            Criterion::ScaledCondition => figures.scaled_condition,
            Criterion::Condition => figures.condition,
            Criterion::Determinant => figures.determinant,
            Criterion::SmallestSingular => -figures.smallest_singular,
        }
    }

    /// Whether the rows of W are divided by the efforts' standard deviations.
    pub(super) fn is_weighted(self) -> bool {
        self == Criterion::Determinant
    }
}

impl Figures {
    /// The figures of a matrix with `n` columns, column-major; `weighted` is the same matrix with
    /// its rows divided by the efforts' standard deviations.
    pub(super) fn new(w: &[f64], weighted: &[f64], n: usize) -> Self {
        let rows = w.len().checked_div(n).unwrap_or(0);
        let raw = SingularValues::new(w, n);
        let unit = SingularValues::new(&scaled(w, rows, &column_lengths(w, rows)), n);
        let weighted = SingularValues::new(weighted, n);
        Self {
            scaled_condition: unit.condition(),
            condition: raw.condition(),
            determinant: -2.0 * weighted.values.iter().map(|s| libm::log(*s)).sum::<f64>(),
            smallest_singular: raw.values.last().copied().unwrap_or(0.0),
        }
    }
}
