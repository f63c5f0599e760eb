//! Reduces the base parameters of a start to those that the data tell from zero.

use std::fmt::Write as _;

use regen_runtime::BaseModel;

use super::{LeastSquaresStart, Session, SessionError};
use crate::data::{DataError, Run};
use crate::estimate::{EffortFit, FactorSet, QrFactor};
use crate::identifiability::{Change, Checks, Reduction, Step, reduce};
use crate::identify::{self, EquationKind, NoColumns};
use crate::model::{IdentifiedModel, Intervals};
use crate::states::Source;

/// Equations of the logs that a model is validated on, in memory.
struct Equations {
    columns: usize,
    /// Regressor, right-hand side and weights of each sample.
    rows: Vec<(Vec<f64>, Vec<f64>, Vec<f64>)>,
    /// The means of the efforts.
    means: Vec<f64>,
}

impl Equations {
    /// eps_RA of these base parameters in percent (Eq. 33).
    fn relative_absolute(&self, beta: &[f64]) -> f64 {
        let (mut absolute, mut spread) = (0.0, 0.0);
        for (w, tau, weights) in &self.rows {
            // as elsewhere, an effort whose coordinate rests does not count, and the others do
            let used = tau.iter().zip(&self.means).zip(weights).enumerate();
            for (i, ((t, mean), _)) in used.filter(|(_, (_, weight))| **weight > 0.0) {
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

/// Reduces the base parameters of a start step by step; returns all steps.
///
/// - `against`: further logs that each step is validated on; may be empty.
///
/// # Errors
/// When a log cannot be read, or the start does not determine the parameters.
pub fn reduction<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    start: &LeastSquaresStart,
    against: &[Run],
) -> Result<Reduction, SessionError> {
    let (model, kind) = (session.model, session.kind);
    let (factor, efforts) = (&start.factor, &start.estimate.efforts);
    let (layout, combinations) = super::physical::layout_and_base_map(model)?;
    let against = match against {
        [] => None,
        paths => {
            let mut logs = session.open(paths)?;
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
        scale: super::physical::scale(model, &layout, &combinations, &factor.solve()?)?,
        deviations: Some(&start.deviations),
        ..Checks::default()
    };
    Ok(reduce(factor, &combinations, &layout, &checks)?)
}

fn weighted(set: &FactorSet, efforts: &[EffortFit]) -> Result<QrFactor, SessionError> {
    let weights: Vec<f64> = efforts.iter().map(|e| e.weight).collect();
    Ok(set.combined(&weights)?)
}

fn equations<M: BaseModel<f64> + ?Sized, S: Source<Error = DataError>>(
    model: &M,
    kind: EquationKind,
    logs: &mut S,
    set: &FactorSet,
) -> Result<Equations, SessionError> {
    let mut out = Equations {
        columns: set.labels().len(),
        rows: Vec::new(),
        means: set.means(),
    };
    identify::equations(model, kind, logs, &mut NoColumns, &mut |rows| {
        if !rows.tau.is_empty() {
            let (tau, weights) = (rows.tau.to_vec(), rows.weights.to_vec());
            out.rows.push((rows.w.to_vec(), tau, weights));
        }
        Ok(())
    })?;
    Ok(out)
}

/// Builds an identified model from the result of a reduction; parameters that were left out are
/// zero.
///
/// - `columns`: r, the number of base parameters;
/// - `confidence`: the level of the intervals, in (0, 1);
/// - `correlated`: whether the steps account for the residuals' correlation.
///
/// # Errors
/// [`SessionError::NoWellIdentifiedParameter`] if the reduction has no result.
pub fn adopt(
    reduction: &Reduction,
    columns: usize,
    confidence: f64,
    correlated: bool,
) -> Result<IdentifiedModel, SessionError> {
    let step = reduction
        .result()
        .ok_or(SessionError::NoWellIdentifiedParameter)?;
    let residuals = if correlated {
        "residuals correlated in time"
    } else {
        "for white residuals"
    };
    let of_kept = match step.change {
        Change::Physical => "the physical values of those that were kept that fit best",
        _ => "least squares of the parameters that were kept",
    };
    let method = format!(
        "{of_kept}, {residuals}; deviations are those of all parameters, with the distance from there"
    );
    let own = Intervals::of(&step.estimate, &step.estimate, confidence, method);
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
        feasibility: described(step),
        intervals: Intervals {
            base: intervals,
            ..own
        },
        ..IdentifiedModel::default()
    })
}

/// Describes in words whether a model is feasible, and whether it fits worse than chance explains.
fn described(step: &Step) -> String {
    let mut text = step.feasibility.to_string();
    if step.change == Change::Physical {
        text.push_str(": the physical values that fit best");
    }
    if step.is_significantly_worse() {
        // writing to a String cannot fail
        let _ = write!(
            text,
            "; all parameters by least squares fit significantly better (probability {:.1e})",
            step.probability
        );
    }
    text
}
