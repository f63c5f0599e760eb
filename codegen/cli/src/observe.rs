//! `regen observe`: reduces logs to a factor file; also how all commands read logs.

use regen_identify::data::{
    Checks, DataError, Decision, Fault, FileReport, Gaps, Policy, Problem, Problems, Quantity, Run,
    Settings,
};
use regen_identify::estimate::EstimateError;
use regen_identify::identify::{EquationKind, LeftOut, observe};
use regen_identify::session::{MonitoredLogs, Session, SessionError, from_logs};
use regen_identify::signals::{Method, SignalError};
use regen_identify::states::Standstill;
use regen_identify::text::figure_of;
use regen_report::results::{
    LOCK_JOINTS, LogFile, Observed, READ_AS_POSES, doubts_of_log, notes_of_logs, observed_text,
};

use crate::args::{
    DelayArg, Format, ObserveArgs, ProblemsArg, ReadingArgs, StandstillArg, VelocitiesArg,
};
use crate::exit::Failure;
use crate::suspect::OtherSpecs;
use crate::watch::TERMINAL;
use crate::{choice, delay, experiment, load, suspect, table, terminal, write};
use regen_interpreted::{BaseTerms, Interpreted};

/// Runs the command.
pub(crate) fn run(args: &ObserveArgs) -> Result<(), Failure> {
    let source = load::source(&args.file)?;
    let mut args = args.clone();
    experiment::resolve(&mut args.logs, &mut args.reading, &source)?;
    experiment::require_logs(&args.logs)?;
    let robot = load::loaded_derived(&source, args.reading.payload)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    require_base(&model, &robot.name)?;
    let filter = {
        let session = session(&model, &args.reading);
        let open = choice::open(&args.reading, false);
        choice::made(&mut args.reading, &session, &mut args.logs, open)?
    };
    let (reading, corrected_delays) =
        delay::with_found_delays(&args.reading, &session(&model, &args.reading), &args.logs)?;
    args.reading = reading;
    let mut logs = open(&model, &args.logs, &args.reading)?;
    let (set, left_out) = observe(&model, kind(&args.reading), &mut logs)?;
    // what the order of the rows and the motion tell of the errors is not in the factors
    let session = session(&model, &args.reading);
    let errors = from_logs(&session, &mut session.open(&args.logs)?);
    let errors = errors.ok().and_then(|start| start.log_errors());
    let set = set.with_errors(errors)?;
    write::atomically(&args.out, &set.to_text())?;
    note_problems(logs.logs().reports());
    // who adds up the factors sees no log any more
    let specs = OtherSpecs::new(&args.file, args.reading.payload);
    let _ = suspect::warn_of_logs(&session, &args.logs, logs.logs(), &specs);
    let files = logs.logs().reports().iter().map(LogFile::new).collect();
    let mut found = Observed::new(&set, &left_out, corrected_delays, files);
    found.filter = filter;
    terminal::print(&match args.format {
        Format::Json => table::document(&found),
        Format::Human => observed_text(&found),
    })?;
    terminal::note(&format!("{}: written", args.out.display()));
    Ok(())
}

/// Whether every equation was left out because its joint was at rest.
pub(crate) fn all_rest(left: &LeftOut) -> bool {
    let mut rest = left.resting.iter().peekable();
    left.samples > 0 && rest.peek().is_some() && rest.all(|rest| *rest == left.samples)
}

/// Refuses a robot without base parameters: it cannot be identified.
pub(crate) fn require_base(model: &Interpreted<'_>, name: &str) -> Result<(), Failure> {
    if !model.base_info().base.is_empty() {
        return Ok(());
    }
    let text = format!("{name} has no base parameters to identify");
    Err(Failure::Input(text))
}

