//! Measured velocities against the positions they should be velocities of.

/// Rows over which a velocity is integrated: noise of single rows averages out.
const ROWS: usize = 64;
/// Stretches that are needed for a judgement.
const FEWEST: f64 = 8.0;
/// Correlation of what was moved with the velocity's integral: less is another signal.
const ALIKE: f64 = 0.7;
/// A slope outside 1/TWICE .. TWICE is another unit.
const TWICE: f64 = 2.0;

/// Sums over stretches of each position's change and of each velocity's integral.
#[derive(Clone, Debug, Default)]
pub(super) struct Rates {
    start: Vec<f64>,
    integral: Vec<f64>,
    last: Vec<f64>,
    rows: usize,
    stretches: f64,
    /// Squares of changes, squares of integrals, and products of a change (row) with an integral.
    moved: Vec<f64>,
    said: Vec<f64>,
    products: Vec<f64>,
}

impl Rates {
    /// The next row: time, `m` positions, `m` velocities.
    pub(super) fn push(&mut self, m: usize, row: &[f64]) {
        if self.moved.len() != m {
            self.moved = vec![0.0; m];
            self.said = vec![0.0; m];
            self.products = vec![0.0; m * m];
        }
        if self.rows == 0 {
            self.start = row.to_vec();
            self.integral = vec![0.0; m];
        } else {
            let step = row[0] - self.last[0];
            for (k, sum) in self.integral.iter_mut().enumerate() {
                *sum += 0.5 * step * (row[1 + m + k] + self.last[1 + m + k]);
            }
        }
        self.last = row.to_vec();
        self.rows += 1;
        if self.rows <= ROWS {
            return;
        }
        self.rows = 0;
        self.stretches += 1.0;
        for k in 0..m {
            let moved = row[1 + k] - self.start[1 + k];
            self.moved[k] += moved * moved;
            self.said[k] += self.integral[k] * self.integral[k];
            for j in 0..m {
                self.products[k * m + j] += moved * self.integral[j];
            }
        }
    }

    /// The rows that come do not follow.
    pub(super) fn pause(&mut self) {
        self.rows = 0;
    }

    /// What does not fit, in a sentence, with titles of positions and velocities.
    pub(super) fn judge(&self, titles: &dyn Fn(usize) -> String) -> Option<String> {
        let m = self.moved.len();
        if self.stretches < FEWEST {
            return None;
        }
        let alike =
            |k: usize, j: usize| self.products[k * m + j] / (self.moved[k] * self.said[j]).sqrt();
        for k in 0..m {
            let own = alike(k, k);
            // a position or a velocity that is always 0 says nothing
            if !own.is_finite() {
                continue;
            }
            let (position, velocity) = (titles(1 + k), titles(1 + m + k));
            let head = format!(
                "column `{velocity}` is not the velocity of column `{position}`: over {ROWS} rows \
                 its integral has the correlation {own:.2} with what that moved"
            );
            if own < -ALIKE {
                return Some(format!(
                    "{head}; its sign is flipped, give it the factor -1"
                ));
            }
            if own < ALIKE {
                let other = (0..m).find(|j| *j != k && alike(*j, k) > ALIKE);
                return Some(match other {
                    Some(j) => {
                        format!(
                            "{head}; it fits column `{}`: the two are swapped",
                            titles(1 + j)
                        )
                    }
                    None => format!("{head}; at least {ALIKE} is expected"),
                });
            }
            let slope = self.products[k * m + k] / self.moved[k];
            if !(1.0 / TWICE..TWICE).contains(&slope) {
                return Some(format!(
                    "column `{velocity}` is {slope:.3} times the velocity of column \
                     `{position}`: give their units"
                ));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is told of two joints whose columns are changed: q1, q2, qd1, qd2.
    fn told(change: impl Fn([f64; 4]) -> [f64; 4]) -> Option<String> {
        let mut rates = Rates::default();
        for k in 0..3000 {
            let t = f64::from(k) * 2e-3;
            // noise of an encoder, the same in every run
            let noise = |seed: f64| 1e-4 * (1e4 * (t + seed)).sin();
            let row = [
                (2.0 * t).sin() + noise(0.1),
                (3.1 * t).cos() + noise(0.2),
                2.0 * (2.0 * t).cos() + noise(0.3),
                -3.1 * (3.1 * t).sin() + noise(0.4),
            ];
            let changed = change(row);
            rates.push(2, &[&[t][..], &changed].concat());
        }
        rates.judge(&|entry| ["t", "q1", "q2", "qd_q1", "qd_q2"][entry].to_owned())
    }

    #[test]
    fn velocities_of_others_are_told() {
        assert_eq!(told(|row| row), None);
        let flipped = told(|[a, b, c, d]| [a, b, c, -d]).unwrap_or_default();
        assert!(
            flipped.contains("`qd_q2`") && flipped.contains("factor -1"),
            "{flipped}"
        );
        let swapped = told(|[a, b, c, d]| [a, b, d, c]).unwrap_or_default();
        assert!(swapped.contains("fits column `q2`"), "{swapped}");
        let degrees = told(|[a, b, c, d]| [a, b, c.to_degrees(), d]).unwrap_or_default();
        assert!(
            degrees.contains("57.") && degrees.contains("units"),
            "{degrees}"
        );
        let other = told(|[a, b, _, d]| [a, b, a, d]).unwrap_or_default();
        assert!(other.contains("at least 0.7"), "{other}");
        // a joint that is held
        assert_eq!(told(|[a, _, c, _]| [a, 0.3, c, 0.0]), None);
    }
}
