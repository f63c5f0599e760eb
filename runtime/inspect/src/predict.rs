//! Predicts how well a log will determine the base parameters, before anything is fitted.
//!
//! With efforts of white noise of density S, the covariance of the parameters is
//! (W^T W)^-1 (S / 2) (rate of the rows of W), each row weighted by the noise of its own effort. A
//! filter of the equations that passes the motion does not change this: it reduces the variance of
//! the noise and makes consecutive noise depend on each other in the same proportion.

use nalgebra::DMatrix;
use regen_identify::estimate::{EstimateError, QrFactor};
use regen_identify::identifiability::WELL_IDENTIFIED_PERCENT;
use regen_identify::identify::{EquationKind, observe};
use regen_identify::signals::Smoothing;
use regen_identify::states::{Filtering, Source, StateSample};
use regen_runtime::{BaseModel, BaseParameter, Info};
use serde::Serialize;

use crate::clock::median;
use crate::motion::{JointMotion, Motions};
use crate::needs::{Need, Trial, needs};
use crate::spectrum::{Welch, block_rows};

/// The time between states is the median of at most this many steps.
const MAX_STEPS: usize = 1001;
/// The smallest noise that is assumed of an effort, as a part of its root mean square: logged numbers
/// are rounded.
const MIN_NOISE_PART: f64 = 1e-9;

/// The least number of equations of an effort, beyond its parameters, whose residuals tell its noise.
const MIN_FREEDOM: usize = 10;

/// The noise of an effort.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffortNoise {
    /// The effort's name.
    pub name: String,
    /// The density of the noise at high frequencies, (N m)^2/Hz or N^2/Hz; 0 of an effort that never
    /// changes, which is taken as not measured; of a coordinate without a motor that of the noisiest
    /// effort.
    pub density: f64,
    /// Its standard deviation at the rate of the rows, N m or N.
    pub sigma: f64,
    /// Whether it is about the same at all high frequencies; if not, the effort was filtered before
    /// it was logged, and noise at the frequencies of the motion is not seen.
    pub flat: bool,
}

impl EffortNoise {
    /// What speaks against the stated noise, in words in parentheses behind a space; empty if nothing
    /// does.
    pub fn doubt(&self) -> &'static str {
        match self {
            Self { density: 0.0, .. } => " (never changes: not used)",
            Self { flat: true, .. } => "",
            _ => " (filtered?)",
        }
    }
}

/// How well an identification from this log would determine a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExpectedStatus {
    /// The standard deviation is below 15 % of the nominal value.
    Well,
    /// The parameter is determined; there is no nominal value to compare its deviation with.
    Determined,
    /// The standard deviation is 15 % of the nominal value or more.
    Poor,
    /// Only a combination with other parameters is determined.
    Combined,
    /// No effort depends on the parameter at these states.
    Unseen,
}

impl ExpectedStatus {
    /// The word for it in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Well => "well",
            Self::Determined => "determined",
            Self::Poor => "poor",
            Self::Combined => "combined",
            Self::Unseen => "unseen",
        }
    }
}

/// What to expect of one base parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PredictedParameter {
    /// The label of its first term, such as `Izz(1)`.
    pub label: String,
    /// Its nominal value, SI, where all parameters of its combination have one.
    pub nominal: Option<f64>,
    /// The predicted standard deviation, SI; `None` where data do not determine it.
    pub sigma: Option<f64>,
    /// The same in percent of the nominal value.
    pub percent: Option<f64>,
    /// The magnitude from which on it would be well identified, SI: sigma over 15 %.
    pub well_from: Option<f64>,
    /// How well data determine it.
    pub status: ExpectedStatus,
    /// The motions that would determine it better, the best first; empty where it is well
    /// identified, or no motion of a single joint helps.
    pub needs: Vec<Need>,
}

/// What to expect of an identification.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Prediction {
    /// The number of equations.
    pub equations: usize,
    /// The noise of each effort.
    pub noise: Vec<EffortNoise>,
    /// All base parameters, in the order of `BaseModel::base_info`.
    pub parameters: Vec<PredictedParameter>,
    /// The condition number of the weighted equations with columns scaled to unit length.
    pub condition: f64,
    /// How each independent joint moves.
    pub motion: Vec<JointMotion>,
    /// Sentences about what the prediction is made from, such as runs that are left out.
    pub notes: Vec<String>,
}

