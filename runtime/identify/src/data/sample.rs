//! Takes a sample of a log's measured states, before the loops are closed, for checks of the
//! whole log that need few states.

use super::columns::Quantity;
use super::logs::{Log, Logs, delays, motion_noise, reach, sign_thresholds};
use super::motion;
use super::problem::DataError;
use super::reader::LogRow;
use super::settings::Decision;
use super::shift;
use super::standstill::{Encoder, resting};
use super::stretch::Stretch;
use crate::signals::{Derivatives, Method};
use regen_runtime::Model;

/// The number of rows for which a drive holds an effort that acts so.
const MAX_HELD_EFFORT: usize = 2;
/// Rows of a log that are differentiated for its sample; more only where a filter needs longer
/// stretches.
const SAMPLED_ROWS: usize = 16_384;
/// Number of stretches that a longer log's sample consists of.
const BLOCKS: usize = 8;

/// The part of the rms acceleration of a coordinate that a filter takes off one that it bends, and so many deviations of
/// noise.
const BENT_PART: f64 = 0.2;
const BENT_DEVIATIONS: f64 = 6.0;

/// The largest number of states used for hypotheses on efforts; more are not needed.
pub const STATES: usize = 1000;

/// States of a log as they were measured, before the loops are closed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sample {
    /// The measured coordinates, as indices into `Info::coordinates`.
    pub measured: Vec<usize>,
    /// The states.
    pub states: Vec<Measured>,
    /// The titles of all columns of the log.
    pub titles: Vec<String>,
    /// The title of the column of times, where it was found without being assigned.
    pub time_column: Option<String>,
    /// A column of velocities or accelerations that is a multiple of the derivative, or another signal, in words, and
    /// the assignment that corrects it, or advice.
    pub doubted_rate: Option<(String, String)>,
    /// The titles of columns that have a new value only every so many rows.
    pub held: Vec<(String, usize)>,
    /// Whether all columns but the time have new values only every so many rows, and as many: each row is there several
    /// times.
    pub are_rows_repeated: bool,
    /// The usual step between rows of the log, s.
    pub step: f64,
    /// The number of states of a whole pass over the log.
    pub whole: usize,
    /// For each measured coordinate, the rms of the residuals of its Fourier series over the rms
    /// about its mean; empty where no series was fitted.
    pub series_residuals: Vec<f64>,
    /// For each measured coordinate, the rms of the residuals of its Fourier series over the
    /// standard deviation of its noise; empty where no series was fitted, or where it was chosen from the logs.
    pub series_over_noise: Vec<f64>,
    /// The efforts that jump in some rows and are back in the next ones.
    pub spikes: Vec<Spikes>,
    /// Whether velocities are measured.
    pub has_rates: bool,
    /// The columns of efforts with few values, each with the step between these in its unit, and the step over the standard
    /// deviation of the column.
    pub coarse: Vec<(String, f64, f64)>,
    /// For each measured coordinate the one whose velocity its own is read from, by the names of the columns; empty
    /// where these are their own.
    pub rates_of: Vec<usize>,
    /// The measured coordinates that were wrapped by other spans than turns, with these spans, rad or m: their zeros
    /// are known but for multiples of them.
    pub wrapped: Vec<(usize, f64)>,
    /// The efforts that are stated as not measured: indices into `Info::actuated`.
    pub unmeasured: Vec<usize>,
    /// The pairs of efforts that are read from columns with the same values in all rows, whatever their delays.
    pub copied_efforts: Vec<[usize; 2]>,
    /// The delays of the efforts that are corrected, s, in the order of `Info::actuated`; may be empty.
    pub delays: Vec<f64>,
    /// The standard deviation of what noise leaves unknown of the acceleration of each measured coordinate; may be
    /// empty.
    pub acceleration_noise: Vec<f64>,
    /// For each equation, the error that this noise alone causes, over the rms of its effort about the mean; empty
    /// until a model is known.
    pub least_errors: Vec<f64>,
}

/// Rows in which an effort jumps and is back in the next row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spikes {
    /// The effort: an index into `Info::actuated`.
    pub effort: usize,
    /// The number of these rows; at most some hundreds are counted.
    pub rows: usize,
    /// The largest jump, N or N m.
    pub largest: f64,
    /// The number of the first row, as in messages on faulty rows.
    pub row: u64,
}

/// One state of a [`Sample`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Time, s.
    pub time: f64,
    /// Positions, velocities and accelerations of the measured coordinates, rad or m.
    pub motion: [Vec<f64>; 3],
    /// Efforts in the order of `Info::actuated`, N or N m.
    pub efforts: Vec<f64>,
    /// Whether each measured coordinate rests or reverses, so that its friction may be another one than that of sliding;
    /// may be empty.
    pub resting: Vec<bool>,
}

