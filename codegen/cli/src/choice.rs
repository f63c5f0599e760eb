//! The filter that is chosen from the logs where no option names one.

use regen_codegen::diag::Source;
use regen_experiment::instruments::instrumental;
use regen_identify::data::Run;
use regen_identify::files::ParameterFile;
use regen_identify::session::{Choice, Session, chosen, from_logs};
use regen_identify::status::{EffortContributions, Status};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_report::results::BiasRemedy;

use crate::args::{IdentifyArgs, ReadingArgs, VelocitiesArg};
use crate::exit::Failure;

use crate::{identify, load, loads, observe};

/// Whether neither an option nor the experiment file says how positions are differentiated.
pub(crate) fn is_open(reading: &ReadingArgs) -> bool {
    !observe::settings(reading).is_method_given
}

/// Chooses a filter from the logs where none is given, and sets the options that pin it; returns the
/// choice.
pub(crate) fn made(
    reading: &mut ReadingArgs,
    session: &Session<'_, Interpreted<'_>>,
    logs: &[Run],
) -> Result<Option<Choice>, Failure> {
    if !is_open(reading) || logs.is_empty() {
        return Ok(None);
    }
    let choice = chosen(session, logs)?;
    if let Some(choice) = &choice {
        pin(choice, reading);
    }
    Ok(choice)
}

/// Chooses a filter for a fit of unknown gains and payloads, from the runs without a payload where there
/// are some, and with the robot alone: currents of unknown gain count in A, and a payload as part of the
/// body that carries it.
pub(crate) fn made_without_loads(
    args: &mut IdentifyArgs,
    source: &Source,
) -> Result<Option<Choice>, Failure> {
    let robot = load::unloaded_with_base(source)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let runs = args.logs.iter();
    let alone = runs.filter(|run| loads::of_run(&args.reading, run).is_none());
    let mut runs: Vec<Run> = alone.cloned().collect();
    if runs.is_empty() {
        runs.clone_from(&args.logs);
    }
    let session = identify::session(&args.clone(), &model).in_amperes();
    made(&mut args.reading, &session, &runs)
}

/// Sets the options that pin a choice; a decimation or an even grid that is given stays.
pub(crate) fn pin(choice: &Choice, reading: &mut ReadingArgs) {
    let settings = observe::settings(reading);
    reading.butterworth = Some((choice.cutoff, choice.order));
    if settings.decimation == 1 {
        reading.decimate = Some(choice.decimation);
    }
    reading.resample = settings.resample.or(choice.resample);
    if settings.measured_rates.is_none() && choice.velocities.is_some_and(|own| own.are_computed) {
        reading.velocities = Some(VelocitiesArg::Computed);
    }
}

/// What leaves fewer values biased than the result of least squares does, tried on the same logs: the
/// filter that would be chosen in place of a given one, else instrumental variables; `None` where no value
/// is biased.
///
/// - `filter`: the one that was chosen, `None` where it was given.
pub(crate) fn bias_remedy(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    file: &ParameterFile,
    filter: Option<&Choice>,
) -> Result<Option<BiasRemedy>, Failure> {
    let before = biased(file);
    if before == 0 || args.logs.is_empty() {
        return Ok(None);
    }
    let session = identify::session(args, model);
    if filter.is_none()
        && let Some(choice) = chosen(&session, &args.logs)?
    {
        let mut other = args.clone();
        (other.reading.local, other.reading.fourier) = (None, None);
        (other.reading.no_filter, other.reading.decimate) = (false, None);
        pin(&choice, &mut other.reading);
        let session = identify::session(&other, model);
        let start = from_logs(&session, &mut session.open(&other.logs)?)?;
        let shares = EffortContributions::of(&start.factor);
        let found = start.model();
        let other = ParameterFile::new(model, &found, &shares, Vec::new(), args.confidence)?;
        let after = biased(&other);
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
    let start = from_logs(&session, &mut session.open(&args.logs)?)?;
    let found = instrumental(&session, &start, &args.logs, None).ok();
    let found = found.filter(|own| own.instrumental.converged);
    let closer = found.map_or(0, |own| {
        let pairs = file.parameters.iter().zip(&own.model.intervals.base);
        let closer = pairs.filter(|(row, interval)| {
            row.status == Status::Biased && interval.is_some_and(|own| own.sigma < row.sigma)
        });
        closer.count()
    });
    let options = if 2 * closer > before { "--iv" } else { "" };
    Ok(Some(BiasRemedy {
        options: options.to_owned(),
        unchanged: before - closer,
    }))
}

/// How many values of a file are biased.
fn biased(file: &ParameterFile) -> usize {
    let rows = file.parameters.iter();
    rows.filter(|row| row.status == Status::Biased).count()
}
