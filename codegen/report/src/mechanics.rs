//! The parts of a report on springs, drives, payloads and gains.

use std::fmt::Write as _;

use regen_identify::files::{GainRow, PayloadRow};
use regen_runtime::{Info, Symbol};

use crate::identified::Content;
use crate::page::{escaped, four, section, table};

/// The rows of the summary that list the robot's drives, springs and payloads: titles and names.
/// Kinds that the robot lacks have no row.
pub(crate) fn rows(report: &Content<'_>) -> Vec<(&'static str, String)> {
    let info = report.model.info();
    let named = |wanted: &dyn Fn(Symbol<'_>) -> bool| -> Vec<String> {
        let own = info.parameters.iter().filter(|p| wanted(p.symbol));
        own.map(|p| escaped(p.owner)).collect()
    };
    let payloads = report.robot.payloads.iter();
    let payloads = payloads.filter_map(|k| report.robot.bodies.get(*k));
    let all = [
        ("Drives", drives(&info)),
        ("Springs at joints", named(&|s| s == Symbol::Stiffness)),
        (
            "Springs between points",
            named(&|s| s == Symbol::SpringStiffness),
        ),
        (
            "Constant pulls between points",
            named(&|s| s == Symbol::SpringPull),
        ),
        (
            "Payloads, carried in some runs",
            payloads.map(|label| escaped(label)).collect(),
        ),
    ];
    let there = all.into_iter().filter(|(_, names)| !names.is_empty());
    there
        .map(|(title, names)| (title, names.join(", ")))
        .collect()
}

/// The names of the coordinates that belong to drives rather than to joints.
fn drives(info: &Info<'_>) -> Vec<String> {
    let joints = info.coordinates.iter().zip(info.joints);
    let drives = joints.filter(|(_, joint)| joint.is_drive());
    drives.map(|(name, _)| escaped(name)).collect()
}

/// The section of gains and payloads; empty if none were identified.
pub(crate) fn loads(report: &Content<'_>) -> String {
    let file = report.file;
    let mut out = String::new();
    if !file.gains.is_empty() {
        let rows: Vec<Vec<String>> = file.gains.iter().map(gain).collect();
        let caption = "Gains of drives: the effort over the measured current, with the ends of the \
                       confidence interval";
        let head = ["effort", "gain", "unit", "σ", "from", "to"];
        out.push_str(&table(caption, &head, &rows));
    }
    for payload in &file.payloads {
        let rows: Vec<Vec<String>> = values(payload);
        let caption = format!(
            "Payload “{}” in the frame of its body: mass, centre of mass, and inertia about the \
             centre of mass",
            escaped(&payload.body)
        );
        let head = ["", "value", "unit", "σ", "from", "to"];
        out.push_str(&table(&caption, &head, &rows));
    }
    if out.is_empty() {
        return out;
    }
    let _ = writeln!(out, "<p>A value without σ was given, not estimated.</p>");
    section("loads", "Gains and payloads", &out)
}

/// The cells of a gain.
fn gain(row: &GainRow) -> Vec<String> {
    let numbers = [row.value, row.sigma, row.low, row.high];
    estimated(&row.effort, &row.unit, numbers)
}

/// The cells of each value of a payload.
fn values(payload: &PayloadRow) -> Vec<Vec<String>> {
    let rows = payload.values.iter();
    rows.map(|row| {
        let numbers = [row.value, row.sigma, row.low, row.high];
        estimated(&row.name, &row.unit, numbers)
    })
    .collect()
}

/// The cells of an estimate: name, value, unit, deviation, and the ends of its interval.
fn estimated(name: &str, unit: &str, numbers: [f64; 4]) -> Vec<String> {
    let [value, sigma, low, high] = numbers.map(four);
    vec![escaped(name), value, escaped(unit), sigma, low, high]
}
