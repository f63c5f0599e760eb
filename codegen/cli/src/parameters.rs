//! Identified parameters: their rows, and the files that hold them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use regen_runtime::estimate::Estimate;
use regen_runtime::feasibility::{Layout, unit};
use regen_runtime::friction::JointFit;
use regen_runtime::identify::digest;
use regen_runtime::{BaseModel, BaseParameter, Friction, Model};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::exit::Failure;
use crate::identified::IdentifiedModel;
use crate::load;
use crate::yaml;
use regen_interpreted::Interpreted;

/// Relative deviations below this, in percent, are of well identified parameters (section 5.3).
pub(crate) const WELL: f64 = regen_runtime::identifiability::WELL;

/// One identified base parameter.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ParameterRow {
    pub(crate) label: String,
    /// The combination that it stands for.
    pub(crate) combination: String,
    pub(crate) unit: String,
    pub(crate) value: f64,
    /// Its standard deviation, which knows of correlated residuals where these are known; that of
    /// least squares for parameters under constraints.
    #[serde(deserialize_with = "perhaps")]
    pub(crate) sigma: f64,
    /// The standard deviation for white residuals.
    #[serde(deserialize_with = "perhaps")]
    pub(crate) sigma_white: f64,
    #[serde(deserialize_with = "perhaps")]
    pub(crate) sigma_percent: f64,
    /// The confidence interval of least squares.
    #[serde(deserialize_with = "perhaps")]
    pub(crate) low: f64,
    #[serde(deserialize_with = "perhaps")]
    pub(crate) high: f64,
    /// `well identified`, `poorly identified` or `left out`.
    pub(crate) status: String,
}

/// A file of identified parameters.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ParameterFile {
    pub(crate) robot: String,
    pub(crate) model: String,
    /// What kind of model it is: `least squares`, `feasible`, ...
    pub(crate) method: String,
    /// What is known of its feasibility.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) feasibility: Option<String>,
    pub(crate) confidence: f64,
    pub(crate) parameters: Vec<ParameterRow>,
    /// Friction that has no columns.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) friction: Vec<FrictionRow>,
    /// All parameters, where they are physical.
    #[serde(skip_deserializing, skip_serializing_if = "Vec::is_empty")]
    pub(crate) physical: Vec<PhysicalRow>,
    /// The bodies as in a spec, and what joints have in robot files: for `regen export`.
    #[serde(skip_deserializing, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) bodies: BTreeMap<String, BodyRow>,
    #[serde(skip_deserializing, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) joints: BTreeMap<String, BTreeMap<String, f64>>,
}

/// A number, or null for one that is not finite.
fn perhaps<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

/// The friction of a joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct FrictionRow {
    pub(crate) joint: String,
    pub(crate) law: String,
    pub(crate) coefficients: BTreeMap<String, f64>,
}

/// One of all parameters.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct PhysicalRow {
    pub(crate) label: String,
    pub(crate) value: f64,
    pub(crate) unit: &'static str,
}

/// A body as in a spec: inertia about the centre of mass.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BodyRow {
    mass: f64,
    com: [f64; 3],
    inertia: [f64; 6],
}

/// The laws by their names in specs.
const LAWS: [(&str, Friction); 4] = [
    ("linear", Friction::Linear),
    ("stribeck", Friction::Stribeck),
    ("atan", Friction::Atan),
    ("power", Friction::Power),
];

impl FrictionRow {
    pub(crate) fn new(joint: &JointFit) -> Self {
        let law = LAWS.iter().find(|(_, f)| *f == joint.friction);
        let symbols = joint.friction.symbols().iter();
        let pairs = symbols.zip(&joint.values);
        Self {
            joint: joint.name.clone(),
            law: law.map_or("none", |(name, _)| name).to_owned(),
            coefficients: pairs.map(|(s, v)| ((*s).to_owned(), *v)).collect(),
        }
    }