impl<M: Model<f64> + ?Sized> Logs<'_, M> {
    /// For each measured coordinate the one by whose name the column of its velocity is called, see
    /// [`Sample::rates_of`].
    fn rates_of(&self, measured: &[usize]) -> Vec<usize> {
        let names = self.model.info().coordinates;
        let place = |name: &str| measured.iter().position(|c| names.get(*c) == Some(&name));
        let mut out: Vec<usize> = (0..measured.len()).collect();
        for given in self.settings.columns.iter().rev() {
            let Quantity::Velocity(name) = &given.quantity else {
                continue;
            };
            let from = given.column.strip_prefix("qd_").and_then(place);
            if let (Some(of), Some(from)) = (place(name), from) {
                out.iter_mut().skip(of).take(1).for_each(|own| *own = from);
            }
        }
        out
    }

    /// Takes states of the file with index `file`, spread evenly over it, at most about twice as
    /// many as [`STATES`]; a stretch that cannot be differentiated gives none.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn sample(&self, file: usize) -> Result<Sample, DataError> {
        let Some((log, report)) = self.files.get(file).zip(self.reports.get(file)) else {
            return Ok(Sample::default());
        };
        let support = self.settings.method.support(log.survey.time_step());
        let support = support.ok().flatten().unwrap_or(0);
        let rows = report.rows;
        // a filter may need more rows than the log has
        let length = (SAMPLED_ROWS / BLOCKS).max(4 * support.min(rows));
        let (count, length) = if rows <= BLOCKS * length {
            (1, rows)
        } else {
            (BLOCKS, length)
        };
        let mut out = Sample {
            measured: log.file.layout.measured.clone(),
            unmeasured: log.file.layout.unmeasured.clone(),
            delays: delays(&self.model.info(), &self.settings),
            has_rates: log.file.layout.velocities.iter().any(Option::is_some),
            rates_of: self.rates_of(&log.file.layout.measured),
            titles: log.file.layout.header.clone(),
            time_column: log.file.layout.time_column().map(str::to_owned),
            held: (log.file.layout.positions().start..)
                .zip(log.survey.held.iter().skip(1))
                .filter(|(entry, rows)| {
                    // drives hold their efforts for a few rows, which act so
                    **rows
                        > if log.file.layout.efforts().contains(entry) {
                            MAX_HELD_EFFORT
                        } else {
                            1
                        }
                })
                .map(|(entry, rows)| (log.file.layout.title(entry), *rows))
                .collect(),
            are_rows_repeated: match log.survey.held.get(1..) {
                Some([first, rest @ ..]) => *first > 1 && rest.iter().all(|own| own == first),
                _ => false,
            },
            wrapped: (log.survey.wrapped.iter())
                .filter(|(_, own)| !own.is_turn())
                .map(|(entry, own)| (entry - log.file.layout.positions().start, own.span))
                .collect(),
            coarse: (log.file.layout.efforts().zip(&log.survey.steps))
                .filter_map(|(entry, own)| {
                    let (step, part) = (*own)?;
                    let factor = log.file.layout.channels.get(entry)?.factor;
                    Some((log.file.layout.title(entry), (step / factor).abs(), part))
                })
                .collect(),
            doubted_rate: log.survey.doubted_rate.clone(),
            // the times of poses are not those of a clock
            step: if self.settings.poses {
                0.0
            } else {
                log.survey.time_step()
            },
            whole: rows / self.settings.decimation.max(1),
            ..Sample::default()
        };
        let every = (count * length)
            .div_ceil(STATES)
            .max(self.settings.decimation)
            .max(1);
        let mut segment = Stretch::default();
        let mut spread = Spread::new(log.file.layout.measured.len());
        let efforts = log.file.layout.efforts();
        let mut pairs: Vec<[usize; 2]> = (0..efforts.len())
            .flat_map(|b| (0..b).map(move |a| [a, b]))
            .collect();
        let mut place = 0;
        log.rows(&mut |_| {}, &mut |row, follows| {
            if !row.bridged && log.series.is_some() {
                spread.push(log, row);
            }
            let own = row.values.get(efforts.clone()).unwrap_or_default();
            pairs.retain(|[a, b]| {
                own.get(*a).map(|x| x.to_bits()) == own.get(*b).map(|x| x.to_bits())
            });
            let block = place * count / rows.max(1);
            let within = place < block * rows / count.max(1) + length;
            place += 1;
            if !follows || !within {
                self.states(log, &mut segment, every, &mut out);
            }
            if within {
                segment.push(row);
            }
            Ok(())
        })?;
        self.states(log, &mut segment, every, &mut out);
        if let Ok(noise) = motion_noise(log, self.settings.method) {
            out.lessen_noise(&noise);
        }
        out.copied_efforts = pairs;
        if !log.file.bridges_spikes() {
            out.spikes.clone_from(&log.survey.spikes);
        }
        if log.series.is_some() {
            out.series_residuals = spread.relative_residuals();
            // the choice has compared its own series with filters
            if self.settings.method_by != Decision::Chosen {
                let noise = log.encoders.iter().map(|encoder| encoder.noise);
                out.series_over_noise = spread.residuals_over(noise);
            }
        }
        Ok(out)
    }

    /// Adds the states of consecutive rows to the sample, and clears the rows.
    fn states(&self, log: &Log, rows: &mut Stretch, every: usize, out: &mut Sample) {
        let layout = &log.file.layout;
        let rows = core::mem::take(rows);
        let on_time = rows.on_time(log.late());
        let known = on_time.as_ref().map_or(0..rows.len(), |own| own.1.clone());
        let rows = on_time.map_or(rows, |own| own.0);
        let times = rows.times();
        let efforts = layout.efforts();
        let mut efforts: Vec<Vec<f64>> = efforts.map(|entry| rows.column(entry).to_vec()).collect();
        let m = layout.measured.len();
        let mut motion: Vec<[Vec<f64>; 3]> = Vec::with_capacity(m);
        let mut valid = known.clone();
        let method = self.settings.method;
        let Ok(of_all) = motion::all_derivatives(log, method, &rows) else {
            return;
        };
        let resting = self.resting(log, &rows, &of_all);
        let bent = self.bent(log, &rows, &of_all);
        for mut own in of_all {
            own.valid = shift::within(&own.valid, &known, rows.len());
            valid = valid.start.max(own.valid.start)..valid.end.min(own.valid.end);
            motion.push([own.value, own.rate, own.acceleration]);
        }
        if matches!(method, Method::Butterworth { .. }) && !layout.derivatives {
            for effort in &mut efforts {
                let Ok(found) = method.differentiate(times, effort) else {
                    return;
                };
                *effort = found.value;
            }
        }
        for (effort, delay) in efforts.iter_mut().zip(&out.delays) {
            if *delay != 0.0 {
                let own = shift::later(times, effort, *delay);
                valid = valid.start.max(own.start)..valid.end.min(own.end);
            }
        }
        let step = log.survey.time_step();
        let own_reach = reach(log, method, Encoder::default());
        #[allow(clippy::cast_sign_loss, reason = "neither is negative")]
        let near = |delay: &f64| ((2.0 * own_reach + delay.abs()) / step).ceil() as usize;
        let unknown: Vec<Vec<bool>> = (out.delays.iter().enumerate())
            .map(|(effort, delay)| rows.near_unknown(effort, near(delay)))
            .collect();
        for k in valid.step_by(every) {
            let is_unknown = unknown.iter().any(|own| own.get(k) == Some(&true));
            if is_unknown || rows.bridged().get(k) == Some(&true) || bent.get(k) == Some(&true) {
                continue;
            }
            let pick = |d: usize| motion.iter().map(|m| m[d][k]).collect();
            out.states.push(Measured {
                time: times[k],
                motion: [pick(0), pick(1), pick(2)],
                efforts: efforts.iter().map(|e| e[k]).collect(),
                resting: resting
                    .iter()
                    .map(|own| own.get(k) == Some(&true))
                    .collect(),
            });
        }
    }

    /// Whether a motion is so fast at each row that the filter bends it: the equations of a fit are filtered as a
    /// whole, which does not harm them, but states are not. None is where most are.
    fn bent(&self, log: &Log, rows: &Stretch, motion: &[Derivatives]) -> Vec<bool> {
        let mut out = vec![false; rows.len()];
        let wider = self.settings.method.of_states(log.survey.time_step());
        let noise = motion_noise(log, wider).unwrap_or_default();
        let Ok(all) = motion::all_derivatives(log, wider, rows) else {
            return out;
        };
        for ((own, wide), [_, noise]) in motion.iter().zip(&all).zip(noise) {
            let valid = own.valid.start.max(wide.valid.start)..own.valid.end.min(wide.valid.end);
            let squares = valid.clone().map(|k| wide.acceleration[k].powi(2));
            let rms = (squares.sum::<f64>() / valid.len().max(1) as f64).sqrt();
            let least = (BENT_PART * rms).max(BENT_DEVIATIONS * noise);
            for k in valid {
                out[k] |= (wide.acceleration[k] - own.acceleration[k]).abs() > least;
            }
        }
        if 2 * out.iter().filter(|bent| **bent).count() > out.len() {
            out.fill(false);
        }
        out
    }

    /// For each measured coordinate, whether it rests or reverses at each row.
    fn resting(&self, log: &Log, rows: &Stretch, motion: &[Derivatives]) -> Vec<Vec<bool>> {
        let slowest = sign_thresholds(log, &self.settings).unwrap_or_default();
        let positions = log.file.layout.positions();
        let own = positions.zip(&log.encoders).zip(motion).zip(slowest);
        let one = |(((entry, encoder), own), slowest): (((usize, &Encoder), &Derivatives), f64)| {
            let reach = reach(log, self.settings.method, *encoder);
            let rests = resting(rows.times(), rows.column(entry), *encoder);
            let motion = own.rate.iter().zip(&own.acceleration);
            // near a reversal the derivatives mix samples of both directions
            let reverses = motion.map(|(v, a)| v.abs() < slowest.max(a.abs() * reach));
            rests
                .into_iter()
                .zip(reverses)
                .map(|(a, b)| a || b)
                .collect()
        };
        own.map(one).collect()
    }
}

