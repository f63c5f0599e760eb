//! Computes physically feasible parameters from the least-squares estimate: decides whether that
//! estimate is feasible, fits under the constraints, and fits nonlinear friction.

use regen_runtime::{BaseModel, Friction, LoopClosure};

use super::{LeastSquaresStart, PriorKnowledge, Session, SessionError};
use crate::feasibility::{
    BaseMap, MAX_COST, Options, ParameterLayout, Scale, Verdict, describe_draws, describe_fit,
    describe_gap, describe_held, describe_verdict, identify_first, limits_of_free_masses,
    unbounded, verdict,
};
use crate::friction::{self, FrictionData, JointFit, fit};
use crate::intervals::{Draws, LeastSquares, Spread, constrained_by};
use crate::model::{IdentifiedModel, Interval, Intervals};
use crate::states::FrictionJoint;

/// The parameter layout of a model, and the map from its parameters to base parameters.
pub(super) fn layout_and_base_map<M: BaseModel<f64> + ?Sized>(
    model: &M,
) -> Result<(ParameterLayout, BaseMap), SessionError> {
    let layout = ParameterLayout::of(model.info().parameters)?;
    let combinations = BaseMap::from_model(model, layout.len())?;
    Ok((layout, combinations))
}

/// Computes the models of a session: the least-squares model `start` with the verdict on its
/// feasibility, the physically feasible model, and, where a joint has nonlinear friction, the
/// feasible model with that friction. In the last case, the parameters of `start` after the base
/// parameters are those of linear friction at these joints.
///
/// - `draws`: the number of fits that the intervals are computed from; 0 for no intervals.
///
/// # Errors
/// When constraints contradict each other, or name parameters or bodies that do not exist.
pub fn physical<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    knowledge: &PriorKnowledge,
    start: &LeastSquaresStart,
    draws: usize,
) -> Result<Vec<IdentifiedModel>, SessionError> {
    let model = session.model;
    let info = model.info();
    let (factor, values) = (&start.factor, start.estimate.values.as_slice());
    let data = start.data.as_ref();
    let (plain_layout, plain) = layout_and_base_map(model)?;
    let r = plain.labels().len();
    let more = factor.labels().get(r..).unwrap_or_default();
    let joints = data.map_or(&[][..], FrictionData::joints);
    let layout = plain_layout.extended(more)?;
    let combinations = plain.extended(more);
    let scale = scale(model, &layout, &combinations, values)?;
    let mut options = Options {
        scale,
        ..knowledge.options(&info, &layout)?
    };
    let judged = verdict(&layout, &combinations, values, scale)?;
    let mut out = vec![IdentifiedModel {
        name: if data.is_some() {
            "linear, least squares".to_owned()
        } else {
            "least squares".to_owned()
        },
        beta: values.get(..r).unwrap_or_default().to_vec(),
        phi: None,
        friction: linear(joints, values.get(r..).unwrap_or_default()),
        feasibility: describe_verdict(&judged),
        ..IdentifiedModel::default()
    }];
    let certificate = match &judged {
        Verdict::Infeasible { certificate } => Some(certificate),
        Verdict::Feasible { .. } | Verdict::Undecided { .. } => None,
    };
    let (mut linear_fit, mut known) =
        identify_first(factor, &combinations, &layout, &options, certificate)?;
    let held = limits_of_free_masses(&linear_fit, &layout, &options.reference);
    if !held.is_empty() {
        let bounded = Options {
            bounds: [&options.bounds[..], &held].concat(),
            ..options.clone()
        };
        let found = identify_first(factor, &combinations, &layout, &bounded, certificate);
        // a limit that the fit resists is not one that the data leave open
        if let Ok((fit, similar)) = found
            && fit.squared_residual.sqrt() <= (1.0 + MAX_COST) * linear_fit.squared_residual.sqrt()
        {
            (linear_fit, known, options) = (fit, similar, bounded);
        }
    }
    let added = options
        .bounds
        .get(knowledge.bounds.len()..)
        .unwrap_or_default()
        .to_vec();
    let p = plain_layout.len();
    let mut progress = |done: usize| {
        session
            .watch
            .phase(&format!("intervals: {done} of {draws} fits"));
    };
    let intervals = if data.is_some() || draws == 0 {
        Intervals::default()
    } else {
        let least = LeastSquares {
            factor,
            values,
            deviations: &start.deviations,
        };
        let found = (linear_fit.phi.as_slice(), linear_fit.beta.as_slice());
        let draws = Draws {
            known: known.as_ref(),
            ..Draws::new(least, draws)
        };
        let found = constrained_by(
            least,
            &combinations,
            &layout,
            &options,
            found,
            &draws,
            &mut progress,
        )?;
        let known = match start.score_blocks {
            Some(_) => start.deviations.in_words(),
            None => "for white residuals".to_owned(),
        };
        let one = |s: &Spread| Interval::drawn(s, session.confidence);
        Intervals {
            base: found.base.iter().map(one).collect(),
            physical: found.physical.iter().map(|s| one(s.as_ref()?)).collect(),
            friction: Vec::new(),
            bias: start.intervals.bias.clone(),
            method: describe_draws(found.replicates, &known),
        }
    };
    out.push(IdentifiedModel {
        name: if data.is_some() {
            "linear, feasible".to_owned()
        } else {
            "feasible".to_owned()
        },
        beta: linear_fit.beta.get(..r).unwrap_or_default().to_vec(),
        phi: linear_fit.phi.get(..p).map(<[f64]>::to_vec),
        friction: linear(joints, linear_fit.phi.get(p..).unwrap_or_default()),
        feasibility: describe_fit(&linear_fit, &layout) + &describe_held(&added),
        unbounded: unbounded(&linear_fit, &layout),
        gap: Some(linear_fit.gap),
        intervals,
        ..IdentifiedModel::default()
    });
    if let Some(data) = data {
        let mut own = Options {
            scale,
            ..knowledge.options(&info, &plain_layout)?
        };
        own.bounds.extend(added.iter().cloned());
        let found = fit(data, &plain, &plain_layout, &own)?;
        let mut text = format!(
            "physical; {:.3} % of the linear model's squared residuals; with these shapes {}",
            100.0 * found.squared_residual / found.linear_squared_residual,
            describe_gap(found.gap)
        );
        if !found.converged {
            text.push_str("; the search for the shapes did not converge");
        }
        text.push_str(&describe_held(&added));
        let intervals = if draws == 0 {
            Intervals::default()
        } else {
            let spread = friction::intervals(
                data,
                &plain,
                &plain_layout,
                &own,
                &found,
                draws,
                &mut progress,
            )?;
            let short = if spread.replicates > 0 && spread.deviations.short() {
                "; likely to be too small, as the independent samples are too few"
            } else {
                ""
            };
            let filter = if session.reading.method.smoothing().is_none() {
                ""
            } else {
                "; with what the filter leaves unknown of the velocities near reversals"
            };
            let one = |s: &Spread| Interval::drawn(s, session.confidence);
            let of_joint =
                |joint: &Vec<Option<Spread>>| joint.iter().map(|s| one(s.as_ref()?)).collect();
            Intervals {
                base: spread.base.iter().map(one).collect(),
                physical: spread.physical.iter().map(|s| one(s.as_ref()?)).collect(),
                friction: spread.joints.iter().map(of_joint).collect(),
                bias: Vec::new(),
                method: format!(
                    "shapes of friction drawn by their likelihood; {}{short}{filter}",
                    describe_draws(spread.replicates, &spread.deviations.in_words())
                ),
            }
        };
        out.push(IdentifiedModel {
            name: "nonlinear, feasible".to_owned(),
            beta: found.beta,
            phi: Some(found.phi),
            friction: found.joints,
            feasibility: text,
            gap: Some(found.gap),
            intervals,
            ..IdentifiedModel::default()
        });
    }
    Ok(out)
}

