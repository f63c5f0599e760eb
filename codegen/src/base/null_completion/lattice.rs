//! Lattice reduction with doubles and 128-bit integers.

use dashu_int::IBig;

/// Bits of the values that enter at a time.
const STEP_BITS: usize = 24;
/// Entries beyond this might overflow products.
const MAX_ENTRY: i128 = 1 << 58;
/// With fewer values than these, the entries of reduced rows are too long for 128-bit integers.
const MIN_VALUES: usize = 7;
/// Rounds after which the reduction of a lattice is given up: far more than occur.
const MAX_ROUNDS: usize = 100_000;
/// The largest coefficient of a size-reduced row along an orthogonalised row before it: a little
/// above a half, for rounding.
const SHORT: f64 = 0.501;
/// The factor of Lovasz's condition.
const LOVASZ: f64 = 0.75;

/// A lattice whose rows are integers and their combination of the values, reduced after Lenstra,
/// Lenstra and Lovasz. Following Nguyen and Stehle (2005), inner products of rows are exact and
/// only the orthogonalisation is in doubles. The values enter a few bits at a time (van Hoeij and
/// Novocin, 2010): rows are short before each step, so that doubles suffice and integers stay
/// small.
struct Lattice {
    /// Coefficients of the values, and last the combination of their leading bits.
    rows: Vec<Vec<i128>>,
    /// Inner products of all pairs of rows.
    gram: Vec<Vec<i128>>,
    /// For j <= k, the inner product of row k with the orthogonalised row j.
    r: Vec<Vec<f64>>,
    /// For j < k, the coefficient of row k along the orthogonalised row j.
    mu: Vec<Vec<f64>>,
}

/// The reduced lattice of the values: rows of coefficients, and last the combination of the values.
/// `None` where 128-bit integers do not suffice.
///
/// - `bits`: the largest number of bits of a value.
pub(super) fn reduced(values: &[IBig], bits: usize) -> Option<Vec<Vec<i128>>> {
    let n = values.len();
    if n < MIN_VALUES {
        return None;
    }
    let identity = |i: usize| (0..=n).map(|j| i128::from(i == j)).collect();
    let mut lattice = Lattice {
        rows: (0..n).map(identity).collect(),
        gram: vec![vec![0; n]; n],
        r: vec![vec![0.0; n]; n],
        mu: vec![vec![0.0; n]; n],
    };
    let mut entered = 0;
    while entered < bits {
        entered = (entered + STEP_BITS).min(bits);
        let leading: Vec<IBig> = values.iter().map(|v| v >> (bits - entered)).collect();
        for row in &mut lattice.rows {
            let products = row.iter().zip(&leading).map(|(x, v)| v * IBig::from(*x));
            let sum = products.fold(IBig::ZERO, |sum, x| sum + x);
            let sum = i128::try_from(sum).ok()?;
            if sum.abs() > MAX_ENTRY {
                return None;
            }
            *row.last_mut()? = sum;
        }
        lattice.compute_gram();
        lattice.reduce()?;
    }
    Some(lattice.rows)
}

impl Lattice {
    /// Computes the inner products of all pairs of rows.
    fn compute_gram(&mut self) {
        for (i, a) in self.rows.iter().enumerate() {
            for (j, b) in self.rows.iter().enumerate() {
                self.gram[i][j] = a.iter().zip(b).map(|(x, y)| x * y).sum();
            }
        }
    }

    fn reduce(&mut self) -> Option<()> {
        let n = self.rows.len();
        let mut k = 0;
        for _ in 0..MAX_ROUNDS {
            if k == n {
                return Some(());
            }
            self.size_reduce(k)?;
            let exchanged = k > 0 && {
                let (before, slope) = (self.r[k - 1][k - 1], self.mu[k][k - 1]);
                self.r[k][k] + slope * slope * before < LOVASZ * before
            };
            if exchanged {
                self.rows.swap(k, k - 1);
                self.gram.swap(k, k - 1);
                for row in &mut self.gram {
                    row.swap(k, k - 1);
                }
                k -= 1;
            } else {
                k += 1;
            }
        }
        None
    }

    /// Subtracts integer multiples of earlier rows until the row is short along each of them.
    fn size_reduce(&mut self, k: usize) -> Option<()> {
        for _ in 0..MAX_ROUNDS {
            self.orthogonalise(k);
            let mut changed = false;
            for j in (0..k).rev() {
                let slope = self.mu[k][j];
                if !slope.is_finite() {
                    return None;
                }
                if slope.abs() > SHORT {
                    let multiple = slope.round();
                    let (before, after) = self.mu.split_at_mut(k);
                    for (x, y) in after[0].iter_mut().zip(&before[j]).take(j) {
                        *x -= multiple * y;
                    }
                    #[allow(clippy::cast_possible_truncation, reason = "entries are bounded")]
                    self.subtract(k, j, multiple as i128)?;
                    changed = true;
                }
            }
            if !changed {
                return Some(());
            }
        }
        None
    }

    /// Subtracts a multiple of row j from row k.
    fn subtract(&mut self, k: usize, j: usize, by: i128) -> Option<()> {
        let (before, after) = self.rows.split_at_mut(k);
        for (x, y) in after[0].iter_mut().zip(&before[j]) {
            *x = x.checked_sub(by.checked_mul(*y)?)?;
            if x.abs() > MAX_ENTRY {
                return None;
            }
        }
        // (a - c b)(a - c b) = aa - 2c ab + cc bb
        let cross = self.gram[k][j];
        let square = by
            .checked_mul(self.gram[j][j])?
            .checked_sub(cross.checked_mul(2)?)?;
        self.gram[k][k] = self.gram[k][k].checked_add(by.checked_mul(square)?)?;
        for i in (0..self.rows.len()).filter(|i| *i != k) {
            let change = by.checked_mul(self.gram[j][i])?;
            let product = self.gram[k][i].checked_sub(change)?;
            self.gram[k][i] = product;
            self.gram[i][k] = product;
        }
        Some(())
    }

    /// Computes the orthogonalisation of a row from its inner products with the rows before it.
    fn orthogonalise(&mut self, k: usize) {
        for j in 0..=k {
            #[allow(clippy::cast_precision_loss, reason = "rounded here on purpose")]
            let mut r = self.gram[k][j] as f64;
            for i in 0..j {
                r -= self.mu[j][i] * self.r[k][i];
            }
            self.r[k][j] = r;
            if j < k {
                self.mu[k][j] = r / self.r[j][j];
            }
        }
    }
}
