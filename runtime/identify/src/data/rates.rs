//! Checks measured velocities against the changes of the measured positions, and measured
//! accelerations against those of the velocities.

use super::layout::Unfit;

/// The number of rows over which a velocity is integrated, so that noise of single rows averages out.
const STRETCH_ROWS: usize = 64;
/// A step of so many times the longest one of this stretch and the last is a gap, if the first stretch has so many rows.
const GAP: f64 = 8.0;
const MIN_ROWS_BEFORE_GAP: usize = 8;
/// With fewer stretches than this, nothing is reported.
const MIN_STRETCHES: f64 = 8.0;
/// If a position's change and its velocity's integral have a lower correlation, the column contains
/// another signal.
const MIN_CORRELATION: f64 = 0.7;
/// If the ratio of a velocity's integral to the position's change is outside `1/MAX_RATIO ..
/// MAX_RATIO`, the column is in another unit.
const MAX_RATIO: f64 = 1.5;
/// As [`MAX_RATIO`], where the correlation is above [`MIN_SAME_CORRELATION`]: neither noise nor the
/// delay of a filter explains such a ratio.
const MAX_SAME_RATIO: f64 = 1.07;
/// The part of the squared integrals of an acceleration that neither the changes of the velocity nor noise explain, from
/// which on it is another signal, such as a command.
const MAX_UNEXPLAINED_PART: f64 = 0.1;
/// With a higher correlation, both are the same motion but for a factor.
const MIN_SAME_CORRELATION: f64 = 0.995;

/// A position moves if its rms change over a stretch is at least this many times its rms change
/// between rows. The ratio is about 1 for noise, and [`STRETCH_ROWS`] for a steady motion.
const MIN_MOTION: f64 = 8.0;
/// A ratio is one of a unit's if it differs by less than this part, because of noise and filters.
const RATIO_TOLERANCE: f64 = 0.1;

/// A column and the one that it should be the rate of.
#[derive(Clone, Debug)]
pub(super) struct Pair {
    /// The name of the coordinate.
    pub(super) name: String,
    /// The title of the column of the position.
    pub(super) position: String,
    /// The title of the column of the velocity.
    pub(super) velocity: String,
    /// The factors that both are read with.
    pub(super) factors: [f64; 2],
    /// The widest range of positions that the joint has or, without limits, joints have.
    pub(super) widest: f64,
}

/// Which ratios of a rate to its derivative are mistakes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Strictness {
    /// Those of which the log cannot be used.
    Refused,
    /// Those that neither noise nor the delay of a filter explains.
    Doubted,
}

