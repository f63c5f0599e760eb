//! A motion of the independent coordinates over time, from a series.

use core::fmt;

use regen_identify::signals::{Fourier, SignalError};
use regen_runtime::{ClosureError, Model};

use crate::reach;
use crate::simulate::Reference;

/// The fundamental frequency of the motion that is made without a file, Hz.
const GENTLE: f64 = 0.1;

/// A finite Fourier series of the independent coordinates and its name.
///
/// ```
/// use regen_experiment::trajectory::FourierReference;
/// use regen_identify::signals::Fourier;
///
/// let series = Fourier::of_positions(0.5, &[(1.0, vec![0.25], vec![2.0])])?;
/// let reference = FourierReference::new("swing".to_owned(), series, 1);
/// assert_eq!((reference.name(), reference.period()), ("swing", 2.0));
/// assert_eq!(reference.position(0.0), [1.25]);
/// # Ok::<(), regen_identify::signals::SignalError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FourierReference {
    name: String,
    series: Fourier,
    dof: usize,
}

impl FourierReference {
    /// A series with one signal for each of `dof` independent coordinates.
    pub fn new(name: String, series: Fourier, dof: usize) -> Self {
        Self { name, series, dof }
    }

    /// A gentle periodic motion about home, which every state of the period allows: see
    /// [`reach::gentle`].
    ///
    /// # Errors
    /// When the model's home is not closed.
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
        let series = Fourier::of_positions(GENTLE, &signals)?;
        Ok(Self::new("gentle swing about home".to_owned(), series, dof))
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its period, s.
    pub fn period(&self) -> f64 {
        1.0 / self.series.frequency()
    }

    /// The independent coordinates at a time in s, in rad or m.
    pub fn position(&self, t: f64) -> Vec<f64> {
        (0..self.dof).map(|k| self.series.at(k, t)[0]).collect()
    }
}

impl Reference for FourierReference {
    fn at(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let slots = q.iter_mut().zip(qd).zip(qdd).enumerate();
        for (k, ((q, qd), qdd)) in slots {
            [*q, *qd, *qdd] = self.series.at(k, t);
        }
    }
}

/// What keeps a motion from being made.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The model cannot be asked for its motion.
    Model(ClosureError),
    /// The series is none.
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
