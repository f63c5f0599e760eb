//! The variables of the search: scaled coefficients of the finite Fourier series (Eq. 25).

use std::f64::consts::TAU;

use super::ExciteError;
use regen_identify::signals::Fourier;

/// The map from variables to Fourier series. The variables of each coordinate are its offset, then
/// the coefficients of the cosines and the sines of all harmonics, each divided by the amplitude
/// that the coordinate can reach at that frequency. Motions that start and end at rest have one
/// cosine and one sine variable less.
#[derive(Clone, Debug)]
pub(super) struct Space {
    frequency: f64,
    harmonics: usize,
    /// For each coordinate, the scales of offset, cosines and sines.
    scales: Vec<Vec<f64>>,
    /// For motions that start and end at rest: for each coordinate the excluded directions of the
    /// scaled cosines and sines, as Householder vectors.
    rest: Option<Vec<[Vec<f64>; 2]>>,
}

/// Position, velocity, acceleration and jerk.
pub(super) const ORDERS: usize = 4;

/// The values and rates of the series at one time, as linear functions of the variables.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// For each coordinate and each of position, velocity, acceleration and jerk: the factors of that
    /// coordinate's variables.
    pub(super) factors: Vec<[Vec<f64>; ORDERS]>,
}

impl Space {
    /// Computes the scales of the variables.
    ///
    /// - `frequency`: that of the first harmonic, Hz; `reach`: half the range of each coordinate,
    ///   rad or m; `speed`: the velocity limit of each coordinate, if any, rad/s or m/s.
    pub(super) fn new(
        frequency: f64,
        harmonics: usize,
        reach: &[f64],
        speed: &[Option<f64>],
        at_rest: bool,
    ) -> Self {
        let scales: Vec<Vec<f64>> = reach
            .iter()
            .zip(speed)
            .map(|(reach, speed)| {
                let of = |k: usize| {
                    let w = TAU * frequency * k as f64;
                    speed.map_or(*reach, |v| reach.min(v / w)) / (k as f64).sqrt()
                };
                let each = || (1..=harmonics).map(of);
                std::iter::once(*reach)
                    .chain(each())
                    .chain(each())
                    .collect()
            })
            .collect();
        let rest = at_rest.then(|| {
            let vectors = scales.iter().map(|scale| {
                // qdd(0) = -sum (wk)^2 c_k and qd(0) = sum wk s_k
                let part = |from: usize, power: i32| {
                    let entries = scale[from..from + harmonics].iter().enumerate();
                    let weighted = entries.map(|(k, s)| s * ((k + 1) as f64).powi(power));
                    householder(weighted.collect())
                };
                [part(1, 2), part(1 + harmonics, 1)]
            });
            vectors.collect()
        });
        Self {
            frequency,
            harmonics,
            scales,
            rest,
        }
    }

    /// The number of variables of each coordinate.
    pub(super) fn per_coordinate(&self) -> usize {
        1 + 2 * self.harmonics - if self.rest.is_some() { 2 } else { 0 }
    }

    /// The number of all variables.
    pub(super) fn size(&self) -> usize {
        self.scales.len() * self.per_coordinate()
    }

    /// The time in which the highest harmonic turns by a radian, s.
    pub(super) fn shortest(&self) -> f64 {
        1.0 / (TAU * self.frequency * self.harmonics as f64)
    }

    /// Offset, cosines and sines of a coordinate, from its variables.
    fn unscaled(&self, coordinate: usize, y: &[f64]) -> Vec<f64> {
        let scale = &self.scales[coordinate];
        let full = match &self.rest {
            None => y.to_vec(),
            Some(rest) => {
                let (offset, tail) = y.split_at(1);
                let (cosines, sines) = tail.split_at(self.harmonics - 1);
                let mut full = offset.to_vec();
                for (part, vector) in [cosines, sines].into_iter().zip(&rest[coordinate]) {
                    let mut padded = vec![0.0];
                    padded.extend(part);
                    reflect(vector, &mut padded);
                    full.extend(padded);
                }
                full
            }
        };
        full.iter().zip(scale).map(|(y, s)| y * s).collect()
    }

