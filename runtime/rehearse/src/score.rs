//! Scores how often, and how well, the true parameters were found.

use serde::Serialize;

use crate::chance::counts_by_chance;
use crate::trial::{Fit, Trial};

/// The number of standard deviations within which an estimate counts as correct.
const SIGMAS: f64 = 3.0;

/// The scores of a rehearsal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// The number of finished seeds, including failed ones.
    pub seeds: usize,
    /// The number of requested seeds.
    pub asked: usize,
    /// The seeds without an estimate.
    pub failed: Vec<FailedSeed>,
    /// The score: the percentage of finished seeds whose estimate is within three standard
    /// deviations of the truth, for the parameter with the lowest percentage. A failed seed, or a
    /// value without interval, counts as not within.
    pub least: f64,
    /// The parameter with the lowest percentage.
    pub lowest: String,
    /// The percentage of all values of the seeds with an estimate that are within three standard
    /// deviations.
    pub within: Option<f64>,
    /// The percentage of these values whose interval contains the truth.
    pub inside: Option<f64>,
    /// The level of the intervals, percent.
    pub level: f64,
    /// If the intervals have their level, the percentage of one parameter's intervals that contain
    /// the truth is within these limits in all but 0.2 % of such rehearsals. The percentage over all
    /// parameters varies no more.
    pub by_chance: [f64; 2],
    /// The mean eps_RA (Eq. 33) on a run that is not used for identification, percent.
    pub relative_absolute: Option<f64>,
    /// The mean eps_RA of the true parameters on it, read as for each estimate: the part of noise and
    /// unmodelled effects.
    pub relative_absolute_of_truth: Option<f64>,
    /// The scores of each base parameter, then of nonlinear friction, then of unknown gains, then of
    /// the identified parameters of payloads: mass, centre of mass and inertia about it.
    pub parameters: Vec<ParameterScore>,
}

/// A seed without an estimate.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FailedSeed {
    /// The seed.
    pub seed: u64,
    /// The reason, in words.
    pub why: String,
}

/// The score of one parameter; means are over the seeds with an estimate, and `None` without any.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterScore {
    /// The label of the parameter.
    pub label: String,
    /// The true value, SI.
    pub truth: f64,
    /// The mean estimate, SI.
    pub mean: Option<f64>,
    /// The root mean square of the error, SI.
    pub rms: Option<f64>,
    /// The same in percent of the truth; `None` if the truth is 0 up to rounding.
    pub rms_percent: Option<f64>,
    /// The mean standard deviation that the estimator states, SI.
    pub sigma: Option<f64>,
    /// The same in percent of the truth; `None` if the truth is 0 up to rounding.
    pub sigma_percent: Option<f64>,
    /// The mean error over the mean stated standard deviation.
    pub bias: Option<f64>,
    /// The number of seeds with an interval.
    pub intervals: usize,
    /// The number of seeds within three standard deviations of the truth.
    pub within: usize,
    /// The number of seeds whose interval contains the truth.
    pub inside: usize,
    /// Whether fewer intervals contain the truth than chance explains.
    pub is_low: bool,
}

impl Score {
    /// Scores the trials, which are in the order of their seeds.
    pub(crate) fn new(
        labels: &[&str],
        truth: &[f64],
        trials: &[Trial],
        asked: usize,
        confidence: f64,
    ) -> Self {
        let fits = trials.iter().filter_map(|t| t.outcome.as_ref().ok());
        let fits: Vec<&Fit> = fits.collect();
        let failed = trials.iter().filter_map(|t| {
            let why = t.outcome.as_ref().err()?.clone();
            Some(FailedSeed { seed: t.seed, why })
        });
        let (fewest, most) = counts_by_chance(fits.len(), confidence);
        let errors = || fits.iter().filter_map(|fit| fit.errors);
        let pairs = labels.iter().zip(truth).enumerate();
        let parameters =
            pairs.map(|(k, (label, truth))| parameter_score(label, *truth, k, &fits, fewest));
        let parameters: Vec<ParameterScore> = parameters.collect();
        let percent = |count: usize, of: usize| (of > 0).then(|| 100.0 * count as f64 / of as f64);
        let all = parameters.len() * fits.len();
        let lowest = parameters.iter().min_by_key(|p| p.within);
        Self {
            seeds: trials.len(),
            asked,
            failed: failed.collect(),
            least: lowest
                .and_then(|p| percent(p.within, trials.len()))
                .unwrap_or(0.0),
            lowest: lowest.map(|p| p.label.clone()).unwrap_or_default(),
            within: percent(parameters.iter().map(|p| p.within).sum(), all),
            inside: percent(parameters.iter().map(|p| p.inside).sum(), all),
            level: 100.0 * confidence,
            by_chance: [fewest, most].map(|count| percent(count, fits.len()).unwrap_or(0.0)),
            relative_absolute: mean(errors().map(|[of_estimate, _]| of_estimate)),
            relative_absolute_of_truth: mean(errors().map(|[_, of_truth]| of_truth)),
            parameters,
        }
    }
}

