//! Identification by instrumental variables. The instruments are evaluated at the measured motion
//! after smoothing, or at that of a robot simulated under control along a reference.

use core::fmt;

use regen_identify::data::{DataError, Logs, Run, Settings as Reading};
use regen_identify::estimate::EstimateError;
use regen_identify::identify::{self, InstrumentOptions, Instrumental, MotionSeries};
use regen_identify::model::{IdentifiedModel, Intervals};
use regen_identify::session::{LeastSquaresStart, Session};
use regen_identify::signals::{Method, SignalError};
use regen_runtime::{BaseModel, SizeError};

use crate::closed_loop::{self, ClosedLoop, Controllers, LoopError};
use crate::simulate::Gains;
use crate::trajectory::FourierReference;

/// The bandwidth of simulated controllers whose gains are not given, Hz, where none can be found.
const BANDWIDTH_HZ: f64 = 3.0;

/// The result of identification by instrumental variables.
#[derive(Clone, Debug)]
pub struct InstrumentalResult {
    /// The estimate, its rounds, and its difference from least squares.
    pub instrumental: Instrumental,
    /// The cut-off frequency at which the measured motion was smoothed, Hz; `None` where the motion
    /// was simulated.
    pub cutoff: Option<f64>,
    /// The bandwidth of simulated controllers without given gains, Hz: that with which the simulated
    /// motion is nearest to the measured one. `None` where nothing was simulated.
    pub controller_bandwidth: Option<f64>,
    /// The identified model; its intervals include the uncertainty that sampling leaves in the
    /// motion.
    pub model: IdentifiedModel,
}

/// Identifies base parameters by instrumental variables.
///
/// - `start`: least squares from the same logs;
/// - `logs`: the logs, read with the settings of `session`; the measured motion is taken from all
///   of their positions, unfiltered;
/// - `reference`: the motion that the robot was to follow, and gains of its controllers, if the
///   instruments are to be simulated; without it the measured motion is smoothed.
///
/// # Errors
/// The logs cannot be read, the measured motion cannot be smoothed, or the robot cannot be
/// simulated with an estimate: see [`InstrumentError`].
pub fn instrumental<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    start: &LeastSquaresStart,
    logs: &[Run],
    reference: Option<(&FourierReference, &[Gains])>,
) -> Result<InstrumentalResult, InstrumentError> {
    let model = session.model;
    // all positions, unfiltered, whatever filter the regressor passes: filtered rows would be
    // decimated
    let raw = Reading {
        method: Method::Central,
        decimation: 1,
        ..session.reading.clone()
    };
    session.watch.phase("reading the measured motion");
    let measured =
        Logs::open(model, logs, &raw).and_then(|mut l| MotionSeries::recorded(model, &mut l));
    session.watch.finished();
    let measured = measured?;
    let options = InstrumentOptions {
        weighting: session.options.weighting,
        hac_bandwidth: session.options.hac_bandwidth,
        ..InstrumentOptions::default()
    };
    let mut logs = session.open(logs)?;
    let least = &start.estimate.values;
    let (smooth, cutoff) = measured
        .smoothed(None)
        .map_err(InstrumentError::Unsmoothed)?;
    let mut smooth = Some(smooth);
    let mut result = identify::instrumental(model, &options, &mut logs, least, &mut |_| {
        Ok::<_, DataError>(smooth.take())
    })?;
    let mut cutoff = Some(cutoff);
    let mut bandwidth = None;
    if let Some((reference, gains)) = reference {
        // least squares may be too biased for a simulation; this estimate is less biased
        let first = result.estimate.values.clone();
        let near = nearest(model, reference, gains, &measured, &first).unwrap_or(BANDWIDTH_HZ);
        bandwidth = Some(near);
        let mut failed = None;
        let simulation = identify::instrumental(
            model,
            &options,
            &mut logs,
            &first,
            &mut |values| match simulated(model, (reference, near), gains, &measured, values) {
                Ok(motion) => Ok(Some(motion)),
                Err(why) => {
                    failed = Some(why);
                    Err(EstimateError::NoConvergence.into())
                }
            },
        );
        if let Some(why) = failed {
            return Err(why);
        }
        (result, cutoff) = (simulation?, None);
    }
    let model = identified(session, start, &result);
    Ok(InstrumentalResult {
        instrumental: result,
        cutoff,
        controller_bandwidth: bandwidth,
        model,
    })
}

/// The identified model with the confidence intervals of its values.
fn identified<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    start: &LeastSquaresStart,
    result: &Instrumental,
) -> IdentifiedModel {
    let method = format!(
        "instrumental variables, whitened scores correlated in {} samples (Newey and West)",
        result.hac_bandwidth
    );
    // the regressor, and so its sampling uncertainty, is that of least squares
    let mut estimate = result.estimate.clone();
    if let Some(blocks) = &start.score_blocks {
        let n = estimate.values.len();
        let all: Vec<usize> = (0..n).collect();
        let mut change = blocks.change(&start.factor, &all);
        change.resize(n, 0.0);
        let pairs = change
            .iter()
            .flat_map(|a| change.iter().map(move |b| a * b));
        let covariance = estimate.covariance.iter().zip(pairs);
        estimate.covariance = covariance.map(|(c, x)| c + x).collect();
    }
    IdentifiedModel {
        name: "instrumental variables".to_owned(),
        beta: result.estimate.values.clone(),
        feasibility: "not judged".to_owned(),
        intervals: Intervals::of(&estimate, &estimate, session.confidence, method),
        ..IdentifiedModel::default()
    }
}

