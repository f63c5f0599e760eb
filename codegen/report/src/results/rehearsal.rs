//! The scores of a rehearsal as text.

use std::fmt::Write as _;

use regen_codegen::explain::lines::{columns, field};
use regen_experiment::simulate::Following;
use regen_identify::text::{counted, figure_of};
use regen_rehearse::{ParameterScore, Score};
use serde::Serialize;

/// A rehearsal to be printed, and its JSON.
#[derive(Clone, Debug, Serialize)]
pub struct Rehearsed<'a> {
    /// The version of the JSON: [`Self::VERSION`].
    pub version: usize,
    /// The robot's name.
    pub robot: &'a str,
    /// The name of the motion.
    pub motion: &'a str,
    /// The name of the estimator.
    pub estimator: &'a str,
    /// The durations of the runs of a seed, s.
    pub durations: &'a [f64],
    /// The time between samples, s.
    pub step: f64,
    /// How the controllers were chosen; `None` where they are given.
    pub following: Option<&'a Following>,
    /// The first seed.
    pub seed: u64,
    /// The largest relative difference between the true parameters and the nominal ones.
    pub perturb: f64,
    /// The effects that the simulated robot has and the model lacks, in words.
    pub unmodelled: Option<String>,
    /// Whether seeds are missing because the run was interrupted.
    pub interrupted: bool,
    /// The least score to pass, percent.
    pub needed: f64,
    /// Whether the score reaches it.
    pub passed: bool,
    /// The scores.
    #[serde(flatten)]
    pub score: &'a Score,
}

impl Rehearsed<'_> {
    /// The version of the JSON.
    pub const VERSION: usize = 1;
}

/// The table of all parameters, and the scores over all of them.
pub fn rehearsed_text(json: &Rehearsed<'_>) -> String {
    let score = json.score;
    let count = json.durations.len();
    let seeds = counted(score.seeds, "seed", "seeds");
    let mut out = format!("{}, {seeds}, {}\n", json.robot, json.estimator);
    let longest = json.durations.iter().fold(0.0, |a: f64, b| a.max(*b));
    let runs = match count {
        1 => format!("1 of {} s", figure_of(4, longest)),
        _ => format!("{count} of up to {} s", figure_of(4, longest)),
    };
    let runs = format!("{runs}, every {} s, {}", json.step, json.motion);
    out.push_str(&field("runs", &runs));
    if let Some(following) = json.following {
        out.push_str(&field("controllers", &following.to_string()));
    }
    if let Some(unmodelled) = &json.unmodelled {
        out.push_str(&field("not modelled", unmodelled));
    }
    if let Some(first) = score.failed.first() {
        let why = first.why.lines().next().unwrap_or_default();
        let text = format!(
            "{} of {}; seed {}: {why}",
            score.failed.len(),
            score.seeds,
            first.seed
        );
        out.push_str(&field("failed", &text));
    }
    let estimates = score.seeds - score.failed.len();
    if estimates > 0 {
        out.push_str(&of_estimates(json, estimates));
    }
    let verdict = if json.passed { "passed" } else { "not passed" };
    let text = format!("{:.1} %, {} % needed: {verdict}", score.least, json.needed);
    out.push_str(&field("score", &text));
    out
}

/// The table of the parameters and their summary, from this many seeds with an estimate.
fn of_estimates(json: &Rehearsed<'_>, estimates: usize) -> String {
    let score = json.score;
    let mut out = "\n".to_owned();
    let level = format!("in {} %", (100.0 * score.level).round() / 100.0);
    let head = [
        "parameter",
        "truth",
        "mean",
        "rms %",
        "sigma %",
        &level,
        "3 sigma",
        "bias",
    ];
    let lines: Vec<Vec<String>> = score
        .parameters
        .iter()
        .map(|parameter| line(parameter, estimates))
        .collect();
    out.push_str(&columns(&head, &lines));
    out.push('\n');
    if let (Some(within), Some(inside)) = (score.within, score.inside) {
        let text = format!(
            "{within:.2} % of all values; {:.1} % of the seeds in {}",
            score.least, score.lowest
        );
        out.push_str(&field("in 3 sigma", &text));
        let [low, high] = score.by_chance;
        let text = format!(
            "{inside:.1} % of all intervals; {low:.0} to {high:.0} % of a parameter's by chance"
        );
        out.push_str(&field(&level, &text));
    }
    if let Some(error) = score.relative_absolute {
        let mut text = format!("{error:.3} % on a fresh run");
        if let Some(of_truth) = score.relative_absolute_of_truth {
            // writing to a String cannot fail
            let _ = write!(text, ", {of_truth:.3} % with the true parameters");
        }
        out.push_str(&field("eps_RA", &text));
    }
    out
}

/// The row of a parameter.
fn line(parameter: &ParameterScore, estimates: usize) -> Vec<String> {
    let figure = |digits: usize, value: Option<f64>| {
        value.map_or_else(|| "-".to_owned(), |x| figure_of(digits, x))
    };
    let share = |count: usize| format!("{:.0}", 100.0 * count as f64 / estimates as f64);
    let mark = if parameter.is_low { "!" } else { "" };
    vec![
        parameter.label.clone(),
        figure_of(4, parameter.truth),
        figure(4, parameter.mean),
        figure(2, parameter.rms_percent),
        figure(2, parameter.sigma_percent),
        share(parameter.inside) + mark,
        share(parameter.within),
        figure(2, parameter.bias),
    ]
}
