//! Least squares that weighs equations by what static friction disturbs of them.

use super::passes::reduce;
use super::replay::Replay;
use super::stream::MAX_RESTED_PART;
use crate::estimate::{Estimate, FactorSet, Weighting};
use crate::signals::Smoothing;
use crate::states::Source;
use crate::states::Standstill;
use regen_runtime::BaseModel;

/// How often the weights are computed from the noise that they leave.
const PASSES: usize = 3;
/// Equations beside a rest share its static friction, so that differences between them still tell what they
/// would without it: it counts as this part.
const SHARED: f64 = 1.0 / 6.0;
/// Efforts keep at least this part of their equations, or have the weights of before.
const MIN_KEPT_PART: f64 = 0.3;
/// Weights are computed where static friction adds more than this part to the deviation of an equation.
const MIN_PART: f64 = 0.1;

/// Least squares whose equations have the weights that static friction and noise leave them. No column
/// describes static friction, which may be anything up to Coulomb friction, and a filter spreads it from a
/// rest over the equations beside it; the lower its cutoff, the less noise there is for it to vanish in.
pub(super) fn weighed_by_rests<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    weighting: Weighting,
) -> Result<(FactorSet, Estimate), S::Error> {
    let mut set = reduce(replay)?;
    let rests: usize = replay.left_out().resting.iter().sum();
    let mut estimate = Estimate::new(&set, weighting).map_err(|why| why.beside_rests(rests))?;
    let filtering = replay.source().filtering();
    if rests == 0
        || filtering.smoothing == Smoothing::None
        || filtering.standstill != Standstill::Drop
    {
        return Ok((set, estimate));
    }
    let mut before = Vec::new();
    for _ in 0..PASSES {
        let ratios = static_friction(&set, &estimate);
        let largest = ratios.iter().fold(0.0, |m: f64, ratio| m.max(*ratio));
        if libm::hypot(1.0, MAX_RESTED_PART * largest) < 1.0 + MIN_PART {
            break;
        }
        replay.set_static_friction(ratios);
        let weighed = reduce(replay)?;
        let counts = effective_counts(replay, weighed.factors().len())?;
        let pairs = weighed.factors().iter().zip(counts);
        let mut pairs =
            pairs.map(|(own, count)| (own.rows() as f64, own.contained() as f64, count));
        let is_enough = pairs
            .all(|(all, contained, count)| count >= (3.0 * contained).max(MIN_KEPT_PART * all));
        match Estimate::new(&weighed, weighting) {
            Ok(found) if is_enough => (set, estimate) = (weighed, found),
            _ => {
                replay.set_static_friction(before);
                set = reduce(replay)?;
                break;
            }
        }
        before = replay.static_friction().to_vec();
    }
    Ok((set, estimate))
}

/// As how many equations of equal weight those of each effort count.
fn effective_counts<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    efforts: usize,
) -> Result<Vec<f64>, S::Error> {
    let mut sums = vec![Weights::default(); efforts];
    replay.visit(&mut |equations| {
        for (sum, weight) in sums.iter_mut().zip(equations.weights) {
            sum.push(*weight);
        }
        Ok(())
    })?;
    Ok(sums.iter().map(Weights::count).collect())
}

/// The weights of equations, as sums of their squares and of the squares of these.
#[derive(Clone, Copy, Debug, Default)]
struct Weights {
    squares: f64,
    fourth: f64,
}

impl Weights {
    fn push(&mut self, weight: f64) {
        let square = weight * weight;
        self.squares += square;
        self.fourth += square * square;
    }

    /// As how many equations of equal weight they count.
    fn count(&self) -> f64 {
        self.squares * self.squares / self.fourth.max(f64::MIN_POSITIVE)
    }
}

/// The deviation of static friction, which is as likely anything up to Coulomb friction in both directions,
/// over that of the residuals, for each effort.
fn static_friction(set: &FactorSet, estimate: &Estimate) -> Vec<f64> {
    let pairs = set.factors().iter().zip(&estimate.efforts);
    let ratio = pairs.map(|(factor, effort)| {
        let columns = factor.r().chunks_exact(factor.columns().max(1));
        let friction = columns.zip(&estimate.values).zip(factor.labels());
        let friction = friction.filter(|(_, label)| label.starts_with("Fc"));
        let squares = friction
            .map(|((column, value), _)| column.iter().map(|x| x * x).sum::<f64>() * value * value);
        let rms = (squares.sum::<f64>() / factor.rows().max(1) as f64).sqrt();
        let ratio = SHARED * rms / (3.0_f64.sqrt() * effort.sigma);
        if ratio.is_finite() { ratio } else { 0.0 }
    });
    ratio.collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::estimate::{Accumulator, Origin};
    use crate::intervals::Random;

    /// The ratio for a joint of inertia 0.1 and Coulomb friction 0.4, with noise of this deviation.
    fn ratio(label: &str, noise: f64) -> f64 {
        let origin = Origin {
            robot: String::new(),
            model: String::new(),
            kind: String::new(),
            efforts: vec!["q1".to_owned()],
            labels: vec!["Izz(1)".to_owned(), label.to_owned()],
        };
        let (mut rows, mut random) = (Accumulator::new(&origin), Random(5));
        for k in 0..2000 {
            let phase = 0.05 * f64::from(k);
            let row = [3.0 * phase.sin(), phase.cos().signum()];
            let tau = 0.1 * row[0] + 0.4 * row[1] + noise * random.normal();
            rows.push(0, &row, 1, tau, 1.0).unwrap();
        }
        let set = rows.finish().unwrap();
        let estimate = Estimate::new(&set, Weighting::PerEffort).unwrap();
        static_friction(&set, &estimate)[0]
    }

    #[test]
    fn static_friction_is_compared_with_the_noise_of_its_effort() {
        for noise in [4e-4, 4e-3, 0.04] {
            let expected = SHARED * 0.4 / (3.0_f64.sqrt() * noise);
            let found = ratio("Fc(q1)", noise);
            assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
        }
        // no other column is friction that depends on the direction
        assert!(ratio("Fv(q1)", 4e-3).abs() < 1e-12);
        // friction of one direction is
        assert!(ratio("Fc+(q1)", 4e-3) > 1.0);
    }

    #[test]
    fn equations_of_small_weights_count_as_few() {
        let count = |weights: &[(usize, f64)]| {
            let mut sums = Weights::default();
            for (times, weight) in weights {
                (0..*times).for_each(|_| sums.push(*weight));
            }
            sums.count()
        };
        // the scale of all weights does not matter
        for scale in [1e-3, 1.0, 40.0] {
            assert!((count(&[(100, scale)]) - 100.0).abs() < 1e-9);
            assert!((count(&[(100, scale), (50, 1e-3 * scale)]) - 100.0).abs() < 0.01);
            let halves = count(&[(100, scale), (100, 0.5 * scale)]);
            assert!((halves - 125.0 * 125.0 / 106.25).abs() < 1e-9, "{halves}");
        }
    }
}