/// The bandwidth with which the simulated motion is nearest to the measured one; `None` where gains
/// are given for all joints, or no bandwidth can be simulated.
fn nearest<M: BaseModel<f64> + ?Sized>(
    model: &M,
    reference: &FourierReference,
    gains: &[Gains],
    measured: &MotionSeries,
    values: &[f64],
) -> Option<f64> {
    let info = model.info();
    let mut names = info.actuated.iter().map(|k| info.coordinates.get(*k));
    let is_given = |name: Option<&&str>| gains.iter().any(|g| g.name.as_deref() == name.copied());
    if gains.iter().any(|g| g.name.is_none()) || names.all(is_given) {
        return None;
    }
    let run = measured.runs().into_iter().find(|run| run.len() > 1)?;
    let times = measured.times().get(run)?;
    let step = (times.last()? - times.first()?) / (times.len() - 1) as f64;
    closed_loop::nearest_bandwidth(step, &mut |bandwidth| {
        let motion = simulated(model, (reference, bandwidth), gains, measured, values).ok()?;
        Some(distance(&motion, measured, info.dof()))
    })
}

/// The squared differences of two motions' positions, each coordinate relative to how far it moves.
fn distance(simulated: &MotionSeries, measured: &MotionSeries, dof: usize) -> f64 {
    let rows: Vec<usize> = measured
        .runs()
        .into_iter()
        .filter(|run| run.len() > 1)
        .flatten()
        .collect();
    let position = |motion: &MotionSeries, row: usize, c: usize| {
        let [q, ..] = motion.state(row);
        q.get(c).copied().unwrap_or(0.0)
    };
    let one = |c: usize| {
        let own: Vec<f64> = rows.iter().map(|row| position(measured, *row, c)).collect();
        let mean = own.iter().sum::<f64>() / own.len().max(1) as f64;
        let motion: f64 = own.iter().map(|x| (x - mean) * (x - mean)).sum();
        let off = own.iter().enumerate().map(|(k, x)| {
            let off = position(simulated, k, c) - x;
            off * off
        });
        off.sum::<f64>() / motion.max(f64::MIN_POSITIVE)
    };
    (0..dof).map(one).sum()
}

/// The motion of the robot with these base parameters under PID control along a reference. Each run
/// begins one period earlier, so that the initial transient has decayed.
fn simulated<M: BaseModel<f64> + ?Sized>(
    model: &M,
    (reference, bandwidth): (&FourierReference, f64),
    gains: &[Gains],
    measured: &MotionSeries,
    values: &[f64],
) -> Result<MotionSeries, InstrumentError> {
    let mut phi = vec![0.0; model.info().parameters.len()];
    let free = vec![0.0; model.base_info().free.len()];
    model.parameters_from_base(values, &free, &mut phi)?;
    let run = ClosedLoop {
        reference,
        lead: reference.period(),
        controllers: Controllers::Tuned {
            bandwidth,
            given: gains,
        },
    };
    Ok(closed_loop::motion(model, &run, &phi, measured)?)
}

/// Why instrumental variables cannot be computed.
#[derive(Debug)]
#[non_exhaustive]
pub enum InstrumentError {
    /// The logs cannot be read, or the instruments leave parameters undetermined.
    Data(DataError),
    /// The measured motion cannot be smoothed.
    Unsmoothed(SignalError),
    /// The robot cannot be simulated with the present estimate.
    Loop(LoopError),
    /// The estimate and the model differ in size.
    Size(SizeError),
}

impl fmt::Display for InstrumentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Data(why) => why.fmt(f),
            Self::Unsmoothed(why) => write!(f, "the measured motion cannot be smoothed: {why}"),
            Self::Loop(why) => why.fmt(f),
            Self::Size(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for InstrumentError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Data(why) => Some(why),
            Self::Unsmoothed(why) => Some(why),
            Self::Loop(why) => Some(why),
            Self::Size(why) => Some(why),
        }
    }
}

impl From<DataError> for InstrumentError {
    fn from(why: DataError) -> Self {
        Self::Data(why)
    }
}

impl From<LoopError> for InstrumentError {
    fn from(why: LoopError) -> Self {
        Self::Loop(why)
    }
}

impl From<SizeError> for InstrumentError {
    fn from(why: SizeError) -> Self {
        Self::Size(why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion of two coordinates through these positions, at rest.
    fn motion(rows: &[[f64; 2]]) -> MotionSeries {
        let mut out = MotionSeries::new(2);
        for (k, q) in rows.iter().enumerate() {
            out.push(k as f64, [q, &[0.0; 2], &[0.0; 2]], k > 0)
                .unwrap();
        }
        out
    }

    #[test]
    fn motions_are_as_far_apart_in_other_units_and_from_other_zeros() {
        let measured = [[1.0, 2.0], [2.0, 0.0], [3.0, 1.0], [6.0, 5.0]];
        let simulated = [[1.5, 2.0], [2.0, 1.0], [3.0, 1.0], [5.0, 5.0]];
        // squares of 1.25 and 1 to be compared with those of 14 and 14 about the means 3 and 2
        let wanted = 1.25 / 14.0 + 1.0 / 14.0;
        let both = |change: &dyn Fn([f64; 2]) -> [f64; 2]| {
            let changed = |rows: [[f64; 2]; 4]| motion(&rows.map(change));
            distance(&changed(simulated), &changed(measured), 2)
        };
        for found in [
            both(&|q| q),
            both(&|[a, b]| [1000.0 * a, b]),
            both(&|[a, b]| [a + 7.0, b - 2.5]),
            both(&|[a, b]| [b, a]),
        ] {
            assert!((found - wanted).abs() < 1e-12, "{found}");
        }
    }
}
