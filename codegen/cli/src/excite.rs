//! `regen excite`: exciting trajectories.

use std::sync::atomic::Ordering;

use indicatif::ProgressBar;
use regen_experiment::excite::{
    Criterion, ExciteError, Monitor, Outcome, Progress, Settings, excite,
};
use regen_experiment::simulate::missing_values;
use regen_report::results::{Excited, excited_text};
use regen_runtime::Info;

use crate::args::{CriterionArg, ExciteArgs, Format};
use crate::exit::Failure;
use crate::{choose, interrupt, load, observe, progress, table, terminal, write};
use regen_interpreted::{BaseTerms, Interpreted};

/// The least pivot of A_e where none is given.
const MARGIN: f64 = 0.05;

/// Runs the command.
pub(crate) fn run(args: &ExciteArgs) -> Result<(), Failure> {
    if let (Some(poses), Some(file)) = (args.calibrate, &args.measure) {
        return choose::run(args, poses, file, args.margin.unwrap_or(MARGIN));
    }
    let robot = load::loaded_derived(&load::source(&args.file)?, args.payload)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    observe::require_base(&model, &robot.name)?;
    let info = model.info();
    let settings = settings(args, &info)?;
    require_used(args, &info, settings.nominal.is_some())?;
    let limited = settings.limits.iter().any(|limit| limit.effort.is_some());
    if limited && settings.nominal.is_none() {
        let mut values = info.nominal.to_vec();
        values.resize(info.parameters.len(), None);
        let missing = missing_values(&info, &values);
        terminal::note(&format!(
            "efforts are not limited: the spec lacks {} nominal values, of {}",
            missing.len(),
            missing.join(", ")
        ));
    } else if limited && info.actuated.len() != info.dof() {
        terminal::note(
            "efforts are not limited: actuators share them, for there are more than one each",
        );
    }
    if args.out.is_none() && args.format == Format::Human {
        terminal::note("note: the trajectory is not written: give --out FILE");
    }
    let stop = interrupt::flag();
    let bar = progress::bar(1, "{bar:24} {percent} %{left}{msg}");
    let report = |progress: Progress| show(&bar, progress);
    let watch = Monitor {
        stop: &stop,
        report: &report,
    };
    let outcome = excite(&model, &model, &settings, watch);
    bar.finish_and_clear();
    let interrupted = stop.load(Ordering::Relaxed);
    let found = match outcome? {
        Outcome::Found(found) => found,
        Outcome::Infeasible { .. } | Outcome::NotClosed if interrupted => {
            return Err(Failure::Interrupted(
                "interrupted before a trajectory was found that keeps every limit".to_owned(),
            ));
        }
        Outcome::Infeasible {
            limit,
            excess,
            time,
        } => {
            return Err(Failure::Numeric(format!(
                "no trajectory keeps every limit: {limit} is passed by {:.2} % of half its range \
                 at {time:.3} s; widen it, or take more --starts",
                100.0 * excess
            )));
        }
        Outcome::NotClosed => {
            return Err(Failure::Numeric(
                "the loops cannot be closed along any start: narrow the ranges of positions"
                    .to_owned(),
            ));
        }
        Outcome::Stopped => {
            return Err(Failure::Interrupted(
                "interrupted before a trajectory was found".to_owned(),
            ));
        }
    };
    let trajectory = found.trajectory(&info);
    if let Some(out) = &args.out {
        write::atomically(out, &trajectory.text())?;
    }
    terminal::print(&match args.format {
        Format::Json => {
            let excited = Excited::new(&trajectory, &found, args.seed, interrupted);
            table::document(&excited)
        }
        Format::Human => excited_text(&trajectory, &found),
    })?;
    for (name, part) in found.slow() {
        let remedy = match settings.criterion {
            Criterion::ScaledCondition => {
                "; scaled columns do not depend on how far joints move, --criterion determinant does"
            }
            _ => "",
        };
        terminal::note(&format!(
            "note: {name} comes to {} % of its limits of velocity, so that noise may hide what it \
             shows{remedy}",
            table::figure_of(2, 100.0 * part)
        ));
    }
    match &args.out {
        Some(out) if interrupted => Err(Failure::Interrupted(format!(
            "interrupted: the best so far is written to {}",
            out.display()
        ))),
        None if interrupted => Err(Failure::Interrupted(
            "interrupted: this is the best so far; without --out it is not written".to_owned(),
        )),
        Some(out) => {
            terminal::note(&format!("{}: written", out.display()));
            Ok(())
        }
        None => Ok(()),
    }
}

