//! Least squares without equations that static friction disturbs by more than their noise.

use super::filtering::Standstill;
use super::passes::{Source, reduce};
use super::replay::Replay;
use crate::estimate::{Estimate, FactorSet, Weighting};
use crate::signals::Smoothing;
use regen_runtime::BaseModel;

/// The part of an effort's noise that static friction may have in an equation.
const FRICTION_PART: f64 = 0.3;
/// The least part of a filter's memory that is told from none.
const MIN_RESTED_PART: f64 = 5e-4;
/// How often the part is made smaller: with less static friction in them, residuals are smaller.
const NARROWINGS: usize = 2;
/// Efforts keep at least this part of their equations.
const MIN_KEPT_PART: f64 = 0.25;

/// Least squares with equations whose noise exceeds the static friction in them. No column describes that
/// friction, and a filter spreads it from a rest over the equations beside it; the lower its cutoff, the
/// less noise there is for it to vanish in.
pub(super) fn without_rests<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    replay: &mut Replay<'_, M, S>,
    weighting: Weighting,
) -> Result<Moving, S::Error> {
    let mut set = reduce(replay)?;
    let rests: usize = replay.left_out().resting.iter().sum();
    let mut estimate = Estimate::new(&set, weighting).map_err(|why| why.beside_rests(rests))?;
    let filtering = replay.source().filtering();
    if rests == 0
        || filtering.smoothing == Smoothing::None
        || filtering.standstill != Standstill::Drop
    {
        return Ok(Moving::new(set, estimate));
    }
    let mut change = Vec::new();
    for narrowing in 0..NARROWINGS {
        let before = replay.rested();
        let Some(part) = narrower(&set, &estimate, before) else {
            break;
        };
        replay.set_rested(part);
        let fewer = reduce(replay)?;
        let pairs = fewer.factors().iter().zip(set.factors());
        let mut pairs = pairs.map(|(own, all)| (own.rows(), own.contained(), all.rows()));
        let is_enough = pairs.all(|(own, contained, all)| {
            own >= 3 * contained && own as f64 >= MIN_KEPT_PART * all as f64
        });
        let found = Estimate::new(&fewer, weighting);
        match found {
            Ok(found) if is_enough => (set, estimate) = (fewer, found),
            found => {
                // what few equations differ by is noise up to two of their deviations
                if let (Ok(found), 0) = (found, narrowing) {
                    let pairs = found.values.iter().zip(&estimate.values).enumerate();
                    let beyond = |(k, (a, b)): (usize, (&f64, &f64))| {
                        ((a - b).abs() - 2.0 * found.sigma(k))
                            .max(0.0)
                            .copysign(a - b)
                    };
                    change = pairs.map(beyond).collect();
                }
                replay.set_rested(before);
                set = reduce(replay)?;
                break;
            }
        }
    }
    Ok(Moving {
        change,
        ..Moving::new(set, estimate)
    })
}

/// Least squares with equations of coordinates that move.
pub(super) struct Moving {
    pub(super) set: FactorSet,
    pub(super) estimate: Estimate,
    /// By how much static friction may move the parameters where too few equations are without it; empty
    /// where enough are.
    pub(super) change: Vec<f64>,
}

impl Moving {
    fn new(set: FactorSet, estimate: Estimate) -> Self {
        Self {
            set,
            estimate,
            change: Vec::new(),
        }
    }
}

/// The largest part of a filter's memory in which a coordinate may have rested so that noise exceeds static
/// friction; `None` where that is not much less than it was.
fn narrower(set: &FactorSet, estimate: &Estimate, before: f64) -> Option<f64> {
    let mut least = before;
    for (factor, effort) in set.factors().iter().zip(&estimate.efforts) {
        let columns = factor.r().chunks_exact(factor.columns().max(1));
        let friction = columns.zip(&estimate.values).zip(factor.labels());
        let friction = friction.filter(|(_, label)| label.starts_with("Fc("));
        let squares = friction
            .map(|((column, value), _)| column.iter().map(|x| x * x).sum::<f64>() * value * value);
        let rms = (squares.sum::<f64>() / factor.rows().max(1) as f64).sqrt();
        if rms > 0.0 {
            least = least.min(FRICTION_PART * effort.sigma / rms);
        }
    }
    let least = least.max(MIN_RESTED_PART);
    (least < 0.7 * before).then_some(least)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::estimate::{Accumulator, Origin};
    use crate::intervals::Random;

    /// The narrower part for a joint of inertia 0.1 and Coulomb friction 0.4, with noise of this deviation.
    fn part(label: &str, noise: f64) -> Option<f64> {
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
        narrower(&set, &estimate, 0.03)
    }

    #[test]
    fn the_part_of_rest_is_as_small_as_noise_beside_coulomb_friction_demands() {
        let found = part("Fc(q1)", 4e-3).unwrap();
        assert!(
            (found / (FRICTION_PART * 0.01) - 1.0).abs() < 0.1,
            "{found}"
        );
        assert_eq!(part("Fc(q1)", 1e-7), Some(MIN_RESTED_PART));
        // measured robots: noise is a tenth of the friction or more, and no other column is friction
        assert_eq!(part("Fc(q1)", 0.04), None);
        assert_eq!(part("Fv(q1)", 4e-3), None);
    }
}
