//! Sums in twice the working precision (Ogita, Rump and Oishi, 2005, algorithms Sum2 and Dot2), one
//! or many side by side in vector registers.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use pulp::Arch;

/// A sum in twice the working precision.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    /// The sum in working precision.
    high: f64,
    /// The sum of the rounding errors of `high`.
    low: f64,
    /// The sum of the absolute values of all terms.
    size: f64,
    /// The number of terms.
    count: usize,
}

impl Sum {
    #[inline(always)]
    pub(super) fn add(&mut self, x: f64) {
        let next = self.high + x;
        let part = next - self.high;
        self.low += (self.high - (next - part)) + (x - part);
        self.high = next;
        self.size += x.abs();
        self.count += 1;
    }

    /// Adds `a b`.
    #[inline(always)]
    pub(super) fn product(&mut self, a: f64, b: f64) {
        let p = a * b;
        self.low += a.mul_add(b, -p);
        self.add(p);
    }

    pub(super) fn value(&self) -> f64 {
        self.high + self.low
    }

    /// An upper bound on the absolute value of the exact sum.
    pub(super) fn bound(&self) -> f64 {
        let n = self.count as f64 + 2.0;
        let rounding = n * n * f64::EPSILON * f64::EPSILON * self.size;
        self.value().abs() * (1.0 + 4.0 * f64::EPSILON) + rounding
    }
}

/// Sums side by side, each with terms in the order in which they are added.
struct Sums {
    high: Vec<f64>,
    low: Vec<f64>,
    size: Vec<f64>,
    count: usize,
}

impl Sums {
    fn new(number: usize) -> Self {
        Self {
            high: vec![0.0; number],
            low: vec![0.0; number],
            size: vec![0.0; number],
            count: 0,
        }
    }

    /// Adds one term to each sum.
    fn add(&mut self, terms: &[f64]) {
        let sums = self.high.iter_mut().zip(&mut self.low).zip(&mut self.size);
        for (((high, low), size), x) in sums.zip(terms) {
            let next = *high + x;
            let part = next - *high;
            *low += (*high - (next - part)) + (x - part);
            *high = next;
            *size += x.abs();
        }
        self.count += 1;
    }

    /// Adds `a[k] b` to each sum k.
    #[inline(always)]
    fn product(&mut self, a: &[f64], b: f64) {
        let sums = self.high.iter_mut().zip(&mut self.low).zip(&mut self.size);
        for (((high, low), size), a) in sums.zip(a) {
            let p = a * b;
            *low += a.mul_add(b, -p);
            let next = *high + p;
            let part = next - *high;
            *low += (*high - (next - part)) + (p - part);
            *high = next;
            *size += p.abs();
        }
        self.count += 1;
    }

    fn into_sums(self) -> impl Iterator<Item = Sum> {
        let count = self.count;
        let sums = self.high.into_iter().zip(self.low).zip(self.size);
        sums.map(move |((high, low), size)| Sum {
            high,
            low,
            size,
            count,
        })
    }
}

/// `first + rows^T factors`: the first terms plus the sum of the rows, each times its factor.
///
/// - `rows`: of at least as many entries as `first`.
pub(super) fn weighted_rows(first: &[f64], rows: &[Vec<f64>], factors: &[f64]) -> Vec<Sum> {
    let mut sums = Sums::new(first.len());
    sums.add(first);
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (row, factor) in rows.iter().zip(factors) {
                sums.product(row, *factor);
            }
        },
    );
    sums.into_sums().collect()
}

/// `A x - b`, each entry summed in twice the working precision and then rounded.
///
/// - `rows`: those of A, each followed by its entry of b.
pub(super) fn residuals(rows: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    let entry = |row: &Vec<f64>, at: usize| row.get(at).copied().unwrap_or(0.0);
    let mut sums = Sums::new(rows.len());
    let mut column = vec![0.0; rows.len()];
    let load = |at: usize, column: &mut [f64]| {
        for (slot, row) in column.iter_mut().zip(rows) {
            *slot = entry(row, at);
        }
    };
    for (at, value) in x.iter().enumerate() {
        load(at, &mut column);
        Arch::new().dispatch(
            #[inline(always)]
            || sums.product(&column, *value),
        );
    }
    load(x.len(), &mut column);
    for term in &mut column {
        *term = -*term;
    }
    sums.add(&column);
    sums.into_sums().map(|sum| sum.value()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums side by side are those that are computed one by one, to the last bit.
    #[test]
    fn sums_side_by_side_are_the_sums_one_by_one() {
        let mut seed = 7_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let unit = (seed >> 33) as f64 / 2_f64.powi(30) - 1.0;
            unit * 10_f64.powi((seed % 17) as i32 - 8)
        };
        for (count, n) in [(1, 1), (5, 3), (19, 23)] {
            let mut list = |n: usize| (0..n).map(|_| random()).collect::<Vec<f64>>();
            let rows: Vec<Vec<f64>> = (0..count).map(|_| list(n + 1)).collect();
            let (x, factors, first) = (list(n), list(count), list(n));
            for (row, found) in rows.iter().zip(residuals(&rows, &x)) {
                let mut sum = Sum::default();
                row.iter().zip(&x).for_each(|(a, b)| sum.product(*a, *b));
                sum.add(-row[n]);
                assert_eq!(sum.value().to_bits(), found.to_bits());
            }
            for (v, found) in weighted_rows(&first, &rows, &factors).iter().enumerate() {
                let mut sum = Sum::default();
                sum.add(first[v]);
                for (row, factor) in rows.iter().zip(&factors) {
                    sum.product(row[v], *factor);
                }
                assert_eq!(sum.value().to_bits(), found.value().to_bits());
                assert_eq!(sum.bound().to_bits(), found.bound().to_bits());
            }
        }
    }

    /// The result contains terms that cancellation in working precision would lose.
    #[test]
    fn small_terms_survive_large_ones() {
        let rows = [vec![1e16, 1.0, -1e16, 0.5]];
        assert_eq!(residuals(&rows, &[1.0, 1.0, 1.0]), [0.5]);
    }
}
