//! The motion that the commands of a log require.

use regen_experiment::simulate::Reference;
use regen_identify::data::Track;
use regen_identify::states::{Completed, Completion};
use regen_runtime::Model;

use crate::logs::{TrackError, driven};

/// The motion of the independent coordinates that the commands of a track require. At any time the
/// positions are those of the nearest row, and accelerations are 0. Velocities are those of the quartic
/// through five rows, and central differences (one-sided ones at the ends) where the commands are not
/// smooth or their times not even. That of the first row is of the cubic through nine rows if commands are
/// rounded.
///
/// Simulations begin with the velocity of the first row. One that is off by a forward difference's error
/// (0.005 rad/s in the wrist of an arm) moves a loop of 3 Hz for several seconds.
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs")); }
/// use regen_experiment::simulate::Reference;
/// use regen_identify::data::Track;
/// use regen_response::Commanded;
///
/// let velocity = |commands: &dyn Fn(f64) -> f64, t: f64| {
///     let times: Vec<f64> = (0..50).map(|k| 0.01 * f64::from(k)).collect();
///     let commands = times.iter().map(|t| commands(*t)).collect();
///     let track = Track { commands: vec![(0, commands)], times, ..Track::default() };
///     let commanded = Commanded::new(&models::Pendulum, &track).unwrap();
///     let mut velocity = [0.0];
///     commanded.at(t, &mut [0.0], &mut velocity, &mut [0.0]);
///     velocity[0]
/// };
/// // smooth, also where it turns: at the first row, the second, in the middle, and at the last
/// for t in [0.0, 0.01, 0.25, 0.49] {
///     assert!((velocity(&|t| (3.0 * t).cos(), t) + 3.0 * (3.0 * t).sin()).abs() < 1e-5);
/// }
/// // at the first row, with a third derivative that changes its sign two rows later
/// assert!((velocity(&|t| (3.0 * (t - 0.02)).cos(), 0.0) - 3.0 * 0.06_f64.sin()).abs() < 1e-5);
/// // rounded: a forward difference would be 0.045 off
/// let rounded = |t: f64| ((3.0 * t).cos() * 1e4).round() / 1e4;
/// assert!(velocity(&rounded, 0.0).abs() < 0.01);
/// // a ramp that begins after some rows
/// assert_eq!(velocity(&|t| (t - 0.035).max(0.0), 0.0), 0.0);
/// // a step, seen from its first row, and a step in the middle
/// assert_eq!(velocity(&|t| if t > 0.0 { 1.0 } else { 0.0 }, 0.0), 1.0 / 0.01);
/// assert!((velocity(&|t| if t > 0.245 { 1.0 } else { 0.0 }, 0.25) - 0.5 / 0.01).abs() < 1e-9);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Commanded {
    times: Vec<f64>,
    /// For each row, the independent positions.
    positions: Vec<Vec<f64>>,
}

impl Commanded {
    /// Closes the loops at the commanded positions of all actuated joints.
    ///
    /// # Errors
    /// When a command is missing, or the loops do not close at the commands.
    pub fn new<M: Model<f64> + ?Sized>(model: &M, track: &Track) -> Result<Self, TrackError> {
        let info = model.info();
        let commands = driven(&track.commands, &info, "command")?;
        let mut completion =
            Completion::new(model, info.actuated, &vec![1.0; info.actuated.len()])?;
        let still = vec![0.0; info.actuated.len()];
        let mut positions = Vec::with_capacity(track.times.len());
        for (row, time) in track.times.iter().enumerate() {
            let q: Vec<f64> = commands.iter().map(|x| x[row]).collect();
            let state = match completion.complete(&q, &still, &still)? {
                Completed::State(state) => state,
                Completed::Open(outcome) => {
                    return Err(TrackError::Open {
                        time: *time,
                        outcome: Some(outcome),
                    });
                }
                Completed::Unmeasured => {
                    return Err(TrackError::Open {
                        time: *time,
                        outcome: None,
                    });
                }
            };
            let independent = info.independent.iter();
            positions.push(independent.map(|c| state.q[*c]).collect());
        }
        Ok(Self {
            times: track.times.clone(),
            positions,
        })
    }
}

impl Reference for Commanded {
    fn at(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        // the nearest row: simulated samples are those of the log, up to rounding
        let next = self.times.partition_point(|x| *x < t);
        let last = self.times.len().saturating_sub(1);
        let distance = |k: usize| self.times.get(k).map_or(f64::INFINITY, |x| (x - t).abs());
        let row = if next > 0 && distance(next - 1) < distance(next) {
            next - 1
        } else {
            next.min(last)
        };
        qdd.fill(0.0);
        for (k, (q, qd)) in q.iter_mut().zip(qd).enumerate() {
            *q = self.position(row, k).unwrap_or(f64::NAN);
            *qd = self.velocity(row, k);
        }
    }
}

/// Commands change smoothly if two third differences that follow each other differ by at most this
/// part of the sum of their sizes; those around steps, beginning ramps and rounded positions have
/// different signs.
const MAX_CHANGE_OF_THIRD_DIFFERENCE: f64 = 0.5;
/// They change smoothly too if the third differences are at most this part of the second ones, as where
/// the third derivative is zero.
const MAX_PART_OF_SECOND_DIFFERENCE: f64 = 0.1;
/// The largest deviation of rows from even times, as a part of the time between them.
const MAX_UNEVENNESS: f64 = 1e-2;
/// Twelve times the derivatives of the quartic through five values, at each of these.
const QUARTIC: [[f64; 5]; 5] = [
    [-25.0, 48.0, -36.0, 16.0, -3.0],
    [-3.0, -10.0, 18.0, -6.0, 1.0],
    [1.0, -8.0, 0.0, 8.0, -1.0],
    [-1.0, 6.0, -18.0, 10.0, 3.0],
    [3.0, -16.0, 36.0, -48.0, 25.0],
];

