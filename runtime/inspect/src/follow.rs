//! Finds the joint that each effort belongs to, whether both have the same sign, and the delay of the
//! effort.
//!
//! The friction of a joint acts on its own effort and on no other. Each effort is regressed on the
//! positions, velocities, directions and accelerations of all joints; the joint whose velocity and
//! direction explain most of it is its joint, and the sign of their contribution is its sign.

use regen_identify::signals::Butterworth;
use serde::Serialize;

use crate::clock::median;
use crate::gather::Stretch;
use crate::solve::{Normal, Solved};

/// Order of the filter of positions and efforts.
const FILTER_ORDER: usize = 4;
/// The cutoff of the filter of positions, divided by that of the efforts and of the columns of the
/// regression.
const POSITION_CUTOFF_RATIO: f64 = 3.0;
/// The widths of the two shapes in which friction changes its sign with the direction of motion, as
/// parts of the usual speed: nearly at once, and gradually.
const DIRECTION_WIDTHS: [f64; 2] = [0.02, 0.2];
/// The least share of an effort's variance by which a joint is assigned to it, divided by the share
/// that no joint explains.
const MIN_SHARE: f64 = 0.15;
/// Smaller shares are rounding errors and are ignored.
const ROUNDING_SHARE: f64 = 1e-6;
/// How many times more of an effort its joint must explain than any other joint.
const MIN_SHARE_RATIO: f64 = 2.0;
/// The least correlation of the identified friction with the velocity, or with its direction, in the
/// regression on all joints or in that on weights and one joint, whose rest contains more.
const MIN_CORRELATION: f64 = 0.6;
/// The least in both of them.
const MIN_CORRELATION_IN_BOTH: f64 = 0.3;
/// The least part of an effort's variance that must be explained before a delay is looked for.
const MIN_EXPLAINED: f64 = 0.5;
/// How often the effort is shifted by the estimated delay and the delay estimated again.
const DELAY_PASSES: usize = 4;
/// The number of blocks of time in which the delay is estimated, for its standard deviation.
const BLOCKS: usize = 10;
/// An effort that precedes its motion by this many standard deviations shows an effect that the
/// regression lacks and that looks like a delay, so that no delay is stated. One of seven efforts
/// without any delay does so by chance in one log of six, of which nothing is then stated: that is
/// better than wrong delays of the others.
const MIN_LEAD_DEVIATIONS: f64 = 2.0;
/// The least standard deviation with which an effort is judged to precede its motion, in steps:
/// differences between samples, as which rates are computed, are no better.
const LEAST_DEVIATION_STEPS: f64 = 0.05;
/// The part of the cutoff with which delays are found a second time: what seems to be a delay and is
/// not changes with the cutoff.
const SLOW_PART: f64 = 0.5;
/// The length of each end of a stretch that is left out, in periods of the cutoff.
const MARGIN_PERIODS: f64 = 1.0;
/// The least number of rows for each column of the regression.
const ROWS_PER_COLUMN: usize = 4;
/// The columns of the regression for one joint.
const COLUMNS_PER_JOINT: usize = 6;

/// The joint whose motion an effort follows.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Following {
    /// The number of the effort's column, from 1.
    pub column: usize,
    /// The joint to which its name or its place assigns it.
    pub joint: String,
    /// The joint whose friction and inertia it contains; `None` if no joint is clear.
    pub follows: Option<String>,
    /// Whether its sign is the opposite of that joint's motion.
    pub reversed: bool,
    /// The part of its variance that the motion of all joints explains.
    pub explained: f64,
    /// For each joint, the part of its variance that only this joint's velocity and direction
    /// explain; if no joint shows friction, also its acceleration.
    pub shares: Vec<f64>,
    /// The delay with respect to the motion, s, with its standard deviation; `None` if the motion
    /// explains too little of the effort, or an effort seems to precede its motion.
    pub delay: Option<[f64; 2]>,
}

/// Filtered positions and efforts on an even grid of times.
struct Filtered {
    positions: Vec<Vec<f64>>,
    efforts: Vec<Vec<f64>>,
}

