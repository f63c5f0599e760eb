//! What the way from positions to derivatives does to an estimate: derivatives from samples or of
//! a fitted series are not those of the motion, and no residual says so.

use std::prelude::v1::*;
use std::vec;

use super::logs::{Log, Logs};
use super::problem::DataError;
use super::reader::Kept;
use crate::BaseModel;
use crate::estimate::{Estimate, Factor};
use crate::identify::{Completed, Completion};
use crate::signals::{Derivatives, Method, SignalError, differences};

/// Rows of each file that are looked at, in so many stretches.
const ROWS: usize = 8192;
const STRETCHES: usize = 8;
/// States of each file that equations are made of.
const STATES: usize = 500;
/// Of the filter that a series is compared with.
const ORDER: usize = 4;

impl<M: BaseModel<f64> + ?Sized> Logs<'_, M> {
    /// By how much each base parameter would change if derivatives were taken in another way: an
    /// estimate, from some hundred states of each file, of what is not known of the motion.
    ///
    /// Differences and regressions are compared with differences over one neighbour on either side
    /// (Eq. 31), a series (Eq. 25) with what a filter of three times its highest frequency leaves of
    /// the positions. To first order the change is the least-squares solution of
    /// `W d = (W - W_1) beta`, where `W_1` is the regressor (Eq. 12) with the other derivatives. Zero
    /// where derivatives are measured, or where noise decided for one neighbour.
    ///
    /// - `beta`: the parameters found, SI; `weights`: those of the equations by effort.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn discretisation(&self, beta: &[f64], weights: &[f64]) -> Result<Vec<f64>, DataError> {
        let base = self.model.base_info().base;
        let labels: Vec<String> = base.iter().map(|b| b.label.to_owned()).collect();
        let mut changes = Changes {
            beta,
            weights,
            factor: Factor::new(labels),
        };
        for (log, report) in self.files.iter().zip(&self.reports) {
            let another = match self.settings.method {
                Method::Central => log.encoders.iter().any(|e| e.neighbours > 1),
                _ => true,
            };
            if another && !log.file.layout.derivatives {
                self.changes(log, report.rows, &mut changes)?;
            }
        }
        let nothing = vec![0.0; beta.len()];
        if changes.factor.rows() < beta.len() {
            return Ok(nothing);
        }
        // parameters that these states do not determine are judged by the whole log
        Ok(Estimate::of(&changes.factor).map_or(nothing, |found| found.values))
    }

    /// Adds the equations of one file.
    fn changes(&self, log: &Log, rows: usize, out: &mut Changes<'_>) -> Result<(), DataError> {
        let measured = &log.file.layout.measured;
        let mut completions = Completions {
            usual: Completion::new(self.model, measured, &vec![1.0; measured.len()])?,
            other: Completion::new(self.model, measured, &vec![1.0; measured.len()])?,
        };
        let length = ROWS / STRETCHES;
        let (count, length) = if rows <= ROWS {
            (1, rows)
        } else {
            (STRETCHES, length)
        };
        let every = (count * length).div_ceil(STATES).max(1);
        let mut stretch: Vec<Kept> = Vec::new();
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
        rows: &mut Vec<Kept>,
        every: usize,
        completions: &mut Completions<'_, M>,
        out: &mut Changes<'_>,
    ) -> Result<(), DataError> {
        let rows = core::mem::take(rows);
        let times: Vec<f64> = rows.iter().map(|r| r.values[0]).collect();
        let method = self.settings.method.of_states(log.survey.step());
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
            let same = |(a, b): (&Derivatives, &Derivatives)| a.rate[k] * b.rate[k] > 0.0;
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
            if judged.iter().any(|c| c.status() == crate::Status::Singular) {
                continue;
            }
            out.push(&mut w, &tau, &changed);
        }
        Ok(())
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
    if let (
        Method::Fourier {
            frequency,
            harmonics,
        },
        Some(series),
    ) = (method, &log.series)
    {
        let [mut value, mut rate, mut acceleration] = [vec![], vec![], vec![]];
        for [q, qd, qdd] in times.iter().map(|t| series.at(place, *t)) {
            value.push(q);
            rate.push(qd);
            acceleration.push(qdd);
        }
        let series = Derivatives {
            value,
            rate,
            acceleration,
            valid: 0..times.len(),
        };
        let filter = Method::Butterworth {
            order: ORDER,
            cutoff: frequency * harmonics as f64,
        };
        let filter = filter.of_states(log.survey.step());
        return Ok((series, filter.differentiate(times, positions)?));
    }
    let neighbours = log.encoders.get(place).map_or(1, |e| e.neighbours);
    let usual = match method {
        Method::Central => differences(times, positions, neighbours)?,
        _ => method.differentiate(times, positions)?,
    };
    let other = differences(times, &usual.value, 1)?;
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
    factor: Factor,
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
