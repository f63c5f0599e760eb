//! The triangular QR factor of an observation matrix: all that least squares needs, for any number
//! of rows.

use serde::{Deserialize, Serialize};

use super::EstimateError;
use super::spectrum::RANK_TOLERANCE;
use crate::qr_update::{BLOCK, reduce, reduce_by_pairs, substitute};

/// Singular values are computed unless the bound of the condition number is below this part of
/// the one at which the rank is no longer full.
const SURE_PART: f64 = 0.01;
/// A column that is smaller than this part of the largest one is zero but for rounding.
const ROUNDING: f64 = 1e-12;

/// The system W x = tau (Eq. 12) after an orthogonal transformation from the left:
/// `||W x - tau||^2 = ||R x - z||^2 + rss` for every x.
///
/// Rows can be added in blocks and factors of different logs merged in any order. Afterwards
/// columns can be selected, combined or fixed without reading the data again.
///
/// ```
/// use regen_identify::estimate::QrFactor;
///
/// let mut factor = QrFactor::new(["offset", "slope"].map(String::from).to_vec());
/// // y = 1 + 2 x at x = 0, 1, 2, 3, column-major; then one more row, an outlier
/// factor.push_block(&[1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 2.0, 3.0], &[1.0, 3.0, 5.0, 7.0])?;
/// let x = factor.solve()?;
/// assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 2.0).abs() < 1e-14);
/// assert!(factor.rss() < 1e-28);
///
/// let mut other = QrFactor::new(factor.labels().to_vec());
/// other.push_block(&[1.0, 4.0], &[10.0])?;
/// factor.merge(&other)?;
/// assert_eq!(factor.rows(), 5);
/// assert!(factor.rss() > 0.1);
/// # Ok::<(), regen_identify::estimate::EstimateError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Raw")]
pub struct QrFactor {
    labels: Vec<String>,
    /// n x n, column-major, upper triangular with a non-negative diagonal.
    r: Vec<f64>,
    z: Vec<f64>,
    rss: f64,
    rows: usize,
}

/// A factor as read, before it is checked.
#[derive(Deserialize)]
struct Raw {
    labels: Vec<String>,
    r: Vec<f64>,
    z: Vec<f64>,
    rss: f64,
    rows: usize,
}

impl TryFrom<Raw> for QrFactor {
    type Error = EstimateError;

    fn try_from(raw: Raw) -> Result<Self, EstimateError> {
        let factor = QrFactor::from_parts(raw.labels, raw.r, raw.z, raw.rss, raw.rows)?;
        let is_empty = |all: &[f64]| all.iter().all(|x| *x == 0.0);
        let empty = is_empty(&factor.r) && is_empty(&factor.z) && factor.rss == 0.0;
        if factor.rows == 0 && !empty {
            return Err(EstimateError::Impossible {
                what: "rows".to_owned(),
                why: "is 0, and the factor has entries",
            });
        }
        Ok(factor)
    }
}

pub(super) fn size(what: &'static str, expected: usize, got: usize) -> Result<(), EstimateError> {
    if expected == got {
        return Ok(());
    }
    Err(EstimateError::Size {
        what,
        expected,
        got,
    })
}

/// Refuses rows with an entry that is not finite.
fn require_finite(w: &[f64], tau: &[f64]) -> Result<(), EstimateError> {
    // without a branch for each entry
    let finite = |all: &[f64]| all.iter().fold(true, |finite, x| finite & x.is_finite());
    let place = |all: &[f64]| all.iter().position(|x| !x.is_finite()).unwrap_or(0);
    if !finite(tau) {
        let row = place(tau);
        return Err(EstimateError::NotFinite { what: "tau", row });
    }
    if !finite(w) {
        let row = place(w) % tau.len().max(1);
        return Err(EstimateError::NotFinite { what: "w", row });
    }
    Ok(())
}

