//! Unknown gains and payloads by instrumental variables.
//!
//! The equations `i = g W x` are not linear in gains and parameters together. They are linearised at
//! the present estimate, and the instruments are the same derivatives at another motion: that of a
//! simulation of each run with its payload, or the measured one after smoothing. Each round is
//! then one of [`identify::instrumental`](crate::identify::instrumental).

use std::rc::Rc;

use super::linear::Linear;
use super::optimum::Optimum;
use super::planned::Planned;
use super::rank::require_rank;
use super::rows::{Rows, Sample, add_product};
use super::statistics::Solved;
use super::unknowns::Unknowns;
use super::{CarriedRun, GainError, GainFit, GainOptions, Plan, origin};
use crate::data::DataError;
use crate::estimate::{EstimateError, FilteredNoise, Origin};
use crate::identify::{
    ChangedParameters, Equations, HeldEfforts, InstrumentOptions, Instrumental,
    InstrumentedEquations, instrumental_of,
};
use crate::states::{MotionSeries, Source};
use regen_runtime::BaseModel;

/// Callback that returns the motions of the instruments, one for each run, for the base parameters of
/// each run (those of payloads that it does not carry are 0); `None` if they are the same as in
/// the last call.
pub type LoadedMotions<'a> =
    dyn FnMut(&[Vec<f64>]) -> Result<Option<Vec<MotionSeries>>, GainError> + 'a;

/// The result of instrumental variables with gains and payloads.
#[derive(Clone, Debug)]
pub struct LoadedInstruments {
    /// The base parameters, gains and payloads with their standard deviations, which mean nothing
    /// unless [`Instrumental::converged`] is set.
    pub fit: GainFit,
    /// The unknowns of the linearised equations, their rounds, and their difference from least squares
    /// of the same equations; errors are in SI.
    pub instrumental: Instrumental,
}

