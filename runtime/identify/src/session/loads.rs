//! Unknown gains and payloads from logs, and predictions of runs with payloads.

use regen_runtime::{BaseModel, LoopClosure};

use super::motion_noise::{NoisyLogs, bias_of_fit, is_undetermined};
use super::physical::layout_and_base_map;
use super::start::MOTION_NOISE;
use super::{MonitoredLogs, PriorKnowledge, Session, SessionError};
use crate::data::{FileReport, Run};
use crate::estimate::Residuals;
use crate::gains::{
    self, CarriedRun, GainError, GainFit, GainOptions, Physical, PhysicalGains, Plan,
};
use crate::identify::{self, EquationKind, LeftOut};
use crate::model::{Covariance, IdentifiedModel, Interval};

/// A bias is mentioned where it is larger than this part of a standard deviation.
const MENTIONED_PART: f64 = 0.5;

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
    let mut free = free;
    session.watch.phase("adding noise to the motion");
    let biased = add_motion_noise((model, &options, plan), runs, &logs, &mut free.model);
    session.watch.finished();
    biased?;
    let reports = logs.iter().flat_map(|own| own.logs().reports().to_vec());
    Ok(LoadedFits {
        free,
        physical,
        reports: reports.collect(),
    })
}

/// Adds what noise of the measured motion biases to the intervals and the covariance of a fit of gains and
/// payloads.
fn add_motion_noise<'m, M: BaseModel<f64> + ?Sized>(
    (model, options, plan): (&'m M, &GainOptions, &Plan),
    runs: &[(Run, Option<usize>)],
    logs: &[MonitoredLogs<'m, M>],
    found: &mut IdentifiedModel,
) -> Result<(), SessionError> {
    let fit = |noisy: &mut [NoisyLogs<'m, M>]| {
        let pairs = noisy.iter_mut().zip(runs);
        let carried = pairs.map(|(source, (_, carried))| CarriedRun {
            source,
            carried: *carried,
        });
        let mut carried: Vec<CarriedRun<'_, _>> = carried.collect();
        let found = gains::fit(model, options, plan, &mut carried)?.model;
        let gains = found.gains.iter().map(|own| own.value);
        let payloads = found.payloads.iter().flat_map(|own| &own.values);
        let more = gains.chain(payloads.map(|own| own.value));
        Ok(found.beta.iter().copied().chain(more).collect())
    };
    let logs: Vec<_> = logs.iter().map(MonitoredLogs::logs).collect();
    let bias = bias_of_fit(&logs, fit);
    let mut bias: Vec<f64> = match bias {
        Ok(Some(bias)) => bias,
        // the rows that noise is added to, which are fewer, may not determine all
        Ok(None) | Err(SessionError::Gains(_)) => return Ok(()),
        Err(SessionError::Data(error)) if is_undetermined(&error) => return Ok(()),
        Err(error) => return Err(error),
    };
    let mut rest = bias.split_off(found.beta.len().min(bias.len())).into_iter();
    let (base, gains) = (found.beta.len(), found.gains.len());
    let of_gains: Vec<f64> = rest.by_ref().take(gains).collect();
    let widened = |interval: &mut Option<Interval>, bias: f64| {
        *interval = interval.map(|own| own.with_bias(bias));
    };
    for (gain, bias) in found.gains.iter_mut().zip(&of_gains) {
        widened(&mut gain.interval, *bias);
    }
    let values = found.payloads.iter_mut().flat_map(|own| &mut own.values);
    for (value, bias) in values.zip(rest) {
        widened(&mut value.interval, bias);
    }
    if let Some(covariance) = &mut found.covariance {
        let names = found
            .gains
            .iter()
            .map(|gain| Covariance::gain(&gain.effort));
        let of_names: Vec<(String, f64)> = names.zip(of_gains).collect();
        let labels = covariance.labels.iter().enumerate();
        let all: Vec<f64> = labels
            .map(
                |(k, label)| match of_names.iter().find(|(name, _)| name == label) {
                    Some((_, bias)) => *bias,
                    None if k < base => bias.get(k).copied().unwrap_or(0.0),
                    None => 0.0,
                },
            )
            .collect();
        for (column, b) in covariance
            .values
            .chunks_exact_mut(all.len().max(1))
            .zip(&all)
        {
            for (entry, a) in column.iter_mut().zip(&all) {
                *entry += a * b;
            }
        }
    }
    let grows = found
        .intervals
        .base
        .iter()
        .zip(&bias)
        .any(|(own, bias)| own.is_some_and(|own| bias.abs() > MENTIONED_PART * own.sigma));
    if grows {
        found.intervals.method.push_str(MOTION_NOISE);
    }
    found.intervals.add_bias(bias);
    Ok(())
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
