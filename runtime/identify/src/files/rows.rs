//! The rows of identified parameters in files of JSON and YAML.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::estimate::Estimate;
use crate::feasibility::{ParameterLayout, about_centre, unit};
use crate::friction::JointFit;
use regen_runtime::{BaseParameter, Friction, Info, Parameter};
use serde::{Deserialize, Serialize};

use crate::model::{IdentifiedModel, Interval};
use crate::status::Status;

use super::FileError;

/// One base parameter of the adopted model. Standard deviations are those of the estimator that
/// gave the value, and null where it gives none.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ParameterRow {
    /// The label.
    pub label: String,
    /// The linear combination of parameters that it is, its factors in all their digits.
    pub combination: String,
    /// The unit.
    pub unit: String,
    /// The value, SI.
    pub value: f64,
    /// The standard deviation; see the file's `deviations` for how it was computed.
    #[serde(deserialize_with = "number_or_nan")]
    pub sigma: f64,
    /// The standard deviation for white residuals.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub sigma_white: f64,
    /// `sigma` in percent of the absolute value.
    #[serde(deserialize_with = "number_or_nan")]
    pub sigma_percent: f64,
    /// The lower end of the confidence interval.
    #[serde(deserialize_with = "number_or_nan")]
    pub low: f64,
    /// The upper end of the confidence interval.
    #[serde(deserialize_with = "number_or_nan")]
    pub high: f64,
    /// The contribution to the efforts, in percent: the root mean square of the parameter's column
    /// times the value over that of the efforts, all efforts with the weights of the fit.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub share: f64,
    /// How well the parameter is identified.
    pub status: Status,
}

/// The least-squares value of a base parameter, where another model was adopted.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LeastSquaresRow {
    /// The label.
    pub label: String,
    /// The unit.
    pub unit: String,
    /// The value, SI.
    pub value: f64,
    /// The standard deviation.
    #[serde(deserialize_with = "number_or_nan")]
    pub sigma: f64,
    /// The standard deviation for white residuals.
    #[serde(deserialize_with = "number_or_nan")]
    pub sigma_white: f64,
    /// The lower end of the confidence interval.
    #[serde(deserialize_with = "number_or_nan")]
    pub low: f64,
    /// The upper end of the confidence interval.
    #[serde(deserialize_with = "number_or_nan")]
    pub high: f64,
}

/// Reads a number, or NaN for null.
pub(super) fn number_or_nan<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

pub(super) fn nan() -> f64 {
    f64::NAN
}

/// The friction of a joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FrictionRow {
    /// The coordinate's name.
    pub joint: String,
    /// The name of the friction law.
    pub law: String,
    /// The coefficients of the law by symbol, SI.
    pub coefficients: BTreeMap<String, f64>,
    /// Standard deviations and intervals of the coefficients that have them, by symbol.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub intervals: BTreeMap<String, IntervalRow>,
}

/// The uncertainty of a value.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct IntervalRow {
    /// The standard deviation.
    #[serde(deserialize_with = "number_or_nan")]
    pub sigma: f64,
    /// The lower end of the confidence interval.
    #[serde(deserialize_with = "number_or_nan")]
    pub low: f64,
    /// The upper end of the confidence interval.
    #[serde(deserialize_with = "number_or_nan")]
    pub high: f64,
}

/// One of all p parameters of a physically feasible model.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PhysicalRow {
    /// The label.
    pub label: String,
    /// The value, SI.
    pub value: f64,
    /// The unit.
    pub unit: String,
    /// The standard deviation.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub sigma: f64,
    /// The lower end of the confidence interval.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub low: f64,
    /// The upper end of the confidence interval.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub high: f64,
}

/// A body as in a spec: inertia about the centre of mass.
#[derive(Clone, Debug, Serialize)]
pub struct BodyRow {
    /// The mass, kg.
    pub mass: f64,
    /// The centre of mass in the body's frame, m.
    pub com: [f64; 3],
    /// Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre of mass, in the axes of the body's frame,
    /// kg m^2.
    pub inertia: [f64; 6],
}

impl ParameterRow {
    /// Builds the row of a base parameter; `share`: percent of the efforts.
    pub fn new(
        parameter: &BaseParameter<'_>,
        info: &Info<'_>,
        value: f64,
        interval: Option<Interval>,
        share: f64,
        status: Status,
    ) -> Self {
        let of = |field: fn(&Interval) -> f64| interval.as_ref().map_or(f64::NAN, field);
        Self {
            label: parameter.label.to_owned(),
            combination: combination(parameter),
            unit: unit(parameter.label, info).to_owned(),
            value,
            sigma: of(|i| i.sigma),
            sigma_white: of(|i| i.sigma_white),
            sigma_percent: 100.0 * of(|i| i.sigma) / value.abs(),
            low: of(|i| i.low),
            high: of(|i| i.high),
            share,
            status,
        }
    }
}