/// The values at the times of an even grid, interpolated linearly.
fn even(times: &[f64], values: &[f64], step: f64) -> Vec<f64> {
    let (Some(start), Some(end)) = (times.first(), times.last()) else {
        return Vec::new();
    };
    #[allow(clippy::cast_sign_loss, reason = "times ascend")]
    let count = ((end - start) / step + 0.5).max(0.0) as usize + 1;
    let mut k = 0;
    (0..count)
        .map(|n| {
            let t = start + n as f64 * step;
            while k + 2 < times.len() && times[k + 1] < t {
                k += 1;
            }
            let (a, b) = (times[k], times[(k + 1).min(times.len() - 1)]);
            let part = if b > a {
                ((t - a) / (b - a)).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let next = values[(k + 1).min(values.len() - 1)];
            values[k] + part * (next - values[k])
        })
        .collect()
}

/// The derivative by central differences.
fn slope(values: &[f64], step: f64) -> Vec<f64> {
    let n = values.len();
    (0..n)
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
            (values[b] - values[a]) / ((b - a).max(1) as f64 * step)
        })
        .collect()
}

/// The values `by` samples later, interpolated by a cubic; the first and the last are repeated.
fn shifted(values: &[f64], by: f64) -> Vec<f64> {
    let n = values.len();
    // the value at a sample; beyond the ends, the first or the last one
    let at = |k: f64| {
        #[allow(clippy::cast_sign_loss, reason = "clamped")]
        let place = k.clamp(0.0, n.saturating_sub(1) as f64) as usize;
        values[place]
    };
    (0..n)
        .map(|k| {
            let place = k as f64 + by;
            let left = place.floor();
            let x = place - left;
            let [a, b, c, d] = [-1.0, 0.0, 1.0, 2.0].map(|off| at(left + off));
            let bend = 2.0 * a - 5.0 * b + 4.0 * c - d + x * (3.0 * (b - c) + d - a);
            b + 0.5 * x * (c - a + x * bend)
        })
        .collect()
}

/// The signals from which the regression is computed.
pub(crate) struct RegressionInput<'a> {
    pub(crate) stretches: &'a [Stretch],
    /// The time between values, s.
    pub(crate) step: f64,
    /// The cutoff of the filter, Hz.
    pub(crate) cutoff: f64,
    /// Positions and names of the joints.
    pub(crate) joints: Vec<(Signal, String)>,
    /// The efforts, each with the joint that it is assigned to, as an index into `joints`, and the
    /// number of its column.
    pub(crate) efforts: Vec<(Signal, usize, usize)>,
}

/// A column and the factor of its unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Signal {
    pub(crate) column: usize,
    pub(crate) factor: f64,
}

/// Positions and efforts that passed the filters, the rows of the regression, and its equations.
struct Regression {
    filtered: Vec<Filtered>,
    rows: Vec<Vec<Vec<f64>>>,
    width: usize,
    /// The number of values at each end of a stretch that are left out.
    margin: usize,
    normal: Normal,
}

