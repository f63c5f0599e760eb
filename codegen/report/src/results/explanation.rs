//! The explanation of a mechanism in words.

use std::fmt::Write as _;

use regen_codegen::base::Provenance;
use regen_codegen::explain::lines::{item, paragraph};
use regen_codegen::explain::table::layer;
use regen_codegen::explain::{BodyMotion, Evidence, Explanation, Fact, Grouped, predicate};
use serde::Serialize;

/// Appends a title and the statements under it, each as a paragraph; nothing if there are none.
fn section(out: &mut String, title: &str, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    let _ = writeln!(out, "\n{title}");
    for line in lines {
        out.push_str(&item(line));
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

/// The explanation as paragraphs of at most 80 columns.
pub fn explanation_text(explanation: &Explanation) -> String {
    let mut out = paragraph(&format!(
        "{}: a mechanism of mobility {}",
        explanation.robot, explanation.mobility
    ));
    section(
        &mut out,
        "Coordinates",
        &facts(&explanation.coordinate_facts),
    );
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
    let without_effect = explanation.unidentifiable.iter();
    let without_effect: Vec<String> = without_effect
        .map(|own| {
            let parameters = own.parameters.join(" ");
            let provenance = layer(own.provenance);
            match &own.reason {
                Some(reason) => format!("{parameters}: {reason} ({provenance})"),
                None => format!("{parameters}: no motion shows it ({provenance})"),
            }
        })
        .collect();
    section(&mut out, "Parameters without any effect", &without_effect);
    section(
        &mut out,
        "Parameters that act only together with others",
        &grouped(&explanation.grouped),
    );
    section(
        &mut out,
        "What holds at these values only",
        &facts(&explanation.geometry_facts),
    );
    section(
        &mut out,
        "Where numbers are in trouble",
        &facts(&explanation.warnings),
    );
    out
}

/// Lines about parameters that are grouped with others: those with the same reason and provenance
/// share a line.
fn grouped(all: &[Grouped]) -> Vec<String> {
    let mut groups: Vec<(&Option<String>, Provenance, Vec<&str>)> = Vec::new();
    for one in all {
        let same = |group: &&mut (&Option<String>, Provenance, Vec<&str>)| {
            *group.0 == one.reason && group.1 == one.provenance
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.2.push(&one.parameter),
            None => groups.push((&one.reason, one.provenance, vec![&one.parameter])),
        }
    }
    let line = |(reason, provenance, parameters): &(&Option<String>, Provenance, Vec<&str>)| {
        let parameters = parameters.join(" ");
        let provenance = layer(*provenance);
        match reason {
            Some(reason) => format!("{parameters}: {reason} ({provenance})"),
            None => format!("{parameters}: no reason can be named ({provenance})"),
        }
    };
    groups.iter().map(line).collect()
}

/// An explanation, to be serialised.
#[derive(Serialize)]
pub struct ExplanationJson<'a> {
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

/// `evidence` is `given`, `exact` or `sampled`; `states` and `digits` are present for `sampled`.
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

/// The explanation, to be serialised.
pub fn explanation(explanation: &Explanation) -> ExplanationJson<'_> {
    let body = |b: &'_ BodyMotion| (predicate(b.freedom).to_owned(), evidence(b.evidence));
    ExplanationJson {
        robot: &explanation.robot,
        mobility: explanation.mobility,
        coordinates: list(&explanation.coordinate_facts),
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
            .unidentifiable
            .iter()
            .map(|u| UnseenJson {
                parameters: &u.parameters,
                reason: u.reason.as_deref(),
                rests_on: layer(u.provenance),
            })
            .collect(),
        only_together: explanation
            .grouped
            .iter()
            .map(|m| MergedJson {
                parameter: &m.parameter,
                with: &m.with,
                reason: m.reason.as_deref(),
                rests_on: layer(m.provenance),
            })
            .collect(),
        at_these_values: list(&explanation.geometry_facts),
        trouble: list(&explanation.warnings),
    }
}
