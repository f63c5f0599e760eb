//! The filter that is chosen from the logs where no option names one.

use regen_codegen::diag::Source;
use regen_experiment::instruments::instrumental;
use regen_identify::IdentifiedModel;
use regen_identify::choice::Choice;
use regen_identify::data::{Decision, FileReport, Run};
use regen_identify::files::ParameterFile;
use regen_identify::session::{LeastSquaresStart, OpenChoices, Session, chosen, from_logs};
use regen_identify::signals::Method;
use regen_identify::status::{EffortContributions, Status};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_report::results::{BiasRemedy, stem};

use crate::args::{DelayArg, IdentifyArgs, ReadingArgs, VelocitiesArg};
use crate::exit::Failure;

use crate::{identify, load, loads, observe};

/// The most rows of a log from which instrumental variables are tried as a remedy.
const MAX_TRIED_ROWS: usize = 1 << 17;

/// Whether neither an option nor the experiment file says how positions are differentiated.
pub(crate) fn is_open(reading: &ReadingArgs) -> bool {
    observe::settings(reading).method_by == Decision::Open
}

/// What the options leave to be chosen beside the filter.
///
/// - `loss`: whether the command solves by the loss of least squares or Huber's.
pub(crate) fn open(reading: &ReadingArgs, loss: bool) -> OpenChoices {
    OpenChoices {
        delays: reading.delay.is_empty() && observe::settings(reading).delays.is_empty(),
        loss,
        series: true,
    }
}

/// Chooses from the logs how they are read where no filter is given, sets the options that pin it, and cuts the
/// logs to what is read of them; returns the choice.
pub(crate) fn made(
    reading: &mut ReadingArgs,
    session: &Session<'_, Interpreted<'_>>,
    logs: &mut Vec<Run>,
    open: OpenChoices,
) -> Result<Option<Choice>, Failure> {
    if !is_open(reading) || logs.is_empty() {
        return Ok(None);
    }
    let choice = chosen(session, logs, open)?;
    if let Some(choice) = &choice {
        pin(choice, reading);
        *logs = choice.runs(logs);
    }
    Ok(choice)
}

/// The choice by which parameters were identified, if options leave it open and these are all of their logs.
pub(crate) fn of_its_logs<'f>(
    reading: &ReadingArgs,
    found: &'f IdentifiedModel,
    logs: &[Run],
) -> Option<&'f Choice> {
    let choice = found.provenance.filter.as_ref()?;
    let runs = choice.runs(logs).into_iter();
    let mut names: Vec<String> = runs.map(|run| stem(&run.to_string())).collect();
    names.sort();
    (is_open(reading) && names == found.provenance.logs).then_some(choice)
}

/// Sets the options that read logs as those of parameters were read, as far as options leave that open; where
/// none was chosen for them, one is chosen from these logs. Returns the choice where its filter is used.
pub(crate) fn repeat_or_make(
    reading: &mut ReadingArgs,
    model: &Interpreted<'_>,
    found: &IdentifiedModel,
    logs: &mut Vec<Run>,
) -> Result<Option<Choice>, Failure> {
    let Some(choice) = &found.provenance.filter else {
        let session = observe::session(model, reading).in_amperes();
        let open = OpenChoices {
            delays: found.gains.is_empty() && open(reading, false).delays,
            ..OpenChoices::default()
        };
        return made(reading, &session, logs, open);
    };
    if is_open(reading) {
        // these logs may have another motion
        let choice = choice.without_series();
        pin(&choice, reading);
        return Ok(Some(choice));
    }
    // the drives are as late behind any filter
    pin_delays(choice, reading);
    Ok(None)
}

/// Chooses how the logs of a fit of unknown gains and payloads are read, from the runs without a payload or, where
/// all carry one, from those with the same, as part of the body that carries it.
///
/// - `gains`: those of a fit, with which currents count as efforts; without them currents of unknown gain
///   count in A. They then do not share parameters as the equations do, so that what looks like delays is none.
pub(crate) fn made_without_loads(
    args: &mut IdentifyArgs,
    source: &Source,
    gains: Option<&IdentifiedModel>,
) -> Result<Option<Choice>, Failure> {
    let robot = load::unloaded_with_base(source)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let carried = |run: &Run| loads::of_run(&args.reading, run);
    let wanted = args.logs.iter().map(carried).min().flatten();
    let mut runs = args.logs.clone();
    runs.retain(|run| carried(run) == wanted);
    let own = args.clone();
    let mut session = identify::session(&own, &model);
    session.reading = session
        .reading
        .with_gains(&gains.map(loads::gains).unwrap_or_default());
    let experiment = args.reading.experiment.as_ref();
    let is_scaled = gains.is_some() || experiment.is_none_or(|own| own.unknown_gains.is_empty());
    // runs with a payload need not repeat the motion of those without
    let open = OpenChoices {
        delays: is_scaled && open(&args.reading, false).delays,
        ..OpenChoices::default()
    };
    made(&mut args.reading, &session, &mut runs, open)
}

/// Sets the options of reading that pin a choice; a decimation, an even grid or delays that are given stay.
pub(crate) fn pin(choice: &Choice, reading: &mut ReadingArgs) {
    let settings = observe::settings(reading);
    reading.found.filter = true;
    match choice.method() {
        Method::Fourier {
            frequency,
            harmonics,
        } => reading.fourier = Some((frequency, harmonics)),
        _ => reading.butterworth = Some((choice.cutoff, choice.order)),
    }
    if settings.decimation == 1 {
        reading.decimate = Some(choice.equation_decimation());
    }
    reading.resample = settings.resample.or(choice.resample);
    if settings.measured_rates.is_none() && choice.velocities.is_some_and(|own| own.are_computed) {
        reading.velocities = Some(VelocitiesArg::Computed);
    }
    pin_delays(choice, reading);
}