impl Prediction {
    /// Removes the nominal values and what follows from them, where the efforts are in other units
    /// than these, and states why: parameters that data determine are `determined`, neither well nor
    /// poor.
    pub fn without_nominal(&mut self, why: String) {
        for parameter in &mut self.parameters {
            parameter.nominal = None;
            parameter.percent = None;
            if matches!(
                parameter.status,
                ExpectedStatus::Well | ExpectedStatus::Poor
            ) {
                parameter.status = ExpectedStatus::Determined;
                parameter.needs.clear();
            }
        }
        self.notes.push(why);
    }
}

/// A source that also passes each of its states to another function.
struct Tap<'a, S: ?Sized> {
    source: &'a mut S,
    each: &'a mut dyn FnMut(&StateSample<'_>),
}

impl<S: Source + ?Sized> Source for Tap<'_, S> {
    type Error = S::Error;

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), S::Error> {
        let look = &mut *self.each;
        self.source.visit(&mut |row| {
            look(row);
            each(row)
        })
    }

    fn filtering(&self) -> Filtering {
        self.source.filtering()
    }
}

/// The standard deviations of parameters if the errors of the equations have unit variance.
pub(crate) struct Spread {
    /// `None` for those that are not determined.
    pub(crate) sigmas: Vec<Option<f64>>,
    /// Whether each parameter is part of a combination of which only the sum is determined.
    pub(crate) combined: Vec<bool>,
    pub(crate) condition: f64,
}

/// The standard deviations that follow from R: the square roots of the diagonal of (R^T R)^-1,
/// computed with scaled columns.
pub(crate) fn spread(factor: &QrFactor) -> Result<Spread, EstimateError> {
    let n = factor.columns();
    let mut kept: Vec<usize> = (0..n).collect();
    let whole = factor.spectrum()?;
    let mut combined = vec![false; n];
    if whole.rank() < n {
        for k in whole.undetermined() {
            combined[k] = true;
        }
    }
    let mut spectrum = whole.clone();
    while spectrum.rank() < kept.len() {
        let Some(place) = spectrum.undetermined().pop() else {
            break;
        };
        kept.remove(place);
        if kept.is_empty() {
            break;
        }
        spectrum = factor.select(&kept)?.spectrum()?;
    }
    let selected = factor.select(&kept)?;
    let m = kept.len();
    let scale: Vec<f64> = selected.column_norms();
    let r = DMatrix::from_fn(m, m, |i, j| {
        let length = scale[j];
        if length > 0.0 {
            selected.r()[j * m + i] / length
        } else {
            0.0
        }
    });
    let mut sigmas = vec![None; n];
    if let Some(inverse) = r.solve_upper_triangular(&DMatrix::identity(m, m)) {
        for (place, k) in kept.iter().enumerate() {
            let squares: f64 = inverse.row(place).iter().map(|x| x * x).sum();
            let sigma = squares.sqrt() / scale[place];
            if sigma.is_finite() {
                sigmas[*k] = Some(sigma);
            }
        }
    }
    Ok(Spread {
        sigmas,
        combined,
        condition: spectrum.scaled_condition(),
    })
}

/// The weight of equations with noise of this variance; that of an effort that never changes is 0.
fn weight(variance: f64) -> f64 {
    if variance > 0.0 {
        1.0 / variance.sqrt()
    } else {
        0.0
    }
}

/// The variance of what the equations of an effort leave of it; `None` where there are too few to tell.
fn left_variance(factor: &QrFactor) -> Option<f64> {
    let acting = factor
        .column_norms()
        .iter()
        .filter(|norm| **norm > 0.0)
        .count();
    let freedom = factor
        .rows()
        .checked_sub(acting)
        .filter(|own| *own >= MIN_FREEDOM)?;
    Some(factor.rss() / freedom as f64)
}

/// The nominal value of a base parameter.
fn nominal(info: &Info<'_>, parameter: &BaseParameter<'_>) -> Option<f64> {
    let terms = parameter.terms.iter();
    terms
        .map(|term| Some(term.value * info.nominal.get(term.index).copied().flatten()?))
        .sum()
}

