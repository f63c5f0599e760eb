//! Matrix products on slices whose lengths the caller has checked.

use nalgebra::{DMatrix, RealField};

/// The triangle of a symmetric matrix that is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Triangle {
    Upper,
    Lower,
}

impl Triangle {
    /// Reads the argument `uplo`: `U` or `L`.
    pub(crate) fn of(character: u8) -> Option<Self> {
        match character.to_ascii_uppercase() {
            b'U' => Some(Self::Upper),
            b'L' => Some(Self::Lower),
            _ => None,
        }
    }

    /// Whether the entry in row i and column j is in the triangle.
    pub(crate) fn has(self, i: usize, j: usize) -> bool {
        match self {
            Self::Upper => i <= j,
            Self::Lower => i >= j,
        }
    }
}

/// Reads the argument `trans`: whether a factor is transposed (`T`, `C`) or not (`N`).
pub(crate) fn transposed(character: u8) -> Option<bool> {
    match character.to_ascii_uppercase() {
        b'N' => Some(false),
        b'T' | b'C' => Some(true),
        _ => None,
    }
}

/// Reads a matrix from column-major storage.
pub(crate) fn load<T: RealField + Copy>(
    a: &[T],
    rows: usize,
    columns: usize,
    leading: usize,
) -> DMatrix<T> {
    DMatrix::from_fn(rows, columns, |i, j| a[j * leading + i])
}

/// Reads a symmetric n x n matrix of which one triangle is stored.
pub(crate) fn load_symmetric<T: RealField + Copy>(
    a: &[T],
    triangle: Triangle,
    n: usize,
    leading: usize,
) -> DMatrix<T> {
    DMatrix::from_fn(n, n, |i, j| {
        if triangle.has(i, j) {
            a[j * leading + i]
        } else {
            a[i * leading + j]
        }
    })
}

/// Writes a matrix to column-major storage.
pub(crate) fn store<T: RealField + Copy>(matrix: &DMatrix<T>, a: &mut [T], leading: usize) {
    for j in 0..matrix.ncols() {
        for i in 0..matrix.nrows() {
            a[j * leading + i] = matrix[(i, j)];
        }
    }
}

/// `old := alpha new + beta old`; where beta is zero `old` is not read, since it may be NaN.
fn blend<T: RealField + Copy>(old: &mut T, alpha: T, new: T, beta: T) {
    *old = if beta.is_zero() {
        alpha * new
    } else {
        alpha * new + beta * *old
    };
}

/// Reads op(A), rows x columns, from the storage of A.
pub(crate) fn operand<T: RealField + Copy>(
    a: &[T],
    transpose: bool,
    rows: usize,
    columns: usize,
    leading: usize,
) -> DMatrix<T> {
    if transpose {
        load(a, columns, rows, leading).transpose()
    } else {
        load(a, rows, columns, leading)
    }
}

/// `C := alpha A B + beta C`.
pub(crate) fn gemm<T: RealField + Copy>(
    alpha: T,
    a: &DMatrix<T>,
    b: &DMatrix<T>,
    beta: T,
    c: &mut [T],
    leading: usize,
) {
    let product = a * b;
    for j in 0..product.ncols() {
        for i in 0..product.nrows() {
            blend(&mut c[j * leading + i], alpha, product[(i, j)], beta);
        }
    }
}

/// `C := alpha S + beta C`, for one triangle of C.
pub(crate) fn update_triangle<T: RealField + Copy>(
    alpha: T,
    s: &DMatrix<T>,
    beta: T,
    triangle: Triangle,
    c: &mut [T],
    leading: usize,
) {
    for j in 0..s.ncols() {
        for i in (0..s.nrows()).filter(|&i| triangle.has(i, j)) {
            blend(&mut c[j * leading + i], alpha, s[(i, j)], beta);
        }
    }
}

/// The storage index of entry k of a vector of n entries; a negative increment stores the vector
/// backwards.
fn place(k: usize, n: usize, increment: isize) -> usize {
    let step = increment.unsigned_abs();
    if increment < 0 {
        (n - 1 - k) * step
    } else {
        k * step
    }
}

/// `y := alpha A x + beta y`; the increments of x and y must not be zero.
pub(crate) fn gemv<T: RealField + Copy>(
    alpha: T,
    a: &DMatrix<T>,
    (x, x_step): (&[T], isize),
    beta: T,
    (y, y_step): (&mut [T], isize),
) {
    let (rows, columns) = a.shape();
    for i in 0..rows {
        let mut sum = T::zero();
        for j in 0..columns {
            sum += a[(i, j)] * x[place(j, columns, x_step)];
        }
        blend(&mut y[place(i, rows, y_step)], alpha, sum, beta);
    }
}