impl QrFactor {
    /// A factor without rows, for parameters with these labels.
    pub fn new(labels: Vec<String>) -> Self {
        let n = labels.len();
        Self {
            labels,
            r: vec![0.0; n * n],
            z: vec![0.0; n],
            rss: 0.0,
            rows: 0,
        }
    }

    /// A factor from its parts: `r` is n x n, column-major and upper triangular, `z` has n entries,
    /// `rss` is the sum of squared residuals and `rows` the number of rows. The signs of the
    /// diagonal are left as they are.
    ///
    /// # Errors
    /// When lengths do not fit, an entry is not finite, `r` has entries other than zero below its
    /// diagonal, or `rss` is negative.
    pub fn from_parts(
        labels: Vec<String>,
        r: Vec<f64>,
        z: Vec<f64>,
        rss: f64,
        rows: usize,
    ) -> Result<Self, EstimateError> {
        let n = labels.len();
        size("r", n * n, r.len())?;
        size("z", n, z.len())?;
        for (k, value) in r.iter().enumerate() {
            let (column, row) = (k / n, k % n);
            if !value.is_finite() {
                return Err(EstimateError::NotFinite { what: "r", row });
            }
            if row > column && *value != 0.0 {
                return Err(EstimateError::Impossible {
                    what: format!("r: the entry {k}, in row {row} and column {column},"),
                    why: "is below the diagonal and not zero",
                });
            }
        }
        if let Some(row) = z.iter().position(|value| !value.is_finite()) {
            return Err(EstimateError::NotFinite { what: "z", row });
        }
        if !rss.is_finite() {
            let (what, row) = ("rss", 0);
            return Err(EstimateError::NotFinite { what, row });
        }
        if rss < 0.0 {
            return Err(EstimateError::Impossible {
                what: "rss".to_owned(),
                why: "is negative",
            });
        }
        Ok(Self {
            labels,
            r,
            z,
            rss,
            rows,
        })
    }

    /// The labels of the n columns.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// R: n x n, column-major, upper triangular, with a non-negative diagonal unless
    /// [`from_parts`](Self::from_parts) received another one.
    pub fn r(&self) -> &[f64] {
        &self.r
    }

    /// The number of columns of the rows that are not zero but for rounding.
    pub(crate) fn contained(&self) -> usize {
        let square = |column: &[f64]| column.iter().map(|x| x * x).sum::<f64>();
        let squares: Vec<f64> = self
            .r
            .chunks_exact(self.columns().max(1))
            .map(square)
            .collect();
        let largest = squares.iter().fold(0.0, |m: f64, own| m.max(*own));
        let parts = squares
            .iter()
            .filter(|own| **own > ROUNDING * ROUNDING * largest);
        parts.count()
    }

    /// z: the right side of R x = z, n entries.
    pub fn z(&self) -> &[f64] {
        &self.z
    }

    /// The sum of squared residuals at the least-squares solution (no x gives less), in the squared
    /// units of the efforts.
    pub fn rss(&self) -> f64 {
        self.rss
    }

    /// The number of rows that were reduced.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Whether there are less than three rows for two columns: the parameters can then fit the
    /// noise of whole efforts, so that the residuals give no information on it.
    pub(crate) fn has_too_few_rows(&self) -> bool {
        2 * self.rows < 3 * self.columns()
    }

    /// The number of columns.
    pub fn columns(&self) -> usize {
        self.labels.len()
    }

    /// Adds rows of W x = tau.
    ///
    /// - `w`: rows x n, column-major; `tau`: one entry per row, N or N m.
    ///
    /// # Errors
    /// When lengths do not fit or an entry is not finite; the factor is then unchanged.
    pub fn push_block(&mut self, w: &[f64], tau: &[f64]) -> Result<(), EstimateError> {
        let (n, rows) = (self.columns(), tau.len());
        size("w", n * rows, w.len())?;
        require_finite(w, tau)?;
        let mut block = vec![0.0; BLOCK.min(rows) * n];
        let mut side = vec![0.0; BLOCK.min(rows)];
        for start in (0..rows).step_by(BLOCK) {
            let end = rows.min(start + BLOCK);
            let m = end - start;
            side[..m].copy_from_slice(&tau[start..end]);
            for (j, column) in block[..m * n].chunks_exact_mut(m).enumerate() {
                column.copy_from_slice(&w[j * rows + start..j * rows + end]);
            }
            let (block, side) = (&mut block[..m * n], &mut side[..m]);
            self.rss += reduce(&mut self.r, &mut self.z, block, side, m);
        }
        self.rows += rows;
        Ok(())
    }

