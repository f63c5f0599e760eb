//! Drifts of an effort away from what the model explains of it.

use super::grams::{Fit, Grams, Stored, solve};
use super::{MIN_DOUBTED_ERROR, Sample};

/// The least part of what is left of an effort that a drift is, in squares, and that it is with a constant.
const MIN_DRIFTING_PART: f64 = 0.2;
const MIN_STRAIGHT_PART: f64 = 0.5;

/// An effort that drifts away from what the model explains of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// The effort: an index into `Info::actuated`.
    pub effort: usize,
    /// What changes over the log.
    pub change: Drifting,
}

/// What drifts.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Drifting {
    /// A constant, by so many N or N m over the log.
    Constant(f64),
    /// The factor on the effort, by this part of its mean over the log.
    Gain(f64),
}

/// The mean square of residuals that a drift explains beside constants and multiples of the positions.
///
/// - `rows`: time, residual and prediction at each state of equation `i`.
fn beside_positions(sample: &Sample, grams: &Grams, i: usize, rows: &[[f64; 3]]) -> Option<f64> {
    let used = grams.stored.iter().filter(|own| own.has(i));
    let position = |own: &Stored| -> Option<Vec<f64>> {
        let q = sample.states.get(own.state)?.motion.first()?;
        Some(q.iter().copied().chain([1.0]).collect())
    };
    let motion: Vec<Vec<f64>> = used.map(position).collect::<Option<_>>()?;
    let n = motion.first()?.len();
    let mut gram = vec![0.0; n * n];
    for own in &motion {
        for (a, x) in own.iter().enumerate() {
            for (out, y) in gram.iter_mut().skip(a * n).zip(&own[..=a]) {
                *out += x * y;
            }
        }
    }
    let left_of = |d: usize| -> Option<Vec<f64>> {
        let mut right = vec![0.0; n];
        for (own, row) in motion.iter().zip(rows) {
            right
                .iter_mut()
                .zip(own)
                .for_each(|(sum, x)| *sum += x * row[d]);
        }
        let values = solve(&mut gram.clone(), &right)?;
        let pairs = motion.iter().zip(rows);
        let left = pairs
            .map(|(own, row)| row[d] - own.iter().zip(&values).map(|(x, b)| x * b).sum::<f64>());
        Some(left.collect())
    };
    let (times, residuals) = (left_of(0)?, left_of(1)?);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let explained = product(&times, &residuals).powi(2) / product(&times, &times);
    Some(explained / rows.len() as f64)
}

/// The efforts of which most that is left is a drift over the log, and matters.
pub(super) fn search(sample: &Sample, grams: &Grams, fit: &Fit) -> Vec<Drift> {
    let time = |state: usize| sample.states.get(state).map_or(f64::NAN, |s| s.time);
    let one = |i: usize| {
        let effort = grams.only_effort(i)?;
        let spread = *fit.spreads.get(i)?;
        // time, residual and prediction
        let rows: Vec<[f64; 3]> = (grams.stored.iter())
            .filter(|own| own.has(i))
            .map(|own| {
                let left = own.residual(i, &fit.values);
                [time(own.state), left, own.tau.get(i).unwrap_or(&0.0) - left]
            })
            .collect();
        let n = rows.len() as f64;
        let mean = |of: &dyn Fn(&[f64; 3]) -> f64| rows.iter().map(of).sum::<f64>() / n;
        let (t, r) = (mean(&|p| p[0]), mean(&|p| p[1]));
        let squares = mean(&|p| p[1] * p[1]);
        let whole = rows.last()?[0] - rows.first()?[0];
        let matters = |drifting: f64| {
            drifting.sqrt() > MIN_DOUBTED_ERROR * spread && drifting > MIN_DRIFTING_PART * squares
        };
        let tt = mean(&|p| (p[0] - t).powi(2));
        let tr = mean(&|p| (p[0] - t) * (p[1] - r));
        let constant = tr * tr / tt;
        let gg = mean(&|p| ((p[0] - t) * p[2]).powi(2));
        let gr = mean(&|p| (p[0] - t) * p[2] * p[1]);
        let gain = gr * gr / gg;
        let is_straight = constant + r * r > MIN_STRAIGHT_PART * squares;
        // what a slow motion explains as well is no drift
        let beside_motion = beside_positions(sample, grams, i, &rows)?;
        if matters(constant)
            && matters(beside_motion)
            && is_straight
            && (gain < constant || gain.is_nan())
        {
            return Some(Drift {
                effort,
                change: Drifting::Constant(tr / tt * whole),
            });
        }
        (matters(gain) && gain > MIN_STRAIGHT_PART * squares).then_some(Drift {
            effort,
            change: Drifting::Gain(gr / gg * whole),
        })
    };
    (0..grams.rows()).filter_map(one).collect()
}