impl Regression {
    /// Filters the signals and sets up the equations; `None` if there are too few rows.
    fn new(motion: &RegressionInput<'_>) -> Option<Self> {
        let filter = |cutoff: f64| Butterworth::new(FILTER_ORDER, cutoff, motion.step).ok();
        let (narrow, wide) = (
            filter(motion.cutoff),
            filter(POSITION_CUTOFF_RATIO * motion.cutoff),
        );
        let pass = |filter: &Option<Butterworth>, values: Vec<f64>| match filter {
            Some(filter) => filter.zero_phase(&values).ok(),
            None => Some(values),
        };
        let mut filtered: Vec<Filtered> = Vec::new();
        for stretch in motion.stretches {
            let column = |signal: Signal, filter: &Option<Butterworth>| {
                let values = stretch.columns.get(signal.column)?;
                let mut values = even(&stretch.times, values, motion.step);
                for value in &mut values {
                    *value *= signal.factor;
                }
                pass(filter, values)
            };
            let positions: Option<Vec<_>> =
                motion.joints.iter().map(|j| column(j.0, &wide)).collect();
            let efforts: Option<Vec<_>> = motion
                .efforts
                .iter()
                .map(|e| column(e.0, &narrow))
                .collect();
            if let Some((positions, efforts)) = positions.zip(efforts) {
                filtered.push(Filtered { positions, efforts });
            }
        }
        let mut rows: Vec<Vec<Vec<f64>>> = basis(&filtered, motion);
        // efforts and regressor pass the same filter, which keeps the equations valid although
        // friction is not smooth
        for rows in &mut rows {
            for k in 1..rows.first().map_or(0, Vec::len) {
                let values: Vec<f64> = rows.iter().map(|row| row[k]).collect();
                let Some(values) = pass(&narrow, values) else {
                    continue;
                };
                for (row, value) in rows.iter_mut().zip(values) {
                    row[k] = value;
                }
            }
        }
        let total: usize = rows.iter().map(Vec::len).sum();
        let width = rows.iter().flatten().next().map_or(0, Vec::len);
        if width == 0 || total < ROWS_PER_COLUMN * width {
            return None;
        }
        #[allow(clippy::cast_sign_loss, reason = "positive")]
        let margin = (MARGIN_PERIODS / motion.cutoff / motion.step).ceil() as usize;
        let normal = Normal::new(width, inner(&rows, margin).flatten())?;
        Some(Self {
            filtered,
            rows,
            width,
            margin,
            normal,
        })
    }

    /// One effort in each stretch.
    fn effort(&self, e: usize) -> Vec<Vec<f64>> {
        self.filtered.iter().map(|f| f.efforts[e].clone()).collect()
    }

    /// The delay of an effort that is explained well enough, with its standard deviation.
    fn delay(&self, e: usize, motion: &RegressionInput<'_>) -> Option<[f64; 2]> {
        delay(
            &self.normal,
            &self.rows,
            self.effort(e),
            self.margin,
            motion,
        )
    }
}

/// Finds the joint, the sign and the delay of each effort.
pub(crate) fn follow(motion: &RegressionInput<'_>) -> Vec<Following> {
    let n = motion.joints.len();
    let Some(regression) = Regression::new(motion) else {
        return Vec::new();
    };
    let Regression {
        rows,
        width,
        margin,
        normal,
        ..
    } = &regression;
    let (width, margin) = (*width, *margin);
    let mut out = Vec::new();
    for (e, (_, joint, number)) in motion.efforts.iter().enumerate() {
        let efforts = regression.effort(e);
        let solved = regress(normal, rows, &efforts, margin);
        let mut found = Following {
            column: *number,
            joint: motion.joints.get(*joint).map_or("", |j| &j.1).to_owned(),
            explained: solved.explained(),
            ..Following::default()
        };
        let first = |j: usize| 1 + COLUMNS_PER_JOINT * j;
        // the columns of a joint: sine, cosine, acceleration, velocity, and two of direction
        let of_friction = |j: usize| [first(j) + 3, first(j) + 4, first(j) + 5];
        let friction: Vec<f64> = (0..n)
            .map(|j| normal.share(&solved, &of_friction(j)))
            .collect();
        let least = (MIN_SHARE * (1.0 - found.explained)).max(ROUNDING_SHARE);
        let shows = friction.iter().any(|share| *share >= least);
        found.shares = if shows {
            friction
        } else {
            (0..n)
                .map(|j| {
                    let [v, sharp, wide] = of_friction(j);
                    normal.share(&solved, &[first(j) + 2, v, sharp, wide])
                })
                .collect()
        };
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| found.shares[*b].total_cmp(&found.shares[*a]));
        let share = |k: usize| order.get(k).map_or(0.0, |j| found.shares[*j]);
        if share(0) >= least && share(0) >= MIN_SHARE_RATIO * share(1) {
            let j = order[0];
            // velocities of a few harmonics are nearly made up of positions and accelerations, the
            // change of direction is not
            let (terms, candidates) = if shows {
                (of_friction(j).to_vec(), vec![first(j) + 3, first(j) + 4])
            } else {
                (vec![first(j) + 2], vec![first(j) + 2])
            };
            // weights and this joint alone: if joints move in step, a regression on all may
            // distribute their friction with any sign
            let alone: Vec<usize> = (0..width)
                .filter(|k| {
                    let of_weight = *k > COLUMNS_PER_JOINT * n
                        || (*k - usize::from(*k > 0)) % COLUMNS_PER_JOINT < 2;
                    of_weight || (first(j)..first(j) + COLUMNS_PER_JOINT).contains(k)
                })
                .collect();
            let all: Vec<usize> = (0..width).collect();
            let [with_all, with_own] = [&all, &alone]
                .map(|fitted| normal.own_correlation(&solved, fitted, &terms, &candidates));
            // friction is against the motion, and inertia against the acceleration
            let (one, other) = (with_all.abs(), with_own.abs());
            let is_clear =
                one.max(other) >= MIN_CORRELATION && one.min(other) >= MIN_CORRELATION_IN_BOTH;
            if is_clear && with_all * with_own > 0.0 {
                found.follows = motion.joints.get(j).map(|joint| joint.1.clone());
                found.reversed = with_own < 0.0;
            }
        }
        if found.explained >= MIN_EXPLAINED {
            found.delay = regression.delay(e, motion);
        }
        out.push(found);
    }
    exchanged(&mut out);
    judge_delays(motion, &mut out);
    out
}

