//! The covariance of the estimate by instrumental variables: as for least squares, from cosine
//! transforms of whitened scores, see [`Deviations`].

use nalgebra::DMatrix;

use super::{InstrumentedEquations, RoundResult};
use crate::estimate::{Deviations, EffortNoise, NoiseResiduals, OuterProducts};
use crate::identify::equation_builder::Equations;
use crate::identify::passes::predicted;

/// The deviations of an estimate, and its covariance for white residuals.
pub(super) struct Correlated {
    pub(super) deviations: Deviations,
    /// n x n, symmetric.
    pub(super) white: Vec<f64>,
}

/// Computes the deviations from the scores `z e`, with `e = tau - W beta` at the estimate.
pub(super) fn deviations<E: InstrumentedEquations>(
    equations: &mut E,
    round: &RoundResult,
) -> Result<Correlated, E::Error> {
    let solution = &round.solution;
    let n = solution.values.len();
    let noise = noise(equations, round)?;
    let mut scores = noise.scores(n);
    let mut squares = OuterProducts::new(n, true);
    let mut weighted = Weighted::default();
    let (mut square, mut line) = (0.0, Vec::with_capacity(n));
    equations.visit(&mut |rows| {
        if !rows.follows {
            scores.interrupt();
        }
        weighted.compute(rows, round);
        let count = rows.tau.len();
        let (w, z) = rows.w.split_at(n * count);
        for (effort, (weight, psi)) in weighted.weights.iter().zip(&weighted.psi).enumerate() {
            if *weight == 0.0 {
                continue;
            }
            square += psi * psi;
            line.clear();
            let column = z.iter().skip(effort).step_by(count);
            line.extend(column.map(|z| z * weight));
            squares.push(&line, &line);
        }
        scores.push_with_instruments((z, w), &weighted.weights, &weighted.psi)
    })?;
    let blocks = scores.finish(&solution.values)?;
    let factor = &solution.factor;
    let deviations = blocks.deviations_of_instruments(&solution.inverse, factor.rows())?;
    let variance = if factor.has_too_few_rows() {
        f64::INFINITY
    } else {
        square / factor.rows().saturating_sub(n).max(1) as f64
    };
    let white = sandwich(&solution.inverse, &squares.take(), variance);
    Ok(Correlated { deviations, white })
}

/// `variance B S B^T`, n x n.
///
/// - `inverse`: B; `squares`: the entries of S from the diagonal on; both n x n, row by row.
fn sandwich(inverse: &[f64], squares: &[f64], variance: f64) -> Vec<f64> {
    let n = inverse.len().isqrt();
    let bread = DMatrix::from_row_slice(n, n, inverse);
    let mut squares = DMatrix::from_row_slice(n, n, squares);
    squares.fill_lower_triangle_with_upper_triangle();
    let covariance = &bread * squares * bread.transpose() * variance;
    covariance.as_slice().to_vec()
}

/// Models the noise of each effort's weighted residuals.
fn noise<E: InstrumentedEquations>(
    equations: &mut E,
    round: &RoundResult,
) -> Result<EffortNoise, E::Error> {
    let mut noise = NoiseResiduals::new(round.efforts.len(), equations.filtered_noise());
    let mut weighted = Weighted::default();
    equations.visit(&mut |rows| {
        if !rows.follows {
            noise.interrupt();
        }
        weighted.compute(rows, round);
        noise.push(&weighted.psi, &weighted.used)
    })?;
    Ok(noise.noise())
}

/// The weighted residuals of one sample, one for each effort.
#[derive(Default)]
struct Weighted {
    weights: Vec<f64>,
    psi: Vec<f64>,
    /// Whether the equation is used.
    used: Vec<bool>,
}

