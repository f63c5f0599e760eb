//! The external forces on a robot, from its generalised momentum.

use core::array::from_fn;

use regen_runtime::Scalar;

use crate::filter::{LowPass, positive};
use crate::outcome::{Sample, SettingError};
use crate::real::{Real, moderate};

/// The momentum observer (A. De Luca, R. Mattone, "Sensorless robot collision detection and hybrid
/// force/motion control", ICRA 2005): the external generalised force on the `D` independent
/// coordinates of a robot, behind a first-order low-pass.
///
/// With p = M qd, d/dt p = n + tau + external, where n is the generated function `momentum_rate`:
/// Coriolis, gravity and friction. No acceleration is needed and no mass matrix inverted. The
/// observer is the exact solution of De Luca and Mattone's equation for efforts that are held from
/// cycle to cycle, and momentum and n that are straight lines between samples.
///
/// For a robot with loops everything is over the independent coordinates, at states on which the
/// loops are closed (see [`Closure`](crate::Closure)): an external force F at a point acts as its
/// Jacobian's transpose times F. Leave out samples at which the functions' `Condition` is singular.
///
/// ```
/// use regen_control::{Observer, Sample};
///
/// // a mass of 2 kg is pushed by 3 N beside the drive's 1 N
/// let mut observer = Observer::<f64, 1>::new(100.0, 1e-3)?;
/// assert_eq!(observer.update(&[0.0], &[0.0], &[0.0]), Sample::First);
/// for k in 1..=100 {
///     let momentum = (3.0 + 1.0) * 1e-3 * f64::from(k);
///     assert_eq!(observer.update(&[momentum], &[0.0], &[1.0]), Sample::Taken);
///     let known = 3.0 * (1.0 - (-0.1 * f64::from(k)).exp());
///     assert!((observer.force()[0] - known).abs() < 1e-9);
/// }
/// # Ok::<(), regen_control::SettingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Observer<T, const D: usize> {
    filter: LowPass<T>,
    state: Option<Memory<T, D>>,
    force: [T; D],
}

/// What the filter remembers.
#[derive(Clone, Copy, Debug)]
struct Memory<T, const D: usize> {
    /// H (omega p + n), and its input at the last sample.
    moved: [T; D],
    last: [T; D],
    /// H tau.
    driven: [T; D],
}

impl<T: Real, const D: usize> Observer<T, D> {
    /// An observer whose force follows the external one within about one over the bandwidth.
    ///
    /// - `bandwidth`: rad/s; a higher one is faster, and passes more noise of velocities.
    /// - `period`: of the cycle, s.
    ///
    /// # Errors
    /// When one is not positive, or their product is above 1.
    pub fn new(bandwidth: f64, period: f64) -> Result<Self, SettingError> {
        Ok(Self {
            filter: LowPass::new(bandwidth, period)?,
            state: None,
            force: [T::ZERO; D],
        })
    }

    /// Observes one sample.
    ///
    /// - `momentum`, `rate`: `momentum` (kg m^2/s or kg m/s) and `momentum_rate` (N m or N) at the
    ///   sample.
    /// - `effort`: the efforts of the drives since the last sample (`generalized_forces` of them
    ///   where drives are not at the independent coordinates), N m or N; of sampled efforts the mean
    ///   of both samples.
    pub fn update(&mut self, momentum: &[T; D], rate: &[T; D], effort: &[T; D]) -> Sample {
        if !(moderate(momentum) && moderate(rate) && moderate(effort)) {
            return Sample::Refused;
        }
        let omega = self.filter.bandwidth;
        let last: [T; D] = from_fn(|d| omega * momentum[d] + rate[d]);
        let Some(state) = &self.state else {
            self.state = Some(Memory {
                moved: momentum.map(|p| omega * p),
                last,
                driven: [T::ZERO; D],
            });
            return Sample::First;
        };
        let next = Memory {
            moved: from_fn(|d| self.filter.line(state.moved[d], state.last[d], last[d])),
            last,
            driven: from_fn(|d| self.filter.held(state.driven[d], effort[d])),
        };
        self.force = from_fn(|d| omega * momentum[d] - next.moved[d] - next.driven[d]);
        self.state = Some(next);
        Sample::Taken
    }

