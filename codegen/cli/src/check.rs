//! `regen check`: a mechanism in words.

use std::fmt::Write as _;

use regen_codegen::explain::{BodyMotion, Evidence, Explanation, Fact, Grouped, words};
use serde::Serialize;

use crate::args::{CheckArgs, Format};
use crate::exit::Failure;
use crate::progress::spinner;
use crate::{load, table, terminal};

/// Runs the command.
pub(crate) fn run(args: &CheckArgs) -> Result<(), Failure> {
    let source = load::source(&args.file)?;
    let mechanism = load::mechanism(&source)?;
    load::check_parameter_count(&mechanism)?;
    let working = spinner(format!("looking at how {} moves", source.name));
    let explanation = mechanism.explanation();
    working.finish_and_clear();
    let explanation = explanation?;
    terminal::print(&match args.format {
        Format::Human => human(&explanation),
        Format::Json => table::json(&json(&explanation)),
    })
}

/// Statements under a title, each a paragraph.
fn section(out: &mut String, title: &str, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    let _ = writeln!(out, "\n{title}");
    for line in lines {
        out.push_str(&table::item(line));
    }
}

fn with_evidence(text: &str, evidence: Evidence) -> String {
    match evidence {
        Evidence::Given => text.to_owned(),
        Evidence::Exact | Evidence::Sampled { .. } => format!("{text} ({evidence})"),
    }
}

fn facts(facts: &[Fact]) -> Vec<String> {
    let line = |fact: &Fact| with_evidence(&fact.text, fact.evidence);
    facts.iter().map(line).collect()
}

fn human(explanation: &Explanation) -> String {
    let mut out = table::paragraph(&format!(
        "{}: a mechanism of mobility {}",
        explanation.robot, explanation.mobility
    ));
    section(&mut out, "Coordinates", &facts(&explanation.coordinates));
    section(&mut out, "Loops", &facts(&explanation.loops));
    let bodies = explanation.bodies.iter();
    let bodies: Vec<String> = bodies
        .map(|body| with_evidence(&body.to_string(), body.evidence))
        .collect();
    section(&mut out, "How the bodies move", &bodies);
    section(
        &mut out,
        "Relations on this branch",
        &facts(&explanation.relations),
    );
    let unseen = explanation.unseen.iter();
    let unseen: Vec<String> = unseen
        .map(|unseen| {
            let parameters = unseen.parameters.join(" ");
            let rests = rests(unseen.derived);
            match &unseen.reason {
                Some(reason) => format!("{parameters}: {reason} ({rests})"),
                None => format!("{parameters}: no motion shows it ({rests})"),
            }
        })
        .collect();
    section(&mut out, "Parameters without any effect", &unseen);
    section(
        &mut out,
        "Parameters that act only together with others",
        &merged(&explanation.merged),
    );
    section(
        &mut out,
        "What holds at these values only",
        &facts(&explanation.values),
    );
    section(
        &mut out,
        "Where numbers are in trouble",
        &facts(&explanation.trouble),
    );
    out
}

fn rests(derived: bool) -> &'static str {
    if derived { "derived" } else { "completed" }
}

/// Merged parameters, those with one reason and one set of partners together.
fn merged(all: &[Grouped]) -> Vec<String> {
    let mut groups: Vec<(&Option<String>, bool, Vec<&str>)> = Vec::new();
    for one in all {
        let same = |group: &&mut (&Option<String>, bool, Vec<&str>)| {
            *group.0 == one.reason && group.1 == one.derived
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.2.push(&one.parameter),
            None => groups.push((&one.reason, one.derived, vec![&one.parameter])),
        }
    }
    let line = |(reason, derived, parameters): &(&Option<String>, bool, Vec<&str>)| {
        let parameters = parameters.join(" ");
        let rests = rests(*derived);
        match reason {
            Some(reason) => format!("{parameters}: {reason} ({rests})"),
            None => format!("{parameters}: no reason can be named ({rests})"),
        }
    };
    groups.iter().map(line).collect()
}

#[derive(Serialize)]
struct Json<'a> {
    robot: &'a str,
    mobility: usize,
    coordinates: Vec<FactJson<'a>>,
    loops: Vec<FactJson<'a>>,
    bodies: Vec<BodyJson<'a>>,
    relations: Vec<FactJson<'a>>,
    without_effect: Vec<UnseenJson<'a>>,
    only_together: Vec<MergedJson<'a>>,
    at_these_values: Vec<FactJson<'a>>,
    trouble: Vec<FactJson<'a>>,
}

#[derive(Serialize)]
struct FactJson<'a> {
    text: &'a str,
    #[serde(flatten)]
    evidence: EvidenceJson,
}

/// `evidence` is `given`, `exact` or `sampled`; the others are there for `sampled`.
#[derive(Serialize)]
struct EvidenceJson {
    evidence: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    states: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    digits: Option<usize>,
}

#[derive(Serialize)]
struct BodyJson<'a> {
    body: &'a str,
    motion: String,
    direction: Option<[f64; 3]>,
    #[serde(flatten)]
    evidence: EvidenceJson,
}

#[derive(Serialize)]
struct UnseenJson<'a> {
    parameters: &'a [String],
    reason: Option<&'a str>,
    rests_on: &'static str,
}

#[derive(Serialize)]
struct MergedJson<'a> {
    parameter: &'a str,
    with: &'a [String],
    reason: Option<&'a str>,
    rests_on: &'static str,
}

fn evidence(evidence: Evidence) -> EvidenceJson {
    let (name, sampled) = match evidence {
        Evidence::Given => ("given", None),
        Evidence::Exact => ("exact", None),
        Evidence::Sampled { states, digits } => ("sampled", Some((states, digits))),
    };
    EvidenceJson {
        evidence: name,
        states: sampled.map(|s| s.0),
        digits: sampled.map(|s| s.1),
    }
}

fn list(facts: &[Fact]) -> Vec<FactJson<'_>> {
    let mut all = Vec::new();
    for fact in facts {
        all.push(FactJson {
            text: &fact.text,
            evidence: evidence(fact.evidence),
        });
    }
    all
}

fn json(explanation: &Explanation) -> Json<'_> {
    let body = |b: &'_ BodyMotion| (words(b.freedom).to_owned(), evidence(b.evidence));
    Json {
        robot: &explanation.robot,
        mobility: explanation.mobility,
        coordinates: list(&explanation.coordinates),
        loops: list(&explanation.loops),
        bodies: explanation
            .bodies
            .iter()
            .map(|b| {
                let (motion, evidence) = body(b);
                BodyJson {
                    body: &b.body,
                    motion,
                    direction: b.direction,
                    evidence,
                }
            })
            .collect(),
        relations: list(&explanation.relations),
        without_effect: explanation
            .unseen
            .iter()
            .map(|u| UnseenJson {
                parameters: &u.parameters,
                reason: u.reason.as_deref(),
                rests_on: rests(u.derived),
            })
            .collect(),
        only_together: explanation
            .merged
            .iter()
            .map(|m| MergedJson {
                parameter: &m.parameter,
                with: &m.with,
                reason: m.reason.as_deref(),
                rests_on: rests(m.derived),
            })
            .collect(),
        at_these_values: list(&explanation.values),
        trouble: list(&explanation.trouble),
    }
}