impl Sample {
    /// Lessens the velocities and accelerations to the part of them that is motion.
    ///
    /// Least squares takes the motion as exact, so that noise of it adds to the errors of the efforts, and
    /// whatever lessens the motion, such as another unit, would seem to explain them. The best prediction of
    /// the motion from what was measured leaves nothing to gain by that (regression calibration; Carroll,
    /// Ruppert, Stefanski and Crainiceanu, 2006, Measurement Error in Nonlinear Models, chapter 4).
    ///
    /// - `noise`: the standard deviations of the noise of both, of each measured coordinate.
    pub(crate) fn lessen_noise(&mut self, noise: &[[f64; 2]]) {
        self.acceleration_noise = noise.iter().map(|own| own[1]).collect();
        let count = self.states.len().max(1) as f64;
        for (k, noise) in noise.iter().enumerate() {
            for (d, noise) in (1..).zip(noise) {
                let values = (self.states.iter()).filter_map(|own| own.motion.get(d)?.get(k));
                let mean = values.clone().sum::<f64>() / count;
                let square = values.map(|x| (x - mean).powi(2)).sum::<f64>() / count;
                if *noise == 0.0 || square <= 0.0 {
                    continue;
                }
                let part = (1.0 - noise * noise / square).max(0.0);
                for own in &mut self.states {
                    if let Some(x) = own.motion.get_mut(d).and_then(|own| own.get_mut(k)) {
                        *x = mean + part * (*x - mean);
                    }
                }
                if let (2, Some(left)) = (d, self.acceleration_noise.get_mut(k)) {
                    *left *= part.sqrt();
                }
            }
        }
    }
}

