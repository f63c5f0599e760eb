//! The base parameters of a robot and their certificate.

use regen_codegen::base::certificate::Certificate;
use regen_codegen::base::{Analysis, BaseParameter, Exactness, Term};
use regen_codegen::explain::Grouped;
use regen_codegen::explain::lines::field;
use regen_codegen::explain::table::{self as words, completed, doubt, label, largest_term, layer};
use regen_codegen::robot::Robot;
use serde::Serialize;

/// The base parameters of a robot, to be serialised.
#[derive(Serialize)]
pub struct BaseJson<'a> {
    robot: &'a str,
    parameters: Vec<&'a str>,
    rank: usize,
    base: Vec<Row<'a>>,
    null_directions: NullDirections,
    certificate: Option<CertificateJson>,
    /// The largest coefficient of an eliminated parameter; null without combinations.
    largest_coefficient: Option<f64>,
    /// The condition of the sampled rows, with the kept columns scaled to length 1; null if it is
    /// unknown or above 1e7.
    condition: Option<f64>,
    /// The payloads, whose base parameters are separate from the robot's.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    payloads: Vec<PayloadJson<'a>>,
    complete: bool,
    /// The reason why the base parameters are incomplete.
    reason: Option<String>,
    trees_opened: usize,
    equal_by_value: &'a [String],
    /// Names of geometric values that were not varied: completed factors hold at these values only.
    held: &'a [String],
    /// Names at other values of which every row was checked, except rows whose factors hold `here`.
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    varied: &'a [String],
    /// Values of named angles at which the rank is lower, with the rank: `12 at alpha = pi/2`.
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    special: &'a [String],
    /// Factors that are numbers, for which no expression was found.
    unrecognised: &'a [String],
    /// The reasons why completed parameters act only in combination, one per eliminated parameter.
    reasons: Vec<Reason<'a>>,
    known: Vec<KnownJson<'a>>,
    dropped: Vec<Row<'a>>,
}

#[derive(Serialize)]
struct Reason<'a> {
    parameter: &'a str,
    with: &'a [String],
    #[serde(rename = "reason")]
    why: Option<&'a str>,
}

/// A payload and the number of its base parameters.
#[derive(Serialize)]
struct PayloadJson<'a> {
    body: &'a str,
    rank: usize,
}

#[derive(Serialize)]
struct Row<'a> {
    label: &'a str,
    /// The payload that it belongs to; absent for the robot's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    payload: Option<&'a str>,
    terms: Vec<TermJson<'a>>,
    layer: &'static str,
    /// `everywhere` (symbolic), `here` (at the spec's geometric values only) or `digits` (a
    /// number).
    factors: &'static str,
}

#[derive(Serialize)]
struct TermJson<'a> {
    parameter: &'a str,
    coefficient: String,
    value: f64,
}

#[derive(Serialize)]
struct KnownJson<'a> {
    parameter: &'a str,
    terms: Vec<TermJson<'a>>,
}

#[derive(Serialize)]
struct NullDirections {
    trees: usize,
    completed: usize,
}

/// A certificate of base parameters.
#[derive(Serialize)]
struct CertificateJson {
    columns: usize,
    rank: usize,
    states: usize,
    digits: usize,
    #[serde(rename = "smallest_kept")]
    smallest_pivot: f64,
    #[serde(rename = "largest_dropped")]
    largest_remainder: f64,
}

/// The base parameters of a robot, to be serialised.
///
/// - `reasons`: the reasons why the parameters of completed directions act only in combination.
pub fn base<'a>(robot: &'a Robot, analysis: &'a Analysis, reasons: &'a [Grouped]) -> BaseJson<'a> {
    let own = &analysis.base;
    let rows = |dropped: bool| -> Vec<Row<'a>> {
        let rows = own.parameters.iter().filter(|p| p.dropped == dropped);
        rows.map(|p| row(robot, p)).collect()
    };
    BaseJson {
        robot: &robot.name,
        parameters: robot.labels(),
        rank: own.rank(),
        base: rows(false),
        null_directions: NullDirections {
            trees: own.from_trees,
            completed: completed(analysis),
        },
        certificate: analysis.certificate.as_ref().ok().map(certificate),
        largest_coefficient: largest_term(analysis).map(|(term, _)| term.value.to_f64().abs()),
        condition: analysis.condition.filter(|c| c.is_finite()),
        payloads: payloads(robot, analysis),
        complete: analysis.complete,
        reason: doubt(analysis),
        trees_opened: own.trees,
        equal_by_value: &own.coincidences,
        held: &own.unvaried_names,
        varied: &own.varied_names,
        special: &own.special_angles,
        unrecognised: &own.unrecognised,
        reasons: reasons
            .iter()
            .map(|r| Reason {
                parameter: &r.parameter,
                with: &r.with,
                why: r.reason.as_deref(),
            })
            .collect(),
        known: own
            .known
            .iter()
            .map(|known| KnownJson {
                parameter: label(robot, known.column),
                terms: terms(robot, &known.terms),
            })
            .collect(),
        dropped: rows(true),
    }
}

fn payloads<'a>(robot: &'a Robot, analysis: &Analysis) -> Vec<PayloadJson<'a>> {
    let bodies = robot.payloads.iter().filter_map(|b| robot.bodies.get(*b));
    let count = |body: &String| {
        let own = |p: &&BaseParameter| robot.payload_of(p.column) == Some(body) && !p.dropped;
        analysis.base.parameters.iter().filter(own).count()
    };
    bodies
        .map(|body| PayloadJson {
            body,
            rank: count(body),
        })
        .collect()
}

fn row<'a>(robot: &'a Robot, parameter: &'a BaseParameter) -> Row<'a> {
    Row {
        label: label(robot, parameter.column),
        payload: robot.payload_of(parameter.column),
        terms: terms(robot, &parameter.terms),
        layer: layer(parameter.provenance),
        factors: match parameter.exactness {
            Exactness::Symbolic => "everywhere",
            Exactness::AtThisGeometry => "here",
            Exactness::Numeric => "digits",
        },
    }
}

fn terms<'a>(robot: &'a Robot, terms: &'a [Term]) -> Vec<TermJson<'a>> {
    let term = |term: &'a Term| TermJson {
        parameter: label(robot, term.column),
        coefficient: term.coefficient.to_string(),
        value: term.value.to_f64(),
    };
    terms.iter().map(term).collect()
}

fn certificate(c: &Certificate) -> CertificateJson {
    CertificateJson {
        columns: c.columns,
        rank: c.rank,
        states: c.states,
        digits: c.digits,
        smallest_pivot: c.smallest_pivot,
        largest_remainder: c.largest_remainder,
    }
}

/// Rank, completeness and certificate of base parameters, to be serialised.
#[derive(Serialize)]
pub struct BaseSummary {
    rank: usize,
    complete: bool,
    certificate: Option<CertificateJson>,
}

/// Rank, completeness and certificate of base parameters, to be serialised.
pub fn base_summary(analysis: &Analysis) -> BaseSummary {
    BaseSummary {
        rank: analysis.base.rank(),
        complete: analysis.complete,
        certificate: analysis.certificate.as_ref().ok().map(certificate),
    }
}

/// Two lines of text on base parameters: their number, and the certificate.
pub fn base_lines(analysis: &Analysis) -> String {
    let rank = match doubt(analysis) {
        None => format!("{} base parameters", analysis.base.rank()),
        Some(why) => format!("INCOMPLETE: {why}"),
    };
    let certificate = words::certificate(analysis);
    field("base", &rank) + &field("certificate", &certificate)
}
