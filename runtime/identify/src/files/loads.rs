//! Gains, payloads and covariances in files of identified parameters.

use regen_runtime::{Info, Motion};
use serde::{Deserialize, Serialize};

use super::FileError;
use super::rows::{nan, number_or_nan};
use crate::model::{Covariance, Gain, IdentifiedPayload, Interval, PayloadValue};

/// The gain of a drive.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GainRow {
    /// The coordinate of the effort.
    pub effort: String,
    /// The effort over the current.
    pub value: f64,
    /// `N m/A` or `N/A`.
    pub unit: String,
    /// The standard deviation; null where the gain was known.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub sigma: f64,
    /// The lower end of the confidence interval.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub low: f64,
    /// The upper end of the confidence interval.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub high: f64,
}

/// A payload.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PayloadRow {
    /// The label of its body.
    pub body: String,
    /// The values that the runs determine, and those that were given.
    pub values: Vec<PayloadValueRow>,
}

/// A value of a payload.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PayloadValueRow {
    /// `m`, `cx`, `cy`, `cz`, or `Ixx` to `Izz` about the centre of mass.
    pub name: String,
    /// The value.
    pub value: f64,
    /// `kg`, `m` or `kg m^2`.
    pub unit: String,
    /// Whether the value was given.
    pub known: bool,
    /// The standard deviation; null where the value was given.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub sigma: f64,
    /// The lower end of the confidence interval.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub low: f64,
    /// The upper end of the confidence interval.
    #[serde(default = "nan", deserialize_with = "number_or_nan")]
    pub high: f64,
}

/// A covariance of base parameters and gains.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CovarianceRows {
    /// The labels of base parameters, and `gain(NAME)` of gains.
    pub labels: Vec<String>,
    /// The lower triangle, row by row: row k has k + 1 entries.
    pub lower: Vec<Vec<f64>>,
}

/// Sigma, low and high of an interval; NaN without one.
fn parts(interval: Option<&Interval>) -> [f64; 3] {
    interval.map_or([f64::NAN; 3], |own| [own.sigma, own.low, own.high])
}

/// The interval of three numbers; `None` if they are not finite.
fn interval([sigma, low, high]: [f64; 3]) -> Option<Interval> {
    let known = sigma.is_finite() && low.is_finite() && high.is_finite();
    known.then_some(Interval {
        sigma,
        sigma_white: f64::NAN,
        low,
        high,
    })
}

impl GainRow {
    /// The row of a gain.
    pub fn new(gain: &Gain, info: &Info<'_>) -> Self {
        let [sigma, low, high] = parts(gain.interval.as_ref());
        let unit = match info.motion_of(&gain.effort) {
            Some(Motion::Translation) => "N/A",
            _ => "N m/A",
        };
        Self {
            effort: gain.effort.clone(),
            value: gain.value,
            unit: unit.to_owned(),
            sigma,
            low,
            high,
        }
    }

    /// The gain of a row.
    pub fn gain(&self) -> Gain {
        Gain {
            effort: self.effort.clone(),
            value: self.value,
            interval: interval([self.sigma, self.low, self.high]),
        }
    }
}

impl PayloadRow {
    /// The row of a payload.
    pub fn new(payload: &IdentifiedPayload) -> Self {
        let values = payload.values.iter().map(|own| {
            let [sigma, low, high] = parts(own.interval.as_ref());
            PayloadValueRow {
                name: own.name.clone(),
                value: own.value,
                unit: own.unit.clone(),
                known: own.is_known,
                sigma,
                low,
                high,
            }
        });
        Self {
            body: payload.body.clone(),
            values: values.collect(),
        }
    }

    /// The payload of a row.
    pub fn payload(&self) -> IdentifiedPayload {
        let values = self.values.iter().map(|row| PayloadValue {
            name: row.name.clone(),
            unit: row.unit.clone(),
            value: row.value,
            is_known: row.known,
            interval: interval([row.sigma, row.low, row.high]),
        });
        IdentifiedPayload {
            body: self.body.clone(),
            values: values.collect(),
        }
    }
}

impl CovarianceRows {
    /// The rows of a covariance.
    pub fn new(covariance: &Covariance) -> Self {
        let row = |k: usize| (0..=k).map(|j| covariance.entry(k, j)).collect();
        Self {
            labels: covariance.labels.clone(),
            lower: (0..covariance.labels.len()).map(row).collect(),
        }
    }

    /// The covariance of the rows.
    ///
    /// # Errors
    /// [`FileError::Covariance`] if the rows are not a triangle of finite numbers.
    pub fn covariance(&self) -> Result<Covariance, FileError> {
        let n = self.labels.len();
        let rows = self.lower.iter().enumerate();
        let fits = |(k, row): (usize, &Vec<f64>)| {
            row.len() == k + 1 && row.iter().all(|x| x.is_finite()) && row[k] >= 0.0
        };
        if self.lower.len() != n || !rows.clone().all(fits) {
            return Err(FileError::Covariance);
        }
        let mut values = vec![0.0; n * n];
        for (k, row) in rows {
            for (j, value) in row.iter().enumerate() {
                values[k * n + j] = *value;
                values[j * n + k] = *value;
            }
        }
        Ok(Covariance {
            labels: self.labels.clone(),
            values,
        })
    }
}