    /// The derivative by a coordinate's variables, from that by offset, cosines and sines.
    fn pulled(&self, coordinate: usize, slope: &[f64]) -> Vec<f64> {
        let scale = &self.scales[coordinate];
        let full: Vec<f64> = slope.iter().zip(scale).map(|(g, s)| g * s).collect();
        let Some(rest) = &self.rest else {
            return full;
        };
        let mut out = vec![full[0]];
        let parts = full[1..].chunks_exact(self.harmonics);
        for (part, vector) in parts.zip(&rest[coordinate]) {
            let mut part = part.to_vec();
            reflect(vector, &mut part);
            out.extend(&part[1..]);
        }
        out
    }

    /// The row at the fraction `step / steps` of the period.
    pub(super) fn row(&self, step: usize, steps: usize) -> Row {
        let (mut cosines, mut sines) = (Vec::new(), Vec::new());
        for k in 1..=self.harmonics {
            // the angle is reduced by whole turns in integers, so that the period closes exactly
            let angle = TAU * ((k * step) % steps) as f64 / steps as f64;
            let (sin, cos) = libm::sincos(angle);
            cosines.push(cos);
            sines.push(sin);
        }
        let w = |k: usize| TAU * self.frequency * (k + 1) as f64;
        let series = |constant: f64, of: &dyn Fn(usize) -> [f64; 2]| {
            let each: Vec<[f64; 2]> = (0..self.harmonics).map(of).collect();
            let cosines = each.iter().map(|e| e[0]);
            let sines = each.iter().map(|e| e[1]);
            std::iter::once(constant)
                .chain(cosines)
                .chain(sines)
                .collect::<Vec<f64>>()
        };
        let rows = [
            series(1.0, &|k| [cosines[k], sines[k]]),
            series(0.0, &|k| [-w(k) * sines[k], w(k) * cosines[k]]),
            series(0.0, &|k| {
                [-w(k) * w(k) * cosines[k], -w(k) * w(k) * sines[k]]
            }),
            series(0.0, &|k| {
                let cube = w(k) * w(k) * w(k);
                [cube * sines[k], -cube * cosines[k]]
            }),
        ];
        let factors = (0..self.scales.len())
            .map(|c| rows.each_ref().map(|row| self.pulled(c, row)))
            .collect();
        Row { factors }
    }

    /// The Fourier series of these variables.
    pub(super) fn series(&self, y: &[f64]) -> Result<Fourier, ExciteError> {
        let parts: Vec<_> = y
            .chunks_exact(self.per_coordinate())
            .enumerate()
            .map(|(c, y)| {
                let all = self.unscaled(c, y);
                let (cosine, sine) = all[1..].split_at(self.harmonics);
                (all[0], cosine.to_vec(), sine.to_vec())
            })
            .collect();
        Ok(Fourier::of_positions(self.frequency, &parts)?)
    }

    /// The variables of standing still at a pose of the independent coordinates.
    pub(super) fn stationary(&self, pose: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.size()];
        let each = self.per_coordinate();
        for ((chunk, q), scale) in y.chunks_exact_mut(each).zip(pose).zip(&self.scales) {
            chunk[0] = q / scale[0];
        }
        y
    }

    /// Interpolates between standing still at a pose (`part` 0) and `y` (`part` 1).
    pub(super) fn between(&self, pose: &[f64], y: &[f64], part: f64) -> Vec<f64> {
        let stationary = self.stationary(pose);
        let pairs = stationary.iter().zip(y);
        pairs.map(|(a, b)| a + part * (b - a)).collect()
    }

    /// The offsets of a motion, rad or m: its mean pose.
    pub(super) fn offsets(&self, y: &[f64]) -> Vec<f64> {
        let chunks = y.chunks_exact(self.per_coordinate()).zip(&self.scales);
        chunks.map(|(chunk, scale)| chunk[0] * scale[0]).collect()
    }
}

