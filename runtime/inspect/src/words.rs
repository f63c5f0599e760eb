//! Writes sentences about a log: its clock, columns, derivatives and efforts.

use regen_identify::data::{RawLog, Wrapped};
use regen_identify::text::{counted, figure_of};

use crate::clock::ClockSource;
use crate::log::{Column, LogFacts};
use crate::names::Role;

/// The least share of rows at an extreme that is reported as saturation.
const SATURATED_SHARE: f64 = 1e-3;
/// The least number of consecutive rows at an extreme that is reported as saturation.
const SATURATED_ROWS: usize = 4;
/// A delay is reported only if it exceeds this many of its standard deviations.
const CERTAIN_DEVIATIONS: f64 = 4.0;
/// A delay is reported only if it exceeds this part of the sampling step.
const MIN_DELAY_STEPS: f64 = 0.5;
/// The least share of rows at rest that is reported.
const MIN_REST_SHARE: f64 = 0.05;
/// The units of a position and its velocity, by the factor between the position and the integral of
/// the velocity.
const UNITS: [(f64, &str); 4] = [
    (
        180.0 / core::f64::consts::PI,
        "degrees, its velocity in radians",
    ),
    (
        core::f64::consts::PI / 180.0,
        "radians, its velocity in degrees",
    ),
    (1e3, "mm, its velocity in m"),
    (1e-3, "m, its velocity in mm"),
];

fn percent(share: f64) -> String {
    format!("{} %", figure_of(2, 100.0 * share))
}

/// The name of a column as sentences use it.
pub(crate) fn title(found: &LogFacts, number: usize) -> String {
    match found.column(number) {
        Some(column) if found.named => format!("`{}`", column.name),
        _ => format!("column {number}"),
    }
}

/// The sentences on columns that are wrapped.
pub(crate) fn wrapped(log: &RawLog, found: &LogFacts) -> Vec<String> {
    let one = |(index, own): (usize, Wrapped)| {
        format!(
            "{} jumps by {} ({}), as it is wrapped: it is read without these jumps",
            title(found, index + 1),
            figure_of(6, own.span),
            counted(own.jumps, "time", "times")
        )
    };
    log.wrapped().map(one).collect()
}

/// All sentences about a log.
pub(crate) fn notes(found: &LogFacts) -> Vec<String> {
    let mut out = Vec::new();
    clock(found, &mut out);
    columns(found, &mut out);
    derivatives(found, &mut out);
    efforts(found, &mut out);
    out
}

fn clock(found: &LogFacts, out: &mut Vec<String>) {
    let clock = &found.clock;
    if found.unusable > 0 {
        let first = found.problems.first().map_or("", String::as_str);
        let rows = counted(found.unusable, "row", "rows");
        out.push(format!("{rows} cannot be read; {first}"));
    }
    match clock.source {
        ClockSource::Unknown => out.push(
            "the time is unknown: frequencies are per row; state the rate of the rows".to_owned(),
        ),
        ClockSource::Velocities => out.push(format!(
            "there is no column of time; positions agree with their velocities at {} Hz",
            figure_of(4, clock.rate)
        )),
        ClockSource::Column | ClockSource::Rate => {}
    }
    if !clock.even {
        out.push(format!(
            "the clock is uneven, with steps of {} to {} ms: filters need an even grid",
            figure_of(3, 1e3 * clock.steps[0]),
            figure_of(3, 1e3 * clock.steps[1])
        ));
    }
    if let Some(gap) = clock.first_gaps.first() {
        out.push(format!(
            "{}, the first of {} s before row {}",
            counted(clock.gaps, "gap", "gaps"),
            figure_of(3, gap.seconds),
            gap.row
        ));
    }
    if clock.backwards > 0 {
        out.push(format!(
            "the time of {} is not after that of the row before",
            counted(clock.backwards, "row", "rows")
        ));
    }
}

