//! The rank of the equations at the solution, and the unknowns that the runs do not determine.

use super::linear::Linear;
use super::{Free, GainError};
use crate::estimate::QrFactor;

/// Singular values below this part of the largest, with columns scaled to unit length, count as
/// zero: an undetermined scale is an exact null direction of the equations, so that its singular
/// value is zero up to rounding.
const RANK_TOLERANCE: f64 = 1e-11;
/// Entries of a direction below this part of its largest count as rounding.
const MIN_PART: f64 = 1e-6;

/// Returns an error that names the unknowns of each undetermined direction, if there is one.
pub(super) fn require_rank(linear: &Linear<'_>, factor: &QrFactor) -> Result<(), GainError> {
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
        if largest < MIN_PART {
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
        let part = |k: &usize| direction[*k].abs() > MIN_PART * largest;
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