/// 8316 times the derivative at the first of nine values of the cubic that fits them by least squares.
const FIRST_OF_CUBIC: [f64; 9] = [
    -6118.0, 854.0, 3593.0, 3366.0, 1440.0, -918.0, -2441.0, -1862.0, 2086.0,
];
/// The largest fourth difference of values that are each off by half of what they are rounded to, in
/// units of the latter.
const MAX_FOURTH_DIFFERENCE: f64 = 8.0;
/// Commands are known to be rounded only if they change by more than this many units from row to row, in
/// the mean: a ramp that begins has changes of nothing and of one unit.
const MIN_CHANGE: f64 = 8.0;
/// Differences of positions below this, rad or m, are rounding errors of the computer.
const MIN_QUANTUM: f64 = 1e-9;

impl Commanded {
    /// The commanded position of an independent coordinate at a row.
    fn position(&self, row: usize, coordinate: usize) -> Option<f64> {
        self.positions.get(row)?.get(coordinate).copied()
    }

    /// The velocity of an independent coordinate that the commands around a row have.
    fn velocity(&self, row: usize, coordinate: usize) -> f64 {
        let rounded = match row {
            0 => self.velocity_of_rounded_rows(coordinate),
            _ => None,
        };
        let smooth = rounded.or_else(|| self.velocity_of_five_rows(row, coordinate));
        smooth.unwrap_or_else(|| self.velocity_of_neighbours(row, coordinate))
    }

    /// The velocity at a row of the quartic through five rows around it; `None` where there are fewer,
    /// their times are not even, or the commands are not smooth.
    fn velocity_of_five_rows(&self, row: usize, coordinate: usize) -> Option<f64> {
        let first = row.saturating_sub(2).min(self.times.len().checked_sub(5)?);
        let rows = first..first + 5;
        let times = self.times.get(rows.clone())?;
        let step = even_step(times)?;
        let values: Option<Vec<f64>> = rows.map(|row| self.position(row, coordinate)).collect();
        let values = values?;
        let second: Vec<f64> = values
            .windows(3)
            .map(|x| x[2] - 2.0 * x[1] + x[0])
            .collect();
        let (before, after) = (second[1] - second[0], second[2] - second[1]);
        let sizes = before.abs() + after.abs();
        let changes_evenly = (after - before).abs() <= MAX_CHANGE_OF_THIRD_DIFFERENCE * sizes;
        let mean = second.iter().sum::<f64>().abs() / 3.0;
        let hardly_changes = sizes <= MAX_PART_OF_SECOND_DIFFERENCE * mean;
        let is_smooth = changes_evenly || hardly_changes;
        if !is_smooth {
            return None;
        }
        let products = values.iter().zip(QUARTIC.get(row - first)?);
        Some(products.map(|(x, weight)| x * weight).sum::<f64>() / (12.0 * step))
    }

    /// The velocity at the first row, with which simulations begin, of the cubic through nine rows; `None`
    /// where there are fewer, their times are not even, or the commands are no smooth ones that are
    /// rounded.
    fn velocity_of_rounded_rows(&self, coordinate: usize) -> Option<f64> {
        let times = self.times.get(..FIRST_OF_CUBIC.len())?;
        let step = even_step(times)?;
        let at = |row: usize| self.position(row, coordinate);
        let values: Option<Vec<f64>> = (0..times.len()).map(at).collect();
        let values = values?;
        let changes: Vec<f64> = values.windows(2).map(|x| x[1] - x[0]).collect();
        let quantum = changes.iter().fold(0.0, |q, x| common_part(q, *x));
        let fourth = changes
            .windows(4)
            .map(|x| x[3] - x[0] - 3.0 * (x[2] - x[1]));
        let largest = fourth.fold(0.0, |m: f64, x| m.max(x.abs()));
        let mean = changes.iter().map(|x| x.abs()).sum::<f64>() / changes.len() as f64;
        let is_smooth = largest <= MAX_FOURTH_DIFFERENCE * quantum && mean >= MIN_CHANGE * quantum;
        let products = values.iter().zip(&FIRST_OF_CUBIC).map(|(x, w)| x * w);
        is_smooth.then(|| products.sum::<f64>() / (8316.0 * step))
    }

    /// The difference of the rows before and after a row, or of the row itself at the ends, over time.
    fn velocity_of_neighbours(&self, row: usize, coordinate: usize) -> f64 {
        let last = (row + 1).min(self.times.len().saturating_sub(1));
        let at = |row: usize| Some((self.position(row, coordinate)?, *self.times.get(row)?));
        let ends = at(row.saturating_sub(1)).zip(at(last));
        let slope = |((a, from), (b, to)): ((f64, f64), (f64, f64))| {
            if to > from {
                (b - a) / (to - from)
            } else {
                0.0
            }
        };
        ends.map_or(0.0, slope)
    }
}

/// The time between rows; `None` unless it is even.
fn even_step(times: &[f64]) -> Option<f64> {
    let step = (times.last()? - times.first()?) / (times.len() - 1) as f64;
    let is_even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= MAX_UNEVENNESS * step;
    (step > 0.0 && times.windows(2).all(is_even)).then_some(step)
}

/// The largest value of which both are multiples, by Euclid's algorithm.
fn common_part(a: f64, b: f64) -> f64 {
    let (mut a, mut b) = (a.abs(), b.abs());
    while b > MIN_QUANTUM {
        (a, b) = (b, (a - b * (a / b).round()).abs());
    }
    a
}