/// The mean of values; `None` without values, or if it is not finite.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0_usize);
    for value in values {
        sum += value;
        count += 1;
    }
    let mean = sum / count as f64;
    mean.is_finite().then_some(mean)
}

/// The largest error that is stated in percent of the true value; above it, the true value is zero
/// up to rounding.
const MAX_PERCENT: f64 = 1e9;

/// An error in percent of the truth; `None` if the truth is 0 up to rounding.
fn percent_of(error: f64, truth: f64) -> Option<f64> {
    let percent = 100.0 * error / truth.abs();
    // false for NaN
    (percent < MAX_PERCENT).then_some(percent)
}

/// The score of the parameter with the index `k`; it is low if fewer than `fewest` intervals contain
/// the truth.
fn parameter_score(
    label: &str,
    truth: f64,
    k: usize,
    fits: &[&Fit],
    fewest: usize,
) -> ParameterScore {
    let values = || fits.iter().filter_map(|fit| fit.values.get(k).copied());
    let rms = mean(values().map(|x| (x - truth) * (x - truth))).map(f64::sqrt);
    let known: Vec<_> = fits
        .iter()
        .filter_map(|fit| Some((*fit.values.get(k)?, fit.intervals.get(k).copied()??)))
        .collect();
    let sigma = mean(known.iter().map(|(_, i)| i.sigma));
    let error = mean(known.iter().map(|(x, _)| x - truth));
    let within = known
        .iter()
        .filter(|(x, i)| (x - truth).abs() <= SIGMAS * i.sigma);
    let inside = known
        .iter()
        .filter(|(_, i)| (i.low..=i.high).contains(&truth))
        .count();
    ParameterScore {
        label: label.to_owned(),
        truth,
        mean: mean(values()),
        rms,
        rms_percent: rms.and_then(|rms| percent_of(rms, truth)),
        sigma,
        sigma_percent: sigma.and_then(|sigma| percent_of(sigma, truth)),
        bias: error
            .zip(sigma)
            .map(|(error, sigma)| error / sigma)
            .filter(|x| x.is_finite()),
        intervals: known.len(),
        within: within.count(),
        inside,
        is_low: inside < fewest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use regen_identify::model::Interval;

    fn fit(value: f64, sigma: Option<f64>) -> Trial {
        let interval = sigma.map(|sigma| Interval {
            sigma,
            sigma_white: sigma,
            low: value - 2.0 * sigma,
            high: value + 2.0 * sigma,
        });
        Trial {
            seed: 0,
            outcome: Ok(Fit {
                values: vec![value],
                intervals: vec![interval],
                errors: Some([2.0, 1.0]),
            }),
        }
    }

    #[test]
    fn counts_and_means_are_those_by_hand() {
        let trials = [
            fit(1.1, Some(0.1)),
            fit(0.7, Some(0.11)),
            fit(1.5, Some(0.1)),
            fit(1.0, None),
            Trial {
                seed: 4,
                outcome: Err("no convergence".to_owned()),
            },
        ];
        let score = Score::new(&["m(1)"], &[1.0], &trials, 6, 0.95);
        let one = &score.parameters[0];
        assert_eq!((one.intervals, one.within, one.inside), (3, 2, 1));
        assert!((score.least - 40.0).abs() < 1e-12, "2 of 5");
        assert_eq!(score.within, Some(50.0), "2 of 4 estimates");
        assert_eq!((score.seeds, score.asked), (5, 6));
        assert_eq!(score.failed[0].seed, 4);
        assert!((one.mean.unwrap_or(0.0) - 1.075).abs() < 1e-12);
        let rms = (0.35_f64 / 4.0).sqrt();
        assert!((one.rms_percent.unwrap_or(0.0) - 100.0 * rms).abs() < 1e-9);
        let bias = (0.3 / 3.0) / (0.31 / 3.0);
        assert!((one.bias.unwrap_or(0.0) - bias).abs() < 1e-9);
        assert_eq!(score.relative_absolute, Some(2.0));
        assert_eq!(score.relative_absolute_of_truth, Some(1.0));
    }

    #[test]
    fn without_any_estimate_the_score_is_0_and_nothing_is_a_number() {
        let none = Trial {
            seed: 1,
            outcome: Err("no convergence".to_owned()),
        };
        let score = Score::new(&["m(1)"], &[0.0], &[none], 1, 0.95);
        assert_eq!((score.least, score.inside), (0.0, None));
        assert_eq!(score.parameters[0].rms_percent, None);
        assert_eq!(score.relative_absolute, None);
    }
}
