//! `regen observe`: reduces logs to a factor file; also how all commands read logs.

use std::path::PathBuf;

use regen_identify::data::{DataError, FileReport, Policy, Settings};
use regen_identify::estimate::{EstimateError, FactorSet};
use regen_identify::identify::{EquationKind, LeftOut, Options, Standstill, observe};
use regen_identify::session::{MonitoredLogs, Session, SessionError};
use regen_identify::signals::Method;
use serde::Serialize;

use crate::args::{DelayArg, Format, ObserveArgs, ProblemsArg, ReadingArgs, StandstillArg};
use crate::exit::Failure;
use crate::watch::TERMINAL;
use crate::{load, table, terminal, write};
use regen_interpreted::{BaseTerms, Interpreted};

/// The JSON of `regen observe`.
#[derive(Serialize)]
struct ObserveJson<'a> {
    robot: &'a str,
    model: &'a str,
    kind: &'a str,
    parameters: usize,
    efforts: Vec<Rows<'a>>,
    singular: usize,
    left_out: &'a LeftOut,
    files: Vec<FileJson>,
}

#[derive(Serialize)]
struct Rows<'a> {
    name: &'a str,
    rows: usize,
}

/// The statistics of one log file that was read.
#[derive(Serialize)]
pub(crate) struct FileJson {
    file: String,
    rows: usize,
    step: f64,
    states: usize,
    problems: Vec<String>,
    dropped: usize,
}

impl FileJson {
    /// The JSON of a file's report.
    pub(crate) fn new(report: &FileReport) -> Self {
        Self {
            file: report.file.clone(),
            rows: report.rows,
            step: report.step,
            states: report.states,
            problems: report
                .problems
                .first
                .iter()
                .map(ToString::to_string)
                .collect(),
            dropped: report
                .problems
                .left_out(report.policy)
                .iter()
                .map(|(_, count)| count)
                .sum(),
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &ObserveArgs) -> Result<(), Failure> {
    let robot = load::loaded_robot(&args.file, args.reading.payload)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    require_base(&model, &robot.name)?;
    let mut logs = open(&model, &args.logs, &args.reading)?;
    let (set, left_out) = observe(&model, kind(&args.reading), &mut logs)?;
    write::atomically(&args.out, &set.to_text())?;
    note_problems(logs.logs().reports());
    let json = ObserveJson {
        robot: &set.robot,
        model: &set.model,
        kind: &set.kind,
        parameters: set.labels().len(),
        efforts: rows(&set),
        singular: left_out.singular,
        left_out: &left_out,
        files: logs.logs().reports().iter().map(FileJson::new).collect(),
    };
    terminal::print(&match args.format {
        Format::Json => table::json(&json),
        Format::Human => to_text(&json),
    })?;
    terminal::note(&format!("{}: written", args.out.display()));
    Ok(())
}

fn rows(set: &FactorSet) -> Vec<Rows<'_>> {
    let pairs = set.efforts.iter().zip(set.factors());
    let rows = pairs.map(|(name, factor)| Rows {
        name,
        rows: factor.rows(),
    });
    rows.collect()
}

fn to_text(json: &ObserveJson<'_>) -> String {
    let efforts = json.efforts.iter();
    let lines: Vec<Vec<String>> = efforts
        .map(|e| vec![e.name.to_owned(), e.rows.to_string()])
        .collect();
    let mut out = format!("{}, {} parameters\n", json.robot, json.parameters);
    out.push_str(&table::field("equations", json.kind));
    if json.singular > 0 {
        out.push_str(&table::field("singular", &json.singular.to_string()));
    }
    out.push_str(&resting(json.left_out));
    out.push_str(&table::columns(&["effort", "equations"], &lines));
    out
}

/// The share of equations that were left out because their coordinates were at rest, for people;
/// empty where there were none.
pub(crate) fn resting(left: &LeftOut) -> String {
    let rest: usize = left.resting.iter().sum();
    let all = left.samples * left.resting.len();
    if rest == 0 || all == 0 {
        return String::new();
    }
    let share = 100.0 * rest as f64 / all as f64;
    table::field(
        "at rest",
        &format!("{share:.2} % of the equations left out"),
    )
}

/// Whether every equation was left out because its coordinate was at rest.
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
        let text = "--delay auto is for `identify`: give the values that it printed, NAME=S";
        return Err(Failure::Input(text.to_owned()));
    }
    if reading.standstill == StandstillArg::Weigh && settings(reading).method.smoothing().is_none()
    {
        let text = "--standstill weigh weighs equations by how long their joints moved within the \
                    memory of a filter, and there is none: give --butterworth or --local, or choose \
                    drop or keep";
        return Err(Failure::Input(text.to_owned()));
    }
    Ok(())
}

