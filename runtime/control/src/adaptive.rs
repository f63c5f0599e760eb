//! Update laws of adaptive control.

use core::array::from_fn;

use regen_runtime::{Parameter, Scalar};

use crate::outcome::{Sample, SettingError};
use crate::physical::Physical;
use crate::real::{Real, moderate};
use crate::symmetric::{Cholesky, inertial, parameters, pseudo_inertia};

/// Terms of the exponential series of a matrix whose norm is at most a half.
const TERMS: u32 = 16;

/// The update law of passivity-based adaptive control (J.-J. Slotine, W. Li, "On the adaptive control
/// of robot manipulators", International Journal of Robotics Research 6(3), 1987):
/// d/dt phi = -Gamma Y^T s.
///
/// Y is the generated function `adaptive_regressor` at (q, qd, qd_r, qdd_r), s = qd - qd_r the error
/// of the velocities of the independent coordinates behind the reference qd_r = qd_d - lambda (q -
/// q_d), and the controller's efforts are Y phi - K s. The error of the motion then vanishes;
/// the parameters do not always become those of the robot.
///
/// ```
/// use regen_control::{GradientLaw, Sample};
///
/// // one parameter, a mass of 2 kg that starts at 3 kg, and an error of 0.5 m/s at 4 m/s^2
/// let mut law = GradientLaw::new(&[3.0], &[0.1])?;
/// assert_eq!(law.update(&[[4.0]], &[0.5], 1e-2), Sample::Taken);
/// assert!((law.values()[0] - (3.0_f64 - 0.1 * 1e-2 * 4.0 * 0.5)).abs() < 1e-15);
/// # Ok::<(), regen_control::SettingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct GradientLaw<T, const P: usize> {
    values: [T; P],
    gains: [T; P],
}

impl<T: Real, const P: usize> GradientLaw<T, P> {
    /// Parameters to start from, with the diagonal of Gamma: each in the parameter's unit squared
    /// per J. A gain of zero keeps a parameter.
    ///
    /// # Errors
    /// When a value is not finite or a gain negative.
    pub fn new(start: &[T; P], gains: &[T; P]) -> Result<Self, SettingError> {
        if !moderate(start) {
            return Err(SettingError::NotFinite { of: "start" });
        }
        if !(moderate(gains) && gains.iter().all(|gain| *gain >= T::ZERO)) {
            return Err(SettingError::Negative { of: "gain" });
        }
        Ok(Self {
            values: *start,
            gains: *gains,
        })
    }

    /// Adapts for one `period` (s), during which `y` and `s` are held.
    ///
    /// - `y`: the regressor column by column, as it is generated.
    /// - `s`: rad/s or m/s.
    pub fn update<const D: usize>(&mut self, y: &[[T; D]; P], s: &[T; D], period: T) -> Sample {
        let Some(next) = change(y, s, period) else {
            return Sample::Refused;
        };
        let next = from_fn(|j| self.values[j] - self.gains[j] * next[j]);
        if !moderate(&next) {
            return Sample::Refused;
        }
        self.values = next;
        Sample::Taken
    }

    /// The parameters for the next cycle.
    pub fn values(&self) -> [T; P] {
        self.values
    }
}

/// The natural update law (T. Lee, J. Kwon, F. Park, "A natural adaptive control law for robot
/// manipulators", IROS 2018): the pseudo-inertia J of each of `B` bodies changes by
/// d/dt J = -gamma J L J, where L is the gradient Y^T s as a symmetric matrix. One gain serves all
/// bodies whatever their size and units are, and they stay physical.
///
/// A period is a step along the geodesic of this metric, J^(1/2) exp(-gamma T J^(1/2) L J^(1/2))
/// J^(1/2), so that J stays positive definite for every gain. Friction and rotors follow the same
/// law in one dimension and stay positive; offsets and other parameters of both signs follow the
/// [`GradientLaw`].
///
/// ```
/// use regen_control::{NaturalLaw, Sample};
/// use regen_runtime::{Parameter, Symbol};
///
/// let parameters = Symbol::INERTIAL.map(|s| Parameter::new(s, "1"));
/// let ball = [0.1, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 2.0];
/// let mut law = NaturalLaw::<f64, 10, 1>::new(&parameters, &ball, 1.0, 0.0)?;
/// // an error for which the mass is too large: it shrinks, and never below zero
/// let mut y = [[0.0]; 10];
/// y[9] = [9.81];
/// for _ in 0..1000 {
///     assert_eq!(law.update(&y, &[1.0], 0.1), Sample::Taken);
/// }
/// assert!(law.values()[9] > 0.0 && law.values()[9] < 0.01);
/// # Ok::<(), regen_control::SettingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct NaturalLaw<T, const P: usize, const B: usize> {
    set: Physical<P, B>,
    /// F of each body, with J = F F^T.
    factors: [[[T; 4]; 4]; B],
    values: [T; P],
    gain: T,
    free: T,
}

