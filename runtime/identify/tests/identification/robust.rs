//! Robust estimates, tested by the equations that define them, and the bandwidth of correlation.

use regen_identify::estimate::EstimateError;
use regen_identify::identify::{EquationKind, Identified, Options, identify};
use regen_identify::states::{Filtering, Recorded, Source, StateSample};

use crate::models::pendulum::Pendulum;

const INERTIA: f64 = 0.5;
const MOMENT: f64 = 2.0;
const SAMPLES: usize = 300;

/// Pseudo-random numbers (SplitMix64), the same on every machine; normally distributed ones by Box
/// and Muller.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

/// A pendulum's motion with noise on its effort: rows of the two parameters, and the effort.
fn pendulum(noise: impl FnMut() -> f64) -> (Vec<[f64; 2]>, Vec<f64>, Recorded) {
    let mut noise = noise;
    let (mut w, mut y, mut log) = (Vec::new(), Vec::new(), Recorded::new());
    for k in 0..SAMPLES {
        let t = 0.05 * k as f64;
        let (q, qd, qdd) = (t.sin(), t.cos(), -t.sin());
        let row = [qdd, 9.81 * q.sin()];
        let tau = INERTIA * row[0] + MOMENT * row[1] + noise();
        log.push(t, &[q], &[qd], &[qdd], &[tau]);
        w.push(row);
        y.push(tau);
    }
    (w, y, log)
}

fn identified(log: &mut Recorded, options: &Options) -> Identified {
    identify(&Pendulum, EquationKind::Forces, options, log).unwrap()
}

fn residuals(w: &[[f64; 2]], y: &[f64], beta: &[f64]) -> Vec<f64> {
    let pairs = w.iter().zip(y);
    pairs
        .map(|([a, b], y)| y - a * beta[0] - b * beta[1])
        .collect()
}

/// The inverse of `W^T diag(d) W`.
fn inverse(w: &[[f64; 2]], d: impl Fn(usize) -> f64) -> [[f64; 2]; 2] {
    let sum = |i: usize, j: usize| -> f64 {
        let terms = w.iter().enumerate();
        terms.map(|(t, row)| d(t) * row[i] * row[j]).sum()
    };
    let (a, b, c) = (sum(0, 0), sum(0, 1), sum(1, 1));
    let det = a * c - b * b;
    [[c / det, -b / det], [-b / det, a / det]]
}

