//! Computes physically feasible parameters from the least-squares estimate: decides whether that
//! estimate is feasible, fits under the constraints, and fits nonlinear friction.

use std::fmt::Write as _;

use regen_runtime::{BaseModel, Friction, LoopClosure};

use super::{LeastSquaresStart, PriorKnowledge, Session, SessionError};
use crate::feasibility::{
    BaseMap, Body, Bound, MAX_OPTIMAL_GAP, Options, Outcome, ParameterLayout, PhysicalFit, Scale,
    Verdict, identify_first, verdict,
};
use crate::friction::{self, FrictionData, FrictionJoint, JointFit, fit};
use crate::intervals::{Draws, LeastSquares, Spread, constrained_by};
use crate::model::{IdentifiedModel, Interval, Intervals};
use crate::text::figure_of;

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
        let one = |s: &Spread| drawn_interval(s, session.confidence);
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
            let one = |s: &Spread| drawn_interval(s, session.confidence);
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

/// Describes how intervals under constraints were computed; `known` describes how the standard
/// deviations of least squares were.
pub(crate) fn describe_draws(replicates: usize, known: &str) -> String {
    format!("percentiles of {replicates} draws of least squares under the constraints; {known}")
}

/// The interval of a value from its draws; `None` if there are no draws.
pub(crate) fn drawn_interval(spread: &Spread, confidence: f64) -> Option<Interval> {
    let (low, high) = spread.interval(confidence);
    low.is_finite().then_some(Interval {
        sigma: spread.sigma,
        sigma_white: f64::NAN,
        low,
        high,
    })
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

/// Describes a verdict in words.
fn describe_verdict(judged: &Verdict) -> String {
    match judged {
        Verdict::Feasible { margin, .. } => {
            format!("feasible: a physical robot has them (smallest eigenvalue {margin:.2e})")
        }
        Verdict::Infeasible { certificate } => {
            let escape = certificate.escape();
            if escape.is_finite() {
                format!("infeasible: proven for robots of less than {escape:.1e} kg and kg m^2")
            } else {
                "infeasible: proven, no physical robot has them".to_owned()
            }
        }
        Verdict::Undecided { .. } => {
            "undecided: too close to the border of feasibility for double precision".to_owned()
        }
    }
}

/// Describes in words whether the gap to the optimum proves optimality.
fn describe_gap(gap: f64) -> String {
    if gap <= MAX_OPTIMAL_GAP {
        format!("the optimum, proven to {gap:.1e}")
    } else {
        format!("NOT proven to be the optimum, gap {gap:.1e}")
    }
}

/// Describes a physically feasible fit: how much the constraints increase the residual, and how far
/// the result can be from the optimum.
pub(crate) fn describe_fit(found: &PhysicalFit, layout: &ParameterLayout) -> String {
    let how = match found.outcome {
        Outcome::Unconstrained => "physical, no constraint is active".to_owned(),
        Outcome::Constrained => format!("physical, {}", describe_gap(found.gap)),
    };
    let (margin, rise) = (found.check.margin(), 100.0 * found.rise());
    let mut text = format!("{how} (smallest eigenvalue {margin:.2e}, rms residual +{rise:.3} %)");
    // a body of little mass reaches its limit by its moments of inertia
    let is_heavy = |label: &&String| heavy_bodies(found, layout).any(|body| body.label == **label);
    let (heavier, larger): (Vec<&String>, Vec<&String>) = found.limited.iter().partition(is_heavy);
    let list = |labels: &[&String]| {
        labels
            .iter()
            .map(|l| l.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    for (bodies, than, what) in [
        (heavier, "heavier", "masses"),
        (larger, "of larger inertia", "moments of inertia"),
    ] {
        if !bodies.is_empty() {
            // writing to a String cannot fail
            let _ = write!(
                text,
                "; the fit wants {} {than} than any robot of this size: bound their {what}",
                list(&bodies)
            );
        }
    }
    let heavy = heavy(found, layout);
    if !heavy.is_empty() {
        let _ = write!(
            text,
            "; the masses {} hardly affect the fit, and this robot cannot have these values: bound \
             them",
            heavy.join(", ")
        );
    }
    text
}

/// Bodies heavier than this part of the safety limit of their mass are reported. The limit is a
/// thousand times the mass that is known of the robot, so that a reported body is a hundred times as
/// heavy as that: no load or counterweight is.
const MAX_LIMIT_PART: f64 = 0.1;

/// The bodies whose masses are far above any that the robot can have.
fn heavy_bodies<'a>(
    found: &'a PhysicalFit,
    layout: &'a ParameterLayout,
) -> impl Iterator<Item = &'a Body> {
    let bodies = layout.bodies().iter().zip(&found.sizes);
    let heavy = bodies.filter(|(body, size)| {
        let mass = body.columns.last().and_then(|c| found.phi.get(*c));
        mass.is_some_and(|m| *m > MAX_LIMIT_PART * size.mass)
    });
    heavy.map(|(body, _)| body)
}

/// The labels of masses far above any that the robot can have, without bodies that reach their
/// limit.
fn heavy(found: &PhysicalFit, layout: &ParameterLayout) -> Vec<String> {
    let own = heavy_bodies(found, layout).filter(|body| !found.limited.contains(&body.label));
    own.map(|body| format!("m({})", body.label)).collect()
}

/// The labels of masses that neither the data nor a meaningful limit bounds.
pub(crate) fn unbounded(found: &PhysicalFit, layout: &ParameterLayout) -> Vec<String> {
    let is_limited = |body: &&Body| found.limited.contains(&body.label);
    let limited = heavy_bodies(found, layout).filter(is_limited);
    let limited = limited.map(|body| format!("m({})", body.label));
    limited.chain(heavy(found, layout)).collect()
}

/// A mass that the data leave open is held below so many times its nominal value or, without one, the mass that is
/// known of the whole robot.
const MAX_NOMINAL: f64 = 3.0;
/// The limit of a body's mass over the mass that is known of the robot, see
/// [`SizeLimit`](crate::feasibility::SizeLimit).
const LIMIT_RATIO: f64 = 1000.0;
/// Limits of masses may cost this part of the rms residual: less than its last printed digit.
const MAX_COST: f64 = 1e-4;

/// Limits of the masses that hardly affect a fit and are far above any that the robot can have.
///
/// - `nominal`: the nominal values of all parameters, SI.
fn limits_of_free_masses(
    found: &PhysicalFit,
    layout: &ParameterLayout,
    nominal: &[Option<f64>],
) -> Vec<Bound> {
    let free = unbounded(found, layout);
    let bodies = layout.bodies().iter().zip(&found.sizes);
    let limits = bodies.map(|(body, size)| {
        let own = body.columns.last().and_then(|c| *nominal.get(*c)?);
        let own = own.filter(|mass| *mass > 0.0);
        Bound {
            parameter: format!("m({})", body.label),
            lowest: f64::NEG_INFINITY,
            highest: MAX_NOMINAL * own.unwrap_or(size.mass / LIMIT_RATIO),
        }
    });
    limits.filter(|own| free.contains(&own.parameter)).collect()
}

/// Says which masses are held below limits that no one gave.
fn describe_held(limits: &[Bound]) -> String {
    let all = limits
        .iter()
        .map(|own| format!("{} below {} kg", own.parameter, figure_of(3, own.highest)));
    let all: Vec<String> = all.collect();
    if all.is_empty() {
        return String::new();
    }
    format!(
        "; masses that hardly affect the fit are held below what this robot can have: {}",
        all.join(", ")
    )
}

/// Linear friction at joints with nonlinear friction, from `values`: Fc and Fv of each in turn.
fn linear(joints: &[FrictionJoint], values: &[f64]) -> Vec<JointFit> {
    let pairs = joints.iter().zip(values.chunks_exact(2));
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::estimate::QrFactor;
    use crate::feasibility::{SYMBOLS, identify};

    /// A mass that the fit leaves open is held below three times its nominal value or, without one, the largest mass
    /// that is known of the robot.
    #[test]
    fn open_masses_are_held_below_what_the_robot_can_have() {
        let labels: Vec<String> = (1..=2)
            .flat_map(|body| SYMBOLS.iter().map(move |s| format!("{s}({body})")))
            .collect();
        let layout = ParameterLayout::new(&labels).unwrap();
        // the moment of mass of body 1 without inertia about z, which takes an infinite mass; body 2 weighs 4 kg
        let map = BaseMap::identity(&labels).select(&[6, 5, 19]).unwrap();
        let mut factor = QrFactor::new(map.labels().to_vec());
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        factor.push_block(&identity, &[0.1, -1.0, 4.0]).unwrap();
        let found = identify(&factor, &map, &layout, &Options::default()).unwrap();
        assert_eq!(unbounded(&found, &layout), ["m(1)"]);
        let mut nominal = vec![None; 20];
        let [own] = &limits_of_free_masses(&found, &layout, &nominal)[..] else {
            panic!("one mass is open")
        };
        let known = found.sizes[0].mass / LIMIT_RATIO;
        assert_eq!((own.parameter.as_str(), own.highest), ("m(1)", 3.0 * known));
        nominal[9] = Some(0.7);
        let bounds = limits_of_free_masses(&found, &layout, &nominal);
        assert!((bounds[0].highest - 2.1).abs() < 1e-12);
        assert!(describe_held(&bounds).contains("m(1) below 2.10 kg"));
        let held = Options {
            bounds,
            ..Options::default()
        };
        let found = identify(&factor, &map, &layout, &held).unwrap();
        assert!(found.phi[9] < 2.1 + 1e-6 && unbounded(&found, &layout).is_empty());
    }

    /// What is asked to be bounded is what grew: the mass for a moment of mass without inertia, the
    /// inertia for one without mass, and nothing for a fit that needs no limit.
    #[test]
    fn the_advice_names_what_has_no_bound() {
        let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
        let layout = ParameterLayout::new(&labels).unwrap();
        let said = |observed: [usize; 2], values: [f64; 2]| {
            let map = BaseMap::identity(&labels).select(&observed).unwrap();
            let mut factor = QrFactor::new(map.labels().to_vec());
            factor.push_block(&[1.0, 0.0, 0.0, 1.0], &values).unwrap();
            let found = identify(&factor, &map, &layout, &Options::default()).unwrap();
            (describe_fit(&found, &layout), unbounded(&found, &layout))
        };
        let (mx, izz, m) = (6, 5, 9);
        let (text, masses) = said([mx, izz], [0.1, -1.0]);
        assert!(text.contains("1 heavier than any"), "{text}");
        assert_eq!(masses, ["m(1)"]);
        let (text, masses) = said([mx, m], [0.1, -1.0]);
        assert!(text.contains("1 of larger inertia than any"), "{text}");
        assert!(!text.contains("masses") && masses.is_empty(), "{text}");
        let (text, masses) = said([izz, m], [-0.1, 1.0]);
        assert!(!text.contains("bound") && masses.is_empty(), "{text}");
    }
}
