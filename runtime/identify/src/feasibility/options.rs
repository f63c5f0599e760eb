//! Prior knowledge about the parameters, and other options of the physical fit.

use super::Scale;

/// The limits of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Bound {
    /// The label of the parameter.
    pub parameter: String,
    /// The lowest value, SI. For a single parameter, a value below 0 replaces the condition that
    /// the parameter is not negative, as is needed for the offset of a torque sensor or of a driven
    /// joint.
    pub lowest: f64,
    /// The highest value, SI; may be infinite.
    pub highest: f64,
}

/// A known sum of parameters, such as the mass of the whole robot on a scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Total {
    /// The labels of the parameters.
    pub parameters: Vec<String>,
    /// The sum of the parameters, SI.
    pub value: f64,
}

/// A linear form in parameters that is zero, such as a known centre of mass of an unknown mass.
#[derive(Clone, Debug, PartialEq)]
pub struct Form {
    /// Where it comes from, as a phrase for error messages.
    pub source: String,
    /// The labels of the parameters with their factors.
    pub terms: Vec<(String, f64)>,
}

/// A prior on a parameter, from CAD or a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// The label of the parameter.
    pub parameter: String,
    /// The expected value, SI.
    pub value: f64,
    /// The standard deviation of that value, SI, positive.
    pub deviation: f64,
}

/// Constraints, priors and numerical options besides the observations. [`Options::default()`] has
/// none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// The units of margins, in which parameters are also compared.
    pub scale: Scale,
    /// The smallest eigenvalue that every pseudo-inertia must have, in units of the scale.
    pub margin: f64,
    /// Groups of bodies known to be identical, in frames that correspond.
    pub identical: Vec<Vec<String>>,
    /// Parameters with known values, SI: zeros of symmetric bodies, masses from a scale.
    pub known: Vec<(String, f64)>,
    /// Limits of single parameters or of parameters of bodies.
    pub bounds: Vec<Bound>,
    /// Known sums of parameters.
    pub totals: Vec<Total>,
    /// Linear forms in parameters that are zero.
    pub forms: Vec<Form>,
    /// Priors, weighted against the observations by their standard deviations.
    pub priors: Vec<Prior>,
    /// Reference values of all p parameters, SI, from CAD: the parameters that the observations
    /// do not determine are chosen as close to them as possible; without a reference, as small as
    /// possible. `None` for a parameter without a reference.
    pub reference: Vec<Option<f64>>,
    /// The weight of the entropic prior towards the reference bodies: each body with a complete
    /// reference adds weight times the log-det divergence
    /// `trace(J J0^-1) - ln det(J J0^-1) - 4`, in squared standard deviations of the noise.
    /// Unlike a quadratic prior it does not depend on the bodies' frames and units (Lee, Wensing
    /// and Park, 2020). 0 for none.
    pub entropic: f64,
    /// The standard deviation of the noise of the factor's rows, by default that of the
    /// least-squares residuals. It sets the weight of priors.
    pub noise: Option<f64>,
    /// Skips the choice of the parameters that the observations do not determine, which are then
    /// anywhere within the constraints. Meant for the many fits of a search, whose final fit is
    /// made without this option.
    pub rough: bool,
}

impl Options {
    /// Whether there are priors, or constraints besides physical consistency.
    pub(super) fn has_constraints(&self) -> bool {
        !self.priors.is_empty()
            || self.entropic > 0.0
            || !self.known.is_empty()
            || !self.bounds.is_empty()
            || !self.totals.is_empty()
            || !self.forms.is_empty()
            || !self.identical.is_empty()
    }
}
