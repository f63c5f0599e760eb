//! What the way from positions to derivatives does to an estimate: derivatives from samples or of
//! a fitted series are not those of the motion, and no residual says so.

use super::logs::{Log, Logs};
use super::problem::DataError;
use super::reader::LogRow;
use crate::estimate::QrFactor;
use crate::identify::{Completed, Completion};
use crate::signals::{Derivatives, Method, SignalError, differences};
use regen_runtime::BaseModel;

/// Rows of each file that are looked at, in so many stretches.
const ROWS: usize = 8192;
const STRETCHES: usize = 8;
/// States of each file that equations are made of.
const STATES: usize = 500;
/// Of the filter that a series is compared with.
const ORDER: usize = 4;
/// How much the whole log counts where the states that were looked at say little.
const HELD: f64 = 1e-3;
/// How many times as wide the regression is that one is compared with.
const WIDER: f64 = 1.5;

impl<M: BaseModel<f64> + ?Sized> Logs<'_, M> {
    /// By how much each base parameter would change if derivatives were taken in another way: what is
    /// not known of the motion, and what no residual tells. r entries, SI.
    ///
    /// Differences, of filtered positions too, are compared with those over one neighbour on either
    /// side (Eq. 31), a regression with a wider one, a series (Eq. 25) with what a filter of three
    /// times its highest frequency leaves of the positions. Zero where derivatives are measured, or
    /// where noise decided for one neighbour.
    ///
    /// To first order the change solves `W d = tau - tau_1` (Eq. 12) by least squares, where `tau_1`
    /// are the efforts of the parameters with the other derivatives. Some hundred states of each file
    /// stand for all; the factor of all keeps `d` small where these say little.
    ///
    /// - `beta`: the parameters found, SI; `weights`: those of the equations by effort;
    /// - `factor`: weighted, that the parameters are the solution of.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn discretisation(
        &self,
        beta: &[f64],
        weights: &[f64],
        factor: &QrFactor,
    ) -> Result<Vec<f64>, DataError> {
        let r = beta.len();
        let mut changes = Changes {
            beta,
            weights,
            factor: QrFactor::new(factor.labels().to_vec()),
        };
        for (log, report) in self.files.iter().zip(&self.reports) {
            let differs = match self.settings.method {
                Method::Central => log.encoders.iter().any(|e| e.neighbours > 1),
                _ => true,
            };
            if differs && !log.file.layout.derivatives {
                self.changes(log, report.rows, &mut changes)?;
            }
        }
        let part = changes.factor.rows() as f64 / factor.rows().max(1) as f64;
        let whole: Vec<f64> = factor
            .r()
            .iter()
            .map(|x| (HELD * part).sqrt() * x)
            .collect();
        let solved = changes.factor.push_block(&whole, &vec![0.0; r]);
        Ok(match solved.and_then(|()| changes.factor.solve()) {
            Ok(change) if part > 0.0 => change,
            _ => vec![0.0; r],
        })
    }

    /// Adds the equations of one file.
    fn changes(&self, log: &Log, rows: usize, out: &mut Changes<'_>) -> Result<(), DataError> {
        let measured = &log.file.layout.measured;
        let mut completions = Completions {
            usual: Completion::new(self.model, measured, &vec![1.0; measured.len()])?,
            other: Completion::new(self.model, measured, &vec![1.0; measured.len()])?,
        };
        // a filter settles within a part of each stretch only
        let step = log.survey.step();
        let slower = another(self.settings.method, step).support(step);
        let slower = slower.ok().flatten().unwrap_or(0).min(rows);
        let length = (ROWS / STRETCHES).max(4 * slower);
        let (count, length) = if rows <= STRETCHES * length {
            (1, rows)
        } else {
            (STRETCHES, length)
        };
        let every = (count * length).div_ceil(STATES).max(1);
        let mut stretch: Vec<LogRow> = Vec::new();
        let mut place = 0;
        log.file
            .rows(&log.survey, &mut |_| {}, &mut |row, follows| {
                let within = place < (place * count / rows.max(1)) * rows / count + length;
                place += 1;
                if !follows || !within {
                    self.stretch(log, &mut stretch, every, &mut completions, out)?;
                }
                if within {
                    stretch.push(row);
                }
                Ok(())
            })?;
        self.stretch(log, &mut stretch, every, &mut completions, out)
    }

    /// Adds the equations of rows that follow each other, and empties them.
    fn stretch(
        &self,
        log: &Log,
        rows: &mut Vec<LogRow>,
        every: usize,
        completions: &mut Completions<'_, M>,
        out: &mut Changes<'_>,
    ) -> Result<(), DataError> {
        let rows = core::mem::take(rows);
        let times: Vec<f64> = rows.iter().map(|r| r.values[0]).collect();
        let method = self.settings.method;
        let mut valid = 0..rows.len();
        let (mut usual, mut other) = (Vec::new(), Vec::new());
        for (place, entry) in log.file.layout.positions().enumerate() {
            let positions: Vec<f64> = rows.iter().map(|r| r.values[entry]).collect();
            // a stretch that is too short gives nothing
            let Ok((a, b)) = both(log, method, place, &times, &positions) else {
                return Ok(());
            };
            for found in [&a, &b] {
                valid = valid.start.max(found.valid.start)..valid.end.min(found.valid.end);
            }
            usual.push(a);
            other.push(b);
        }
        let (n, r) = (self.model.info().dof(), out.beta.len());
        let (mut w, mut tau, mut changed) = (vec![0.0; n * r], vec![0.0; n], vec![0.0; n]);
        for k in valid.step_by(every) {
            let same = |(a, b): (&Derivatives, &Derivatives)| a.rate[k] * b.rate[k] >= 0.0;
            // where a velocity changes its sign, friction differs by more than derivatives do
            if !usual.iter().zip(&other).all(same) {
                continue;
            }
            let at = |all: &[Derivatives]| {
                let q: Vec<f64> = all.iter().map(|d| d.value[k]).collect();
                let qd: Vec<f64> = all.iter().map(|d| d.rate[k]).collect();
                let qdd: Vec<f64> = all.iter().map(|d| d.acceleration[k]).collect();
                (q, qd, qdd)
            };
            let (q, qd, qdd) = at(&usual);
            let Completed::State(a) = completions.usual.complete(&q, &qd, &qdd)? else {
                continue;
            };
            let (q, qd, qdd) = at(&other);
            let Completed::State(b) = completions.other.complete(&q, &qd, &qdd)? else {
                continue;
            };
            let model = self.model;
            let judged = [
                model.base_regressor(&a.q, &a.qd, &a.qdd, &mut w)?,
                model.base_inverse_dynamics(&a.q, &a.qd, &a.qdd, out.beta, &mut tau)?,
                model.base_inverse_dynamics(&b.q, &b.qd, &b.qdd, out.beta, &mut changed)?,
            ];
            if judged
                .iter()
                .any(|c| c.status() == regen_runtime::Status::Singular)
            {
                continue;
            }
            out.push(&mut w, &tau, &changed);
        }
        Ok(())
    }
}

