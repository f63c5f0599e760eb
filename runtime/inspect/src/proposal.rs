//! Proposes an experiment file for logs, in the format that `regen_identify::experiment_file` reads.

use std::fmt::Write as _;

use regen_identify::choice::Choice;
use regen_identify::data::{Join, Run};
use regen_identify::experiment_file::with_process;
use regen_identify::signals::Method;
use regen_identify::text::{figure_of, yaml_text};

use crate::clock::ClockSource;
use crate::joints::Joint;
use crate::log::{Column, LogFacts};
use crate::names::Role;
use crate::words::{late_efforts, title};

/// The unit of efforts that are parts of a rated one.
const PERCENT: &str = "%";
/// The order of the proposed Butterworth filter.
const ORDER: usize = 4;
/// The factor between a position and the integral of its velocity counts as that of a unit if it
/// differs by at most this part.
const UNIT_TOLERANCE: f64 = 0.05;

/// How the file names a column: by its name if no other column has it, else by its number.
fn place(found: &LogFacts, column: &Column) -> String {
    let same = found.columns.iter().filter(|c| c.name == column.name);
    let digits = column.name.chars().all(|c| c.is_ascii_digit());
    if found.named && !digits && !column.name.contains(['*', '\n', '"']) && same.count() == 1 {
        yaml_text(&column.name)
    } else {
        column.number.to_string()
    }
}

/// The units of a joint's position and velocity: those that the log states, or degrees if the factor
/// between the two shows it.
fn units(found: &LogFacts, joint: &Joint) -> [Option<&'static str>; 2] {
    let of = |number: Option<usize>| number.and_then(|n| found.column(n));
    let (position, velocity) = (of(joint.position), of(joint.velocity));
    let stated = |column: Option<&Column>| column.and_then(|c| c.unit);
    let mut out = [stated(position), stated(velocity)];
    let factor = velocity.and_then(|c| c.derivative).map(|d| d.factor);
    let near = |factor: f64, unit: f64| (factor / unit - 1.0).abs() < UNIT_TOLERANCE;
    let degree = core::f64::consts::PI / 180.0;
    match factor {
        Some(factor) if near(factor, 1.0 / degree) && out[0].is_none() => out[0] = Some("deg"),
        Some(factor) if near(factor, degree) && out[1].is_none() => out[1] = Some("deg/s"),
        _ => {}
    }
    out
}

/// A column in the proposed file.
struct Entry<'a> {
    /// The joint's name.
    name: String,
    column: &'a Column,
    unit: Option<&'static str>,
    /// The keys beside column and unit, each with its value, such as `gain` and `unknown`.
    more: Vec<(&'static str, &'static str)>,
}

/// A line of `columns`.
fn line(out: &mut String, key: &str, column: &str, unit: Option<&str>, more: &[(&str, String)]) {
    let unit = unit.map_or_else(String::new, |unit| format!(", unit: {unit}"));
    let more = more.iter().map(|(key, value)| format!(", {key}: {value}"));
    let more: String = more.collect();
    let _ = writeln!(
        out,
        "  {}: {{column: {column}{unit}{more}}}",
        yaml_text(key)
    );
}

