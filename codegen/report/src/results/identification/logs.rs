//! The statistics of the logs that were read, and of the equations that were left out.

use regen_codegen::explain::lines::field;
use regen_identify::choice::{Candidate, Choice};
use regen_identify::data::{Bridged, FileReport, Policies, Policy, Problems, Spikes, Wrapped};
use regen_identify::identify::LeftOut;
use regen_identify::text::{counted, figure_of};
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
    /// The titles of columns that are not read, where no option or file names columns.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    unused: Vec<String>,
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
            unused: report.unused.clone(),
        }
    }
}

/// What was chosen and why, as lines of text; empty where nothing was.
pub fn filter_text(choice: Option<&Choice>) -> String {
    fields(&choice_fields(choice))
}

/// A label and a text beside it; one without a label continues the text before it.
pub(crate) type Field = (&'static str, String);

/// The lines of some fields.
pub(crate) fn fields(all: &[Field]) -> String {
    all.iter().map(|(label, text)| field(label, text)).collect()
}

/// The filter or series, the velocities and the loss that were chosen, with the figures they were chosen by.
pub(crate) fn choice_fields(choice: Option<&Choice>) -> Vec<Field> {
    let Some(choice) = choice else {
        return Vec::new();
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
    let mut out = Vec::new();
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
        let text = format!(
            "{used}: the motion repeats itself{}, and its series leaves an error of {series} % of the efforts, \
             {other}",
            parts_text(&own.parts)
        );
        out.push(("series", text));
        if own.is_used {
            out.extend(alternatives(choice));
            return out;
        }
    }
    out.push(("filter", format!("{filter}, {reason}")));
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
        out.push(("", line(own)));
    }
    out.extend(alternatives(choice));
    out
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

/// The velocities and the loss that were chosen and why.
fn alternatives(choice: &Choice) -> Vec<Field> {
    let mut out = Vec::new();
    if let Some(own) = choice.velocities {
        let (measured, computed) = (share(own.measured), share(own.computed));
        let used = if own.are_computed {
            "computed from the positions"
        } else {
            "measured"
        };
        let text = format!(
            "{used}: measured ones leave an error of {measured} % of the efforts, computed ones {computed} %"
        );
        out.push(("velocities", text));
    }
    if let Some(own) = choice.loss {
        let (squares, bounded) = (share(own.squares), share(own.bounded));
        let used = own.huber.map_or_else(
            || "squares".to_owned(),
            |bound| format!("--huber {bound}, residuals have heavy tails"),
        );
        let text = format!(
            "{used}: squares leave an error of {squares} % of the efforts, Huber's loss {bounded} %"
        );
        out.push(("loss", text));
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

/// What is done with joints that stand still.
pub const LOCK_JOINTS: &str = "joints that never move can be locked, by `regen import --lock` or as `type: fixed` in the spec";
/// What is done with rows that are poses at rest.
pub const READ_AS_POSES: &str = "they jump from row to row as separate poses do, which are read with --poses in place of a \
                                 rate: it identifies the parameters of gravity";

/// What is doubtful in a log, and which of its rows were left out or interpolated: a text for each, without the
/// name of the log.
///
/// ```
/// use regen_identify::data::{FileReport, Wrapped};
/// use regen_report::results::doubts_of_log;
///
/// let mut log = FileReport { rows: 97, ..FileReport::default() };
/// assert_eq!(doubts_of_log(&log), [""; 0]);
/// (log.bridged.count, log.bridged.rows, log.bridged.largest) = (2, 3, 2);
/// let found = doubts_of_log(&log);
/// assert!(found[0].starts_with("2 gaps or dropouts of up to 2 rows were bridged: 3 rows (3.0 %)"), "{found:?}");
/// log.wrapped = vec![("angle".to_owned(), Wrapped { span: 360.0, jumps: 1, added: 0.0 })];
/// assert!(doubts_of_log(&log)[0].contains("column `angle` by 360.000 (once)"));
/// ```
pub fn doubts_of_log(report: &FileReport) -> Vec<String> {
    let mut out = Vec::new();
    if !report.still.is_empty() {
        let still = report.still.join(", ");
        out.push(if report.are_poses {
            format!("without motion: {still}; {READ_AS_POSES}")
        } else {
            format!(
                "without motion: {still}; parameters that only it determines cannot be identified; {LOCK_JOINTS}"
            )
        });
    }
    if let Some((first, last)) = report.uncut {
        out.push(format!(
            "these times leave out no row: those of the log are from {first} s to {last} s; `times` are in s, \
             whatever the unit of the column of time is"
        ));
    }
    if let Some((other, part)) = &report.repeats {
        out.push(format!(
            "{} % of its rows are rows of {other} too: as they count twice, deviations are too small; leave one \
             of them out",
            figure_of(3, 100.0 * part)
        ));
    }
    out.extend(wrapped(report));
    out.extend(spikes(report));
    out.extend(gaps(report));
    for policy in [Policy::Fail, Policy::Drop, Policy::Tell, Policy::Keep] {
        let problems = report.problems.treated(&report.policies, policy);
        out.extend(treated(&problems, policy));
    }
    out
}

/// The most columns that are named.
const SHOWN_COLUMNS: usize = 8;

/// Sentences about how the files of logs are joined, and about columns that are not used, one for all logs with the same
/// ones.
///
/// ```
/// use regen_identify::data::FileReport;
/// use regen_report::results::notes_of_logs;
///
/// let one = |file: &str, unused: &[&str]| FileReport {
///     file: file.to_owned(),
///     unused: unused.iter().map(|own| (*own).to_owned()).collect(),
///     ..FileReport::default()
/// };
/// let found = notes_of_logs(&[one("a.csv", &["current1", "heat"]), one("b.csv", &[]), one("c.csv", &["current1", "heat"])]);
/// let text = "2 columns of a.csv and 1 other log are not used: `current1`, `heat`; `regen inspect` says what they look like";
/// assert_eq!(found, [text]);
/// let text = "1 column of a.csv is not used: `heat`; `regen inspect` says what it looks like";
/// assert_eq!(notes_of_logs(&[one("a.csv", &["heat"])]), [text]);
/// let found = notes_of_logs(&[one("a.csv", &["a", "b", "c", "d", "e", "f", "g", "h", "i", "j"])]);
/// assert!(found[0].contains("`h` and 2 others;"));
/// ```
pub fn notes_of_logs(reports: &[FileReport]) -> Vec<String> {
    let later = reports.iter().filter_map(|own| own.later.clone());
    let mut out: Vec<String> = later.collect();
    for (k, report) in reports.iter().enumerate() {
        let same = |own: &&FileReport| own.unused == report.unused;
        if report.unused.is_empty() || reports.iter().take(k).any(|own| same(&own)) {
            continue;
        }
        let logs = match reports.iter().skip(k + 1).filter(same).count() {
            0 => report.file.clone(),
            others => format!(
                "{} and {}",
                report.file,
                counted(others, "other log", "other logs")
            ),
        };
        let names = report.unused.iter().take(SHOWN_COLUMNS);
        let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
        let more = match report.unused.len().saturating_sub(SHOWN_COLUMNS) {
            0 => String::new(),
            more => format!(" and {}", counted(more, "other", "others")),
        };
        let (verb, looks) = if report.unused.len() == 1 {
            ("is", "it looks")
        } else {
            ("are", "they look")
        };
        out.push(format!(
            "{} of {logs} {verb} not used: {}{more}; `regen inspect` says what {looks} like",
            counted(report.unused.len(), "column", "columns"),
            names.join(", ")
        ));
    }
    out
}

/// Which positions are wrapped.
fn wrapped(report: &FileReport) -> Option<String> {
    let one = |(column, own): &(String, Wrapped)| {
        let times = if own.jumps == 1 {
            "once".to_owned()
        } else {
            format!("{} times", own.jumps)
        };
        format!("`{column}` by {} ({times})", figure_of(6, own.span))
    };
    let columns: Vec<String> = report.wrapped.iter().map(one).collect();
    (!columns.is_empty()).then(|| {
        format!(
            "positions jump from one end of their range to the other, as they are wrapped: column {}: they are read \
             without these jumps (as they are: `keep` for --problems)",
            columns.join(", ")
        )
    })
}

/// Which efforts jump in single rows of a log.
fn spikes(report: &FileReport) -> Option<String> {
    let one = |(column, own): &(String, Spikes)| {
        let rows = if own.rows == 1 {
            format!("row {}", own.row)
        } else {
            format!("{} rows, the first is row {}", own.rows, own.row)
        };
        format!("`{column}` by up to {} ({rows})", figure_of(3, own.largest))
    };
    let columns: Vec<String> = report.spikes.iter().map(one).collect();
    (!columns.is_empty()).then(|| {
        format!(
            "efforts jump and are back in the next row: column {}: they count as missing; \
             `checks: {{outliers: keep}}` uses them",
            columns.join(", ")
        )
    })
}

/// What was done with the gaps and dropouts of a log.
fn gaps(report: &FileReport) -> Option<String> {
    let Bridged {
        count,
        rows,
        largest,
        cuts,
        longest,
    } = report.bridged;
    let parts = |count: usize| {
        if report.spikes.is_empty() {
            counted(count, "gap or dropout", "gaps or dropouts")
        } else {
            let several = "gaps, dropouts or jumps of efforts";
            counted(count, "gap, dropout or jump of efforts", several)
        }
    };
    let bridged = (count > 0).then(|| {
        let part = 100.0 * rows as f64 / (report.rows + rows) as f64;
        format!(
            "{} of up to {} {} bridged: {} ({} %) {} interpolated, and the equations within left out",
            parts(count),
            counted(largest, "row", "rows"),
            if count == 1 { "was" } else { "were" },
            counted(rows, "row", "rows"),
            figure_of(2, part),
            if rows == 1 { "is" } else { "are" },
        )
    });
    let divided = (cuts > 0 && longest > 0.0).then(|| {
        let what = if count > 0 {
            format!("{cuts} more")
        } else {
            parts(cuts)
        };
        format!(
            "{what}, longer than the {} s that the filter bridges, divide{} the log",
            figure_of(3, longest),
            if cuts == 1 { "s" } else { "" },
        )
    });
    let said: Vec<String> = bridged.into_iter().chain(divided).collect();
    (!said.is_empty()).then(|| said.join("; "))
}

/// The rows of a log that were treated in one way.
fn treated(problems: &Problems, policy: Policy) -> Option<String> {
    let [one, several] = match policy {
        Policy::Keep => {
            // rows that even `keep` cannot use are reported
            let lost = problems.left_out(&Policies::from(policy));
            let kinds = lost.iter().map(|(kind, count)| format!("{count} x {kind}"));
            let kinds: Vec<String> = kinds.collect();
            return (!kinds.is_empty()).then(|| {
                format!(
                    "rows that cannot be kept were left out: {}",
                    kinds.join(", ")
                )
            });
        }
        Policy::Tell => [
            "row or gap is doubtful, and used if it is of numbers",
            "rows or gaps are doubtful; those that are numbers are used",
        ],
        Policy::Fail | Policy::Drop if problems.has_saturated() => [
            "row was left out, and where an effort is saturated its equations only",
            "rows or gaps were left out, and where an effort is saturated its equations only",
        ],
        Policy::Fail | Policy::Drop => ["row or gap was left out", "rows or gaps were left out"],
    };
    let count = problems.total();
    let text = format!("{}\n{problems}", counted(count, one, several));
    (count > 0).then(|| text.trim_end().to_owned())
}
