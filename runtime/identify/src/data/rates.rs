//! Checks measured velocities against the changes of the measured positions.

use super::layout::Unfit;

/// The number of rows over which a velocity is integrated, so that noise of single rows averages out.
const STRETCH_ROWS: usize = 64;
/// With fewer stretches than this, nothing is reported.
const MIN_STRETCHES: f64 = 8.0;
/// If a position's change and its velocity's integral have a lower correlation, the column contains
/// another signal.
const MIN_CORRELATION: f64 = 0.7;
/// If the ratio of a velocity's integral to the position's change is outside `1/MAX_RATIO ..
/// MAX_RATIO`, the column is in another unit.
const MAX_RATIO: f64 = 2.0;

/// A position moves if its rms change over a stretch is at least this many times its rms change
/// between rows. The ratio is about 1 for noise, and [`STRETCH_ROWS`] for a steady motion.
const MIN_MOTION: f64 = 8.0;
/// A ratio is one of a unit's if it differs by less than this part, because of noise and filters.
const RATIO_TOLERANCE: f64 = 0.1;

/// Accumulates products of the positions' changes and the velocities' integrals over stretches.
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

    /// The mistake of the first velocity column that does not fit its position; `None` if all fit.
    /// Positions that hardly move are not judged.
    ///
    /// - `pairs`: the name of each coordinate with the titles of its position and its velocity;
    /// - `clock`: the title of the column of time; empty without one.
    pub(super) fn judge(&self, pairs: &[[String; 3]], clock: &str) -> Option<Unfit> {
        let m = self.change_squares.len();
        if self.stretches < MIN_STRETCHES {
            return None;
        }
        let correlation = |k: usize, j: usize| {
            self.products[k * m + j] / (self.change_squares[k] * self.integral_squares[j]).sqrt()
        };
        let moves = |k: usize| {
            self.change_squares[k] * STRETCH_ROWS as f64
                > MIN_MOTION * MIN_MOTION * self.step_squares[k]
        };
        let slopes: Vec<(usize, f64)> = (0..m)
            .filter(|k| moves(*k) && correlation(*k, *k) > MIN_CORRELATION)
            .map(|k| (k, self.products[k * m + k] / self.change_squares[k]))
            .collect();
        // a wrong unit of time changes all velocities alike
        let all = |size: f64| slopes.iter().all(|(_, slope)| is_near(*slope, size));
        let of_time = CLOCKS
            .iter()
            .find(|(size, _)| slopes.len() > 1 && all(*size));
        if let (Some((_, unit)), false) = (of_time, clock.is_empty()) {
            return Some(Unfit {
                why: format!(
                    "column `{clock}` looks like {unit}: the changes of the positions are not the \
                     integrals of the velocities. Read it with"
                ),
                assignment: Some(format!("t={clock}:{unit}")),
            });
        }
        for (k, [name, position, velocity]) in pairs.iter().enumerate().take(m) {
            if !moves(k) {
                continue;
            }
            let own = correlation(k, k);
            if !own.is_finite() {
                return Some(Unfit::from(format!(
                    "column `{velocity}` is 0 while column `{position}` moves: leave it out"
                )));
            }
            let head = format!(
                "column `{velocity}` is not the velocity of column `{position}`: over \
                 {STRETCH_ROWS} rows its integral has the correlation {own:.2} with the position's \
                 change"
            );
            if own < -MIN_CORRELATION {
                return Some(Unfit {
                    why: format!("{head}; the sign of one of them is flipped. Read that with"),
                    assignment: Some(format!("qd_{name}={velocity}*-1")),
                });
            }
            if own < MIN_CORRELATION {
                let fits = |j: &usize| *j != k && moves(*j) && correlation(*j, k) > MIN_CORRELATION;
                let other = (0..m).find(fits).and_then(|j| pairs.get(j));
                return Some(match other {
                    Some([_, other, swapped]) => Unfit {
                        why: format!(
                            "{head}; it fits column `{other}`: these velocities are swapped, or \
                             their positions. Read each of the two as the other, such as"
                        ),
                        assignment: Some(format!("qd_{name}={swapped}")),
                    },
                    None => format!("{head}; at least {MIN_CORRELATION} is expected").into(),
                });
            }
            let slope = self.products[k * m + k] / self.change_squares[k];
            if !(1.0 / MAX_RATIO..MAX_RATIO).contains(&slope) {
                return Some(scaled(slope, name, position, velocity));
            }
        }
        None
    }
}

