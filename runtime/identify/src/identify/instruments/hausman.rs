//! The covariances of the estimate by instrumental variables and of its difference to least
//! squares, and the test whether both differ.

use std::collections::VecDeque;

use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

use super::{Hausman, InstrumentedEquations, RoundResult};
use crate::estimate::{Autocorrelated, EffortError, EstimateError, QrFactor, levinson};
use crate::identify::passes::predicted;
use crate::qr_update::substitute;

/// A difference is left out of the test if the other differences explain all of its variance except
/// at most this part.
const MIN_UNEXPLAINED_PART: f64 = 1e-6;
/// The highest order of the autoregression that whitens scores.
const MAX_ORDER: usize = 6;
/// White noise that is added to the autocovariance, as a part of the variance: filtered residuals
/// have almost no noise at high frequencies.
const WHITE_NOISE_PART: f64 = 1e-3;
/// Least value of 1 minus the sum of the autoregression's coefficients (Andrews and Monahan,
/// 1992): below that it would imply correlations longer than the log.
const MIN_WHITENED_CONSTANT: f64 = 0.03;

pub(super) struct Covariances {
    pub(super) instrumental: Vec<f64>,
    /// The covariance of least squares minus instrumental variables, r x r.
    pub(super) difference: Vec<f64>,
}

/// Computes the covariances from scores `w e` and `z e`, with `e = tau - W beta` at the consistent
/// estimate by instrumental variables: `(Z^T W)^-1 sum z e` is the error of that estimate,
/// `(W^T W)^-1 sum w e` the error of least squares where it is consistent.
///
/// Scores are whitened by the residuals' autoregression before their long-run covariance is
/// computed, which is then coloured again (Andrews and Monahan, 1992): second differences of
/// encoder noise are so strongly correlated that without whitening it would be several times too
/// large.
pub(super) fn covariances<E: InstrumentedEquations>(
    equations: &mut E,
    round: &RoundResult,
    bandwidth: usize,
) -> Result<Covariances, E::Error> {
    let solution = &round.solution;
    let r = solution.values.len();
    let noise = autoregression(&round.efforts);
    let mut past: VecDeque<Vec<f64>> = VecDeque::new();
    let mut scores = Autocorrelated::new(2 * r, bandwidth);
    let mut score = vec![0.0; 2 * r];
    equations.visit(&mut |rows| {
        if !rows.follows {
            scores.interrupt();
            past.clear();
        }
        score.fill(0.0);
        let count = rows.tau.len();
        for (e, (tau, own)) in rows.tau.iter().zip(rows.weights).enumerate() {
            let weight = own * round.weights.get(e).copied().unwrap_or(1.0);
            if weight == 0.0 {
                continue;
            }
            let psi = weight * weight * (tau - predicted(rows, e, &solution.values));
            // the scores of W, then those of Z
            let row = rows.w.iter().skip(e).step_by(count);
            for (sum, x) in score.iter_mut().zip(row) {
                *sum += x * psi;
            }
        }
        let own = score.clone();
        for (a, before) in noise.iter().zip(&past) {
            for (sum, x) in score.iter_mut().zip(before) {
                *sum -= a * x;
            }
        }
        past.push_front(own);
        past.truncate(noise.len());
        scores.push(&score)
    })?;
    // with the identity as QR factor, the covariance is the long-run sum times a known factor
    let mut unit = QrFactor::new(vec![String::new(); 2 * r]);
    let mut identity = vec![0.0; 4 * r * r];
    for k in 0..2 * r {
        identity[k * 2 * r + k] = 1.0;
    }
    unit.push_block(&identity, &vec![0.0; 2 * r])?;
    let rows = solution.factor.rows() as f64;
    let spare = solution.factor.rows().saturating_sub(r).max(1) as f64;
    let whitened = (1.0 - noise.iter().sum::<f64>()).max(MIN_WHITENED_CONSTANT);
    let scale = rows / spare / (2 * r).max(1) as f64 / (whitened * whitened);
    let sums = scores.covariance(&unit)?;
    // rows of (Z^T W)^-1, and of (W^T W)^-1 from the QR factor
    let gram = inverse_gram(&solution.factor)?;
    let both = |i: usize, difference: bool| -> Vec<f64> {
        let mut out = vec![0.0; 2 * r];
        let sign = if difference { -1.0 } else { 1.0 };
        for j in 0..r {
            out[j] = if difference { gram[i * r + j] } else { 0.0 };
            out[r + j] = sign * solution.inverse[i * r + j];
        }
        out
    };
    let sandwich = |difference: bool| -> Vec<f64> {
        let lines: Vec<Vec<f64>> = (0..r).map(|i| both(i, difference)).collect();
        let mut out = vec![0.0; r * r];
        for (i, line) in lines.iter().enumerate() {
            let half: Vec<f64> = (0..2 * r)
                .map(|k| {
                    let column = sums[k * 2 * r..(k + 1) * 2 * r].iter();
                    column.zip(line).map(|(s, x)| s * x).sum()
                })
                .collect();
            for (j, other) in lines.iter().enumerate() {
                let sum: f64 = half.iter().zip(other).map(|(a, b)| a * b).sum();
                out[i * r + j] = scale * sum;
            }
        }
        out
    };
    Ok(Covariances {
        instrumental: sandwich(false),
        difference: sandwich(true),
    })
}