/// Opens logs as the options say, with progress bars for the passes over them.
pub(crate) fn open<'m>(
    model: &'m Interpreted<'m>,
    paths: &[PathBuf],
    reading: &ReadingArgs,
) -> Result<MonitoredLogs<'m, Interpreted<'m>>, Failure> {
    require_consistent(reading)?;
    Ok(session(model, reading).open(paths)?)
}

/// An identification session with the options' reading and default settings of the solution.
pub(crate) fn session<'m>(
    model: &'m Interpreted<'m>,
    reading: &ReadingArgs,
) -> Session<'m, Interpreted<'m>> {
    Session {
        model,
        reading: settings(reading),
        kind: kind(reading),
        options: Options::default(),
        confidence: 0.95,
        watch: &TERMINAL,
    }
}

/// The settings for reading logs.
pub(crate) fn settings(reading: &ReadingArgs) -> Settings {
    let method = if let Some((frequency, harmonics)) = reading.fourier {
        Method::Fourier {
            frequency,
            harmonics,
        }
    } else if let Some((cutoff, order)) = reading.butterworth {
        Method::Butterworth { order, cutoff }
    } else if let Some(half_width) = reading.local {
        Method::Local { half_width }
    } else {
        Method::Central
    };
    Settings {
        columns: reading.column.clone(),
        method,
        policy: match reading.problems {
            ProblemsArg::Fail => Policy::Fail,
            ProblemsArg::Drop => Policy::Drop,
            ProblemsArg::Keep => Policy::Keep,
            ProblemsArg::Tell => Policy::Tell,
        },
        decimation: reading.decimate.max(1),
        period: reading.period,
        deviations: reading.deviation.clone(),
        standstill: match reading.standstill {
            StandstillArg::Drop => Standstill::Drop,
            StandstillArg::Keep => Standstill::Keep,
            StandstillArg::Weigh => Standstill::Weigh,
        },
        rest_speed: reading.rest_speed,
        delays: delays(reading),
    }
}

/// The delays of efforts given as numbers in the options, s.
pub(crate) fn delays(reading: &ReadingArgs) -> Vec<(String, f64)> {
    let stated = reading.delay.iter().filter_map(|delay| match delay {
        DelayArg::Of(name, seconds) => Some((name.clone(), *seconds)),
        DelayArg::Auto => None,
    });
    stated.collect()
}

/// The equations that the options ask for: forces or energy balance.
pub(crate) fn kind(reading: &ReadingArgs) -> EquationKind {
    match reading.energy {
        Some(window) => EquationKind::Energy { window },
        None => EquationKind::Forces,
    }
}

/// Prints which rows of the logs were left out, or used although they are doubtful.
pub(crate) fn note_problems(reports: &[FileReport]) {
    for report in reports {
        if !report.still.is_empty() {
            terminal::note(&format!(
                "{}: {} never moves: what only its motion shows cannot be seen",
                report.file,
                report.still.join(", ")
            ));
        }
        let count = report.problems.total();
        let what = match report.policy {
            Policy::Keep => {
                // rows that even `keep` cannot use are reported
                let lost = report.problems.left_out(report.policy);
                let kinds = lost.iter().map(|(kind, count)| format!("{count} x {kind}"));
                let kinds: Vec<String> = kinds.collect();
                if !kinds.is_empty() {
                    terminal::note(&format!(
                        "warning: {}: rows that cannot be kept were left out: {}",
                        report.file,
                        kinds.join(", ")
                    ));
                }
                continue;
            }
            Policy::Tell => "are doubtful; those that are numbers are used",
            Policy::Fail | Policy::Drop => "were left out",
        };
        if count > 0 {
            let text = format!(
                "warning: {}: {count} rows or gaps {what}\n{}",
                report.file, report.problems
            );
            terminal::note(text.trim_end());
        }
    }
}

impl From<DataError> for Failure {
    fn from(error: DataError) -> Self {
        match error {
            DataError::Io { .. } => Self::Io(error.to_string()),
            DataError::Estimate(error) => error.into(),
            DataError::Feasibility(error) => error.into(),
            DataError::Problems { .. } => Self::Input(format!(
                "{error}  leave them out with --problems drop, or use those that are numbers with \
                 --problems keep"
            )),
            DataError::Columns {
                file,
                why,
                assignment,
            } => Self::Input(if assignment.contains('*') {
                format!("{file}: {why} --column '{assignment}'")
            } else {
                format!("{file}: {why} --column {assignment}")
            }),
            DataError::NonlinearFrictionInEnergyBalance => {
                Self::Input(format!("{error}: leave out --energy"))
            }
            other => Self::Input(other.to_string()),
        }
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Data(error) => error.into(),
            SessionError::Feasibility(error) => error.into(),
            SessionError::TooFewLogs => Self::Input("--cross needs two logs or more".to_owned()),
            SessionError::DelaysFromEnergyBalance => Self::Input(
                "--delay auto needs the equations of motion: leave out --energy".to_owned(),
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
            other => Self::Input(other.to_string()),
        }
    }
}