/// Refuses combinations of reading options that contradict each other.
pub(crate) fn require_consistent(reading: &ReadingArgs) -> Result<(), Failure> {
    if reading.delay.contains(&DelayArg::Auto) {
        let text = "this command does not estimate delays (auto): give the values that `identify` \
                    printed, --delay NAME=S";
        return Err(Failure::Input(text.to_owned()));
    }
    let settings = settings(reading);
    if settings.standstill == Standstill::Weigh && settings.method.smoothing().is_none() {
        let text = "--standstill weigh weighs equations by how long their joints moved within the \
                    memory of a filter, and there is none: give --butterworth or --local, or choose \
                    drop or keep";
        return Err(Failure::Input(text.to_owned()));
    }
    if settings.standstill == Standstill::Keep && settings.rest_speed > 0.0 {
        let text = "a speed below which joints rest has no effect where equations of joints at rest are used \
                    like all others (keep): leave one of them out";
        return Err(Failure::Input(text.to_owned()));
    }
    Ok(())
}

/// Opens logs as the options say, with progress bars for the passes over them.
pub(crate) fn open<'m, R: Clone + Into<Run>>(
    model: &'m Interpreted<'m>,
    runs: &[R],
    reading: &ReadingArgs,
) -> Result<MonitoredLogs<'m, Interpreted<'m>>, Failure> {
    require_consistent(reading)?;
    Ok(session(model, reading).open(runs)?)
}

/// An identification session with the options' reading and default settings of the solution.
pub(crate) fn session<'m>(
    model: &'m Interpreted<'m>,
    reading: &ReadingArgs,
) -> Session<'m, Interpreted<'m>> {
    Session {
        kind: kind(reading),
        watch: &TERMINAL,
        ..Session::new(model, settings(reading))
    }
}

/// The settings for reading logs: those of the experiment file, if there is one, overridden by the
/// options.
pub(crate) fn settings(reading: &ReadingArgs) -> Settings {
    let stated = reading
        .experiment
        .as_ref()
        .map(|found| found.settings.clone());
    let mut settings = stated.unwrap_or_default();
    settings.columns.splice(..0, reading.column.iter().cloned());
    // a time counted by the rate of the file has no column
    if reading
        .column
        .iter()
        .any(|column| column.quantity == Quantity::Time)
    {
        settings.rate = None;
    }
    settings.rate = reading.rate.or(settings.rate);
    settings.topic = reading.topic.clone().or(settings.topic);
    settings.episode = reading.episode.or(settings.episode);
    settings.resample = reading.resample.or(settings.resample);
    if let Some(velocities) = reading.velocities {
        settings.measured_rates = Some(velocities == VelocitiesArg::Measured);
    }
    settings.poses |= reading.poses;
    if reading.no_filter
        || settings.poses
        || reading.fourier.is_some()
        || reading.butterworth.is_some()
        || reading.local.is_some()
    {
        settings.method_by = Decision::Given;
    }
    if reading.no_filter || reading.poses {
        settings.method = Method::Central;
    } else if let Some((frequency, harmonics)) = reading.fourier {
        settings.method = Method::Fourier {
            frequency,
            harmonics,
        };
    } else if let Some((cutoff, order)) = reading.butterworth {
        settings.method = Method::Butterworth { order, cutoff };
    } else if let Some(half_width) = reading.local {
        settings.method = Method::Local { half_width };
    }
    if let Some(problems) = reading.problems {
        settings.checks = Checks::default();
        if problems == ProblemsArg::Fail {
            settings.checks.gaps = Gaps::Fail;
        }
        settings.policy = match problems {
            ProblemsArg::Fail => Policy::Fail,
            ProblemsArg::Drop => Policy::Drop,
            ProblemsArg::Keep => Policy::Keep,
            ProblemsArg::Tell => Policy::Tell,
        };
    }
    if let Some(decimation) = reading.decimate {
        settings.decimation = decimation.max(1);
    }
    settings.period = reading.period.or(settings.period);
    settings
        .deviations
        .splice(..0, reading.deviation.iter().cloned());
    if let Some(standstill) = reading.standstill {
        settings.standstill = match standstill {
            StandstillArg::Drop => Standstill::Drop,
            StandstillArg::Keep => Standstill::Keep,
            StandstillArg::Weigh => Standstill::Weigh,
        };
    }
    settings.rest_speed = reading.rest_speed.unwrap_or(settings.rest_speed);
    let given = reading.delay.iter().filter_map(|delay| match delay {
        DelayArg::Of(name, seconds) => Some((name.clone(), *seconds)),
        DelayArg::Auto => None,
    });
    let given: Vec<(String, f64)> = given.collect();
    settings
        .delays
        .retain(|(name, _)| !given.iter().any(|(own, _)| own == name));
    settings.delays.extend(given);
    settings.are_delays_found = reading.found.delays;
    if reading.found.filter {
        settings.method_by = Decision::Chosen;
    }
    settings
}

