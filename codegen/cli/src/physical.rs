//! Physical parameters of `regen identify`: converts the options to prior knowledge, and reports on
//! the result.

use regen_identify::feasibility::{Bound, FeasibilityError, MAX_OPTIMAL_GAP, Total};
use regen_identify::intervals::DEFAULT_DRAWS;
use regen_identify::model::IdentifiedModel;
use regen_identify::session::{NominalTrust, PriorKnowledge};
use regen_interpreted::Interpreted;
use regen_runtime::Info;

use crate::args::{PhysicalArgs, PriorArg};
use crate::exit::Failure;
use crate::terminal;

/// The prior knowledge of the parameters that the options state.
pub(crate) fn knowledge(args: &PhysicalArgs) -> PriorKnowledge {
    let names = |text: &str| -> Vec<String> {
        let parts = text.split(',').map(str::trim);
        parts.map(str::to_owned).collect()
    };
    let bound = |(label, lowest, highest): &(String, f64, f64)| Bound {
        parameter: label.clone(),
        lowest: *lowest,
        highest: *highest,
    };
    let total = |(labels, value): &(String, f64)| Total {
        parameters: names(labels),
        value: *value,
    };
    PriorKnowledge {
        identical: args.identical.iter().map(|text| names(text)).collect(),
        known: args.known.clone(),
        bounds: args.bound.iter().map(bound).collect(),
        totals: args.total.iter().map(total).collect(),
        trust: match args.prior {
            None => NominalTrust::Open,
            Some(PriorArg::Entropic(weight)) => NominalTrust::Entropic(weight),
            Some(PriorArg::Weighted(part)) => NominalTrust::Weighted(part),
        },
    }
}

/// The largest number of draws that a confidence level takes by itself.
const MOST_DRAWS: f64 = 1e4;

/// The number of draws for intervals of this confidence level: as many as reach it, unless the options
/// ask for another number, which may reach less and then is noted.
pub(crate) fn draws(args: &PhysicalArgs, confidence: f64) -> Result<usize, Failure> {
    // the next draw is beyond the extremes of n draws with the probability 2 / (n + 1)
    let needed = (2.0 / (1.0 - confidence) - 1.0 - 1e-6).ceil();
    let given = args.draws;
    if given == 0 || given as f64 >= needed {
        return Ok(given);
    }
    if given != DEFAULT_DRAWS {
        let reached = 1.0 - 2.0 / (given as f64 + 1.0);
        terminal::note(&format!(
            "warning: {given} draws reach a confidence of {:.0} % and not {} %, which takes at least \
             {needed} draws",
            100.0 * reached,
            100.0 * confidence
        ));
        return Ok(given);
    }
    if needed > MOST_DRAWS {
        return Err(Failure::Input(format!(
            "--confidence {confidence} takes at least {needed} draws of constrained values: give \
             --draws as many, --draws 0 for no intervals, or a smaller confidence"
        )));
    }
    #[allow(clippy::cast_sign_loss, reason = "positive")]
    Ok(needed as usize)
}

/// Notes the options that would bound a mass which neither data nor constraints bound: a nominal mass
/// does only as a prior.
pub(crate) fn note_unbounded(found: &IdentifiedModel, info: &Info<'_>) {
    let Some(mass) = found.unbounded.first() else {
        return;
    };
    let mut known = info.parameters.iter().zip(info.nominal);
    let is_nominal = known.any(|(p, value)| value.is_some() && p.to_string() == *mass);
    let prior = if is_nominal {
        "--prior weighted, which holds it near its nominal value"
    } else {
        "nominal masses in the spec's `bodies:` with --prior weighted"
    };
    terminal::note(&format!(
        "note: --bound '{mass}=LOWEST..HIGHEST' would bound this mass, and so would {prior}"
    ));
}

/// Fails if the fit is not proven to be the optimum, after the result was printed and written.
pub(crate) fn require_optimum(found: &IdentifiedModel) -> Result<(), Failure> {
    match found.gap {
        Some(gap) if gap.is_nan() || gap > MAX_OPTIMAL_GAP => Err(Failure::Numeric(format!(
            "the physical parameters are not proven to be the optimum: others may fit better by up \
             to {gap:.1e} of the squared residuals"
        ))),
        _ => Ok(()),
    }
}

/// Notes that nonlinear friction of the spec is left out of a linear model.
pub(crate) fn note_friction(model: &Interpreted<'_>) {
    let joints = regen_identify::states::nonlinear_joints(model);
    if !joints.is_empty() {
        let names: Vec<&str> = joints.iter().map(|j| j.name.as_str()).collect();
        terminal::note(&format!(
            "note: the nonlinear friction of {} is left out; --friction identifies it",
            names.join(", ")
        ));
    }
}

impl From<FeasibilityError> for Failure {
    fn from(error: FeasibilityError) -> Self {
        match error {
            FeasibilityError::Estimate(error) => error.into(),
            FeasibilityError::Solver(_) => Self::Numeric(error.to_string()),
            other => Self::Input(other.to_string()),
        }
    }
}
