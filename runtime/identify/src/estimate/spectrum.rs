//! Singular values of a factor: condition numbers, rank, and which parameters are undetermined.

use super::{EstimateError, QrFactor};
use crate::SingularValues;

/// Singular values below this fraction of the largest, with columns scaled to unit length, count as
/// zero: below it fewer than three of the sixteen digits of the parameter are significant.
pub const RANK_TOLERANCE: f64 = 1e-13;
/// A parameter is reported as undetermined when the length of its projection onto the null space,
/// with columns scaled, is above this (a unit vector has length 1).
const MIN_NULL_PART: f64 = 1e-6;

/// The singular values of W and of W with columns scaled to unit length (Eq. 27).
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// The singular values of W, the largest first.
    pub raw: Vec<f64>,
    /// The singular values of W with columns scaled to unit length, the largest first.
    pub scaled: Vec<f64>,
    /// The divisors of the columns: their lengths, or 1 for a zero column.
    pub divisors: Vec<f64>,
    /// The right singular vectors of the scaled matrix, n x n, column-major, in the same order.
    vectors: Vec<f64>,
}

fn ratio(values: &[f64]) -> f64 {
    match (values.first(), values.last()) {
        (Some(&largest), Some(&smallest)) if smallest > 0.0 => largest / smallest,
        (Some(_), Some(_)) => f64::INFINITY,
        _ => 1.0,
    }
}

impl Spectrum {
    /// The condition number of W (Eq. 24).
    pub fn condition(&self) -> f64 {
        ratio(&self.raw)
    }

    /// The condition number of W with scaled columns.
    pub fn scaled_condition(&self) -> f64 {
        ratio(&self.scaled)
    }

    /// The number of independent combinations of parameters that the data determine: the scaled
    /// singular values above [`RANK_TOLERANCE`] times the largest.
    pub fn rank(&self) -> usize {
        let largest = self.scaled.first().copied().unwrap_or(0.0);
        let floor = largest * RANK_TOLERANCE;
        self.scaled.iter().filter(|&&s| s > floor).count()
    }

    /// The columns that take part in a direction which the data leave undetermined (the null
    /// space).
    pub fn undetermined(&self) -> Vec<usize> {
        let n = self.scaled.len();
        let rank = self.rank();
        let null = self.vectors.get(rank * n..).unwrap_or(&[]);
        let part = |column: usize| -> f64 {
            let entries = null.iter().skip(column).step_by(n.max(1));
            entries.map(|v| v * v).sum::<f64>().sqrt()
        };
        (0..n).filter(|&c| part(c) > MIN_NULL_PART).collect()
    }

    /// Orthonormal directions, with columns scaled to unit length, whose singular values are at
    /// most this fraction of the largest: changing the parameters along them does not change the
    /// efforts.
    pub(crate) fn null_directions(&self, tolerance: f64) -> Vec<Vec<f64>> {
        let n = self.scaled.len();
        let floor = tolerance * self.scaled.first().copied().unwrap_or(0.0);
        let directions = self.vectors.chunks_exact(n.max(1)).zip(&self.scaled);
        directions
            .filter(|(_, value)| **value <= floor)
            .map(|(direction, _)| direction.to_vec())
            .collect()
    }

    pub(super) fn require_full_rank(&self, factor: &QrFactor) -> Result<(), EstimateError> {
        let parameters = factor.columns();
        let labels = || -> Vec<String> {
            self.undetermined()
                .into_iter()
                .filter_map(|c| factor.labels().get(c).cloned())
                .collect()
        };
        if factor.rows() < parameters {
            return Err(EstimateError::TooShort {
                rows: factor.rows(),
                parameters,
                labels: labels(),
                resting: 0,
            });
        }
        let rank = self.rank();
        if rank == parameters {
            return Ok(());
        }
        Err(EstimateError::Undetermined {
            rank,
            parameters,
            labels: labels(),
            reciprocal_condition: 1.0 / self.scaled_condition(),
        })
    }
}

impl QrFactor {
    /// Computes the singular values of the reduced matrix W, which are those of R.
    ///
    /// # Errors
    /// When the decomposition does not converge.
    ///
    /// ```
    /// use regen_identify::estimate::QrFactor;
    ///
    /// let mut factor = QrFactor::new(["a", "b", "c"].map(String::from).to_vec());
    /// // the second and third column are equal
    /// let w = [3.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 4.0, 0.0];
    /// factor.push_block(&w, &[1.0, 2.0, 0.0])?;
    /// let spectrum = factor.spectrum()?;
    /// assert_eq!(spectrum.rank(), 2);
    /// assert_eq!(spectrum.undetermined(), [1, 2]);
    /// # Ok::<(), regen_identify::estimate::EstimateError>(())
    /// ```
    pub fn spectrum(&self) -> Result<Spectrum, EstimateError> {
        let n = self.columns();
        let divisors: Vec<f64> = self
            .column_norms()
            .into_iter()
            .map(|norm| if norm > 0.0 { norm } else { 1.0 })
            .collect();
        let columns = self.r().chunks_exact(n.max(1)).zip(&divisors);
        let scaled: Vec<f64> = columns
            .flat_map(|(column, divisor)| column.iter().map(move |x| x / divisor))
            .collect();
        let raw = SingularValues::of_square(self.r(), n);
        let scaled = SingularValues::of_square(&scaled, n);
        if raw
            .values
            .iter()
            .chain(&scaled.values)
            .any(|s| !s.is_finite())
        {
            return Err(EstimateError::NoConvergence);
        }
        Ok(Spectrum {
            raw: raw.values,
            scaled: scaled.values,
            divisors,
            vectors: scaled.vectors,
        })
    }
}
