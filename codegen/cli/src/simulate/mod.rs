//! `regen simulate`: simulates a controlled robot and writes the logs that it would record.

mod parameters;
mod twin;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use regen_experiment::simulate::{
    Following, Log, LogColumns, Settings, SimulationError, Termination, Trial, TuningError,
    simulate_with_progress,
};
use regen_experiment::trajectory::FourierReference;
use regen_identify::files::Format;
use regen_runtime::Info;
use serde::Serialize;

use crate::args::{Format as OutputFormat, SimulateArgs, TwinArgs};
use crate::exit::Failure;
use crate::{load, path, progress, table, terminal, write};
use regen_interpreted::Interpreted;

pub(crate) use parameters::{Described, WHERE};
pub(crate) use twin::{of as twin, require_jump};

/// The JSON of `regen simulate`.
#[derive(Serialize)]
struct SimulateJson {
    robot: String,
    motion: String,
    duration: f64,
    step: f64,
    seed: u64,
    /// How the controllers were chosen; null where they are given.
    following: Option<Following>,
    controllers: Vec<Controller>,
    runs: Vec<Run>,
}

#[derive(Serialize)]
struct Controller {
    joint: String,
    kp: f64,
    ki: f64,
    kd: f64,
    offset: f64,
}

/// The figures of one run.
#[derive(Serialize)]
struct Run {
    file: String,
    samples: usize,
    steps: usize,
    /// The largest absolute entry of the closure residual f(q), m or without unit.
    drift: f64,
    /// The largest imbalance of energy, J; `work`, `loss` and `kinetic`, J, are what to compare it
    /// with.
    imbalance: f64,
    work: f64,
    loss: f64,
    kinetic: f64,
    /// The largest distance of an independent coordinate from the reference motion, rad or m.
    tracking: f64,
}

/// Runs the command.
pub(crate) fn run(args: &SimulateArgs) -> Result<(), Failure> {
    if args.runs == 0 {
        return Err(Failure::Input("--runs must be at least 1".to_owned()));
    }
    check(&args.twin)?;
    let robot = load::without_base(&args.file, args.payload)?;
    let model = Interpreted::new(&robot);
    let info = model.info();
    let motion = path::of(args.twin.trajectory.as_deref(), &model)?;
    let source = Described {
        file: &args.file,
        payload: args.payload,
    };
    let duration = args.twin.duration.unwrap_or(motion.period());
    let settle = args.twin.settle;
    // all runs are simulated before any file is written: an interrupt leaves all files or none
    let total = duration + settle;
    let bar = progress::bar(
        thousandths(args.runs as f64 * total),
        "{bar:24} {percent:>3} %, {eta} left",
    );
    let mut progress = |t: f64| bar.set_position(thousandths(t));
    let span = (args.twin.step, total);
    let tried = twin::of(&args.twin, source, &model, &motion, span, &mut progress)?;
    let twin = tried.twin;
    let mut first = tried.first;
    let settings = twin.run(args.twin.seed, 0, total);
    if let Some(file) = &args.controller {
        let text = Format::of(file).text(&gains_of(&info, &settings));
        let text = text.map_err(|why| Failure::Input(format!("{}: {why}", file.display())))?;
        // the file of a run that fails later does no harm
        write::atomically(file, &text)?;
    }
    let truth = match &args.truth {
        Some(file) => {
            let text = Format::of(file).text(&parameters::truth(&info, &twin));
            let text = text.map_err(|why| Failure::Input(format!("{}: {why}", file.display())))?;
            Some((file.clone(), text))
        }
        None => None,
    };
    let names = info.actuated.iter().zip(&settings.pid);
    let controllers = names
        .zip(&settings.offset)
        .map(|((joint, pid), offset)| Controller {
            joint: info.coordinates.get(*joint).unwrap_or(&"?").to_string(),
            kp: pid.kp,
            ki: pid.ki,
            kd: pid.kd,
            offset: *offset,
        })
        .collect();

    let mut texts = Vec::with_capacity(args.runs);
    let mut runs = Vec::with_capacity(args.runs);
    for number in 0..args.runs {
        let settings = twin.run(args.twin.seed, number, total);
        let from = number as f64 * total;
        let mut progress = |t: f64| bar.set_position(thousandths(from + t));
        let found = match first.take() {
            Some(first) => first,
            None => {
                simulate_with_progress(&model, &twin.parameters, &motion, &settings, &mut progress)
                    .map_err(|error| misuse(&error))?
            }
        };
        if let Some(why) = reason(found.ended) {
            bar.finish_and_clear();
            let at = found.t.last().copied().unwrap_or(0.0);
            return Err(Failure::Numeric(format!(
                "run {} ended after {at:.3} s of {} s: {why}",
                number + 1,
                settings.duration
            )));
        }
        if number == 0
            && let tuned = (args.twin.bandwidth.unwrap_or_default(), settings.period)
            && let trial = Trial::of(tuned, &info, &settings.drives, (&found, &motion))
            && !trial.follows()
        {
            terminal::note(&format!(
                "warning: {trial}, so that the log is of another motion: leave --bandwidth and gains out for \
                 controllers that follow it, or shorten --step where it swings"
            ));
        }
        let file = numbered(&args.out, number, args.runs);
        runs.push(Run {
            file: file.display().to_string(),
            ..summary(&info, &found, &motion)
        });
        let columns = match (args.exact, args.commands) {
            (true, _) => LogColumns::Exact,
            (_, true) => LogColumns::Commanded,
            _ => LogColumns::Measured,
        };
        texts.push((file, found.csv(&info, &settings, settle, columns)));
    }
    bar.finish_and_clear();
    texts.extend(truth);
    for (file, text) in &texts {
        write::atomically(file, text)?;
    }
    let json = SimulateJson {
        robot: robot.name.clone(),
        motion: motion.name().to_owned(),
        duration,
        step: twin.settings.period,
        seed: args.twin.seed,
        following: tried.following,
        controllers,
        runs,
    };
    terminal::print(&match args.format {
        OutputFormat::Json => table::document(&json),
        OutputFormat::Human => to_text(&json),
    })?;
    for (file, _) in &texts {
        terminal::note(&format!("{}: written", file.display()));
    }
    Ok(())
}

