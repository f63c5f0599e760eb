//! Results that speed up further fits to similar observations, such as the draws of an interval.

use super::constrained::TARGET_GAP;
use super::faces::{InteriorStart, find_interior_point};
use super::interior::{InteriorOutcome, Point, Precision, minimise, start};
use super::problem::{Problem, Setting};
use super::verdict::{refutes, verdict};
use super::{
    BaseMap, FeasibilityError, InfeasibilityCertificate, Options, ParameterLayout, Scale, Verdict,
};
use crate::estimate::QrFactor;

/// Results of fits to similar observations with the same combinations, layout and options. They make
/// further fits faster.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    /// The weights of certificates which prove that no physical robot has the least-squares base
    /// parameters of earlier observations; the same weights may prove it for further ones.
    certificates: Vec<Vec<f64>>,
    similar: Option<Similar>,
    /// The gap at which fits that begin at the similar one stop; `None`: [`NEAR_GOAL`].
    goal: Option<f64>,
}

/// The estimated gap at which a fit that starts near a similar one stops.
const NEAR_GOAL: f64 = 1e-9;

/// A fit to similar observations.
#[derive(Clone, Debug)]
pub(super) struct Similar {
    problem: Problem,
    /// The standard deviation of its noise.
    noise: f64,
    /// A point well inside the cones.
    inside: Vec<f64>,
    /// Where fits to similar observations start, if the method reached the optimum.
    central: Option<Central>,
}

/// Where fits to similar observations start.
#[derive(Clone, Debug)]
pub(super) struct Central {
    /// A point near the central path on the way to the optimum.
    pub(super) point: Point,
    /// The absolute values of the variables at the optimum.
    pub(super) reach: Vec<f64>,
}

impl Central {
    pub(super) fn of(found: InteriorOutcome) -> Self {
        Self {
            reach: found.best.x.iter().map(|x| x.abs()).collect(),
            point: found.central,
        }
    }
}

impl Similar {
    /// - `inside`: a point well inside the cones;
    pub(super) fn new(
        noise: f64,
        problem: Problem,
        inside: Vec<f64>,
        central: Option<Central>,
    ) -> Self {
        Self {
            problem,
            noise,
            inside,
            central,
        }
    }
}

/// A problem and points to start its solution from.
pub(super) struct Starts {
    pub(super) problem: Problem,
    /// A point well inside the cones.
    pub(super) inside: Vec<f64>,
    /// A start that takes fewer steps if the optimum is near that of similar observations.
    pub(super) central: Option<Central>,
    /// The gap at which a fit from there stops.
    pub(super) goal: f64,
}

impl Known {
    /// The results of a fit to these observations; see [`identify`](super::identify).
    pub(crate) fn of(
        factor: &QrFactor,
        combinations: &BaseMap,
        layout: &ParameterLayout,
        options: &Options,
    ) -> Result<Self, FeasibilityError> {
        let mut known = Self::default();
        let Ok(beta) = factor.solve() else {
            return Ok(known);
        };
        let setting = Setting::new(factor, combinations, layout, options);
        let inside = find_interior_point(&setting);
        if !options.has_constraints() {
            match verdict(layout, combinations, &beta, options.scale)? {
                Verdict::Infeasible { certificate } => known.certificates.push(certificate.weights),
                // the fit may not need a point inside the cones
                _ if inside.is_err() => return Ok(known),
                _ => {}
            }
        }
        let InteriorStart { problem, x } = inside?;
        let Problem {
            objective,
            cones,
            reach,
            ..
        } = &problem;
        let first = start(objective, cones, x.clone());
        let goal = (TARGET_GAP, Precision::Full);
        let central = first
            .and_then(|first| minimise(objective, cones, reach, first, goal, &|_| false))
            .map(Central::of);
        known.similar = Some(Similar::new(setting.noise, problem, x, central));
        Ok(known)
    }

    /// With only this certificate, if there is one.
    pub(super) fn certified(certificate: Option<&InfeasibilityCertificate>) -> Self {
        Self {
            certificates: certificate.iter().map(|c| c.weights.clone()).collect(),
            ..Self::default()
        }
    }

