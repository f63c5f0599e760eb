//! Unknown gains and payloads from logs, and predictions of runs with payloads.

use regen_runtime::{BaseModel, LoopClosure};

use super::physical::layout_and_base_map;
use super::{PriorKnowledge, Session, SessionError};
use crate::data::{FileReport, Run};
use crate::estimate::Residuals;
use crate::gains::{
    self, CarriedRun, GainError, GainFit, GainOptions, Physical, PhysicalGains, Plan,
};
use crate::identify::{self, EquationKind, LeftOut};
use crate::model::IdentifiedModel;

/// Fits of unknown gains and payloads.
pub struct LoadedFits {
    /// The fit without constraints.
    pub free: GainFit,
    /// The fit under physical constraints, if it was requested.
    pub physical: Option<PhysicalGains>,
    /// The summaries of the logs.
    pub reports: Vec<FileReport>,
}

/// Fits parameters, unknown gains and payloads to runs.
///
/// - `runs`: each with the index of the payload that it carries, see [`Plan::payloads`];
/// - `knowledge`: if a fit under physical constraints is wanted too, the prior knowledge for it,
///   and the number of draws for its intervals.
///
/// # Errors
/// [`SessionError::Gains`], see [`gains::fit`] and [`gains::feasible`]; when a log cannot be read.
pub fn with_gains<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    plan: &Plan,
    runs: &[(Run, Option<usize>)],
    knowledge: Option<(&PriorKnowledge, usize)>,
) -> Result<LoadedFits, SessionError> {
    if session.kind != EquationKind::Forces {
        return Err(GainError::EnergyBalance.into());
    }
    let measured = session.in_amperes();
    let mut logs = Vec::with_capacity(runs.len());
    for (run, _) in runs {
        logs.push(measured.open(std::slice::from_ref(run))?);
    }
    let mut sources: Vec<CarriedRun<'_, _>> = logs
        .iter_mut()
        .zip(runs)
        .map(|(source, (_, carried))| CarriedRun {
            source,
            carried: *carried,
        })
        .collect();
    let options = gain_options(session);
    let model = session.model;
    let (free, physical) = match knowledge {
        None => (gains::fit(model, &options, plan, &mut sources)?, None),
        Some((knowledge, draws)) => {
            session.watch.phase("solving for physical parameters");
            let (layout, combinations) = layout_and_base_map(model)?;
            let physical = Physical {
                layout: &layout,
                combinations: &combinations,
                options: &knowledge.options(&model.info(), &layout)?,
                length: LoopClosure::new(model)?.length_unit(),
                draws,
                progress: &|done| {
                    let text = format!("intervals: {done} of {draws} fits");
                    session.watch.phase(&text);
                },
            };
            let both = gains::feasible(model, &options, plan, &mut sources, &physical);
            session.watch.finished();
            let (free, constrained) = both?;
            (free, Some(constrained))
        }
    };
    let reports = logs.iter().flat_map(|own| own.logs().reports().to_vec());
    Ok(LoadedFits {
        free,
        physical,
        reports: reports.collect(),
    })
}

/// The options of a session for gains and payloads.
pub fn gain_options<M: ?Sized>(session: &Session<'_, M>) -> GainOptions {
    GainOptions {
        weighting: session.options.weighting,
        huber: session.options.huber,
        lags: session.options.lags,
        confidence: session.confidence,
    }
}

/// The residuals of a model on one run, efforts in N m or N: currents of unknown gain have the
/// gains of the model.
///
/// - `bodies`: the labels of all payloads of the robot; `carried`: the one that is carried.
///
/// # Errors
/// When a log cannot be read or predicted.
pub fn loaded_residuals<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    run: &Run,
    identified: &IdentifiedModel,
    bodies: &[String],
    carried: Option<&str>,
) -> Result<(Residuals, LeftOut, Vec<FileReport>), SessionError> {
    let gains = identified.gains.iter();
    let gains: Vec<(String, f64)> = gains.map(|g| (g.effort.clone(), g.value)).collect();
    let scaled = Session {
        reading: session.reading.clone().with_gains(&gains),
        ..*session
    };
    let model = session.model;
    let mut log = scaled.open(std::slice::from_ref(run))?;
    let (set, left_out) = identify::observe(model, session.kind, &mut log)?;
    let own = identified.carrying(model, bodies, carried);
    let lags = identify::Options::default().lags;
    let residuals = own.residuals(model, session.kind, &mut log, &set.means(), lags)?;
    Ok((residuals, left_out, log.logs().reports().to_vec()))
}
