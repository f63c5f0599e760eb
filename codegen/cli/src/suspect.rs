//! Warns about logs that were read without an error but look wrong, with the options that would read
//! them correctly.

mod gravity;
#[cfg(test)]
mod tests;

use regen_identify::data::{Assignment, Logs, Run, Settings, ValuesFrom};
use regen_identify::estimate::{EffortError, Estimate};
use regen_identify::session::{Session, errors_with_columns};
use regen_identify::suspect::{self, LogColumns, Remedy, Suspicion};
use regen_interpreted::Interpreted;
use regen_report::results::{self, Suspected};

pub(crate) use gravity::OtherSpecs;

use crate::args::IdentifyArgs;
use crate::{observe, progress, terminal};

/// The cutoff, in the rate of the rows, and the order of the filter where none could be chosen.
const LOW_CUTOFF: f64 = 0.05;
const FILTER_ORDER: usize = 4;
/// Delays that were found explain a log of which they leave no more than this of any effort, percent.
const MAX_LEFT_BY_DELAYS: f64 = 10.0;
/// The factor by which a change must leave less of efforts as they are logged than another one does behind delays.
const MIN_GAIN_OVER_DELAYS: f64 = 1.5;

/// Converts a suspicion of the library to the command's terms: its remedy becomes options.
fn with_options(found: Suspicion) -> Suspected {
    let remedy = match &found.remedy {
        Remedy::Read { advice, columns } => {
            let options: Vec<String> = columns.iter().map(option).collect();
            let options = options.join(" ");
            let mut advice = advice.clone();
            match (advice.is_empty(), columns.is_empty()) {
                (true, _) => advice.push(options),
                (false, false) if columns.iter().all(is_unmeasured) => {
                    advice.push(format!("Leave its equations out with {options}"));
                }
                (false, false) => advice.push(format!("Read it with {options}")),
                (false, true) => {}
            }
            advice.join(". ")
        }
        Remedy::Series => "The frequency is not that of the motion, the harmonics are too few, \
                           or parts of the log are not periodic: give --fourier the motion's \
                           frequency, or use --butterworth"
            .to_owned(),
        Remedy::Bounded => {
            "Give --huber 1.345, which bounds their weight, or leave these rows out".to_owned()
        }
        _ => "The cause may be the sign or the delay of an effort, an offset, or a motion that \
              does not determine it separately; --feasible keeps it at 0 or above"
            .to_owned(),
    };
    Suspected { found, remedy }
}

/// Whether no column is read for an effort.
fn is_unmeasured(to: &Assignment) -> bool {
    to.from == ValuesFrom::Unmeasured
}

/// The option that reads a column with this assignment.
fn option(to: &Assignment) -> String {
    let factor = format!("{:.11e}", to.factor).parse().unwrap_or(to.factor);
    let factor = match factor {
        1.0 => String::new(),
        factor => format!("*{factor}"),
    };
    let offset = match to.offset {
        0.0 => String::new(),
        offset => format!(":offset:{offset}"),
    };
    let late = match to.late {
        0.0 => String::new(),
        late => format!(":late:{late}"),
    };
    format!(
        "--column '{}={}{factor}{offset}{late}'",
        to.quantity, to.column
    )
}

/// Prints and returns the suspected mistakes in each log; does nothing with `--no-suspicion`.
///
/// - `found`: the estimate from all logs, with standard deviations; `None` if there is none.
pub(crate) fn warn(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    logs: &Logs<'_, Interpreted<'_>>,
    found: Option<&Estimate>,
) -> Vec<Suspected> {
    warn_of_more(args, model, logs, (found, &[]))
}

/// As [`warn`], but for what is known already.
fn warn_of_more(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    logs: &Logs<'_, Interpreted<'_>>,
    (found, known): (Option<&Estimate>, &[Suspected]),
) -> Vec<Suspected> {
    if args.no_suspicion {
        return Vec::new();
    }
    let spec = OtherSpecs::new(&args.file, args.reading.payload);
    let session = observe::session(model, &args.reading);
    let mut out = doubts(&session, &args.logs, logs, found, &spec);
    out.retain(|doubt| args.huber.is_none() || doubt.found.remedy != Remedy::Bounded);
    let is_same = |one: &Suspected, other: &Suspected| {
        one.found.file == other.found.file && one.remedy == other.remedy
    };
    out.retain(|doubt| !known.iter().any(|own| is_same(own, doubt)));
    for suspicion in &out {
        terminal::note(&format!("warning: {suspicion}"));
    }
    out
}

/// Prints what looks wrong with logs that another command than `identify` reads, where their efforts are known.
pub(crate) fn warn_of_logs(
    session: &Session<'_, Interpreted<'_>>,
    runs: &[Run],
    logs: &Logs<'_, Interpreted<'_>>,
    specs: &OtherSpecs<'_>,
) -> Vec<Suspected> {
    let out = doubts(session, runs, logs, None, specs);
    for suspicion in &out {
        terminal::note(&format!("warning: {suspicion}"));
    }
    out
}

/// Prints which position contradicts the others in each log, where no filter could be chosen for them.
pub(crate) fn warn_of_contradictions(args: &IdentifyArgs, model: &Interpreted<'_>) {
    let opened = observe::open(model, &args.logs, &args.reading);
    let Some(logs) = opened.ok().filter(|_| !args.no_suspicion) else {
        return;
    };
    let given = observe::settings(&args.reading).columns;
    for (k, report) in logs.logs().reports().iter().enumerate() {
        let columns = LogColumns {
            file: &report.file,
            given: &given,
            model,
        };
        let sample = logs.logs().sample(k).ok();
        if let Some(found) = sample.and_then(|own| suspect::contradiction(&columns, &own)) {
            terminal::note(&format!("warning: {}", with_options(found)));
        }
    }
}