    /// As [`push_block`](Self::push_block) for at most [`BLOCK`] rows, which are overwritten.
    pub(super) fn push_owned(
        &mut self,
        mut w: Vec<f64>,
        tau: &mut [f64],
    ) -> Result<(), EstimateError> {
        let rows = tau.len();
        size("w", self.columns() * rows, w.len())?;
        require_finite(&w, tau)?;
        self.rss += reduce_by_pairs(&mut self.r, &mut self.z, &mut w, tau, rows);
        self.rows += rows;
        Ok(())
    }

    /// Adds the rows of another factor of the same columns.
    ///
    /// The order of merges changes the result only by rounding.
    ///
    /// # Errors
    /// When the labels differ.
    pub fn merge(&mut self, other: &Self) -> Result<(), EstimateError> {
        if self.labels != other.labels {
            return Err(EstimateError::Mismatch {
                what: "columns",
                left: self.labels.join(" "),
                right: other.labels.join(" "),
            });
        }
        let rows = self.rows + other.rows;
        self.push_block(&other.r, &other.z)?;
        self.rss += other.rss;
        self.rows = rows;
        Ok(())
    }

    /// The factor with every row multiplied by the absolute value of `factor`, such as 1/sigma for
    /// an effort whose residuals have the standard deviation sigma.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let times = |values: &[f64]| values.iter().map(|x| x * factor.abs()).collect();
        Self {
            labels: self.labels.clone(),
            r: times(&self.r),
            z: times(&self.z),
            rss: self.rss * factor * factor,
            rows: self.rows,
        }
    }

    /// The factor of the system in fewer or other unknowns y, where x = T y.
    ///
    /// - `labels`: the k names of y; `t`: n x k, column-major.
    ///
    /// A column of T with two ones makes two parameters equal; a parameter without a one in T is
    /// left out (zero).
    ///
    /// # Errors
    /// When lengths do not fit or an entry of `t` is not finite.
    pub fn transformed(&self, labels: Vec<String>, t: &[f64]) -> Result<Self, EstimateError> {
        let n = self.columns();
        size("t", n * labels.len(), t.len())?;
        let mut w = Vec::with_capacity(t.len());
        for column in t.chunks_exact(n.max(1)) {
            w.extend(self.times_r(column));
        }
        let mut out = Self::new(labels);
        out.push_block(&w, &self.z)?;
        out.rss += self.rss;
        out.rows = self.rows;
        Ok(out)
    }

    /// The factor of the given columns, in the given order; the parameters of the other columns are
    /// taken as zero.
    ///
    /// # Errors
    /// When a column does not exist.
    pub fn select(&self, columns: &[usize]) -> Result<Self, EstimateError> {
        let n = self.columns();
        let mut labels = Vec::with_capacity(columns.len());
        let mut w = Vec::with_capacity(columns.len() * n);
        for &column in columns {
            let Some(label) = self.labels.get(column) else {
                return Err(EstimateError::Size {
                    what: "columns",
                    expected: n,
                    got: column + 1,
                });
            };
            labels.push(label.clone());
            w.extend_from_slice(&self.r[column * n..(column + 1) * n]);
        }
        let mut out = Self::new(labels);
        out.push_block(&w, &self.z)?;
        out.rss += self.rss;
        out.rows = self.rows;
        Ok(out)
    }

    /// The factor of the remaining columns when some parameters have known values.
    ///
    /// - `known`: column and value (SI) of each known parameter.
    ///
    /// # Errors
    /// When a column does not exist or a value is not finite.
    pub fn fixed(&self, known: &[(usize, f64)]) -> Result<Self, EstimateError> {
        let n = self.columns();
        let mut out = self.clone();
        for &(column, value) in known {
            let Some(entries) = self.r.get(column * n..(column + 1) * n) else {
                return Err(EstimateError::Size {
                    what: "known",
                    expected: n,
                    got: column + 1,
                });
            };
            for (z, r) in out.z.iter_mut().zip(entries) {
                *z -= r * value;
            }
        }
        let kept: Vec<usize> = (0..n)
            .filter(|c| known.iter().all(|(k, _)| k != c))
            .collect();
        out.select(&kept)
    }

    /// The Euclidean lengths of the columns of R, which are those of W's columns.
    pub fn column_norms(&self) -> Vec<f64> {
        self.r
            .chunks_exact(self.columns().max(1))
            .map(|column| column.iter().map(|x| x * x).sum::<f64>().sqrt())
            .collect()
    }

    /// `||W x - tau||^2` for given parameters.
    ///
    /// # Errors
    /// When the length does not fit.
    pub fn squared_residual(&self, x: &[f64]) -> Result<f64, EstimateError> {
        size("x", self.columns(), x.len())?;
        let fitted = self.times_r(x);
        let inside: f64 = fitted
            .iter()
            .zip(&self.z)
            .map(|(a, b)| (a - b).powi(2))
            .sum();
        Ok(inside + self.rss)
    }

    /// Solves for the least-squares parameters, n entries; the rank is decided with columns scaled
    /// to unit length (Eq. 27).
    ///
    /// # Errors
    /// When there are fewer rows than parameters, or the data leave parameters undetermined:
    /// the error names them.
    pub fn solve(&self) -> Result<Vec<f64>, EstimateError> {
        if !self.has_surely_full_rank() {
            self.spectrum()?.require_full_rank(self)?;
        }
        substitute(&self.r, &self.z).ok_or(EstimateError::NoConvergence)
    }

    /// Whether a bound of the condition number with scaled columns, which is far quicker than
    /// singular values, shows that the data determine all parameters: the product of the Euclidean
    /// norms of the scaled triangle and of its inverse.
    fn has_surely_full_rank(&self) -> bool {
        let n = self.columns();
        let mut squares = 0.0;
        for (k, norm) in self.column_norms().iter().enumerate() {
            let mut row = vec![0.0; n];
            row[k] = *norm;
            // row k of the scaled inverse: x R = norm e_k
            for j in k..n {
                let column = &self.r[j * n..(j + 1) * n];
                let before: f64 = (k..j).map(|i| row[i] * column[i]).sum();
                let side = if j == k { *norm } else { 0.0 };
                row[j] = (side - before) / column[j];
            }
            squares += row[k..].iter().map(|x| x * x).sum::<f64>();
        }
        let condition = (n as f64 * squares).sqrt();
        // the comparison is false for NaN
        self.rows >= n && condition < SURE_PART / RANK_TOLERANCE
    }

    /// The factor of equations whose solution differs by `change`, with the same residuals: R of this one,
    /// and `z + R change`.
    ///
    /// - `change`: of each of the n parameters, in its unit.
    #[must_use]
    pub(crate) fn moved_by(&self, change: &[f64]) -> Self {
        let z = self.z.iter().zip(self.times_r(change));
        Self {
            z: z.map(|(z, more)| z + more).collect(),
            ..self.clone()
        }
    }

    /// R x.
    pub(crate) fn times_r(&self, x: &[f64]) -> Vec<f64> {
        let n = self.columns();
        let mut out = vec![0.0; n];
        for (column, value) in self.r.chunks_exact(n.max(1)).zip(x) {
            for (o, r) in out.iter_mut().zip(column) {
                *o += r * value;
            }
        }
        out
    }
}
