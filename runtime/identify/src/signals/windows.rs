//! Weighted cubic polynomials around several consecutive samples, one in each lane of a register.
//!
//! Every lane has the operations of [`reduce`](crate::qr_update::reduce) on the rows of its window
//! alone, in the same order, so that the results have the bits of one window fitted after the other.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::{Simd, bytemuck};

use super::local::{MIN_SAMPLES, TERMS};

/// The largest number of rows of a window: with more, the columns of all lanes leave the cache.
const MAX_ROWS: usize = 256;
/// Number of independent sums of a scalar product, as where one window is reduced.
const SUMS: usize = 8;

/// The samples `low..high` of each window.
pub(super) type Bounds = (usize, usize);

/// Buffers of the windows in the lanes of a register.
pub(super) struct Windows<S: Simd> {
    simd: S,
    half_width: f64,
    rows: usize,
    /// The distances of the samples from the middle of their window over its half width.
    distances: Vec<S::f64s>,
    /// The tricube weight of each sample.
    tricubes: Vec<S::f64s>,
    /// The powers of the distances, each multiplied by the root of the weight: column by column.
    columns: Vec<S::f64s>,
    side: Vec<S::f64s>,
    /// The triangle, column by column.
    r: [[S::f64s; TERMS]; TERMS],
}

/// Whether consecutive windows have equally many rows, each one later than the one before.
pub(super) fn are_alike(bounds: &[Bounds]) -> bool {
    let rows = bounds.first().map_or(0, |b| b.1 - b.0);
    let next = |pair: &[Bounds]| pair[1] == (pair[0].0 + 1, pair[0].1 + 1);
    (MIN_SAMPLES..=MAX_ROWS).contains(&rows) && bounds.windows(2).all(next)
}

impl<S: Simd> Windows<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, half_width: f64) -> Self {
        let zero = simd.splat_f64s(0.0);
        Self {
            simd,
            half_width,
            rows: 0,
            distances: Vec::new(),
            tricubes: Vec::new(),
            columns: Vec::new(),
            side: Vec::new(),
            r: [[zero; TERMS]; TERMS],
        }
    }

    /// The entries from `at` on, one in each lane.
    #[inline(always)]
    fn load(series: &[f64], at: usize) -> S::f64s {
        S::as_simd_f64s(&series[at..at + S::F64_LANES]).0[0]
    }

    /// The lanes of a register.
    #[inline(always)]
    pub(super) fn lanes(value: &S::f64s) -> &[f64] {
        bytemuck::cast_slice::<S::f64s, f64>(core::slice::from_ref(value))
    }

    /// Fills the columns of the windows around the samples from `middle` on, the first of which has
    /// the rows `low..high`. Returns whether all windows have enough samples inside.
    #[inline(always)]
    pub(super) fn fill(&mut self, times: &[f64], middle: usize, (low, high): Bounds) -> bool {
        let simd = self.simd;
        let (zero, one) = (simd.splat_f64s(0.0), simd.splat_f64s(1.0));
        let rows = high - low;
        if self.rows != rows {
            self.rows = rows;
            self.distances.resize(rows, zero);
            self.tricubes.resize(rows, zero);
            self.columns.resize(TERMS * rows, zero);
            self.side.resize(rows, zero);
        }
        let width = simd.splat_f64s(self.half_width);
        let t = Self::load(times, middle);
        let mut inside = zero;
        for i in 0..rows {
            let time = Self::load(times, low + i);
            let s = simd.div_f64s(simd.sub_f64s(time, t), width);
            let cube = |x: S::f64s| simd.mul_f64s(simd.mul_f64s(x, x), x);
            let size = simd.min_f64s(simd.abs_f64s(s), one);
            let tricube = cube(simd.sub_f64s(one, cube(size)));
            let positive = simd.less_than_f64s(zero, tricube);
            inside = simd.add_f64s(inside, simd.select_f64s(positive, one, zero));
            let root = simd.sqrt_f64s(tricube);
            let mut power = root;
            for column in 0..TERMS {
                self.columns[column * rows + i] = power;
                power = simd.mul_f64s(power, s);
            }
            self.distances[i] = s;
            self.tricubes[i] = tricube;
        }
        let least = MIN_SAMPLES as f64;
        Self::lanes(&inside).iter().all(|count| *count >= least)
    }

    /// Reduces the columns to a triangle; returns false where a column is zero. The columns then
    /// hold the Householder vectors below the triangle.
    #[inline(always)]
    pub(super) fn reduce(&mut self) -> bool {
        let (simd, rows) = (self.simd, self.rows);
        let zero = simd.splat_f64s(0.0);
        let mut rest = &mut self.columns[..];
        for k in 0..TERMS {
            let (v, later) = rest.split_at_mut(rows);
            let v = &*v;
            rest = later;
            let tail = dot(simd, v, v);
            if Self::lanes(&tail).contains(&0.0) {
                return false;
            }
            let beta = simd.sqrt_f64s(tail);
            let head = simd.sub_f64s(zero, beta);
            let h = simd.mul_f64s(head, head);
            self.r[k][k] = beta;
            let mut column = k + 1;
            let mut pairs = rest.chunks_exact_mut(2 * rows);
            for pair in &mut pairs {
                let (a, b) = pair.split_at_mut(rows);
                let (pa, pb) = dots(simd, v, a, b);
                for (a, p) in [(a, pa), (b, pb)] {
                    let s = simd.div_f64s(p, h);
                    self.r[column][k] = simd.sub_f64s(zero, simd.mul_f64s(s, head));
                    subtract(simd, v, a, s);
                    column += 1;
                }
            }
            let last = pairs.into_remainder();
            if !last.is_empty() {
                let s = simd.div_f64s(dot(simd, v, last), h);
                self.r[column][k] = simd.sub_f64s(zero, simd.mul_f64s(s, head));
                subtract(simd, v, last, s);
            }
        }
        true
    }

    /// The coefficients of the polynomials of one series in the windows whose columns were reduced,
    /// the first of which begins at sample `low`.
    #[inline(always)]
    pub(super) fn coefficients(&mut self, values: &[f64], low: usize) -> [S::f64s; TERMS] {
        let (simd, rows) = (self.simd, self.rows);
        let zero = simd.splat_f64s(0.0);
        // the first column is that of the roots of the weights, which no reflection changes
        for (i, (side, root)) in self.side.iter_mut().zip(&self.columns).enumerate() {
            *side = simd.mul_f64s(*root, Self::load(values, low + i));
        }
        let mut z = [zero; TERMS];
        for (k, v) in self.columns.chunks_exact(rows).enumerate() {
            let head = simd.sub_f64s(zero, self.r[k][k]);
            let h = simd.mul_f64s(head, head);
            let s = simd.div_f64s(dot(simd, v, &self.side), h);
            z[k] = simd.sub_f64s(zero, simd.mul_f64s(s, head));
            subtract(simd, v, &mut self.side, s);
        }
        self.substitute(z)
    }

    #[inline(always)]
    fn substitute(&self, mut x: [S::f64s; TERMS]) -> [S::f64s; TERMS] {
        let simd = self.simd;
        for k in (0..TERMS).rev() {
            x[k] = simd.div_f64s(x[k], self.r[k][k]);
            for i in 0..k {
                x[i] = simd.sub_f64s(x[i], simd.mul_f64s(self.r[k][i], x[k]));
            }
        }
        x
    }

    /// The weight of each sample in the polynomial's value in the middle of its window, row by row.
    #[inline(always)]
    pub(super) fn weights(&self, weights: &mut Vec<S::f64s>) {
        let simd = self.simd;
        let mut u = [simd.splat_f64s(0.0); TERMS];
        u[0] = simd.div_f64s(simd.splat_f64s(1.0), self.r[0][0]);
        for k in 1..TERMS {
            let mut before = simd.mul_f64s(self.r[k][0], u[0]);
            for (r, u) in self.r[k][1..k].iter().zip(&u[1..k]) {
                before = simd.add_f64s(before, simd.mul_f64s(*r, *u));
            }
            u[k] = simd.div_f64s(simd.sub_f64s(simd.splat_f64s(0.0), before), self.r[k][k]);
        }
        let a = self.substitute(u);
        weights.clear();
        for (tricube, s) in self.tricubes.iter().zip(&self.distances) {
            let mut sum = simd.splat_f64s(0.0);
            for c in a.iter().rev() {
                sum = simd.add_f64s(simd.mul_f64s(sum, *s), *c);
            }
            weights.push(simd.mul_f64s(*tricube, sum));
        }
    }
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: &[S::f64s], b: &[S::f64s]) -> S::f64s {
    let (a, a_rest) = a.as_chunks::<SUMS>();
    let (b, b_rest) = b.as_chunks::<SUMS>();
    let mut sums = [simd.splat_f64s(0.0); SUMS];
    for (x, y) in a.iter().zip(b) {
        for l in 0..SUMS {
            sums[l] = simd.add_f64s(sums[l], simd.mul_f64s(x[l], y[l]));
        }
    }
    let mut rest = simd.splat_f64s(-0.0);
    for (x, y) in a_rest.iter().zip(b_rest) {
        rest = simd.add_f64s(rest, simd.mul_f64s(*x, *y));
    }
    simd.add_f64s(total(simd, &sums), rest)
}

