//! Identification by instrumental variables. The instruments are evaluated at the measured motion
//! after smoothing, or at that of a robot simulated under control along a reference.

mod loaded;

use core::cell::LazyCell;
use core::fmt;

use regen_identify::data::{DataError, Logs, Run, Settings as Reading};
use regen_identify::estimate::EstimateError;
use regen_identify::gains::GainError;
use regen_identify::identify::{self, InstrumentOptions, Instrumental};
use regen_identify::model::{IdentifiedModel, Intervals};
use regen_identify::session::{self, LeastSquaresStart, PriorKnowledge, Session};
use regen_identify::signals::{Method, SignalError};
use regen_identify::states::MotionSeries;
use regen_runtime::{BaseModel, SizeError};

use crate::closed_loop::{self, ClosedLoop, Controllers, LoopError};
use crate::simulate::Gains;
use crate::trajectory::FourierReference;

pub use loaded::{LoadedInstrumentalResult, instrumental_with_gains};

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
/// The logs cannot be read, the measured motion cannot be smoothed, or the robot can be
/// simulated neither with an estimate nor with physical parameters: see [`InstrumentError`].
pub fn instrumental<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    start: &LeastSquaresStart,
    logs: &[Run],
    reference: Option<(&FourierReference, &[Gains])>,
) -> Result<InstrumentalResult, InstrumentError> {
    let model = session.model;
    session.watch.phase("reading the measured motion");
    let measured = Logs::open(model, logs, &raw(session))
        .and_then(|mut l| MotionSeries::recorded(model, &mut l));
    session.watch.finished();
    let measured = measured?;
    let options = options(session);
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
        let robot = Simulable::new(|| {
            let found = session::physical(session, &PriorKnowledge::default(), start, 0);
            found.ok()?.pop().map(|model| vec![model.beta])
        });
        let with = (reference, gains);
        let all = core::slice::from_ref(&measured);
        let along = Along::choose(model, with, all, &robot, core::slice::from_ref(&first));
        bandwidth = along.bandwidth;
        let mut failed = None;
        let simulation =
            identify::instrumental(model, &options, &mut logs, &first, &mut |values| {
                let motion = robot.try_with(&[values.to_vec()], |values| {
                    let values = values.first().map_or(&[][..], Vec::as_slice);
                    along.motion(model, &measured, values)
                });
                match motion {
                    Ok(motion) => Ok(Some(motion)),
                    Err(why) => {
                        failed = Some(why);
                        Err(EstimateError::NoConvergence.into())
                    }
                }
            });
        if let Some(why) = failed {
            return Err(why);
        }
        (result, cutoff) = (simulation?, None);
    }
    // delays move these values as they move those of least squares
    let late = session::delay_changes(&session.reading, &start.delays);
    let result = result.with_changes(&late);
    let model = identified(session, &result);
    Ok(InstrumentalResult {
        instrumental: result,
        cutoff,
        controller_bandwidth: bandwidth,
        model,
    })
}

/// A robot that can be simulated. An estimate need not be that of bodies, so that its mass matrix may
/// not be positive definite; any motion without the log's noise is a valid instrument, so that the
/// robot with the physical parameters that fit best then moves in its place.
struct Simulable<'a> {
    physical: LazyCell<BaseOfRuns, Box<dyn FnOnce() -> BaseOfRuns + 'a>>,
}

/// The base parameters of each run of a robot; `None` where there is none.
type BaseOfRuns = Option<Vec<Vec<f64>>>;

impl<'a> Simulable<'a> {
    /// - `physical`: computes the base parameters of each run of the physical robot, once.
    fn new(physical: impl FnOnce() -> BaseOfRuns + 'a) -> Self {
        Self {
            physical: LazyCell::new(Box::new(physical)),
        }
    }

    /// Simulates with these base parameters of each run or, where that fails, with the physical ones.
    fn try_with<R, E>(
        &self,
        values: &[Vec<f64>],
        simulate: impl Fn(&[Vec<f64>]) -> Result<R, E>,
    ) -> Result<R, E> {
        simulate(values).or_else(|why| match &*self.physical {
            Some(physical) => simulate(physical).map_err(|_| why),
            None => Err(why),
        })
    }
}

/// The settings for reading the measured motion: all positions, unfiltered, whatever filter the
/// regressor passes, since filtered rows would be decimated.
fn raw<M: ?Sized>(session: &Session<'_, M>) -> Reading {
    Reading {
        method: Method::Central,
        decimation: 1,
        ..session.reading.clone()
    }
}

fn options<M: ?Sized>(session: &Session<'_, M>) -> InstrumentOptions {
    InstrumentOptions {
        weighting: session.options.weighting,
        hac_bandwidth: session.options.hac_bandwidth,
        ..InstrumentOptions::default()
    }
}

/// The identified model with the confidence intervals of its values.
fn identified<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    result: &Instrumental,
) -> IdentifiedModel {
    let method = format!("instrumental variables, {}", result.covariance_in_words());
    let correlated = result.correlated();
    IdentifiedModel {
        name: "instrumental variables".to_owned(),
        beta: result.estimate.values.clone(),
        feasibility: "not judged".to_owned(),
        intervals: Intervals::of(&result.estimate, &correlated, session.confidence, method),
        ..IdentifiedModel::default()
    }
}

/// A robot under PID control along a reference.
#[derive(Clone, Copy)]
struct Along<'a> {
    reference: &'a FourierReference,
    given: &'a [Gains],
    /// Of controllers without given gains, Hz; `None` where gains are given for all joints.
    bandwidth: Option<f64>,
    /// The time before each run for which the motion is simulated, s.
    lead: f64,
}

