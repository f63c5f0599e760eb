//! The JSON of `regen identify`.

use regen_identify::estimate::EffortError;
use regen_identify::files::{FrictionRow, ParameterFile};
use regen_identify::identify::{Delays, LeftOut};
use regen_identify::session::{CrossValidation, LeastSquaresStart, LogError};
use serde::Serialize;

use crate::identify_iv::InstrumentsJson;
use crate::identify_simulated::SimulatedJson;
use crate::observe::FileJson;
use crate::reduce::StepJson;
use crate::suspect::Suspicion;

/// The JSON of `regen identify`: the parameter file of the adopted model, and the summary of the
/// fit.
#[derive(Serialize)]
pub(crate) struct IdentifyJson {
    #[serde(flatten)]
    pub(crate) file: ParameterFile,
    #[serde(flatten)]
    pub(crate) summary: Summary,
}

/// The summary of a fit: everything but its parameters.
#[derive(Serialize)]
pub(crate) struct Summary {
    pub(crate) kind: String,
    pub(crate) equations: usize,
    pub(crate) degrees_of_freedom: usize,
    pub(crate) condition: f64,
    pub(crate) scaled_condition: f64,
    pub(crate) efforts: Vec<EffortJson>,
    /// eps_RA of the adopted model in percent; `None` without logs.
    pub(crate) relative_absolute: Option<f64>,
    /// The lag in samples up to which residuals count as correlated; `None` without logs.
    pub(crate) bandwidth: Option<usize>,
    pub(crate) singular: usize,
    /// Samples and equations that were left out; `None` without logs.
    pub(crate) left_out: Option<LeftOut>,
    /// Estimated delays of efforts behind the motion; empty without logs.
    pub(crate) delays: Delays,
    /// The delays that efforts were corrected by while reading, s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) corrected_delays: Vec<(String, f64)>,
    pub(crate) cross: Vec<CrossValidation>,
    /// The steps of `--reduce`.
    pub(crate) reduction: Vec<StepJson>,
    /// The models compared on each log; empty unless options asked for more than least squares.
    pub(crate) models: Vec<ModelJson>,
    pub(crate) files: Vec<FileJson>,
    /// The instruments of `--iv`, and the test of least squares for bias.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) instruments: Option<InstrumentsJson>,
    /// The rounds of `didim`, or the search of `response`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) simulated: Option<SimulatedJson>,
    /// Columns of the logs that look wrong.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) suspicions: Vec<Suspicion>,
}

/// The noise of an effort by least squares and, where logs are known, the error of the adopted
/// model.
#[derive(Serialize)]
pub(crate) struct EffortJson {
    pub(crate) name: String,
    pub(crate) equations: usize,
    pub(crate) sigma: f64,
    pub(crate) weight: f64,
    pub(crate) error: Option<EffortError>,
}

/// The errors of a model on the logs.
#[derive(Serialize)]
pub(crate) struct ModelJson {
    pub(crate) name: String,
    pub(crate) feasibility: String,
    /// The bound on how far the objective can exceed the optimum, as a part of the objective.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) gap: Option<f64>,
    pub(crate) base: Vec<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) friction: Vec<FrictionRow>,
    pub(crate) logs: Vec<LogError>,
}

impl Summary {
    /// The summary of a least-squares fit; the results of later steps are empty.
    pub(crate) fn of(start: &LeastSquaresStart) -> Self {
        let estimate = &start.estimate;
        let efforts = estimate.efforts.iter().enumerate();
        let efforts = efforts.map(|(k, e)| EffortJson {
            name: e.name.clone(),
            equations: e.rows,
            sigma: e.sigma,
            weight: e.weight,
            error: start.errors.get(k).cloned(),
        });
        Self {
            kind: start.kind.clone(),
            equations: estimate.efforts.iter().map(|e| e.rows).sum(),
            degrees_of_freedom: estimate.degrees_of_freedom,
            condition: estimate.condition,
            scaled_condition: estimate.scaled_condition,
            efforts: efforts.collect(),
            relative_absolute: start.relative_absolute,
            bandwidth: start.bandwidth,
            singular: start.left_out.as_ref().map_or(0, |left| left.singular),
            left_out: start.left_out.clone(),
            delays: start.delays.clone(),
            corrected_delays: Vec::new(),
            cross: Vec::new(),
            reduction: Vec::new(),
            models: Vec::new(),
            files: start.reports.iter().map(FileJson::new).collect(),
            instruments: None,
            simulated: None,
            suspicions: Vec::new(),
        }
    }
}