/// The equations that the options or the experiment file ask for: forces or energy balance.
pub(crate) fn kind(reading: &ReadingArgs) -> EquationKind {
    match (reading.energy, &reading.experiment) {
        (Some(window), _) => EquationKind::Energy { window },
        (None, Some(found)) => found.kind,
        (None, None) => EquationKind::Forces,
    }
}

/// Adds to the message of an error of too little motion the joints that do not move in any log.
pub(crate) fn with_still(failure: Failure, reports: &[FileReport]) -> Failure {
    let first = reports.first().map(|first| first.still.as_slice());
    let still: Vec<&str> = (first.unwrap_or_default().iter())
        .filter(|name| reports.iter().all(|report| report.still.contains(name)))
        .map(String::as_str)
        .collect();
    let rests = (!still.is_empty()).then(|| {
        let still = still.join(", ");
        let what = if reports.iter().any(|report| report.are_poses) {
            READ_AS_POSES
        } else {
            LOCK_JOINTS
        };
        format!("\n  no log has motion of {still} beyond its noise: {what}")
    });
    let divided = reports.iter().filter_map(said_of_stretches);
    match failure {
        Failure::Numeric(text) => {
            Failure::Numeric(text + &rests.into_iter().chain(divided).collect::<String>())
        }
        other => other,
    }
}

/// Why a log gives no equation, if all its stretches are too short for the filter.
fn said_of_stretches(report: &FileReport) -> Option<String> {
    let bridged = report.bridged.count + report.bridged.cuts;
    (report.settling > report.longest && bridged + report.problems.total() > 0).then(|| {
        format!(
            "\n  {}: gaps, dropouts or rows that are left out divide it into stretches of at most \
             {} s, and the filter needs {} s to settle at both ends of one: bridge gaps \
             (`gaps: bridge`), raise the filter's cutoff, or read it without a filter",
            report.file,
            figure_of(3, report.longest),
            figure_of(3, report.settling)
        )
    })
}

/// Prints which rows of the logs were left out, or used although they are doubtful, and what else is to know of their files.
pub(crate) fn note_problems(reports: &[FileReport]) {
    note_doubts(reports);
    note_files(reports);
}

/// Prints how the files of logs are joined, and which columns are not used.
pub(crate) fn note_files(reports: &[FileReport]) {
    for text in notes_of_logs(reports) {
        terminal::note(&format!("note: {text}"));
    }
}

/// Prints which rows of the logs were left out, or used although they are doubtful.
pub(crate) fn note_doubts(reports: &[FileReport]) {
    for report in reports {
        for text in doubts_of_log(report) {
            terminal::note(&format!("warning: {}: {text}", report.file));
        }
    }
}

/// A gap of at most this many usual steps is blamed on an uneven clock, which resampling corrects.
const SHORT_GAP_STEPS: f64 = 3.0;
/// With so many rows of other entries, of which one of the first is the first, the header is wrong and not they.
const MIN_ROWS_OF_HEADER: usize = 10;
const MAX_FIRST_ROW: u64 = 10;

