//! The page of inspected logs and of what they can identify.

use std::fmt::Write as _;

use regen_identify::status::WELL_IDENTIFIED_PERCENT;
use regen_identify::text::counted;
use regen_inspect::{Column, ExpectedStatus, Joint, LogFacts, Prediction, Role};

use crate::ReportError;
use crate::charts::{self, BLUE, Bar, Figure, GREY, LINE_COLOURS, Line, Look, ORANGE};
use crate::figures::TIME;
use crate::page::{escaped, figure, four, label, section, table, whole};

/// The largest number of columns in one figure, since more lines cannot be distinguished.
const MAX_LINES: usize = 8;

/// The page of inspected logs, as HTML that needs no network.
///
/// - `robot`: the name of the robot whose coordinates the columns were matched with;
/// - `prediction`: how well the logs can identify its parameters.
///
/// # Errors
/// When a figure cannot be drawn.
///
/// ```
/// use regen_inspect::{Clock, LogFacts};
///
/// let clock = Clock { rate: 200.0, ..Clock::default() };
/// let log = LogFacts { log: "run<1>.csv".to_owned(), rows: 5, clock, ..LogFacts::default() };
/// let page = regen_report::inspected(None, &[log], None)?;
/// assert!(page.contains("<h2>run&lt;1&gt;.csv</h2>") && page.contains("200.0 Hz"));
/// # Ok::<(), regen_report::ReportError>(())
/// ```
pub fn inspected(
    robot: Option<&str>,
    logs: &[LogFacts],
    prediction: Option<&Prediction>,
) -> Result<String, ReportError> {
    let mut body = String::new();
    for (k, log) in logs.iter().enumerate() {
        body.push_str(&log_section(k, log)?);
    }
    if let Some(prediction) = prediction {
        body.push_str(&predicted(prediction)?);
    }
    let title = match robot {
        Some(robot) => format!("Logs of {}", escaped(robot)),
        None => "Logs".to_owned(),
    };
    Ok(whole(&title, &body))
}

/// The name of a column in tables and legends.
fn name(column: &Column) -> String {
    if column.name == column.number.to_string() {
        format!("column {}", column.number)
    } else {
        column.name.clone()
    }
}

fn share(value: f64) -> String {
    if value > 0.0 {
        format!("{:.2} %", 100.0 * value)
    } else {
        String::new()
    }
}

fn positive(value: f64) -> String {
    if value > 0.0 {
        four(value)
    } else {
        String::new()
    }
}

fn log_section(place: usize, log: &LogFacts) -> Result<String, ReportError> {
    let clock = &log.clock;
    let mut out = String::from("<dl>\n");
    let mut entry = |title: &str, text: String| {
        let _ = writeln!(out, "<dt>{title}</dt><dd>{}</dd>", escaped(&text));
    };
    entry(
        "Rows",
        format!("{}, and {} that cannot be read", log.rows, log.unusable),
    );
    entry(
        "Clock",
        format!(
            "{} s at {} Hz; steps of {} to {} ms, {}",
            four(clock.span[1] - clock.span[0]),
            four(clock.rate),
            four(1e3 * clock.steps[0]),
            four(1e3 * clock.steps[1]),
            counted(clock.gaps, "gap", "gaps")
        ),
    );
    if let Some(cutoff) = log.cutoff {
        entry(
            "Cutoff",
            format!("{cutoff} Hz: above it the motion is noise"),
        );
    }
    let period = log.period.map_or("none found".to_owned(), |p| {
        format!(
            "{} s, {} Hz, {:.2} times",
            four(p.seconds),
            four(p.frequency),
            p.repetitions
        )
    });
    entry("Period", period);
    out.push_str("</dl>\n");
    if !log.notes.is_empty() {
        out.push_str("<ul>\n");
        for note in &log.notes {
            let _ = writeln!(out, "<li>{}</li>", escaped(note));
        }
        out.push_str("</ul>\n");
    }
    for drawn in figures(place, log)? {
        out.push_str(&figure(&drawn));
    }
    if !log.efforts.is_empty() {
        out.push_str(&efforts(log));
    }
    out.push_str(&columns(log));
    Ok(section(
        &format!("log-{}", place + 1),
        &escaped(&log.log),
        &out,
    ))
}

