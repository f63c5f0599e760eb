//! Reads and writes files of identified parameters, and reads states of motion; errors say where in
//! the text the mistakes are.

mod constants;
mod error;
mod json;
mod loads;
mod places;
mod predictions;
mod rows;
mod states;
mod yaml;

use std::collections::{BTreeMap, BTreeSet};

use regen_runtime::{BaseModel, BaseParameter, Info};
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use crate::document::{Mistake, Mistakes, Remedy, require_regular};
pub use constants::{c_constants, python_constants, rust_constants};
pub use error::FileError;
pub use loads::{CovarianceRows, GainRow, PayloadRow, PayloadValueRow};
pub use places::part_at;
pub use predictions::Predictions;
pub use rows::{BodyRow, FrictionRow, IntervalRow, LeastSquaresRow, ParameterRow, PhysicalRow};
pub use states::{MotionState, State, states};

use crate::choice::Choice;
use crate::feasibility::{ParameterLayout, unit};
use crate::identify::digest;
use crate::model::{IdentifiedModel, Provenance};
use crate::status::{EffortContributions, Status};

/// The format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// JSON.
    Json,
    /// YAML 1.2.
    Yaml,
}

impl Format {
    /// The format by a file's name: YAML if it ends in `.yaml` or `.yml`, JSON otherwise.
    ///
    /// ```
    /// use regen_identify::files::Format;
    ///
    /// assert_eq!(Format::of("arm.YML".as_ref()), Format::Yaml);
    /// assert_eq!(Format::of("arm.json".as_ref()), Format::Json);
    /// ```
    pub fn of(path: &std::path::Path) -> Self {
        let extension = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
        match extension {
            Some(e) if e == "yaml" || e == "yml" => Self::Yaml,
            _ => Self::Json,
        }
    }

    /// Parses a text of this format.
    ///
    /// # Errors
    /// [`FileError::Syntax`], with the line and column of the mistake.
    pub fn value(self, text: &str) -> Result<Value, FileError> {
        match self {
            Self::Yaml => yaml::value(text).map_err(FileError::Syntax),
            Self::Json => json::value(text).map_err(|error| {
                let kind = if error.is_data() { "" } else { "not JSON: " };
                FileError::Syntax(format!("{kind}{error}"))
            }),
        }
    }

    /// Writes a value as text of this format, with a final end of line.
    ///
    /// # Errors
    /// [`FileError::Syntax`] for a value that the format cannot represent, such as a map whose keys
    /// are no strings.
    pub fn text<T: Serialize>(self, value: &T) -> Result<String, FileError> {
        match self {
            Self::Yaml => yaml::text(value).map_err(FileError::Syntax),
            Self::Json => serde_json::to_string(value)
                .map(|text| text + "\n")
                .map_err(|error| FileError::Syntax(error.to_string())),
        }
    }
}

/// The content of a file of identified parameters. All lists belong to the adopted model, except
/// `least_squares`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ParameterFile {
    /// The robot's name.
    pub robot: String,
    /// The [`digest`] of the robot's model.
    pub model: String,
    /// The estimator: `least squares`, `feasible`, ...
    pub method: String,
    /// The names of the logs that the values were identified from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub logs: Vec<String>,
    /// The date of the identification, as the caller gave it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date: Option<String>,
    /// The filter that was chosen from the logs, where none was given; `validate` uses it too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter: Option<Choice>,
    /// The verdict on the physical feasibility, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feasibility: Option<String>,
    /// The bound on how far the objective of a physically feasible model can exceed the optimum, as
    /// a part of the objective.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<f64>,
    /// The level of the confidence intervals, in (0, 1).
    pub confidence: f64,
    /// How the standard deviations were computed, in words.
    #[serde(default)]
    pub deviations: String,
    /// The base parameters.
    pub parameters: Vec<ParameterRow>,
    /// The least-squares parameters, where another model was adopted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub least_squares: Vec<LeastSquaresRow>,
    /// Nonlinear friction, which is not among the base parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub friction: Vec<FrictionRow>,
    /// The gains of drives whose efforts were measured as currents.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gains: Vec<GainRow>,
    /// The payloads that runs carried.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub payloads: Vec<PayloadRow>,
    /// The covariance of base parameters and gains.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<CovarianceRows>,
    /// All parameters of a physically feasible model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub physical: Vec<PhysicalRow>,
    /// The bodies as in a spec, by label.
    #[serde(skip_deserializing, skip_serializing_if = "BTreeMap::is_empty")]
    pub bodies: BTreeMap<String, BodyRow>,
    /// Linear friction, offset and rotor inertia of each joint, by symbol.
    #[serde(skip_deserializing, skip_serializing_if = "BTreeMap::is_empty")]
    pub joints: BTreeMap<String, BTreeMap<String, f64>>,
}

