//! `regen identify` with unknown gains of drives, and with payloads in some of the runs.

use regen_codegen::diag::Source;
use regen_codegen::robot::Robot;
use regen_identify::data::Run;
use regen_identify::files::{FileError, ParameterFile};
use regen_identify::gains::{GainError, GainFit, KnownPayload, KnownRobot, Plan};
use regen_identify::identify::{Delays, digest};
use regen_identify::model::{IdentifiedModel, Provenance};
use regen_identify::session::{LogError, Session, loaded_residuals, with_gains};
use regen_interpreted::{BaseTerms, Interpreted};

use crate::args::{DelayArg, EstimatorArg, IdentifyArgs, PayloadArg};
use crate::exit::Failure;
use crate::identify::{Outcome, note_short, note_unexplained};
use crate::identify_json::{EffortJson, IdentifyJson, ModelJson, Summary};
use crate::observe::FileJson;
use crate::{load, loads, observe, parameters, physical, predicted, terminal};

/// Whether gains or payloads are to be identified.
pub(crate) fn wanted(args: &IdentifyArgs) -> bool {
    let experiment = args.reading.experiment.as_ref();
    experiment.is_some_and(|e| !e.unknown_gains.is_empty() || e.carries())
        || args.reading.payload == Some(PayloadArg::Unknown)
        || args.before.parameters.is_some()
}

/// Refuses options that the fit does not take.
pub(crate) fn require_options(args: &IdentifyArgs) -> Result<(), Failure> {
    let physical = &args.physical;
    let estimator = !matches!(args.estimator, None | Some(EstimatorArg::Ls));
    let wrong = [
        (!args.from.is_empty(), "--from"),
        (args.huber.is_some(), "--huber"),
        (args.iv, "--iv"),
        (estimator, "--estimator"),
        (args.cross, "--cross"),
        (args.bandwidth.is_some(), "--bandwidth"),
        (args.reading.energy.is_some(), "--energy"),
        (physical.feasible, "--feasible"),
        (physical.friction, "--friction"),
        (physical.reduce, "--reduce"),
        (!physical.against.is_empty(), "--against"),
    ];
    if let Some((_, option)) = wrong.iter().find(|wrong| wrong.0) {
        return Err(Failure::Usage(format!(
            "{option} is not for unknown gains and payloads, which least squares identifies from \
             all runs: leave it out"
        )));
    }
    if args.reading.delay.contains(&DelayArg::Auto) {
        return Err(Failure::Usage(
            "delays are not found together with gains and payloads: give them in seconds"
                .to_owned(),
        ));
    }
    Ok(())
}

/// Derives the robot: with payloads apart where a run carries one.
pub(crate) fn robot(args: &IdentifyArgs, source: &Source) -> Result<Robot, Failure> {
    let experiment = args.reading.experiment.as_ref();
    let is_unknown = args.reading.payload == Some(PayloadArg::Unknown);
    if is_unknown || experiment.is_some_and(|e| e.carries()) {
        return load::with_base(source);
    }
    load::loaded_with_base(source, args.reading.payload)
}

/// The runs with what they carry, and the payloads of the robot with what is known of them.
type Loaded = (Vec<(Run, Option<usize>)>, Vec<KnownPayload>);

fn loaded(args: &IdentifyArgs, bodies: &[String], source: &Source) -> Result<Loaded, Failure> {
    let reading = &args.reading;
    if reading.payload == Some(PayloadArg::Unknown) {
        let [body] = bodies else {
            let name = &source.name;
            let text = if bodies.is_empty() {
                format!(
                    "{name} has no payload: mark a body on a fixed joint `payload: true` for \
                     --payload unknown"
                )
            } else {
                format!(
                    "{name} has the payloads {}: say in an experiment file which a run carries, \
                     `payload: {{body: NAME}}`",
                    bodies.join(", ")
                )
            };
            return Err(Failure::Input(text));
        };
        if args.before.parameters.is_none() {
            return Err(Failure::Usage(
                "--payload unknown needs the robot without it, --parameters PARAMS; or an \
                 experiment file with runs that carry nothing beside those that do"
                    .to_owned(),
            ));
        }
        let runs = args.logs.iter().map(|run| (run.clone(), Some(0)));
        let known = KnownPayload {
            body: body.clone(),
            ..KnownPayload::default()
        };
        return Ok((runs.collect(), vec![known]));
    }
    let carried = |run: &Run| (run.clone(), loads::of_run(reading, run));
    let payloads = match &reading.experiment {
        Some(experiment) if !bodies.is_empty() => experiment.payloads.clone(),
        _ => Vec::new(),
    };
    Ok((args.logs.iter().map(carried).collect(), payloads))
}