/// The method that the one of the logs is compared with.
fn another(method: Method, step: f64) -> Method {
    match (method, method.of_states(step)) {
        (
            Method::Fourier {
                frequency,
                harmonics,
            },
            _,
        ) => Method::Butterworth {
            order: ORDER,
            cutoff: frequency * harmonics as f64,
        }
        .of_states(step),
        (_, filter @ Method::Butterworth { .. }) => filter,
        (_, Method::Local { half_width }) => Method::Local {
            half_width: WIDER * half_width,
        },
        _ => Method::Central,
    }
}

/// The derivatives of a position that are used, and those of another method.
fn both(
    log: &Log,
    method: Method,
    place: usize,
    times: &[f64],
    positions: &[f64],
) -> Result<(Derivatives, Derivatives), SignalError> {
    let step = log.survey.step();
    let usual = match (method, &log.series) {
        (Method::Fourier { .. }, Some(series)) => {
            let [mut value, mut rate, mut acceleration] = [vec![], vec![], vec![]];
            for [q, qd, qdd] in times.iter().map(|t| series.at(place, *t)) {
                value.push(q);
                rate.push(qd);
                acceleration.push(qdd);
            }
            Derivatives {
                value,
                rate,
                acceleration,
                valid: 0..times.len(),
            }
        }
        (Method::Central, _) => {
            let neighbours = log.encoders.get(place).map_or(1, |e| e.neighbours);
            differences(times, positions, neighbours)?
        }
        _ => method.of_states(step).differentiate(times, positions)?,
    };
    let other = another(method, step).differentiate(times, positions)?;
    let other = match method {
        // a stronger filter would differ by the noise that it takes away
        Method::Butterworth { .. } => differences(times, &other.value, 1).map(|d| Derivatives {
            valid: other.valid,
            ..d
        })?,
        _ => other,
    };
    Ok((usual, other))
}

/// The closures of both kinds of states, each of which goes on from its last one.
struct Completions<'m, M: ?Sized> {
    usual: Completion<'m, M>,
    other: Completion<'m, M>,
}

/// Equations of the changes.
struct Changes<'a> {
    beta: &'a [f64],
    weights: &'a [f64],
    factor: QrFactor,
}

impl Changes<'_> {
    /// Adds those of one state: its regressor, and its efforts with both derivatives.
    fn push(&mut self, w: &mut [f64], tau: &[f64], changed: &[f64]) {
        let n = tau.len();
        let weight = |i: usize| self.weights.get(i).copied().unwrap_or(1.0);
        for column in w.chunks_exact_mut(n.max(1)) {
            for (i, entry) in column.iter_mut().enumerate() {
                *entry *= weight(i);
            }
        }
        let pairs = tau.iter().zip(changed).enumerate();
        let side: Vec<f64> = pairs.map(|(i, (a, b))| weight(i) * (a - b)).collect();
        // what is not finite says nothing
        let _ = self.factor.push_block(w, &side);
    }
}
