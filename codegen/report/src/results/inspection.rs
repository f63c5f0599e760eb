//! The facts found about logs, and the prediction of what they can identify, as tables.

use std::fmt::Write as _;

use regen_codegen::explain::lines::{columns, field, item, paragraph};
use regen_identify::text::{counted, figure_of};
use regen_inspect::{Clock, ClockSource, Column, LogFacts, Prediction, Role};

/// The result of an inspection of logs.
#[derive(Clone, Copy, Debug)]
pub struct Inspection<'a> {
    /// The robot's name, where one was given.
    pub robot: Option<&'a str>,
    /// The facts found about each log.
    pub logs: &'a [LogFacts],
    /// How well the logs can identify the robot's parameters.
    pub prediction: Option<&'a Prediction>,
    /// The contradictions between the logs and the robot, one sentence each.
    pub doubts: &'a [String],
    /// Why there is no prediction although a robot was given.
    pub unpredicted: Option<&'a str>,
}

/// A share in percent.
fn percent(share: f64) -> String {
    if share > 0.0 {
        figure_of(2, 100.0 * share)
    } else {
        "0".to_owned()
    }
}

/// A name cut to 18 characters, to fit into a table.
fn short(name: &str) -> String {
    /// Characters that leave room for the other columns.
    const MOST: usize = 20;
    if name.chars().count() <= MOST {
        return name.to_owned();
    }
    name.chars().take(MOST - 3).chain("...".chars()).collect()
}

fn three(value: f64) -> String {
    figure_of(3, value)
}

/// The result of an inspection as tables of at most 80 columns.
pub fn inspection_text(found: &Inspection<'_>) -> String {
    let mut out = String::new();
    for (k, log) in found.logs.iter().enumerate() {
        if k > 0 {
            out.push('\n');
        }
        write_log(&mut out, log);
    }
    if let Some(prediction) = found.prediction {
        predicted(&mut out, prediction, found.robot.unwrap_or_default());
    }
    if !found.doubts.is_empty() {
        let gap = if out.ends_with("\n\n") { "" } else { "\n" };
        let _ = writeln!(out, "{gap}What contradicts the robot");
        for doubt in found.doubts {
            out.push_str(&item(doubt));
        }
    }
    if let Some(why) = found.unpredicted {
        out.push_str("\nWhat these logs can identify\n");
        out.push_str(&item(why));
    }
    out
}

fn clock(clock: &Clock) -> String {
    let source = match (clock.source, clock.column) {
        (ClockSource::Column, Some(column)) => format!("column {column}, in {}", clock.unit),
        (ClockSource::Column, None) => "a column".to_owned(),
        (ClockSource::Rate, _) => "the stated rate".to_owned(),
        (ClockSource::Velocities, _) => "positions and their velocities".to_owned(),
        (ClockSource::Unknown, _) => "an unknown clock: times are counted in rows".to_owned(),
    };
    // the time that passed is not known where the clock was set back
    let span = match clock.backwards {
        0 => figure_of(4, clock.span[1] - clock.span[0]) + " s",
        rows => format!("goes back at {};", counted(rows, "row", "rows")),
    };
    format!(
        "{span} at {} Hz from {source}; jitter {} ms, {}",
        figure_of(4, clock.rate),
        three(1e3 * clock.jitter),
        counted(clock.gaps, "gap", "gaps")
    )
}

/// A line of the table of columns.
fn line(column: &Column) -> Vec<String> {
    let plain = |value: f64| {
        if value > 0.0 {
            three(value)
        } else {
            "-".to_owned()
        }
    };
    let moving = matches!(
        column.role,
        Role::Position | Role::Velocity | Role::Acceleration | Role::Effort | Role::Current
    );
    let spectrum = column.spectrum.filter(|_| moving);
    let number = column.number.to_string();
    let name = if column.name == number {
        ""
    } else {
        &column.name
    };
    let of = column
        .derivative
        .map_or(String::new(), |d| d.of.to_string());
    vec![
        number,
        short(name),
        column.role.name().to_owned(),
        of,
        if moving {
            plain(column.encoder_step)
        } else {
            String::new()
        },
        if moving {
            plain(column.noise)
        } else {
            String::new()
        },
        if column.role == Role::Position {
            percent(column.resting)
        } else {
            String::new()
        },
        spectrum.map_or(String::new(), |s| three(s.ends)),
    ]
}

