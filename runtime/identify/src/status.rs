//! Rates each identified parameter: how much it contributes to the efforts, and how well it is
//! determined.

use core::fmt;

use crate::estimate::QrFactor;
use serde::{Deserialize, Serialize};

/// Standard deviation in percent of the value below which a parameter is well identified (section
/// 5.3).
pub const WELL_IDENTIFIED_PERCENT: f64 = crate::identifiability::WELL_IDENTIFIED_PERCENT;
/// A value within this many standard deviations of zero may be zero.
const NEAR_ZERO_DEVIATIONS: f64 = 2.0;
/// Contribution of the standard deviation of such a value to the efforts, in percent, below which
/// the parameter is known to be negligible.
const NEGLIGIBLE_DEVIATION_PERCENT: f64 = 1.0;

/// Contribution to the efforts, in percent, below which a parameter has no effect: no effort is
/// measured to a ten-thousandth, and the errors of differentiation and sampling, which no standard
/// deviation includes, are larger.
const NO_EFFECT_PERCENT: f64 = 0.01;
/// The part of a value's variance that noise of the motion may have.
const MAX_BIASED_PART: f64 = 0.5;
/// Columns whose norm is below this part of the largest norm are rounding errors.
const RELATIVE_ROUNDING: f64 = 1e-12;

/// How well a parameter is identified.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Status {
    /// The parameter's standard deviation is below 15 % of its value.
    #[serde(rename = "well")]
    Well,
    /// The parameter may be zero, and its standard deviation contributes less than 1 % of the
    /// efforts: it is known to be negligible. Or it is not well identified, and no value within
    /// its uncertainty contributes more than 0.01 % of the efforts.
    #[serde(rename = "zero within its error")]
    Zero,
    /// The data do not determine the parameter, and it may matter.
    #[serde(rename = "poor")]
    Poor,
    /// The parameter's column is zero in these data.
    #[serde(rename = "unseen")]
    Unseen,
    /// Noise of the measured motion moves the value by more than all other errors do.
    #[serde(rename = "biased")]
    Biased,
    /// The value is below zero by more than its errors, as no friction and no rotor's inertia is.
    #[serde(rename = "negative")]
    Negative,
    /// The parameter was left out of the model on purpose.
    #[serde(rename = "left out")]
    LeftOut,
    /// The estimator gives no standard deviation of the parameter.
    #[serde(rename = "no deviation")]
    Unknown,
}

impl Status {
    /// All statuses, in the order in which they are counted.
    pub const ALL: [Self; 8] = [
        Self::Well,
        Self::Zero,
        Self::Poor,
        Self::Biased,
        Self::Negative,
        Self::Unseen,
        Self::LeftOut,
        Self::Unknown,
    ];

    /// A word for a column of a table.
    pub fn word(self) -> &'static str {
        match self {
            Self::Zero => "zero",
            Self::Unknown => "-",
            Self::Well => "well",
            Self::Poor => "poor",
            Self::Biased => "biased",
            Self::Negative => "negative",
            Self::Unseen => "unseen",
            Self::LeftOut => "left out",
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Zero => "zero within their error",
            Self::Unknown => "without a deviation",
            other => other.word(),
        })
    }
}

/// The number of parameters of each status, in words: `23 well, 2 zero within their error`.
pub fn counted(statuses: impl Iterator<Item = Status>) -> String {
    let statuses: Vec<Status> = statuses.collect();
    let parts: Vec<String> = Status::ALL
        .iter()
        .filter_map(|status| {
            let count = statuses.iter().filter(|s| *s == status).count();
            (count > 0).then(|| format!("{count} {status}"))
        })
        .collect();
    parts.join(", ")
}

/// The contributions of parameters to the efforts in the data of a fit.
///
/// All efforts have the weights of the fit, which are the inverse of their noise unless all weights
/// are equal: so N and N m can be summed, and an effort counts by how well it is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct EffortContributions {
    /// The root mean squares of the columns, each in the efforts' units over the parameter's.
    columns: Vec<f64>,
    /// The root mean square of the efforts.
    efforts: f64,
}

impl EffortContributions {
    /// The contributions in the data of a fit's weighted QR factor.
    pub fn of(factor: &QrFactor) -> Self {
        let rows = factor.rows().max(1) as f64;
        let squares: f64 = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
        let norms = factor.column_norms();
        let longest = norms.iter().copied().fold(0.0, f64::max);
        // shorter columns are rounding errors and count as zero
        let without_rounding = |norm: f64| {
            if norm > RELATIVE_ROUNDING * longest {
                norm
            } else {
                0.0
            }
        };
        Self {
            columns: norms
                .iter()
                .map(|n| without_rounding(*n) / rows.sqrt())
                .collect(),
            efforts: (squares / rows).sqrt(),
        }
    }

