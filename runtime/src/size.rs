//! Conversions from slices to arrays, which check the lengths against a model's sizes.

use core::fmt;

/// The error of a slice whose length does not fit the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SizeError {
    /// The argument's name in the called method.
    pub argument: &'static str,
    /// The length it must have.
    pub expected: usize,
    /// The length it had.
    pub got: usize,
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "`{}` has {} entries, the model needs {}",
            self.argument, self.got, self.expected
        )
    }
}

impl core::error::Error for SizeError {}

/// Converts a slice to an array of the model's size.
///
/// # Errors
/// When the length is not `N`.
///
/// ```
/// let q = [0.1, 0.2];
/// assert_eq!(regen_runtime::array::<f64, 2>(&q, "q"), Ok(&[0.1, 0.2]));
/// let error = regen_runtime::array::<f64, 3>(&q, "q").unwrap_err();
/// assert_eq!(error.to_string(), "`q` has 2 entries, the model needs 3");
/// ```
#[inline]
pub fn array<'a, T, const N: usize>(
    slice: &'a [T],
    argument: &'static str,
) -> Result<&'a [T; N], SizeError> {
    slice.try_into().map_err(|_| SizeError {
        argument,
        expected: N,
        got: slice.len(),
    })
}

/// Converts a mutable slice to a mutable array of the model's size.
///
/// # Errors
/// When the length is not `N`.
#[inline]
pub fn array_mut<'a, T, const N: usize>(
    slice: &'a mut [T],
    argument: &'static str,
) -> Result<&'a mut [T; N], SizeError> {
    let got = slice.len();
    slice.try_into().map_err(|_| SizeError {
        argument,
        expected: N,
        got,
    })
}

/// Converts a mutable slice to `OUTER` mutable arrays of `INNER` entries: the columns of a
/// column-major matrix, or the rows of a row-major one.
///
/// `INNER = 0` does not compile; check such a slice with [`array_mut`] and `N = 0`.
///
/// # Errors
/// When the length is not `OUTER * INNER`.
///
/// ```
/// let mut w = [0.0; 6];
/// let columns = regen_runtime::matrix_mut::<f64, 3, 2>(&mut w, "out").unwrap();
/// columns[2] = [5.0, 6.0];
/// assert_eq!(w, [0.0, 0.0, 0.0, 0.0, 5.0, 6.0]);
/// assert!(regen_runtime::matrix_mut::<f64, 2, 2>(&mut w, "out").is_err());
/// ```
#[inline]
pub fn matrix_mut<'a, T, const OUTER: usize, const INNER: usize>(
    slice: &'a mut [T],
    argument: &'static str,
) -> Result<&'a mut [[T; INNER]; OUTER], SizeError> {
    let error = SizeError {
        argument,
        expected: OUTER * INNER,
        got: slice.len(),
    };
    let (chunks, rest) = slice.as_chunks_mut::<INNER>();
    if !rest.is_empty() {
        return Err(error);
    }
    chunks.try_into().map_err(|_| error)
}
