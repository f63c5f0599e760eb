//! Files of identified parameters: what `regen identify --out` writes, and what is read again.

use std::collections::BTreeMap;
use std::path::Path;

use regen_runtime::BaseModel;
use regen_runtime::feasibility::Layout;
use regen_runtime::identify::digest;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::exit::Failure;
use crate::identified::{IdentifiedModel, Interval};
use crate::load;
use crate::rows::{self, BodyRow, FrictionRow, LeastSquaresRow, ParameterRow, PhysicalRow};
use crate::status::{Shares, Status};
use crate::yaml;
use regen_interpreted::Interpreted;

/// A file of identified parameters. All lists are of the one model that was adopted, but for
/// `least_squares`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ParameterFile {
    pub(crate) robot: String,
    pub(crate) model: String,
    /// What kind of model it is: `least squares`, `feasible`, ...
    pub(crate) method: String,
    /// What is known of its feasibility.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) feasibility: Option<String>,
    pub(crate) confidence: f64,
    /// How the deviations were found.
    #[serde(default)]
    pub(crate) deviations: String,
    pub(crate) parameters: Vec<ParameterRow>,
    /// What least squares found before, where another model was adopted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) least_squares: Vec<LeastSquaresRow>,
    /// Friction that has no columns.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) friction: Vec<FrictionRow>,
    /// All parameters, where they are physical.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) physical: Vec<PhysicalRow>,
    /// The bodies as in a spec, and what joints have in robot files: for `regen export`.
    #[serde(skip_deserializing, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) bodies: BTreeMap<String, BodyRow>,
    #[serde(skip_deserializing, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) joints: BTreeMap<String, BTreeMap<String, f64>>,
}

impl ParameterFile {
    /// The file of an adopted model.
    ///
    /// - `shares`: of the fit's data, by the places of the base parameters;
    /// - `least`: what least squares found, where that is another model.
    pub(crate) fn new(
        model: &Interpreted<'_>,
        found: &IdentifiedModel,
        shares: &Shares,
        least: Vec<LeastSquaresRow>,
        confidence: f64,
    ) -> Result<Self, Failure> {
        let info = model.info();
        let base = model.base_info().base.iter().enumerate();
        let values = base.zip(&found.beta);
        let parameters = values.map(|((k, parameter), value)| {
            let interval = found.intervals.base.get(k).copied().flatten();
            let sigma = interval.map_or(f64::NAN, |i| i.sigma);
            let status = if found.left_out.contains(&k) {
                Status::LeftOut
            } else {
                shares.status(k, *value, sigma)
            };
            let share = shares.percent(k, *value);
            ParameterRow::new(parameter, &info, *value, interval, share, status)
        });
        let mut file = Self {
            robot: info.name.to_owned(),
            model: digest(model),
            method: found.name.to_owned(),
            feasibility: (!found.feasibility.is_empty()).then(|| found.feasibility.clone()),
            confidence,
            deviations: found.intervals.method.clone(),
            parameters: parameters.collect(),
            least_squares: least,
            friction: rows::friction(found),
            physical: Vec::new(),
            bodies: BTreeMap::new(),
            joints: BTreeMap::new(),
        };
        if let Some(phi) = &found.phi {
            let layout = Layout::new(info.parameters)?;
            let intervals = &found.intervals.physical;
            let labels = layout.labels().iter().enumerate();
            file.physical = labels
                .zip(phi)
                .map(|((k, label), value)| {
                    let interval: Option<Interval> = intervals.get(k).copied().flatten();
                    PhysicalRow::new(label, &info, *value, interval)
                })
                .collect();
            file.bodies = rows::bodies(&layout, phi);
            file.joints = rows::joints(&layout, phi);
        }
        Ok(file)
    }

    /// The file's text: YAML where its name ends so, JSON otherwise.
    pub(crate) fn text(&self, path: &Path) -> Result<String, Failure> {
        if !is_yaml(path) {
            return Ok(crate::table::json(self));
        }
        yaml::text(self).map_err(|error| Failure::Input(format!("{}: {error}", path.display())))
    }
}

/// Whether a file's name says that it is YAML.
pub(crate) fn is_yaml(path: &Path) -> bool {
    let extension = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
    extension.is_some_and(|e| e == "yaml" || e == "yml")
}

/// A file's content, JSON or YAML by its name.
pub(crate) fn value(path: &Path) -> Result<Value, Failure> {
    let text = load::text(path)?;
    let wrong = |why: String| Failure::Input(format!("{}: {why}", path.display()));
    if is_yaml(path) {
        return yaml::value(&text).map_err(wrong);
    }
    serde_json::from_str(&text).map_err(|error| wrong(format!("not JSON: {error}")))
}

/// What is read of a file; deviations may be unknown, and are not needed.
#[derive(Deserialize)]
struct Read {
    robot: String,
    model: String,
    parameters: Vec<ReadRow>,
    #[serde(default)]
    physical: Vec<ReadRow>,
    #[serde(default)]
    friction: Vec<FrictionRow>,
}

#[derive(Deserialize)]
struct ReadRow {
    label: String,
    value: f64,
}

/// The model that a file holds.
pub(crate) fn read(path: &Path, model: &Interpreted<'_>) -> Result<IdentifiedModel, Failure> {
    let value = value(path)?;
    let wrong = |why: String| Failure::Input(format!("{}: {why}", path.display()));
    let mut found = IdentifiedModel {
        name: "identified",
        ..IdentifiedModel::default()
    };
    let mut physical = BTreeMap::new();
    let values: BTreeMap<String, f64> = match serde_json::from_value::<Read>(value.clone()) {
        Ok(file) => {
            let own = digest(model);
            if file.model != own {
                return Err(wrong(format!(
                    "these are parameters of {} with the digest {}, the spec's model has {own}: \
                     identify again with this spec",
                    file.robot, file.model
                )));
            }
            for row in &file.friction {
                found.friction.push(row.joint().map_err(wrong)?);
            }
            let pair = |row: ReadRow| (row.label, row.value);
            physical = file.physical.into_iter().map(pair).collect();
            file.parameters.into_iter().map(pair).collect()
        }
        Err(why) => serde_json::from_value(value).map_err(|_| {
            wrong(format!(
                "is neither what `regen identify --out` writes ({why}) nor an object of labels \
                 with numbers"
            ))
        })?,
    };
    let info = model.info();
    let all = |values: &BTreeMap<String, f64>, labels: &[&str]| -> Option<Vec<f64>> {
        let values = labels.iter().map(|label| values.get(*label).copied());
        values.collect()
    };
    let base: Vec<&str> = model.base_info().base.iter().map(|b| b.label).collect();
    // a file of `identify` has base parameters in its list, even where all parameters are base
    if physical.is_empty()
        && let Some(phi) = all(&values, info.parameters)
    {
        found.beta = vec![0.0; base.len()];
        model.to_base(&phi, &mut found.beta)?;
        found.phi = Some(phi);
        return Ok(found);
    }
    if let Some(beta) = all(&values, &base) {
        found.beta = beta;
        found.phi = all(&physical, info.parameters);
        return Ok(found);
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