/// Whether an effort with this delay and standard deviation, s, seems to precede its motion.
///
/// - `step`: the time between values, s.
pub(crate) fn precedes([seconds, sigma]: [f64; 2], step: f64) -> bool {
    seconds < -MIN_LEAD_DEVIATIONS * sigma.max(LEAST_DEVIATION_STEPS * step)
}

/// Leaves out all delays if an effort seems to precede its motion, and else adds to their standard
/// deviations what the regression's lack of the robot's equations does to them: how they change
/// with half of the cutoff, and how they differ from the usual one, since the drives of one
/// controller are mostly logged equally late.
fn judge_delays(motion: &RegressionInput<'_>, out: &mut [Following]) {
    let mut delays = out.iter().filter_map(|found| found.delay);
    if delays.any(|delay| precedes(delay, motion.step)) {
        for found in out {
            found.delay = None;
        }
        return;
    }
    let all: Vec<f64> = out.iter().filter_map(|f| Some(f.delay?[0])).collect();
    if all.is_empty() {
        return;
    }
    let usual = 0.5 * (median(&all) - median(&all.iter().map(|s| -s).collect::<Vec<f64>>()));
    let slow = RegressionInput {
        cutoff: SLOW_PART * motion.cutoff,
        joints: motion.joints.clone(),
        efforts: motion.efforts.clone(),
        ..*motion
    };
    let with_slow = Regression::new(&slow);
    for (e, found) in out.iter_mut().enumerate() {
        found.delay = found.delay.and_then(|[seconds, sigma]| {
            let [other, _] = with_slow.as_ref()?.delay(e, &slow)?;
            let lacking = (seconds - other).hypot(seconds - usual);
            Some([seconds, sigma.hypot(lacking)])
        });
    }
}

/// Resets the result of an effort that follows another joint, unless the effort of that joint also
/// follows another one: columns are exchanged, so that a single one cannot be wrong.
fn exchanged(efforts: &mut [Following]) {
    loop {
        let other = |effort: &Following| {
            let joint = effort
                .follows
                .as_ref()
                .filter(|joint| **joint != effort.joint)?;
            let own = efforts.iter().find(|e| e.joint == *joint)?;
            let moved = own
                .follows
                .as_ref()
                .is_some_and(|follows| *follows != own.joint);
            (!moved).then_some(effort.column)
        };
        let Some(column) = efforts.iter().find_map(other) else {
            return;
        };
        for effort in efforts.iter_mut().filter(|e| e.column == column) {
            effort.follows = None;
            effort.reversed = false;
        }
    }
}