impl<'a> Along<'a> {
    /// Chooses what is not known by the measured motion of a run: the bandwidth, and whether the robot
    /// repeated the motion before the run or began with it. Without a robot that can be simulated, the
    /// motion was repeated.
    ///
    /// - `measured`: the motion of each run; `values`: its base parameters.
    fn choose<M: BaseModel<f64> + ?Sized>(
        model: &M,
        (reference, given): (&'a FourierReference, &'a [Gains]),
        measured: &[MotionSeries],
        robot: &Simulable<'_>,
        values: &[Vec<f64>],
    ) -> Self {
        let are_given = Gains::are_of_all(given, &model.info());
        let of = |lead: f64| Self {
            reference,
            given,
            bandwidth: (!are_given).then_some(BANDWIDTH_HZ),
            lead,
        };
        let found = robot.try_with(values, |values| {
            let own = measured.first().zip(values.first()).ok_or(())?;
            let Some((repeated, far)) = of(reference.period()).nearest(model, own) else {
                return of(0.0).nearest(model, own).map(|own| own.0).ok_or(());
            };
            let begun = Self {
                lead: 0.0,
                ..repeated
            };
            let is_nearer = begun.distance(model, own).is_some_and(|near| near < far);
            let begun = is_nearer.then(|| begun.nearest(model, own)).flatten();
            Ok(begun.map_or(repeated, |own| own.0))
        });
        found.unwrap_or_else(|()| of(reference.period()))
    }

    /// The same with the bandwidth at which the simulated motion is nearest to the measured one, and
    /// their distance; `None` where no bandwidth can be simulated.
    fn nearest<M: BaseModel<f64> + ?Sized>(
        self,
        model: &M,
        (measured, values): (&MotionSeries, &Vec<f64>),
    ) -> Option<(Self, f64)> {
        let distance_at =
            |bandwidth: Option<f64>| Self { bandwidth, ..self }.distance(model, (measured, values));
        let mut bandwidth = self.bandwidth;
        if bandwidth.is_some() {
            let run = measured.runs().into_iter().find(|run| run.len() > 1)?;
            let times = measured.times().get(run)?;
            let step = (times.last()? - times.first()?) / (times.len() - 1) as f64;
            let at = &mut |hertz| distance_at(Some(hertz));
            bandwidth = Some(closed_loop::nearest_bandwidth(step, at)?);
        }
        Some((Self { bandwidth, ..self }, distance_at(bandwidth)?))
    }

    /// How far the motion is from the measured one; `None` where it cannot be simulated.
    fn distance<M: BaseModel<f64> + ?Sized>(
        &self,
        model: &M,
        (measured, values): (&MotionSeries, &Vec<f64>),
    ) -> Option<f64> {
        let motion = self.motion(model, measured, values).ok()?;
        Some(distance(&motion, measured, model.info().dof()))
    }

    /// The motion of the robot with these base parameters at the times of a measured one.
    fn motion<M: BaseModel<f64> + ?Sized>(
        &self,
        model: &M,
        measured: &MotionSeries,
        values: &[f64],
    ) -> Result<MotionSeries, InstrumentError> {
        let mut phi = vec![0.0; model.info().parameters.len()];
        let free = vec![0.0; model.base_info().free.len()];
        model.parameters_from_base(values, &free, &mut phi)?;
        let run = ClosedLoop {
            reference: self.reference,
            lead: self.lead,
            controllers: Controllers::Tuned {
                bandwidth: self.bandwidth.unwrap_or(BANDWIDTH_HZ),
                given: self.given,
            },
        };
        Ok(closed_loop::motion(model, &run, &phi, measured)?)
    }
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
    /// The gains and payloads cannot be identified.
    Gains(GainError),
    /// The estimate and the model differ in size.
    Size(SizeError),
}

impl fmt::Display for InstrumentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Data(why) => why.fmt(f),
            Self::Unsmoothed(why) => write!(f, "the measured motion cannot be smoothed: {why}"),
            Self::Loop(why) => why.fmt(f),
            Self::Gains(why) => why.fmt(f),
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
            Self::Gains(why) => Some(why),
            Self::Size(why) => Some(why),
        }
    }
}

impl From<DataError> for InstrumentError {
    fn from(why: DataError) -> Self {
        Self::Data(why)
    }
}

impl From<GainError> for InstrumentError {
    fn from(why: GainError) -> Self {
        match why {
            GainError::Data(why) => Self::Data(why),
            why => Self::Gains(why),
        }
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
    fn a_robot_that_cannot_be_simulated_moves_with_physical_parameters() {
        let drives = |values: &[Vec<f64>]| {
            let mass = values[0][0];
            if mass > 0.0 { Ok(mass) } else { Err(mass) }
        };
        let asked = core::cell::Cell::new(0);
        let robot = Simulable::new(|| {
            asked.set(asked.get() + 1);
            Some(vec![vec![2.0]])
        });
        assert_eq!(robot.try_with(&[vec![1.0]], drives), Ok(1.0));
        assert_eq!(asked.get(), 0);
        assert_eq!(robot.try_with(&[vec![-1.0]], drives), Ok(2.0));
        assert_eq!(robot.try_with(&[vec![-3.0]], drives), Ok(2.0));
        assert_eq!(asked.get(), 1);
        // the reason is that of the estimate
        let none = Simulable::new(|| None);
        assert_eq!(none.try_with(&[vec![-1.0]], drives), Err(-1.0));
        let worse = Simulable::new(|| Some(vec![vec![-9.0]]));
        assert_eq!(worse.try_with(&[vec![-1.0]], drives), Err(-1.0));
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
