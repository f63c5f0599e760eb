//! A reference motion of the independent coordinates, as a Fourier series.

use core::fmt;

use regen_identify::signals::{Fourier, SignalError};
use regen_runtime::{ClosureError, Model};

use crate::reach;
use crate::simulate::Reference;

/// The frequency of the default motion, which is used without a file, Hz.
const GENTLE_FREQUENCY_HZ: f64 = 0.1;

/// A named finite Fourier series of the independent coordinates.
///
/// ```
/// use regen_experiment::trajectory::FourierReference;
/// use regen_identify::signals::Fourier;
///
/// let series = Fourier::of_positions(0.5, &[(1.0, vec![0.25], vec![2.0])])?;
/// let reference = FourierReference::new("swing".to_owned(), series, 1);
/// assert_eq!((reference.name(), reference.period()), ("swing", 2.0));
/// assert_eq!(reference.position(0.0), [1.25]);
/// let states = reference.states();
/// assert_eq!(states[0], [1.25]);
/// assert!((states[states.len() / 2][0] - 0.75).abs() < 1e-12);
/// # Ok::<(), regen_identify::signals::SignalError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FourierReference {
    name: String,
    series: Fourier,
    dof: usize,
}

impl FourierReference {
    /// Creates a reference from a series with one signal for each of `dof` independent coordinates.
    pub fn new(name: String, series: Fourier, dof: usize) -> Self {
        Self { name, series, dof }
    }

    /// A gentle periodic motion about home, with amplitudes at which the loops close over the whole
    /// period: see [`reach::gentle`].
    ///
    /// # Errors
    /// [`ReferenceError::Model`] where the model's home is not closed.
    pub fn gentle<M: Model<f64> + ?Sized>(model: &M) -> Result<Self, ReferenceError> {
        let info = model.info();
        let dof = info.dof();
        let amplitudes = reach::gentle(model)?;
        let home = info.independent.iter().map(|c| info.home[*c]);
        let signals: Vec<_> = home
            .zip(amplitudes)
            .enumerate()
            .map(|(k, (home, amplitude))| {
                let mut sine = vec![0.0; dof];
                sine[k] = amplitude;
                (home, vec![0.0; dof], sine)
            })
            .collect();
        let series = Fourier::of_positions(GENTLE_FREQUENCY_HZ, &signals)?;
        Ok(Self::new("gentle swing about home".to_owned(), series, dof))
    }

    /// The name of the motion.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The period, s.
    pub fn period(&self) -> f64 {
        1.0 / self.series.frequency()
    }

    /// The independent coordinates at the time `t` in s, rad or m.
    pub fn position(&self, t: f64) -> Vec<f64> {
        (0..self.dof).map(|k| self.series.at(k, t)[0]).collect()
    }

    /// The independent coordinates at the start, and at evenly spaced times of a period, rad or m.
    pub fn states(&self) -> Vec<Vec<f64>> {
        /// Enough for inertias, which change with the second harmonic of joints at most.
        const COUNT: u32 = 64;
        let times = (0..COUNT).map(|k| self.period() * f64::from(k) / f64::from(COUNT));
        times.map(|t| self.position(t)).collect()
    }
}

impl Reference for FourierReference {
    fn at(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let slots = q.iter_mut().zip(qd).zip(qdd);
        for (((q, qd), qdd), values) in slots.zip(self.series.all(t)) {
            [*q, *qd, *qdd] = values;
        }
    }
}

/// Why a reference motion cannot be made.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The model refuses a state, such as a home that is not closed.
    Model(ClosureError),
    /// The coefficients do not make a series.
    Series(SignalError),
}

impl fmt::Display for ReferenceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Model(error) => error.fmt(f),
            Self::Series(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for ReferenceError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Model(error) => Some(error),
            Self::Series(error) => Some(error),
        }
    }
}

impl From<ClosureError> for ReferenceError {
    fn from(error: ClosureError) -> Self {
        Self::Model(error)
    }
}

impl From<SignalError> for ReferenceError {
    fn from(error: SignalError) -> Self {
        Self::Series(error)
    }
}