impl Row {
    /// Position, velocity, acceleration and jerk of each coordinate for the variables `y`.
    pub(super) fn at(&self, y: &[f64]) -> [Vec<f64>; ORDERS] {
        let each = self.factors.first().map_or(1, |f| f[0].len());
        std::array::from_fn(|i| {
            let chunks = y.chunks_exact(each).zip(&self.factors);
            let sum = |(y, f): (&[f64], &[Vec<f64>; ORDERS])| dot(y, &f[i]);
            chunks.map(sum).collect()
        })
    }

    /// Adds to `out`, the derivative by the variables, the contribution of `slope`, the derivative
    /// by the position of each coordinate, then by the velocities, accelerations and jerks (4 dof).
    pub(super) fn pull(&self, slope: &[f64], out: &mut [f64]) {
        let dof = self.factors.len();
        let each = self.factors.first().map_or(1, |f| f[0].len());
        for (c, (out, factors)) in out.chunks_exact_mut(each).zip(&self.factors).enumerate() {
            let own = slope.iter().skip(c).step_by(dof.max(1));
            for (g, row) in own.zip(factors) {
                if *g != 0.0 {
                    for (o, f) in out.iter_mut().zip(row) {
                        *o += g * f;
                    }
                }
            }
        }
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The unit vector v of the Householder reflection that maps `a` to the first axis.
fn householder(mut a: Vec<f64>) -> Vec<f64> {
    let length = dot(&a, &a).sqrt();
    let first = a[0];
    a[0] += if first < 0.0 { -length } else { length };
    let norm = dot(&a, &a).sqrt();
    a.iter().map(|x| x / norm).collect()
}

/// Applies the Householder reflection of the unit vector `v`.
fn reflect(v: &[f64], x: &mut [f64]) {
    let twice = 2.0 * dot(v, x);
    for (x, v) in x.iter_mut().zip(v) {
        *x -= twice * v;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_the_series_and_a_motion_at_rest_starts_at_rest() {
        for at_rest in [false, true] {
            let space = Space::new(0.2, 4, &[0.5, 2.0], &[Some(1.0), None], at_rest);
            let y: Vec<f64> = (0..space.size()).map(|k| libm::sin(k as f64)).collect();
            let series = space.series(&y).unwrap();
            for step in 0..7 {
                let at = space.row(step, 7).at(&y);
                for c in 0..2 {
                    let known = series.at(c, step as f64 / 7.0 / 0.2);
                    for (found, known) in at.iter().zip(known) {
                        assert!((found[c] - known).abs() < 1e-12, "{step} {c}");
                    }
                    // the jerk, by a difference whose error is of the square of its step
                    let beside = [-1e-4, 1e-4].map(|h| series.at(c, step as f64 / 1.4 + h)[2]);
                    let jerk = (beside[1] - beside[0]) / 2e-4;
                    assert!(
                        (at[3][c] - jerk).abs() < 1e-5 * (1.0 + jerk.abs()),
                        "{step} {c}"
                    );
                }
            }
            let [_, qd, qdd, _] = space.row(0, 7).at(&y);
            let moves = qd.iter().chain(&qdd).any(|x| x.abs() > 1e-12);
            assert_eq!(moves, !at_rest);
        }
    }

    #[test]
    fn derivatives_by_the_variables_are_those_of_the_rows() {
        let space = Space::new(0.2, 3, &[0.5, 2.0], &[None, None], true);
        let row = space.row(2, 9);
        let slope = [1.0, -2.0, 0.5, 0.25, 3.0, 0.125, -1.0, 0.75];
        let mut pulled = vec![0.0; space.size()];
        row.pull(&slope, &mut pulled);
        let y: Vec<f64> = (0..space.size()).map(|k| libm::cos(k as f64)).collect();
        let at = row.at(&y).concat();
        assert!((dot(&at, &slope) - dot(&y, &pulled)).abs() < 1e-13);
    }
}