/// Whether a base parameter is friction or the inertia of a drive alone, which is never below zero.
fn is_never_negative(parameter: &BaseParameter<'_>) -> bool {
    let label = parameter.label;
    let of_drive = label.starts_with("Fv") || label.starts_with("Fc") || label.starts_with("J(");
    of_drive && rows::combination(parameter) == label
}

impl ParameterFile {
    /// Builds the file's content from an identified model.
    ///
    /// - `shares`: the contributions of the base parameters to the efforts of the fit;
    /// - `least`: the least-squares parameters, where they are another model;
    /// - `confidence`: the level of the model's intervals, in (0, 1).
    ///
    /// # Errors
    /// When parameters of the model have labels that no body or joint has.
    pub fn new<M: BaseModel<f64> + ?Sized>(
        model: &M,
        identified: &IdentifiedModel,
        shares: &EffortContributions,
        least: Vec<LeastSquaresRow>,
        confidence: f64,
    ) -> Result<Self, FileError> {
        let info = model.info();
        let base = model.base_info().base.iter().enumerate();
        let values = base.zip(&identified.beta);
        let parameters = values.map(|((k, parameter), value)| {
            let interval = identified.intervals.base.get(k).copied().flatten();
            let sigma = interval.map_or(f64::NAN, |i| i.sigma);
            let status = if identified.left_out.contains(&k) {
                Status::LeftOut
            } else {
                let bias = identified.intervals.bias.get(k).copied().unwrap_or(0.0);
                let found = shares.status_with_bias(k, *value, sigma, bias);
                if is_never_negative(parameter) {
                    EffortContributions::of_positive(found, *value, sigma)
                } else {
                    found
                }
            };
            let share = shares.percent(k, *value);
            ParameterRow::new(parameter, &info, *value, interval, share, status)
        });
        let mut file = Self {
            robot: info.name.to_owned(),
            model: digest(model),
            method: identified.name.clone(),
            logs: identified.provenance.logs.clone(),
            date: identified.provenance.date.clone(),
            filter: identified.provenance.filter.clone(),
            feasibility: (!identified.feasibility.is_empty())
                .then(|| identified.feasibility.clone()),
            gap: identified.gap,
            confidence,
            deviations: identified.intervals.method.clone(),
            parameters: parameters.collect(),
            least_squares: least,
            friction: rows::friction(identified),
            gains: identified
                .gains
                .iter()
                .map(|g| GainRow::new(g, &info))
                .collect(),
            payloads: identified.payloads.iter().map(PayloadRow::new).collect(),
            covariance: identified.covariance.as_ref().map(CovarianceRows::new),
            physical: Vec::new(),
            bodies: BTreeMap::new(),
            joints: BTreeMap::new(),
        };
        if let Some(phi) = &identified.phi {
            let layout = ParameterLayout::of(info.parameters)?;
            let intervals = &identified.intervals.physical;
            let labels = layout.labels().iter().enumerate();
            file.physical = labels
                .zip(phi)
                .map(|((k, label), value)| {
                    let interval = intervals.get(k).copied().flatten();
                    PhysicalRow::new(label, &info, *value, interval)
                })
                .collect();
            file.bodies = rows::bodies(&layout, phi);
            file.joints = rows::joints(info.parameters, phi);
        }
        Ok(file)
    }
}

/// The part of a file's content that is read: values without standard deviations.
#[derive(Deserialize)]
struct FileContent {
    robot: String,
    model: String,
    #[serde(default)]
    method: Option<String>,
    #[serde(default)]
    logs: Vec<String>,
    #[serde(default)]
    date: Option<String>,
    #[serde(default)]
    filter: Option<Choice>,
    parameters: Vec<ReadRow>,
    #[serde(default)]
    physical: Vec<ReadRow>,
    #[serde(default)]
    friction: Vec<FrictionRow>,
    #[serde(default)]
    gains: Vec<GainRow>,
    #[serde(default)]
    payloads: Vec<PayloadRow>,
    #[serde(default)]
    covariance: Option<CovarianceRows>,
}

