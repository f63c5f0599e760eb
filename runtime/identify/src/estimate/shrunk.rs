//! The covariance of few cosine transforms, drawn towards the one that stationary noise has.

use super::cosine_sums::dot;
use super::deviations::MIN_CHANCE;
use super::noise::cholesky;

/// A covariance of full rank, see [`Deviations::root`](super::Deviations::root).
pub(super) struct Shrunk {
    /// Its Cholesky factor, k x k, column-major.
    pub(super) root: Vec<f64>,
    k: usize,
    /// The weight of the covariance that noise with the autocorrelation of the residuals has.
    weight: f64,
}

impl Shrunk {
    pub(super) fn covariance(&self) -> Vec<f64> {
        let k = self.k;
        let mut out = vec![0.0; k * k];
        for column in self.root.chunks_exact(k.max(1)) {
            for (at, x) in out.iter_mut().enumerate() {
                *x += column[at % k] * column[at / k];
            }
        }
        out
    }

    /// Makes the variances as large as those of the cosines alone where these are larger than chance
    /// explains: what of the noise is not stationary moves some parameters more than others.
    ///
    /// - `cosines`: the covariance from the cosines alone, k x k.
    pub(super) fn keep_what_is_beyond_chance(
        &mut self,
        cosines: &[f64],
        degrees_of_freedom: &[f64],
    ) {
        for (a, freedom) in degrees_of_freedom.iter().enumerate() {
            self.raise(a, cosines, 1.0 + MIN_CHANCE * (2.0 / freedom).sqrt());
        }
    }

    /// Makes no variance smaller than that of noise of known level.
    pub(super) fn raise_to_expected(&mut self, expected: &[f64]) {
        for a in 0..self.k {
            self.raise(a, expected, 1.0);
        }
    }

    /// Makes a variance as large as that of another covariance where that is larger by more than a factor.
    fn raise(&mut self, a: usize, other: &[f64], least: f64) {
        let k = self.k;
        let variance: f64 = (0..k).map(|j| self.root[j * k + a].powi(2)).sum();
        let ratio = other[a * k + a] / variance;
        if ratio.is_finite() && ratio > least {
            for j in 0..k {
                self.root[j * k + a] *= ratio.sqrt();
            }
        }
    }

    /// Those of a variance whose cosines have so many: the expected covariance, of all residuals, is known far
    /// better.
    pub(super) fn degrees_of_freedom(&self, of_cosines: f64) -> f64 {
        of_cosines / (1.0 - self.weight).powi(2)
    }
}

/// The weighted mean of the covariance of the transforms and of the expected one; `None` if a variance
/// is not positive and finite.
pub(super) fn shrunk(
    transforms: &[Vec<f64>],
    scale: &[f64],
    expected: &[f64],
    k: usize,
) -> Option<Shrunk> {
    let zero = vec![0.0; k * k];
    let sizes: Vec<f64> = (0..k).map(|a| expected[a * k + a].sqrt()).collect();
    if sizes.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
        return None;
    }
    let correlation: Vec<f64> = (0..k * k)
        .map(|at| expected[at] / (sizes[at / k] * sizes[at % k]))
        .collect();
    let own = cholesky(&correlation, k)?;
    // the transforms, whitened by the expected covariance
    let terms = transforms.len() as f64;
    let white: Vec<Vec<f64>> = transforms
        .iter()
        .map(|x| {
            let mut out: Vec<f64> = (0..k).map(|a| x[a] * scale[a].sqrt() / sizes[a]).collect();
            for j in 0..k {
                out[j] /= own[j * k + j];
                let value = out[j];
                for (i, x) in out.iter_mut().enumerate().skip(j + 1) {
                    *x -= own[j * k + i] * value;
                }
            }
            out
        })
        .collect();
    let mut found = zero.clone();
    for x in &white {
        for (i, xi) in x.iter().enumerate() {
            for (sum, xj) in found[i * k..(i + 1) * k].iter_mut().zip(x) {
                *sum += xi * xj / terms;
            }
        }
    }
    let mean = (0..k).map(|a| found[a * k + a]).sum::<f64>() / k.max(1) as f64;
    let square = |matrix: &[f64]| matrix.iter().map(|x| x * x).sum::<f64>();
    // |S - mu I|^2, and the part of it that is due to chance: sum |x x^T - S|^2 / terms^2
    let distance = square(&found) - k as f64 * mean * mean;
    let lengths: f64 = white.iter().map(|x| dot(x, x).powi(2)).sum();
    let chance = (lengths / terms - square(&found)) / terms;
    let shrinkage = if distance > 0.0 {
        (chance / distance).clamp(0.0, 1.0)
    } else {
        1.0
    };
    // a small part of the mean makes a singular matrix positive definite
    let shrinkage = shrinkage.max(1e-6);
    for (at, x) in found.iter_mut().enumerate() {
        *x *= 1.0 - shrinkage;
        if at / k == at % k {
            *x += shrinkage * mean;
        }
    }
    let of_found = cholesky(&found, k)?;
    let mut out = zero;
    for j in 0..k {
        for i in j..k {
            let sum: f64 = (j..=i).map(|l| own[l * k + i] * of_found[j * k + l]).sum();
            out[j * k + i] = sizes[i] * sum;
        }
    }
    Some(Shrunk {
        root: out,
        k,
        weight: shrinkage,
    })
}