impl From<DataError> for Failure {
    fn from(error: DataError) -> Self {
        match error {
            DataError::Io { .. } => Self::Io(error.to_string()),
            DataError::Estimate(error) => error.into(),
            DataError::Feasibility(error) => error.into(),
            DataError::Problems { ref problems, .. } => {
                // a clock whose stamps come late has short gaps, and the same time twice
                let is_of_clock = |fault: &Fault| match fault {
                    Fault::Gap { step, usual } | Fault::Uneven { step, usual } => {
                        *step <= SHORT_GAP_STEPS * usual
                    }
                    Fault::Duplicate { .. } => true,
                    _ => false,
                };
                let mut gaps = problems.first.iter().rev().filter_map(|p| match p.what {
                    Fault::Gap { usual, .. } | Fault::Uneven { usual, .. } => Some(usual),
                    _ => None,
                });
                let clock_kinds = ["gap", "uneven step", "duplicate time"];
                let is_clock = problems.first.iter().all(|p| is_of_clock(&p.what))
                    && (problems.counts.iter())
                        .all(|(kind, _)| clock_kinds.contains(&kind.as_str()));
                if let Some(remedy) = of_header(problems) {
                    return Self::Input(format!("{error}  {remedy}"));
                }
                match gaps.next().filter(|_| is_clock) {
                    Some(usual) => Self::Input(format!(
                        "{error}  the steps of time are uneven: interpolate onto an even grid with \
                         --resample {}{}; or, if all other steps are equal, leave the rows out with \
                         --problems drop",
                        (1.0 / usual).round().max(1.0),
                        if problems.counts.len() > 1 {
                            " and --problems drop"
                        } else {
                            ""
                        }
                    )),
                    None => Self::Input(format!(
                        "{error}  leave them out with --problems drop, or use those that are \
                         numbers with --problems keep"
                    )),
                }
            }
            DataError::Signal {
                why: SignalError::NotUniform { .. },
                ..
            } => Self::Input(format!("{error}: --resample HZ")),
            DataError::Columns {
                file,
                why,
                assignment,
            } => {
                let options = assignment.lines().map(|assignment| {
                    let quote = if assignment.contains('*') { "'" } else { "" };
                    format!("--column {quote}{assignment}{quote}")
                });
                let options = options.collect::<Vec<_>>().join(" ");
                let rate = if assignment.starts_with("t=") {
                    ", or give the rate of the rows with --rate HZ"
                } else {
                    ""
                };
                let text = format!("{file}: {why} {options}{rate}");
                Self::Input(text)
            }
            DataError::Part { key, .. } => Self::Input(format!(
                "{error}\n  name it with --{key}, or as `{key}` of its run in an experiment file"
            )),
            DataError::NonlinearFrictionInEnergyBalance => {
                Self::Input(format!("{error}: leave out --energy"))
            }
            other => Self::Input(other.to_string()),
        }
    }
}

/// The remedy where the rows have other entries than the header from the first one on; `None` for other problems.
fn of_header(problems: &Problems) -> Option<String> {
    let rows: usize = problems.first.iter().map(Problem::rows).sum();
    let first = problems.first.first()?;
    let Fault::Entries { found, expected } = first.what else {
        return None;
    };
    if rows < MIN_ROWS_OF_HEADER || first.row > MAX_FIRST_ROW || found < expected {
        return None;
    }
    Some(if 2 * found > 3 * expected {
        "commas separate the columns, and the decimals, too: write the log with another separator, such as \
         `;` or a tabulator"
            .to_owned()
    } else {
        format!("give each of the {found} columns a title in the header, also one that is not used")
    })
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Data(error) => error.into(),
            SessionError::Feasibility(error) => error.into(),
            SessionError::Gains(error) => error.into(),
            SessionError::TooFewLogs => Self::Input("--cross needs two logs or more".to_owned()),
            SessionError::DelaysFromEnergyBalance => Self::Input(
                "--delay auto needs the equations of motion: leave out --energy, or give --delay 0"
                    .to_owned(),
            ),
            SessionError::NoWellIdentifiedParameter => Self::Numeric(error.to_string()),
            other => Self::Input(other.to_string()),
        }
    }
}

impl From<EstimateError> for Failure {
    fn from(error: EstimateError) -> Self {
        match error {
            EstimateError::TooShort { .. }
            | EstimateError::Undetermined { .. }
            | EstimateError::NoConvergence => Self::Numeric(error.to_string()),
            EstimateError::Signal(SignalError::NotUniform { .. }) => {
                Self::Input(format!("{error}: --resample HZ"))
            }
            other => Self::Input(other.to_string()),
        }
    }
}