/// The keys of all entries together: a value if it is that of all, and else their list.
fn listed(entries: &[Entry<'_>]) -> Vec<(&'static str, String)> {
    let mut out = Vec::new();
    for (key, missing) in [("factor", "1"), ("gain", "unknown")] {
        let values: Vec<&str> = entries
            .iter()
            .map(|entry| {
                let own = entry.more.iter().find(|(own, _)| *own == key);
                own.map_or(missing, |(_, value)| value)
            })
            .collect();
        let stated = entries.iter().any(|e| e.more.iter().any(|m| m.0 == key));
        if let (true, Some(first)) = (stated, values.first()) {
            let is_shared = values.iter().all(|value| value == first);
            out.push((
                key,
                if is_shared {
                    (*first).to_owned()
                } else {
                    format!("[{}]", values.join(", "))
                },
            ));
        }
    }
    out
}

/// Writes the columns of one quantity: as one line with a range of numbers if they are consecutive,
/// have the same unit, and neither they nor the joints have names; else as one line per joint.
fn kind(out: &mut String, found: &LogFacts, prefix: &str, stated: bool, entries: &[Entry<'_>]) {
    let numbers: Vec<usize> = entries.iter().map(|entry| entry.column.number).collect();
    let together = numbers.windows(2).all(|pair| pair[1] == pair[0] + 1);
    let unit = entries.first().and_then(|entry| entry.unit);
    let same = entries.iter().all(|entry| entry.unit == unit);
    if let (Some(first), Some(last)) = (numbers.first(), numbers.last())
        && !stated
        && !found.named
        && together
        && same
    {
        let key = if prefix.is_empty() {
            "*".to_owned()
        } else {
            format!("{prefix}*")
        };
        line(
            out,
            &key,
            &format!("{first}..{last}"),
            unit,
            &listed(entries),
        );
        return;
    }
    for entry in entries {
        line(
            out,
            &format!("{prefix}{}", entry.name),
            &place(found, entry.column),
            entry.unit,
            &listed(std::slice::from_ref(entry)),
        );
    }
}

/// Whether all logs that tell the sign of this effort tell that it is reversed.
fn is_reversed(facts: &[LogFacts], joint: &str, column: usize) -> bool {
    let all = facts.iter().flat_map(|log| &log.efforts);
    let mut own = all
        .filter(|e| e.column == column && e.joint == joint && e.follows.as_deref() == Some(joint))
        .peekable();
    own.peek().is_some() && own.all(|effort| effort.reversed)
}

/// Whether a unit is that of a current.
fn is_current(unit: Option<&str>) -> bool {
    matches!(unit, Some("A" | "mA"))
}

/// Writes the columns of the efforts, with what is unknown about them.
fn efforts(out: &mut String, facts: &[LogFacts], found: &LogFacts, robot: bool) {
    let one = |joint: &Joint| {
        let column = found.column(joint.effort?)?;
        let mut more = Vec::new();
        if is_reversed(facts, &joint.name, column.number) {
            more.push(("factor", "-1"));
        }
        Some(Entry {
            name: joint.name.clone(),
            column,
            unit: column.unit,
            more,
        })
    };
    let mut entries: Vec<Entry<'_>> = found.joints.iter().filter_map(one).collect();
    let parts = entries.iter().any(|entry| entry.unit == Some(PERCENT));
    let currents = entries
        .iter()
        .any(|entry| is_current(entry.unit) || entry.column.role == Role::Current);
    if parts || currents {
        // a torque gives the scale, and an effort that never changes gives none
        let is_torque = |entry: &Entry<'_>| matches!(entry.unit, Some("Nm" | "N"));
        let changes = |entry: &&Entry<'_>| entry.column.low.value < entry.column.high.value;
        let known = if entries.iter().any(is_torque) {
            None
        } else {
            entries.iter().find(changes).or(entries.first())
        };
        let known = known.map(|entry| entry.name.clone());
        comment(
            out,
            if parts {
                "in % of a rated torque or current, which is not stated: read like a current, \
             since the file has no unit for it, with a gain in N m per %"
            } else {
                "currents: the gain is the torque constant with the gear, N m/A"
            },
        );
        if let Some(name) = &known {
            let (unit, give) = if parts {
                ("percentage", "the torque of one percent, with the gear,")
            } else {
                ("current", "its torque constant times its gear ratio")
            };
            comment(
                out,
                &format!(
                    "the gain of tau_{name} is set to 1: parameters are then in units of that \
                     drive's {unit}; give {give} if known. Gains differ between drives, so the \
                     others are identified"
                ),
            );
        }
        for entry in entries.iter_mut().filter(|entry| !is_torque(entry)) {
            entry.unit = entry.unit.filter(|u| is_current(Some(u))).or(Some("A"));
            let is_known = known.as_ref() == Some(&entry.name);
            entry
                .more
                .push(("gain", if is_known { "1" } else { "unknown" }));
        }
    } else if !found.named && !entries.is_empty() {
        comment(
            out,
            "where these are currents: unit: A, and gain: with one torque constant each",
        );
    }
    let reversed: Vec<String> = entries
        .iter()
        .filter(|entry| entry.more.iter().any(|m| m.0 == "factor"))
        .map(|entry| format!("tau_{}", entry.name))
        .collect();
    if !reversed.is_empty() {
        comment(
            out,
            &format!(
                "factor: -1 where friction would otherwise drive the joint: {}",
                reversed.join(", ")
            ),
        );
    }
    for effort in &found.efforts {
        if let Some(other) = effort.follows.as_ref().filter(|f| **f != effort.joint) {
            let name = title(found, effort.column);
            let text = format!(
                "{name}, here the effort of {}, follows the motion of {other}: see which is right",
                effort.joint
            );
            comment(out, &text);
        }
    }
    kind(out, found, "tau_", robot, &entries);
}

/// Writes a comment among the columns, in lines of at most 80 characters where words allow.
fn comment(out: &mut String, text: &str) {
    const START: &str = "  #";
    let mut length = 0;
    for word in text.split_whitespace() {
        let own = word.chars().count() + 1;
        if length == 0 || length + own > 80 {
            out.push_str(if length == 0 { START } else { "\n  #" });
            length = START.len();
        }
        out.push(' ');
        out.push_str(word);
        length += own;
    }
    out.push('\n');
}

/// The text of an experiment file that reads these logs, for the columns and the clock of the first.
///
/// - `runs`: the runs that were inspected;
/// - `facts`: the facts that were found in each;
/// - `robot`: whether the joints have the names of a robot's description. Without one, columns without
///   names are given by `*` for any robot's coordinates in their order;
/// - `choice`: the filter that was chosen from the logs; without one, that of their spectra.
///
/// Returns `None` if no log has columns that were recognised as positions.
pub fn proposal(
    runs: &[Run],
    facts: &[LogFacts],
    robot: bool,
    choice: Option<&Choice>,
) -> Option<String> {
    let found = facts.iter().find(|f| !f.joints.is_empty())?;
    let mut out = String::from("# Proposed from what the logs hold: check it before it is used.\n");
    out.push_str("columns:\n");
    let with = |number: fn(&Joint) -> Option<usize>, unit: usize| {
        let one = |joint: &Joint| {
            let column = found.column(number(joint)?)?;
            let unit = if unit < 2 {
                units(found, joint)[unit]
            } else {
                column.unit
            };
            Some(Entry {
                name: joint.name.clone(),
                column,
                // no unit of a motion
                unit: unit.filter(|unit| *unit != PERCENT),
                more: Vec::new(),
            })
        };
        found.joints.iter().filter_map(one).collect::<Vec<_>>()
    };
    kind(&mut out, found, "", robot, &with(|j| j.position, 0));
    kind(&mut out, found, "qd_", robot, &with(|j| j.velocity, 1));
    kind(&mut out, found, "qdd_", robot, &with(|j| j.acceleration, 2));
    efforts(&mut out, facts, found, robot);
    let clock = &found.clock;
    match (clock.source, clock.column.and_then(|n| found.column(n))) {
        (ClockSource::Column, Some(column)) => {
            let plain = found.named && ["t", "time"].contains(&column.name.as_str());
            if !plain || clock.unit != "s" {
                let _ = writeln!(
                    out,
                    "time: {{column: {}, unit: {}}}",
                    place(found, column),
                    clock.unit
                );
            }
        }
        (ClockSource::Unknown, _) => {
            out.push_str("# rate: HZ, as nothing in the log gives the time\n");
        }
        _ => {
            let _ = writeln!(out, "rate: {}", number(clock.rate));
        }
    }
    write_process(&mut out, found, choice);
    checks(&mut out, facts);
    out.push_str("runs:\n");
    let cut = choice.map(|own| own.runs(runs));
    for run in cut.as_deref().unwrap_or(runs) {
        let files: Vec<String> = run
            .files
            .iter()
            .map(|file| yaml_text(&file.display().to_string()))
            .collect();
        let mut more = String::new();
        match run.join {
            Join::Auto => {}
            Join::Rows => more.push_str(", join: rows"),
            Join::Time => more.push_str(", join: time"),
        }
        if let Some(topic) = &run.topic {
            let _ = write!(more, ", topic: {}", yaml_text(topic));
        }
        if let Some(episode) = run.episode {
            let _ = write!(more, ", episode: {episode}");
        }
        if let Some((first, last)) = run.rows {
            let _ = write!(more, ", rows: [{first}, {last}]");
        }
        if let Some((start, end)) = run.times {
            let _ = write!(more, ", times: [{start}, {end}]");
        }
        let _ = writeln!(out, "  - {{files: [{}]{more}}}", files.join(", "));
    }
    Some(out)
}

/// A number with four significant digits.
fn number(value: f64) -> String {
    let rounded: f64 = figure_of(4, value).parse().unwrap_or(value);
    rounded.to_string()
}

/// The keys of `process` with their values as far as logs need them: resampling, filter and delay.
///
/// - `choice`: the filter that was chosen from the logs.
fn process(found: &LogFacts, choice: Option<&Choice>) -> Vec<(&'static str, String)> {
    let clock = &found.clock;
    let mut keys = Vec::new();
    let uneven = !clock.even && clock.source == ClockSource::Column;
    let chosen = choice.and_then(|own| own.resample);
    if chosen.is_some() || uneven {
        let rate: f64 = figure_of(2, clock.rate).parse().unwrap_or(clock.rate);
        keys.push(("resample", chosen.unwrap_or(rate).to_string()));
    }
    if let Some(own) = choice {
        let filter = match own.method() {
            Method::Fourier {
                frequency,
                harmonics,
            } => format!("{{fourier: {{frequency: {frequency}, harmonics: {harmonics}}}}}"),
            _ => format!(
                "{{butterworth: {{order: {}, cutoff: {}}}}}",
                own.order, own.cutoff
            ),
        };
        keys.push(("filter", filter));
        if own.equation_decimation() > 1 {
            keys.push(("decimate", own.equation_decimation().to_string()));
        }
        if own.velocities.is_some_and(|own| own.are_computed) {
            keys.push(("velocities", "computed".to_owned()));
        }
    } else if let (Some(cutoff), true) = (found.cutoff, clock.source != ClockSource::Unknown) {
        let filter = format!("{{butterworth: {{order: {ORDER}, cutoff: {cutoff}}}}}");
        keys.push(("filter", filter));
    }
    if !late_efforts(found).is_empty() {
        keys.push(("delay", "auto".to_owned()));
    }
    keys
}

/// Writes `process`, with what is known of the period and of delays.
fn write_process(out: &mut String, found: &LogFacts, choice: Option<&Choice>) {
    let keys = process(found, choice);
    if keys.is_empty() {
        return;
    }
    out.push_str("process:\n");
    for (key, value) in &keys {
        let _ = writeln!(out, "  {key}: {value}");
    }
    if let Some(period) = found.period {
        let _ = writeln!(
            out,
            "  # the motion repeats every {} s, {} Hz",
            figure_of(5, period.seconds),
            figure_of(5, period.frequency)
        );
    }
    let unclear = |log: &LogFacts| log.efforts.iter().all(|effort| effort.delay.is_none());
    if keys.iter().all(|(key, _)| *key != "delay") && !found.efforts.is_empty() && unclear(found) {
        out.push_str(
            "  # whether efforts are late is unclear: `delay: auto` finds it in the fit\n",
        );
    }
}

/// An experiment file with everything that it states, and the keys of `process` that the logs propose and it
/// lacks; `None` where it is written in a way that takes no further key.
///
/// - `text`: the file; `facts`: the facts that were found in each of its runs;
/// - `choice`: the filter that was chosen from the logs, `None` if the file states one.
pub fn completed(text: &str, facts: &[LogFacts], choice: Option<&Choice>) -> Option<String> {
    let found = facts.iter().find(|f| !f.joints.is_empty())?;
    let mut keys = process(found, choice);
    keys.retain(|(key, _)| choice.is_some() || *key == "delay");
    let text = with_process(text, &keys)?;
    Some(if text.ends_with('\n') {
        text
    } else {
        text + "\n"
    })
}

/// Writes `checks`: faulty rows are dropped if there are any.
fn checks(out: &mut String, facts: &[LogFacts]) {
    let faulty = facts
        .iter()
        .any(|f| f.unusable > 0 || f.clock.gaps > 0 || f.clock.backwards > 0);
    let rows = if faulty { "rows: drop, " } else { "" };
    let _ = writeln!(
        out,
        "checks: {{{rows}outliers: tell, saturated: tell, stuck: tell}}"
    );
}
