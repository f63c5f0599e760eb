//! Writes sentences about what a log has besides its columns, and states of them beside their names.

use regen_identify::data::{RawLog, file_unit};

use crate::log::LogFacts;
use crate::names::{Role, bracketed};

/// The largest number of names in a sentence.
const MAX_NAMES: usize = 8;

/// The clocks and dates by which the parts of a log are joined.
pub(crate) fn joined(log: &RawLog) -> Vec<String> {
    let mut out = Vec::new();
    let clocks = log.clocks();
    if clocks.len() > 1 {
        out.push(format!(
            "the columns have {} clocks, and are joined by time: {}",
            clocks.len(),
            listed(&clocks)
        ));
    }
    out.extend(log.later());
    out
}

/// What a log has that is in no column, the units that are not known, and how its parts are joined.
pub(crate) fn notes(log: &RawLog, found: &LogFacts) -> Vec<String> {
    let mut out = joined(log);
    // the names of each reason
    let left = log.left_out();
    let mut reasons: Vec<&str> = Vec::new();
    for (_, why) in &left {
        if !reasons.contains(&why.as_str()) {
            reasons.push(why);
        }
    }
    for reason in reasons {
        let own = left.iter().filter(|(_, why)| why == reason);
        let names: Vec<&str> = own.map(|(name, _)| name.as_str()).collect();
        out.push(format!("in no column: {} ({reason})", listed(&names)));
    }
    out.extend(units(log, found));
    out
}

/// A sentence about efforts that belong to no joint of the robot.
pub(crate) fn efforts_of_others(found: &LogFacts, robot: &str) -> Option<String> {
    let is_read = |number| found.joints.iter().any(|own| own.effort == Some(number));
    let others = found.columns.iter().filter(|column| {
        matches!(column.role, Role::Effort | Role::Current) && !is_read(column.number)
    });
    let names: Vec<&str> = others.map(|column| column.name.as_str()).collect();
    (!names.is_empty()).then(|| format!("read for no joint of {robot}: {}", listed(&names)))
}

/// A sentence about units that are not known, of columns that identification may use.
fn units(log: &RawLog, found: &LogFacts) -> Option<String> {
    let unknown = found.columns.iter().filter_map(|column| {
        let is_used = !matches!(column.role, Role::Other | Role::Constant | Role::Text);
        let unit = log
            .unit(column.number - 1)
            .or_else(|| bracketed(&column.name))?;
        let is_unknown = is_used && column.unit.is_none() && file_unit(unit).is_none();
        is_unknown.then(|| format!("{unit}` of `{}", column.name))
    });
    let unknown: Vec<String> = unknown.collect();
    let names: Vec<&str> = unknown.iter().map(String::as_str).collect();
    (!names.is_empty()).then(|| {
        format!(
            "units that are not known here, whose columns are read as SI: {}",
            listed(&names)
        )
    })
}

/// Names in marks, at most [`MAX_NAMES`].
fn listed(names: &[&str]) -> String {
    let all = names.iter().take(MAX_NAMES).map(|name| format!("`{name}`"));
    let all: Vec<String> = all.collect();
    let more = names.len().saturating_sub(MAX_NAMES);
    let tail = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    format!("{}{tail}", all.join(", "))
}
