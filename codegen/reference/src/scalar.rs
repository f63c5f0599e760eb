//! Scalars that may be dual numbers, and operations on 3-vectors and 4x4 matrices.

use num_dual::DualNum;

/// A real number or a dual number over one.
pub trait Scalar: DualNum<Primitive = f64> + Copy {}
impl<T: DualNum<Primitive = f64> + Copy> Scalar for T {}

/// A vector in space.
pub type Vec3<T> = [T; 3];

/// A homogeneous transformation matrix.
pub type Mat4<T> = [[T; 4]; 4];

/// The identity matrix.
pub(crate) fn identity() -> Mat4<f64> {
    let mut out = [[0.0; 4]; 4];
    for (i, row) in out.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    out
}

/// A constant matrix with entries that are dual numbers.
pub(crate) fn constant_matrix<T: Scalar>(m: &Mat4<f64>) -> Mat4<T> {
    m.map(|row| row.map(T::from))
}

/// The matrix product.
pub(crate) fn mul<T: Scalar>(a: &Mat4<T>, b: &Mat4<T>) -> Mat4<T> {
    let mut out = [[T::from(0.0); 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            for k in 0..4 {
                out[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    out
}

/// The translation of a homogeneous matrix.
pub(crate) fn position<T: Scalar>(m: &Mat4<T>) -> Vec3<T> {
    [m[0][3], m[1][3], m[2][3]]
}

/// The axis k of the frame that a homogeneous matrix describes.
pub(crate) fn axis<T: Scalar>(m: &Mat4<T>, k: usize) -> Vec3<T> {
    [m[0][k], m[1][k], m[2][k]]
}

/// The rotation part of a matrix times a vector.
pub(crate) fn rotate<T: Scalar>(m: &Mat4<T>, v: &Vec3<T>) -> Vec3<T> {
    let mut out = [T::from(0.0); 3];
    for i in 0..3 {
        for j in 0..3 {
            out[i] += m[i][j] * v[j];
        }
    }
    out
}

/// The scalar product.
pub(crate) fn dot<T: Scalar>(a: &Vec3<T>, b: &Vec3<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product.
pub(crate) fn cross<T: Scalar>(a: &Vec3<T>, b: &Vec3<T>) -> Vec3<T> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// The sum.
pub(crate) fn add<T: Scalar>(a: &Vec3<T>, b: &Vec3<T>) -> Vec3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// The difference.
pub(crate) fn sub<T: Scalar>(a: &Vec3<T>, b: &Vec3<T>) -> Vec3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A vector times a scalar.
pub(crate) fn scale<T: Scalar>(a: &Vec3<T>, s: T) -> Vec3<T> {
    a.map(|x| x * s)
}

/// A rotation about the coordinate axis k, by an angle in rad.
pub(crate) fn rotation<T: Scalar>(k: usize, angle: T) -> Mat4<T> {
    let mut out = constant_matrix(&identity());
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let (s, c) = (angle.sin(), angle.cos());
    out[i][i] = c;
    out[j][j] = c;
    out[j][i] = s;
    out[i][j] = -s;
    out
}

/// A translation along the coordinate axis k.
pub(crate) fn translation<T: Scalar>(k: usize, distance: T) -> Mat4<T> {
    let mut out = constant_matrix(&identity());
    out[k][3] = distance;
    out
}