#[derive(Deserialize)]
struct ReadRow {
    label: String,
    value: f64,
    #[serde(default)]
    unit: Option<String>,
}

/// The keys of a file.
const KEYS: [&str; 19] = [
    "robot",
    "model",
    "method",
    "logs",
    "date",
    "filter",
    "feasibility",
    "gap",
    "confidence",
    "deviations",
    "parameters",
    "least_squares",
    "friction",
    "gains",
    "payloads",
    "covariance",
    "physical",
    "bodies",
    "joints",
];

/// The further keys of what `regen identify --format json` prints, which has a file's keys too.
const PRINTED_KEYS: [&str; 22] = [
    "version",
    "bandwidth",
    "bias_remedy",
    "condition",
    "corrected_delays",
    "cross",
    "degrees_of_freedom",
    "delays",
    "efforts",
    "equations",
    "files",
    "instruments",
    "kind",
    "left_out",
    "models",
    "reduction",
    "relative_absolute",
    "relative_absolute_without_delays",
    "scaled_condition",
    "simulated",
    "singular",
    "suspicions",
];
/// The version of what is printed.
const VERSION: u64 = 1;

fn wrong(place: &str, why: String) -> FileError {
    FileError::Content {
        place: place.to_owned(),
        why,
    }
}

/// Refuses names that are given twice or are none of the known ones.
fn require_names<'a>(
    list: &str,
    names: impl Iterator<Item = &'a str>,
    known: &[&str],
    robot: &str,
) -> Result<(), FileError> {
    let mut seen = BTreeSet::new();
    for (k, name) in names.enumerate() {
        let place = format!("{list}, row {}", k + 1);
        if !seen.insert(name) {
            return Err(wrong(&place, format!("`{name}` is given twice")));
        }
        if !known.contains(&name) {
            let why = format!(
                "`{name}` is none of {robot}'s: there are {}",
                known.join(", ")
            );
            return Err(wrong(&place, why));
        }
    }
    Ok(())
}

/// The keys of the rows of each list, of which the first ones are required.
const ROWS: [(&str, usize, &[&str]); 6] = [
    (
        "parameters",
        2,
        &[
            "label",
            "value",
            "combination",
            "unit",
            "sigma",
            "sigma_white",
            "sigma_percent",
            "low",
            "high",
            "share",
            "status",
        ],
    ),
    (
        "least_squares",
        2,
        &[
            "label",
            "value",
            "unit",
            "sigma",
            "sigma_white",
            "low",
            "high",
        ],
    ),
    (
        "physical",
        2,
        &["label", "value", "unit", "sigma", "low", "high"],
    ),
    (
        "friction",
        3,
        &["joint", "law", "coefficients", "intervals"],
    ),
    (
        "gains",
        3,
        &["effort", "value", "unit", "sigma", "low", "high"],
    ),
    ("payloads", 2, &["body", "values"]),
];
/// The keys of the values of a payload.
const PAYLOAD_KEYS: [&str; 7] = ["name", "value", "unit", "known", "sigma", "low", "high"];
/// The keys of intervals, of bodies and of a covariance.
const INTERVAL_KEYS: [&str; 3] = ["sigma", "low", "high"];
const BODY_KEYS: [&str; 3] = ["mass", "com", "inertia"];
const COVARIANCE_KEYS: [&str; 2] = ["labels", "lower"];
/// The keys whose values are numbers, or null where they are unknown.
const NUMBERS: [&str; 7] = [
    "value",
    "sigma",
    "sigma_white",
    "sigma_percent",
    "low",
    "high",
    "share",
];

