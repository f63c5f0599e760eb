//! The payloads of runs, from the experiment file or the options, for commands that predict runs.

use std::path::Path;

use regen_codegen::diag::Source;
use regen_codegen::robot::Robot;
use regen_identify::data::Run;
use regen_identify::identify::digest;
use regen_identify::model::IdentifiedModel;
use regen_identify::session::{MonitoredLogs, Session};
use regen_interpreted::{BaseTerms, Interpreted};
use serde_json::Value;

use crate::args::{PayloadArg, ReadingArgs};
use crate::exit::Failure;
use crate::{load, observe, parameters, terminal};

/// The labels of a robot's payloads.
pub(crate) fn bodies(robot: &Robot) -> Vec<String> {
    let labels = robot.payloads.iter().filter_map(|k| robot.bodies.get(*k));
    labels.cloned().collect()
}

/// The payload of a run in the experiment file.
pub(crate) fn of_run(reading: &ReadingArgs, run: &Run) -> Option<usize> {
    let experiment = reading.experiment.as_ref()?;
    let planned = experiment.carried.iter().find(|(own, _)| own == run);
    planned.and_then(|(_, carried)| *carried)
}

/// The gains of a model, by coordinate.
pub(crate) fn gains(found: &IdentifiedModel) -> Vec<(String, f64)> {
    let gains = found.gains.iter();
    gains.map(|g| (g.effort.clone(), g.value)).collect()
}

/// Opens a run whose currents of unknown gain have the gains of a model.
pub(crate) fn open<'m>(
    model: &'m Interpreted<'m>,
    run: &Run,
    reading: &ReadingArgs,
    found: &IdentifiedModel,
) -> Result<MonitoredLogs<'m, Interpreted<'m>>, Failure> {
    observe::require_consistent(reading)?;
    Ok(scaled(model, reading, found).open(std::slice::from_ref(run))?)
}

/// A session that reads currents of unknown gain with the gains of a model.
pub(crate) fn scaled<'m>(
    model: &'m Interpreted<'m>,
    reading: &ReadingArgs,
    found: &IdentifiedModel,
) -> Session<'m, Interpreted<'m>> {
    let mut session = observe::session(model, reading);
    session.reading = session.reading.with_gains(&gains(found));
    session
}

/// Derives the robot that the parameters of a file belong to; with separate payloads if the file has
/// any.
pub(crate) fn derived_for(
    source: &Source,
    reading: &ReadingArgs,
    params: &Path,
) -> Result<Robot, Failure> {
    let value = parameters::value(params)?;
    let payloads = value.get("payloads").and_then(|list| list.as_array());
    if payloads.is_some_and(|list| !list.is_empty()) {
        return load::derived(source);
    }
    let carries = |experiment: &crate::experiment::Experiment| {
        experiment.carried.iter().any(|(_, own)| own.is_some())
    };
    if reading.experiment.as_deref().is_some_and(carries) {
        return Err(Failure::Input(format!(
            "{}: it has no payload, but runs of the experiment file carry one: identify from runs \
             with it",
            params.display()
        )));
    }
    let robot = load::loaded_derived(source, reading.payload)?;
    let missing = missing(&robot, &value);
    if missing.is_empty() {
        return Ok(robot);
    }
    // `identify` leaves out what acts in no equation of its logs
    terminal::note(&format!(
        "note: {} lacks {}, which the prediction leaves out",
        params.display(),
        missing.join(", ")
    ));
    load::loaded_without(source, reading.payload, &missing)
}

/// The base parameters that a file of parameters lacks because they were left out; none where it has others than
/// the robot.
fn missing(robot: &Robot, file: &Value) -> Vec<String> {
    let rows = file.get("parameters").and_then(Value::as_array);
    let rows = rows.into_iter().flatten();
    let known: Vec<&str> = rows.filter_map(|row| row.get("label")?.as_str()).collect();
    let terms = BaseTerms::new(robot);
    let model = Interpreted::with_terms(robot, &terms);
    let base: Vec<&str> = model.base_info().base.iter().map(|own| own.label).collect();
    let is_whole = file.get("model").and_then(Value::as_str) == Some(digest(&model).as_str());
    if is_whole || known.is_empty() || known.iter().any(|label| !base.contains(label)) {
        return Vec::new();
    }
    let missing = base.into_iter().filter(|label| !known.contains(label));
    missing.map(str::to_owned).collect()
}

/// Refuses parameters that lack a gain which the logs need.
pub(crate) fn require_gains(
    reading: &ReadingArgs,
    found: &IdentifiedModel,
    params: &Path,
) -> Result<(), Failure> {
    let unknown = reading.experiment.iter().flat_map(|e| &e.unknown_gains);
    let mut lacking = unknown.filter(|name| !found.gains.iter().any(|g| g.effort == **name));
    match lacking.next() {
        None => Ok(()),
        Some(name) => Err(Failure::Input(format!(
            "{}: it has no gain of {name}, which is unknown in the experiment file: identify it, or \
             state the torque constant in place of `unknown`",
            params.display()
        ))),
    }
}

/// The model of a run: that of the robot with the payload that the run carries.
pub(crate) fn model_of(
    robot: &Robot,
    model: &Interpreted<'_>,
    reading: &ReadingArgs,
    run: &Run,
    found: &IdentifiedModel,
) -> Result<IdentifiedModel, Failure> {
    let bodies = bodies(robot);
    if bodies.is_empty() {
        return Ok(found.clone());
    }
    let planned = reading.experiment.iter().flat_map(|e| &e.carried);
    let is_planned = planned.into_iter().any(|(own, _)| own == run);
    let carried = match (is_planned, reading.payload, &found.payloads[..]) {
        (true, ..) => of_run(reading, run).and_then(|k| bodies.get(k)),
        (false, Some(PayloadArg::None), _) => None,
        (false, Some(PayloadArg::Carried | PayloadArg::Unknown), [one]) => Some(&one.body),
        _ => {
            return Err(Failure::Input(format!(
                "{run}: the parameters are those of the robot with and without {}: state what is \
                 carried, with --payload none or --payload carried, or in an experiment file",
                bodies.join(", ")
            )));
        }
    };
    Ok(found.carrying(model, &bodies, carried.map(String::as_str)))
}

/// The model of each run, with its payload; empty without payloads.
pub(crate) fn by_run(
    robot: &Robot,
    model: &Interpreted<'_>,
    reading: &ReadingArgs,
    runs: &[Run],
    found: &IdentifiedModel,
) -> Result<Vec<(Run, IdentifiedModel)>, Failure> {
    if found.payloads.is_empty() {
        return Ok(Vec::new());
    }
    let mut out = Vec::with_capacity(runs.len());
    for run in runs {
        out.push((run.clone(), model_of(robot, model, reading, run, found)?));
    }
    Ok(out)
}
