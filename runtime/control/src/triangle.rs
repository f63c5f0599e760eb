//! The triangular factor of equations that arrive one by one: R x = z, by Givens rotations.

use core::array::from_fn;

use regen_runtime::Scalar;

use crate::real::{Real, largest};

/// The smallest pivot of a column that counts as determined, in roundings of the column's largest
/// entry.
const PIVOT_ROUNDINGS: f64 = 64.0;

/// R with R^T R the information of all equations, and z on its right side. Pivots are never
/// negative.
#[derive(Clone, Debug)]
pub(crate) struct Triangle<T, const P: usize> {
    /// R; entries below the diagonal are zero.
    pub(crate) rows: [[T; P]; P],
    /// z.
    pub(crate) right: [T; P],
}

impl<T: Real, const P: usize> Triangle<T, P> {
    pub(crate) fn empty() -> Self {
        Self {
            rows: [[T::ZERO; P]; P],
            right: [T::ZERO; P],
        }
    }

    /// Adds the equation `row` x = `right`, and returns what remains of its right side: the residual
    /// by which the sum of squares grows, which is the residual at the estimate before, over the
    /// square root of one and the row's leverage.
    pub(crate) fn add(&mut self, mut row: [T; P], mut right: T) -> T {
        for j in 0..P {
            if row[j] == T::ZERO {
                continue;
            }
            let top = &mut self.rows[j];
            let turn = Rotation::new(top[j], row[j]);
            top[j] = turn.length;
            for k in j + 1..P {
                turn.apply(&mut top[k], &mut row[k]);
            }
            turn.apply(&mut self.right[j], &mut right);
        }
        right
    }

    /// Multiplies the weight of all equations by the square of a factor.
    pub(crate) fn scale(&mut self, factor: T) {
        for x in self.rows.as_flattened_mut().iter_mut() {
            *x = *x * factor;
        }
        for z in &mut self.right {
            *z = *z * factor;
        }
    }

    /// Replaces \[R z\] by the triangle of \[R z\] + `tall` \[`row` `right`\].
    pub(crate) fn rank_one(&mut self, mut tall: [T; P], row: &[T; P], right: T) {
        // rotations that leave only the first entry of `tall` make R a Hessenberg matrix
        for i in (1..P).rev() {
            if tall[i] == T::ZERO {
                continue;
            }
            let turn = Rotation::new(tall[i - 1], tall[i]);
            tall[i - 1] = turn.length;
            self.turn(i, i - 1, turn);
        }
        let first = tall.first().copied().unwrap_or(T::ZERO);
        if let (Some(top), Some(z)) = (self.rows.first_mut(), self.right.first_mut()) {
            for (x, y) in top.iter_mut().zip(row) {
                *x = *x + first * *y;
            }
            *z = *z + first * right;
        }
        for i in 1..P {
            let below = self.rows[i][i - 1];
            if below != T::ZERO {
                let turn = Rotation::new(self.rows[i - 1][i - 1], below);
                self.turn(i, i - 1, turn);
                self.rows[i][i - 1] = T::ZERO;
            }
        }
        for (i, (row, z)) in self.rows.iter_mut().zip(&mut self.right).enumerate() {
            if row[i] < T::ZERO {
                for x in row.iter_mut() {
                    *x = -*x;
                }
                *z = -*z;
            }
        }
    }

    /// Rotates row `i` into the one above it, from a column on.
    fn turn(&mut self, i: usize, column: usize, turn: Rotation<T>) {
        let (above, below) = self.rows.split_at_mut(i);
        if let (Some(upper), Some(lower)) = (above.last_mut(), below.first_mut()) {
            for (x, y) in upper.iter_mut().zip(lower.iter_mut()).skip(column) {
                turn.apply(x, y);
            }
        }
        let (above, below) = self.right.split_at_mut(i);
        if let (Some(upper), Some(lower)) = (above.last_mut(), below.first_mut()) {
            turn.apply(upper, lower);
        }
    }

    /// R `x`.
    pub(crate) fn times(&self, x: &[T; P]) -> [T; P] {
        from_fn(|i| dot(&self.rows[i], x))
    }

    /// R^T `x`.
    pub(crate) fn transposed_times(&self, x: &[T; P]) -> [T; P] {
        let mut out = [T::ZERO; P];
        for (row, x) in self.rows.iter().zip(x) {
            for (out, r) in out.iter_mut().zip(row) {
                *out = *out + *r * *x;
            }
        }
        out
    }

    /// Whether every unknown is determined.
    pub(crate) fn is_regular(&self) -> bool {
        (0..P).all(|j| {
            let column = largest(self.rows.iter().map(|row| row[j]));
            self.rows[j][j] > T::of(PIVOT_ROUNDINGS) * T::EPSILON * column
        })
    }

    /// The solution of R x = `z`. Meaningless unless R is regular.
    pub(crate) fn back(&self, z: &[T; P]) -> [T; P] {
        let mut x = *z;
        for i in (0..P).rev() {
            for k in i + 1..P {
                x[i] = x[i] - self.rows[i][k] * x[k];
            }
            x[i] = x[i] / self.rows[i][i];
        }
        x
    }

    /// The solution of R^T x = `z`. Meaningless unless R is regular.
    pub(crate) fn forward(&self, z: &[T; P]) -> [T; P] {
        let mut x = *z;
        for i in 0..P {
            x[i] = x[i] / self.rows[i][i];
            for k in i + 1..P {
                x[k] = x[k] - self.rows[i][k] * x[i];
            }
        }
        x
    }
}

/// A plane rotation that turns a pair of numbers into (length, 0).
#[derive(Clone, Copy)]
struct Rotation<T> {
    cosine: T,
    sine: T,
    length: T,
}

impl<T: Real> Rotation<T> {
    fn new(x: T, y: T) -> Self {
        // scaled so that no square overflows or vanishes
        let most = Scalar::max(Scalar::abs(x), Scalar::abs(y));
        if most == T::ZERO {
            return Self {
                cosine: T::ONE,
                sine: T::ZERO,
                length: T::ZERO,
            };
        }
        let (a, b) = (x / most, y / most);
        let length = Scalar::sqrt(a * a + b * b);
        Self {
            cosine: a / length,
            sine: b / length,
            length: most * length,
        }
    }

    #[inline]
    fn apply(self, x: &mut T, y: &mut T) {
        let (a, b) = (*x, *y);
        *x = self.cosine * a + self.sine * b;
        *y = self.cosine * b - self.sine * a;
    }
}

/// The scalar product.
pub(crate) fn dot<T: Real, const P: usize>(a: &[T; P], b: &[T; P]) -> T {
    let products = a.iter().zip(b);
    products.fold(T::ZERO, |sum, (a, b)| sum + *a * *b)
}