/// Prints what looks wrong with logs for which no filter could be chosen, behind a low one, as columns of
/// wrong signs or units may be why.
///
/// - `known`: what was printed already.
pub(crate) fn warn_without_choice(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    known: &[Suspected],
) -> Vec<Suspected> {
    let mut args = args.clone();
    let opened = observe::open(model, &args.logs, &args.reading).ok();
    let step = opened.and_then(|opened| Some(opened.logs().sample(0).ok()?.step));
    let Some(step) = step.filter(|step| *step > 0.0) else {
        return Vec::new();
    };
    args.reading.fourier = None;
    args.reading.butterworth = Some((LOW_CUTOFF / step, FILTER_ORDER));
    let opened = observe::open(model, &args.logs, &args.reading);
    opened.map_or_else(
        |_| Vec::new(),
        |opened| warn_of_more(&args, model, opened.logs(), (None, known)),
    )
}

/// The suspected mistakes in logs. Without an estimate they are found from the weights and inertias
/// of the nominal bodies.
///
/// - `session`: how the logs are read, with the filter; `runs`: those that `logs` were opened from;
/// - `found`: as for [`warn`];
/// - `specs`: the spec with other values, which are tried on the logs.
pub(crate) fn doubts(
    session: &Session<'_, Interpreted<'_>>,
    runs: &[Run],
    logs: &Logs<'_, Interpreted<'_>>,
    found: Option<&Estimate>,
    specs: &OtherSpecs<'_>,
) -> Vec<Suspected> {
    let (model, given) = (session.model, &session.reading.columns);
    let working = progress::later("checking the columns");
    let mut out = Vec::new();
    for (k, report) in logs.reports().iter().enumerate() {
        // derivatives of separate poses tell nothing of signs, units or rates
        if report.are_poses {
            continue;
        }
        let Ok(sample) = logs.sample(k) else { continue };
        let columns = LogColumns {
            file: &report.file,
            given,
            model,
        };
        let step = &mut |k, n| working.at(k, n);
        let run = runs.get(k);
        let whole = |columns: &[Assignment]| errors_with_columns(session, run?, columns).ok();
        let own = suspect::suspicions(&columns, &sample, found, &whole, step);
        let mut own = gravity::with_spec(&columns, &sample, specs, own);
        if let (true, Some(run)) = (session.reading.are_delays_found, run)
            && least_left(&own).is_none_or(|left| left > MAX_LEFT_BY_DELAYS)
        {
            own = behind_delays(session, run, &columns, specs, own, step);
        }
        out.extend(own.into_iter().map(with_options));
    }
    working.end();
    out
}

/// What is suspected, and where delays were found that leave much of an effort, the columns or the gravity that
/// explain more with efforts as they are logged: delays explain a part of what such mistakes cause, and hide these.
///
/// - `found`: what is suspected of the log with its delays.
fn behind_delays(
    session: &Session<'_, Interpreted<'_>>,
    run: &Run,
    columns: &LogColumns<'_, Interpreted<'_>>,
    specs: &OtherSpecs<'_>,
    found: Vec<Suspicion>,
    step: &mut dyn FnMut(usize, usize),
) -> Vec<Suspicion> {
    let late = errors_with_columns(session, run, &[]).unwrap_or_default();
    if late.iter().all(|own| own.1 < MAX_LEFT_BY_DELAYS) {
        return found;
    }
    let on_time = Session {
        reading: Settings {
            delays: Vec::new(),
            are_delays_found: false,
            ..session.reading.clone()
        },
        ..*session
    };
    let opened = on_time.open(std::slice::from_ref(run));
    let Some(sample) = opened.ok().and_then(|own| own.logs().sample(0).ok()) else {
        return found;
    };
    // a change must explain more than the delays do
    let whole = |columns: &[Assignment]| match columns {
        [] => Some(late.clone()),
        _ => errors_with_columns(&on_time, run, columns).ok(),
    };
    let mut more = suspect::suspicions(columns, &sample, None, &whole, step);
    more.retain(|own| own.remedy.gives_columns() && own.changed.is_some());
    let mut out = gravity::with_spec(columns, &sample, specs, more);
    let explains_more =
        |left: f64| least_left(&out).is_some_and(|own| MIN_GAIN_OVER_DELAYS * own < left);
    if least_left(&found).is_some_and(|left| !explains_more(left)) {
        return found;
    }
    out.extend(found.into_iter().filter(|own| own.left_in_sample.is_none()));
    out
}

/// What the change that explains most leaves of the efforts, percent; `None` if no change is suspected.
fn least_left(found: &[Suspicion]) -> Option<f64> {
    let left = found.iter().filter_map(|own| own.left_in_sample);
    left.reduce(f64::min)
}

/// The errors without those of efforts that are mostly noise, which are told: of them no model explains more.
pub(crate) fn without_noise(
    model: &Interpreted<'_>,
    logs: &Logs<'_, Interpreted<'_>>,
    errors: Vec<EffortError>,
) -> Vec<EffortError> {
    let Ok(found) = suspect::noise_alone(model, logs, errors.clone()) else {
        return errors;
    };
    let texts = [
        results::noise_alone(&found.doubted, false),
        results::noise_alone(&found.expected, true),
    ];
    texts.iter().flatten().for_each(|text| terminal::note(text));
    found.rest
}
