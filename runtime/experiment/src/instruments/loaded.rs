//! Unknown gains and payloads by instrumental variables.

use std::slice::from_ref;

use regen_identify::data::{FileReport, Logs, Run};
use regen_identify::estimate::EstimateError;
use regen_identify::gains::{self, CarriedRun, GainError, LoadedInstruments, Plan};
use regen_identify::identify::EquationKind;
use regen_identify::session::{PriorKnowledge, Session, with_gains};
use regen_identify::signals::SignalError;
use regen_identify::states::MotionSeries;
use regen_runtime::BaseModel;

use super::{Along, InstrumentError, Simulable, options, raw};
use crate::simulate::Gains;
use crate::trajectory::FourierReference;

/// The result of instrumental variables with gains and payloads.
#[derive(Clone, Debug)]
pub struct LoadedInstrumentalResult {
    /// The estimate, its rounds, and its difference from least squares.
    pub found: LoadedInstruments,
    /// The highest cut-off frequency at which the measured motion of a run was smoothed, Hz; `None`
    /// where the motion was simulated.
    pub cutoff: Option<f64>,
    /// As [`InstrumentalResult::controller_bandwidth`](super::InstrumentalResult::controller_bandwidth).
    pub controller_bandwidth: Option<f64>,
    /// The summaries of the logs.
    pub reports: Vec<FileReport>,
}

/// Identifies base parameters, unknown gains and payloads by instrumental variables.
///
/// - `runs`: each with the index of the payload that it carries, see [`Plan::payloads`];
/// - `reference`: as for [`instrumental`](super::instrumental); each run is simulated with its payload.
///
/// # Errors
/// As [`instrumental`](super::instrumental) and [`gains::instrumental`]: see [`InstrumentError`].
pub fn instrumental_with_gains<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    plan: &Plan,
    runs: &[(Run, Option<usize>)],
    reference: Option<(&FourierReference, &[Gains])>,
) -> Result<LoadedInstrumentalResult, InstrumentError> {
    if session.kind != EquationKind::Forces {
        return Err(GainError::EnergyBalance.into());
    }
    let model = session.model;
    let measured_in = session.in_amperes();
    session.watch.phase("reading the measured motion");
    let motions = runs.iter().map(|(run, _)| {
        let mut logs = Logs::open(model, from_ref(run), &raw(&measured_in))?;
        MotionSeries::recorded(model, &mut logs)
    });
    let motions: Result<Vec<MotionSeries>, _> = motions.collect();
    session.watch.finished();
    let measured = motions?;
    let (mut smooth, mut cutoff) = (Vec::with_capacity(runs.len()), 0.0_f64);
    let longest = measured.iter().map(MotionSeries::len).max();
    for motion in &measured {
        match motion.smoothed(None) {
            Ok((own, hertz)) => {
                smooth.push(own);
                cutoff = cutoff.max(hertz);
            }
            // a run that is too short for the filter gives no equations
            Err(SignalError::TooFew { .. }) if Some(motion.len()) < longest => {
                smooth.push(MotionSeries::new(model.info().dof()));
            }
            Err(why) => return Err(InstrumentError::Unsmoothed(why)),
        }
    }
    let mut smooth = Some(smooth);
    let mut smoothed = |_: &[Vec<f64>]| Ok(smooth.take());
    let robot = Simulable::new(|| {
        let found = with_gains(session, plan, runs, Some((&PriorKnowledge::default(), 0)));
        let found = found.ok()?.physical?.model;
        let bodies: Vec<String> = plan.payloads.iter().map(|own| own.body.clone()).collect();
        let base = |(_, carried): &(Run, Option<usize>)| {
            let body = carried.and_then(|k| bodies.get(k)).map(String::as_str);
            found.carrying(model, &bodies, body).beta
        };
        Some(runs.iter().map(base).collect())
    });
    let (mut failed, mut chosen) = (None, None::<Along<'_>>);
    let mut along = |bases: &[Vec<f64>]| {
        let Some(with) = reference else {
            return Ok(None);
        };
        let along =
            *chosen.get_or_insert_with(|| Along::choose(model, with, &measured, &robot, bases));
        let all = robot.try_with(bases, |bases| {
            let own = measured.iter().zip(bases);
            let all = own.map(|(own, base)| along.motion(model, own, base));
            all.collect::<Result<Vec<MotionSeries>, InstrumentError>>()
        });
        match all {
            Ok(all) => Ok(Some(all)),
            Err(why) => {
                failed = Some(why);
                Err(EstimateError::NoConvergence.into())
            }
        }
    };
    let mut logs = Vec::with_capacity(runs.len());
    for (run, _) in runs {
        logs.push(
            measured_in
                .open(from_ref(run))
                .map_err(InstrumentError::Data)?,
        );
    }
    let sources = logs.iter_mut().zip(runs);
    let mut sources: Vec<CarriedRun<'_, _>> = sources
        .map(|(source, (_, carried))| CarriedRun {
            source,
            carried: *carried,
        })
        .collect();
    let own = (&options(session), session.confidence);
    let found = if reference.is_some() {
        let stages: &mut [&mut gains::LoadedMotions<'_>] = &mut [&mut smoothed, &mut along];
        gains::instrumental(model, own, plan, &mut sources, stages)
    } else {
        gains::instrumental(model, own, plan, &mut sources, &mut [&mut smoothed])
    };
    if let Some(why) = failed {
        return Err(why);
    }
    let reports = logs.iter().flat_map(|own| own.logs().reports().to_vec());
    Ok(LoadedInstrumentalResult {
        found: found?,
        cutoff: reference.is_none().then_some(cutoff),
        controller_bandwidth: chosen.and_then(|along| along.bandwidth),
        reports: reports.collect(),
    })
}
