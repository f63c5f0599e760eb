//! Identified parameters: their rows, and the files that hold them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use regen_runtime::estimate::Estimate;
use regen_runtime::identify::digest;
use regen_runtime::{BaseModel, BaseParameter, Info, Model, Motion};
use serde::{Deserialize, Serialize};

use crate::exit::Failure;
use crate::interpreted::Interpreted;
use crate::load;

/// Relative deviations below this, in percent, are of well identified parameters (section 5.3).
const WELL: f64 = 15.0;

/// One identified base parameter.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ParameterRow {
    pub(crate) label: String,
    /// The combination that it stands for.
    pub(crate) combination: String,
    pub(crate) unit: String,
    pub(crate) value: f64,
    /// Its standard deviation, which knows of correlated residuals where these are known.
    pub(crate) sigma: f64,
    /// The standard deviation for white residuals.
    pub(crate) sigma_white: f64,
    pub(crate) sigma_percent: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// `well identified` or `poorly identified`.
    pub(crate) status: String,
}

/// A file of identified parameters.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ParameterFile {
    pub(crate) robot: String,
    pub(crate) model: String,
    pub(crate) confidence: f64,
    pub(crate) parameters: Vec<ParameterRow>,
}

impl ParameterFile {
    /// The rows of an estimate; `used` is the same with the covariance that counts.
    pub(crate) fn new(
        model: &Interpreted<'_>,
        white: &Estimate,
        used: &Estimate,
        confidence: f64,
    ) -> Self {
        let info = model.info();
        let base = model.base_info().base;
        let row = |(k, label): (usize, &String)| {
            let value = used.values.get(k).copied().unwrap_or(f64::NAN);
            let half = used.half_width(k, confidence);
            let percent = used.sigma_percent(k);
            let known = base.iter().find(|b| b.label == label);
            ParameterRow {
                label: label.clone(),
                combination: known.map_or_else(|| label.clone(), combination),
                unit: unit(&info, label).to_owned(),
                value,
                sigma: used.sigma(k),
                sigma_white: white.sigma(k),
                sigma_percent: percent,
                low: value - half,
                high: value + half,
                status: if percent < WELL {
                    "well identified".to_owned()
                } else {
                    "poorly identified".to_owned()
                },
            }
        };
        Self {
            robot: info.name.to_owned(),
            model: digest(model),
            confidence,
            parameters: used.labels.iter().enumerate().map(row).collect(),
        }
    }
}

/// A combination in four digits.
fn combination(parameter: &BaseParameter<'_>) -> String {
    let mut out = String::new();
    for (k, term) in parameter.terms.iter().enumerate() {
        let sign = if term.value < 0.0 { "-" } else { "+" };
        let size = term.value.abs();
        let _ = match k {
            0 => write!(out, "{}", term.parameter),
            _ if (size - 1.0).abs() < 1e-12 => write!(out, " {sign} {}", term.parameter),
            _ => write!(out, " {sign} {size:.4} {}", term.parameter),
        };
    }
    out
}

/// The unit of a parameter by its label.
fn unit(info: &Info<'_>, label: &str) -> &'static str {
    let (symbol, of) = label.split_once('(').unwrap_or((label, ""));
    let joint = info
        .index_of(of.trim_end_matches(')'))
        .and_then(|k| info.joints.get(k));
    let shift = joint.is_some_and(|j| j.motion == Motion::Shift);
    match symbol {
        "m" => "kg",
        "mx" | "my" | "mz" => "kg m",
        "Fv" | "Fv+" | "Fv-" if shift => "N s/m",
        "Fv" | "Fv+" | "Fv-" => "N m s/rad",
        "Fc" | "Fc+" | "Fc-" if shift => "N",
        "Fc" | "Fc+" | "Fc-" => "N m",
        "J" if shift => "kg",
        _ => "kg m^2",
    }
}

/// Values of the base parameters from a file.
pub(crate) fn read(path: &Path, model: &Interpreted<'_>) -> Result<Vec<f64>, Failure> {
    let text = load::text(path)?;
    let wrong = |why: String| Failure::Input(format!("{}: {why}", path.display()));
    let values: BTreeMap<String, f64> = match serde_json::from_str::<ParameterFile>(&text) {
        Ok(file) => {
            let own = digest(model);
            if file.model != own {
                return Err(wrong(format!(
                    "these are parameters of {} with the digest {}, the spec's model has {own}: \
                     identify again with this spec",
                    file.robot, file.model
                )));
            }
            let rows = file.parameters.into_iter();
            rows.map(|row| (row.label, row.value)).collect()
        }
        Err(why) => serde_json::from_str(&text).map_err(|_| {
            wrong(format!(
                "is neither what `regen identify --out` writes ({why}) nor an object of labels \
                 with numbers"
            ))
        })?,
    };
    let info = model.info();
    let all = |labels: &[&str]| -> Option<Vec<f64>> {
        labels
            .iter()
            .map(|label| values.get(*label).copied())
            .collect()
    };
    let base: Vec<&str> = model.base_info().base.iter().map(|b| b.label).collect();
    if let Some(phi) = all(info.parameters) {
        let mut beta = vec![0.0; base.len()];
        model.to_base(&phi, &mut beta)?;
        return Ok(beta);
    }
    if let Some(beta) = all(&base) {
        return Ok(beta);
    }
    let missing: Vec<&str> = base
        .into_iter()
        .filter(|label| !values.contains_key(*label))
        .collect();
    Err(wrong(format!(
        "values are missing for {}",
        missing.join(", ")
    )))
}
