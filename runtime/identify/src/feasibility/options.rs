//! What is known about the parameters besides the observations.

use super::Scale;

/// Limits of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Bound {
    /// Its label.
    pub parameter: String,
    /// The lowest value, SI. One below 0 of a single parameter stands for the sign that it must
    /// have otherwise: what a torque sensor's offset or a joint that drives asks for.
    pub lowest: f64,
    /// The highest value, SI; may be infinite.
    pub highest: f64,
}

/// A known sum of parameters, such as the mass of the whole robot on a scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Total {
    /// The labels of the parameters.
    pub parameters: Vec<String>,
    /// Their sum, SI.
    pub value: f64,
}

/// What is believed of a parameter before, from CAD or a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// Its label.
    pub parameter: String,
    /// Its value, SI.
    pub value: f64,
    /// The standard deviation of the belief, SI, positive.
    pub deviation: f64,
}

/// What is known and wanted besides the observations. [`Options::default()`]: nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// The units for margins and for comparing parameters.
    pub scale: Scale,
    /// The smallest eigenvalue that every pseudo-inertia must have, in units of the scale.
    pub margin: f64,
    /// Groups of bodies known to be identical, in frames that correspond.
    pub identical: Vec<Vec<String>>,
    /// Parameters with known values, SI: zeros of symmetric bodies, masses from a scale.
    pub known: Vec<(String, f64)>,
    /// Limits.
    pub bounds: Vec<Bound>,
    /// Known sums.
    pub totals: Vec<Total>,
    /// Beliefs, weighted against the observations by their deviations.
    pub priors: Vec<Prior>,
    /// Reference values of all p parameters, from CAD: what the observations leave open is taken
    /// as close to them as can be; without, as small as can be. `None` where there is none.
    pub reference: Vec<Option<f64>>,
    /// The weight of the entropic prior towards the reference bodies: each body with a complete
    /// reference adds weight times the log-det divergence
    /// `trace(J J0^-1) - ln det(J J0^-1) - 4`, in squared standard deviations of the noise.
    /// Unlike a quadratic prior it does not depend on the bodies' frames and units (Lee, Wensing
    /// and Park, 2020). 0 for none.
    pub entropic: f64,
    /// The standard deviation of the noise of the factor's rows; without, that of the
    /// least-squares residuals. It sets the weight of priors.
    pub noise: Option<f64>,
    /// Only the fit: what observations leave open is not chosen, and left somewhere inside the
    /// constraints. For the many fits inside a search, of which the last is made without this.
    pub rough: bool,
}