/// Sets the delays of a choice, unless delays are given.
pub(crate) fn pin_delays(choice: &Choice, reading: &mut ReadingArgs) {
    if open(reading, false).delays && !choice.delays.is_empty() {
        let delays = choice.delays.iter().cloned();
        reading.delay = delays.map(|(name, s)| DelayArg::Of(name, s)).collect();
        reading.found.delays = true;
    }
}

/// What leaves fewer values biased than the result of least squares does, tried on the same logs: corrected
/// delays, the filter that would be chosen in place of a given one, else instrumental variables, for which the
/// middles of long logs suffice; `None` where no value is biased.
///
/// - `start`, `file`: the result of least squares, and its values with their statuses;
/// - `filter`: the one that was chosen, `None` where it was given; `on_time`: the options with corrected delays,
///   where they are not.
pub(crate) fn bias_remedy(
    (args, model): (&IdentifyArgs, &Interpreted<'_>),
    (start, file): (&LeastSquaresStart, &ParameterFile),
    filter: Option<&Choice>,
    on_time: Option<&IdentifyArgs>,
) -> Result<Option<BiasRemedy>, Failure> {
    let before = biased(file);
    if before == 0 || args.logs.is_empty() {
        return Ok(None);
    }
    let session = identify::session(args, model);
    let left = |other: &IdentifyArgs| -> Result<usize, Failure> {
        let session = identify::session(other, model);
        let start = from_logs(&session, &mut session.open(&other.logs)?)?;
        let shares = EffortContributions::of(&start.factor);
        let found = start.model();
        let file = ParameterFile::new(model, &found, &shares, Vec::new(), args.confidence)?;
        Ok(biased(&file))
    };
    if let Some(other) = on_time {
        let after = left(other)?;
        if after < before {
            return Ok(Some(BiasRemedy {
                options: "--delay auto".to_owned(),
                unchanged: after,
            }));
        }
    }
    if filter.is_none()
        && let Some(choice) = chosen(&session, &args.logs, OpenChoices::default())?
    {
        let mut other = args.clone();
        (other.reading.local, other.reading.fourier) = (None, None);
        (other.reading.no_filter, other.reading.decimate) = (false, None);
        pin(&choice, &mut other.reading);
        let after = left(&other)?;
        if after < before {
            return Ok(Some(BiasRemedy {
                options: format!(
                    "--butterworth {},{} --decimate {}",
                    choice.order, choice.cutoff, choice.decimation
                ),
                unchanged: after,
            }));
        }
    }
    let (middles, part) = middles(&args.logs, &start.reports);
    let found = instrumental(&session, start, &middles, None).ok();
    let found = found.filter(|own| own.instrumental.converged);
    let closer = found.map_or(0, |own| {
        let pairs = file.parameters.iter().zip(&own.model.intervals.base);
        let closer = pairs.filter(|(row, interval)| {
            // those of all rows are smaller by the root of their number
            let is_closer = |sigma: f64| part.sqrt() * sigma < row.sigma;
            row.status == Status::Biased && interval.is_some_and(|own| is_closer(own.sigma))
        });
        closer.count()
    });
    let options = if 2 * closer > before { "--iv" } else { "" };
    Ok(Some(BiasRemedy {
        options: options.to_owned(),
        unchanged: before - closer,
    }))
}

/// The logs, of each long one its middle only, and the part of all rows that these have.
fn middles(runs: &[Run], reports: &[FileReport]) -> (Vec<Run>, f64) {
    let mut out = runs.to_vec();
    let (mut kept, mut all) = (0, 0);
    for (run, report) in out.iter_mut().zip(reports) {
        let rows = report.rows.min(MAX_TRIED_ROWS);
        (kept, all) = (kept + rows, all + report.rows);
        if rows < report.rows {
            let middle = f64::midpoint(report.missing.start, report.missing.end);
            let half = 0.5 * rows as f64 * report.step;
            run.times = Some((middle - half, middle + half));
        }
    }
    (out, kept as f64 / all.max(1) as f64)
}

/// How many values of a file are biased.
fn biased(file: &ParameterFile) -> usize {
    let rows = file.parameters.iter();
    rows.filter(|row| row.status == Status::Biased).count()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn of_a_long_log_the_middle_is_tried_and_a_short_one_as_it_is() {
        let report = |rows: usize| {
            let mut own = FileReport {
                rows,
                step: 0.5,
                ..FileReport::default()
            };
            (own.missing.start, own.missing.end) = (7.0, 7.0 + 0.5 * rows as f64);
            own
        };
        let runs: Vec<Run> = ["a.csv", "b.csv"]
            .map(|name| Run::from(Path::new(name)))
            .into();
        let (cut, part) = middles(&runs, &[report(100), report(3 * MAX_TRIED_ROWS)]);
        assert_eq!(cut[0].times, None);
        let [from, to] = cut[1].times.map(|own| [own.0, own.1]).unwrap();
        let rows = MAX_TRIED_ROWS as f64;
        assert_eq!([from, to], [7.0 + 0.5 * rows, 7.0 + rows]);
        assert_eq!(part, (100.0 + rows) / (100.0 + 3.0 * rows));
    }
}
