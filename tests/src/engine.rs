//! tmp
use nalgebra::DMatrix;

/// The largest difference of a row, relative to that row's largest entry.
pub fn row_error(ours: &DMatrix<f64>, theirs: &DMatrix<f64>) -> f64 {
    if ours.shape() != theirs.shape() {
        return f64::INFINITY;
    }
    let floor = 1e-3 * theirs.amax();
    let mut worst: f64 = 0.0;
    for (x, y) in ours.row_iter().zip(theirs.row_iter()) {
        let scale = y.amax().max(floor);
        let difference = (x - y).amax();
        if difference > 0.0 {
            worst = worst.max(difference / scale);
        } else if difference.is_nan() {
            return f64::INFINITY;
        }
    }
    worst
}