#[cfg(test)]
mod tests {
    use super::super::deviations::covariance_of;
    use super::*;
    use crate::intervals::Random;

    #[test]
    fn variances_of_many_parameters_vary_less_than_those_of_cosines_alone() {
        let (k, terms) = (24, 20);
        let mut random = Random(3);
        let transforms = (0..terms).map(|_| (0..k).map(|_| random.normal()).collect());
        let transforms: Vec<Vec<f64>> = transforms.collect();
        let scale = vec![1.0; k];
        let identity: Vec<f64> = (0..k * k)
            .map(|at| f64::from(u8::from(at / k == at % k)))
            .collect();
        let spread = |covariance: &[f64]| {
            let variances = (0..k).map(|a| covariance[a * k + a] - 1.0);
            variances.map(|x| x * x).sum::<f64>()
        };
        let cosines = covariance_of(&transforms, &scale);
        let mut found = shrunk(&transforms, &scale, &identity, k).unwrap();
        let alone = spread(&cosines);
        assert!(spread(&found.covariance()) < 0.25 * alone, "{alone}");
        assert!(found.degrees_of_freedom(20.0) > 100.0);
        // a variance that is far larger than chance explains is kept
        let mut larger = cosines.clone();
        larger[5 * k + 5] = 9.0;
        found.keep_what_is_beyond_chance(&larger, &vec![20.0; k]);
        let covariance = found.covariance();
        assert!((covariance[5 * k + 5] - 9.0).abs() < 1e-9);
        assert!((covariance[6 * k + 6] - 1.0).abs() < 0.3);
    }

    #[test]
    fn a_covariance_is_the_same_in_other_units() {
        let (k, terms) = (3, 12);
        let mut random = Random(5);
        let transforms = (0..terms).map(|_| (0..k).map(|_| random.normal()).collect());
        let transforms: Vec<Vec<f64>> = transforms.collect();
        let expected = [2.0, 0.5, 0.1, 0.5, 1.0, -0.3, 0.1, -0.3, 0.7];
        let plain = shrunk(&transforms, &[1.0; 3], &expected, k).unwrap();
        let units = [1e3, 1.0, 0.02];
        let scaled = transforms
            .iter()
            .map(|x| x.iter().zip(units).map(|(x, u)| x * u).collect());
        let scaled: Vec<Vec<f64>> = scaled.collect();
        let of_units = |matrix: &[f64]| -> Vec<f64> {
            (0..9)
                .map(|at| matrix[at] * units[at / k] * units[at % k])
                .collect()
        };
        let other = shrunk(&scaled, &[1.0; 3], &of_units(&expected), k).unwrap();
        for (own, other) in of_units(&plain.covariance()).iter().zip(other.covariance()) {
            assert!((own / other - 1.0).abs() < 1e-9, "{own} {other}");
        }
        // a matrix that is nearly the expected one stays between both
        let found = covariance_of(&transforms, &[1.0; 3]);
        let weight = plain.weight;
        assert!((1e-6..=1.0).contains(&weight));
        for a in 0..k {
            let bounds = [found[4 * a], expected[4 * a]].map(|x| x / plain.covariance()[4 * a]);
            assert!(
                bounds.iter().all(|part| (0.2..5.0).contains(part)),
                "{bounds:?}"
            );
        }
    }
}
