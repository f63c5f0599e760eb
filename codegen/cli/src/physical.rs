//! Physical parameters of `regen identify`: converts the options to prior knowledge, and reports on
//! the result.

use regen_identify::feasibility::{Bound, FeasibilityError, MAX_OPTIMAL_GAP, Total};
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
    let joints = regen_identify::friction::nonlinear_joints(model);
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
