//! Inertias that no body has, beyond those that are negative by chance.

use super::facts::{self, CERTAIN_DEVIATIONS};
use super::grams::{Fit, Grams};
use regen_runtime::BaseModel;

impl Grams {
    /// For each equation, the inertia that what is left of its effort may pretend by chance.
    fn inertia_by_chance(&self, fit: &Fit) -> Vec<f64> {
        let pairs = fit.errors.iter().zip(&fit.spreads);
        let of = pairs.zip(&self.accelerations).enumerate();
        let of = of.map(|(i, ((error, spread), square))| {
            let own = CERTAIN_DEVIATIONS * error * spread / square.sqrt();
            // a coordinate that does not accelerate tells no inertia
            if own.is_finite() && !self.left_out[i] {
                own
            } else {
                0.0
            }
        });
        of.collect()
    }
}

/// The largest number of directions, in any posture, in which the mass matrix is negative beyond chance, plus the
/// number of coordinates whose friction drives the joint.
pub(super) fn implausible_count<M: BaseModel<f64> + ?Sized>(
    model: &M,
    grams: &Grams,
    fit: &Fit,
) -> usize {
    let dof = model.info().dof();
    let mut mass = vec![0.0; dof * dof];
    let beta = fit.values.get(..grams.columns()).unwrap_or_default();
    let chance = grams.inertia_by_chance(fit);
    let mut light = 0;
    for q in &grams.postures {
        if model.base_mass_matrix(q, beta, &mut mass).is_ok() {
            let diagonal = mass.iter_mut().step_by(dof + 1);
            diagonal.zip(&chance).for_each(|(m, own)| *m += own);
            light = light.max(negative_pivots(&mut mass, dof));
        }
    }
    light + facts::driving(model, grams, fit).len()
}

/// The number of negative eigenvalues of a symmetric matrix, as that of its negative pivots.
fn negative_pivots(matrix: &mut [f64], size: usize) -> usize {
    let mut out = 0;
    for k in 0..size {
        let pivot = matrix[k * size + k];
        if pivot < 0.0 {
            out += 1;
        }
        if pivot == 0.0 {
            continue;
        }
        for i in k + 1..size {
            let factor = matrix[i * size + k] / pivot;
            for j in k + 1..size {
                matrix[i * size + j] -= factor * matrix[k * size + j];
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::swings_for_tests::{sample, swings, with};
    use super::super::{Reading, Sample};
    use super::*;
    use crate::intervals::Random;

    #[test]
    fn an_inertia_is_implausible_only_beyond_chance() {
        let model = swings(false);
        let plain = Reading::plain(3);
        let count = |sample: &Sample| {
            let grams = Grams::of(&model, sample, &plain, 1).unwrap();
            implausible_count(&model, &grams, &grams.fit(&plain, &[]).unwrap())
        };
        assert_eq!(count(&sample()), 0);
        assert!(count(&with(|s| s.efforts.iter_mut().for_each(|u| *u *= -1.0))) > 0);
        // an effort that is noise has an inertia of either sign
        for seed in 1..8 {
            let mut random = Random(seed);
            let mut noise = sample();
            for own in &mut noise.states {
                own.efforts[2] = random.normal();
            }
            assert_eq!(count(&noise), 0, "{seed}");
        }
    }
}
