//! `regen report`, and `--report` of `regen identify`: writes one HTML page about an
//! identification.

use std::path::Path;

use regen_codegen::robot::Robot;

use crate::args::{IdentifyArgs, ReportArgs};
use crate::exit::Failure;
use crate::suspect::OtherSpecs;
use crate::{
    choice, delay, experiment, identify, load, loads, observe, parameters, suspect, terminal, write,
};
use regen_identify::choice::Choice;
use regen_identify::data::Run;
use regen_identify::files::ParameterFile;
use regen_identify::model::IdentifiedModel;
use regen_identify::session::Session;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_report::results::Identification;
use regen_report::{Inputs, ReportError};

/// Writes the report if `regen identify` was given `--report`.
pub(crate) fn of_identified(
    args: &IdentifyArgs,
    robot: &Robot,
    model: &Interpreted<'_>,
    found: &Identification,
    identified: &IdentifiedModel,
) -> Result<(), Failure> {
    let Some(out) = &args.report.report else {
        return Ok(());
    };
    observe::require_consistent(&args.reading)?;
    let runs: Vec<Run> = args
        .logs
        .iter()
        .chain(&args.physical.against)
        .cloned()
        .collect();
    let session = Session {
        options: identify::options(args),
        ..loads::scaled(model, &args.reading, identified)
    };
    let inputs = Inputs {
        robot,
        session: &session,
        by_run: &loads::by_run(robot, model, &args.reading, &runs, identified)?,
        file: &found.file,
        identified,
        logs: &args.logs,
        validation: &args.physical.against,
        suspicions: &found.summary.suspicions,
        command: args.report.command.as_deref(),
    };
    let outputs = Outputs {
        page: out,
        figures: args.report.figures.as_deref(),
    };
    write(&outputs, &inputs)
}

/// The paths that a report is written to.
struct Outputs<'a> {
    page: &'a Path,
    figures: Option<&'a Path>,
}

/// Runs `regen report`.
pub(crate) fn run(args: &ReportArgs) -> Result<(), Failure> {
    let source = load::source(&args.file)?;
    let mut args = args.clone();
    let planned = experiment::resolve_loaded(&mut args.logs, &mut args.reading, &source)?;
    experiment::require_logs(&args.logs)?;
    args.against.extend(planned);
    let robot = loads::derived_for(&source, &args.reading, &args.params)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    observe::require_base(&model, &robot.name)?;
    // `read` checks that the file belongs to this model, by its digest
    let identified = parameters::read(&args.params, &model)?;
    loads::require_gains(&args.reading, &identified, &args.params)?;
    match choice::of_its_logs(&args.reading, &identified, &args.logs) {
        Some(own) => {
            choice::pin(own, &mut args.reading);
            args.logs = own.runs(&args.logs);
        }
        None => {
            choice::repeat_or_make(&mut args.reading, &model, &identified, &mut args.logs)?;
        }
    }
    let value = parameters::value(&args.params)?;
    let file: ParameterFile = serde_json::from_value(value).map_err(|why| {
        Failure::Input(format!(
            "{}: is not what `regen identify --out` writes: {why}",
            args.params.display()
        ))
    })?;
    args.reading = delay::with_found_delays_of_model(&args.reading, &model, &args.logs)?.0;
    observe::require_consistent(&args.reading)?;
    let runs: Vec<Run> = args.logs.iter().chain(&args.against).cloned().collect();
    let mut session = loads::scaled(&model, &args.reading, &identified);
    session.options.huber = file.filter.as_ref().and_then(Choice::huber);
    // these checks compare efforts with plausible weights and inertias, and so need known gains
    let suspicions = if identified.gains.is_empty() {
        let opened = session.open(&args.logs).map_err(ReportError::from)?;
        let specs = OtherSpecs::new(&args.file, args.reading.payload);
        suspect::warn_of_logs(&session, &args.logs, opened.logs(), &specs)
    } else {
        Vec::new()
    };
    let inputs = Inputs {
        robot: &robot,
        session: &session,
        by_run: &loads::by_run(&robot, &model, &args.reading, &runs, &identified)?,
        file: &file,
        identified: &identified,
        logs: &args.logs,
        validation: &args.against,
        suspicions: &suspicions,
        command: args.command.as_deref(),
    };
    let outputs = Outputs {
        page: &args.out,
        figures: args.figures.as_deref(),
    };
    write(&outputs, &inputs)
}

/// Makes the report and writes it: the figures first, so that a page never lacks its figures.
fn write(outputs: &Outputs<'_>, inputs: &Inputs<'_>) -> Result<(), Failure> {
    let report = regen_report::report(inputs)?;
    if let Some(dir) = outputs.figures {
        for figure in &report.figures {
            write::atomically(&dir.join(format!("{}.svg", figure.name)), &figure.svg)?;
        }
    }
    write::atomically(outputs.page, &report.html)?;
    terminal::note(&format!("{}: written", outputs.page.display()));
    Ok(())
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        match error {
            ReportError::Log(error) => error.into(),
            ReportError::Drawing(_) => Self::Io(error.to_string()),
            other => Self::Input(other.to_string()),
        }
    }
}
