//! Estimates the error of the parameters that comes from differentiating the positions:
//! derivatives from samples or of a fitted series differ from those of the motion, and no
//! residual reveals it.

use super::logs::{Log, Logs};
use super::motion;
use super::problem::DataError;
use super::stretch::Stretch;
use crate::estimate::QrFactor;
use crate::identify::{Completed, Completion};
use crate::signals::{Derivatives, Method, SignalError, differences};
use regen_runtime::BaseModel;

/// Rows of each file that are differentiated in both ways, unless a filter needs more.
const SAMPLED_ROWS: usize = 8192;
/// Number of stretches that these rows are divided into.
const STRETCHES: usize = 8;
/// Approximate number of states of each file that equations are set up for.
const SAMPLED_STATES: usize = 500;
/// Order of the Butterworth filter that a series is compared with.
const FILTER_ORDER: usize = 4;
/// Weight of the whole log's QR factor against the equations of the sampled states: it decides
/// only where these contain little information.
const WHOLE_LOG_WEIGHT: f64 = 1e-3;
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
    /// To first order the change `d` solves `W d = tau - tau_1` (Eq. 12) by least squares, where
    /// `tau_1` are the efforts that the parameters predict with the other derivatives. A few
    /// hundred states of each file represent the whole file; the factor of all states keeps `d`
    /// small where these contain little information.
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
            .map(|x| (WHOLE_LOG_WEIGHT * part).sqrt() * x)
            .collect();
        let solved = changes.factor.push_block(&whole, &vec![0.0; r]);
        Ok(match solved.and_then(|()| changes.factor.solve()) {
            Ok(change) if part > 0.0 => change,
            _ => vec![0.0; r],
        })
    }

    /// Adds the equations of one file with `rows` usable rows.
    fn changes(&self, log: &Log, rows: usize, out: &mut Changes<'_>) -> Result<(), DataError> {
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
        let every = (count * length).div_ceil(SAMPLED_STATES).max(1);
        let mut stretch = Stretch::default();
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

    /// Adds the equations of consecutive rows, and clears the rows.
    fn stretch(
        &self,
        log: &Log,
        rows: &mut Stretch,
        every: usize,
        completions: &mut Completions<'_, M>,
        out: &mut Changes<'_>,
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
        for k in valid.step_by(every) {
            let same_sign = |(a, b): (&Derivatives, &Derivatives)| a.rate[k] * b.rate[k] >= 0.0;
            // where a velocity's sign depends on the method, friction would change more than the
            // derivatives do
            if !usual.iter().zip(&other).all(same_sign) {
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
            out.push(&mut w, &tau, &changed);
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

/// The equations of the parameters' changes, as a QR factor.
struct Changes<'a> {
    beta: &'a [f64],
    weights: &'a [f64],
    factor: QrFactor,
}

impl Changes<'_> {
    /// Adds the equations of one state: `w` is its regressor (n x r, column-major; weighted in
    /// place), `tau` and `changed` are its n efforts with either method's derivatives.
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
        // equations that are not finite are left out
        let _ = self.factor.push_block(w, &side);
    }
}