/// The controllers of a run as a file, by the names of their joints.
fn gains_of(info: &Info<'_>, settings: &Settings) -> BTreeMap<String, ControllerRow> {
    let all = info.actuated.iter().zip(&settings.pid).enumerate();
    let rows = all.map(|(k, (joint, pid))| {
        let row = ControllerRow {
            kp: pid.kp,
            ki: pid.ki,
            kd: pid.kd,
            offset: settings.offset.get(k).copied().unwrap_or(0.0),
            limit: settings.drives.get(k).and_then(|drive| drive.limit),
        };
        let name = info.coordinates.get(*joint).copied().unwrap_or("?");
        (name.to_owned(), row)
    });
    rows.collect()
}

/// One controller in a file for `identify`.
#[derive(Serialize)]
struct ControllerRow {
    kp: f64,
    ki: f64,
    kd: f64,
    offset: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    limit: Option<[f64; 2]>,
}

/// Refuses options that are wrong for every robot.
pub(crate) fn check(args: &TwinArgs) -> Result<(), Failure> {
    let positive = [
        ("--step", args.step),
        ("--duration", args.duration),
        ("--bandwidth", args.bandwidth),
        ("--friction-width", args.friction_width),
    ];
    for (name, value) in positive {
        if value.is_some_and(|v| !(v > 0.0 && v.is_finite())) {
            return Err(Failure::Input(format!("{name} must be above 0")));
        }
    }
    require_width(args.friction_width)?;
    let at_least_zero = [("--lag", args.lag), ("--settle", args.settle)];
    for (name, value) in at_least_zero {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(Failure::Input(format!("{name} must be at least 0")));
        }
    }
    if !(0.0..1.0).contains(&args.perturb) {
        let text = "--perturb must be at least 0 and below 1, such as 0.05";
        return Err(Failure::Input(text.to_owned()));
    }
    Ok(())
}

/// Below this width, rad/s or m/s, the integration of friction takes minutes for seconds of motion, which differ
/// from those of a larger width by less than any sensor tells.
const MIN_FRICTION_WIDTH: f64 = 1e-5;

