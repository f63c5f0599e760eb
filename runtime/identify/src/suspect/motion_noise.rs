//! Errors that noise of the motion causes alone.

use super::grams::{Fit, Grams};
use super::{MAX_POSITION_STATES, MIN_DOUBTED_ERROR, Reading, Sample, worst};
use regen_runtime::BaseModel;

/// Errors up to this factor of what noise of the motion alone causes are that, as its size is estimated.
const MAX_OVER_NOISE: f64 = 1.25;

/// The sample with the errors that noise of its motion causes alone, if there are any.
pub(super) fn with_noise<M: BaseModel<f64> + ?Sized>(model: &M, sample: &Sample) -> Option<Sample> {
    let every = sample.states.len().div_ceil(MAX_POSITION_STATES).max(1);
    let plain = Reading::plain(sample.measured.len());
    let grams = Grams::of_hypothesis(model, sample, &plain, every)?;
    let fit = grams.fit(&Reading::plain(model.info().actuated.len()), &[])?;
    let least = grams.errors_of_noise(model, sample, &fit);
    // parameters of a log with mistakes may say more than there is
    let pairs = least.iter().zip(&fit.errors);
    let least_errors: Vec<f64> = pairs.map(|(least, now)| least.min(*now)).collect();
    (worst(&least_errors) > 0.0).then(|| Sample {
        least_errors,
        ..sample.clone()
    })
}

/// Whether all errors that matter are those of noise of the motion.
pub(super) fn is_noise_of_motion(grams: &Grams, fit: &Fit) -> bool {
    let mut pairs = fit.errors.iter().zip(&grams.least);
    worst(&grams.least) > MIN_DOUBTED_ERROR
        && pairs.all(|(error, least)| *error < MIN_DOUBTED_ERROR.max(MAX_OVER_NOISE * least))
}

impl Grams {
    /// The errors that what noise leaves unknown of the accelerations causes with these parameters, see
    /// [`Sample::least_errors`]. Where efforts or positions are read with other factors, they are the same.
    fn errors_of_noise<M: BaseModel<f64> + ?Sized>(
        &self,
        model: &M,
        sample: &Sample,
        fit: &Fit,
    ) -> Vec<f64> {
        let info = model.info();
        let dof = info.dof();
        let noise = info.independent.iter().map(|c| {
            let place = sample.measured.iter().position(|own| own == c);
            let own = place.and_then(|place| sample.acceleration_noise.get(place));
            own.copied().unwrap_or(0.0)
        });
        let noise: Vec<f64> = noise.collect();
        let mut squares = vec![0.0; self.rows()];
        let mut mass = vec![0.0; dof * dof];
        let beta = fit.values.get(..self.columns()).unwrap_or_default();
        let mut count = 0.0;
        for q in &self.postures {
            if model.base_mass_matrix(q, beta, &mut mass).is_err() {
                continue;
            }
            count += 1.0;
            for (i, sum) in squares.iter_mut().enumerate() {
                let row = mass.iter().skip(i).step_by(dof.max(1));
                *sum += row
                    .zip(&noise)
                    .map(|(m, noise)| (m * noise).powi(2))
                    .sum::<f64>();
            }
        }
        let pairs = squares.iter().zip(&fit.spreads);
        let error = pairs.map(|(square, spread)| (square / count).sqrt() / spread);
        error
            .map(|own| if own.is_finite() { own } else { 0.0 })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::swings_for_tests::{sample, swings};
    use super::super::{Findings, look};
    use super::*;
    use crate::intervals::Random;

    /// The sample with noise of this deviation in the accelerations of the second joint.
    fn noisy(deviation: f64) -> Sample {
        let mut random = Random(3);
        let mut out = sample();
        for own in &mut out.states {
            own.motion[2][1] += deviation * random.normal();
        }
        out
    }

    fn findings(sample: &Sample) -> Findings {
        look(&swings(false), sample, &[1.0; 3], None, &mut |_, _| {})
    }

    #[test]
    fn the_motion_is_once_what_is_left_of_it_without_its_noise() {
        let truth = sample();
        let slope = |own: &Sample| {
            let pairs = own.states.iter().zip(&truth.states);
            let pairs = pairs.map(|(own, truth)| (own.motion[2][1], truth.motion[2][1]));
            let sums = pairs.fold((0.0, 0.0), |(xy, xx), (x, y)| (xy + x * y, xx + x * x));
            sums.0 / sums.1
        };
        for deviation in [3.0, 6.0] {
            let mut known = noisy(deviation);
            let before = slope(&known);
            known.lessen_noise(&[[0.0; 2], [0.0, deviation], [0.0; 2]]);
            let after = slope(&known);
            // a smaller or larger motion would explain the efforts less; known to a tenth from 400 states
            assert!(
                (after - 1.0).abs() < 0.1 && before < 0.85,
                "{before} {after}"
            );
        }
        let mut known = truth.clone();
        known.lessen_noise(&[[0.0; 2]; 3]);
        assert_eq!(known.states, truth.states);
    }

    #[test]
    fn noise_of_accelerations_is_no_mistake() {
        for deviation in [5.0, 20.0, 60.0] {
            let mut known = noisy(deviation);
            known.lessen_noise(&[[0.0; 2], [0.0, deviation], [0.0; 2]]);
            let found = findings(&known);
            assert_eq!(found.change, None, "{deviation}");
            assert!(found.drifts.is_empty() && found.parts.is_none());
        }
    }

    #[test]
    fn a_mistake_beside_noise_of_accelerations_is_found_alone() {
        let mut sample = noisy(2.0);
        for own in &mut sample.states {
            own.efforts[0] *= -1.0;
        }
        sample.lessen_noise(&[[0.0; 2], [0.0, 2.0], [0.0; 2]]);
        let change = findings(&sample).change.unwrap();
        let factors: Vec<f64> = change.efforts.iter().map(|own| own.factor).collect();
        assert_eq!(factors, [-1.0, 1.0, 1.0]);
        assert!(
            change
                .positions
                .iter()
                .all(|own| (own.factor - 1.0).abs() < 1e-9)
        );
    }

    #[test]
    fn errors_of_noise_are_those_of_the_inertia_times_what_it_leaves_unknown() {
        let model = swings(false);
        let mut noisy = noisy(6.0);
        noisy.lessen_noise(&[[0.0; 2], [0.0, 6.0], [0.0; 2]]);
        let least = with_noise(&model, &noisy).unwrap().least_errors;
        let plain = Reading::plain(3);
        let fit = Grams::of(&model, &noisy, &plain, 1).and_then(|own| own.fit(&plain, &[]));
        let fit = fit.unwrap();
        let expected = 0.3 * noisy.acceleration_noise[1] / fit.spreads[1];
        // known to a fifth from 400 states
        assert!(
            (least[1] / expected - 1.0).abs() < 0.2,
            "{least:?} {expected}"
        );
        assert!(
            (least[1] / fit.errors[1] - 1.0).abs() < 0.2,
            "{least:?} {:?}",
            fit.errors
        );
        assert!(least[0].abs() + least[2].abs() < 1e-12);
        assert!(with_noise(&model, &sample()).is_none());
    }
}
