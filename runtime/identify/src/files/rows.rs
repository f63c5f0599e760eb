//! The rows of identified parameters in files and in JSON.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::estimate::Estimate;
use crate::feasibility::{ParameterLayout, unit};
use crate::friction::JointFit;
use regen_runtime::{BaseParameter, Friction, Info, Parameter};
use serde::{Deserialize, Serialize};

use crate::model::{IdentifiedModel, Interval};
use crate::status::Status;

use super::FileError;

/// One base parameter of the adopted model. Deviations are those of the estimator that gave the
/// value, and null where it gives none.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ParameterRow {
    /// The label.
    pub label: String,
    /// The combination that it stands for, its factors in all their digits.
    pub combination: String,
    /// The unit.
    pub unit: String,
    /// The value, SI.
    pub value: f64,
    /// The standard deviation; see the file's `deviations` for how it was found.
    #[serde(deserialize_with = "perhaps")]
    pub sigma: f64,
    /// The standard deviation for white residuals.
    #[serde(default = "unknown", deserialize_with = "perhaps")]
    pub sigma_white: f64,
    /// `sigma` in percent of the value's size.
    #[serde(deserialize_with = "perhaps")]
    pub sigma_percent: f64,
    /// The confidence interval.
    #[serde(deserialize_with = "perhaps")]
    pub low: f64,
    /// See `low`.
    #[serde(deserialize_with = "perhaps")]
    pub high: f64,
    /// What it contributes to the efforts, in percent: the root mean square of its column times
    /// the value over that of the efforts, all efforts with the weights of the fit.
    #[serde(default = "unknown", deserialize_with = "perhaps")]
    pub share: f64,
    /// How well it is known.
    pub status: Status,
}

/// What least squares found of a base parameter, where another model was adopted.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LeastSquaresRow {
    /// The label.
    pub label: String,
    /// The unit.
    pub unit: String,
    /// The value, SI.
    pub value: f64,
    /// The standard deviation.
    #[serde(deserialize_with = "perhaps")]
    pub sigma: f64,
    /// The standard deviation for white residuals.
    #[serde(deserialize_with = "perhaps")]
    pub sigma_white: f64,
    /// The confidence interval.
    #[serde(deserialize_with = "perhaps")]
    pub low: f64,
    /// See `low`.
    #[serde(deserialize_with = "perhaps")]
    pub high: f64,
}

/// A number, or null for one that is not finite.
fn perhaps<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

fn unknown() -> f64 {
    f64::NAN
}

/// The friction of a joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FrictionRow {
    /// The coordinate's name.
    pub joint: String,
    /// The law's name.
    pub law: String,
    /// Its values by symbol, SI.
    pub coefficients: BTreeMap<String, f64>,
    /// Deviations and intervals of coefficients that have them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub intervals: BTreeMap<String, IntervalRow>,
}

/// The uncertainty of a value.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct IntervalRow {
    /// The standard deviation.
    #[serde(deserialize_with = "perhaps")]
    pub sigma: f64,
    /// The confidence interval.
    #[serde(deserialize_with = "perhaps")]
    pub low: f64,
    /// See `low`.
    #[serde(deserialize_with = "perhaps")]
    pub high: f64,
}

/// One of all parameters.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PhysicalRow {
    /// The label.
    pub label: String,
    /// The value, SI.
    pub value: f64,
    /// The unit.
    pub unit: String,
    /// The standard deviation.
    #[serde(default = "unknown", deserialize_with = "perhaps")]
    pub sigma: f64,
    /// The confidence interval.
    #[serde(default = "unknown", deserialize_with = "perhaps")]
    pub low: f64,
    /// See `low`.
    #[serde(default = "unknown", deserialize_with = "perhaps")]
    pub high: f64,
}

/// A body as in a spec: inertia about the centre of mass.
#[derive(Clone, Debug, Serialize)]
pub struct BodyRow {
    /// The mass, kg.
    pub mass: f64,
    /// The centre of mass in the body's frame, m.
    pub com: [f64; 3],
    /// Ixx, Ixy, Ixz, Iyy, Iyz, Izz about it, kg m^2.
    pub inertia: [f64; 6],
}

impl ParameterRow {
    /// The row of a value.
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
    /// The rows of an estimate with the intervals that belong to it.
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
    /// The row of a value.
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

/// The friction of a model that has no columns.
pub(super) fn friction(found: &IdentifiedModel) -> Vec<FrictionRow> {
    let joints = found.friction.iter().enumerate();
    joints
        .map(|(k, joint)| {
            let mut row = FrictionRow::new(joint);
            let intervals = found
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
    /// The row of a value.
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

    /// The friction that a row stands for.
    ///
    /// # Errors
    /// [`FileError::Friction`] for a law of another name, or a value that is missing.
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

/// Each body's mass, centre of mass and inertia about it, by label.
pub(super) fn bodies(layout: &ParameterLayout, phi: &[f64]) -> BTreeMap<String, BodyRow> {
    let of = |column: usize| phi.get(column).copied().unwrap_or_default();
    let bodies = layout.bodies().iter();
    bodies
        .map(|body| (body.label.clone(), BodyRow::of(&body.columns.map(of))))
        .collect()
}

/// Each joint's linear friction and rotor inertia, by symbol: all that are no body's.
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

/// A combination with its factors in all their digits.
fn combination(parameter: &BaseParameter<'_>) -> String {
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
