//! `regen validate`: predicts the forces of logs from identified parameters.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use regen_identify::IdentifiedModel;
use regen_identify::choice::Choice;
use regen_identify::data::Run;
use regen_identify::estimate::EffortError;
use regen_identify::files::Predictions;
use regen_identify::identify::{self, LeftOut};
use regen_report::results::{corrected_delays_text, error_percent, filter_text, resting, stem};
use serde::Serialize;

use crate::args::{Format, ValidateArgs};
use crate::exit::Failure;
use crate::suspect::OtherSpecs;
use crate::{
    choice, delay, experiment, load, loads, observe, parameters, suspect, table, terminal, write,
};
use regen_interpreted::{BaseTerms, Interpreted};

/// With larger errors, percent, the columns of a log are looked at.
const DOUBTED_PERCENT: f64 = 10.0;

/// The JSON of `regen validate`.
#[derive(Serialize)]
struct ValidateJson {
    robot: String,
    kind: String,
    logs: Vec<String>,
    /// The filter that was chosen, for the parameters or from these logs.
    #[serde(skip_serializing_if = "Option::is_none")]
    filter: Option<Choice>,
    /// The delays of efforts that were found and corrected, s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    corrected_delays: Vec<(String, f64)>,
    /// The logs with columns that are not used, and their titles.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    unused: Vec<Unused>,
    models: Vec<Predicted>,
}

/// The titles of columns of a log that are not used.
#[derive(Serialize)]
struct Unused {
    file: String,
    columns: Vec<String>,
}

/// Says which of the logs the parameters were identified from, as far as names tell.
fn note_known_logs(path: &Path, found: &IdentifiedModel, logs: &[Run]) {
    let names = logs.iter().map(|run| stem(&run.to_string()));
    let known = names.filter(|name| found.provenance.logs.contains(name));
    let known: Vec<String> = known.collect();
    if !known.is_empty() {
        terminal::note(&format!(
            "note: {} names {} among the logs that it was identified from: errors on them validate nothing",
            path.display(),
            known.join(", ")
        ));
    }
}

/// The prediction errors of one set of parameters on all logs.
#[derive(Serialize)]
struct Predicted {
    params: String,
    logs: Vec<LogError>,
}

#[derive(Serialize)]
struct LogError {
    relative_absolute: f64,
    /// The root mean square of the residuals in percent of that of the efforts.
    relative_rms: f64,
    left_out: LeftOut,
    efforts: Vec<EffortError>,
}