impl Weighted {
    fn compute(&mut self, rows: &Equations<'_>, round: &RoundResult) {
        self.weights.clear();
        self.psi.clear();
        self.used.clear();
        for (e, (tau, own)) in rows.tau.iter().zip(rows.weights).enumerate() {
            let weight = own * round.weights.get(e).copied().unwrap_or(1.0);
            self.weights.push(weight);
            self.psi
                .push(weight * (tau - predicted(rows, e, &round.solution.values)));
            self.used.push(*own > 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::estimate::{EstimateError, FilteredNoise, Origin};
    use crate::identify::instruments::instrumental_of;
    use crate::identify::{ChangedParameters, HeldEfforts, InstrumentOptions, Instrumental};

    /// Equations of one effort and two unknowns: rows of W, rows of Z, right-hand sides.
    struct Rows(Vec<([f64; 2], [f64; 2], f64)>);

    impl InstrumentedEquations for Rows {
        type Error = EstimateError;

        fn origin(&self) -> Origin {
            Origin {
                robot: String::new(),
                model: String::new(),
                kind: "forces".to_owned(),
                efforts: vec!["q1".to_owned()],
                labels: vec!["a".to_owned(), "b".to_owned()],
            }
        }

        fn renew(&mut self, _: &[f64]) -> Result<bool, EstimateError> {
            Ok(false)
        }

        fn linearise(&mut self, _: &[f64]) -> bool {
            false
        }

        fn filtered_noise(&self) -> FilteredNoise {
            FilteredNoise::unfiltered()
        }

        fn changed(
            &mut self,
            _: &[f64],
            _: &[f64],
            _: &mut ChangedParameters,
        ) -> Result<(), EstimateError> {
            Ok(())
        }

        fn held(&mut self, _: &[f64], _: &mut HeldEfforts) -> Result<(), EstimateError> {
            Ok(())
        }

        fn visit(
            &mut self,
            each: &mut dyn FnMut(&Equations<'_>) -> Result<(), EstimateError>,
        ) -> Result<(), EstimateError> {
            for (k, (w, z, tau)) in self.0.iter().enumerate() {
                each(&Equations {
                    time: k as f64,
                    w: &[w[0], w[1], z[0], z[1]],
                    tau: &[*tau],
                    weights: &[1.0],
                    follows: k > 0,
                    held: &[],
                })?;
            }
            Ok(())
        }
    }

    /// An estimate with instruments `Z A`.
    fn with(a: [[f64; 2]; 2]) -> Instrumental {
        let wave = |k: usize, w: f64| libm::sin(w * k as f64);
        let row = |k: usize| {
            let own = [wave(k, 0.05), wave(k, 0.083) + 0.4 * wave(k, 0.05)];
            let z = [own[0] + 0.3 * wave(k, 0.31), own[1] - 0.2 * wave(k, 0.47)];
            let noise = 0.1 * (wave(k, 12.9898) + wave(k, 4.1414) + wave(k, 0.7));
            let z = [0, 1].map(|j| z[0] * a[0][j] + z[1] * a[1][j]);
            (own, z, 2.0 * own[0] - own[1] + noise)
        };
        let mut rows = Rows((0..600).map(row).collect());
        instrumental_of(&mut rows, &InstrumentOptions::default(), &[2.0, -1.0], None).unwrap()
    }

    #[test]
    fn combinations_of_the_instruments_give_the_same_estimate_and_deviations() {
        let plain = with([[1.0, 0.0], [0.0, 1.0]]);
        let mixed = with([[1.0, 3.0], [-0.5, 0.8]]);
        let same = |a: &[f64], b: &[f64]| {
            let size = a.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            assert!(size > 0.0 && a.len() == b.len());
            for (x, y) in a.iter().zip(b) {
                assert!((x - y).abs() < 1e-8 * size, "{a:?} {b:?}");
            }
        };
        same(&plain.estimate.values, &mixed.estimate.values);
        same(&plain.estimate.covariance, &mixed.estimate.covariance);
        same(&plain.deviations.covariance, &mixed.deviations.covariance);
        let freedom = [&plain, &mixed].map(|found| &found.deviations.degrees_of_freedom);
        same(freedom[0], freedom[1]);
    }
}