    fn joint(&self) -> Result<JointFit, String> {
        let known = LAWS.iter().find(|(name, _)| *name == self.law);
        let (_, friction) = known.ok_or_else(|| {
            let names: Vec<&str> = LAWS.iter().map(|(name, _)| *name).collect();
            format!(
                "friction of {}: `{}` is none of {}",
                self.joint,
                self.law,
                names.join(", ")
            )
        })?;
        let value = |symbol: &&str| {
            let found = self.coefficients.get(*symbol).copied();
            found.ok_or_else(|| format!("friction of {}: {symbol} is missing", self.joint))
        };
        Ok(JointFit {
            name: self.joint.clone(),
            friction: *friction,
            values: friction
                .symbols()
                .iter()
                .map(value)
                .collect::<Result<_, _>>()?,
        })
    }
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
            let known = base.iter().find(|b| b.label == label);
            ParameterRow {
                label: label.clone(),
                combination: known.map_or_else(|| label.clone(), combination),
                unit: unit(label, &info).to_owned(),
                value,
                sigma: used.sigma(k),
                sigma_white: white.sigma(k),
                sigma_percent: used.sigma_percent(k),
                low: value - half,
                high: value + half,
                status: status(used.sigma_percent(k)),
            }
        };
        Self {
            robot: info.name.to_owned(),
            model: digest(model),
            method: "least squares".to_owned(),
            feasibility: None,
            confidence,
            parameters: used.labels.iter().enumerate().map(row).collect(),
            friction: Vec::new(),
            physical: Vec::new(),
            bodies: BTreeMap::new(),
            joints: BTreeMap::new(),
        }
    }

    /// The same with the values of a model that was found; deviations and intervals stay those of
    /// least squares.
    pub(crate) fn adopt(
        &mut self,
        model: &Interpreted<'_>,
        found: &IdentifiedModel,
    ) -> Result<(), Failure> {
        let info = model.info();
        found.name.clone_into(&mut self.method);
        self.feasibility = Some(found.feasibility.clone());
        // columns of linear friction in place of another law's are listed with the friction
        self.parameters.truncate(found.beta.len());
        for (row, value) in self.parameters.iter_mut().zip(&found.beta) {
            row.value = *value;
            row.sigma_percent = 100.0 * row.sigma / value.abs();
            row.status = status(row.sigma_percent);
        }
        self.friction = found.friction.iter().map(FrictionRow::new).collect();
        let Some(phi) = &found.phi else {
            return Ok(());
        };
        let layout = Layout::new(info.parameters)?;
        let pairs = layout.labels().iter().zip(phi);
        self.physical = pairs
            .map(|(label, value)| PhysicalRow {
                label: label.clone(),
                value: *value,
                unit: unit(label, &info),
            })
            .collect();
        for body in layout.bodies() {
            let ten = body
                .columns
                .map(|c| phi.get(c).copied().unwrap_or_default());
            self.bodies.insert(body.label.clone(), BodyRow::of(&ten));
        }
        for k in layout.single() {
            let label = layout.labels().get(*k).map_or("", String::as_str);
            let split = label.strip_suffix(')').and_then(|l| l.split_once('('));
            if let (Some((symbol @ ("Fv" | "Fc" | "J"), joint)), Some(value)) = (split, phi.get(*k))
            {
                let own = self.joints.entry(joint.to_owned()).or_default();
                own.insert(symbol.to_owned(), *value);
            }
        }
        Ok(())
    }

    /// The file's text: YAML where its name ends so, JSON otherwise.
    pub(crate) fn text(&self, path: &Path) -> Result<String, Failure> {
        if !is_yaml(path) {
            return Ok(crate::table::json(self));
        }
        yaml::text(self).map_err(|error| Failure::Input(format!("{}: {error}", path.display())))
    }
}

impl BodyRow {
    /// By the parallel axis theorem.
    fn of(ten: &[f64; 10]) -> Self {
        let [xx, xy, xz, yy, yz, zz, mx, my, mz, m] = *ten;
        let [x, y, z] = if m > 0.0 {
            [mx / m, my / m, mz / m]
        } else {
            [0.0; 3]
        };
        Self {
            mass: m,
            com: [x, y, z],
            inertia: [
                xx - m * (y * y + z * z),
                xy + m * x * y,
                xz + m * x * z,
                yy - m * (x * x + z * z),
                yz + m * y * z,
                zz - m * (x * x + y * y),
            ],
        }
    }
}

fn status(percent: f64) -> String {
    let text = if percent < WELL {
        "well identified"
    } else {
        "poorly identified"
    };
    text.to_owned()
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
