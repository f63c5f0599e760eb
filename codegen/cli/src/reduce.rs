//! `regen identify --reduce`: from all base parameters to those the data determine well.

use regen_identify::estimate::{EffortFit, Factor, FactorSet};
use regen_identify::identifiability::{Checks, Feasibility, Reduction, Step, reduce};
use regen_identify::identify::{self, Kind, NoColumns, Source};
use serde::Serialize;

use crate::args::IdentifyArgs;
use crate::exit::Failure;
use crate::identify::Start;
use crate::{observe, physical};
use regen_identify::model::{IdentifiedModel, Intervals};
use regen_interpreted::Interpreted;

/// A step in JSON.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct StepJson {
    pub(crate) change: String,
    pub(crate) kept: Vec<String>,
    pub(crate) well: usize,
    pub(crate) feasibility: &'static str,
    pub(crate) condition: f64,
    pub(crate) residual: f64,
    pub(crate) other_residual: Option<f64>,
    pub(crate) relative_absolute: Option<f64>,
}

/// Equations of the logs that a model is validated on, in memory.
struct Equations {
    columns: usize,
    rows: Vec<(Vec<f64>, Vec<f64>)>,
    means: Vec<f64>,
}

impl Equations {
    fn relative_absolute(&self, beta: &[f64]) -> f64 {
        let (mut absolute, mut spread) = (0.0, 0.0);
        for (w, tau) in &self.rows {
            for (i, (t, mean)) in tau.iter().zip(&self.means).enumerate() {
                let entries = w.iter().skip(i).step_by(tau.len());
                let fitted: f64 = entries.zip(beta).map(|(w, b)| w * b).sum();
                absolute += (t - fitted).abs();
                spread += (t - mean).abs();
            }
        }
        debug_assert_eq!(self.columns, beta.len());
        100.0 * absolute / spread
    }
}

/// Reduces the base parameters of a start; the steps, and the last of them over all r.
pub(crate) fn run(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    start: &Start,
) -> Result<Reduction, Failure> {
    let (factor, efforts) = (&start.factor, &start.estimate.efforts);
    let (layout, combinations) = physical::frame(model)?;
    let kind = observe::kind(&args.reading);
    let against = match args.physical.against.as_slice() {
        [] => None,
        paths => {
            let mut logs = observe::open(model, paths, &args.reading)?;
            let set = identify::observe(model, kind, &mut logs)?.0;
            Some((
                weighted(&set, efforts)?,
                equations(model, kind, &mut logs, &set)?,
            ))
        }
    };
    let predict = against
        .as_ref()
        .map(|(_, equations)| |beta: &[f64]| equations.relative_absolute(beta));
    let checks = Checks {
        other: against.as_ref().map(|(factor, _)| factor),
        relative_absolute: predict.as_ref().map(|f| f as _),
        scale: physical::scale(model, &layout, &combinations, &factor.solve()?)?,
        blocks: start.blocks.as_ref(),
        ..Checks::default()
    };
    Ok(reduce(factor, &combinations, &layout, &checks)?)
}

fn weighted(set: &FactorSet, efforts: &[EffortFit]) -> Result<Factor, Failure> {
    let weights: Vec<f64> = efforts.iter().map(|e| e.weight).collect();
    Ok(set.combined(&weights)?)
}

fn equations<S: Source<Error = regen_identify::data::DataError>>(
    model: &Interpreted<'_>,
    kind: Kind,
    logs: &mut S,
    set: &FactorSet,
) -> Result<Equations, Failure> {
    let mut out = Equations {
        columns: set.labels().len(),
        rows: Vec::new(),
        means: set.means(),
    };
    identify::equations(model, kind, logs, &mut NoColumns, &mut |found| {
        let resting = found.weights.contains(&0.0);
        if !found.tau.is_empty() && !resting {
            out.rows.push((found.w.to_vec(), found.tau.to_vec()));
        }
        Ok(())
    })?;
    Ok(out)
}

/// Takes the last step over: what was left out is zero in the forces.
pub(crate) fn adopt(
    reduction: &Reduction,
    columns: usize,
    confidence: f64,
    correlated: bool,
) -> Result<IdentifiedModel, Failure> {
    let step = reduction.result().ok_or_else(|| {
        Failure::Numeric("no base parameter is well identified: excite the robot more".to_owned())
    })?;
    let own = Intervals::of(
        &step.estimate,
        &step.estimate,
        confidence,
        if correlated {
            "least squares of the parameters that were kept, residuals correlated in time"
        } else {
            "least squares of the parameters that were kept, for white residuals"
        }
        .to_owned(),
    );
    let mut beta = vec![0.0; columns];
    let mut intervals = vec![None; columns];
    for (k, place) in step.kept.iter().enumerate() {
        if let (Some(slot), Some(value)) = (beta.get_mut(*place), step.estimate.values.get(k)) {
            *slot = *value;
        }
        if let (Some(slot), Some(interval)) = (intervals.get_mut(*place), own.base.get(k)) {
            *slot = *interval;
        }
    }
    Ok(IdentifiedModel {
        name: "reduced".to_owned(),
        beta,
        left_out: (0..columns).filter(|k| !step.kept.contains(k)).collect(),
        feasibility: feasibility(step.feasibility).to_owned(),
        intervals: Intervals {
            base: intervals,
            ..own
        },
        ..IdentifiedModel::default()
    })
}

fn feasibility(judged: Feasibility) -> &'static str {
    match judged {
        Feasibility::Feasible => "feasible",
        Feasibility::Infeasible => "infeasible",
        Feasibility::Undecided => "undecided",
    }
}

/// The steps in JSON.
pub(crate) fn json(reduction: &Reduction, labels: &[String]) -> Vec<StepJson> {
    let one = |step: &Step| StepJson {
        change: step.change.to_string(),
        kept: step
            .kept
            .iter()
            .filter_map(|k| labels.get(*k).cloned())
            .collect(),
        well: step.well,
        feasibility: feasibility(step.feasibility),
        condition: step.condition,
        residual: step.residual,
        other_residual: step.other_residual,
        relative_absolute: step.relative_absolute,
    };
    reduction.steps.iter().map(one).collect()
}

/// The steps for people, in 80 columns.
pub(crate) fn human(steps: &[StepJson]) -> String {
    let figure = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.3}"));
    let lines: Vec<Vec<String>> = steps
        .iter()
        .map(|step| {
            vec![
                step.change.clone(),
                step.kept.len().to_string(),
                step.well.to_string(),
                step.feasibility.to_owned(),
                format!("{:.2e}", step.condition),
                figure(Some(step.residual)),
                figure(step.relative_absolute),
            ]
        })
        .collect();
    let head = ["step", "kept", "well", "physical", "cond", "rms", "eps_RA"];
    let mut out = crate::table::columns(&head, &lines);
    out.push_str("  rms in standard deviations of the noise; eps_RA in percent, on --against\n");
    out
}
