//! The result of an identification, as it is serialised.

use regen_identify::estimate::{EffortError, Spectrum};
use regen_identify::files::{FrictionRow, ParameterFile};
use regen_identify::gains::GainFit;
use regen_identify::identify::{Delays, LeftOut};
use regen_identify::session::{CrossValidation, LeastSquaresStart, LogError};
use regen_identify::suspect::Suspicion;
use regen_response::ResponseFit;
use serde::Serialize;

use super::{Instruments, LogFile, ReductionStep, Simulated};

/// An identification, as it is serialised: the parameter file of the adopted model, and the summary
/// of the fit.
#[derive(Serialize)]
pub struct Identification {
    /// The adopted model.
    #[serde(flatten)]
    pub file: ParameterFile,
    /// The statistics of the fit, the steps and the other models.
    #[serde(flatten)]
    pub summary: Summary,
}

/// The summary of a fit: everything but its parameters.
#[derive(Default, Serialize)]
pub struct Summary {
    /// The name of the kind of equations.
    pub kind: String,
    /// The number of equations.
    pub equations: usize,
    /// The equations less the parameters.
    pub degrees_of_freedom: usize,
    /// The condition number of the observation matrix (Eq. 24).
    pub condition: f64,
    /// The same with columns scaled to unit length (Eq. 27).
    pub scaled_condition: f64,
    /// Each effort with its noise.
    pub efforts: Vec<EffortSummary>,
    /// The efforts whose equations are left out, as an effort acts on them that is not measured.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unmeasured: Vec<String>,
    /// eps_RA of the adopted model in percent; `None` without logs.
    pub relative_absolute: Option<f64>,
    /// The number of consecutive samples that carry the information of one independent sample, or the
    /// bandwidth that was given; `None` without logs.
    #[serde(rename = "bandwidth")]
    pub correlation_length: Option<usize>,
    /// The number of samples left out because their states are singular.
    pub singular: usize,
    /// Samples and equations that were left out; `None` without logs.
    pub left_out: Option<LeftOut>,
    /// Estimated delays of efforts behind the motion; empty without logs.
    pub delays: Delays,
    /// The delays that efforts were corrected by while reading, s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub corrected_delays: Vec<(String, f64)>,
    /// eps_RA of least squares with `--delay auto`, percent, where the delays are worth a correction that
    /// was not asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_absolute_without_delays: Option<f64>,
    /// Each log predicted by parameters from the others.
    pub cross: Vec<CrossValidation>,
    /// The steps of a reduction.
    pub reduction: Vec<ReductionStep>,
    /// The models compared on each log; empty unless options asked for more than least squares.
    pub models: Vec<ModelErrors>,
    /// The logs that were read.
    pub files: Vec<LogFile>,
    /// The instruments, and the test of least squares for bias.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instruments: Option<Instruments>,
    /// The result of an estimator that simulates the controlled robot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulated: Option<Simulated>,
    /// What was tried against values that noise of the motion biases; `None` where there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_remedy: Option<BiasRemedy>,
    /// Columns of the logs that look wrong.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub suspicions: Vec<Suspected>,
}

/// What was tried on the same logs against values that noise of the motion biases.
#[derive(Serialize)]
pub struct BiasRemedy {
    /// The options that help most of them; empty if neither another filter nor instrumental variables do.
    pub options: String,
    /// How many of them are biased with these options too, or have a deviation that is not smaller.
    pub unchanged: usize,
}

impl BiasRemedy {
    /// What helps, in words.
    pub(super) fn to_text(&self) -> String {
        match (self.options.as_str(), self.unchanged) {
            ("", _) => "neither another filter nor --iv helps (tried): move slower, or measure \
                        positions more finely"
                .to_owned(),
            (options, 0) => format!("{options} determines all of them better (tried)"),
            (options, some) => {
                format!("{options} determines all but {some} of them better (tried)")
            }
        }
    }
}

/// The noise of an effort by least squares and, if logs were read, the error of the adopted model.
#[derive(Serialize)]
pub struct EffortSummary {
    /// The name of the effort, or of the signal.
    pub name: String,
    /// The number of its equations.
    pub equations: usize,
    /// The standard deviation of its residuals, in its unit.
    pub sigma: f64,
    /// The weight of its equations.
    pub weight: f64,
    /// The error of the adopted model.
    pub error: Option<EffortError>,
}

/// The errors of a model on the logs.
#[derive(Serialize)]
pub struct ModelErrors {
    /// The name of the model.
    pub name: String,
    /// Whether its parameters are physically possible, in words.
    pub feasibility: String,
    /// The bound on how far the objective can exceed the optimum, as a part of the objective.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gap: Option<f64>,
    /// The base parameters.
    pub base: Vec<f64>,
    /// Friction beyond the base parameters.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub friction: Vec<FrictionRow>,
    /// Its error on each log.
    pub logs: Vec<LogError>,
}

/// A suspected mistake in a log, with its remedy.
#[derive(Clone, Debug, Serialize)]
pub struct Suspected {
    /// The contradiction between the log and the model.
    #[serde(flatten)]
    pub found: Suspicion,
    /// How to read the log correctly, or other advice.
    pub remedy: String,
}

impl std::fmt::Display for Suspected {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.remedy.starts_with("--column") {
            write!(
                f,
                "{}. If that is so, read it with {}",
                self.found, self.remedy
            )
        } else {
            write!(f, "{}. {}", self.found, self.remedy)
        }
    }
}

