//! The statistics of the logs that were read, and of the equations that were left out.

use regen_codegen::explain::lines::field;
use regen_identify::choice::{Candidate, Choice};
use regen_identify::data::FileReport;
use regen_identify::identify::LeftOut;
use regen_identify::text::figure_of;
use serde::Serialize;

/// The most parts of logs that are named.
const SHOWN_PARTS: usize = 3;

/// The statistics of one log that was read, as they are serialised.
#[derive(Clone, Debug, Serialize)]
pub struct LogFile {
    file: String,
    rows: usize,
    step: f64,
    states: usize,
    problems: Vec<String>,
    dropped: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    gaps: Option<Gaps>,
}

/// The gaps and dropouts of a log: how many were bridged, with how many rows, and how many divide the
/// log.
#[derive(Clone, Copy, Debug, Serialize)]
struct Gaps {
    bridged: usize,
    rows: usize,
    cuts: usize,
    /// The longest time that is bridged, s.
    longest: f64,
}

impl Gaps {
    fn of(report: &FileReport) -> Option<Self> {
        let own = report.bridged;
        (own.count > 0 || own.cuts > 0).then_some(Self {
            bridged: own.count,
            rows: own.rows,
            cuts: own.cuts,
            longest: own.longest,
        })
    }
}

impl LogFile {
    /// The statistics of a log, from the report of its reader.
    pub fn new(report: &FileReport) -> Self {
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
                .left_out(&report.policies)
                .iter()
                .map(|(_, count)| count)
                .sum(),
            gaps: Gaps::of(report),
        }
    }
}

/// The filter that was chosen and why, as lines of text; empty where none was.
pub fn filter_text(choice: Option<&Choice>) -> String {
    let Some(choice) = choice else {
        return String::new();
    };
    let grid = choice.resample.map_or_else(String::new, |rate| {
        format!(", on an even grid of {rate} Hz")
    });
    let reason = match choice.candidates.len() {
        0 => "chosen by noise of the motion alone: too few equations".to_owned(),
        count => format!("the mean of {count} cutoffs by their errors:"),
    };
    let filter = format!(
        "--butterworth {},{} --decimate {}{grid}",
        choice.order, choice.cutoff, choice.decimation
    );
    let mut out = String::new();
    if let Some(own) = &choice.series {
        let series = share(own.series);
        let filtered = own.filtered.map_or_else(
            || "too few equations to tell".to_owned(),
            |percent| format!("{} %", share(percent)),
        );
        let (used, other) = if own.is_used {
            let used = format!("--fourier {},{}", own.frequency, own.harmonics);
            (used, format!("the best filter, {filter}, {filtered}"))
        } else {
            ("a filter".to_owned(), format!("a filter {filtered}"))
        };
        out.push_str(&field(
            "series",
            &format!(
                "{used}: the motion repeats itself{}, and its series leaves an error of {series} % of the \
                 efforts, {other}",
                parts_text(&own.parts)
            ),
        ));
        if own.is_used {
            return out + &alternatives_text(choice);
        }
    }
    out.push_str(&field("filter", &format!("{filter}, {reason}")));
    let line = |own: &Candidate| {
        let far = if own.apart > 0.0 {
            format!(", and is {} % from that of lower ones", share(own.apart))
        } else {
            String::new()
        };
        format!(
            "{} Hz: noise leaves {} % of the efforts unknown and biases {} %{far}",
            own.cutoff,
            share(own.deviation),
            share(own.bias)
        )
    };
    let far = |own: &Candidate| (own.cutoff / choice.cutoff).max(choice.cutoff / own.cutoff);
    let places = choice.candidates.iter().enumerate();
    let place = places
        .min_by(|a, b| far(a.1).total_cmp(&far(b.1)))
        .map(|(k, _)| k);
    let last = choice.candidates.len().saturating_sub(1);
    let first = (place != Some(0)).then_some(0);
    let mut shown: Vec<usize> = first.into_iter().chain(place).collect();
    if place != Some(last) {
        shown.push(last);
    }
    for own in shown.into_iter().filter_map(|k| choice.candidates.get(k)) {
        out.push_str(&field("", &line(own)));
    }
    out + &alternatives_text(choice)
}

/// The parts of logs in which the motion repeats itself, in words; empty where it does in whole logs.
fn parts_text(parts: &[[f64; 2]]) -> String {
    let mut texts: Vec<String> = parts
        .iter()
        .map(|[start, end]| format!("{} to {} s", share(*start), share(*end)))
        .collect();
    if texts.len() > SHOWN_PARTS {
        texts.truncate(SHOWN_PARTS);
        texts.push("...".to_owned());
    }
    if texts.is_empty() {
        return String::new();
    }
    format!(" from {}", texts.join(", "))
}

/// The velocities and the loss that were chosen and why, as lines of text.
fn alternatives_text(choice: &Choice) -> String {
    let mut out = String::new();
    if let Some(own) = choice.velocities {
        let (measured, computed) = (share(own.measured), share(own.computed));
        let used = if own.are_computed {
            "computed from the positions"
        } else {
            "measured"
        };
        out.push_str(&field(
            "velocities",
            &format!(
                "{used}: measured ones leave an error of {measured} % of the efforts, computed ones \
                 {computed} %"
            ),
        ));
    }
    if let Some(own) = choice.loss {
        let (squares, bounded) = (share(own.squares), share(own.bounded));
        let used = own.huber.map_or_else(
            || "squares".to_owned(),
            |bound| format!("--huber {bound}, residuals have heavy tails"),
        );
        out.push_str(&field(
            "loss",
            &format!(
                "{used}: squares leave an error of {squares} % of the efforts, Huber's loss {bounded} %"
            ),
        ));
    }
    out
}

/// A part in percent, with two digits.
fn share(percent: f64) -> String {
    figure_of(2, percent)
}

/// The share of equations that were left out because their coordinates were at rest, as a
/// line of text; empty where there were none.
pub fn resting(left: &LeftOut) -> String {
    let rest: usize = left.resting.iter().sum();
    let all = left.samples * left.resting.len();
    if rest == 0 || all == 0 {
        return String::new();
    }
    let share = 100.0 * rest as f64 / all as f64;
    field(
        "at rest",
        &format!("{share:.2} % of the equations left out"),
    )
}
