//! Logs whose rows are held in memory: at a lower rate, or with noise added to what was measured of
//! the motion.

use super::logs::{Log, Logs, signal};
use super::noise_levels::NoiseLevels;
use super::problem::DataError;
use super::reader::{EffortSet, LogRow};
use super::standstill::{Differences, Encoder};
use crate::intervals::Random;
use crate::signals::{Butterworth, Method, Sampled, SignalError};
use regen_runtime::Model;

/// The order of the filter before rows are left out.
const ORDER: usize = 4;
/// Its cutoff frequency over the rate of the rows that remain.
const CUTOFF_RATIO: f64 = 0.4;

/// The filter that the columns of a log pass before only one of `every` rows is used: noise of high frequencies
/// would appear at lower ones.
///
/// # Errors
/// When the cutoff is not below half the rate of the log.
pub(super) fn filter_before(log: &Log, every: usize) -> Result<Butterworth, DataError> {
    let step = log.survey.time_step();
    let filter = Butterworth::new(ORDER, CUTOFF_RATIO / (every as f64 * step), step);
    filter.map_err(|why| signal(&log.file, why))
}
/// The most rows from which the noise of efforts is computed.
const NOISE_ROWS: usize = 16_384;
/// The number of stretches of a log that is too long to be held whole.
const PIECES: usize = 8;

