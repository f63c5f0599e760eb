//! Integer relations among real numbers, by lattice reduction.

use dashu_int::IBig;
use dashu_int::ops::{Abs, BitTest, DivEuclid};

use crate::base::certificate::Float320;

use super::lattice;

/// Number of bits of each value that enter the lattice.
const VALUE_BITS: i32 = 230;
/// Largest total number of bits of the integers of a relation.
const MAX_RELATION_BITS: usize = 130;

/// Integers, not all zero, whose combination of the values is zero; `None` if there are only long
/// ones, which exist for any values.
pub(super) fn relation(values: &[Float320]) -> Option<Vec<IBig>> {
    let largest = values
        .iter()
        .map(Float320::log10)
        .fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return None;
    }
    let top = (largest / core::f64::consts::LOG10_2).ceil() as i32;
    let leading = values.iter().map(|v| integer(&v.scaled(VALUE_BITS - top)));
    let leading: Vec<IBig> = leading.collect::<Option<_>>()?;
    reduced(&leading).into_iter().find_map(|mut row| {
        row.pop();
        let products = row.iter().zip(&leading).map(|(x, v)| x * v);
        let residual = products.fold(IBig::ZERO, |sum, x| sum + x);
        let lengths = row.iter().map(BitTest::bit_len);
        let longest = lengths.clone().max().unwrap_or(0);
        let is_short = lengths.sum::<usize>() <= MAX_RELATION_BITS;
        (is_short && residual.bit_len() <= longest + 8).then_some(row)
    })
}

/// The integer part, rounded towards zero.
fn integer(value: &Float320) -> Option<IBig> {
    let (negative, magnitude, exponent) = value.binary();
    let shift = usize::try_from(exponent.unsigned_abs()).ok()?;
    if exponent > 0 && shift > 1000 {
        return None;
    }
    let size = if exponent < 0 {
        magnitude >> shift
    } else {
        magnitude << shift
    };
    let size = IBig::from(size);
    Some(if negative { -size } else { size })
}

/// The reduced lattice of the values: rows of coefficients, and last the combination of the values.
fn reduced(values: &[IBig]) -> Vec<Vec<IBig>> {
    if let Some(rows) = lattice::reduced(values, VALUE_BITS.unsigned_abs() as usize) {
        let wide = |row: Vec<i128>| row.into_iter().map(IBig::from).collect();
        return rows.into_iter().map(wide).collect();
    }
    // with few values the entries are too long for the quick method
    let n = values.len();
    let mut basis: Vec<Vec<IBig>> = Vec::new();
    for (i, value) in values.iter().enumerate() {
        let mut row = vec![IBig::ZERO; n + 1];
        row[i] = IBig::ONE;
        row[n].clone_from(value);
        basis.push(row);
    }
    reduce(&mut basis);
    basis
}

fn dot(a: &[IBig], b: &[IBig]) -> IBig {
    let products = a.iter().zip(b).map(|(x, y)| x * y);
    products.fold(IBig::ZERO, |sum, x| sum + x)
}

/// The lattice reduction of Lenstra, Lenstra and Lovasz in integer arithmetic, after de Weger: `d`
/// are the Gram determinants, `lambda` the coefficients of the orthogonalisation multiplied by
/// them.
struct Lattice<'a> {
    basis: &'a mut [Vec<IBig>],
    d: Vec<IBig>,
    lambda: Vec<Vec<IBig>>,
}

fn reduce(basis: &mut [Vec<IBig>]) {
    let n = basis.len();
    let mut lattice = Lattice {
        basis,
        d: vec![IBig::ONE; n + 1],
        lambda: vec![vec![IBig::ZERO; n]; n],
    };
    lattice.orthogonalise();
    let mut k = 1;
    while k < n {
        lattice.size_reduce(k, k - 1);
        let (d, l) = (&lattice.d, &lattice.lambda[k][k - 1]);
        // Lovasz's condition with 3/4
        if (&d[k + 1] * &d[k - 1] + l * l) * 4 < &d[k] * &d[k] * 3 {
            lattice.exchange(k);
            k = (k - 1).max(1);
        } else {
            for l in (0..k - 1).rev() {
                lattice.size_reduce(k, l);
            }
            k += 1;
        }
    }
}

impl Lattice<'_> {
    fn orthogonalise(&mut self) {
        for k in 0..self.basis.len() {
            for j in 0..=k {
                let mut u = dot(&self.basis[k], &self.basis[j]);
                for i in 0..j {
                    let rest = &self.d[i + 1] * u - &self.lambda[k][i] * &self.lambda[j][i];
                    u = rest / &self.d[i];
                }
                if j < k {
                    self.lambda[k][j] = u;
                } else {
                    self.d[k + 1] = u;
                }
            }
        }
    }

    /// Subtracts the nearest integer multiple of an earlier vector.
    fn size_reduce(&mut self, k: usize, l: usize) {
        let (of, d) = (&self.lambda[k][l], &self.d[l + 1]);
        if of.abs() * 2 <= *d {
            return;
        }
        // q is x / d rounded: floor(x / d + 1/2)
        let q = (of * IBig::from(2) + d).div_euclid(d * IBig::from(2));
        let (before, after) = self.basis.split_at_mut(k);
        for (x, y) in after[0].iter_mut().zip(&before[l]) {
            *x -= &q * y;
        }
        let (before, after) = self.lambda.split_at_mut(k);
        for (x, y) in after[0].iter_mut().zip(&before[l]).take(l) {
            *x -= &q * y;
        }
        after[0][l] -= &q * &self.d[l + 1];
    }

    /// Exchanges a vector with the one before it.
    fn exchange(&mut self, k: usize) {
        self.basis.swap(k, k - 1);
        let (before, after) = self.lambda.split_at_mut(k);
        for (x, y) in before[k - 1].iter_mut().zip(&mut after[0]).take(k - 1) {
            core::mem::swap(x, y);
        }
        let l = self.lambda[k][k - 1].clone();
        let b = (&self.d[k - 1] * &self.d[k + 1] + &l * &l) / &self.d[k];
        for row in &mut self.lambda[k + 1..] {
            let t = row[k].clone();
            row[k] = (&self.d[k + 1] * &row[k - 1] - &l * &t) / &self.d[k];
            row[k - 1] = (&b * &t + &l * &row[k]) / &self.d[k + 1];
        }
        self.d[k] = b;
    }
}