/// Curves and spectra of positions and efforts.
fn figures(place: usize, log: &LogFacts) -> Result<Vec<Figure>, ReportError> {
    type Of = fn(&Joint) -> Option<usize>;
    let kinds: [(&str, Of); 3] = [
        ("positions", |j| j.position),
        ("velocities", |j| j.velocity),
        ("efforts", |j| j.effort),
    ];
    let mut out = Vec::new();
    for (what, of) in kinds {
        let all: Vec<&Column> = log
            .joints
            .iter()
            .filter_map(|j| log.column(of(j)?))
            .collect();
        for (part, columns) in all.chunks(MAX_LINES).enumerate() {
            let start = log.clock.span[0];
            let from_start = |line: &mut Line| line.points.iter_mut().for_each(|p| p.0 -= start);
            let lines = |points: fn(&Column) -> &[(f64, f64)]| -> Vec<Line> {
                let dyes = LINE_COLOURS.iter().cycle();
                let pairs = columns.iter().zip(dyes);
                let lines = pairs.map(|(column, dye)| Line {
                    label: name(column),
                    points: points(column).to_vec(),
                    dye: *dye,
                    look: Look::Solid,
                });
                lines.collect()
            };
            let number = format!("{}-{}", place + 1, part + 1);
            let mut curves = lines(|c| &c.curve);
            curves.iter_mut().for_each(from_start);
            out.push(Figure {
                name: format!("{what}-{number}"),
                caption: format!("{what} as they are logged"),
                svg: charts::lines(TIME, what, 230, &curves)?,
            });
            let spectra = lines(|c| &c.density);
            if what != "velocities" && spectra.iter().any(|l| !l.points.is_empty()) {
                let mark = log.cutoff.map(|f| (f, "cutoff"));
                out.push(Figure {
                    name: format!("spectra-of-{what}-{number}"),
                    caption: format!(
                        "spectra of {what}: roots of the power spectral density, by Welch's method"
                    ),
                    svg: charts::densities("unit / root Hz", &spectra, mark)?,
                });
            }
        }
    }
    Ok(out)
}

fn efforts(log: &LogFacts) -> String {
    let mut head = vec!["effort", "taken for", "follows", "explained", "behind, ms"];
    let names: Vec<String> = log.joints.iter().map(|j| escaped(&j.name)).collect();
    head.extend(names.iter().map(String::as_str));
    let row = |effort: &regen_inspect::Following| {
        let follows = match &effort.follows {
            None => "unclear".to_owned(),
            Some(joint) if *joint == effort.joint && !effort.reversed => escaped(joint),
            Some(joint) => {
                let sign = if effort.reversed { ", reversed" } else { "" };
                format!("<b>{}{sign}</b>", escaped(joint))
            }
        };
        let delay = effort.delay.map_or(String::new(), |[seconds, sigma]| {
            format!("{} ± {}", four(1e3 * seconds), four(1e3 * sigma))
        });
        let column = log.column(effort.column).map(name).unwrap_or_default();
        let mut cells = vec![
            escaped(&column),
            escaped(&effort.joint),
            follows,
            share(effort.explained),
            delay,
        ];
        cells.extend(effort.shares.iter().map(|s| share(*s)));
        cells
    };
    let rows: Vec<Vec<String>> = log.efforts.iter().map(row).collect();
    table(
        "The joint of each effort: the part of its variance that only the friction (or, if there is \
         none, the inertia) of each joint explains",
        &head,
        &rows,
    )
}