    /// The same with a fit to similar observations.
    pub(super) fn with(self, similar: Similar) -> Self {
        Self {
            similar: Some(similar),
            ..self
        }
    }

    /// Only the certificates: a fit with these ends where it would end without them.
    pub(crate) fn proofs(&self) -> Self {
        Self {
            certificates: self.certificates.clone(),
            ..Self::default()
        }
    }

    /// The same for fits that stop at this gap.
    pub(crate) fn to(&self, goal: f64) -> Self {
        Self {
            goal: Some(goal),
            ..self.clone()
        }
    }

    /// Whether a certificate of earlier observations also proves that no physical robot has these
    /// base parameters.
    pub(super) fn refutes(
        &self,
        layout: &ParameterLayout,
        combinations: &BaseMap,
        beta: &[f64],
        scale: Scale,
    ) -> Result<bool, FeasibilityError> {
        for weights in &self.certificates {
            if refutes(layout, combinations, beta, scale, weights)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The problem of these observations, with the units and limits of similar ones, and points to
    /// start from.
    pub(super) fn starts(&self, setting: &Setting<'_>) -> Result<Option<Starts>, FeasibilityError> {
        let Some(similar) = &self.similar else {
            return Ok(None);
        };
        // the cones of an entropic prior depend on the noise
        if setting.options.entropic > 0.0 && setting.noise.total_cmp(&similar.noise).is_ne() {
            return Ok(None);
        }
        let mut problem = similar.problem.clone();
        let linear = problem.objective.linear;
        problem.objective = setting.objective(&problem.solved, &problem.units)?;
        problem.objective.linear = linear;
        Ok(Some(Starts {
            problem,
            inside: similar.inside.clone(),
            central: similar.central.clone(),
            goal: self.goal.unwrap_or(NEAR_GOAL),
        }))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::feasibility::{SYMBOLS, identify, identify_like};

    /// Fits that begin at what is known of another end where they end without it, whether the other
    /// is near or not.
    #[test]
    fn what_is_known_changes_no_fit() {
        let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
        let layout = ParameterLayout::new(&labels).unwrap();
        let all = BaseMap::identity(&labels);
        let mut w = vec![0.0; 100];
        (0..10).for_each(|k| w[11 * k] = 1.0 + 0.1 * k as f64);
        let observed = |shift: f64| {
            let values = [0.2, 0.01, -0.02, 0.3, 0.015, -0.1, 0.05, 0.02, 0.1, 2.0];
            let tau: Vec<f64> = values
                .iter()
                .enumerate()
                .map(|(k, x)| (x + shift * ((k % 3) as f64 - 1.0)) * w[11 * k])
                .collect();
            let mut factor = QrFactor::new(labels.clone());
            factor.push_block(&w, &tau).unwrap();
            factor
        };
        let options = Options {
            rough: true,
            ..Options::default()
        };
        let known = Known::of(&observed(0.0), &all, &layout, &options).unwrap();
        assert!(!known.certificates.is_empty() && known.similar.is_some());
        let (mut refuted, mut physical) = (0, 0);
        for shift in [0.0, 1e-3, -0.01, 0.03, -0.09, 0.5, -3.0] {
            let factor = observed(shift);
            let alone = identify(&factor, &all, &layout, &options).unwrap();
            let found = identify_like(&factor, &all, &layout, &options, &known).unwrap();
            assert_eq!(alone.outcome, found.outcome);
            let beta = factor.solve().unwrap();
            refuted += usize::from(known.refutes(&layout, &all, &beta, options.scale).unwrap());
            physical += usize::from(
                verdict(&layout, &all, &beta, options.scale)
                    .unwrap()
                    .is_feasible(),
            );
            let allowed = 1e-8 * alone.squared_residual;
            assert!(
                (alone.squared_residual - found.squared_residual).abs() <= allowed,
                "{shift}"
            );
            for (a, b) in alone.phi.iter().zip(&found.phi) {
                assert!((a - b).abs() < 1e-4, "{shift}: {a} {b}");
            }
        }
        assert!(
            refuted >= 3 && physical <= 7 - refuted,
            "{refuted} {physical}"
        );
    }
}
