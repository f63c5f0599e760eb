//! Standard deviations of the shared unknowns, from residuals that are correlated in time.

use regen_identify::estimate::{
    Deviations, EffortError, Estimate, ORDER, QrFactor, Residuals, Scores,
};
use regen_runtime::BaseModel;

use crate::rank::Undetermined;
use crate::residuals::SignalRows;
use crate::search::{Searched, Signals, substitute};
use crate::window::Experiment;
use crate::{Number, ResponseError};

/// The damping of each window's own unknowns, relative to the squared lengths of their columns; it
/// keeps the factor regular where the window does not determine some of them.
const OWN_DAMPING: f64 = 1e-14;
/// The number of lags at which the autocorrelation of the residuals is computed.
const LAGS: usize = 20;

/// The statistics of a fit.
pub(crate) struct Statistics {
    /// The determined unknowns with their covariance for white residuals.
    pub(crate) white: Estimate,
    /// The same with a covariance that accounts for the residuals' correlation in time.
    pub(crate) correlated: Estimate,
    pub(crate) deviations: Deviations,
    pub(crate) errors: Vec<EffortError>,
}

impl<M, D> Experiment<'_, '_, M, D>
where
    M: BaseModel<f64> + ?Sized + Sync,
    D: BaseModel<Number> + ?Sized + Sync,
{
    /// Computes the statistics at the result of a search.
    pub(crate) fn statistics(
        &self,
        signals: &Signals,
        names: &[String],
        found: &Searched,
        open: &Undetermined,
    ) -> Result<Statistics, ResponseError> {
        let factor = found.factor.select(&open.kept)?;
        let mut windows = Vec::with_capacity(found.windows.len());
        for window in &found.windows {
            let trace = match self.simulate(window, &found.shared)? {
                Ok(trace) => trace,
                Err(why) => {
                    return Err(ResponseError::Start {
                        time: 0.0,
                        why: why.words(),
                    });
                }
            };
            let rows = self.rows(signals, window, &found.shared, &trace);
            windows.push(self.projected(&rows, window.rows.len(), &found.weights, open)?);
        }
        let zeros = vec![0.0; names.len()];
        let mut errors = Residuals::new(names, &means(&windows, names.len()), LAGS);
        let mut noise = Residuals::new(names, &zeros, ORDER);
        for window in &windows {
            errors.interrupt();
            noise.interrupt();
            for sample in window {
                errors.push_used(&sample.measured, &sample.fitted, &sample.used)?;
                noise.push_used(&sample.psi, &zeros, &sample.used)?;
            }
        }
        let fits = noise.autoregressions();
        let kept = open.kept.len();
        let mut scores = Scores::new(kept, &fits);
        let slopes = vec![1.0; names.len()];
        for window in &windows {
            scores.interrupt();
            for sample in window {
                let weights: Vec<f64> = sample
                    .used
                    .iter()
                    .map(|u| f64::from(u8::from(*u)))
                    .collect();
                scores.push(&sample.w, &weights, &sample.psi, &slopes)?;
            }
        }
        let values: Vec<f64> = open.kept.iter().map(|k| found.shared[*k]).collect();
        let white = Estimate {
            values: values.clone(),
            ..Estimate::of(&factor)?
        };
        let all: Vec<usize> = (0..kept).collect();
        let deviations = scores
            .finish(&values)?
            .deviations(&factor, &all, &values, 1.0)?;
        Ok(Statistics {
            correlated: white.with_deviations(&deviations),
            white,
            deviations,
            errors: errors.efforts(),
        })
    }

    /// The weighted rows of a window for the determined unknowns, projected onto the complement of
    /// the columns of the window's own unknowns, sample by sample.
    fn projected(
        &self,
        rows: &[SignalRows],
        samples: usize,
        weights: &[f64],
        open: &Undetermined,
    ) -> Result<Vec<Sample>, ResponseError> {
        let own = self.own();
        let n = own + self.unknowns.len();
        let mut whole = QrFactor::new(vec![String::new(); n]);
        for (rows, weight) in rows.iter().zip(weights) {
            let scaled: Vec<f64> = rows.slopes.iter().map(|x| x * weight).collect();
            whole.push_block(&scaled, &vec![0.0; rows.values.len()])?;
        }
        let norms = whole.column_norms();
        let mut damping = vec![0.0; own * n];
        for (k, norm) in norms.iter().take(own).enumerate() {
            let size = if *norm > 0.0 { *norm } else { 1.0 };
            damping[k * own + k] = OWN_DAMPING.sqrt() * size;
        }
        whole.push_block(&damping, &vec![0.0; own])?;
        let mut triangle = Vec::with_capacity(own * own);
        for j in 0..own {
            triangle.extend_from_slice(&whole.r()[j * n..j * n + own]);
        }
        // the regression of each shared unknown's column on those of the window's own unknowns
        let explained = open.kept.iter().map(|k| {
            let column = (own + k) * n;
            substitute(&triangle, &whole.r()[column..column + own])
        });
        let explained: Vec<Vec<f64>> = explained.collect();
        let count = rows.len();
        let empty = Sample {
            w: vec![0.0; count * open.kept.len()],
            psi: vec![0.0; count],
            measured: vec![0.0; count],
            fitted: vec![0.0; count],
            used: vec![false; count],
        };
        let mut out = vec![empty; samples];
        for (s, (rows, weight)) in rows.iter().zip(weights).enumerate() {
            let height = rows.values.len();
            for (line, (row, value)) in rows.rows.iter().zip(&rows.values).enumerate() {
                let sample = &mut out[*row];
                sample.used[s] = true;
                sample.psi[s] = value * weight;
                sample.measured[s] = rows.measured[line];
                sample.fitted[s] = rows.measured[line] - value;
                for (place, (k, parts)) in open.kept.iter().zip(&explained).enumerate() {
                    let mut x = rows.slopes[(own + k) * height + line];
                    for (j, part) in parts.iter().enumerate() {
                        x -= rows.slopes[j * height + line] * part;
                    }
                    sample.w[place * count + s] = x * weight;
                }
            }
        }
        Ok(out)
    }
}

/// The mean of each signal.
fn means(windows: &[Vec<Sample>], signals: usize) -> Vec<f64> {
    let mean = |s: usize| {
        let used = windows.iter().flatten().filter(|x| x.used[s]);
        let (sum, count) = used.fold((0.0, 0.0), |(sum, n), x| (sum + x.measured[s], n + 1.0));
        sum / f64::max(count, 1.0)
    };
    (0..signals).map(mean).collect()
}

/// The rows of one sample.
#[derive(Clone)]
struct Sample {
    /// The weighted derivatives, signals x determined unknowns, column by column.
    w: Vec<f64>,
    /// The weighted residual of each signal.
    psi: Vec<f64>,
    /// The measured value of each signal, in its unit.
    measured: Vec<f64>,
    /// The fitted value of each signal, in its unit.
    fitted: Vec<f64>,
    /// Whether each signal has a residual at the sample.
    used: Vec<bool>,
}
