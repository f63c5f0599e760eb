//! Repeatable noise, and random changes of parameters that keep them physically possible.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use regen_runtime::{Info, Parameter};

/// A generator of normally distributed numbers from a seed, the same on every machine.
///
/// ```
/// use regen_experiment::simulate::Noise;
///
/// let (mut a, mut b) = (Noise::new(7), Noise::new(7));
/// assert_eq!(a.normal(), b.normal());
/// ```
#[derive(Clone, Debug)]
pub struct Noise {
    generator: ChaCha8Rng,
    spare: Option<f64>,
}

impl Noise {
    /// Starts the generator from a seed.
    pub fn new(seed: u64) -> Self {
        Self {
            generator: ChaCha8Rng::seed_from_u64(seed),
            spare: None,
        }
    }

    /// The next number, uniformly distributed in (0, 1).
    pub fn uniform(&mut self) -> f64 {
        let bits = self.generator.next_u64() >> 11;
        (bits as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// The next number, normally distributed with mean 0 and variance 1 (Box and Muller, 1958).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * libm::log(self.uniform())).sqrt();
        let angle = std::f64::consts::TAU * self.uniform();
        self.spare = Some(radius * libm::sin(angle));
        radius * libm::cos(angle)
    }
}

/// Random parameters about given ones (p): the ten parameters of each body are scaled by one common
/// factor in `1 - by ... 1 + by`, every other parameter by its own factor, so that physically
/// possible parameters remain possible.
///
/// ```
/// use regen_experiment::simulate;
/// use regen_runtime::{Info, Parameter, Symbol};
///
/// let info = Info {
///     parameters: &[
///         Parameter::new(Symbol::Mx, "1"),
///         Parameter::new(Symbol::Mass, "1"),
///         Parameter::new(Symbol::Rotor, "q1"),
///     ],
///     bodies: &["1"],
///     ..Info::EMPTY
/// };
/// let changed = simulate::perturb_parameters(&info, &[2.0, 4.0, 1.0], 0.1, &mut simulate::Noise::new(1));
/// // The centre of mass stays where it was.
/// assert!((changed[0] / changed[1] - 0.5).abs() < 1e-15);
/// assert!((changed[2] - 1.0).abs() <= 0.1);
/// ```
pub fn perturb_parameters(info: &Info<'_>, phi: &[f64], by: f64, noise: &mut Noise) -> Vec<f64> {
    let mut factor = || 1.0 + by * (2.0 * noise.uniform() - 1.0);
    let of_bodies: Vec<f64> = info.bodies.iter().map(|_| factor()).collect();
    let body_of = |parameter: &Parameter<'_>| {
        let of_body = parameter.is_inertial();
        let mut bodies = info.bodies.iter();
        bodies.position(|b| of_body && *b == parameter.owner)
    };
    let mut changed = Vec::with_capacity(phi.len());
    for (parameter, value) in info.parameters.iter().zip(phi) {
        let by = body_of(parameter).map_or_else(&mut factor, |b| of_bodies[b]);
        changed.push(value * by);
    }
    changed
}
