//! Two consecutive reflections of many columns at a time, for which each entry is read and written
//! once in place of twice.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::{Simd, bytemuck};

use super::{LANES, Reflection, dot};

/// Columns that are reflected at a time.
const TILE: usize = 4;

/// The reflections of two consecutive columns.
#[derive(Clone, Copy)]
pub(super) struct Pair<'a, S> {
    simd: S,
    reflections: [Reflection; 2],
    /// What is left of the first column, and of the second.
    v: &'a [f64],
    w: &'a [f64],
    /// The scalar product of the two, by which the second reflection knows what the first one changes.
    between: f64,
}

impl<'a, S: Simd> Pair<'a, S> {
    /// The pair of a reflection and the one after it, with what is left of their columns.
    #[inline(always)]
    pub(super) fn new(simd: S, reflections: [Reflection; 2], v: &'a [f64], w: &'a [f64]) -> Self {
        Self {
            simd,
            reflections,
            v,
            w,
            between: dot(v, w),
        }
    }

    /// Reflects columns of as many rows.
    ///
    /// - `tops`: their entries in the two rows of the triangle, each two `n` behind the ones before.
    #[inline(always)]
    pub(super) fn apply(self, columns: &mut [f64], tops: &mut [f64], n: usize) {
        let rows = self.v.len();
        let mut tops = tops.chunks_mut(n);
        let mut tiles = columns.chunks_exact_mut(TILE * rows);
        for tile in &mut tiles {
            self.apply_to::<TILE>(tile, &mut tops);
        }
        for column in tiles.into_remainder().chunks_exact_mut(rows) {
            self.apply_to::<1>(column, &mut tops);
        }
    }

    /// Reflects N columns.
    #[inline(always)]
    fn apply_to<'t, const N: usize>(
        self,
        columns: &mut [f64],
        tops: &mut impl Iterator<Item = &'t mut [f64]>,
    ) {
        let mut columns = columns.chunks_exact_mut(self.v.len());
        let mut columns: [&mut [f64]; N] =
            core::array::from_fn(|_| columns.next().unwrap_or_default());
        let [first, second] = self.products(columns.each_ref().map(|column| &**column));
        let mut s = [[0.0; N]; 2];
        for (i, tops) in (0..N).zip(tops) {
            s[0][i] = self.reflections[0].reflect(&mut tops[0], first[i]);
            let product = second[i] - s[0][i] * self.between;
            s[1][i] = self.reflections[1].reflect(&mut tops[1], product);
        }
        self.subtract(&mut columns, s);
    }

    /// The scalar products of N columns with those of the pair.
    #[inline(always)]
    fn products<const N: usize>(self, columns: [&[f64]; N]) -> [[f64; N]; 2] {
        let simd = self.simd;
        let (v, w) = (self.v, &self.w[..self.v.len()]);
        let columns = columns.map(|column| &column[..v.len()]);
        let mut sums = [[[simd.splat_f64s(0.0); LANES]; N]; 2];
        let whole = v.len() - v.len() % LANES;
        for at in (0..whole).step_by(LANES) {
            for register in 0..LANES / S::F64_LANES {
                let at = at + register * S::F64_LANES;
                let own = [load::<S>(v, at), load::<S>(w, at)];
                for i in 0..N {
                    let entries = load::<S>(columns[i], at);
                    for (sums, own) in sums.iter_mut().zip(own) {
                        let sum = &mut sums[i][register];
                        *sum = simd.add_f64s(*sum, simd.mul_f64s(own, entries));
                    }
                }
            }
        }
        let mut products = [[0.0; N]; 2];
        for i in 0..N {
            for (own, (products, sums)) in [v, w].iter().zip(products.iter_mut().zip(&sums)) {
                let lanes = bytemuck::cast_slice::<S::f64s, f64>(&sums[i]);
                let rest = own[whole..].iter().zip(&columns[i][whole..]);
                products[i] =
                    lanes.iter().take(LANES).sum::<f64>() + rest.map(|(x, y)| x * y).sum::<f64>();
            }
        }
        products
    }

    /// Subtracts multiples of the columns of the pair from N columns.
    #[inline(always)]
    fn subtract<const N: usize>(self, columns: &mut [&mut [f64]; N], s: [[f64; N]; 2]) {
        let simd = self.simd;
        let (v, w) = (self.v, &self.w[..self.v.len()]);
        let columns = columns.each_mut().map(|column| &mut column[..v.len()]);
        let whole = v.len() - v.len() % S::F64_LANES;
        for at in (0..whole).step_by(S::F64_LANES) {
            let (x, y) = (load::<S>(v, at), load::<S>(w, at));
            for i in 0..N {
                let (slot, _) = S::as_mut_simd_f64s(&mut columns[i][at..at + S::F64_LANES]);
                let less = simd.mul_f64s(simd.splat_f64s(s[0][i]), x);
                let once = simd.sub_f64s(slot[0], less);
                let less = simd.mul_f64s(simd.splat_f64s(s[1][i]), y);
                slot[0] = simd.sub_f64s(once, less);
            }
        }
        for at in whole..v.len() {
            for i in 0..N {
                columns[i][at] = columns[i][at] - s[0][i] * v[at] - s[1][i] * w[at];
            }
        }
    }
}

/// The entries of one register from `at` on.
#[inline(always)]
fn load<S: Simd>(column: &[f64], at: usize) -> S::f64s {
    S::as_simd_f64s(&column[at..at + S::F64_LANES]).0[0]
}