/// What is compared, in words.
#[derive(Clone, Copy, Debug)]
pub(super) struct Words {
    /// The column that is integrated.
    rate: &'static str,
    /// The column whose change that is.
    of: &'static str,
    /// The prefix of the quantity that is integrated, and that of the other.
    prefixes: [&'static str; 2],
}

/// Velocities, integrated, are the changes of positions.
pub(super) const VELOCITIES: Words = Words {
    rate: "velocity",
    of: "position",
    prefixes: ["qd_", ""],
};
/// Accelerations, integrated, are the changes of velocities.
pub(super) const ACCELERATIONS: Words = Words {
    rate: "acceleration",
    of: "velocity",
    prefixes: ["qdd_", "qd_"],
};

impl Words {
    /// Whether accelerations are integrated.
    fn is_of_accelerations(self) -> bool {
        self.prefixes == ACCELERATIONS.prefixes
    }
}

/// Accumulates products of the positions' changes and the velocities' integrals over stretches.
#[derive(Clone, Debug, Default)]
pub(super) struct Rates {
    start: Vec<f64>,
    integral: Vec<f64>,
    last: Vec<f64>,
    rows: usize,
    /// The longest step between rows of the present stretch, and that of the last one.
    longest: [f64; 2],
    stretches: f64,
    /// Sums of squared changes, of squared integrals, and of products of the change of position k
    /// with the integral of velocity j, at k * m + j.
    change_squares: Vec<f64>,
    /// The smallest and the largest position.
    ranges: Vec<[f64; 2]>,
    /// Sums of squared changes between rows.
    step_squares: Vec<f64>,
    integral_squares: Vec<f64>,
    products: Vec<f64>,
    /// Sums of squared changes of the velocities between rows, times the square of their steps.
    rate_squares: Vec<f64>,
}

impl Rates {
    /// Adds the next row: time, `m` positions, `m` velocities.
    pub(super) fn push(&mut self, m: usize, row: &[f64]) {
        if self.change_squares.len() != m {
            self.change_squares = vec![0.0; m];
            self.ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; m];
            self.step_squares = vec![0.0; m];
            self.integral_squares = vec![0.0; m];
            self.products = vec![0.0; m * m];
            self.rate_squares = vec![0.0; m];
        }
        for ([low, high], own) in self.ranges.iter_mut().zip(&row[1..]) {
            (*low, *high) = (low.min(*own), high.max(*own));
        }
        let step = self.last.first().map_or(0.0, |last| row[0] - last);
        let [own, usual] = self.longest;
        let is_usual_known = usual > 0.0 || self.rows >= MIN_ROWS_BEFORE_GAP;
        if is_usual_known && step > GAP * own.max(usual) {
            self.pause();
        }
        if self.rows == 0 {
            self.start = row.to_vec();
            self.integral = vec![0.0; m];
            self.longest = [0.0, usual];
        } else {
            self.longest = [own.max(step), usual];
            for (k, sum) in self.integral.iter_mut().enumerate() {
                *sum += 0.5 * step * (row[1 + m + k] + self.last[1 + m + k]);
                self.step_squares[k] += (row[1 + k] - self.last[1 + k]).powi(2);
                let change = row[1 + m + k] - self.last[1 + m + k];
                self.rate_squares[k] += (step * change).powi(2);
            }
        }
        self.last = row.to_vec();
        self.rows += 1;
        if self.rows <= STRETCH_ROWS {
            return;
        }
        self.rows = 0;
        self.longest[1] = self.longest[0];
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

    /// The factor by which all velocities are too large, if no unit of theirs is why, see [`common`].
    pub(super) fn common_factor(&self) -> Option<f64> {
        let m = self.change_squares.len();
        let slopes = (0..m).map(|k| (k, self.products[k * m + k] / self.change_squares[k]));
        common(&slopes.collect::<Vec<_>>())
    }