/// Sums over the positions and over their residuals from the fitted Fourier series.
struct Spread {
    rows: f64,
    first: Vec<f64>,
    sums: Vec<f64>,
    squares: Vec<f64>,
    residual_squares: Vec<f64>,
}

impl Spread {
    fn new(count: usize) -> Self {
        Self {
            rows: 0.0,
            first: Vec::new(),
            sums: vec![0.0; count],
            squares: vec![0.0; count],
            residual_squares: vec![0.0; count],
        }
    }

    fn push(&mut self, log: &Log, row: &LogRow) {
        let Some(series) = &log.series else { return };
        let values = &row.values[log.file.layout.positions()];
        if self.rows == 0.0 {
            self.first = values.to_vec();
        }
        self.rows += 1.0;
        for (k, value) in values.iter().enumerate() {
            let off = value - self.first[k];
            self.sums[k] += off;
            self.squares[k] += off * off;
            self.residual_squares[k] += (value - series.at(k, row.values[0])[0]).powi(2);
        }
    }

    /// The rms residual of the series over this noise of each position.
    fn residuals_over(&self, noise: impl Iterator<Item = f64>) -> Vec<f64> {
        let pairs = self.residual_squares.iter().zip(noise);
        pairs
            .map(|(squares, noise)| (squares / self.rows).sqrt() / noise)
            .collect()
    }

    /// The rms residual of the series over the rms of the position about its mean; 0 for a
    /// position that does not move.
    fn relative_residuals(&self) -> Vec<f64> {
        let one = |k: usize| {
            let spread = self.squares[k] - self.sums[k] * self.sums[k] / self.rows;
            if spread > 0.0 {
                (self.residual_squares[k] / spread).sqrt()
            } else {
                0.0
            }
        };
        (0..self.residual_squares.len()).map(one).collect()
    }
}