/// Ratios of a velocity to the rate of its position that a wrong unit of time causes.
const CLOCKS: [(f64, &str); 3] = [(1e3, "ms"), (1e6, "us"), (1e9, "ns")];
/// Ratios that a wrong unit of the velocity causes, with the unit in words and for an assignment.
const OF_VELOCITIES: [(f64, &str, &str); 3] = [
    (57.295_779_513_082_32, "degrees per second", "deg/s"),
    (9.549_296_585_513_72, "revolutions per minute", "rpm"),
    (1e3, "millimetres per second", "mm/s"),
];
/// Ratios that a wrong unit of the position causes.
const OF_POSITIONS: [(f64, &str, &str); 2] = [
    (0.017_453_292_519_943_295, "degrees", "deg"),
    (1e-3, "millimetres", "mm"),
];

/// Whether a ratio is `size` up to [`RATIO_TOLERANCE`].
fn is_near(slope: f64, size: f64) -> bool {
    (slope / size - 1.0).abs() < RATIO_TOLERANCE
}

/// The mistake of a velocity that is `slope` times the rate of its position.
fn scaled(slope: f64, name: &str, position: &str, velocity: &str) -> Unfit {
    let head =
        format!("column `{velocity}` is {slope:.3} times the velocity of column `{position}`");
    let known = |units: &[(f64, &'static str, &'static str)]| {
        let found = units.iter().find(|(size, ..)| is_near(slope, *size));
        found.map(|(_, words, unit)| (*words, *unit))
    };
    let (column, words, assignment) = if let Some((words, unit)) = known(&OF_VELOCITIES) {
        (velocity, words, format!("qd_{name}={velocity}:{unit}"))
    } else if let Some((words, unit)) = known(&OF_POSITIONS) {
        (position, words, format!("{name}={position}:{unit}"))
    } else {
        return Unfit {
            why: format!("{head}: a unit or a gear is missing. Read one of them with"),
            assignment: Some(format!("qd_{name}={velocity}*{:.3}", 1.0 / slope)),
        };
    };
    Unfit {
        why: format!("{head}: column `{column}` looks like {words}. Read it with"),
        assignment: Some(assignment),
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
        let pairs = ["q1", "q2"].map(|q| [q.to_owned(), q.to_owned(), format!("v_{q}")]);
        let unfit = rates.judge(&pairs, "t")?;
        Some(match unfit.assignment {
            Some(assignment) => format!("{} {assignment}", unfit.why),
            None => unfit.why,
        })
    }

    #[test]
    fn velocities_of_other_joints_are_reported() {
        assert_eq!(verdict(|row| row), None);
        let flipped = verdict(|[a, b, c, d]| [a, b, c, -d]).unwrap_or_default();
        assert!(
            flipped.ends_with("flipped. Read that with qd_q2=v_q2*-1"),
            "{flipped}"
        );
        let swapped = verdict(|[a, b, c, d]| [a, b, d, c]).unwrap_or_default();
        assert!(
            swapped.contains("fits column `q2`") && swapped.ends_with("qd_q1=v_q2"),
            "{swapped}"
        );
        for (factor, position, expected) in [
            (
                57.3,
                false,
                "`v_q1` looks like degrees per second. Read it with qd_q1=v_q1:deg/s",
            ),
            (
                57.3,
                true,
                "`q1` looks like degrees. Read it with q1=q1:deg",
            ),
            (
                45.0,
                false,
                "a unit or a gear is missing. Read one of them with qd_q1=v_q1*0.022",
            ),
        ] {
            let found = verdict(|[a, b, c, d]| {
                if position {
                    [factor * a, b, c, d]
                } else {
                    [a, b, factor * c, d]
                }
            });
            let found = found.unwrap_or_default();
            assert!(found.ends_with(expected), "{found}");
        }
        let clock = verdict(|[a, b, c, d]| [a, b, 1e3 * c, 1e3 * d]).unwrap_or_default();
        assert!(clock.ends_with("Read it with t=t:ms"), "{clock}");
        let other = verdict(|[a, b, _, d]| [a, b, a, d]).unwrap_or_default();
        assert!(other.contains("at least 0.7"), "{other}");
        let unread = verdict(|[a, b, c, _]| [a, b, c, 0.0]).unwrap_or_default();
        assert!(unread.contains("`v_q2` is 0"), "{unread}");
        // noise of a joint at rest, whatever its velocity is
        assert_eq!(
            verdict(|[a, b, c, _]| [a, 1e-4 * (1e5 * b).sin(), c, a]),
            None
        );
        // a joint that does not move
        assert_eq!(verdict(|[a, _, c, _]| [a, 0.3, c, 0.0]), None);
    }
}