/// Units of mass and length near those of the robot, from its size and its base parameters.
///
/// - `beta`: base parameters, SI.
///
/// # Errors
/// When the model's home is not closed.
pub fn scale<M: BaseModel<f64> + ?Sized>(
    model: &M,
    layout: &ParameterLayout,
    combinations: &BaseMap,
    beta: &[f64],
) -> Result<Scale, SessionError> {
    let length = LoopClosure::new(model)?.length_unit();
    Ok(Scale::near(layout, combinations, beta, length))
}

/// Linear friction at joints with nonlinear friction, from `values`: Fc and Fv of each in turn.
fn linear(joints: &[FrictionJoint], values: &[f64]) -> Vec<JointFit> {
    let pairs = joints.iter().zip(values.as_chunks::<2>().0);
    pairs
        .map(|(joint, own)| JointFit {
            name: joint.name.clone(),
            friction: Friction::Linear,
            // the symbols of linear friction are in the order Fv, Fc
            values: own.iter().rev().copied().collect(),
        })
        .collect()
}

/// Splits least-squares parameters into base parameters and linear friction at these joints.
pub(super) fn linear_part<M: BaseModel<f64> + ?Sized>(
    model: &M,
    joints: &[FrictionJoint],
    values: &[f64],
) -> (Vec<f64>, Vec<JointFit>) {
    let r = model.base_info().base.len().min(values.len());
    let (beta, more) = values.split_at(r);
    (beta.to_vec(), linear(joints, more))
}
