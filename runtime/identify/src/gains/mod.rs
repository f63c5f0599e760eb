//! Unknown gains of drives and payloads: one fit over runs with and without payloads.
//!
//! If efforts are measured as currents i = tau / k with unknown gains k (torque constants with their
//! gears), least squares with i on the left side fits parameters and gains together, in the unit of
//! the noise (Gautier and Briot, 2014). Runs in which the robot carries a payload have further base
//! parameters, those of the payload alone; its known parameters keep their values. Only something
//! known (a gain, or a payload's mass) determines the scale of gains and parameters: the rank of the
//! equations at the solution shows whether it is determined.
//!
//! M. Gautier, S. Briot, "Global Identification of Joint Drive Gains and Dynamic Parameters of
//! Robots", ASME Journal of Dynamic Systems, Measurement, and Control 136(5), 2014.

mod error;
mod feasible;
mod feasible_model;
mod instruments;
mod linear;
mod loops;
mod optimum;
mod payload;
mod planned;
mod problem;
mod rank;
mod result;
mod robot;
mod robust;
mod rows;
mod statistics;
mod unknowns;

pub use error::{Free, GainError};
pub use feasible::{Physical, PhysicalGains};
pub use instruments::{LoadedInstruments, LoadedMotions, instrumental};
pub use loops::{LoadedLoops, LoadedRound};
pub use payload::KnownPayload;

use crate::data::DataError;
use crate::estimate::{Deviations, EffortError, EffortFit, Estimate, Origin, Weighting};
use crate::identify::{EquationBuilder, EquationKind, LeftOut};
use crate::model::{Covariance, IdentifiedModel};
use crate::states::Source;
use crate::status::EffortContributions;
use optimum::Optimum;
use planned::Planned;
use regen_runtime::BaseModel;
use rows::Rows;

/// A run, and the payload that the robot carries in it.
#[derive(Debug)]
pub struct CarriedRun<'a, S: ?Sized> {
    /// The rows of the run. Efforts of unknown gain are currents, A.
    pub source: &'a mut S,
    /// The payload, as an index into [`Plan::payloads`].
    pub carried: Option<usize>,
}

/// A robot that was identified before.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KnownRobot {
    /// All base parameters, SI; those of payloads are ignored.
    pub beta: Vec<f64>,
    /// The identified gains, N m/A or N/A, by coordinate.
    pub gains: Vec<(String, f64)>,
    /// Their covariance, if it is known; otherwise they count as exact.
    pub covariance: Option<Covariance>,
}

/// The known and unknown quantities of a fit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// The coordinates whose efforts are currents of unknown gain.
    pub unknown_gains: Vec<String>,
    /// All payloads of the model, with their known parameters. The base parameters of a payload that
    /// no run carries are not identified.
    pub payloads: Vec<KnownPayload>,
    /// The robot, if it is known: then only payloads, and gains that it lacks, are identified.
    pub robot: Option<KnownRobot>,
}

/// The options of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainOptions {
    /// How efforts are weighted against each other, each in the unit in which it is measured.
    pub weighting: Weighting,
    /// Huber's bound in standard deviations of each effort's noise, see
    /// [`Options::huber`](crate::identify::Options::huber). `None`: plain least squares.
    pub huber: Option<f64>,
    /// The number of autocorrelations of the residuals to compute.
    pub lags: usize,
    /// The level of the confidence intervals, in (0, 1).
    pub confidence: f64,
}

impl Default for GainOptions {
    fn default() -> Self {
        Self {
            weighting: Weighting::PerEffort,
            huber: None,
            lags: 20,
            confidence: 0.95,
        }
    }
}

/// The result of a fit.
#[derive(Clone, Debug)]
pub struct GainFit {
    /// The base parameters, gains and payloads with their standard deviations, and the covariance of
    /// the first two, which is missing if the robot was known.
    pub model: IdentifiedModel,
    /// The unknowns of the fit as least squares of the linearised equations: parameters of the
    /// robot, unknown parameters of the payloads, gains. Its `efforts` are in SI.
    pub estimate: Estimate,
    /// The deviations of these unknowns, for residuals correlated in time.
    pub deviations: Deviations,
    /// The contributions of the base parameters to the efforts.
    pub shares: EffortContributions,
    /// The errors of each effort in N m or N.
    pub errors: Vec<EffortError>,
    /// eps_RA over all efforts, percent (Eq. 33).
    pub relative_absolute: f64,
    /// The number of samples that count as correlated.
    pub correlation_length: usize,
    /// The equations that were left out, by reason.
    pub left_out: LeftOut,
    /// Whether the parameters of a known robot counted as exact, because their covariance is unknown.
    pub is_robot_exact: bool,
}

