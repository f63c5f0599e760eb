//! How logs are read and solved where no one says how: what was chosen, and the figures it was chosen by.

use serde::{Deserialize, Serialize};

use crate::data::{Decision, Run, Settings};
use crate::signals::Method;

/// A cutoff that was tried.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Candidate {
    /// The cutoff, Hz.
    pub cutoff: f64,
    /// What noise leaves unknown of the predicted efforts, rms, percent of the efforts.
    pub deviation: f64,
    /// What the noise of the motion biases of them, rms, percent of the efforts.
    pub bias: f64,
    /// By how much they differ from those of a lower cutoff beyond what the deviations of both explain,
    /// rms, percent of the efforts.
    pub apart: f64,
}

/// Measured velocities beside those computed from the positions, behind the same filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct VelocityChoice {
    /// Whether velocities are computed from the positions.
    pub are_computed: bool,
    /// The error of the predicted efforts with measured velocities, rms, percent of the efforts: that of a
    /// [`Candidate`], and by how much they differ from those with computed velocities beyond what the
    /// deviations of both explain.
    pub measured: f64,
    /// The same with computed velocities.
    pub computed: f64,
}

/// The Fourier series of a motion that repeats itself beside the chosen filter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SeriesChoice {
    /// The frequency of the fundamental, Hz.
    pub frequency: f64,
    /// The number of harmonics.
    pub harmonics: usize,
    /// The first and the last time of each log between which the motion repeats itself, s, in its own time; none if
    /// all logs do as a whole.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<[f64; 2]>,
    /// Whether the series is used in place of the filter.
    pub is_used: bool,
    /// What noise leaves unknown of the predicted efforts and biases with the filter, and by how much they differ from
    /// those with the series beyond what the deviations of both explain, rms, percent of the efforts; `None` where it
    /// leaves too few equations to tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filtered: Option<f64>,
    /// What noise leaves unknown of them with the series; at least this where a part of the equations showed that
    /// the filter leaves far less.
    pub series: f64,
}

/// Huber's loss beside squares of the residuals, behind the same filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LossChoice {
    /// The bound of Huber's loss in standard deviations of the residuals; `None` where squares are as good.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub huber: Option<f64>,
    /// What noise leaves unknown of the predicted efforts and biases with squares, rms, percent of the efforts.
    pub squares: f64,
    /// The same with Huber's loss.
    pub bounded: f64,
}

/// How logs are read and equations are solved: a zero-phase Butterworth filter that the positions are
/// differentiated behind, and what else was chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Choice {
    /// The filter's order.
    pub order: usize,
    /// The cutoff of the filter of the equations, Hz.
    pub cutoff: f64,
    /// One of so many filtered equations is used.
    pub decimation: usize,
    /// The rate of the even grid that rows with an uneven clock are interpolated onto, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resample: Option<f64>,
    /// Which velocities are used, where some are measured and those computed determine the parameters too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocities: Option<VelocityChoice>,
    /// Whether a Fourier series is used in place of the filter, where the motion repeats itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub series: Option<SeriesChoice>,
    /// The delays of efforts that are significant and corrected, s.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub delays: Vec<(String, f64)>,
    /// Which loss is used, where residuals are so large that Huber's was tried.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss: Option<LossChoice>,
    /// All cutoffs that were tried, in rising order.
    #[serde(default)]
    pub candidates: Vec<Candidate>,
}

impl Choice {
    /// The settings with this choice; a decimation, an even grid, velocities or delays that are given stay.
    #[must_use]
    pub fn applied(&self, settings: &Settings) -> Settings {
        Settings {
            method: self.method(),
            method_by: Decision::Chosen,
            decimation: match settings.decimation {
                1 => self.equation_decimation(),
                given => given,
            },
            resample: settings.resample.or(self.resample),
            measured_rates: match self.velocities {
                Some(own) if own.are_computed => settings.measured_rates.or(Some(false)),
                _ => settings.measured_rates,
            },
            delays: if settings.delays.is_empty() {
                self.delays.clone()
            } else {
                settings.delays.clone()
            },
            are_delays_found: settings.are_delays_found
                || settings.delays.is_empty() && !self.delays.is_empty(),
            ..settings.clone()
        }
    }

    /// The bound of Huber's loss, `None` where squares of the residuals are used.
    pub fn huber(&self) -> Option<f64> {
        self.loss.and_then(|own| own.huber)
    }

    /// The same with the filter, for logs of other motions than that of a series.
    #[must_use]
    pub fn without_series(&self) -> Self {
        Self {
            series: None,
            ..self.clone()
        }
    }

    /// The logs, cut to the parts in which the motion of a series repeats itself.
    #[must_use]
    pub fn runs(&self, runs: &[Run]) -> Vec<Run> {
        let mut out = runs.to_vec();
        let series = self.series.as_ref().filter(|own| own.is_used);
        for (run, part) in out.iter_mut().zip(series.iter().flat_map(|own| &own.parts)) {
            run.times = Some((part[0], part[1]));
        }
        out
    }

    /// How positions are differentiated: by the series if it is used, else by the filter.
    pub fn method(&self) -> Method {
        match &self.series {
            Some(own) if own.is_used => Method::Fourier {
                frequency: own.frequency,
                harmonics: own.harmonics,
            },
            _ => Method::Butterworth {
                order: self.order,
                cutoff: self.cutoff,
            },
        }
    }

    /// One of so many equations is used: all of those of a series, which no filter correlates.
    pub fn equation_decimation(&self) -> usize {
        match self.method() {
            Method::Fourier { .. } => 1,
            _ => self.decimation,
        }
    }
}