/// Refuses rows of a file that lack a key or have one that is not known, or text for a number.
fn require_rows(value: &Value) -> Result<(), FileError> {
    for (list, required, keys) in ROWS {
        let Some(rows) = value.get(list) else {
            continue;
        };
        let Some(rows) = rows.as_array() else {
            return Err(wrong(list, "a list of rows is needed here".to_owned()));
        };
        for (k, row) in rows.iter().enumerate() {
            let place = format!("{list}, row {}", k + 1);
            require_keys(&place, row, required, keys)?;
            let values = row.get("values").and_then(Value::as_array);
            for (k, own) in values.into_iter().flatten().enumerate() {
                let place = format!("{place}, values, row {}", k + 1);
                require_keys(&place, own, 4, &PAYLOAD_KEYS)?;
            }
            let intervals = row.get("intervals").and_then(Value::as_object);
            for (symbol, own) in intervals.into_iter().flatten() {
                let place = format!("{place}, intervals, {symbol}");
                require_keys(&place, own, INTERVAL_KEYS.len(), &INTERVAL_KEYS)?;
            }
        }
    }
    let bodies = value.get("bodies").and_then(Value::as_object);
    for (label, own) in bodies.into_iter().flatten() {
        require_keys(&format!("bodies, {label}"), own, 0, &BODY_KEYS)?;
    }
    match value.get("covariance").filter(|own| !own.is_null()) {
        Some(own) => require_keys("covariance", own, COVARIANCE_KEYS.len(), &COVARIANCE_KEYS),
        None => Ok(()),
    }
}

/// Refuses a row that lacks one of the first keys or has one that is not known, or text for a number.
fn require_keys(place: &str, row: &Value, required: usize, keys: &[&str]) -> Result<(), FileError> {
    let Some(entries) = row.as_object() else {
        let why = format!("a row with the keys {} is needed here", keys.join(", "));
        return Err(wrong(place, why));
    };
    if let Some(key) = entries.keys().find(|key| !keys.contains(&key.as_str())) {
        let why = format!("there is no such key; there are {}", keys.join(", "));
        return Err(wrong(&format!("{place}, {key}"), why));
    }
    let mut needed = keys.iter().take(required);
    if let Some(key) = needed.find(|key| !entries.contains_key(**key)) {
        return Err(wrong(place, format!("the key `{key}` is missing")));
    }
    let is_text = |(key, own): &(&String, &Value)| {
        let is_open = own.is_null() && key.as_str() != "value";
        NUMBERS.contains(&key.as_str()) && !(own.is_number() || is_open)
    };
    match entries.iter().find(is_text) {
        Some((key, own)) => {
            let why = format!("a number is needed, and not {own}");
            Err(wrong(&format!("{place}, {key}"), why))
        }
        None => Ok(()),
    }
}

impl FileContent {
    /// Refuses keys, names and units that are not those of the model.
    fn require_fits(
        &self,
        value: &Value,
        info: &Info<'_>,
        [base, all]: [&[&str]; 2],
    ) -> Result<(), FileError> {
        let mut keys = value
            .as_object()
            .into_iter()
            .flat_map(serde_json::Map::keys);
        let known = |key: &str| KEYS.contains(&key) || PRINTED_KEYS.contains(&key);
        let version = value.get("version");
        if let Some(other) = version.filter(|own| own.as_u64() != Some(VERSION)) {
            let why = format!("is {other}, and this program reads {VERSION}");
            return Err(wrong("version", why));
        }
        if let Some(key) = keys.find(|key| !known(key)) {
            return Err(wrong(
                key,
                "files of parameters have no such key".to_owned(),
            ));
        }
        if self.robot != info.name {
            let why = format!(
                "is `{}`, and the spec's robot is `{}`",
                self.robot, info.name
            );
            return Err(wrong("robot", why));
        }
        for (list, rows, known) in [
            ("parameters", &self.parameters, base),
            ("physical", &self.physical, all),
        ] {
            let labels = rows.iter().map(|row| row.label.as_str());
            require_names(list, labels, known, info.name)?;
            for (k, row) in rows.iter().enumerate() {
                let own = unit(&row.label, info);
                if let Some(given) = row.unit.as_ref().filter(|given| *given != own) {
                    let place = format!("{list}, row {}", k + 1);
                    let why = format!("the unit of `{}` is `{own}` and not `{given}`", row.label);
                    return Err(wrong(&place, why));
                }
            }
        }
        let joints = self.friction.iter().map(|row| row.joint.as_str());
        require_names("friction", joints, info.coordinates, info.name)?;
        let efforts = self.gains.iter().map(|row| row.effort.as_str());
        require_names("gains", efforts, info.coordinates, info.name)
    }
}

