//! The numeric method for base parameters (Gautier, 1991): rank and null space of the observation
//! matrix in double precision.

use nalgebra::{DMatrix, DVector};

use crate::svd::svd;

/// Least ratio of the last number kept to the first number dropped; with less the rank is doubtful.
const MIN_GAP_RATIO: f64 = 1e4;
/// Least ratio of the widest gap to the next one.
const MIN_LEAD_RATIO: f64 = 1e2;

/// A rank, determined by the widest gap in a decreasing sequence of singular values or pivots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rank {
    /// The rank.
    pub count: usize,
    /// The last number kept, relative to the largest.
    pub last_kept: f64,
    /// The first number dropped, relative to the largest; 0 if none is dropped.
    pub first_dropped: f64,
    /// Whether the gap between them determines the rank without doubt in double precision.
    pub certain: bool,
}

impl Rank {
    /// The rank of a matrix from its singular values or pivots; `size` is the larger of its numbers
    /// of rows and columns.
    fn new(mut values: Vec<f64>, size: usize) -> Self {
        values.sort_by(|a, b| b.total_cmp(a));
        let largest = values.first().copied().unwrap_or(0.0);
        if largest.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
            return Self {
                count: 0,
                last_kept: 0.0,
                first_dropped: 0.0,
                certain: largest == 0.0,
            };
        }
        // below this, numbers are rounding errors, whatever their ratio
        let floor = f64::EPSILON * size as f64;
        let part = |k: usize| values.get(k).map_or(0.0, |v| v / largest);
        let gap = |k: usize| part(k - 1) / part(k).max(floor);
        let mut gaps: Vec<(f64, usize)> = (1..=values.len()).map(|k| (gap(k), k)).collect();
        gaps.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (widest, rank) = gaps.first().copied().unwrap_or((0.0, 0));
        let next = gaps.get(1).map_or(1.0, |g| g.0);
        Self {
            count: rank,
            last_kept: part(rank.saturating_sub(1)),
            first_dropped: part(rank),
            // a dropped number above the rounding errors may be a small but real singular value
            certain: widest >= MIN_GAP_RATIO
                && widest >= MIN_LEAD_RATIO * next
                && part(rank) <= floor,
        }
    }
}

/// Rank and null space of an observation matrix in double precision.
#[derive(Clone, Debug)]
pub(crate) struct Numeric {
    pub(crate) svd: Rank,
    pub(crate) qr: Rank,
    /// An orthonormal basis of the null space of the scaled matrix.
    null: DMatrix<f64>,
    /// The factor by which each column was divided.
    scale: Vec<f64>,
}

impl Numeric {
    /// Decomposes a matrix; `None` if the iteration does not converge or its result is wrong.
    ///
    /// Columns are scaled to unit length, however short they are: columns of mere rounding errors
    /// must be 0 in `w`.
    pub(crate) fn new(w: &DMatrix<f64>) -> Option<Self> {
        let norms: Vec<f64> = w.column_iter().map(|c| c.norm()).collect();
        let longest = norms.iter().copied().fold(0.0, f64::max);
        let scale: Vec<f64> = norms
            .iter()
            .map(|&norm| match norm {
                _ if norm > 0.0 => norm,
                _ if longest > 0.0 => longest,
                _ => 1.0,
            })
            .collect();
        let mut scaled = w.clone();
        for (mut column, scale) in scaled.column_iter_mut().zip(&scale) {
            column /= *scale;
        }
        let (rows, columns) = scaled.shape();
        let size = rows.max(columns);
        if rows == 0 || columns == 0 {
            // an empty matrix: the rank is 0 and every direction is null
            return Some(Self {
                svd: Rank::new(Vec::new(), size),
                qr: Rank::new(Vec::new(), size),
                null: DMatrix::identity(columns, columns),
                scale,
            });
        }
        // the factor R of QR has the same singular values and null space, and at most as many rows
        // as columns; extended by rows of zeros it has all right singular vectors
        let mut triangle = scaled.clone().qr().r();
        triangle = triangle.resize_vertically(columns, 0.0);
        let svd = svd(triangle.clone(), true)?;
        let error = (svd.clone().recompose().ok()? - &triangle).norm();
        if error.is_nan() || error > 1e-10 * triangle.norm().max(f64::MIN_POSITIVE) {
            return None;
        }
        let rank = Rank::new(svd.singular_values.iter().copied().collect(), size);
        let v = svd.v_t?.transpose();
        let vectors: Vec<DVector<f64>> = v
            .column_iter()
            .skip(rank.count)
            .map(nalgebra::Matrix::into_owned)
            .collect();
        let pivots = scaled.col_piv_qr().r().diagonal();
        Some(Self {
            svd: rank,
            qr: Rank::new(pivots.iter().map(|p| p.abs()).collect(), size),
            null: from_columns(columns, &vectors),
            scale,
        })
    }