impl<M: Model<f64> + ?Sized> Logs<'_, M> {
    /// The same logs with their rows in memory: of a log with more than `most` rows, stretches that are
    /// spread evenly over it.
    ///
    /// # Errors
    /// When a log cannot be read.
    pub(crate) fn in_memory(&self, most: usize) -> Result<Self, DataError> {
        let mut files = Vec::with_capacity(self.files.len());
        for (log, report) in self.files.iter().zip(&self.reports) {
            let all = report.rows;
            let (count, length) = if all <= most {
                (1, all)
            } else {
                (PIECES, most / PIECES)
            };
            let mut stretches: Vec<Vec<LogRow>> = Vec::new();
            let (mut place, mut was_within) = (0, false);
            log.rows(&mut |_| {}, &mut |row, follows| {
                let piece = place * count / all.max(1);
                let within = place < piece * all / count + length;
                place += 1;
                if within {
                    if !(follows && was_within) || stretches.is_empty() {
                        stretches.push(Vec::new());
                    }
                    if let Some(last) = stretches.last_mut() {
                        last.push(row.clone());
                    }
                }
                was_within = within;
                Ok(())
            })?;
            let mut kept = Log {
                kept: Some(stretches),
                ..log.clone()
            };
            if kept.effort_levels.is_none() {
                kept.effort_levels = Some(kept.levels(kept.file.layout.efforts()));
            }
            files.push(kept);
        }
        Ok(self.with_files(files))
    }

    /// The rows in memory at one of `every` instants, behind a low-pass filter below half their rate,
    /// for a method of differentiation.
    ///
    /// - `decimation`: one of so many filtered equations of these is used.
    ///
    /// # Errors
    /// When the rows are not sampled evenly, or no stretch is long enough.
    pub(crate) fn thinned(
        &self,
        method: Method,
        every: usize,
        decimation: usize,
    ) -> Result<Self, DataError> {
        let mut files = Vec::with_capacity(self.files.len());
        for log in &self.files {
            files.push(if every > 1 {
                thinned(log, every)?
            } else {
                log.clone()
            });
        }
        let mut all = self.with_files(files);
        all.settings.method = method;
        all.settings.decimation = decimation;
        Ok(all)
    }

    /// The rows in memory without measured velocities and accelerations; `None` if none are measured, or
    /// some logs have all derivatives.
    pub(crate) fn without_rates(&self) -> Option<Self> {
        let has_rates = |log: &Log| {
            let layout = &log.file.layout;
            layout.velocities.iter().any(Option::is_some)
        };
        let are_all = |log: &Log| log.file.layout.derivatives;
        if self.files.iter().any(are_all) || !self.files.iter().any(has_rates) {
            return None;
        }
        Some(self.with_files(self.files.iter().map(without_rates).collect()))
    }

    /// The rows in memory with white noise added to all columns of the motion.
    ///
    /// - `scale`: the factor of the noise; with the opposite sign the same noise is subtracted;
    /// - `deviations`: for each log, the standard deviation of the noise of each column behind the
    ///   time, as many as columns of motion; none for a log without noise.
    pub(crate) fn disturbed(&self, scale: f64, deviations: &[Vec<f64>]) -> Self {
        let mut random = Random(SEED);
        let files = self.files.iter().enumerate().map(|(k, log)| {
            let own = deviations.get(k).map_or(&[][..], Vec::as_slice);
            let kept = log.kept.as_ref().map(|stretches| {
                let mut stretches = stretches.clone();
                for row in stretches.iter_mut().flatten() {
                    let entries = row.values.iter_mut().skip(1);
                    for (entry, deviation) in entries.zip(own) {
                        *entry += scale * deviation * random.normal();
                    }
                }
                stretches
            });
            Log {
                kept,
                ..log.clone()
            }
        });
        self.with_files(files.collect())
    }

    /// The times and the positions of each log in memory, s and rad or m; `None` where one is in pieces.
    pub(crate) fn positions(&self) -> Option<Vec<Sampled>> {
        let of_log = |log: &Log| {
            let [rows] = log.kept.as_deref()? else {
                return None;
            };
            let column = |entry: usize| -> Vec<f64> {
                let values = rows.iter().filter_map(|row| row.values.get(entry).copied());
                values.collect()
            };
            Some(Sampled {
                times: column(0),
                signals: log.file.layout.positions().map(column).collect(),
            })
        };
        self.files.iter().map(of_log).collect()
    }

    /// The noise levels of the columns of motion of each log, in the order of the rows' entries.
    pub(crate) fn noise_levels(&self) -> Vec<Vec<NoiseLevels>> {
        let of_motion = |log: &Log| log.levels(1..log.file.layout.efforts().start);
        self.files.iter().map(of_motion).collect()
    }

    /// The standard deviations of the noise that is left in the efforts of the equations, in the order of
    /// `Info::actuated`, N or N m: that of the rows at high frequencies, of which a filter passes what is below
    /// its cutoff. That of several logs is their mean; of long logs, parts are looked at.
    ///
    /// # Errors
    /// When a log cannot be read.
    pub fn effort_noise(&self) -> Result<Vec<f64>, DataError> {
        let out = self.mean_of_effort_levels(|passed, own| 2.0 * passed * own.density(passed))?;
        Ok(out.into_iter().map(f64::sqrt).collect())
    }

    /// See [`Source::effort_densities`](crate::states::Source::effort_densities).
    pub(super) fn densities_of_efforts(&self) -> Result<Vec<f64>, DataError> {
        // the octave above has twice as many means
        self.mean_of_effort_levels(|passed, own| {
            (own.density(passed) + 2.0 * own.density(2.0 * passed)) / 3.0
        })
    }

    /// For each effort the mean over the logs of what its noise is below the highest frequency that the filter
    /// passes, Hz.
    fn mean_of_effort_levels(
        &self,
        of: impl Fn(f64, &NoiseLevels) -> f64,
    ) -> Result<Vec<f64>, DataError> {
        let read;
        let known = self.files.iter().all(|log| log.effort_levels.is_some());
        let files = if known {
            &self.files
        } else {
            read = self.in_memory(NOISE_ROWS)?;
            &read.files
        };
        let count = files.len().max(1) as f64;
        let mut out = Vec::new();
        for log in files {
            let half_rate = 0.5 / log.survey.time_step();
            let passed = match self.settings.method {
                Method::Butterworth { cutoff, .. } => cutoff.min(half_rate),
                _ => half_rate,
            };
            let levels = log.effort_levels.as_deref().unwrap_or_default();
            out.resize(levels.len(), 0.0);
            for (sum, own) in out.iter_mut().zip(levels) {
                *sum += of(passed, own) / count;
            }
        }
        Ok(out)
    }

    /// The time between the rows of each log, s, and how long it is, s.
    pub(crate) fn durations(&self) -> Vec<(f64, f64)> {
        let of_log = |log: &Log| {
            let step = log.survey.time_step();
            let rows: usize = log.kept.iter().flatten().map(Vec::len).sum();
            (step, rows as f64 * step)
        };
        self.files.iter().map(of_log).collect()
    }

    /// Whether the rows give the motion by themselves, without being differentiated.
    pub(crate) fn is_differentiated(&self) -> bool {
        self.settings.period.is_none()
            && self.files.iter().all(|log| log.series.is_none())
            && self.files.iter().any(|log| !log.file.layout.derivatives)
    }

    /// Whether gaps or rows that are left out divide a log, or efforts have spikes: a filter would bridge them.
    pub(crate) fn has_gaps(&self) -> bool {
        let mut files = self.files.iter();
        files.any(|log| log.divided || !log.survey.spikes.is_empty())
    }

    fn with_files(&self, files: Vec<Log>) -> Self {
        Self {
            model: self.model,
            settings: self.settings.clone(),
            files,
            reports: self.reports.clone(),
            states_every: 1,
        }
    }
}