fn settings(args: &ExciteArgs, info: &Info<'_>) -> Result<Settings, Failure> {
    let mut settings = Settings {
        harmonics: args.harmonics,
        frequency: args.frequency,
        samples: args.samples,
        criterion: match args.criterion {
            CriterionArg::Scaled => Criterion::ScaledCondition,
            CriterionArg::Condition => Criterion::Condition,
            CriterionArg::Determinant => Criterion::Determinant,
            CriterionArg::Smallest => Criterion::SmallestSingular,
        },
        at_rest: args.at_rest,
        singular_margin: args.margin.unwrap_or(MARGIN),
        seed: args.seed,
        starts: args.starts,
        threads: args.threads,
        steps: args.steps,
        ..Settings::of(info)
    };
    for given in &args.limit {
        let place = info.index_of(&given.coordinate);
        let Some(limits) = place.and_then(|c| settings.limits.get_mut(c)) else {
            return Err(Failure::Input(format!(
                "--limit: there is no coordinate {}; there are {}",
                given.coordinate,
                info.coordinates.join(" ")
            )));
        };
        let slot = match given.quantity.as_str() {
            "position" => &mut limits.position,
            "velocity" => &mut limits.velocity,
            "acceleration" => &mut limits.acceleration,
            "jerk" => &mut limits.jerk,
            _ => &mut limits.effort,
        };
        *slot = Some(given.range);
    }
    for given in &args.cone {
        let place = info.cones.iter().position(|cone| cone.name == given.name);
        let Some(slot) = place.and_then(|k| settings.cones.get_mut(k)) else {
            let names: Vec<&str> = info.cones.iter().map(|cone| cone.name).collect();
            return Err(Failure::Input(format!(
                "--cone: the spec states no cone of {}; it does of {}",
                given.name,
                if names.is_empty() {
                    "none".to_owned()
                } else {
                    names.join(" ")
                }
            )));
        };
        *slot = given.angle;
    }
    Ok(settings)
}

/// Refuses limits that the search does not regard.
fn require_used(args: &ExciteArgs, info: &Info<'_>, has_nominal: bool) -> Result<(), Failure> {
    // trees have no singularities of closure
    if args.margin.is_some() && info.dof() == info.coordinates.len() {
        let text = "--margin has no effect here: the robot has no loops, and so no pivots of A_e";
        return Err(Failure::Usage(text.to_owned()));
    }
    let mut efforts = args.limit.iter().filter(|own| own.quantity == "effort");
    let Some(first) = efforts.next() else {
        return Ok(());
    };
    let is_driven = |name: &str| {
        info.index_of(name)
            .is_some_and(|c| info.actuated.contains(&c))
    };
    let passive = std::iter::once(first)
        .chain(efforts)
        .find(|own| !is_driven(&own.coordinate));
    let why = if let Some(own) = passive {
        format!("{} has no motor", own.coordinate)
    } else if !has_nominal {
        "efforts follow from nominal values, of which the spec lacks some".to_owned()
    } else if info.actuated.len() != info.dof() {
        "actuators share the efforts, for there are more than one each".to_owned()
    } else {
        return Ok(());
    };
    let name = &passive.unwrap_or(first).coordinate;
    Err(Failure::Input(format!(
        "--limit {name}.effort has no effect here: {why}"
    )))
}

fn show(bar: &ProgressBar, progress: Progress) {
    bar.set_length(progress.of as u64);
    bar.set_position(progress.done as u64);
    if let Some(best) = progress.best {
        bar.set_message(format!(", best {best:.2}"));
    }
}

impl From<ExciteError> for Failure {
    fn from(error: ExciteError) -> Self {
        Self::Input(match &error {
            ExciteError::Unbounded { coordinate } => {
                format!("{error}, or give --limit {coordinate}.position=LOWEST,HIGHEST")
            }
            _ => error.to_string(),
        })
    }
}