impl Summary {
    /// Whether the model explains all efforts but for noise.
    pub fn explains_all(&self) -> bool {
        let mut errors = self.efforts.iter().filter_map(|own| own.error.as_ref());
        errors.all(|error| error.of_means().is_explained())
    }

    /// The summary of a least-squares fit; the results of later steps are empty.
    pub fn of(start: &LeastSquaresStart) -> Self {
        let estimate = &start.estimate;
        let (efforts, unmeasured): (Vec<_>, Vec<_>) = estimate
            .efforts
            .iter()
            .enumerate()
            .partition(|(k, _)| !start.is_unmeasured(*k));
        let unmeasured = unmeasured.into_iter().map(|(_, e)| e.name.clone());
        let efforts = efforts.into_iter().map(|(k, e)| EffortSummary {
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
            unmeasured: unmeasured.collect(),
            relative_absolute: start.relative_absolute,
            correlation_length: start.correlation_length,
            singular: start.left_out.as_ref().map_or(0, |left| left.singular),
            left_out: start.left_out.clone(),
            delays: start.delays.clone(),
            files: start.reports.iter().map(LogFile::new).collect(),
            ..Self::default()
        }
    }
    /// The summary of a fit with unknown gains or payloads.
    ///
    /// - `kind`: the name of the kind of equations.
    pub fn of_gains(found: &GainFit, kind: String) -> Self {
        let estimate = &found.estimate;
        let efforts = estimate.efforts.iter().zip(&found.errors);
        let efforts = efforts.map(|(e, error)| EffortSummary {
            name: e.name.clone(),
            equations: e.rows,
            sigma: e.sigma,
            weight: e.weight,
            error: Some(error.clone()),
        });
        Self {
            kind,
            equations: estimate.efforts.iter().map(|e| e.rows).sum(),
            degrees_of_freedom: estimate.degrees_of_freedom,
            condition: estimate.condition,
            scaled_condition: estimate.scaled_condition,
            efforts: efforts.collect(),
            relative_absolute: Some(found.relative_absolute),
            correlation_length: Some(found.correlation_length),
            singular: found.left_out.singular,
            left_out: Some(found.left_out.clone()),
            ..Self::default()
        }
    }

    /// The summary of a fit to responses; the signals stand where efforts do.
    pub fn of_responses(found: &ResponseFit) -> Self {
        let spectrum = found.factor.spectrum().ok();
        let efforts = found.errors.iter().map(|e| EffortSummary {
            name: e.name.clone(),
            equations: e.samples,
            sigma: e.rms,
            weight: if e.rms > 0.0 { 1.0 / e.rms } else { 1.0 },
            error: Some(e.clone()),
        });
        Self {
            kind: "responses to commands".to_owned(),
            equations: found.errors.iter().map(|e| e.samples).sum(),
            degrees_of_freedom: found.factor.rows().saturating_sub(found.factor.columns()),
            condition: spectrum.as_ref().map_or(f64::NAN, Spectrum::condition),
            scaled_condition: spectrum
                .as_ref()
                .map_or(f64::NAN, Spectrum::scaled_condition),
            efforts: efforts.collect(),
            simulated: Some(Simulated::responses(found)),
            ..Self::default()
        }
    }

    /// What the data leave undetermined, in words; empty where nothing is.
    pub fn undetermined(&self) -> Vec<&str> {
        let simulated = self.simulated.as_ref();
        simulated.map_or_else(Vec::new, Simulated::undetermined)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use regen_identify::estimate::QrFactor;
    use regen_identify::model::IdentifiedModel;
    use regen_identify::suspect::Remedy;

    #[test]
    fn signals_count_by_their_errors_and_one_without_an_error_as_it_is() {
        let error = |name: &str, rms: f64| EffortError {
            name: name.to_owned(),
            samples: 100,
            relative_absolute: 2.0,
            rms,
            relative_rms: 2.0,
            largest: 0.3,
            autocorrelation: Vec::new(),
            whiteness_p_value: 0.5,
        };
        let found = ResponseFit {
            model: IdentifiedModel::default(),
            estimated: Vec::new(),
            undetermined: Vec::new(),
            errors: vec![error("q1", 0.4), error("q2", 8.0), error("q3", 0.0)],
            deviations: serde_json::from_str(
                r#"{"covariance": [], "degrees_of_freedom": [], "terms": 0, "samples": 300,
                    "memory": 1, "root": []}"#,
            )
            .unwrap(),
            factor: QrFactor::new(Vec::new()),
            windows: 1,
            steps: 1,
            refused: 0,
            converged: true,
        };
        let summary = Summary::of_responses(&found);
        assert_eq!(summary.equations, 300);
        let weights: Vec<f64> = summary.efforts.iter().map(|e| e.weight).collect();
        assert_eq!(weights, [2.5, 0.125, 1.0]);
    }

    #[test]
    fn a_suspicion_says_what_looks_wrong_and_what_to_do_about_it() {
        let suspected = |remedy: &str| Suspected {
            found: Suspicion {
                file: "a.csv".to_owned(),
                what: "tau_q1 looks reversed".to_owned(),
                error: None,
                changed: None,
                left_in_sample: None,
                efforts: Vec::new(),
                remedy: Remedy::Series,
            },
            remedy: remedy.to_owned(),
        };
        for (remedy, text) in [
            (
                "Look at the sign",
                "a.csv: tau_q1 looks reversed. Look at the sign",
            ),
            (
                "--column tau_q1=-4",
                "a.csv: tau_q1 looks reversed. If that is so, read it with --column tau_q1=-4",
            ),
        ] {
            assert_eq!(suspected(remedy).to_string(), text);
        }
    }
}