/// The mean of min(z^2, bound^2) over the normal distribution, by Simpson's rule.
fn bounded_variance(bound: f64) -> f64 {
    let n = 20_000;
    let step = 24.0 / f64::from(n);
    let term = |k: i32| {
        let z = -12.0 + step * f64::from(k);
        let weight = match k {
            _ if k == 0 || k == n => 1.0,
            _ if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        weight * z.abs().min(bound).powi(2) * (-z * z / 2.0).exp()
    };
    (0..=n).map(term).sum::<f64>() * step / 3.0 / std::f64::consts::TAU.sqrt()
}

/// Huber's second proposal (1964): `sum w psi(r/s) = 0`, and `sum psi^2 / (N - p)` has its expected
/// value for normal noise. The covariance is s^2 times that sum, divided by the squared fraction of
/// samples within bounds, times (W^T W)^-1 (Huber, 1973).
#[test]
fn the_robust_estimate_fulfils_the_equations_that_define_it() {
    for bound in [1.345, 2.5] {
        let mut random = Random(7);
        let mut k = 0;
        // every eleventh effort has an error of 40 standard deviations, always with the same sign
        let noise = || {
            k += 1;
            0.05 * random.normal() + if k % 11 == 0 { 2.0 } else { 0.0 }
        };
        let (w, y, mut log) = pendulum(noise);
        let options = Options {
            huber: Some(bound),
            hac_bandwidth: Some(1),
            ..Options::default()
        };
        let robust = identified(&mut log, &options);
        let beta = &robust.estimate.values;
        let sigma = robust.estimate.efforts[0].sigma;
        let r = residuals(&w, &y, beta);
        let psi: Vec<f64> = r.iter().map(|r| (r / sigma).clamp(-bound, bound)).collect();
        for j in 0..2 {
            let sum: f64 = psi.iter().zip(&w).map(|(p, w)| p * w[j]).sum();
            let size: f64 = psi.iter().zip(&w).map(|(p, w)| (p * w[j]).abs()).sum();
            // the iteration stops when no parameter changes by 1e-6 standard deviations
            assert!(sum.abs() < 1e-5 * size, "{bound}, {j}: {sum:e} of {size:e}");
        }
        let spare = (SAMPLES - 2) as f64;
        let spread = psi.iter().map(|p| p * p).sum::<f64>() / spare;
        let expected = bounded_variance(bound);
        // the scale has not converged fully when the parameters have
        assert!(
            (spread / expected - 1.0).abs() < 1e-4,
            "{spread} {expected}"
        );
        let inside = psi.iter().filter(|p| p.abs() < bound).count() as f64 / SAMPLES as f64;
        assert!(inside < 0.92, "the outliers are outside");
        let white = sigma * sigma * spread / (inside * inside);
        let bread = inverse(&w, |_| 1.0);
        // for scores without correlation: W^T diag(psi^2) W between two (W^T W)^-1
        let meat = inverse(&w, |t| psi[t] * psi[t]);
        let det = meat[0][0] * meat[1][1] - meat[0][1] * meat[1][0];
        let meat = [
            [meat[1][1] / det, -meat[0][1] / det],
            [-meat[1][0] / det, meat[0][0] / det],
        ];
        let scale = sigma * sigma * SAMPLES as f64 / spare / (inside * inside);
        for i in 0..2 {
            for j in 0..2 {
                let found = robust.estimate.covariance[i * 2 + j];
                let exact = white * bread[i][j];
                // relative to the diagonal, because off-diagonal entries may cancel
                let size = white * (bread[i][i] * bread[j][j]).sqrt();
                assert!((found - exact).abs() < 1e-5 * size, "{found:e} {exact:e}");
                let sum = |a: usize, b: usize| bread[i][a] * meat[a][b] * bread[b][j];
                let exact = scale * (sum(0, 0) + sum(0, 1) + sum(1, 0) + sum(1, 1));
                let found = robust.deviations.covariance[i * 2 + j];
                assert!((found - exact).abs() < 1e-5 * size, "{found:e} {exact:e}");
            }
        }
        // outliers move the least-squares estimate more than twice as far as the robust one
        let plain = largest_error(&identified(&mut log, &Options::default()));
        let off = largest_error(&robust);
        assert!(off < 0.5 * plain, "{bound}: {off} {plain}");
    }
}

fn largest_error(found: &Identified) -> f64 {
    let values = &found.estimate.values;
    (values[0] - INERTIA).abs().max((values[1] - MOMENT).abs())
}

/// Without outliers the robust estimate loses little: its efficiency at a bound of 1.345 standard
/// deviations is 95 %.
#[test]
fn on_normal_noise_robust_and_plain_estimates_agree_within_their_deviations() {
    let mut random = Random(3);
    let (_, _, mut log) = pendulum(|| 0.05 * random.normal());
    let plain = identified(&mut log, &Options::default());
    let robust = identified(
        &mut log,
        &Options {
            huber: Some(1.345),
            ..Options::default()
        },
    );
    for k in 0..2 {
        let off = plain.estimate.values[k] - robust.estimate.values[k];
        assert!(off.abs() < plain.estimate.sigma(k));
        let ratio = robust.estimate.sigma(k) / plain.estimate.sigma(k);
        assert!((0.9..1.2).contains(&ratio), "{ratio}");
    }
    let sigma = robust.estimate.efforts[0].sigma;
    // with 300 samples the standard deviation of sigma is about 5 %
    assert!((sigma / 0.05 - 1.0).abs() < 0.2, "{sigma}");
}

/// Noise of an autoregression counts as (1 - rho) / (1 + rho) times as many independent samples.
#[test]
fn the_bandwidth_follows_from_the_correlation_of_residuals() {
    let mut longest = 0;
    for rho in [0.0_f64, 0.3, 0.6, 0.9, 0.98] {
        let mut random = Random(11);
        let mut last = 0.0;
        let (_, _, mut log) = pendulum(|| {
            last = rho * last + 0.05 * random.normal();
            last
        });
        let found = identified(&mut log, &Options::default());
        let exact = (1.0 + rho) / (1.0 - rho);
        // with 300 samples a correlation of 0.9 is accurate to 0.03, and this number to a third
        let ratio = found.correlation_length as f64 / exact;
        let least = if rho > 0.95 { 0.2 } else { 0.6 };
        assert!((least..1.7).contains(&ratio), "{rho}: {ratio}");
        assert!(
            found.correlation_length >= longest,
            "more correlation, fewer samples"
        );
        longest = found.correlation_length;
        // 300 samples, of which 99 correspond to one independent sample
        if !(0.7..=0.95).contains(&rho) {
            assert_eq!(found.deviations.short(), rho > 0.95, "{rho}");
        }
    }
}

/// A bound that no residual exceeds gives ordinary least squares, for any weights of the rows.
#[test]
fn a_bound_beyond_all_residuals_has_no_effect() {
    let mut random = Random(5);
    let (_, y, _) = pendulum(|| 0.05 * random.normal());
    let mut log = Recorded::new();
    for (k, tau) in y.iter().enumerate() {
        let t = 0.05 * k as f64;
        log.push_row(&StateSample {
            time: t,
            q: &[t.sin()],
            qd: &[t.cos()],
            qdd: &[-t.sin()],
            tau: &[*tau],
            efforts: &[],
            held: &[],
            at_standstill: &[],
            weights: &[1.0 + (k % 3) as f64],
            follows: k > 0,
            bridged: false,
        });
    }
    let plain = identified(&mut log, &Options::default());
    let options = Options {
        huber: Some(100.0),
        ..Options::default()
    };
    let robust = identified(&mut log, &options);
    for k in 0..2 {
        let (a, b) = (plain.estimate.values[k], robust.estimate.values[k]);
        assert!((a / b - 1.0).abs() < 1e-12);
        let ratio = robust.estimate.sigma(k) / plain.estimate.sigma(k);
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
    }
}

/// A log that counts how many times it is read.
struct CountingLog {
    log: Recorded,
    read: usize,
}

impl Source for CountingLog {
    type Error = EstimateError;

    fn filtering(&self) -> Filtering {
        self.log.filtering()
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), EstimateError> {
        self.read += 1;
        self.log.visit(each)
    }
}

#[test]
fn a_log_that_fits_into_memory_is_read_once_for_all_passes() {
    let mut random = Random(7);
    let (_, _, log) = pendulum(|| 0.05 * random.normal());
    let mut log = CountingLog { log, read: 0 };
    for huber in [None, Some(100.0), Some(1.345)] {
        let options = Options {
            huber,
            ..Options::default()
        };
        log.read = 0;
        identify(&Pendulum, EquationKind::Forces, &options, &mut log).unwrap();
        assert_eq!(log.read, 1, "{huber:?}");
    }
}
