//! Checks measured velocities against the changes of the measured positions.

/// Rows of a stretch over which a velocity is integrated: noise of single rows averages out.
const STRETCH_ROWS: usize = 64;
/// Number of stretches below which nothing is reported.
const MIN_STRETCHES: f64 = 8.0;
/// Correlation of a position's change with its velocity's integral: below it, the column holds
/// another signal.
const MIN_CORRELATION: f64 = 0.7;
/// Ratio of a velocity's integral to the position's change: outside `1/MAX_RATIO ..
/// MAX_RATIO`, the column is in another unit.
const MAX_RATIO: f64 = 2.0;

/// The least change over a stretch of a position that moves, in changes between rows: those of
/// noise are about as large, those of a steady motion as many times larger as a stretch has rows.
const MIN_MOTION: f64 = 8.0;

/// Sums of products of the positions' changes and the velocities' integrals over stretches.
#[derive(Clone, Debug, Default)]
pub(super) struct Rates {
    start: Vec<f64>,
    integral: Vec<f64>,
    last: Vec<f64>,
    rows: usize,
    stretches: f64,
    /// Sums of squared changes, of squared integrals, and of products of the change of position k
    /// with the integral of velocity j, at k * m + j.
    change_squares: Vec<f64>,
    /// Sums of squared changes between rows.
    step_squares: Vec<f64>,
    integral_squares: Vec<f64>,
    products: Vec<f64>,
}

impl Rates {
    /// Adds the next row: time, `m` positions, `m` velocities.
    pub(super) fn push(&mut self, m: usize, row: &[f64]) {
        if self.change_squares.len() != m {
            self.change_squares = vec![0.0; m];
            self.step_squares = vec![0.0; m];
            self.integral_squares = vec![0.0; m];
            self.products = vec![0.0; m * m];
        }
        if self.rows == 0 {
            self.start = row.to_vec();
            self.integral = vec![0.0; m];
        } else {
            let step = row[0] - self.last[0];
            for (k, sum) in self.integral.iter_mut().enumerate() {
                *sum += 0.5 * step * (row[1 + m + k] + self.last[1 + m + k]);
                self.step_squares[k] += (row[1 + k] - self.last[1 + k]).powi(2);
            }
        }
        self.last = row.to_vec();
        self.rows += 1;
        if self.rows <= STRETCH_ROWS {
            return;
        }
        self.rows = 0;
        self.stretches += 1.0;
        for k in 0..m {
            let moved = row[1 + k] - self.start[1 + k];
            self.change_squares[k] += moved * moved;
            self.integral_squares[k] += self.integral[k] * self.integral[k];
            for j in 0..m {
                self.products[k * m + j] += moved * self.integral[j];
            }
        }
    }

    /// Starts a new stretch: the next row does not follow the last one.
    pub(super) fn pause(&mut self) {
        self.rows = 0;
    }

    /// A sentence on the first velocity column that does not fit its position, with the column
    /// titles; `None` if all fit.
    pub(super) fn judge(&self, titles: &dyn Fn(usize) -> String) -> Option<String> {
        let m = self.change_squares.len();
        if self.stretches < MIN_STRETCHES {
            return None;
        }
        let correlation = |k: usize, j: usize| {
            self.products[k * m + j] / (self.change_squares[k] * self.integral_squares[j]).sqrt()
        };
        for k in 0..m {
            let own = correlation(k, k);
            let (position, velocity) = (titles(1 + k), titles(1 + m + k));
            // a position that never changes, or a velocity that is always 0, has no correlation
            if !own.is_finite() {
                let moves = self.change_squares[k] * STRETCH_ROWS as f64
                    > MIN_MOTION * MIN_MOTION * self.step_squares[k];
                if self.integral_squares[k] == 0.0 && moves && self.change_squares[k] > 0.0 {
                    return Some(format!(
                        "column `{velocity}` is 0 while column `{position}` moves: leave it out"
                    ));
                }
                continue;
            }
            let head = format!(
                "column `{velocity}` is not the velocity of column `{position}`: over \
                 {STRETCH_ROWS} rows its integral has the correlation {own:.2} with what that moved"
            );
            if own < -MIN_CORRELATION {
                return Some(format!(
                    "{head}; its sign is flipped, give it the factor -1"
                ));
            }
            if own < MIN_CORRELATION {
                let other = (0..m).find(|j| *j != k && correlation(*j, k) > MIN_CORRELATION);
                return Some(match other {
                    Some(j) => {
                        format!(
                            "{head}; it fits column `{}`: the two are swapped",
                            titles(1 + j)
                        )
                    }
                    None => format!("{head}; at least {MIN_CORRELATION} is expected"),
                });
            }
            let slope = self.products[k * m + k] / self.change_squares[k];
            if !(1.0 / MAX_RATIO..MAX_RATIO).contains(&slope) {
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

    /// The verdict on two joints whose columns (q1, q2, qd1, qd2) `change` has altered.
    fn verdict(change: impl Fn([f64; 4]) -> [f64; 4]) -> Option<String> {
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
        assert_eq!(verdict(|row| row), None);
        let flipped = verdict(|[a, b, c, d]| [a, b, c, -d]).unwrap_or_default();
        assert!(
            flipped.contains("`qd_q2`") && flipped.contains("factor -1"),
            "{flipped}"
        );
        let swapped = verdict(|[a, b, c, d]| [a, b, d, c]).unwrap_or_default();
        assert!(swapped.contains("fits column `q2`"), "{swapped}");
        let degrees = verdict(|[a, b, c, d]| [a, b, c.to_degrees(), d]).unwrap_or_default();
        assert!(
            degrees.contains("57.") && degrees.contains("units"),
            "{degrees}"
        );
        let other = verdict(|[a, b, _, d]| [a, b, a, d]).unwrap_or_default();
        assert!(other.contains("at least 0.7"), "{other}");
        let unread = verdict(|[a, b, c, _]| [a, b, c, 0.0]).unwrap_or_default();
        assert!(unread.contains("`qd_q2` is 0"), "{unread}");
        // a joint that does not move
        assert_eq!(verdict(|[a, _, c, _]| [a, 0.3, c, 0.0]), None);
    }
}