/// The rows of each stretch without its ends.
fn inner(rows: &[Vec<Vec<f64>>], margin: usize) -> impl Iterator<Item = &[Vec<f64>]> + Clone {
    rows.iter().map(move |rows| {
        rows.get(margin..rows.len().saturating_sub(margin))
            .unwrap_or_default()
    })
}

/// The columns of the regression at every value of the stretches: a constant; for each joint the
/// sine and the cosine of its position, its acceleration, velocity, and direction in two shapes;
/// then the sines and cosines of the sums of positions from each joint on, which for parallel axes
/// are the angles to the vertical.
fn basis(all: &[Filtered], motion: &RegressionInput<'_>) -> Vec<Vec<Vec<f64>>> {
    let n = motion.joints.len();
    let speeds: Vec<f64> = (0..n)
        .map(|j| {
            let rates = all.iter().flat_map(|f| slope(&f.positions[j], motion.step));
            let (sum, count) = rates.fold((0.0, 0.0), |(s, c), v| (s + v * v, c + 1.0));
            (sum / f64::max(count, 1.0)).sqrt()
        })
        .collect();
    let one = |f: &Filtered| -> Vec<Vec<f64>> {
        let rates: Vec<Vec<f64>> = f.positions.iter().map(|q| slope(q, motion.step)).collect();
        let second: Vec<Vec<f64>> = rates.iter().map(|v| slope(v, motion.step)).collect();
        let count = f.positions.first().map_or(0, Vec::len);
        (0..count)
            .map(|k| {
                let mut row = Vec::with_capacity(1 + COLUMNS_PER_JOINT * n + 2 * n);
                row.push(1.0);
                for j in 0..n {
                    let (q, v) = (f.positions[j][k], rates[j][k]);
                    row.extend([libm::sin(q), libm::cos(q), second[j][k], v]);
                    let slow =
                        DIRECTION_WIDTHS.map(|part| (part * speeds[j]).max(f64::MIN_POSITIVE));
                    row.extend(slow.map(|slow| libm::tanh(v / slow)));
                }
                for from in 0..n.saturating_sub(1) {
                    let mut sum = f.positions[from][k];
                    for next in from + 1..n.min(from + 3) {
                        sum += f.positions[next][k];
                        row.extend([libm::sin(sum), libm::cos(sum)]);
                    }
                }
                row
            })
            .collect()
    };
    all.iter().map(one).collect()
}

fn regress(normal: &Normal, rows: &[Vec<Vec<f64>>], efforts: &[Vec<f64>], margin: usize) -> Solved {
    let values = efforts.iter().flat_map(|values| {
        let end = values.len().saturating_sub(margin);
        values.get(margin..end).unwrap_or_default()
    });
    normal.solve(inner(rows, margin).flatten(), values)
}