    /// The contribution of a parameter with this value to the efforts: the root mean square of its
    /// column times the value over that of the efforts, in percent. NaN if there is no such column.
    pub fn percent(&self, parameter: usize, value: f64) -> f64 {
        let column = self.columns.get(parameter).copied().unwrap_or(f64::NAN);
        if value == 0.0 || column == 0.0 {
            return 0.0;
        }
        100.0 * column * value.abs() / self.efforts
    }

    /// The same as [`status`](Self::status) of a value that noise of the motion moves by `bias`, of which
    /// `sigma` contains as much: where that is more than half of the variance, and the deviation matters,
    /// the value is biased.
    pub fn status_with_bias(&self, parameter: usize, value: f64, sigma: f64, bias: f64) -> Status {
        let found = self.status(parameter, value, sigma);
        let is_moved = bias * bias > MAX_BIASED_PART * sigma * sigma;
        match found {
            Status::Well | Status::Poor if is_moved => Status::Biased,
            other => other,
        }
    }

    /// The status of a value that cannot be below zero: it is not known well where it is.
    #[must_use]
    pub fn of_positive(status: Status, value: f64, sigma: f64) -> Status {
        match status {
            Status::Well | Status::Poor | Status::Biased
                if value < -NEAR_ZERO_DEVIATIONS * sigma =>
            {
                Status::Negative
            }
            other => other,
        }
    }

    /// The status of a parameter with this value and this standard deviation `sigma`, which is NaN
    /// where none is known.
    pub fn status(&self, parameter: usize, value: f64, sigma: f64) -> Status {
        let column = self.columns.get(parameter).copied().unwrap_or(f64::NAN);
        if column == 0.0 {
            Status::Unseen
        } else if !sigma.is_finite() {
            Status::Unknown
        } else if 100.0 * sigma < WELL_IDENTIFIED_PERCENT * value.abs() {
            Status::Well
        } else if value.abs() <= NEAR_ZERO_DEVIATIONS * sigma
            && self.percent(parameter, sigma) < NEGLIGIBLE_DEVIATION_PERCENT
            || self.percent(parameter, value.abs() + NEAR_ZERO_DEVIATIONS * sigma)
                < NO_EFFECT_PERCENT
        {
            Status::Zero
        } else {
            Status::Poor
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn the_status_follows_from_the_deviation_and_its_share_of_the_efforts() {
        // efforts of rms 1; columns of rms 1, 0.01 and 0
        let labels = ["a", "b", "c"].map(str::to_owned).to_vec();
        let mut factor = QrFactor::new(labels);
        let w = [
            1.0, -1.0, 1.0, -1.0, 0.01, 0.01, -0.01, -0.01, 0.0, 0.0, 0.0, 0.0,
        ];
        factor.push_block(&w, &[1.0, -1.0, 1.0, -1.0]).unwrap();
        let shares = EffortContributions::of(&factor);
        assert!((shares.percent(0, -1.0) - 100.0).abs() < 1e-12);
        assert!((shares.percent(1, 2.0) - 2.0).abs() < 1e-12);
        for (parameter, value, sigma, status) in [
            (0, 1.0, 0.149, Status::Well),
            (0, 1.0, 0.151, Status::Poor),
            // a standard deviation of 0.01 is 1 % of the efforts here
            (0, 0.015, 0.009, Status::Zero),
            (0, 0.019, 0.009, Status::Poor),
            (0, 0.015, 0.011, Status::Poor),
            (1, 0.5, 0.9, Status::Zero),
            // many standard deviations from zero, but less than 0.01 % of the efforts
            (0, 5e-5, 1e-5, Status::Zero),
            (0, 9e-5, 2e-5, Status::Poor),
            (0, 5e-5, 1e-6, Status::Well),
            (1, 0.0, 0.0, Status::Zero),
            (1, 0.5, f64::NAN, Status::Unknown),
            (1, 0.5, f64::INFINITY, Status::Unknown),
            (2, 0.5, 0.1, Status::Unseen),
        ] {
            assert_eq!(
                shares.status(parameter, value, sigma),
                status,
                "{parameter} {value} {sigma}"
            );
        }
        // a bias of more than the rest of the deviation
        for (value, bias, status) in [
            (1.0, 0.009, Status::Biased),
            (1.0, 0.005, Status::Well),
            (0.05, 0.009, Status::Biased),
        ] {
            let found = shares.status_with_bias(0, value, 0.01, bias);
            assert_eq!(found, status, "{value} {bias}");
        }
        let all = [Status::Well, Status::Zero, Status::Well];
        assert_eq!(
            counted(all.into_iter()),
            "2 well, 1 zero within their error"
        );
    }
}