impl IdentifiedModel {
    /// Reads a model from a file that [`ParameterFile`] wrote, or from an object with the labels
    /// of all parameters, or of all base parameters, as keys and SI values.
    ///
    /// # Errors
    /// [`FileError::Digest`] for parameters of another model; [`FileError::Content`] for a name that is
    /// given twice or that the model does not have, or another unit; [`FileError::Missing`] for missing
    /// values; [`FileError::NoParameters`] for other content; [`FileError::Friction`] and
    /// [`FileError::Covariance`] for friction or a covariance that cannot be read.
    ///
    /// ```
    /// # mod models {
    /// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
    /// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
    /// # }
    /// use regen_identify::IdentifiedModel;
    /// use regen_identify::files::{FileError, Format};
    ///
    /// let model = models::Pendulum;
    /// let text = r#"{"Izz(1)": 0.1, "mx(1)": 0.5}"#;
    /// let identified = IdentifiedModel::read(&Format::Json.value(text)?, &model)?;
    /// assert_eq!(identified.beta, [0.1, 0.5]);
    /// let short = IdentifiedModel::read(&Format::Json.value(r#"{"Izz(1)": 0.1}"#)?, &model);
    /// assert!(matches!(short, Err(FileError::Missing(_))));
    /// # Ok::<(), FileError>(())
    /// ```
    pub fn read<M: BaseModel<f64> + ?Sized>(value: &Value, model: &M) -> Result<Self, FileError> {
        let mut identified = IdentifiedModel {
            name: "identified".to_owned(),
            ..IdentifiedModel::default()
        };
        let info = model.info();
        let labels = info.labels();
        let labels: Vec<&str> = labels.iter().map(String::as_str).collect();
        let base: Vec<&str> = model.base_info().base.iter().map(|b| b.label).collect();
        if value.get("parameters").is_some() {
            require_rows(value)?;
        }
        let mut physical = BTreeMap::new();
        let values: BTreeMap<String, f64> = match FileContent::deserialize(value) {
            Ok(file) => {
                let own = digest(model);
                if file.model != own {
                    return Err(FileError::Digest {
                        robot: file.robot,
                        found: file.model,
                        expected: own,
                    });
                }
                file.require_fits(value, &info, [&base, &labels])?;
                identified.name = file.method.unwrap_or(identified.name);
                identified.provenance = Provenance {
                    model: file.model,
                    logs: file.logs,
                    date: file.date,
                    filter: file.filter,
                };
                for row in &file.friction {
                    identified.friction.push(row.joint()?);
                }
                identified.gains = file.gains.iter().map(GainRow::gain).collect();
                identified.payloads = file.payloads.iter().map(PayloadRow::payload).collect();
                let covariance = file.covariance.as_ref();
                identified.covariance = covariance.map(CovarianceRows::covariance).transpose()?;
                let pair = |row: ReadRow| (row.label, row.value);
                physical = file.physical.into_iter().map(pair).collect();
                file.parameters.into_iter().map(pair).collect()
            }
            Err(why) => {
                let is_label = |key: &str| labels.contains(&key) || base.contains(&key);
                let entries = value.as_object().into_iter().flatten();
                let mut labelled = entries.filter(|(key, _)| is_label(key));
                if let Some((key, own)) = labelled.find(|(_, own)| !own.is_number()) {
                    let why = format!("a number is needed, and not {own}");
                    return Err(wrong(&format!("`{key}`"), why));
                }
                let values: BTreeMap<String, f64> = BTreeMap::deserialize(value)
                    .map_err(|_| FileError::NoParameters(why.to_string()))?;
                let known = |label: &str| labels.contains(&label) || base.contains(&label);
                if let Some(label) = values.keys().find(|label| !known(label)) {
                    let why = format!(
                        "{} has no such parameter; `regen info` lists them",
                        info.name
                    );
                    return Err(wrong(&format!("`{label}`"), why));
                }
                values
            }
        };
        let all = |values: &BTreeMap<String, f64>, labels: &[&str]| -> Option<Vec<f64>> {
            let values = labels.iter().map(|label| values.get(*label).copied());
            values.collect()
        };
        // a file with `physical` lists base parameters, even if these are all parameters
        if physical.is_empty()
            && let Some(phi) = all(&values, &labels)
        {
            identified.beta = vec![0.0; base.len()];
            model.to_base(&phi, &mut identified.beta)?;
            identified.phi = Some(phi);
            return Ok(identified);
        }
        if let Some(beta) = all(&values, &base) {
            identified.beta = beta;
            identified.phi = all(&physical, &labels);
            return Ok(identified);
        }
        let missing = base
            .into_iter()
            .filter(|label| !values.contains_key(*label));
        Err(FileError::Missing(missing.map(str::to_owned).collect()))
    }
}