impl LeastSquaresRow {
    /// Builds the rows of all parameters of an estimate from its intervals.
    pub fn all(estimate: &Estimate, intervals: &[Option<Interval>], info: &Info<'_>) -> Vec<Self> {
        let labels = estimate.labels.iter().zip(&estimate.values).enumerate();
        labels
            .map(|(k, (label, value))| {
                let interval = intervals.get(k).copied().flatten();
                let of = |field: fn(&Interval) -> f64| interval.as_ref().map_or(f64::NAN, field);
                Self {
                    label: label.clone(),
                    unit: unit(label, info).to_owned(),
                    value: *value,
                    sigma: of(|i| i.sigma),
                    sigma_white: of(|i| i.sigma_white),
                    low: of(|i| i.low),
                    high: of(|i| i.high),
                }
            })
            .collect()
    }
}

impl PhysicalRow {
    /// Builds the row of a parameter.
    pub fn new(label: &str, info: &Info<'_>, value: f64, interval: Option<Interval>) -> Self {
        Self {
            label: label.to_owned(),
            value,
            unit: unit(label, info).to_owned(),
            sigma: interval.map_or(f64::NAN, |i| i.sigma),
            low: interval.map_or(f64::NAN, |i| i.low),
            high: interval.map_or(f64::NAN, |i| i.high),
        }
    }
}

/// The rows of a model's nonlinear friction, which is not among the base parameters.
pub(super) fn friction(identified: &IdentifiedModel) -> Vec<FrictionRow> {
    let joints = identified.friction.iter().enumerate();
    joints
        .map(|(k, joint)| {
            let mut row = FrictionRow::new(joint);
            let intervals = identified
                .intervals
                .friction
                .get(k)
                .map_or(&[][..], Vec::as_slice);
            let symbols = joint.friction.symbols().iter().zip(intervals);
            row.intervals = symbols
                .filter_map(|(symbol, interval)| {
                    let interval = (*interval)?;
                    let own = IntervalRow {
                        sigma: interval.sigma,
                        low: interval.low,
                        high: interval.high,
                    };
                    Some(((*symbol).to_owned(), own))
                })
                .collect();
            row
        })
        .collect()
}

impl FrictionRow {
    /// Builds the row of a joint's friction, without intervals.
    pub fn new(joint: &JointFit) -> Self {
        let symbols = joint.friction.symbols().iter();
        let pairs = symbols.zip(&joint.values);
        Self {
            joint: joint.name.clone(),
            law: joint.friction.name().to_owned(),
            coefficients: pairs.map(|(s, v)| ((*s).to_owned(), *v)).collect(),
            intervals: BTreeMap::new(),
        }
    }

    /// Converts the row to the friction of a joint.
    ///
    /// # Errors
    /// [`FileError::Friction`] for an unknown law, or a missing coefficient.
    pub fn joint(&self) -> Result<JointFit, FileError> {
        let wrong = |why: String| FileError::Friction {
            joint: self.joint.clone(),
            why,
        };
        let known = Friction::ALL.iter().find(|law| law.name() == self.law);
        let law = known.ok_or_else(|| {
            let names = Friction::ALL.map(Friction::name);
            wrong(format!("`{}` is none of {}", self.law, names.join(", ")))
        })?;
        let value = |symbol: &&str| {
            let found = self.coefficients.get(*symbol).copied();
            found.ok_or_else(|| wrong(format!("{symbol} is missing")))
        };
        let values = law.symbols().iter().map(value);
        Ok(JointFit {
            name: self.joint.clone(),
            friction: *law,
            values: values.collect::<Result<_, _>>()?,
        })
    }
}

/// Each body's mass, centre of mass and inertia about the centre of mass, by label.
pub(super) fn bodies(layout: &ParameterLayout, phi: &[f64]) -> BTreeMap<String, BodyRow> {
    let of = |column: usize| phi.get(column).copied().unwrap_or_default();
    let bodies = layout.bodies().iter();
    bodies
        .map(|body| (body.label.clone(), BodyRow::of(&body.columns.map(of))))
        .collect()
}

/// Each joint's linear friction, offset and rotor inertia, by symbol: all parameters that are not a body's.
pub(super) fn joints(
    parameters: &[Parameter<'_>],
    phi: &[f64],
) -> BTreeMap<String, BTreeMap<String, f64>> {
    let mut out: BTreeMap<String, BTreeMap<String, f64>> = BTreeMap::new();
    for (parameter, value) in parameters.iter().zip(phi) {
        if !parameter.is_inertial() {
            let own = out.entry(parameter.owner.to_owned()).or_default();
            own.insert(parameter.name().to_owned(), *value);
        }
    }
    out
}

impl BodyRow {
    /// Converts the ten inertial parameters of a body (Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the
    /// frame's origin, mx, my, mz, m) by the parallel axis theorem.
    fn of(ten: &[f64; 10]) -> Self {
        let (mass, com, inertia) = about_centre(ten);
        Self { mass, com, inertia }
    }
}

/// Writes a base parameter's linear combination with its factors in all their digits.
pub(super) fn combination(parameter: &BaseParameter<'_>) -> String {
    let mut out = String::new();
    for (k, term) in parameter.terms.iter().enumerate() {
        let sign = if term.value < 0.0 { "-" } else { "+" };
        let size = term.value.abs();
        let _ = match k {
            0 => write!(out, "{}", term.parameter),
            _ if (size - 1.0).abs() < 1e-12 => write!(out, " {sign} {}", term.parameter),
            _ => write!(out, " {sign} {size} {}", term.parameter),
        };
    }
    out
}