/// The robot that was identified before.
fn known_robot(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    source: &Source,
) -> Result<Option<KnownRobot>, Failure> {
    let Some(path) = &args.before.parameters else {
        return Ok(None);
    };
    let value = parameters::value(path)?;
    match IdentifiedModel::read(&value, model) {
        Ok(found) => Ok(Some(KnownRobot::new(model, model, &found)?)),
        Err(FileError::Digest { .. }) if load::mechanism(source)?.payloads().next().is_some() => {
            // parameters of runs without the payload
            let bare = load::loaded_with_base(source, Some(PayloadArg::None))?;
            let terms = BaseTerms::new(&bare);
            let bare = Interpreted::with_terms(&bare, &terms);
            let found = parameters::read(path, &bare)?;
            Ok(Some(KnownRobot::new(model, &bare, &found)?))
        }
        Err(_) => Err(parameters::read(path, model)
            .err()
            .unwrap_or_else(|| Failure::Input(format!("{}: it cannot be read", path.display())))),
    }
}

/// Identifies gains and payloads.
pub(crate) fn solve(
    args: &IdentifyArgs,
    robot: &Robot,
    session: &Session<'_, Interpreted<'_>>,
    source: &Source,
) -> Result<Outcome, Failure> {
    let model = session.model;
    observe::require_consistent(&args.reading)?;
    physical::note_friction(model);
    let bodies = loads::bodies(robot);
    let (runs, payloads) = loaded(args, &bodies, source)?;
    let experiment = args.reading.experiment.iter();
    let plan = Plan {
        unknown_gains: experiment.flat_map(|e| e.unknown_gains.clone()).collect(),
        payloads,
        robot: known_robot(args, model, source)?,
    };
    let (found, reports) = with_gains(session, &plan, &runs)?;
    observe::note_problems(&reports);
    note_short(&found.deviations);
    note_unexplained(&found.errors);
    if let (true, Some(path)) = (found.is_robot_exact, &args.before.parameters) {
        terminal::note(&format!(
            "note: {} has no covariance, so its parameters are taken as exact, and deviations are \
             too small; `regen identify --covariance --out` writes it",
            path.display()
        ));
    }
    let mut identified = found.model.clone();
    identified.provenance = Provenance {
        model: digest(model),
        logs: {
            let names = args
                .logs
                .iter()
                .map(|run| predicted::stem(&run.to_string()));
            let mut names: Vec<String> = names.collect();
            names.sort();
            names
        },
        date: args.date.clone(),
    };
    if !args.before.covariance {
        identified.covariance = None;
    } else if identified.covariance.is_none() {
        return Err(Failure::Usage(
            "--covariance is that of a robot which is identified, and --parameters gives it"
                .to_owned(),
        ));
    }
    let mut summary = summary(&found, session.kind.name());
    summary.files = reports.iter().map(FileJson::new).collect();
    let mut logs = Vec::new();
    for run in &args.physical.against {
        let carried = loads::of_run(&args.reading, run).and_then(|k| bodies.get(k));
        let carried = carried.map(String::as_str);
        let (errors, _, _) = loaded_residuals(session, run, &identified, &bodies, carried)?;
        logs.push(LogError {
            log: run.to_string(),
            relative_absolute: errors.relative_absolute(),
        });
    }
    if !logs.is_empty() {
        summary.models = vec![ModelJson {
            name: identified.name.clone(),
            feasibility: identified.feasibility.clone(),
            gap: None,
            base: identified.beta.clone(),
            friction: Vec::new(),
            logs,
        }];
    }
    let shares = &found.shares;
    let file = ParameterFile::new(model, &identified, shares, Vec::new(), args.confidence)?;
    let json = IdentifyJson { file, summary };
    Ok(Outcome { json, identified })
}

fn summary(found: &GainFit, kind: String) -> Summary {
    let estimate = &found.estimate;
    let efforts = estimate.efforts.iter().zip(&found.errors);
    let efforts = efforts.map(|(e, error)| EffortJson {
        name: e.name.clone(),
        equations: e.rows,
        sigma: e.sigma,
        weight: e.weight,
        error: Some(error.clone()),
    });
    Summary {
        kind,
        equations: estimate.efforts.iter().map(|e| e.rows).sum(),
        degrees_of_freedom: estimate.degrees_of_freedom,
        condition: estimate.condition,
        scaled_condition: estimate.scaled_condition,
        efforts: efforts.collect(),
        relative_absolute: Some(found.relative_absolute),
        bandwidth: Some(found.bandwidth),
        singular: found.left_out.singular,
        left_out: Some(found.left_out.clone()),
        delays: Delays::default(),
        corrected_delays: Vec::new(),
        cross: Vec::new(),
        reduction: Vec::new(),
        models: Vec::new(),
        files: Vec::new(),
        instruments: None,
        simulated: None,
        suspicions: Vec::new(),
    }
}

impl From<GainError> for Failure {
    fn from(error: GainError) -> Self {
        match error {
            GainError::Data(error) => error.into(),
            GainError::Undetermined { .. } | GainError::NotConverged => {
                Self::Numeric(error.to_string())
            }
            other => Self::Input(other.to_string()),
        }
    }
}
