//! Mass and centre of a payload while the robot moves.

use core::array::from_fn;

use regen_runtime::{Parameter, Symbol};

use crate::estimator::{Estimator, Settings};
use crate::filter::positive;
use crate::outcome::{Sample, SettingError};
use crate::physical::{Physical, Projected};
use crate::real::Real;

/// A payload's mass and its centre of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load<T> {
    /// The mass, kg.
    pub mass: T,
    /// The centre of mass, m, in the frame of the payload's body.
    pub centre: [T; 3],
    /// The standard deviation of the mass, kg; infinite until the motion has shown it.
    pub mass_deviation: T,
    /// The standard deviation of each coordinate of the centre, m.
    pub centre_deviation: [T; 3],
}

/// Estimates what a robot carries from the equations of its `D` efforts in generalised momentum,
/// less those of the robot, whose parameters are known. The payload is a body of the description:
/// the robot's functions are called with zeros for its ten parameters.
///
/// Deviations contain what the residuals show. What the robot's own parameters are off by in the
/// whole run they cannot contain: let the robot move without the payload first, and see what mass it
/// then seems to carry.
///
/// ```
/// use regen_control::{Payload, Settings};
///
/// // a slide lifts a mass: its momentum is m v, and its weight acts downwards
/// let mut payload = Payload::<f64, 1>::new(&Settings::new(1e-3), &[1.0], 10.0, 0.1)?;
/// for k in 0..10_000 {
///     let t = 1e-3 * f64::from(k);
///     let (v, dv) = ((4.0 * t).sin(), 4.0 * (4.0 * t - 2e-3).cos());
///     let (mut momentum, mut rate) = ([[0.0]; 10], [[0.0]; 10]);
///     (momentum[9], rate[9]) = ([v], [-9.81]);
///     let effort = [3.0 * (dv + 9.81) + 5.0 * v]; // friction of 5 N s/m is known
///     let _ = payload.update((&[0.0], &[-5.0 * v]), (&momentum, &rate), &effort);
/// }
/// let load = payload.load().ok_or("no mass is seen")?;
/// assert!((load.mass - 3.0).abs() < 0.01 && load.mass_deviation < 0.01, "{load:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Payload<T, const D: usize> {
    estimator: Estimator<T, D, 10>,
    set: Physical<10, 1>,
    /// A ball of half of the heaviest mass.
    ball: [T; 10],
}

impl<T: Real, const D: usize> Payload<T, D> {
    /// A payload of which nothing is known but its size.
    ///
    /// - `deviations`: how far the robot's predicted efforts are off without a payload, N m or N.
    /// - `heaviest`: about the largest mass, kg, and `reach`: about the largest distance of the
    ///   payload from the origin of its body's frame, m. They are the deviations of a prior at zero,
    ///   for what the motion does not determine.
    ///
    /// # Errors
    /// As [`Estimator::new`], and when mass or reach are not positive.
    pub fn new(
        settings: &Settings,
        deviations: &[f64; D],
        heaviest: f64,
        reach: f64,
    ) -> Result<Self, SettingError> {
        positive("heaviest mass", heaviest)?;
        positive("reach", reach)?;
        let (first, second) = (heaviest * reach, heaviest * reach * reach);
        let sizes = [
            second, second, second, second, second, second, first, first, first, heaviest,
        ];
        let estimator =
            Estimator::new(settings, deviations)?.with_prior(&[T::ZERO; 10], &sizes.map(T::of))?;
        let parameters = Symbol::INERTIAL.map(|symbol| Parameter::new(symbol, "payload"));
        let moment = T::of(0.05 * second);
        let mut ball = [T::ZERO; 10];
        for (value, symbol) in ball.iter_mut().zip(Symbol::INERTIAL) {
            match symbol {
                Symbol::Ixx | Symbol::Iyy | Symbol::Izz => *value = moment,
                Symbol::Mass => *value = T::of(0.5 * heaviest),
                _ => {}
            }
        }
        Ok(Self {
            estimator,
            set: Physical::new(&parameters)?,
            ball,
        })
    }

    /// Adds one sample.
    ///
    /// - `robot`: `momentum` and `momentum_rate` of the robot without the payload.
    /// - `columns`: the ten columns of the payload in `momentum_regressor` and
    ///   `momentum_rate_regressor`, in the order of `PARAMETERS`.
    /// - `effort`: as in [`Estimator::update`].
    pub fn update(
        &mut self,
        robot: (&[T; D], &[T; D]),
        columns: (&[[T; D]; 10], &[[T; D]; 10]),
        effort: &[T; D],
    ) -> Sample {
        let (momentum, rate) = robot;
        self.estimator
            .update_beside(momentum, rate, columns.0, columns.1, effort)
    }

    /// The payload, by least squares; none while no mass is seen.
    pub fn load(&self) -> Option<Load<T>> {
        self.estimator.values().and_then(|values| self.at(&values))
    }

    /// The ten parameters, in the order of [`Symbol::INERTIAL`], that fit best of those that a body can
    /// have, see [`Physical::closest`].
    ///
    /// # Errors
    /// When the tolerance is not positive and finite.
    pub fn physical(&self, steps: usize, tolerance: T) -> Result<Projected<T, 10>, SettingError> {
        let factor = self.estimator.factor();
        self.set.closest(factor, &self.ball, steps, tolerance)
    }

    /// The estimator of the ten parameters.
    pub fn estimator(&self) -> &Estimator<T, D, 10> {
        &self.estimator
    }

    /// Begins another motion with the same payload, see [`Estimator::interrupt`].
    pub fn interrupt(&mut self) {
        self.estimator.interrupt();
    }

    /// Mass and centre of ten parameters, with the deviations of the estimate; none without mass.
    pub fn at(&self, values: &[T; 10]) -> Option<Load<T>> {
        let [.., mx, my, mz, mass] = *values;
        if !(mass > T::ZERO && mass.is_finite()) {
            return None;
        }
        let centre = [mx, my, mz].map(|moment| moment / mass);
        // derivatives of the centre by first moment and mass
        let along = |axis: usize| {
            let of = |k: usize| match k {
                9 => -centre[axis] / mass,
                k if k == 6 + axis => T::ONE / mass,
                _ => T::ZERO,
            };
            self.estimator.deviation(&from_fn(of))
        };
        let only = from_fn(|k| if k == 9 { T::ONE } else { T::ZERO });
        Some(Load {
            mass,
            centre,
            mass_deviation: self.estimator.deviation(&only),
            centre_deviation: [along(0), along(1), along(2)],
        })
    }
}
