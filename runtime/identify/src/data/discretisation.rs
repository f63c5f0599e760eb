//! Estimates the error of the parameters that comes from differentiating the positions:
//! derivatives from samples or of a fitted series differ from those of the motion, and no
//! residual reveals it.

use super::logs::{Log, Logs};
use super::motion;
use super::problem::DataError;
use super::reader::LogRow;
use super::replaced::ReplacedRows;
use super::stretch::Stretch;
use crate::estimate::{EstimateError, QrFactor};
use crate::identify::ChangedParameters;
use crate::signals::{Derivatives, Method, SignalError, differences};
use crate::states::{ChangedEfforts, Completed, Completion, MotionSeries};
use regen_runtime::BaseModel;

/// Rows of each file that are differentiated in both ways, unless a filter needs more.
const SAMPLED_ROWS: usize = 8192;
/// Number of stretches that these rows are divided into.
const STRETCHES: usize = 8;
/// Approximate number of states of each file at which efforts are compared.
const SAMPLED_STATES: usize = 2000;
/// Order of the Butterworth filter that a series is compared with.
const FILTER_ORDER: usize = 4;
/// Half width of the regression that a local regression is compared with, over its own.
const WIDER_REGRESSION: f64 = 1.5;

impl<M: BaseModel<f64> + ?Sized> Logs<'_, M> {
    /// Estimates by how much each base parameter would change if the positions were differentiated
    /// in another way: an error of the motion that no residual reveals. Returns r entries, SI.
    ///
    /// Differences, also of filtered positions, are compared with those over one neighbour on
    /// either side (Eq. 31), a local regression with a wider one, and a series (Eq. 25) with the
    /// positions behind a filter of three times its highest frequency. The change is zero where
    /// derivatives are measured, or where the encoder's noise made one neighbour the best choice.
    ///
    /// Two thousand states of each file represent the whole file; the factor of all states keeps
    /// the change small where these contain little information.
    ///
    /// - `beta`: the identified parameters, SI; `weights`: one for each of the n equations of a
    ///   state;
    /// - `factor`: the weighted QR factor whose solution the parameters are.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn discretisation(
        &self,
        beta: &[f64],
        weights: &[f64],
        factor: &QrFactor,
    ) -> Result<Vec<f64>, DataError> {
        let mut found = ChangedParameters::new(factor.labels().to_vec());
        let mut w = Vec::new();
        self.visit_changed_efforts(beta, None, &mut |state| {
            w.clear();
            w.extend_from_slice(state.w);
            found.push((&mut w, state.change), weights, state.rows)
        })?;
        Ok(found.finish(factor))
    }

    /// As [`Source::changed_efforts`](crate::states::Source::changed_efforts).
    pub(super) fn visit_changed_efforts(
        &self,
        beta: &[f64],
        motion: Option<&MotionSeries>,
        each: &mut dyn FnMut(&ChangedEfforts<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), DataError> {
        let differs = |log: &Log| {
            let differs = match self.settings.method {
                Method::Central => log.encoders.iter().any(|e| e.neighbours > 1),
                _ => true,
            };
            differs && !log.file.layout.derivatives
        };
        if !self.files.iter().any(differs) {
            return Ok(());
        }
        // two kinds of logs are compared as they were measured: with a series, which is fitted to the
        // measured positions, and averaged over their periods, as the motion has the rows of one period
        let is_series = self.files.iter().any(|log| log.series.is_some());
        let motion = motion.filter(|_| !is_series && self.settings.period.is_none());
        let mut replaced = match motion {
            Some(motion) => Some(ReplacedRows::new(self.model, motion)?),
            None => None,
        };
        let mut out = Changes {
            beta,
            every: 1,
            rows: 1.0,
            each,
        };
        // files whose derivatives do not depend on the method count too: nothing changes in them
        for (log, report) in self.files.iter().zip(&self.reports) {
            self.changes(log, report.rows, replaced.as_mut(), &mut out)?;
        }
        Ok(())
    }

    /// Passes on the states of one file with `rows` usable rows.
    fn changes(
        &self,
        log: &Log,
        rows: usize,
        mut replaced: Option<&mut ReplacedRows<'_, M>>,
        out: &mut Changes<'_, '_>,
    ) -> Result<(), DataError> {
        let measured = &log.file.layout.measured;
        let mut completions = Completions {
            usual: Completion::new(self.model, measured, &vec![1.0; measured.len()])?,
            other: Completion::new(self.model, measured, &vec![1.0; measured.len()])?,
        };
        // long enough for states between the ends of a stretch, where the filter settles
        let step = log.survey.time_step();
        let slower = comparison_method(self.settings.method, step).support(step);
        let slower = slower.ok().flatten().unwrap_or(0).min(rows);
        let length = (SAMPLED_ROWS / STRETCHES).max(4 * slower);
        let (count, length) = if rows <= STRETCHES * length {
            (1, rows)
        } else {
            (STRETCHES, length)
        };
        out.every = (count * length).div_ceil(SAMPLED_STATES).max(1);
        out.rows = rows as f64 * out.every as f64 / (count * length).max(1) as f64;
        let mut stretch = Stretch::default();
        let mut place = 0;
        let mut other = LogRow::default();
        log.rows(&mut |_| {}, &mut |row, follows| {
            let within = place < (place * count / rows.max(1)) * rows / count + length;
            place += 1;
            let (row, follows) = match &mut replaced {
                _ if !within => (None, false),
                None => (Some(row), follows),
                Some(replaced) => {
                    other.clone_from(row);
                    match replaced.replace(&log.file.layout, &mut other)? {
                        None => (None, false),
                        Some(goes_on) => (Some(&other), follows && goes_on),
                    }
                }
            };
            if !follows {
                self.stretch(log, &mut stretch, &mut completions, out)?;
            }
            if let Some(row) = row {
                stretch.push(row);
            }
            Ok(())
        })?;
        self.stretch(log, &mut stretch, &mut completions, out)
    }

    /// Passes on the states of consecutive rows, and clears the rows.
    fn stretch(
        &self,
        log: &Log,
        rows: &mut Stretch,
        completions: &mut Completions<'_, M>,
        out: &mut Changes<'_, '_>,
    ) -> Result<(), DataError> {
        let rows = core::mem::take(rows);
        let method = self.settings.method;
        let mut valid = 0..rows.len();
        let (mut usual, mut other) = (Vec::new(), Vec::new());
        for place in 0..log.file.layout.measured.len() {
            // a stretch that is too short gives no equations
            let Ok((a, b)) = derivatives_by_both_methods(log, method, place, &rows) else {
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
        for k in valid.step_by(out.every) {
            let same_sign = |(a, b): (&Derivatives, &Derivatives)| a.rate[k] * b.rate[k] >= 0.0;
            // where a velocity's sign depends on the method, friction would change more than the
            // derivatives do
            if !usual.iter().zip(&other).all(same_sign) || rows.bridged().get(k) == Some(&true) {
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
            let conditions = [
                model.base_regressor(&a.q, &a.qd, &a.qdd, &mut w)?,
                model.base_inverse_dynamics(&a.q, &a.qd, &a.qdd, out.beta, &mut tau)?,
                model.base_inverse_dynamics(&b.q, &b.qd, &b.qdd, out.beta, &mut changed)?,
            ];
            if conditions
                .iter()
                .any(|c| c.status() == regen_runtime::Status::Singular)
            {
                continue;
            }
            let change: Vec<f64> = tau.iter().zip(&changed).map(|(a, b)| a - b).collect();
            (out.each)(&ChangedEfforts {
                q: &a.q,
                qd: [&a.qd, &b.qd],
                w: &w,
                change: &change,
                rows: out.rows,
            })?;
        }
        Ok(())
    }
}

/// The method that a log's method is compared with.
fn comparison_method(method: Method, step: f64) -> Method {
    match (method, method.of_states(step)) {
        (
            Method::Fourier {
                frequency,
                harmonics,
            },
            _,
        ) => Method::Butterworth {
            order: FILTER_ORDER,
            cutoff: frequency * harmonics as f64,
        }
        .of_states(step),
        (_, filter @ Method::Butterworth { .. }) => filter,
        (_, Method::Local { half_width }) => Method::Local {
            half_width: WIDER_REGRESSION * half_width,
        },
        _ => Method::Central,
    }
}

/// The motion of a coordinate by the log's method, and by the method it is compared with.
fn derivatives_by_both_methods(
    log: &Log,
    method: Method,
    place: usize,
    rows: &Stretch,
) -> Result<(Derivatives, Derivatives), SignalError> {
    let step = log.survey.time_step();
    let usual = motion::derivatives(log, method.of_states(step), place, rows)?;
    let layout = &log.file.layout;
    let measured = |of: &[Option<usize>]| of.get(place).copied().flatten();
    let (velocity, acceleration) = (
        measured(&layout.velocities),
        measured(&layout.accelerations),
    );
    if velocity.is_some() && acceleration.is_some() {
        return Ok((usual.clone(), usual));
    }
    let other = |entry: usize| {
        let (times, values) = (rows.times(), rows.column(entry));
        let other = comparison_method(method, step).differentiate(times, values)?;
        Ok(match method {
            // a stronger filter would differ also by the noise that it removes
            Method::Butterworth { .. } => Derivatives {
                valid: other.valid,
                ..differences(times, &other.value, 1)?
            },
            _ => other,
        })
    };
    let mut found = other(layout.positions().start + place)?;
    if log.series.is_none() {
        if let Some(velocity) = velocity {
            let own: Derivatives = other(velocity)?;
            let valid = [&found.valid, &own.valid];
            found.valid = valid[0].start.max(valid[1].start)..valid[0].end.min(valid[1].end);
            (found.rate, found.acceleration) = (own.value, own.rate);
        }
        if acceleration.is_some() {
            found.acceleration.clone_from(&usual.acceleration);
        }
    }
    Ok((usual, found))
}

/// Solvers that close the loops of the states with either method's derivatives, each from its own
/// last state.
struct Completions<'m, M: ?Sized> {
    usual: Completion<'m, M>,
    other: Completion<'m, M>,
}

/// The parameters, and what receives the states with their efforts' changes.
struct Changes<'a, 'e> {
    beta: &'a [f64],
    /// One of so many rows of the present file becomes a state,
    every: usize,
    /// which stands for so many of its rows.
    rows: f64,
    each: &'a mut (dyn FnMut(&ChangedEfforts<'_>) -> Result<(), EstimateError> + 'e),
}