fn write_log(out: &mut String, log: &LogFacts) {
    let _ = writeln!(out, "{}", log.log);
    out.push_str(&field(
        "rows",
        &format!("{}, {} unusable", log.rows, log.unusable),
    ));
    out.push_str(&field("clock", &clock(&log.clock)));
    if let Some(cutoff) = log.cutoff {
        let text = format!("{cutoff} Hz: above it the motion is noise");
        out.push_str(&field("cutoff", &text));
    }
    let period = log.period.map_or("none found".to_owned(), |p| {
        format!(
            "{} s, {} Hz, {} times; periods differ by {} %",
            figure_of(5, p.seconds),
            figure_of(5, p.frequency),
            three(p.repetitions),
            three(p.difference)
        )
    });
    out.push_str(&field("period", &period));
    out.push('\n');
    let head = [
        "", "column", "may be", "d/dt of", "step", "noise", "rests %", "ends Hz",
    ];
    let lines: Vec<Vec<String>> = log.columns.iter().map(line).collect();
    out.push_str(&columns(&head, &lines));
    if !log.efforts.is_empty() {
        out.push('\n');
        let lines: Vec<Vec<String>> = log
            .efforts
            .iter()
            .map(|effort| {
                let follows = effort.follows.as_deref().unwrap_or("unclear");
                let sign = if effort.reversed { "reversed" } else { "" };
                let delay = effort.delay.map_or(String::new(), |[seconds, sigma]| {
                    format!("{} +- {}", three(1e3 * seconds), figure_of(2, 1e3 * sigma))
                });
                vec![
                    effort.column.to_string(),
                    short(&effort.joint),
                    short(follows),
                    sign.to_owned(),
                    percent(effort.explained),
                    delay,
                ]
            })
            .collect();
        let head = [
            "effort",
            "taken for",
            "follows",
            "",
            "explained %",
            "behind, ms",
        ];
        out.push_str(&columns(&head, &lines));
    }
    if !log.notes.is_empty() {
        out.push('\n');
        for note in &log.notes {
            out.push_str(&item(note));
        }
    }
}

fn predicted(out: &mut String, found: &Prediction, robot: &str) {
    let _ = writeln!(
        out,
        "\nWhat these logs can identify of {robot}, before any fit"
    );
    out.push_str(&field("equations", &found.equations.to_string()));
    out.push_str(&field("condition", &figure_of(4, found.condition)));
    let noise: Vec<String> = found
        .noise
        .iter()
        .map(|n| format!("{} {}{}", n.name, three(n.sigma), n.doubt()))
        .collect();
    out.push_str(&field("noise", &noise.join(", ")));
    out.push('\n');
    let lines: Vec<Vec<String>> = found
        .motion
        .iter()
        .map(|m| {
            vec![
                m.name.clone(),
                format!("{} to {}", three(m.positions[0]), three(m.positions[1])),
                format!("{} to {}", three(m.velocities[0]), three(m.velocities[1])),
                three(m.acceleration),
                percent(m.resting),
            ]
        })
        .collect();
    let head = ["joint", "position", "velocity", "acc. rms", "rests %"];
    out.push_str(&columns(&head, &lines));
    for m in found.motion.iter().filter(|m| !m.lacks.is_empty()) {
        out.push_str(&item(&format!("{} {}", m.name, m.lacks.join(", "))));
    }
    out.push('\n');
    let lines: Vec<Vec<String>> = found
        .parameters
        .iter()
        .map(|p| {
            let number = |value: Option<f64>| value.map_or("-".to_owned(), three);
            vec![
                p.label.clone(),
                p.status.name().to_owned(),
                number(p.nominal),
                number(p.sigma),
                p.percent.map_or("-".to_owned(), |x| {
                    // a nominal value near zero has no meaningful part
                    if x < 1e4 {
                        three(x)
                    } else {
                        ">10000".to_owned()
                    }
                }),
                number(p.well_from),
            ]
        })
        .collect();
    let head = ["parameter", "status", "nominal", "sigma", "%", "well from"];
    out.push_str(&columns(&head, &lines));
    let mut lacking = found
        .parameters
        .iter()
        .filter(|p| !p.needs.is_empty())
        .peekable();
    if lacking.peek().is_some() {
        out.push_str("\nMore of these motions would determine them better\n");
        for p in lacking {
            let needs: Vec<String> = p.needs.iter().map(ToString::to_string).collect();
            out.push_str(&item(&format!("{}: {}", p.label, needs.join(", or "))));
        }
    }
    out.push('\n');
    for note in &found.notes {
        out.push_str(&item(note));
    }
    out.push_str(&paragraph(
        "The noise is that of the efforts at high frequencies. Errors of the model come on top.",
    ));
    out.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_the_clock_has_its_figures() {
        let found = Clock {
            span: [1.0, 41.0],
            rate: 200.0,
            jitter: 1.234e-3,
            gaps: 2,
            source: ClockSource::Rate,
            ..Clock::default()
        };
        let expected = "40.00 s at 200.0 Hz from the stated rate; jitter 1.23 ms, 2 gaps";
        assert_eq!(clock(&found), expected);
    }
}