    /// The external generalised force on each independent coordinate behind the low-pass, N m or N;
    /// zero at the first sample.
    pub fn force(&self) -> [T; D] {
        self.force
    }

    /// Forgets the motion: the next sample is the first.
    pub fn restart(&mut self) {
        self.state = None;
        self.force = [T::ZERO; D];
    }
}

/// Tells contact from noise: thresholds for an observer's forces that it learns while nothing
/// touches the robot.
///
/// Each threshold is the rms of what was learned times the square root of 2 ln(D N / p), which normal
/// noise exceeds in N samples with a probability below p, and not below the largest that was
/// learned. Friction that changes with temperature, or a payload that the model does not know, are
/// not noise: learn again when they change.
///
/// ```
/// use regen_control::Collision;
///
/// let mut detector = Collision::<f64, 2>::new(0.01, 10_000)?;
/// for k in 0..1000 {
///     let noise = f64::from(k).sin();
///     detector.learn(&[noise, 3.0 * noise]);
/// }
/// // noise of rms 0.7 and 2.1 N m, times the square root of 2 ln(2 * 10,000 / 0.01)
/// assert!((detector.thresholds()[0] - 3.81).abs() < 0.02);
/// assert_eq!(detector.contact(&[1.0, 6.0]), None);
/// assert_eq!(detector.contact(&[4.0, -25.0]), Some(1));
/// # Ok::<(), regen_control::SettingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Collision<T, const D: usize> {
    level: T,
    squares: [T; D],
    largest: [T; D],
    learned: u32,
}

impl<T: Real, const D: usize> Collision<T, D> {
    /// A detector that has learned nothing, and so tells nothing.
    ///
    /// - `alarms`: the probability of a false alarm in `samples` samples, below 1.
    ///
    /// # Errors
    /// When the probability is not between 0 and 1, or the number of samples is zero.
    pub fn new(alarms: f64, samples: u32) -> Result<Self, SettingError> {
        positive("probability of a false alarm", alarms)?;
        positive("number of samples", f64::from(samples))?;
        if alarms >= 1.0 {
            return Err(SettingError::Probability);
        }
        let odds = D as f64 * f64::from(samples) / alarms;
        Ok(Self {
            level: T::of(libm::sqrt(2.0 * libm::log(odds))),
            squares: [T::ZERO; D],
            largest: [T::ZERO; D],
            learned: 0,
        })
    }

    /// Learns from the forces of a sample without contact; those that are not finite are left out.
    pub fn learn(&mut self, force: &[T; D]) {
        if !moderate(force) || self.learned == u32::MAX {
            return;
        }
        self.learned += 1;
        self.squares = from_fn(|d| self.squares[d] + force[d] * force[d]);
        self.largest = from_fn(|d| Scalar::max(self.largest[d], Scalar::abs(force[d])));
    }

    /// The force on each coordinate above which there is contact, N m or N; infinite before anything
    /// was learned.
    pub fn thresholds(&self) -> [T; D] {
        if self.learned == 0 {
            return [T::INFINITY; D];
        }
        let count = T::of(f64::from(self.learned));
        from_fn(|d| {
            let rms = Scalar::sqrt(self.squares[d] / count);
            Scalar::max(self.level * rms, self.largest[d])
        })
    }

    /// The coordinate whose force exceeds its threshold the most, if any does.
    pub fn contact(&self, force: &[T; D]) -> Option<usize> {
        let mut found = None;
        let mut most = T::ONE;
        for (d, (force, threshold)) in force.iter().zip(self.thresholds()).enumerate() {
            let part = Scalar::abs(*force) / threshold;
            if part > most {
                (found, most) = (Some(d), part);
            }
        }
        found
    }
}
