//! The exported symbols. Each function checks its arguments, makes slices of the lengths that the
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

/// The number of stored entries from the first to the last entry of a column-major matrix; the
/// padding after the last column is not included.
fn extent(rows: usize, columns: usize, leading: usize) -> usize {
    if rows == 0 || columns == 0 {
        0
    } else {
        (columns - 1) * leading + rows
    }
}

/// Converts a size; `None` if it is negative.
fn size(n: c_int) -> Option<usize> {
    usize::try_from(n).ok()
}

/// Converts a leading dimension; `None` if it is less than `rows` or 1.
fn leading(value: c_int, rows: usize) -> Option<usize> {
    size(value).filter(|&l| l >= rows.max(1))
}

/// Converts a size to a value of `info`.
fn info_of(value: usize) -> c_int {
    c_int::try_from(value).unwrap_or(c_int::MAX)
}

/// Unwraps the value of an argument; an argument that is not allowed sets `info` to minus its
/// position and returns from the routine.
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

/// Reads scalar arguments, which the interface passes by reference.
macro_rules! read {
    ($($name:ident),*) => {
        // SAFETY: the interface passes every scalar by a pointer to one readable value.
        $(let $name = unsafe { *$name };)*
    };
}

use {argument, read};