/// Runs the command.
pub(crate) fn run(args: &ValidateArgs) -> Result<(), Failure> {
    let source = load::source(&args.file)?;
    let mut args = args.clone();
    let planned = experiment::resolve_loaded(&mut args.logs, &mut args.reading, &source)?;
    if !planned.is_empty() {
        args.logs = planned;
    } else if args.reading.experiment.is_some() {
        terminal::note(
            "note: no run of the experiment file has `use: validate`: the logs of the command line \
             are predicted, or all runs if there are none",
        );
    }
    let robot = loads::derived_for(&source, &args.reading, &args.params)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    observe::require_base(&model, &robot.name)?;
    let first = parameters::read(&args.params, &model)?;
    let filter = choice::repeat_or_make(&mut args.reading, &model, &first, &mut args.logs)?;
    let (reading, corrected_delays) =
        delay::with_found_delays_of_model(&args.reading, &model, &args.logs)?;
    args.reading = reading;
    let kind = observe::kind(&args.reading);
    let files: Vec<&PathBuf> = std::iter::once(&args.params).chain(&args.beside).collect();
    let mut models = Vec::with_capacity(files.len());
    for path in files {
        let found = parameters::read(path, &model)?;
        loads::require_gains(&args.reading, &found, path)?;
        note_known_logs(path, &found, &args.logs);
        models.push((
            found,
            Predicted {
                params: path.display().to_string(),
                logs: Vec::new(),
            },
        ));
    }
    let mut predictions = args
        .predict
        .as_ref()
        .map(|_| Predictions::new(&model, kind));
    // the efforts of currents with found gains, and those of payloads, are compared with no nominal bodies
    let has_gains = models.iter().any(|(found, _)| !found.gains.is_empty());
    let is_plain = !has_gains && robot.payloads.is_empty();
    let mut reports = Vec::new();
    for run in &args.logs {
        let Some((first, _)) = models.first() else {
            break;
        };
        let mut log = loads::open(&model, run, &args.reading, first)?;
        let (set, left_out) = identify::observe(&model, kind, &mut log)?;
        let mut means = set.means();
        observe::note_doubts(log.logs().reports());
        reports.extend_from_slice(log.logs().reports());
        if observe::all_rest(&left_out) {
            terminal::note(&format!(
                "{}: all {} samples rest, and equations at rest are left out: nothing is \
                 predicted. --standstill keep predicts them",
                run, left_out.samples
            ));
        }
        for (k, (identified, predicted)) in models.iter_mut().enumerate() {
            // currents have the gains of each model
            if k > 0 && !identified.gains.is_empty() {
                log = loads::open(&model, run, &args.reading, identified)?;
                means = identify::observe(&model, kind, &mut log)?.0.means();
            }
            let own = loads::model_of(&robot, &model, &args.reading, run, identified)?;
            let found = own.residuals(&model, kind, &mut log, &means, 1)?;
            predicted.logs.push(LogError {
                relative_absolute: found.relative_absolute(),
                relative_rms: found.relative_rms(),
                left_out: left_out.clone(),
                efforts: found.efforts(),
            });
        }
        // columns that are read wrongly are no fault of the parameters
        let errors = models.iter().filter_map(|own| own.1.logs.last());
        let least = errors.fold(f64::INFINITY, |m, own| m.min(own.relative_absolute));
        if least > DOUBTED_PERCENT && is_plain {
            let specs = OtherSpecs::new(&args.file, args.reading.payload);
            let session = observe::session(&model, &args.reading);
            let runs = std::slice::from_ref(run);
            let _ = suspect::warn_of_logs(&session, runs, log.logs(), &specs);
        }
        if let Some(predictions) = &mut predictions {
            let all: Vec<&IdentifiedModel> = models.iter().map(|(found, _)| found).collect();
            predictions.add(&model, &mut log, &all)?;
        }
    }
    observe::note_files(&reports);
    let unused = reports.into_iter().map(|own| Unused {
        file: own.file,
        columns: own.unused,
    });
    if let (Some(out), Some(predictions)) = (&args.predict, &predictions) {
        write::atomically(out, &predictions.csv())?;
    }
    let json = ValidateJson {
        robot: robot.name.clone(),
        kind: kind.name(),
        logs: args.logs.iter().map(ToString::to_string).collect(),
        filter,
        corrected_delays,
        unused: unused.filter(|own| !own.columns.is_empty()).collect(),
        models: models.into_iter().map(|(_, predicted)| predicted).collect(),
    };
    terminal::print(&match args.format {
        Format::Json => table::document(&json),
        Format::Human => to_text(&json),
    })?;
    if let Some(out) = &args.predict {
        terminal::note(&format!("{}: written", out.display()));
    }
    Ok(())
}

fn to_text(json: &ValidateJson) -> String {
    let mut out = format!("{}, eps_RA in percent\n", json.robot);
    out.push_str(&filter_text(json.filter.as_ref()));
    out.push_str(&corrected_delays_text(&json.corrected_delays));
    // the number of logs whose columns fit on a line
    const BLOCK: usize = 5;
    let names: Vec<String> = json.logs.iter().map(|log| stem(log)).collect();
    for (block, titles) in names.chunks(BLOCK).enumerate() {
        let head: Vec<&str> = std::iter::once("parameters")
            .chain(titles.iter().map(String::as_str))
            .collect();
        let lines: Vec<Vec<String>> = json
            .models
            .iter()
            .map(|m| {
                let logs = m.logs.iter().skip(block * BLOCK).take(BLOCK);
                let figures = logs.map(|l| error_percent(l.relative_absolute));
                std::iter::once(stem(&m.params)).chain(figures).collect()
            })
            .collect();
        out.push_str(&table::columns(&head, &lines));
    }
    for model in &json.models {
        for (log, found) in json.logs.iter().zip(&model.logs) {
            let _ = writeln!(out, "\n  {} on {}", stem(&model.params), stem(log));
            out.push_str(&resting(&found.left_out));
            let lines: Vec<Vec<String>> = found
                .efforts
                .iter()
                .map(|e| {
                    vec![
                        e.name.clone(),
                        e.samples.to_string(),
                        error_percent(e.relative_absolute),
                        error_percent(e.relative_rms),
                        table::figure(e.rms),
                        table::figure(e.largest),
                    ]
                })
                .collect();
            let head = ["effort", "samples", "eps_RA %", "rms %", "rms", "largest"];
            out.push_str(&table::columns(&head, &lines));
        }
    }
    out
}