impl Log {
    /// The noise levels of some entries of the rows in memory.
    fn levels(&self, entries: core::ops::Range<usize>) -> Vec<NoiseLevels> {
        let column = |entry: usize| {
            let kept = self.kept.iter().flatten();
            let values = |rows: &Vec<LogRow>| -> Vec<f64> {
                let values = rows.iter().filter_map(|row| row.values.get(entry).copied());
                values.collect()
            };
            let stretches: Vec<Vec<f64>> = kept.map(values).collect();
            NoiseLevels::new(self.survey.time_step(), &stretches)
        };
        entries.map(column).collect()
    }
}

/// The seed of added noise: the same log gives the same result on every machine.
const SEED: u64 = 0x006e_6f69_7365;

/// A log in memory without its columns of velocities and accelerations.
fn without_rates(log: &Log) -> Log {
    let mut out = log.clone();
    let layout = &mut out.file.layout;
    let rates = layout.positions().end..layout.efforts().start;
    layout.channels.drain(rates.clone());
    layout.velocities.fill(None);
    layout.accelerations.fill(None);
    for own in &mut out.velocity_noise {
        *own = Differences::default().finish();
    }
    for row in out.kept.iter_mut().flatten().flatten() {
        row.values.drain(rates.clone());
    }
    out
}

