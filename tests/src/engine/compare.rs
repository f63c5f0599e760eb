//! Relative differences, and a record of the largest of each kind of comparison.

use std::collections::BTreeMap;
use std::fmt;

use nalgebra::DMatrix;

/// Rows whose entries are below this fraction of the matrix's largest count as rounding, such as a
/// planar loop's rows out of its plane.
const MIN_ROW_PART: f64 = 1e-4;

/// The largest difference within a row, relative to that row's largest entry; infinite if the
/// shapes differ or an entry of either matrix is not finite.
pub fn row_error(ours: &DMatrix<f64>, theirs: &DMatrix<f64>) -> f64 {
    row_error_above(MIN_ROW_PART * theirs.amax(), ours, theirs)
}

/// Like [`row_error`], with the size below which a row counts as rounding.
pub(super) fn row_error_above(floor: f64, ours: &DMatrix<f64>, theirs: &DMatrix<f64>) -> f64 {
    // the maxima below ignore NaN
    if ours.shape() != theirs.shape() || !ours.iter().chain(theirs).all(|x| x.is_finite()) {
        return f64::INFINITY;
    }
    let rows = ours.row_iter().zip(theirs.row_iter());
    rows.fold(0.0, |worst, (x, y)| {
        worst.max(ratio((x - y).amax(), y.amax().max(floor)))
    })
}

/// The largest difference of two vectors relative to a scale; infinite if the lengths differ or an
/// entry of either is not finite.
pub fn vector_error(ours: &[f64], theirs: &[f64], scale: f64) -> f64 {
    // the maximum below ignores NaN
    if ours.len() != theirs.len() || !ours.iter().chain(theirs).all(|x| x.is_finite()) {
        return f64::INFINITY;
    }
    let differences = ours.iter().zip(theirs).map(|(x, y)| (x - y).abs());
    ratio(differences.fold(0.0, f64::max), scale)
}

/// The largest absolute value.
pub(super) fn size(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, x| m.max(x.abs()))
}

pub(super) fn ratio(difference: f64, scale: f64) -> f64 {
    if difference > 0.0 {
        difference / scale
    } else if difference.is_nan() {
        f64::INFINITY
    } else {
        0.0
    }
}

/// The largest difference of one kind of comparison, and its tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// The largest relative difference.
    pub worst: f64,
    /// The largest relative difference that is allowed.
    pub tolerance: f64,
}

/// The largest difference of every comparison.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures(BTreeMap<&'static str, Figure>);

impl Figures {
    /// The largest difference of a comparison, infinite if the comparison was not made.
    pub fn worst(&self, name: &str) -> f64 {
        self.0.get(name).map_or(f64::INFINITY, |f| f.worst)
    }

    /// The comparisons made, by name.
    pub fn all(&self) -> impl Iterator<Item = (&'static str, Figure)> + '_ {
        self.0.iter().map(|(name, figure)| (*name, *figure))
    }

    pub(super) fn record(&mut self, name: &'static str, error: f64, tolerance: f64) {
        let figure = self.0.entry(name).or_insert(Figure {
            worst: 0.0,
            tolerance,
        });
        // `max` would ignore a NaN.
        figure.worst = if error.is_nan() {
            f64::INFINITY
        } else {
            figure.worst.max(error)
        };
    }

    pub(super) fn verdict(self, who: &str) -> Result<Figures, String> {
        let failed: Vec<String> = self
            .all()
            .filter(|(_, f)| f.worst > f.tolerance)
            .map(|(name, f)| format!("{name}: {:.1e} > {:.0e}", f.worst, f.tolerance))
            .collect();
        if failed.is_empty() {
            Ok(self)
        } else {
            Err(format!("{who}: {}", failed.join("; ")))
        }
    }
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, figure) in self.all() {
            writeln!(f, "{name:28} {:9.1e}", figure.worst)?;
        }
        Ok(())
    }
}