/// Fits base parameters, unknown gains and payloads to all runs by instrumental variables.
///
/// - `confidence`: the level of the intervals, in (0, 1);
/// - `stages`: the instruments; those of each stage begin with the estimate of the one before, the
///   first with least squares. The estimate of the last stage is returned.
///
/// # Errors
/// As [`fit`](super::fit); when there are not as many motions as runs; [`GainError::NotConverged`] if least
/// squares have no solution to begin with; the errors of `stages`.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// # use models::Pendulum;
/// use regen_identify::gains::{CarriedRun, GainError, KnownRobot, Plan, instrumental};
/// use regen_identify::identify::{InstrumentOptions};
/// use regen_identify::states::{MotionSeries, Recorded};
///
/// // a pendulum of 0.5 kg m^2 and 2 kg m whose motor gives 4 N m/A, with noise in its acceleration
/// let (mut log, mut motion) = (Recorded::new(), MotionSeries::new(1));
/// for k in 0..2000 {
///     let t = 0.01 * f64::from(k);
///     let (q, qd, qdd) = (t.sin(), t.cos(), -t.sin());
///     let current = (0.5 * qdd + 2.0 * 9.81 * q.sin()) / 4.0;
///     let noise = 0.5 * (7.1 * f64::from(k * k % 101)).sin();
///     log.push(t, &[q], &[qd], &[qdd + noise], &[current]);
///     motion.push(t, [&[q], &[qd], &[qdd]], k > 0).map_err(GainError::from)?;
/// }
/// let plan = Plan {
///     unknown_gains: vec!["q1".to_owned()],
///     robot: Some(KnownRobot { beta: vec![0.5, 2.0], ..KnownRobot::default() }),
///     ..Plan::default()
/// };
/// let mut runs = [CarriedRun { source: &mut log, carried: None }];
/// let mut exact = Some(vec![motion]);
/// let found = instrumental(
///     &Pendulum,
///     (&InstrumentOptions::default(), 0.95),
///     &plan,
///     &mut runs,
///     &mut [&mut |_| Ok(exact.take())],
/// )?;
/// assert!((found.fit.model.gains[0].value - 4.0).abs() < 0.01);
/// assert!(found.instrumental.converged);
/// # Ok::<(), GainError>(())
/// ```
pub fn instrumental<M, S>(
    model: &M,
    (options, confidence): (&InstrumentOptions, f64),
    plan: &Plan,
    runs: &mut [CarriedRun<'_, S>],
    stages: &mut [&mut LoadedMotions<'_>],
) -> Result<LoadedInstruments, GainError>
where
    M: BaseModel<f64> + ?Sized,
    S: Source + ?Sized,
    S::Error: Into<DataError>,
{
    let carried: Vec<Option<usize>> = runs.iter().map(|run| run.carried).collect();
    let planned = Planned::new(model, plan, &carried)?;
    let mut rows = Rows::new(model, runs, &planned.blocks)?;
    let origin = origin(model, &rows.efforts);
    let own = GainOptions {
        weighting: options.weighting,
        huber: None,
        lags: options.lags,
        confidence,
    };
    let least = Optimum::new(&mut rows, &origin, &planned, &own, None)?;
    let unknowns = &planned.unknowns;
    let problem = least.problem(unknowns);
    let linear = Linear::new(unknowns, least.point());
    let labels = linear.labels(&origin.labels, &rows.efforts);
    let weighted = (problem.set, least.weights());
    require_rank(&linear, &linear.factor(weighted, &linear.columns, &labels)?)?;
    if !least.converged {
        return Err(GainError::NotConverged);
    }
    let mut equations = LinearisedEquations {
        unknowns,
        origin: Origin {
            labels,
            efforts: rows.efforts.clone(),
            ..origin
        },
        linear,
        rows,
        motions: &mut |_| Ok(None),
        last: Vec::new(),
        is_first: true,
    };
    let mut found: Option<Instrumental> = None;
    for stage in stages.iter_mut() {
        (equations.motions, equations.is_first) = (stage, true);
        let start = equations.linear.values();
        let weights = match &found {
            None => least.weights().to_vec(),
            Some(found) => weights_of(found),
        };
        found = Some(instrumental_of(
            &mut equations,
            options,
            &start,
            Some(weights),
        )?);
    }
    let mut found = found.ok_or(GainError::NotConverged)?;
    let LinearisedEquations {
        linear, mut rows, ..
    } = equations;
    let point = linear.point_at(&found.estimate.values);
    let weights = weights_of(&found);
    let solved = Solved {
        point: &point,
        weights: &weights,
        converged: found.converged,
        name: "instrumental variables",
        ..least.solved(&planned, plan, &own)
    };
    let mut fit = solved.finish_instrumental(&mut rows, &mut found)?;
    fit.model.left_out.clone_from(&planned.idle);
    Ok(LoadedInstruments {
        fit,
        instrumental: found,
    })
}

/// The weights of the efforts.
fn weights_of(found: &Instrumental) -> Vec<f64> {
    found
        .estimate
        .efforts
        .iter()
        .map(|own| own.weight)
        .collect()
}

/// The equations of all runs, linearised at a point, with the instruments' derivatives at the same point.
struct LinearisedEquations<'a, 'r, 's, M: ?Sized, S: ?Sized> {
    unknowns: &'a Unknowns,
    /// The labels of the columns.
    origin: Origin,
    linear: Linear<'a>,
    rows: Rows<'r, M, S>,
    motions: &'s mut LoadedMotions<'s>,
    /// The present motions of the instruments.
    last: Vec<Rc<MotionSeries>>,
    /// Whether no round of the stage has been solved. The first round has measured currents in the
    /// columns of the gains: `k i = W x` is linear, so that a start far from the solution does no harm.
    /// Later rounds have predicted currents there, which have no noise.
    is_first: bool,
}

impl<M, S> InstrumentedEquations for LinearisedEquations<'_, '_, '_, M, S>
where
    M: BaseModel<f64> + ?Sized,
    S: Source + ?Sized,
    S::Error: Into<DataError>,
{
    type Error = GainError;

    fn origin(&self) -> Origin {
        self.origin.clone()
    }

    fn renew(&mut self, values: &[f64]) -> Result<bool, GainError> {
        let x = self.unknowns.base(&self.linear.point_at(values));
        let Some(motions) = (self.motions)(&self.rows.base_of_runs(&x))? else {
            self.rows.require_instruments()?;
            return Ok(false);
        };
        self.last = motions.into_iter().map(Rc::new).collect();
        self.rows.set_instruments(&self.last)?;
        Ok(true)
    }

    fn linearise(&mut self, values: &[f64]) -> bool {
        self.linear = self.linear.moved(values);
        self.is_first = false;
        true
    }

    fn filtered_noise(&self) -> FilteredNoise {
        self.rows.filtered_noise()
    }

    fn changed(
        &mut self,
        values: &[f64],
        weights: &[f64],
        out: &mut ChangedParameters,
    ) -> Result<(), GainError> {
        let linear = self.linear.moved(values);
        linear.changed(&mut self.rows, Some(&self.last), weights, out)
    }

    fn held(&mut self, weights: &[f64], out: &mut HeldEfforts) -> Result<(), GainError> {
        self.linear.held(&mut self.rows, true, weights, out)
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&Equations<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), GainError> {
        let (mut w, mut z) = (Vec::new(), Vec::new());
        let (mut fitted, mut sides) = (Vec::new(), Vec::new());
        let values = self.linear.values();
        let (linear, is_first) = (&self.linear, self.is_first);
        self.rows.visit(&mut |sample| {
            linear.rows(
                &Sample {
                    w: sample.z,
                    ..*sample
                },
                &mut z,
                &mut fitted,
            );
            linear.rows(sample, &mut w, &mut fitted);
            if is_first {
                linear.set_gains(sample.measured, &mut w);
            }
            sides.clear();
            sides.extend(sample.measured.iter().zip(&fitted).map(|(i, f)| i - f));
            add_product(&mut sides, &w, &values);
            w.extend_from_slice(&z);
            each(&Equations {
                time: sample.time,
                w: &w,
                tau: &sides,
                weights: sample.weights,
                follows: sample.follows,
                held: sample.held,
            })
        })
    }
}