fn columns(log: &LogFacts) -> String {
    let row = |column: &Column| {
        let moving = matches!(
            column.role,
            Role::Position | Role::Velocity | Role::Acceleration | Role::Effort | Role::Current
        );
        let only = |text: String| if moving { text } else { String::new() };
        let spectrum = column.spectrum.filter(|_| moving);
        vec![
            column.number.to_string(),
            escaped(&name(column)),
            column.role.name().to_owned(),
            escaped(&column.reason),
            only(format!(
                "{} … {}",
                four(column.low.value),
                four(column.high.value)
            )),
            only(positive(column.encoder_step)),
            only(positive(column.noise)),
            if column.role == Role::Position {
                share(column.resting)
            } else {
                String::new()
            },
            only(share(column.low.share.max(column.high.share))),
            spectrum.map_or(String::new(), |s| four(s.ends)),
        ]
    };
    let rows: Vec<Vec<String>> = log.columns.iter().map(row).collect();
    table(
        "Columns: range, step of the encoder, noise from row to row, share of rests, largest share \
         at an extreme, and the frequency below which the signal has 99.9 % of its power, of a \
         position that of its acceleration",
        &[
            "",
            "column",
            "may be",
            "why",
            "range",
            "step",
            "noise",
            "rests",
            "at extreme",
            "ends, Hz",
        ],
        &rows,
    )
}

fn predicted(found: &Prediction) -> Result<String, ReportError> {
    let mut out = format!(
        "<p class=\"lead\">From {}, before any fit: standard deviations at the noise that \
         the efforts have at high frequencies. Errors of the model come on top.</p>\n",
        counted(found.equations, "equation", "equations")
    );
    for note in &found.notes {
        let _ = writeln!(out, "<p>{}</p>", escaped(note));
    }
    let noise = found.noise.iter().zip(&found.motion);
    let rows: Vec<Vec<String>> = noise
        .map(|(noise, m)| {
            vec![
                escaped(&m.name),
                format!("{} … {}", four(m.positions[0]), four(m.positions[1])),
                format!("{} … {}", four(m.velocities[0]), four(m.velocities[1])),
                four(m.acceleration),
                share(m.resting),
                format!("{}{}", four(noise.sigma), noise.doubt()),
                format!("<b>{}</b>", escaped(&m.lacks.join(", "))),
            ]
        })
        .collect();
    out.push_str(&table(
        "How the joints move, and the noise of their efforts",
        &[
            "joint",
            "position",
            "velocity",
            "rms acceleration",
            "rests",
            "noise",
            "lacks",
        ],
        &rows,
    ));
    let bars: Vec<Bar> = found
        .parameters
        .iter()
        .filter(|p| p.nominal.is_some())
        .map(|p| Bar {
            label: p.label.clone(),
            percent: p.percent.unwrap_or(f64::NAN),
            dye: match p.status {
                ExpectedStatus::Well => BLUE,
                ExpectedStatus::Poor => ORANGE,
                _ => GREY,
            },
        })
        .collect();
    if !bars.is_empty() {
        out.push_str(&figure(&Figure {
            name: "predicted-deviations".to_owned(),
            caption: "predicted standard deviations of the base parameters, in percent of their \
                      nominal values; no bar if the data do not determine a parameter"
                .to_owned(),
            svg: charts::deviations(&bars, WELL_IDENTIFIED_PERCENT)?,
        }));
    }
    let number = |value: Option<f64>| value.map_or("–".to_owned(), four);
    let rows: Vec<Vec<String>> = found
        .parameters
        .iter()
        .map(|p| {
            let needs: Vec<String> = p.needs.iter().map(ToString::to_string).collect();
            vec![
                label(&p.label),
                match p.status {
                    ExpectedStatus::Well | ExpectedStatus::Determined => p.status.name().to_owned(),
                    _ => format!("<b>{}</b>", p.status.name()),
                },
                number(p.nominal),
                number(p.sigma),
                number(p.percent),
                number(p.well_from),
                escaped(&needs.join(", or ")),
            ]
        })
        .collect();
    out.push_str(&table(
        "Base parameters, SI: the value above which each would be well identified, and the motion \
         that would determine a poor one better",
        &[
            "parameter",
            "status",
            "nominal",
            "sigma",
            "%",
            "well from",
            "needs",
        ],
        &rows,
    ));
    Ok(section("prediction", "What these logs can identify", &out))
}
