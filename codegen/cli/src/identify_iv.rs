//! `regen identify --iv`: instrumental variables.

use std::fmt::Write as _;

use regen_experiment::closed_loop::LoopError;
use regen_experiment::instruments::{InstrumentError, instrumental};
use regen_identify::identify::Instrumental;
use serde::Serialize;

use crate::args::IdentifyArgs;
use crate::exit::Failure;
use crate::simulate::reason;
use crate::{observe, path, table};
use regen_identify::model::IdentifiedModel;
use regen_identify::session::{LeastSquaresStart, Session};
use regen_interpreted::Interpreted;

/// The instruments and the test of least squares for bias, in JSON.
#[derive(Serialize)]
pub(crate) struct InstrumentsJson {
    /// The motion at which the instruments are evaluated, in words.
    motion: String,
    /// The cut-off frequency of the filter on the measured motion, Hz; `None` where it is
    /// simulated.
    cutoff: Option<f64>,
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
    /// Whether the probability is of all differences together.
    joint: bool,
    #[serde(skip)]
    biased: bool,
    /// The difference of least squares and instrumental variables, over its standard deviation.
    differences: Vec<Figure>,
}

#[derive(Serialize)]
struct Figure {
    label: String,
    value: f64,
}

/// Identifies by instrumental variables: the model, its JSON and the bandwidth, in samples.
pub(crate) fn run(
    args: &IdentifyArgs,
    session: &Session<'_, Interpreted<'_>>,
    start: &LeastSquaresStart,
) -> Result<(IdentifiedModel, InstrumentsJson, usize), Failure> {
    observe::require_consistent(&args.reading)?;
    let file = args.reference.as_deref();
    let reference = file
        .map(|file| path::read(file, session.model))
        .transpose()?;
    let reference = reference.as_ref().map(|path| (path, args.pid.as_slice()));
    let found = instrumental(session, start, &args.logs, reference)?;
    if !found.instrumental.settled {
        return Err(Failure::Numeric(format!(
            "--iv did not converge in {} rounds, so there is no estimate: the instruments are weak; \
             take a motion that excites more, or give the commanded one by --reference",
            found.instrumental.rounds
        )));
    }
    let json = InstrumentsJson::new(&found.instrumental, found.cutoff);
    Ok((found.model, json, found.instrumental.bandwidth))
}

impl From<InstrumentError> for Failure {
    fn from(error: InstrumentError) -> Self {
        let refused = |why: String| {
            Self::Numeric(format!(
                "--iv: the robot cannot be simulated with the present estimate: {why}; leave out \
                 --reference, then the measured motion is used"
            ))
        };
        match error {
            InstrumentError::Data(error) => error.into(),
            InstrumentError::Unsmoothed(_) => Self::Input(format!("--iv: {error}")),
            InstrumentError::Loop(LoopError::Untuned(why)) => refused(why.to_string()),
            InstrumentError::Loop(LoopError::Refused(why)) => refused(why.to_string()),
            InstrumentError::Loop(LoopError::Termination(how)) => {
                refused(reason(how).unwrap_or_default())
            }
            other => Self::Input(other.to_string()),
        }
    }
}

impl InstrumentsJson {
    fn new(found: &Instrumental, cutoff: Option<f64>) -> Self {
        let figures = |values: &[f64]| {
            let labels = found.estimate.labels.iter();
            let pairs = labels.zip(values).map(|(label, value)| Figure {
                label: label.clone(),
                value: *value,
            });
            pairs.collect()
        };
        Self {
            motion: if cutoff.is_some() {
                "measured and smoothed, for no --reference is given".to_owned()
            } else {
                "simulated along the reference".to_owned()
            },
            cutoff,
            rounds: found.rounds,
            relative_absolute: found.at_instruments,
            equations: found.estimate.efforts.iter().map(|e| e.rows).sum(),
            weakest: found.weakest().map(|k| (k, found.is_weak(k))),
            relevance: figures(&found.relevance),
            probability: found.test.probability,
            joint: found.test.joint,
            biased: found.test.is_biased(),
            differences: figures(&found.test.ratios),
        }
    }

    /// The table for people.
    pub(crate) fn to_text(&self) -> String {
        let mut text = self.motion.clone();
        if let Some(cutoff) = self.cutoff {
            let _ = write!(text, ", below {} Hz", table::figure_of(3, cutoff));
        }
        let mut out = table::field("instruments", &text);
        out.push_str(&table::field("rounds", &self.rounds.to_string()));
        let weakest = self.weakest.map(|(k, weak)| (self.relevance.get(k), weak));
        if let Some((Some(weakest), weak)) = weakest {
            let weak = if weak { ": weak" } else { "" };
            let text = format!(
                "{} or more, of {}{weak}",
                table::figure_of(3, weakest.value),
                weakest.label
            );
            out.push_str(&table::field("correlation", &text));
        }
        let verdict = if self.biased {
            let least = |a: &&Figure, b: &&Figure| a.value.abs().total_cmp(&b.value.abs());
            let most = self.differences.iter().max_by(least);
            let most = most.map_or_else(String::new, |f| {
                format!(
                    ", most in {} ({} sigma)",
                    f.label,
                    table::figure_of(2, f.value)
                )
            });
            format!("least squares is biased{most}")
        } else {
            "least squares does not differ by more than chance".to_owned()
        };
        let figure = table::figure_of(2, self.probability);
        let text = format!("{verdict}; p = {figure} (Durbin, Wu, Hausman)");
        out.push_str(&table::field("bias", &text));
        out.push_str(&table::field(
            "eps_RA there",
            &format!(
                "{:.3} % at the motion of the instruments",
                self.relative_absolute
            ),
        ));
        out
    }
}