/// Fits base parameters, unknown gains and payloads to all runs.
///
/// # Errors
/// [`GainError::Undetermined`] if the runs leave unknowns undetermined, such as the scale without a
/// known gain or a payload of known mass; [`GainError::Drives`], [`GainError::NoEffort`],
/// [`GainError::NoGain`] and [`GainError::NoPayload`] for a plan that does not fit the model;
/// [`GainError::NoCurrent`]; errors of reading the runs.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// # use models::Pendulum;
/// use regen_identify::gains::{CarriedRun, GainError, GainOptions, KnownRobot, Plan, fit};
/// use regen_identify::states::Recorded;
///
/// // a pendulum of 0.5 kg m^2 and 2 kg m whose motor gives 4 N m/A
/// let mut log = Recorded::new();
/// for k in 0..400 {
///     let t = 0.05 * f64::from(k);
///     let (q, qd, qdd) = (t.sin(), t.cos(), -t.sin());
///     let noise = 1e-4 * (7.1 * f64::from(k * k % 101)).sin();
///     let current = (0.5 * qdd + 2.0 * 9.81 * q.sin()) / 4.0 + noise;
///     log.push(t, &[q], &[qd], &[qdd], &[current]);
/// }
/// let mut plan = Plan { unknown_gains: vec!["q1".to_owned()], ..Plan::default() };
/// let options = GainOptions::default();
/// let mut runs = [CarriedRun { source: &mut log, carried: None }];
/// // a current alone cannot distinguish a heavy pendulum with a strong motor from a light one
/// let refused = fit(&Pendulum, &options, &plan, &mut runs).unwrap_err();
/// assert!(matches!(refused, GainError::Undetermined { rank: 2, unknowns: 3, .. }));
///
/// plan.robot = Some(KnownRobot { beta: vec![0.5, 2.0], ..KnownRobot::default() });
/// let found = fit(&Pendulum, &options, &plan, &mut runs)?;
/// assert!((found.model.gains[0].value - 4.0).abs() < 1e-3);
/// # Ok::<(), GainError>(())
/// ```
pub fn fit<M, S>(
    model: &M,
    options: &GainOptions,
    plan: &Plan,
    runs: &mut [CarriedRun<'_, S>],
) -> Result<GainFit, GainError>
where
    M: BaseModel<f64> + ?Sized,
    S: Source + ?Sized,
    S::Error: Into<DataError>,
{
    Ok(fit_both(model, options, plan, runs, None)?.0)
}

/// Fits base parameters, unknown gains and payloads to all runs, without and with physical
/// constraints.
///
/// The problem in parameters and gains together is not convex: the second fit is the optimum of the
/// equations linearised at itself, to which [`IdentifiedModel::gap`] refers. The search starts from
/// the gains of the first fit.
///
/// Intervals are computed from draws of the first fit that are projected onto the physical
/// parameters, in the linearised equations.
///
/// # Errors
/// As [`fit`]; [`GainError::InertiaAlone`] if a payload's inertia is given without its mass and its
/// centre of mass; [`GainError::Feasibility`] for constraints that contradict each other or name
/// unknown parameters; [`GainError::NotConverged`].
pub fn feasible<M, S>(
    model: &M,
    options: &GainOptions,
    plan: &Plan,
    runs: &mut [CarriedRun<'_, S>],
    physical: &Physical<'_>,
) -> Result<(GainFit, PhysicalGains), GainError>
where
    M: BaseModel<f64> + ?Sized,
    S: Source + ?Sized,
    S::Error: Into<DataError>,
{
    let (found, constrained) = fit_both(model, options, plan, runs, Some(physical))?;
    Ok((found, constrained.ok_or(GainError::NotConverged)?))
}

fn fit_both<M, S>(
    model: &M,
    options: &GainOptions,
    plan: &Plan,
    runs: &mut [CarriedRun<'_, S>],
    physical: Option<&Physical<'_>>,
) -> Result<(GainFit, Option<PhysicalGains>), GainError>
where
    M: BaseModel<f64> + ?Sized,
    S: Source + ?Sized,
    S::Error: Into<DataError>,
{
    let carried: Vec<Option<usize>> = runs.iter().map(|run| run.carried).collect();
    let planned = Planned::new(model, plan, &carried)?;
    let mut rows = Rows::new(model, runs, &planned.blocks)?;
    let origin = origin(model, &rows.efforts);
    let found = Optimum::new(&mut rows, &origin, &planned, options, None)?;
    let solved = found.solved(&planned, plan, options);
    let mut fit = solved.finish(&mut rows)?;
    fit.model.left_out.clone_from(&planned.idle);
    let constrained = match physical {
        Some(physical) => Some(solved.constrained(&mut rows, &fit, physical)?),
        None => None,
    };
    Ok((fit, constrained))
}

/// The labels of all base parameters, and the names of the measured efforts.
fn origin<M: BaseModel<f64> + ?Sized>(model: &M, efforts: &[String]) -> Origin {
    let origin = EquationBuilder::new(model, EquationKind::Forces).origin();
    Origin {
        efforts: efforts.to_vec(),
        ..origin
    }
}

/// The fit of an effort in SI.
fn in_si(name: &str, rows: usize, sigma: f64, gain: f64) -> EffortFit {
    let sigma = sigma * gain.abs();
    EffortFit {
        name: name.to_owned(),
        rows,
        sigma,
        weight: 1.0 / sigma,
    }
}
