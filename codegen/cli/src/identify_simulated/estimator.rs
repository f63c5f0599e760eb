//! The estimator of `regen identify`, and the options that do not apply to it.

use regen_identify::data::Run as LogRun;
use regen_identify::session::HUBER_BOUND;

use crate::args::{EstimatorArg, IdentifyArgs, ReadingArgs, unused_keys};
use crate::exit::Failure;
use crate::terminal;

/// The default of the time at the start of each log that DIDIM leaves out, s.
pub(crate) const SETTLE: f64 = 0.5;

/// The options, completed for the estimator that they choose; an error if one of them does not apply
/// to it.
pub(crate) fn with_estimator(args: &IdentifyArgs) -> Result<IdentifyArgs, Failure> {
    let mut args = args.clone();
    let given = args.estimator;
    let simulated = matches!(given, Some(EstimatorArg::Didim | EstimatorArg::Response));
    let own = |wanted: EstimatorArg| given.is_none_or(|e| e == wanted);
    let mut wrong: Vec<&str> = Vec::new();
    let mut refuse = |is: bool, option: &'static str| {
        if is {
            wrong.push(option);
        }
    };
    refuse(args.huber.is_some() && !own(EstimatorArg::Huber), "--huber");
    refuse(args.iv && !own(EstimatorArg::Iv), "--iv");
    if given == Some(EstimatorArg::Iv) || simulated {
        let physical = &args.physical;
        refuse(!args.from.is_empty(), "--from");
        refuse(args.cross, "--cross");
        refuse(args.reading.energy.is_some(), "--energy");
        refuse(physical.wanted(), "--feasible or --friction");
        refuse(physical.reduce, "--reduce");
    }
    if simulated {
        refuse(!args.physical.against.is_empty(), "--against");
    }
    let along = args.iv || matches!(given, Some(EstimatorArg::Iv | EstimatorArg::Didim));
    refuse(args.reference.is_some() && !along, "--reference");
    refuse(!args.pid.is_empty() && !along, "--pid");
    let own = &args.simulated;
    refuse(own.controller.is_some() && !simulated, "--controller");
    refuse(!own.command.is_empty() && !simulated, "--command");
    refuse(own.start.is_some() && !simulated, "--start");
    if let Some(option) = wrong.first() {
        let name = given.map_or("least squares", name);
        return Err(Failure::Usage(format!(
            "{option} does not apply to {name}: leave it out, or choose another --estimator"
        )));
    }
    match given {
        Some(EstimatorArg::Huber) => args.huber = args.huber.or(Some(HUBER_BOUND)),
        Some(EstimatorArg::Iv) => args.iv = true,
        _ => {}
    }
    Ok(args)
}

/// The name of an estimator in messages.
fn name(estimator: EstimatorArg) -> &'static str {
    match estimator {
        EstimatorArg::Ls => "least squares",
        EstimatorArg::Huber => "Huber's estimate",
        EstimatorArg::Iv => "instrumental variables",
        EstimatorArg::Didim => "DIDIM",
        EstimatorArg::Response => "the fit to responses",
    }
}

/// Notes the settings of an experiment file that do not apply to an estimator that simulates, and
/// removes the delays, which it would not correct.
///
/// - `planned`: the runs to validate on.
pub(crate) fn note_unused(estimator: EstimatorArg, reading: &mut ReadingArgs, planned: &[LogRun]) {
    if reading.experiment.is_none() {
        return;
    }
    let mut unused: Vec<&str> = unused_keys(estimator, reading).collect();
    if !planned.is_empty() {
        unused.push("runs to validate on");
    }
    reading.delay.clear();
    if !unused.is_empty() {
        terminal::note(&format!(
            "note: {} does not use these keys of the experiment file: {}",
            name(estimator),
            unused.join(", ")
        ));
    }
}