/// `(R^T R)^-1`, n x n.
fn inverse_gram(factor: &QrFactor) -> Result<Vec<f64>, EstimateError> {
    let n = factor.columns();
    let r = factor.r();
    // columns of R^-1
    let mut inverse = vec![0.0; n * n];
    for k in 0..n {
        let mut e = vec![0.0; n];
        e[k] = 1.0;
        let column = substitute(r, &e).ok_or(EstimateError::NoConvergence)?;
        inverse[k * n..(k + 1) * n].copy_from_slice(&column);
    }
    let mut out = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            out[i * n + j] = (0..n)
                .map(|k| inverse[k * n + i] * inverse[k * n + j])
                .sum();
        }
    }
    Ok(out)
}

/// Fits an autoregression to the residuals of all efforts together (Levinson and Durbin), of the
/// order with the least final prediction error (Akaike, 1969); returns its coefficients, that of
/// the most recent sample first.
fn autoregression(efforts: &[EffortError]) -> Vec<f64> {
    let samples: usize = efforts.iter().map(|e| e.samples).sum();
    let lags = efforts.iter().map(|e| e.autocorrelation.len()).min();
    let at = |lag: usize| -> f64 {
        if lag == 0 {
            return 1.0 + WHITE_NOISE_PART;
        }
        let parts = efforts
            .iter()
            .filter_map(|e| Some(e.samples as f64 * e.autocorrelation.get(lag - 1)?));
        parts.sum::<f64>() / samples.max(1) as f64
    };
    let criterion = |remaining: f64, order: usize| {
        let (n, p) = (samples as f64, order as f64 + 1.0);
        remaining * (n + p) / (n - p).max(1.0)
    };
    let most = MAX_ORDER.min(lags.unwrap_or(0));
    let autocovariance: Vec<f64> = (0..=most).map(at).collect();
    let mut best = Vec::new();
    let mut least = criterion(at(0), 0);
    levinson(&autocovariance, &mut |coefficients, remaining| {
        let own = criterion(remaining, coefficients.len());
        if own < least {
            least = own;
            best = coefficients.to_vec();
        }
        true
    });
    best
}

/// Computes the test from both estimates and the covariance of their difference.
///
/// - `least`, `instrumental`: the parameters by least squares and by instrumental variables;
/// - `stretches`: the number of independent stretches of the log that the covariance was computed
///   from, see [`bartlett_stretches`](crate::estimate::bartlett_stretches).
pub(super) fn hausman(
    least: &[f64],
    instrumental: &[f64],
    covariance: &[f64],
    stretches: f64,
) -> Hausman {
    let n = least.len();
    let differences: Vec<f64> = least.iter().zip(instrumental).map(|(a, b)| a - b).collect();
    let sigma = |k: usize| covariance[k * n + k].max(0.0).sqrt();
    // a difference that is only rounding has no meaningful standard deviation
    let rounding = |k: usize| 1e-9 * (least[k].abs() + instrumental[k].abs());
    let counts: Vec<usize> = (0..n).filter(|&k| sigma(k) > rounding(k)).collect();
    let ratios: Vec<f64> = (0..n)
        .map(|k| {
            if counts.contains(&k) {
                differences[k] / sigma(k)
            } else {
                0.0
            }
        })
        .collect();
    // Cholesky factorisation of the correlation matrix, the largest pivot first
    let m = counts.len();
    let mut matrix = vec![0.0; m * m];
    for (i, a) in counts.iter().enumerate() {
        for (j, b) in counts.iter().enumerate() {
            matrix[i * m + j] = covariance[a * n + b] / (sigma(*a) * sigma(*b));
        }
    }
    let mut side: Vec<f64> = counts.iter().map(|k| ratios[*k]).collect();
    let mut remaining: Vec<usize> = (0..m).collect();
    let (mut wald, mut rank) = (0.0, 0);
    while let Some(place) = (0..remaining.len()).max_by(|a, b| {
        matrix[remaining[*a] * m + remaining[*a]]
            .total_cmp(&matrix[remaining[*b] * m + remaining[*b]])
    }) {
        let k = remaining.remove(place);
        let pivot = matrix[k * m + k];
        if pivot.is_nan() || pivot <= MIN_UNEXPLAINED_PART {
            break;
        }
        wald += side[k] * side[k] / pivot;
        rank += 1;
        for i in &remaining {
            let part = matrix[i * m + k] / pivot;
            side[*i] -= part * side[k];
            for j in &remaining {
                matrix[i * m + j] -= part * matrix[k * m + j];
            }
        }
    }
    let rank = f64::from(rank);
    let is_joint_test = stretches > 4.0 * rank;
    let probability = if m == 0 {
        1.0
    } else if is_joint_test {
        let rest = stretches - rank + 1.0;
        FisherSnedecor::new(rank, rest).map_or(f64::NAN, |f| f.sf(wald * rest / (stretches * rank)))
    } else {
        let largest = ratios.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        let one = StudentsT::new(0.0, 1.0, stretches.max(1.0));
        let one = one.map_or(f64::NAN, |t| 2.0 * t.sf(largest));
        (one * m as f64).min(1.0)
    };
    Hausman {
        ratios,
        probability,
        is_joint_test,
    }
}
