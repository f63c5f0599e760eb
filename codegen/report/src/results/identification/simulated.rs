//! What estimators that simulate the controlled robot add to a result.

use std::fmt::Write as _;

use regen_codegen::explain::lines::{columns, field};
use regen_identify::text::{figure, figure_of};
use regen_response::{Departure, ResponseFit};
use serde::Serialize;

/// What estimators that simulate the controlled robot add to a result, as it is serialised.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Simulated {
    /// The rounds of DIDIM.
    Didim(Rounds),
    /// The search of a fit to responses.
    Response(Search),
}

/// The rounds of DIDIM.
#[derive(Clone, Debug, Serialize)]
pub struct Rounds {
    #[serde(rename = "rounds")]
    count: usize,
    /// eps_RA of each round, percent.
    relative_absolute: Vec<f64>,
    /// How far the simulated motion is from measured positions.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    departures: Vec<MotionDeparture>,
    /// The bandwidth of controllers whose gains are not known, Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    bandwidth: Option<f64>,
}

/// How far the simulated motion of a coordinate is from measured positions.
#[derive(Clone, Debug, Serialize)]
struct MotionDeparture {
    name: String,
    /// The root mean square of the difference, percent of that of the measured motion about its
    /// mean.
    percent: f64,
}

/// The search of a fit to responses.
#[derive(Clone, Debug, Serialize)]
pub struct Search {
    windows: usize,
    steps: usize,
    /// Candidates that could not be simulated.
    refused: usize,
    /// Gains and values of signals that were estimated.
    estimated: Vec<EstimatedToo>,
    undetermined: Vec<UndeterminedDirection>,
    /// How well the estimate predicts the efforts of the logs, which it did not use.
    #[serde(skip_serializing_if = "Option::is_none")]
    efforts: Option<EffortsOfLogs>,
}

/// How well a fit to responses predicts the efforts of its logs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EffortsOfLogs {
    /// eps_RA, the largest of all logs, percent.
    pub relative_absolute: f64,
    /// That of least squares of the same efforts, percent.
    pub least_squares: f64,
}

#[derive(Clone, Debug, Serialize)]
struct EstimatedToo {
    label: String,
    value: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    sigma: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    interval: Option<[f64; 2]>,
}

/// A direction along which nothing changes the responses.
#[derive(Clone, Debug, Serialize)]
struct UndeterminedDirection {
    words: String,
    terms: Vec<(String, f64)>,
}

impl Simulated {
    /// The rounds of DIDIM.
    ///
    /// - `norms`: eps_RA of each round, percent;
    /// - `departures`: how far the simulated motion is from measured positions;
    /// - `bandwidth`: of controllers whose gains are not known, Hz.
    pub fn didim(norms: &[f64], departures: &[Departure], bandwidth: Option<f64>) -> Self {
        let departures = departures.iter().map(|own| MotionDeparture {
            name: own.name.clone(),
            percent: own.percent,
        });
        Self::Didim(Rounds {
            count: norms.len(),
            relative_absolute: norms.to_vec(),
            departures: departures.collect(),
            bandwidth,
        })
    }

    /// The search of a fit to responses.
    pub fn responses(found: &ResponseFit) -> Self {
        let estimated = found.estimated.iter().map(|e| EstimatedToo {
            label: e.label.clone(),
            value: e.value,
            sigma: e.interval.map(|i| i.sigma),
            interval: e.interval.map(|i| [i.low, i.high]),
        });
        let undetermined = found.undetermined.iter().map(|d| UndeterminedDirection {
            words: d.to_string(),
            terms: d.terms.clone(),
        });
        Self::Response(Search {
            windows: found.windows,
            steps: found.steps,
            refused: found.refused,
            estimated: estimated.collect(),
            undetermined: undetermined.collect(),
            efforts: None,
        })
    }

    /// Adds how well a fit to responses predicts the efforts of its logs.
    #[must_use]
    pub fn with_efforts(mut self, efforts: Option<EffortsOfLogs>) -> Self {
        if let Self::Response(found) = &mut self {
            found.efforts = efforts;
        }
        self
    }

    /// What the responses leave undetermined, in words.
    pub(super) fn undetermined(&self) -> Vec<&str> {
        match self {
            Self::Didim(_) => Vec::new(),
            Self::Response(found) => {
                let directions = found.undetermined.iter();
                directions.map(|d| d.words.as_str()).collect()
            }
        }
    }

    /// The lines above the tables.
    pub(super) fn to_text(&self) -> String {
        match self {
            Self::Didim(found) => {
                let errors: Vec<String> = found
                    .relative_absolute
                    .iter()
                    .map(|e| format!("{e:.3}"))
                    .collect();
                let text = format!("{}; eps_RA {} %", found.count, errors.join(", "));
                let mut out = field("rounds", &text);
                let order =
                    |a: &&MotionDeparture, b: &&MotionDeparture| a.percent.total_cmp(&b.percent);
                if let Some(most) = found.departures.iter().max_by(order) {
                    let text = format!(
                        "within {} % of the measured one, {} the most",
                        figure_of(2, most.percent),
                        most.name
                    );
                    out.push_str(&field("motion", &text));
                }
                if let Some(bandwidth) = found.bandwidth {
                    let text = format!(
                        "{} Hz, for their gains are not known",
                        figure_of(3, bandwidth)
                    );
                    out.push_str(&field("controllers", &text));
                }
                out
            }
            Self::Response(found) => {
                let mut text = format!("{} in {} windows", found.steps, found.windows);
                if found.refused > 0 {
                    let _ = write!(
                        text,
                        "; {} candidates could not be simulated",
                        found.refused
                    );
                }
                let mut out = field("steps", &text);
                if let Some(own) = &found.efforts {
                    let text = format!(
                        "of the logs are predicted with eps_RA {} %; least squares of them has {} %",
                        figure_of(3, own.relative_absolute),
                        figure_of(3, own.least_squares)
                    );
                    out.push_str(&field("efforts", &text));
                }
                out
            }
        }
    }

    /// The tables behind that of the parameters.
    pub(super) fn to_tables(&self) -> String {
        let Self::Response(found) = self else {
            return String::new();
        };
        let mut out = String::new();
        if !found.estimated.is_empty() {
            let lines: Vec<Vec<String>> = found
                .estimated
                .iter()
                .map(|e| {
                    vec![
                        e.label.clone(),
                        figure(e.value),
                        e.sigma.map_or_else(|| "-".to_owned(), |s| figure_of(3, s)),
                    ]
                })
                .collect();
            out.push('\n');
            out.push_str(&columns(&["estimated too", "value", "sigma"], &lines));
        }
        for direction in &found.undetermined {
            out.push_str(&field("undetermined", &direction.words));
        }
        out
    }
}
