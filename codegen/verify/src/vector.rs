//! Operations on vectors and matrices that propagate NaN, and derivatives by finite differences.

use regen_runtime::SizeError;

/// Step of the finite differences: the errors are of the order of its fourth power, and of epsilon
/// divided by it.
const DIFFERENCE_STEP: f64 = 1e-4;

/// The larger of two numbers; NaN if one is.
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if b.is_nan() || b > a { b } else { a }
}

/// The largest absolute value of an entry; NaN if an entry is NaN.
pub(crate) fn max_abs(values: &[f64]) -> f64 {
    values.iter().map(|v| v.abs()).fold(0.0, larger)
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The largest difference of two vectors, relative to their largest entry, or to `scale` if that is
/// larger, as where the terms of both cancel.
pub(crate) fn relative_difference(a: &[f64], b: &[f64], scale: f64) -> f64 {
    let difference = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    difference.fold(0.0, larger) / larger(scale, larger(max_abs(a), max_abs(b)))
}

/// Row-major matrix times vector.
pub(crate) fn mul_row_major(matrix: &[f64], vector: &[f64]) -> Vec<f64> {
    matrix
        .chunks_exact(vector.len().max(1))
        .map(|row| dot(row, vector))
        .collect()
}

/// Column-major matrix times vector.
pub(crate) fn mul_column_major(columns: &[f64], vector: &[f64], rows: usize) -> Vec<f64> {
    let mut sum = vec![0.0; rows];
    for (column, value) in columns.chunks_exact(rows.max(1)).zip(vector) {
        for (sum, entry) in sum.iter_mut().zip(column) {
            *sum += entry * value;
        }
    }
    sum
}

/// The derivative at 0 of a vector function of one variable, by central differences of fourth
/// order.
pub(crate) fn derivative_at_zero(
    f: impl Fn(f64) -> Result<Vec<f64>, SizeError>,
) -> Result<Vec<f64>, SizeError> {
    let difference = |h: f64| -> Result<Vec<f64>, SizeError> {
        let (after, before) = (f(h)?, f(-h)?);
        Ok(after.iter().zip(&before).map(|(a, b)| a - b).collect())
    };
    let (near, far) = (
        difference(DIFFERENCE_STEP)?,
        difference(2.0 * DIFFERENCE_STEP)?,
    );
    let both = near.iter().zip(&far);
    Ok(both
        .map(|(near, far)| (8.0 * near - far) / (12.0 * DIFFERENCE_STEP))
        .collect())
}

/// The vector of the given length that a method of a model writes.
pub(crate) fn fill<C>(
    size: usize,
    run: impl FnOnce(&mut [f64]) -> Result<C, SizeError>,
) -> Result<Vec<f64>, SizeError> {
    let mut out = vec![0.0; size];
    run(&mut out).map(|_| out)
}