impl<T: Real, const P: usize, const B: usize> NaturalLaw<T, P, B> {
    /// - `parameters`: a generated module's `PARAMETERS`, of `B` bodies.
    /// - `start`: physical values to start from.
    /// - `gain`: gamma, 1/J; `free`: the gain of parameters that can have both signs, in their unit
    ///   squared per J.
    ///
    /// # Errors
    /// When the parameters are not those of `B` bodies, the start is not physical, or a gain is
    /// negative.
    pub fn new(
        parameters: &[Parameter<'_>; P],
        start: &[T; P],
        gain: T,
        free: T,
    ) -> Result<Self, SettingError> {
        let set = Physical::new(parameters)?;
        if !(moderate(&[gain, free]) && gain >= T::ZERO && free >= T::ZERO) {
            return Err(SettingError::Negative { of: "gain" });
        }
        if !set.contains(start) {
            return Err(SettingError::Start);
        }
        let mut factors = [[[T::ZERO; 4]; 4]; B];
        for (factor, body) in factors.iter_mut().zip(&set.bodies) {
            let found = Cholesky::new(&pseudo_inertia(&inertial(start, body)));
            *factor = found.ok_or(SettingError::Start)?.lower;
        }
        Ok(Self {
            set,
            factors,
            values: *start,
            gain,
            free,
        })
    }

    /// Adapts for one `period` (s), as [`GradientLaw::update`]. A call changes each body at most by
    /// the factor e: with larger gains the law is followed more slowly.
    pub fn update<const D: usize>(&mut self, y: &[[T; D]; P], s: &[T; D], period: T) -> Sample {
        let Some(next) = change(y, s, period) else {
            return Sample::Refused;
        };
        let mut values: [T; P] = from_fn(|j| {
            if self.set.positive[j] {
                let exponent = -self.gain * self.values[j] * next[j];
                self.values[j] * Scalar::max(-T::ONE, Scalar::min(exponent, T::ONE)).exp()
            } else {
                self.values[j] - self.free * next[j]
            }
        });
        let mut factors = self.factors;
        for (factor, body) in factors.iter_mut().zip(&self.set.bodies) {
            let gradient = dual(&inertial(&next, body));
            *factor = factor_after_step(factor, &gradient, self.gain);
            let matrix = from_fn(|i| from_fn(|k| crate::triangle::dot(&factor[i], &factor[k])));
            for (at, value) in body.iter().zip(parameters(&matrix)) {
                if let Some(entry) = values.get_mut(*at) {
                    *entry = value;
                }
            }
        }
        if !moderate(&values) {
            return Sample::Refused;
        }
        self.factors = factors;
        self.values = values;
        Sample::Taken
    }

    /// The parameters for the next cycle.
    pub fn values(&self) -> [T; P] {
        self.values
    }
}

/// Y^T s times the period; none if anything is not finite or not moderate.
fn change<T: Real, const D: usize, const P: usize>(
    y: &[[T; D]; P],
    s: &[T; D],
    period: T,
) -> Option<[T; P]> {
    let moderate_input = moderate(y.as_flattened()) && moderate(s) && moderate(&[period]);
    let change = y.map(|column| period * crate::triangle::dot(&column, s));
    (moderate_input && moderate(&change)).then_some(change)
}

/// The symmetric matrix L with tr(L J(phi)) = b phi for every body phi.
fn dual<T: Real>(b: &[T; 10]) -> [[T; 4]; 4] {
    let [ixx, ixy, ixz, iyy, iyz, izz, mx, my, mz, m] = *b;
    let half = |x: T| T::of(0.5) * x;
    let (xy, xz, yz) = (-half(ixy), -half(ixz), -half(iyz));
    let (x, y, z) = (half(mx), half(my), half(mz));
    [
        [iyy + izz, xy, xz, x],
        [xy, ixx + izz, yz, y],
        [xz, yz, ixx + iyy, z],
        [x, y, z, m],
    ]
}

/// F exp(X / 2) with X = -gain F^T L F, shortened to norm 1.
fn factor_after_step<T: Real>(
    factor: &[[T; 4]; 4],
    gradient: &[[T; 4]; 4],
    gain: T,
) -> [[T; 4]; 4] {
    let turned: [[T; 4]; 4] = from_fn(|i| from_fn(|k| factor[k][i]));
    let mut x = product(&product(&turned, gradient), factor);
    let sums = x.map(|row| row.into_iter().fold(T::ZERO, |sum, x| sum + Scalar::abs(x)));
    let norm = gain * sums.into_iter().fold(T::ZERO, Scalar::max);
    let shorter = T::of(-0.5) * gain / Scalar::max(norm, T::ONE);
    for entry in x.as_flattened_mut() {
        *entry = *entry * shorter;
    }
    let identity: [[T; 4]; 4] = from_fn(|i| from_fn(|k| if i == k { T::ONE } else { T::ZERO }));
    // 1 + x (1 + x / 2 (1 + x / 3 (...)))
    let mut sum = identity;
    for k in (1..=TERMS).rev() {
        let scale = T::ONE / T::of(f64::from(k));
        let next = product(&x, &sum);
        sum = from_fn(|i| from_fn(|k| identity[i][k] + scale * next[i][k]));
    }
    product(factor, &sum)
}

/// The product of two matrices.
fn product<T: Real>(a: &[[T; 4]; 4], b: &[[T; 4]; 4]) -> [[T; 4]; 4] {
    from_fn(|i| from_fn(|k| (0..4).fold(T::ZERO, |sum, j| sum + a[i][j] * b[j][k])))
}