    /// The mistakes of velocity columns that do not fit their positions; `None` if all fit. Signs and factors are
    /// told of all columns at once, each with its assignment in a line, what is no such motion of the first only.
    /// Positions that hardly move are not judged.
    ///
    /// - `pairs`: the columns of each coordinate;
    /// - `clock`: the title of the column of time; empty without one;
    /// - `words`: what is compared.
    pub(super) fn judge(
        &self,
        pairs: &[Pair],
        clock: &str,
        words: Words,
        strictness: Strictness,
    ) -> Option<Unfit> {
        let Words {
            rate,
            of,
            prefixes: [prefix, _],
        } = words;
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
        // the velocity that fits a position best
        let partner = |k: usize| {
            let moving = (0..m).filter(|j| moves(k) && moves(*j));
            let fitting = moving.map(|j| (j, correlation(k, j).abs()));
            let best = fitting.filter(|own| own.1 > MIN_CORRELATION);
            best.max_by(|a, b| a.1.total_cmp(&b.1)).map(|own| own.0)
        };
        let slopes: Vec<(usize, f64)> = (0..m)
            .filter(|k| moves(*k) && correlation(*k, *k) > MIN_CORRELATION)
            .map(|k| (k, self.products[k * m + k] / self.change_squares[k]))
            .collect();
        // a wrong unit of time changes all velocities alike, whatever else is wrong with some
        let best = |k: usize| {
            let fits = |j: &usize| moves(*j) && correlation(k, *j).abs() > MIN_CORRELATION;
            let other = (0..m).find(fits).filter(|_| moves(k));
            let of = if fits(&k) { Some(k) } else { other };
            of.map(|j| (self.products[k * m + j] / self.change_squares[k]).abs())
        };
        let sizes: Vec<f64> = (0..m).filter_map(best).collect();
        let of_time = clock_of(&sizes);
        if let (Some((_, unit)), false) = (of_time, clock.is_empty()) {
            return Some(Unfit {
                why: format!(
                    "column `{clock}` looks like {unit}: the changes of the positions are not the \
                     integrals of the velocities. Read it with"
                ),
                assignment: Some(format!("t={clock}:{unit}")),
            });
        }
        if let (Some(slope), false) = (common(&slopes), clock.is_empty()) {
            return Some(Unfit {
                why: format!(
                    "the velocities are {slope:.3} times those of the positions: column `{clock}` is not in \
                     s, or the rate of the rows is another one. Read it with"
                ),
                assignment: Some(format!("t={clock}*{}", figure(1.0 / slope))),
            });
        }
        let (mut found, mut other_signals): (Vec<Unfit>, Vec<String>) = (Vec::new(), Vec::new());
        for (k, pair) in pairs.iter().enumerate().take(m) {
            let Pair {
                name,
                position,
                velocity,
                factors: [_, factor],
                ..
            } = pair;
            if !moves(k) {
                continue;
            }
            let own = correlation(k, k);
            if !own.is_finite() && found.is_empty() {
                return Some(Unfit::from(format!(
                    "column `{velocity}` is 0 while column `{position}` moves: leave it out"
                )));
            }
            let head = format!(
                "column `{velocity}` is not the {rate} of column `{position}`: over \
                 {STRETCH_ROWS} rows its integral has the correlation {own:.2} with the {of}'s \
                 change"
            );
            let other = partner(k).filter(|j| *j != k);
            let is_other = own.abs() < MIN_SAME_CORRELATION
                && other.is_some_and(|j| correlation(k, j).abs() > MIN_SAME_CORRELATION);
            if own < -MIN_CORRELATION && !is_other {
                found.push(Unfit {
                    why: format!("{head}; the sign of one of them is flipped. Read that with"),
                    assignment: Some(format!("{prefix}{name}={velocity}*{}", -factor)),
                });
                continue;
            }
            // of another signal no assignment is sure beside other mistakes
            if !found.is_empty() && (own <= MIN_CORRELATION || is_other) {
                continue;
            }
            if own < MIN_CORRELATION || is_other {
                // all velocities of the exchange at once, as one column is not read twice
                let apart = |k: &usize| partner(*k).is_some_and(|j| j != *k);
                let exchanged: Vec<usize> = (0..m).filter(apart).collect();
                let mut from: Vec<usize> = exchanged.iter().filter_map(|k| partner(*k)).collect();
                let of = |k: &usize| {
                    let (to, j) = (pairs.get(*k)?, partner(*k)?);
                    let sign = if correlation(*k, j) < 0.0 { "*-1" } else { "" };
                    Some(format!(
                        "{prefix}{}={}{sign}",
                        to.name,
                        pairs.get(j)?.velocity
                    ))
                };
                let options: Vec<String> = exchanged.iter().filter_map(of).collect();
                let fits = |j: &usize| *j != k && partner(*j) == Some(k);
                let other = (0..m).find(fits).and_then(|j| pairs.get(j));
                from.sort_unstable();
                return Some(match other.filter(|_| from == exchanged) {
                    Some(Pair {
                        position: other, ..
                    }) => Unfit {
                        why: format!(
                            "{head}; it fits column `{other}`: these velocities are swapped, or \
                             their positions. Read each as the other, such as"
                        ),
                        assignment: Some(options.join("\n")),
                    },
                    None => format!(
                        "{head}; at least {MIN_CORRELATION} is expected. Leave it out, or give \
                         --velocities computed, which uses positions only"
                    )
                    .into(),
                });
            }
            let slope = self.products[k * m + k] / self.change_squares[k];
            let is_same = own > MIN_SAME_CORRELATION;
            let most = if is_same && strictness == Strictness::Doubted {
                MAX_SAME_RATIO
            } else {
                MAX_RATIO
            };
            if !(1.0 / most..most).contains(&slope) {
                let [low, high] = self.ranges[k];
                found.push(scaled(slope, pair, words, high - low));
            } else if strictness == Strictness::Doubted && words.is_of_accelerations() {
                // of white noise, the change between rows is twice what a row adds to the integral
                let noise = 0.5 * self.rate_squares[k] / self.integral_squares[k];
                if 1.0 - own * own > MAX_UNEXPLAINED_PART + noise {
                    other_signals.push(format!("`{velocity}` ({own:.2} with `{position}`)"));
                }
            }
        }
        if found.is_empty() && !other_signals.is_empty() {
            return Some(Unfit::from(format!(
                "these columns are not the {rate}s of the measured motion, but may be commands: {}, the \
                 correlation of its integral over {STRETCH_ROWS} rows with the {of}'s change. Leave them out, \
                 so that {rate}s are computed",
                other_signals.join(", ")
            )));
        }
        together(found)
    }
}

/// Several mistakes as one, whose assignments are lines.
fn together(mut found: Vec<Unfit>) -> Option<Unfit> {
    if found.len() < 2 {
        return found.pop();
    }
    let what = |own: &Unfit| {
        let end = own.why.rfind(". ").unwrap_or(own.why.len());
        own.why[..end].to_owned()
    };
    let each: Vec<String> = found.iter().map(what).collect();
    let assignments: Option<Vec<String>> = found.into_iter().map(|own| own.assignment).collect();
    Some(Unfit {
        why: format!("{}. Read each in another way, with", each.join("; ")),
        assignment: Some(assignments?.join("\n")),
    })
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

/// The unit of time that most ratios of a velocity to the rate of its position have in common, where none is
/// right; another unit of all velocities is no reason against it.
fn clock_of(sizes: &[f64]) -> Option<(f64, &'static str)> {
    if sizes.len() < 2 || sizes.iter().any(|size| is_near(*size, 1.0)) {
        return None;
    }
    let units = OF_VELOCITIES.iter().chain(&OF_POSITIONS).map(|own| own.0);
    let with_units = units.flat_map(|unit| CLOCKS.map(|(size, name)| (size * unit, (size, name))));
    let plain = CLOCKS.map(|own| (own.0, own));
    let have = |of: f64| sizes.iter().filter(|size| is_near(**size, of)).count();
    let mut tried = plain.into_iter().chain(with_units);
    tried
        .find(|(of, _)| 2 * have(*of) > sizes.len())
        .map(|own| own.1)
}

/// The factor by which most velocities, of two positions at least, are too large, if none is right and no unit of
/// theirs is why: then the clock is wrong.
fn common(slopes: &[(usize, f64)]) -> Option<f64> {
    let same = |of: f64| {
        let near = |own: &&(usize, f64)| (own.1 / of - 1.0).abs() < COMMON_TOLERANCE;
        slopes.iter().filter(near).count()
    };
    let mut all = slopes.iter().map(|own| own.1);
    let most = all.find(|of| 2 * same(*of) > slopes.len() && same(*of) > 1)?;
    let mut units = OF_VELOCITIES.iter().map(|own| own.0);
    let mut others = OF_POSITIONS.iter().map(|own| own.0);
    let is_unit = units.any(|size| is_near(most, size))
        || others.any(|size| is_near(most, size))
        || is_near(most, PER_SECOND);
    let is_large = !(1.0 / MAX_RATIO..MAX_RATIO).contains(&most);
    let is_one_right = slopes.iter().any(|own| is_near(own.1, 1.0));
    (is_large && !is_unit && !is_one_right).then_some(most)
}

/// Whether a ratio is `size` up to [`RATIO_TOLERANCE`].
fn is_near(slope: f64, size: f64) -> bool {
    (slope / size - 1.0).abs() < RATIO_TOLERANCE
}

/// The ratio of revolutions per second.
const PER_SECOND: f64 = 0.159_154_943_091_895_35;
/// Ratios of all velocities that differ by less than this part have one cause.
const COMMON_TOLERANCE: f64 = 0.02;

/// The mistake of a velocity that is `slope` times the rate of its position.
///
/// - `width`: the range of the positions.
fn scaled(slope: f64, pair: &Pair, words: Words, width: f64) -> Unfit {
    let Pair {
        name,
        position,
        velocity,
        factors,
        widest,
    } = pair;
    let Words {
        rate,
        prefixes: [prefix, of],
        ..
    } = words;
    let head = format!("column `{velocity}` is {slope:.3} times the {rate} of column `{position}`");
    let known = |units: &[(f64, &'static str, &'static str)]| {
        let found = units.iter().find(|(size, ..)| is_near(slope, *size));
        found.map(|(_, words, unit)| (*words, *unit))
    };
    // a column that has a factor already keeps it, and a unit its sign
    let is_plain = factors
        .iter()
        .all(|factor| (factor.abs() - 1.0).abs() < f64::EPSILON);
    let sign = |factor: f64| if factor < 0.0 { "*-1" } else { "" };
    let has_units = of.is_empty() && is_plain;
    let (column, words, assignment) =
        if let (Some((words, unit)), true) = (known(&OF_VELOCITIES), has_units) {
            (
                velocity,
                words,
                format!("{prefix}{name}={velocity}:{unit}{}", sign(factors[1])),
            )
        } else if let (Some((words, unit)), true) = (known(&OF_POSITIONS), has_units) {
            (
                position,
                words,
                format!("{of}{name}={position}:{unit}{}", sign(factors[0])),
            )
        } else if of.is_empty() && width > *widest && width * slope < *widest {
            let words = "values before a gear or counts: the joint does not move so far";
            let factor = figure(factors[0] * slope);
            (position, words, format!("{of}{name}={position}*{factor}"))
        } else {
            return Unfit {
                why: format!("{head}: a unit or a gear is missing. Read one of them with"),
                assignment: Some(format!(
                    "{prefix}{name}={velocity}*{}",
                    figure(factors[1] / slope)
                )),
            };
        };
    Unfit {
        why: format!("{head}: column `{column}` looks like {words}. Read it with"),
        assignment: Some(assignment),
    }
}

/// A factor with four significant digits.
fn figure(factor: f64) -> f64 {
    format!("{factor:.3e}").parse().unwrap_or(factor)
}

#[cfg(test)]
mod tests {
    use super::common;

    #[test]
    fn a_factor_of_most_velocities_is_that_of_the_clock_if_none_is_right() {
        let of = |slopes: &[f64]| {
            let all = slopes.iter().copied().enumerate();
            common(&all.collect::<Vec<_>>())
        };
        assert_eq!(of(&[4.0, 4.0]), Some(4.0));
        // one position is in mm besides
        assert_eq!(of(&[4.0, 4e-3, 4.0]), Some(4.0));
        assert_eq!(of(&[4.0, 1.0, 4.0]), None);
        assert_eq!(of(&[4.0, 3.0]), None);
        assert_eq!(of(&[4.0]), None);
        // degrees per second
        assert_eq!(of(&[57.3, 57.3]), None);
    }

    fn pair(name: &str) -> super::Pair {
        super::Pair {
            widest: f64::INFINITY,
            name: name.to_owned(),
            position: name.to_owned(),
            velocity: format!("v{name}"),
            factors: [1.0; 2],
        }
    }

    /// What is said of velocities that are so many times the rates of two positions.
    fn said(factors: [f64; 2]) -> Option<(String, Option<String>)> {
        said_with_gap(factors, 0, 0.0)
    }

    /// The same, where the clock jumps on by so much before a row, s.
    fn said_with_gap(factors: [f64; 2], first: u32, gap: f64) -> Option<(String, Option<String>)> {
        let mut rates = super::Rates::default();
        for k in 0..3000 {
            let t = 0.002 * f64::from(k);
            let (a, b) = ((2.0 * t).sin_cos(), (3.1 * t).sin_cos());
            let row = [
                if k < first { t } else { t + gap },
                a.0,
                0.4 * b.0,
                factors[0] * 2.0 * a.1,
                factors[1] * 1.24 * b.1,
            ];
            rates.push(2, &row);
        }
        let pairs = [pair("q1"), pair("q2")];
        let found = rates.judge(
            &pairs,
            "time",
            super::VELOCITIES,
            super::Strictness::Refused,
        );
        found.map(|own| (own.why, own.assignment))
    }

    #[test]
    fn a_gap_in_the_times_says_nothing_of_velocities() {
        for (row, gap) in [(1500, 0.5), (1500, 3.0), (20, 60.0)] {
            assert_eq!(said_with_gap([1.0, 1.0], row, gap), None);
            assert!(said_with_gap([1.0, -1.0], row, gap).is_some());
        }
    }

    #[test]
    fn a_position_that_moves_farther_than_its_joint_is_wrong_and_not_its_velocity() {
        let own = super::Pair {
            widest: 4.0,
            ..pair("q1")
        };
        let read = |slope: f64, width: f64| {
            let found = super::scaled(slope, &own, super::VELOCITIES, width);
            found.assignment.unwrap_or_default()
        };
        assert_eq!(read(0.01, 150.0), "q1=q1*0.01");
        assert_eq!(read(0.01, 3.0), "qd_q1=vq1*100");
        // with the factor it would still move too far
        assert_eq!(read(0.1, 150.0), "qd_q1=vq1*10");
    }

    #[test]
    fn accelerations_that_are_commands_are_doubted_and_noisy_ones_are_not() {
        let mut random = crate::intervals::Random(5);
        let mut said = |of: &mut dyn FnMut(f64, &mut crate::intervals::Random) -> f64| {
            let mut rates = super::Rates::default();
            for k in 0..6000 {
                let t = 0.002 * f64::from(k);
                rates.push(
                    1,
                    &[t, (2.0 * t).sin(), of(2.0 * (2.0 * t).cos(), &mut random)],
                );
            }
            let found = rates.judge(
                &[pair("qd_q1")],
                "",
                super::ACCELERATIONS,
                super::Strictness::Doubted,
            );
            found.map(|own| own.why)
        };
        assert_eq!(said(&mut |a, _| a), None);
        assert_eq!(said(&mut |a, random| a + 8.0 * random.normal()), None);
        let command = said(&mut |a, _| if a.abs() > 1.5 { 2.4 * a.signum() } else { 0.0 });
        let command = command.unwrap_or_default();
        assert!(command.contains("`vqd_q1` (0.9"), "{command}");
    }

    #[test]
    fn velocities_that_are_all_too_large_by_one_factor_tell_another_rate_of_the_rows() {
        assert_eq!(said([1.0; 2]), None);
        for factor in [4.0, 0.25] {
            let (why, assignment) = said([factor; 2]).unwrap_or_default();
            assert!(why.contains("the rate of the rows is another one"), "{why}");
            assert_eq!(assignment, Some(format!("t=time*{}", 1.0 / factor)));
        }
        // in ms
        let (why, _) = said([1e3; 2]).unwrap_or_default();
        assert!(why.contains("looks like ms"), "{why}");
        // of a single one, the velocity is wrong
        let (why, assignment) = said([1.0, 4.0]).unwrap_or_default();
        assert!(why.contains("`vq2` is 4.000 times"), "{why}");
        assert_eq!(assignment.as_deref(), Some("qd_q2=vq2*0.25"));
        let (why, _) = said([-1.0, 1.0]).unwrap_or_default();
        assert!(why.contains("sign"), "{why}");
        // two mistakes are told together
        let (why, assignment) = said([-1.0, 57.3]).unwrap_or_default();
        assert!(
            why.contains("`vq1`") && why.contains("`vq2` looks like degrees per second"),
            "{why}"
        );
        assert_eq!(assignment.as_deref(), Some("qd_q1=vq1*-1\nqd_q2=vq2:deg/s"));
    }
}
