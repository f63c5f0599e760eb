//! Instrumental variables: the instruments, and the test of least squares for bias.

use std::fmt::Write as _;

use regen_codegen::explain::lines::field;
use regen_identify::identify::Instrumental;
use regen_identify::text::figure_of;
use serde::Serialize;

/// Instrumental variables and their test of least squares for bias, as they are serialised.
#[derive(Clone, Debug, Serialize)]
pub struct Instruments {
    /// The motion at which the instruments are evaluated, in words.
    motion: String,
    /// The cutoff frequency of the filter on the measured motion, Hz; `None` if the motion is
    /// simulated.
    cutoff: Option<f64>,
    /// The bandwidth of simulated controllers whose gains were not given, Hz, chosen such that the
    /// simulated motion is closest to the measured one.
    bandwidth: Option<f64>,
    rounds: usize,
    /// eps_RA in percent, with efforts predicted at the motion of the instruments.
    relative_absolute: f64,
    /// The number of equations in which both estimates are compared.
    equations: usize,
    /// The index of the weakest instrument, and whether it is weak.
    #[serde(skip)]
    weakest: Option<(usize, bool)>,
    /// The correlation of each instrument with its column of the observation matrix.
    relevance: Vec<Figure>,
    /// The probability that chance makes the estimates differ from least squares at least this
    /// much.
    probability: f64,
    /// Whether the probability is that of all differences together.
    #[serde(rename = "joint")]
    is_joint_test: bool,
    #[serde(skip)]
    biased: bool,
    /// The difference of least squares and instrumental variables, over its standard deviation.
    differences: Vec<Figure>,
}

#[derive(Clone, Debug, Serialize)]
struct Figure {
    label: String,
    value: f64,
}

impl Instruments {
    /// The results of instrumental variables.
    ///
    /// - `cutoff`: the cutoff frequency of the filter on the measured motion, Hz; `None` if the
    ///   motion is simulated;
    /// - `bandwidth`: the bandwidth of simulated controllers whose gains were not given, Hz;
    /// - `motion`: the motion at which the instruments are evaluated, in words.
    pub fn new(
        found: &Instrumental,
        cutoff: Option<f64>,
        bandwidth: Option<f64>,
        motion: &str,
    ) -> Self {
        let figures = |values: &[f64]| {
            let labels = found.estimate.labels.iter();
            let pairs = labels.zip(values).map(|(label, value)| Figure {
                label: label.clone(),
                value: *value,
            });
            pairs.collect()
        };
        Self {
            motion: motion.to_owned(),
            cutoff,
            bandwidth,
            rounds: found.rounds,
            relative_absolute: found.at_instruments,
            equations: found.estimate.efforts.iter().map(|e| e.rows).sum(),
            weakest: found.weakest().map(|k| (k, found.is_weak(k))),
            relevance: figures(&found.relevance),
            probability: found.test.probability,
            is_joint_test: found.test.is_joint_test,
            biased: found.test.is_biased(),
            differences: figures(&found.test.ratios),
        }
    }

    /// The lines above the tables.
    pub(super) fn to_text(&self) -> String {
        let mut text = self.motion.clone();
        if let Some(cutoff) = self.cutoff {
            let _ = write!(text, ", below {} Hz", figure_of(3, cutoff));
        }
        if let Some(bandwidth) = self.bandwidth {
            let figure = figure_of(3, bandwidth);
            let _ = write!(text, ", controllers without given gains at {figure} Hz");
        }
        let mut out = field("instruments", &text);
        out.push_str(&field("rounds", &self.rounds.to_string()));
        let weakest = self.weakest.map(|(k, weak)| (self.relevance.get(k), weak));
        if let Some((Some(weakest), weak)) = weakest {
            let weak = if weak { ": weak" } else { "" };
            let text = format!(
                "{} or more, of {}{weak}",
                figure_of(3, weakest.value),
                weakest.label
            );
            out.push_str(&field("correlation", &text));
        }
        let verdict = if self.biased {
            let least = |a: &&Figure, b: &&Figure| a.value.abs().total_cmp(&b.value.abs());
            let most = self.differences.iter().max_by(least);
            let most = most.map_or_else(String::new, |f| {
                format!(", most in {} ({} sigma)", f.label, figure_of(2, f.value))
            });
            format!("least squares is biased{most}")
        } else {
            "least squares does not differ by more than chance".to_owned()
        };
        let figure = figure_of(2, self.probability);
        let text = format!("{verdict}; p = {figure} (Durbin, Wu, Hausman)");
        out.push_str(&field("bias", &text));
        out.push_str(&field(
            "eps_RA there",
            &format!(
                "{:.3} % at the motion of the instruments",
                self.relative_absolute
            ),
        ));
        out
    }
}
