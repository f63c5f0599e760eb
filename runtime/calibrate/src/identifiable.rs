//! What measurements can tell of a geometry: the unknowns that are kept, and what each of them stands
//! for.

use nalgebra::{DMatrix, DVector};

/// The part of a column that must be left behind those of the kept ones, relative to the column.
const INDEPENDENT: f64 = 1e-6;

/// An unknown that cannot be told from kept ones: an error of it looks like errors of these.
#[derive(Clone, Debug, PartialEq)]
pub struct Absorbed {
    /// Its place among the columns.
    pub column: usize,
    /// The kept columns that its error changes, each with the error for a unit error of it; empty
    /// where it changes nothing that is measured.
    pub by: Vec<(usize, f64)>,
}

/// The columns that equations determine, chosen in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// The columns that are kept.
    pub kept: Vec<usize>,
    /// All others.
    pub absorbed: Vec<Absorbed>,
    /// The smallest part that was left of a kept column, relative to it.
    pub smallest_kept: f64,
    /// The largest part that was left of a column that is not kept.
    pub largest_absorbed: f64,
}

impl Selection {
    /// Chooses among the columns of equations, the first ones first. A column whose largest entry is
    /// below `silent` counts as zero.
    ///
    /// ```
    /// use nalgebra::DMatrix;
    /// use regen_calibrate::Selection;
    ///
    /// // the third column is twice the first less the second
    /// let a = DMatrix::from_row_slice(3, 3, &[1.0, 0.0, 2.0, 0.0, 1.0, -1.0, 1.0, 1.0, 1.0]);
    /// let chosen = Selection::of_columns(&a, 1e-9);
    /// assert_eq!(chosen.kept, [0, 1]);
    /// let by = &chosen.absorbed[0].by;
    /// assert!((by[0].1 - 2.0).abs() < 1e-12 && (by[1].1 + 1.0).abs() < 1e-12);
    /// ```
    pub fn of_columns(a: &DMatrix<f64>, silent: f64) -> Self {
        let mut out = Self {
            smallest_kept: f64::INFINITY,
            ..Self::default()
        };
        // q r = the kept columns
        let mut basis: Vec<DVector<f64>> = Vec::new();
        let mut factors: Vec<Vec<f64>> = Vec::new();
        for column in 0..a.ncols() {
            let whole = a.column(column).into_owned();
            let size = whole.norm();
            if whole.amax() <= silent {
                out.absorbed.push(Absorbed {
                    column,
                    by: Vec::new(),
                });
                continue;
            }
            let mut rest = whole;
            let mut parts = vec![0.0; basis.len()];
            // twice, so that rounding leaves no part of the others
            for _ in 0..2 {
                for (part, unit) in parts.iter_mut().zip(&basis) {
                    let along = unit.dot(&rest);
                    rest.axpy(-along, unit, 1.0);
                    *part += along;
                }
            }
            let left = rest.norm() / size;
            if left > INDEPENDENT {
                out.smallest_kept = out.smallest_kept.min(left);
                let norm = rest.norm();
                parts.push(norm);
                basis.push(rest / norm);
                factors.push(parts);
                out.kept.push(column);
            } else {
                out.largest_absorbed = out.largest_absorbed.max(left);
                let mut by = Vec::new();
                for k in (0..basis.len()).rev() {
                    let value = parts[k] / factors[k][k];
                    for (j, part) in parts.iter_mut().enumerate().take(k) {
                        *part -= value * factors[k][j];
                    }
                    if value.abs() > 1e-7 {
                        by.push((out.kept[k], value));
                    }
                }
                by.reverse();
                out.absorbed.push(Absorbed { column, by });
            }
        }
        out
    }
}
