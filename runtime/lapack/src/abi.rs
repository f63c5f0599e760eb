//! The symbols. Each function checks its arguments, makes slices of the lengths that the
//! interface promises, and calls safe code.

use core::ffi::c_int;

mod products;
mod solve;

pub use products::{
    dgemm_, dgemv_, dsymv_, dsyr2k_, dsyrk_, sgemm_, sgemv_, ssymv_, ssyr2k_, ssyrk_,
};
pub use solve::{
    dgesdd_, dgesv_, dgesvd_, dpotrf_, dpotrs_, dsyevr_, sgesdd_, sgesv_, sgesvd_, spotrf_,
    spotrs_, ssyevr_,
};

/// The length of a column-major matrix: up to its last entry, not its last column's end.
fn extent(rows: usize, columns: usize, leading: usize) -> usize {
    if rows == 0 || columns == 0 {
        0
    } else {
        (columns - 1) * leading + rows
    }
}

/// A size that is not negative.
fn size(n: c_int) -> Option<usize> {
    usize::try_from(n).ok()
}

/// A leading dimension that holds that many rows.
fn leading(value: c_int, rows: usize) -> Option<usize> {
    size(value).filter(|&l| l >= rows.max(1))
}

fn info_of(value: usize) -> c_int {
    c_int::try_from(value).unwrap_or(c_int::MAX)
}

/// The value of an argument, or what the interface says about one that is not allowed: `info`
/// is minus its place.
macro_rules! argument {
    ($value:expr, $place:expr, $info:ident) => {
        match $value {
            Some(value) => value,
            None => {
                *$info = -$place;
                return;
            }
        }
    };
}

/// Reads scalar arguments.
macro_rules! read {
    ($($name:ident),*) => {
        // SAFETY: the interface passes every scalar by a pointer to one readable value.
        $(let $name = unsafe { *$name };)*
    };
}

use {argument, read};
