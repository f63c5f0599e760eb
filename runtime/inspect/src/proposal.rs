//! Proposes an experiment file for logs, in the format that `regen_identify::experiment_file` reads.

use std::fmt::Write as _;

use regen_identify::data::{Join, Run};
use regen_identify::text::figure_of;

use crate::clock::ClockSource;
use crate::joints::Joint;
use crate::log::{Column, LogFacts};
use crate::names::Role;
use crate::words::late_efforts;

/// The order of the proposed Butterworth filter.
const ORDER: usize = 4;
/// The factor between a position and the integral of its velocity counts as that of a unit if it
/// differs by at most this part.
const UNIT_TOLERANCE: f64 = 0.05;

/// A text as a YAML string, in quotes where YAML needs them.
fn quoted(text: &str) -> String {
    let plain = text
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c));
    let starts =
        text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == '/' || c == '.');
    // words that YAML reads as booleans or null
    let word = ["true", "false", "null", "yes", "no", "on", "off", "y", "n"];
    if plain && starts && !word.contains(&text.to_lowercase().as_str()) {
        return text.to_owned();
    }
    let escaped = text.replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{escaped}\"")
}

/// How the file names a column: by its name if no other column has it, else by its number.
fn place(found: &LogFacts, column: &Column) -> String {
    let same = found.columns.iter().filter(|c| c.name == column.name);
    let digits = column.name.chars().all(|c| c.is_ascii_digit());
    if found.named && !digits && !column.name.contains(['*', '\n', '"']) && same.count() == 1 {
        quoted(&column.name)
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

/// A line of `columns`.
fn line(out: &mut String, key: &str, column: &str, unit: Option<&str>, more: &str) {
    let unit = unit.map_or_else(String::new, |unit| format!(", unit: {unit}"));
    let _ = writeln!(out, "  {}: {{column: {column}{unit}{more}}}", quoted(key));
}

/// Writes the columns of one quantity: as one line with a range of numbers if they are consecutive,
/// have the same unit, and neither they nor the joints have names; else as one line per joint.
fn kind(
    out: &mut String,
    found: &LogFacts,
    prefix: &str,
    stated: bool,
    columns: &[(String, &Column, Option<&'static str>)],
    more: &str,
) {
    let numbers: Vec<usize> = columns.iter().map(|(_, column, _)| column.number).collect();
    let together = numbers.windows(2).all(|pair| pair[1] == pair[0] + 1);
    let unit = columns.first().and_then(|c| c.2);
    let same = columns.iter().all(|c| c.2 == unit);
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
        line(out, &key, &format!("{first}..{last}"), unit, more);
        return;
    }
    for (name, column, unit) in columns {
        line(
            out,
            &format!("{prefix}{name}"),
            &place(found, column),
            *unit,
            more,
        );
    }
}

/// The text of an experiment file that reads these logs, for the columns and the clock of the first.
///
/// - `runs`: the runs that were inspected;
/// - `facts`: the facts that were found in each;
/// - `robot`: whether the joints have the names of a robot's description. Without one, columns without
///   names are given by `*` for any robot's coordinates in their order.
///
/// Returns `None` if no log has columns that were recognised as positions.
pub fn proposal(runs: &[Run], facts: &[LogFacts], robot: bool) -> Option<String> {
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
            Some((joint.name.clone(), column, unit))
        };
        found.joints.iter().filter_map(one).collect::<Vec<_>>()
    };
    kind(&mut out, found, "", robot, &with(|j| j.position, 0), "");
    kind(&mut out, found, "qd_", robot, &with(|j| j.velocity, 1), "");
    kind(
        &mut out,
        found,
        "qdd_",
        robot,
        &with(|j| j.acceleration, 2),
        "",
    );
    let efforts = with(|j| j.effort, 2);
    let current = |unit: Option<&str>| matches!(unit, Some("A" | "mA"));
    let currents = efforts
        .iter()
        .any(|(_, column, unit)| current(*unit) || column.role == Role::Current);
    if currents {
        out.push_str(
            "  # currents: the gain is the torque constant with the gear, N m/A; with 1 all\n  \
             # parameters are in units of current\n",
        );
        let efforts: Vec<_> = efforts
            .into_iter()
            .map(|(name, column, unit)| {
                (
                    name,
                    column,
                    unit.filter(|u| current(Some(u))).or(Some("A")),
                )
            })
            .collect();
        kind(&mut out, found, "tau_", robot, &efforts, ", gain: 1");
    } else {
        if !found.named && !efforts.is_empty() {
            out.push_str(
                "  # where these are currents: unit: A, and gain: with one torque constant each\n",
            );
        }
        kind(&mut out, found, "tau_", robot, &efforts, "");
    }
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
    process(&mut out, found);
    checks(&mut out, facts);
    out.push_str("runs:\n");
    for run in runs {
        let files: Vec<String> = run
            .files
            .iter()
            .map(|file| quoted(&file.display().to_string()))
            .collect();
        let mut more = String::new();
        match run.join {
            Join::Auto => {}
            Join::Rows => more.push_str(", join: rows"),
            Join::Time => more.push_str(", join: time"),
        }
        if let Some(topic) = &run.topic {
            let _ = write!(more, ", topic: {}", quoted(topic));
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

/// Writes `process`: resampling, filter and delay, as far as the log needs them.
fn process(out: &mut String, found: &LogFacts) {
    let clock = &found.clock;
    let uneven = !clock.even && clock.source == ClockSource::Column;
    let cutoff = found
        .cutoff
        .filter(|_| clock.source != ClockSource::Unknown);
    let late = !late_efforts(found).is_empty();
    if !uneven && cutoff.is_none() && !late {
        return;
    }
    out.push_str("process:\n");
    if uneven {
        let rate: f64 = figure_of(2, clock.rate).parse().unwrap_or(clock.rate);
        let _ = writeln!(out, "  resample: {rate}");
    }
    if let Some(cutoff) = cutoff {
        let _ = writeln!(
            out,
            "  filter: {{butterworth: {{order: {ORDER}, cutoff: {cutoff}}}}}"
        );
    }
    if let Some(period) = found.period {
        let _ = writeln!(
            out,
            "  # the motion repeats every {} s, {} Hz",
            figure_of(5, period.seconds),
            figure_of(5, period.frequency)
        );
    }
    if late {
        out.push_str("  delay: auto\n");
    }
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