/// The dot products of `v` with two columns, reading `v` once.
#[inline(always)]
fn dots<S: Simd>(simd: S, v: &[S::f64s], a: &[S::f64s], b: &[S::f64s]) -> (S::f64s, S::f64s) {
    let (v, v_rest) = v.as_chunks::<SUMS>();
    let (a, a_rest) = a.as_chunks::<SUMS>();
    let (b, b_rest) = b.as_chunks::<SUMS>();
    let mut first = [simd.splat_f64s(0.0); SUMS];
    let mut second = first;
    for ((x, y), z) in v.iter().zip(a).zip(b) {
        for l in 0..SUMS {
            first[l] = simd.add_f64s(first[l], simd.mul_f64s(x[l], y[l]));
            second[l] = simd.add_f64s(second[l], simd.mul_f64s(x[l], z[l]));
        }
    }
    let mut sums = (total(simd, &first), total(simd, &second));
    for ((x, y), z) in v_rest.iter().zip(a_rest).zip(b_rest) {
        sums.0 = simd.add_f64s(sums.0, simd.mul_f64s(*x, *y));
        sums.1 = simd.add_f64s(sums.1, simd.mul_f64s(*x, *z));
    }
    sums
}

#[inline(always)]
fn total<S: Simd>(simd: S, sums: &[S::f64s; SUMS]) -> S::f64s {
    let mut all = sums[0];
    for sum in &sums[1..] {
        all = simd.add_f64s(all, *sum);
    }
    all
}

#[inline(always)]
fn subtract<S: Simd>(simd: S, v: &[S::f64s], a: &mut [S::f64s], s: S::f64s) {
    for (x, y) in v.iter().zip(a) {
        *y = simd.sub_f64s(*y, simd.mul_f64s(s, *x));
    }
}