/// The delay of an effort and its deviation, by Gauss-Newton: what is left of an effort that comes
/// late by d is -d times the rate of what was predicted.
fn delay(
    normal: &Normal,
    rows: &[Vec<Vec<f64>>],
    mut efforts: Vec<Vec<f64>>,
    margin: usize,
    motion: &RegressionInput<'_>,
) -> Option<[f64; 2]> {
    let raw = efforts.clone();
    let all: usize = rows.iter().map(Vec::len).sum();
    let length = all.div_ceil(BLOCKS).max(1);
    let (mut total, mut sigma) = (0.0, f64::INFINITY);
    for _ in 0..DELAY_PASSES {
        let solved = regress(normal, rows, &efforts, margin);
        let rates: Vec<Vec<f64>> = rows
            .iter()
            .map(|rows| {
                let predicted: Vec<f64> = rows
                    .iter()
                    .map(|row| normal.predict(&solved, row))
                    .collect();
                slope(&predicted, motion.step).iter().map(|x| -x).collect()
            })
            .collect();
        // the part of the rates that no column explains
        let other = regress(normal, rows, &rates, margin);
        let (mut xy, mut xx, mut yy, mut count) = (0.0, 0.0, 0.0, 0.0);
        let (mut blocks, mut before) = ([(0.0, 0.0); BLOCKS], 0);
        for (rows, (rates, efforts)) in rows.iter().zip(rates.iter().zip(&efforts)) {
            for k in margin..rows.len().saturating_sub(margin) {
                let x = rates[k] - normal.predict(&other, &rows[k]);
                let y = efforts[k] - normal.predict(&solved, &rows[k]);
                xy += x * y;
                xx += x * x;
                yy += y * y;
                count += 1.0;
                let block = &mut blocks[(before + k) / length];
                *block = (block.0 + x * y, block.1 + x * x);
            }
            before += rows.len();
        }
        if xx.is_nan() || xx <= 0.0 {
            return None;
        }
        let step = xy / xx;
        total += step;
        // filtered values are not independent of their neighbours
        let memory = (0.5 / motion.cutoff / motion.step).max(1.0);
        let noise = ((yy - xy * step).max(0.0) / f64::max(count, 1.0) / xx * memory).sqrt();
        // what the regression leaves of the motion is not noise, and differs from block to block
        let scatter: f64 = blocks.iter().map(|(xy, xx)| (xy - step * xx).powi(2)).sum();
        let few = BLOCKS as f64 / (BLOCKS as f64 - 1.0);
        sigma = noise.max((few * scatter).sqrt() / xx);
        if total.abs() > 1.0 / motion.cutoff {
            return None;
        }
        efforts = raw
            .iter()
            .map(|values| shifted(values, total / motion.step))
            .collect();
    }
    Some([total, sigma])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Noise;
    use core::f64::consts::TAU;

    /// A joint with weight, inertia and friction whose effort is this much behind its motion, s.
    fn followed(late: impl Fn(f64) -> f64) -> [f64; 2] {
        let angle = |t: f64| {
            let harmonics = [1.0, 3.0, 7.0, 12.0];
            let one = |k: f64| (TAU * 0.1 * k * t + k).sin() / k;
            harmonics.map(one).iter().sum::<f64>()
        };
        let step = 5e-3;
        let effort = |t: f64| {
            let [a, b, c] = [-step, 0.0, step].map(|by| angle(t + by));
            let rate = (c - a) / (2.0 * step);
            (a - 2.0 * b + c) / (step * step) + 6.0 * b.cos() + 0.8 * (rate / 0.02).tanh()
        };
        let times: Vec<f64> = (0..8000).map(|k| step * f64::from(k)).collect();
        let mut noise = Noise::new(11);
        let efforts = times
            .iter()
            .map(|t| effort(t - late(*t)) + 0.01 * noise.normal());
        let stretch = Stretch {
            columns: vec![times.iter().map(|t| angle(*t)).collect(), efforts.collect()],
            times,
        };
        let signal = |column: usize| Signal {
            column,
            factor: 1.0,
        };
        let found = follow(&RegressionInput {
            stretches: &[stretch],
            step,
            cutoff: 5.0,
            joints: vec![(signal(0), "a".to_owned())],
            efforts: vec![(signal(1), 0, 2)],
        });
        found[0].delay.unwrap()
    }

    #[test]
    fn a_delay_that_changes_along_the_log_is_as_uncertain_as_its_parts_differ() {
        let [_, even] = followed(|_| 0.02);
        // the mean of tenths of a log of which half are late by 40 ms and half are not deviates by
        // 20 ms over the root of nine
        let [seconds, sigma] = followed(|t| if t < 20.0 { 0.0 } else { 0.04 });
        let wanted = 0.02 / 3.0;
        assert!((wanted / 1.5..1.5 * wanted).contains(&sigma), "{sigma}");
        assert!((seconds - 0.02).abs() < 2.0 * sigma, "{seconds} {sigma}");
        assert!(even < 0.1 * wanted, "{even}");
    }
}
