//! Vectors and matrices of expressions.

use super::graph::{Ex, Graph};

/// Three expressions.
pub type V3 = [Ex; 3];
/// A 3 x 3 matrix, row by row.
pub type M3 = [V3; 3];

/// The zero vector.
pub const ZERO3: V3 = [Ex::ZERO; 3];
/// The unit matrix.
pub const IDENTITY: M3 = [
    [Ex::ONE, Ex::ZERO, Ex::ZERO],
    [Ex::ZERO, Ex::ONE, Ex::ZERO],
    [Ex::ZERO, Ex::ZERO, Ex::ONE],
];

impl Graph {
    /// `a + b`.
    pub fn add3(&mut self, a: &V3, b: &V3) -> V3 {
        [
            self.add(a[0], b[0]),
            self.add(a[1], b[1]),
            self.add(a[2], b[2]),
        ]
    }

    /// `a - b`.
    pub fn sub3(&mut self, a: &V3, b: &V3) -> V3 {
        [
            self.sub(a[0], b[0]),
            self.sub(a[1], b[1]),
            self.sub(a[2], b[2]),
        ]
    }

    /// `-a`.
    pub fn neg3(&mut self, a: &V3) -> V3 {
        a.map(|x| self.neg(x))
    }

    /// `s a`.
    pub fn scale3(&mut self, s: Ex, a: &V3) -> V3 {
        a.map(|x| self.mul(s, x))
    }

    /// `a + s b`.
    pub fn add_scaled3(&mut self, a: &V3, s: Ex, b: &V3) -> V3 {
        let scaled = self.scale3(s, b);
        self.add3(a, &scaled)
    }

    /// `a . b`.
    pub fn dot3(&mut self, a: &V3, b: &V3) -> Ex {
        self.dot(a, b)
    }

    /// `a x b` (Eq. 2).
    pub fn cross(&mut self, a: &V3, b: &V3) -> V3 {
        let mut component = |i: usize, j: usize| {
            let l = self.mul(a[i], b[j]);
            let r = self.mul(a[j], b[i]);
            self.sub(l, r)
        };
        [component(1, 2), component(2, 0), component(0, 1)]
    }

    /// `M v`.
    pub fn mul_mv(&mut self, m: &M3, v: &V3) -> V3 {
        [
            self.dot3(&m[0], v),
            self.dot3(&m[1], v),
            self.dot3(&m[2], v),
        ]
    }

    /// `A B`.
    pub fn mul_mm(&mut self, a: &M3, b: &M3) -> M3 {
        let columns = transposed(b);
        a.map(|row| columns.map(|column| self.dot3(&row, &column)))
    }
}

/// The transposed matrix.
pub fn transposed(m: &M3) -> M3 {
    [0, 1, 2].map(|j| [m[0][j], m[1][j], m[2][j]])
}