    /// The largest angle between the given directions and the null space, rad; a quarter turn if
    /// there are more directions than the null space has dimensions.
    pub(crate) fn angle(&self, directions: &[DVector<f64>]) -> f64 {
        if directions.is_empty() {
            return 0.0;
        }
        if directions.len() > self.null.ncols() {
            return std::f64::consts::FRAC_PI_2;
        }
        let mut scaled = from_columns(self.scale.len(), directions);
        for (mut row, scale) in scaled.row_iter_mut().zip(&self.scale) {
            row *= *scale;
        }
        for mut column in scaled.column_iter_mut() {
            column.normalize_mut();
        }
        let orthonormal = scaled.qr().q();
        let outside = &orthonormal - &self.null * (self.null.transpose() * &orthonormal);
        let sine = outside.singular_values().max();
        sine.min(1.0).asin()
    }
}

fn from_columns(rows: usize, columns: &[DVector<f64>]) -> DMatrix<f64> {
    if columns.is_empty() {
        return DMatrix::zeros(rows, 0);
    }
    DMatrix::from_columns(columns)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn the_rank_ends_at_the_widest_gap() {
        let rank = Rank::new(vec![3.0, 1e-15, 0.5, 1e-4, 2e-16], 10);
        assert_eq!((rank.count, rank.certain), (3, true));
        let full = Rank::new(vec![3.0, 2.0, 1.0], 3);
        assert_eq!(
            (full.count, full.first_dropped, full.certain),
            (3, 0.0, true)
        );
    }

    #[test]
    fn a_gradual_decrease_leaves_the_rank_uncertain() {
        let decreasing: Vec<f64> = (0..15).map(|k| 10_f64.powi(-k)).collect();
        assert!(!Rank::new(decreasing, 15).certain);
        let small_but_nonzero = Rank::new(vec![1.0, 0.5, 1e-12], 4);
        assert!(!small_but_nonzero.certain, "{small_but_nonzero:?}");
        let two_gaps = Rank::new(vec![1.0, 1e-6, 1e-13], 4);
        assert!(!two_gaps.certain, "{two_gaps:?}");
    }

    #[test]
    fn a_zero_matrix_has_rank_zero() {
        let zero = Numeric::new(&DMatrix::zeros(4, 2)).unwrap();
        assert_eq!(
            (zero.svd.count, zero.qr.count, zero.svd.certain),
            (0, 0, true)
        );
        assert!(zero.angle(&[DVector::from_vec(vec![1.0, 2.0])]) < 1e-15);
    }

    #[test]
    fn the_null_space_is_found_whatever_the_columns_scales() {
        // third column = 1e6 first - 1e-3 second; the fourth is zero
        let a = DVector::from_fn(9, |r, _| (r as f64).sin());
        let b = DVector::from_fn(9, |r, _| (r as f64 * 0.7).cos());
        let c = &a * 1e6 - &b * 1e-3;
        let nothing = DVector::zeros(9);
        let found = Numeric::new(&DMatrix::from_columns(&[a, b, c, nothing])).unwrap();
        assert_eq!((found.svd.count, found.qr.count), (2, 2));
        assert!(found.svd.certain && found.qr.certain);
        let right = DVector::from_vec(vec![1e6, -1e-3, -1.0, 0.0]);
        let none = DVector::from_vec(vec![0.0, 0.0, 0.0, 1.0]);
        assert!(found.angle(&[right, none.clone()]) < 1e-6);
        let wrong = DVector::from_vec(vec![1e6, 0.0, 1.0, 0.0]);
        assert!(found.angle(&[wrong, none]) > 0.1);
    }

    #[test]
    fn more_directions_than_the_null_space_has_are_a_quarter_turn_away() {
        let found = Numeric::new(&DMatrix::identity(3, 3)).unwrap();
        let direction = DVector::from_vec(vec![1.0, 0.0, 0.0]);
        assert!((found.angle(&[direction]) - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    }
}