/// Predicts how well the base parameters will be determined from states of a log: one pass over it,
/// without a fit.
///
/// The noise is that of the efforts at high frequencies. Errors of the model and of the positions come
/// on top, so that the deviations of a fit are larger where these matter.
///
/// - `rows`: the approximate number of states;
/// - `step`: the time between them, s.
///
/// # Errors
/// When the log cannot be read or does not fit the model.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// # use models::Pendulum;
/// use regen_identify::identify::{EquationKind};
/// use regen_identify::states::{Recorded};
/// use regen_inspect::{ExpectedStatus, predict};
///
/// // a pendulum that turns at a constant speed shows its weight and not its inertia
/// let mut log = Recorded::new();
/// let mut state = 1_u64;
/// for k in 0..4000 {
///     let q = 0.01 * f64::from(k);
///     state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
///     let noise = (state >> 33) as f64 / 2_f64.powi(31) - 0.5;
///     log.push(q, &[q], &[1.0], &[0.0], &[2.0 * 9.81 * q.sin() + noise]);
/// }
/// let found = predict(&Pendulum, EquationKind::Forces, &mut log, 4000, 0.01)?;
/// let [inertia, weight] = &found.parameters[..] else { panic!() };
/// assert_eq!((inertia.label.as_str(), inertia.status), ("Izz(1)", ExpectedStatus::Unseen));
/// assert_eq!(inertia.needs[0].to_string(), "acceleration of q1");
/// assert_eq!(found.motion[0].lacks, ["never changes direction", "never accelerates"]);
/// // sigma of even noise, over the square root of the sum of (9.81 sin q)^2
/// let expected = (1.0_f64 / 12.0).sqrt() / (9.81 * 2000.0_f64.sqrt());
/// assert!((weight.sigma.unwrap() / expected - 1.0).abs() < 0.1);
/// # Ok::<(), regen_identify::estimate::EstimateError>(())
/// ```
pub fn predict<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    kind: EquationKind,
    source: &mut S,
    rows: usize,
    step: f64,
) -> Result<Prediction, S::Error> {
    let info = model.info();
    let dof = info.dof();
    let mut welches = vec![Welch::new(block_rows(rows, step)); dof];
    let mut squares = vec![0.0; dof];
    let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; dof];
    let mut motions = Motions::new(dof);
    let (mut last, mut steps, mut count) = (None, Vec::new(), 0.0);
    let filtering = source.filtering();
    let (set, _) = observe(
        model,
        kind,
        &mut Tap {
            source,
            each: &mut |row| {
                if !row.follows {
                    welches.iter_mut().for_each(Welch::restart);
                }
                for (k, tau) in row.tau.iter().enumerate().take(dof) {
                    welches[k].push(*tau);
                    squares[k] += tau * tau;
                    let [low, high] = ranges[k];
                    ranges[k] = [low.min(*tau), high.max(*tau)];
                }
                if let (true, Some(last)) = (row.follows && steps.len() < MAX_STEPS, last) {
                    steps.push(row.time - last);
                }
                last = Some(row.time);
                count += 1.0;
                motions.push(&info, row);
            },
        },
    )?;
    let between = Some(median(&steps)).filter(|s| *s > 0.0).unwrap_or(step);
    let mut noise: Vec<EffortNoise> = info
        .independent
        .iter()
        .zip(welches)
        .zip(squares.iter().zip(&ranges))
        .enumerate()
        .map(|(k, ((c, welch), (squares, [low, high])))| {
            let found = welch.finish(1.0 / between).map(|density| density.judge(0));
            let least = MIN_NOISE_PART * (squares / f64::max(count, 1.0)).sqrt();
            // rows that do not follow each other, as poses at rest, have no frequencies: what their equations leave
            let own = set.factors().get(k).filter(|_| found.is_none());
            let left = own.and_then(left_variance);
            let density = found
                .map(|s| s.floor)
                .or(left.map(|variance| 2.0 * between * variance))
                .unwrap_or(0.0)
                .max(2.0 * between * least * least);
            let density = if low < high { density } else { 0.0 };
            EffortNoise {
                name: info.coordinates.get(*c).map_or("", |n| n).to_owned(),
                density,
                sigma: (0.5 * density / between).sqrt(),
                flat: left.is_some() || found.is_some_and(|s| s.flat),
            }
        })
        .collect();
    // the effort of a coordinate without a motor is 0, and what is left in its equation not known before
    let largest = noise
        .iter()
        .fold(0.0, |most: f64, own| most.max(own.density));
    for (own, c) in noise.iter_mut().zip(info.independent) {
        if own.density <= 0.0 && !info.actuated.contains(c) {
            own.density = largest;
            own.sigma = (0.5 * largest / between).sqrt();
            own.flat = true;
        }
    }
    let decimated = between * filtering.samples_between(between) as f64;
    // half the rate of the equations, or the noise bandwidth of the filter if it is larger
    let band = match filtering.smoothing {
        Smoothing::None => 0.5 / between,
        Smoothing::Butterworth { cutoff, .. } => (0.5 / decimated).max(cutoff),
        Smoothing::Local { .. } => 0.5 / decimated,
    };
    let weights: Vec<f64> = noise.iter().map(|n| weight(n.density * band)).collect();
    // an energy balance has one equation of all efforts
    let of_set = if set.efforts.len() == weights.len() {
        weights.clone()
    } else {
        let all = noise.iter().map(|n| n.density * band).sum();
        vec![weight(all); set.efforts.len()]
    };
    let factor = set.combined(&of_set)?;
    let now = spread(&factor)?;
    let motion = motions.finish(&info);
    let base = model.base_info().base;
    let norms = factor.column_norms();
    let mut parameters: Vec<PredictedParameter> = base
        .iter()
        .enumerate()
        .map(|(k, parameter)| {
            let nominal = nominal(&info, parameter);
            let sigma = now.sigmas.get(k).copied().flatten();
            let combined = now.combined.get(k).copied().unwrap_or(false);
            let sigma = sigma.filter(|_| !combined);
            let percent = nominal
                .zip(sigma)
                .map(|(value, sigma)| 100.0 * sigma / value.abs())
                .filter(|p| p.is_finite());
            let status = match (sigma, percent) {
                (None, _) if norms.get(k).is_none_or(|norm| *norm <= 0.0) => ExpectedStatus::Unseen,
                (None, _) => ExpectedStatus::Combined,
                (Some(_), Some(percent)) if percent < WELL_IDENTIFIED_PERCENT => {
                    ExpectedStatus::Well
                }
                (Some(_), Some(_)) => ExpectedStatus::Poor,
                (Some(_), None) => ExpectedStatus::Determined,
            };
            PredictedParameter {
                label: parameter.label.to_owned(),
                nominal,
                sigma,
                percent,
                well_from: sigma.map(|s| 100.0 * s / WELL_IDENTIFIED_PERCENT),
                status,
                needs: Vec::new(),
            }
        })
        .collect();
    let in_question: Vec<usize> = (0..parameters.len())
        .filter(|k| parameters[*k].status >= ExpectedStatus::Poor)
        .collect();
    let trial = Trial {
        model,
        factor: &factor,
        weights: &weights,
        states: &motions.spread(),
        motions: &motion,
    };
    // parameters of which only a combination is determined count as undetermined
    let judged = Spread {
        sigmas: parameters.iter().map(|p| p.sigma).collect(),
        ..now
    };
    let found = needs(&trial, &judged, &in_question)?;
    for (k, needs) in in_question.into_iter().zip(found) {
        parameters[k].needs = needs;
    }
    Ok(Prediction {
        equations: factor.rows(),
        noise,
        parameters,
        condition: judged.condition,
        motion,
        notes: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Noise, models};
    use regen_identify::states::Recorded;

    #[test]
    fn the_times_of_the_states_decide_how_dense_the_noise_is_and_not_the_stated_step() {
        let (step, sigma) = (0.01, 0.3);
        let mut log = Recorded::new();
        let mut noise = Noise::new(2);
        for k in 0..4000 {
            let t = step * f64::from(k);
            let q = t.sin();
            let effort = 2.0 * 9.81 * q.sin() + sigma * noise.normal();
            log.push(t, &[q], &[t.cos()], &[-q], &[effort]);
        }
        // a variance of sigma^2 below half the rate
        let wanted = 2.0 * sigma * sigma * step;
        for stated in [step, 2.0 * step] {
            let forces = EquationKind::Forces;
            let found = predict(&models::Pendulum, forces, &mut log, 4000, stated).unwrap();
            let density = found.noise[0].density;
            assert!((density / wanted - 1.0).abs() < 0.15, "{stated} {density}");
        }
    }

    #[test]
    fn an_effort_that_never_changes_is_not_used() {
        let mut log = Recorded::new();
        for k in 0..2000 {
            let t = 0.01 * f64::from(k);
            log.push(t, &[t.sin()], &[t.cos()], &[-t.sin()], &[0.0]);
        }
        let kinds = [EquationKind::Forces, EquationKind::Energy { window: 0.1 }];
        for kind in kinds {
            let found = predict(&models::Pendulum, kind, &mut log, 2000, 0.01).unwrap();
            assert!(found.noise[0].doubt().contains("never changes"));
            for parameter in &found.parameters {
                assert_eq!(parameter.status, ExpectedStatus::Unseen);
                assert_eq!(parameter.sigma, None);
            }
        }
    }
}