fn columns(found: &LogFacts, out: &mut Vec<String>) {
    // the velocity and the effort of a joint that stands still show no more than its position does
    let of_still = |number: usize| {
        let still = found.joints.iter().filter(|joint| {
            let position = joint.position.and_then(|n| found.column(n));
            position.is_some_and(Column::is_still)
        });
        let mut columns =
            still.flat_map(|joint| [joint.velocity, joint.acceleration, joint.effort]);
        columns.any(|own| own == Some(number))
    };
    for column in &found.columns {
        let name = title(found, column.number);
        let constant = column.low.value >= column.high.value;
        match column.role {
            Role::Position if column.is_still() => out.push(format!("{name} never moves")),
            _ if constant && of_still(column.number) => {}
            Role::Velocity if constant => out.push(format!("{name} is the same in all rows")),
            Role::Position if column.resting > MIN_REST_SHARE => out.push(format!(
                "{name} rests in {} of the rows, where friction is static",
                percent(column.resting)
            )),
            Role::Effort | Role::Current if constant => {
                out.push(format!("{name} is the same in all rows"));
            }
            Role::Effort | Role::Current | Role::Velocity => {
                for extreme in [column.low, column.high] {
                    if extreme.longest >= SATURATED_ROWS && extreme.share >= SATURATED_SHARE {
                        out.push(format!(
                            "{name} is at its extreme {} in {} of the rows, up to {} in \
                             succession: it may be saturated",
                            figure_of(4, extreme.value),
                            percent(extreme.share),
                            extreme.longest
                        ));
                    }
                }
            }
            _ => {}
        }
        let flat = column.spectrum.is_none_or(|s| s.flat);
        if !flat && matches!(column.role, Role::Effort | Role::Current) {
            out.push(format!(
                "{name} has no even noise at high frequencies: it was filtered before it was \
                 logged, or carries signal at all frequencies"
            ));
        }
    }
}

fn derivatives(found: &LogFacts, out: &mut Vec<String>) {
    for joint in &found.joints {
        let Some((column, position)) = joint
            .velocity
            .and_then(|v| found.column(v))
            .zip(joint.position)
        else {
            continue;
        };
        let Some(derivative) = column.derivative else {
            continue;
        };
        let (own, of) = (title(found, column.number), title(found, derivative.of));
        if derivative.of != position {
            let taken = title(found, position);
            let other = found.column(derivative.of).map(|c| c.role);
            if other == Some(Role::Position) {
                out.push(format!(
                    "{own} is the derivative of {of}, and not of {taken}"
                ));
            }
        } else if derivative.factor < 0.0 {
            out.push(format!(
                "{own} has the opposite sign of the derivative of {of}"
            ));
        } else if let Some((_, words)) = UNITS
            .iter()
            .find(|(factor, _)| (derivative.factor / factor - 1.0).abs() < 0.1)
        {
            out.push(format!("{of} seems to be in {words}: state the unit"));
        } else if (derivative.factor - 1.0).abs() > 0.2 {
            out.push(format!(
                "{of} changes {} times as fast as {own} states: a unit or a gear ratio differs",
                figure_of(3, derivative.factor)
            ));
        }
    }
}

fn efforts(found: &LogFacts, out: &mut Vec<String>) {
    for effort in &found.efforts {
        let name = title(found, effort.column);
        let Some(joint) = &effort.follows else {
            continue;
        };
        if *joint != effort.joint {
            out.push(format!(
                "{name} is taken for the effort of {} and follows the motion of {joint}",
                effort.joint
            ));
        }
        if effort.reversed {
            out.push(format!(
                "{name} has the opposite sign of the motion of {joint}"
            ));
        }
    }
    out.extend(late_sentence(found));
}

/// The sentence about efforts that are certainly behind the motion; `None` if there are none.
pub(crate) fn late_sentence(found: &LogFacts) -> Option<String> {
    let late: Vec<String> = late_efforts(found)
        .iter()
        .map(|(column, seconds)| {
            let title = title(found, *column);
            format!("{title} {} ms", figure_of(3, 1e3 * seconds))
        })
        .collect();
    let words = format!("efforts are behind the motion: {}", late.join(", "));
    (!late.is_empty()).then_some(words)
}

/// The columns of the efforts that are certainly behind the motion, each with its delay in s; none
/// if the time of the rows is unknown.
pub(crate) fn late_efforts(found: &LogFacts) -> Vec<(usize, f64)> {
    if found.clock.source == ClockSource::Unknown {
        return Vec::new();
    }
    let rate = found.clock.rate;
    let certain = found.efforts.iter().filter_map(|effort| {
        let [seconds, sigma] = effort.delay?;
        let is_certain = seconds > CERTAIN_DEVIATIONS * sigma;
        (is_certain && seconds * rate > MIN_DELAY_STEPS).then_some((effort.column, seconds))
    });
    certain.collect()
}
