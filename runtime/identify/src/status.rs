//! What is said of each identified parameter: how much it contributes, and how well it is known.

use core::fmt;

use crate::estimate::QrFactor;
use serde::{Deserialize, Serialize};

/// Deviations below this part of a value, in percent, are of well identified parameters (section
/// 5.3).
pub const WELL: f64 = crate::identifiability::WELL;
/// A value within so many deviations of zero may be zero.
const NEAR: f64 = 2.0;
/// What such a deviation may contribute to the efforts, in percent, for the parameter to be known
/// to be negligible.
const NEGLIGIBLE: f64 = 1.0;

/// Less than this part of the efforts, in percent, is nothing: no effort is measured to a
/// ten-thousandth, and what differentiation and sampling leave, which no deviation knows of, is
/// more.
const NOTHING: f64 = 0.01;
/// Columns below this part of the longest are rounding.
const ROUNDING: f64 = 1e-12;

/// How well a parameter is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Status {
    /// Its deviation is below 15 % of its value.
    #[serde(rename = "well")]
    Well,
    /// It may be zero, and what its deviation leaves open is below 1 % of the efforts: it is known
    /// to be negligible. Or it is not well identified, and all that it may be moves less than
    /// 0.01 % of the efforts.
    #[serde(rename = "zero within its error")]
    Zero,
    /// The data leave it open, and it may matter.
    #[serde(rename = "poor")]
    Poor,
    /// Its column counts for nothing in these data.
    #[serde(rename = "unseen")]
    Unseen,
    /// It was left out of the model on purpose.
    #[serde(rename = "left out")]
    LeftOut,
    /// The estimator gives no deviation of it.
    #[serde(rename = "no deviation")]
    Unknown,
}

impl Status {
    /// All of them, in the order in which they are counted.
    pub const ALL: [Self; 6] = [
        Self::Well,
        Self::Zero,
        Self::Poor,
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

/// How many there are of each status, in words: `23 well, 2 zero within their error`.
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

/// What columns and efforts weigh in the data of a fit.
///
/// All efforts count with the weights of the fit, which are the inverse of their noise unless they
/// are weighted alike: so N and N m can be summed, and an effort counts by how well it is measured.
#[derive(Clone, Debug)]
pub struct Shares {
    /// The root mean squares of the columns, each in the efforts' units over the parameter's.
    columns: Vec<f64>,
    /// The root mean square of the efforts.
    efforts: f64,
}

impl Shares {
    /// Of a fit's weighted factor.
    pub fn of(factor: &QrFactor) -> Self {
        let rows = factor.rows().max(1) as f64;
        let squares: f64 = factor.z().iter().map(|z| z * z).sum::<f64>() + factor.rss();
        let norms = factor.column_norms();
        let longest = norms.iter().copied().fold(0.0, f64::max);
        // what is shorter is rounding
        let seen = |norm: f64| if norm > ROUNDING * longest { norm } else { 0.0 };
        Self {
            columns: norms.iter().map(|n| seen(*n) / rows.sqrt()).collect(),
            efforts: (squares / rows).sqrt(),
        }
    }

    /// What a value of a parameter contributes: the root mean square of its column times the value
    /// over that of the efforts, in percent. NaN where there is no such column.
    pub fn percent(&self, parameter: usize, value: f64) -> f64 {
        let column = self.columns.get(parameter).copied().unwrap_or(f64::NAN);
        if value == 0.0 || column == 0.0 {
            return 0.0;
        }
        100.0 * column * value.abs() / self.efforts
    }

    /// The status of a value with this standard deviation; NaN where none is known.
    pub fn status(&self, parameter: usize, value: f64, sigma: f64) -> Status {
        let column = self.columns.get(parameter).copied().unwrap_or(f64::NAN);
        if column == 0.0 {
            Status::Unseen
        } else if !sigma.is_finite() {
            Status::Unknown
        } else if 100.0 * sigma < WELL * value.abs() {
            Status::Well
        } else if value.abs() <= NEAR * sigma && self.percent(parameter, sigma) < NEGLIGIBLE
            || self.percent(parameter, value.abs() + NEAR * sigma) < NOTHING
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
    fn a_value_is_judged_by_its_deviation_and_by_what_that_moves() {
        // efforts of rms 1; columns of rms 1, 0.01 and 0
        let labels = ["a", "b", "c"].map(str::to_owned).to_vec();
        let mut factor = QrFactor::new(labels);
        let w = [
            1.0, -1.0, 1.0, -1.0, 0.01, 0.01, -0.01, -0.01, 0.0, 0.0, 0.0, 0.0,
        ];
        factor.push_block(&w, &[1.0, -1.0, 1.0, -1.0]).unwrap();
        let shares = Shares::of(&factor);
        assert!((shares.percent(0, -1.0) - 100.0).abs() < 1e-12);
        assert!((shares.percent(1, 2.0) - 2.0).abs() < 1e-12);
        for (parameter, value, sigma, status) in [
            (0, 1.0, 0.149, Status::Well),
            (0, 1.0, 0.151, Status::Poor),
            // 1 % of the efforts is a deviation of 0.01 here
            (0, 0.015, 0.009, Status::Zero),
            (0, 0.019, 0.009, Status::Poor),
            (0, 0.015, 0.011, Status::Poor),
            (1, 0.5, 0.9, Status::Zero),
            // far from zero by its deviation, but less than 0.01 % of the efforts
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
        let all = [Status::Well, Status::Zero, Status::Well];
        assert_eq!(
            counted(all.into_iter()),
            "2 well, 1 zero within their error"
        );
    }
}