/// One of `every` rows of a log, behind a low-pass filter.
fn thinned(log: &Log, every: usize) -> Result<Log, DataError> {
    let filter = filter_before(log, every)?;
    let margin = filter.settling();
    let mut stretches = Vec::new();
    for rows in log.kept.iter().flatten() {
        if rows.len() <= 2 * margin + every {
            continue;
        }
        let channels = rows.first().map_or(0, |row| row.values.len());
        let mut columns = Vec::with_capacity(channels);
        for entry in 0..channels {
            let values: Vec<f64> = rows
                .iter()
                .filter_map(|r| r.values.get(entry).copied())
                .collect();
            columns.push(if entry == 0 {
                values
            } else {
                let filtered = filter.zero_phase(&values);
                filtered.map_err(|why| signal(&log.file, why))?
            });
        }
        let used = (margin..rows.len() - margin).step_by(every);
        let around = |k: usize, reach: usize| {
            let near = k.saturating_sub(reach)..rows.len().min(k + reach + 1);
            rows.get(near).unwrap_or_default().iter()
        };
        let row = |k: usize| LogRow {
            line: rows.get(k).map_or(0, |row| row.line),
            values: columns.iter().filter_map(|c| c.get(k).copied()).collect(),
            // one of the rows that it stands for is interpolated
            bridged: around(k, every / 2).any(|row| row.bridged),
            unknown: around(k, 2 * every)
                .fold(EffortSet::default(), |all, row| all.or(row.unknown)),
        };
        stretches.push(used.map(row).collect::<Vec<LogRow>>());
    }
    if stretches.is_empty() {
        return Err(signal(
            &log.file,
            SignalError::TooFew {
                samples: log.kept.iter().flatten().map(Vec::len).sum(),
                needed: 2 * margin + every,
            },
        ));
    }
    let layout = &log.file.layout;
    let entries = layout.positions();
    let encoder = |entry: usize| -> Encoder {
        let mut all = Differences::default();
        for rows in &stretches {
            for (k, row) in rows.iter().enumerate() {
                if let Some(value) = row.values.get(entry) {
                    all.push(*value, k > 0);
                }
            }
        }
        all.finish()
    };
    let mut out = log.clone();
    out.encoders = entries.map(encoder).collect();
    for (own, velocity) in out.velocity_noise.iter_mut().zip(&layout.velocities) {
        if let Some(entry) = velocity {
            *own = encoder(*entry);
        }
    }
    let coarse = log.survey.time_step() * every as f64;
    out.survey.raw_step = coarse;
    out.survey.time_step = coarse;
    out.kept = Some(stretches);
    Ok(out)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::fmt::Write as _;

    use super::*;
    use crate::data::Settings;
    use crate::states::Source;
    use crate::suspect::swings_for_tests::{Swings, Written, swings};

    /// A log of three joints with so many rows, 10 ms apart.
    fn log(rows: usize, name: &str) -> Written {
        let mut text = "t,q1,q2,q3,tau_q1,tau_q2,tau_q3\n".to_owned();
        for k in 0..rows {
            let t = 0.01 * k as f64;
            let [a, b, c] = [1.3, 2.1, 0.9].map(|w| (w * t).sin());
            let _ = writeln!(text, "{t},{a},{b},{c},{},{},{}", 2.0 * a, b - c, c + 1.0);
        }
        Written::new(name, &text)
    }

    fn opened<'m>(model: &'m Swings, log: &Written) -> Logs<'m, Swings> {
        Logs::open(model, std::slice::from_ref(&log.0), &Settings::default()).unwrap()
    }

    #[test]
    fn of_a_long_log_stretches_that_are_spread_over_it_are_kept() {
        let model = swings(false);
        let file = log(4000, "long");
        let logs = opened(&model, &file);
        let whole = logs.in_memory(4000).unwrap();
        let stretches = |logs: &Logs<'_, Swings>| -> Vec<(f64, usize)> {
            let kept = logs.files[0].kept.as_ref().unwrap();
            kept.iter()
                .map(|rows| (rows[0].values[0], rows.len()))
                .collect()
        };
        assert_eq!(stretches(&whole), [(0.0, 4000)]);
        let parts = stretches(&logs.in_memory(800).unwrap());
        assert_eq!(parts.len(), PIECES);
        for (k, (start, rows)) in parts.into_iter().enumerate() {
            assert!(
                (start - 5.0 * k as f64).abs() < 1e-9 && rows == 800 / PIECES,
                "{start} {rows}"
            );
        }
    }

    #[test]
    fn logs_in_memory_know_how_long_they_are_and_that_their_motion_is_differentiated() {
        let model = swings(false);
        let file = log(500, "short");
        let logs = opened(&model, &file).in_memory(500).unwrap();
        let [(step, length)] = logs.durations()[..] else {
            panic!("one log");
        };
        assert!(
            (step - 0.01).abs() < 1e-9 && (length - 5.0).abs() < 1e-6,
            "{step} {length}"
        );
        assert!(logs.is_differentiated() && !logs.has_gaps());
        // no velocities are measured that could be left out
        assert!(logs.without_rates().is_none());
        let positions = logs.positions().unwrap();
        assert_eq!(
            (positions[0].times.len(), positions[0].signals.len()),
            (500, 3)
        );
    }

    #[test]
    fn logs_of_fewer_rows_know_the_noise_of_all_of_them() {
        let model = swings(false);
        let file = log(2000, "noise");
        let whole = opened(&model, &file).in_memory(2000).unwrap();
        let method = Method::Butterworth {
            order: 2,
            cutoff: 2.0,
        };
        let fewer = whole.thinned(method, 8, 1).unwrap();
        let own = |logs: &Logs<'_, Swings>| {
            let all = logs.files[0].effort_levels.as_deref().unwrap();
            all.to_vec()
        };
        assert_eq!(own(&whole), own(&fewer));
        assert_eq!(fewer.densities_of_efforts().unwrap().len(), 3);
        // means of periods have less noise than rows
        let mut averaged = fewer.with_files(fewer.files.clone());
        averaged.settings.period = Some(1.0);
        assert!(averaged.effort_densities().unwrap().is_empty());
    }
}