/// Refuses a width of friction that takes too long.
pub(crate) fn require_width(width: Option<f64>) -> Result<(), Failure> {
    match width {
        Some(width) if width < MIN_FRICTION_WIDTH => Err(Failure::Input(format!(
            "--friction-width {width:e} is below {MIN_FRICTION_WIDTH}, the least that is simulated"
        ))),
        _ => Ok(()),
    }
}

fn misuse(error: &SimulationError) -> Failure {
    Failure::Input(error.to_string())
}

/// Why a run ended before its time, with the options that may help; `None` for a complete run.
pub(crate) fn reason(ended: Termination) -> Option<String> {
    let remedy = match ended {
        Termination::Complete => return None,
        Termination::Open(_) => {
            "; follow the motion closer (--bandwidth), or stay further from singularities (`excite --margin`)"
        }
        Termination::NotPositiveDefinite => "",
        Termination::StepTooSmall => "; raise --friction-width, or lower the gains",
        Termination::Diverged => ": the gains are too high for this --step",
    };
    Some(format!("{ended}{remedy}"))
}

fn summary(info: &Info<'_>, log: &Log, motion: &FourierReference) -> Run {
    let last = log.energy.last().copied().unwrap_or_default();
    Run {
        file: String::new(),
        samples: log.t.len(),
        steps: log.steps,
        drift: log.residual,
        imbalance: log.imbalance,
        work: last.work,
        loss: last.loss,
        kinetic: log.energy.iter().fold(0.0, |m, e| m.max(e.kinetic)),
        tracking: log.tracking(info, motion),
    }
}

/// A time in milliseconds, for a progress bar.
#[allow(clippy::cast_sign_loss, reason = "times are not negative")]
fn thousandths(t: f64) -> u64 {
    (t * 1e3) as u64
}

/// The file of a run: `log.csv`, or `log-3.csv` where there are several.
fn numbered(out: &Path, number: usize, runs: usize) -> PathBuf {
    if runs == 1 {
        return out.to_owned();
    }
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let end = out.extension().map(|e| format!(".{}", e.to_string_lossy()));
    out.with_file_name(format!("{stem}-{}{}", number + 1, end.unwrap_or_default()))
}

fn to_text(json: &SimulateJson) -> String {
    let mut out = format!(
        "{}, {} s every {} s\n",
        json.robot, json.duration, json.step
    );
    out.push_str(&table::field("motion", &json.motion));
    if let Some(following) = &json.following {
        out.push_str(&table::field("controllers", &following.to_string()));
    }
    out.push('\n');
    let lines: Vec<Vec<String>> = json
        .controllers
        .iter()
        .map(|c| {
            let figures = [c.kp, c.ki, c.kd, c.offset].map(table::figure);
            std::iter::once(c.joint.clone()).chain(figures).collect()
        })
        .collect();
    out.push_str(&table::columns(
        &["controller", "kp", "ki", "kd", "offset"],
        &lines,
    ));
    out.push('\n');
    let lines: Vec<Vec<String>> = json
        .runs
        .iter()
        .enumerate()
        .map(|(k, run)| {
            let figures = [run.tracking, run.drift, run.imbalance, run.work, run.loss];
            std::iter::once((k + 1).to_string())
                .chain(figures.map(|x| table::figure_of(3, x)))
                .collect()
        })
        .collect();
    let head = [
        "run",
        "off the motion",
        "loops open by",
        "imbalance J",
        "work J",
        "friction J",
    ];
    out.push_str(&table::columns(&head, &lines));
    out
}

impl From<TuningError> for Failure {
    fn from(error: TuningError) -> Self {
        match error {
            TuningError::NotPositiveDefinite => Self::Numeric(format!(
                "{error}; correct `bodies:` of the spec, or --parameters"
            )),
            TuningError::NotActuated { .. } => Self::Input(format!("--pid: {error}")),
            TuningError::Model(error) => error.into(),
            other => Self::Numeric(other.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_numbered_before_the_extension() {
        let name = |out: &str, runs| numbered(Path::new(out), 2, runs);
        assert_eq!(name("a/log.csv", 5), Path::new("a/log-3.csv"));
        assert_eq!(name("a/log.csv", 1), Path::new("a/log.csv"));
        assert_eq!(name("log", 5), Path::new("log-3"));
    }
}
