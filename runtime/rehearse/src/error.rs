//! Errors of rehearsals, and which of them concern one seed only.

use core::fmt;

use regen_experiment::closed_loop::LoopError;
use regen_experiment::instruments::InstrumentError;
use regen_experiment::simulate::SimulationError;
use regen_identify::data::DataError;
use regen_identify::estimate::EstimateError;
use regen_identify::feasibility::FeasibilityError;
use regen_identify::gains::GainError;
use regen_identify::session::SessionError;
use regen_response::{DidimError, ResponseError, TrackError};
use regen_runtime::SizeError;

/// The reason why there is no rehearsal: the request cannot be met with any seed.
#[derive(Debug)]
#[non_exhaustive]
pub enum RehearseError {
    /// The setting with this name is invalid; the second text is the rule, such as `must be
    /// positive`.
    Setting(&'static str, &'static str),
    /// The robot cannot be simulated with these settings.
    Simulation(SimulationError),
    /// A log cannot be written.
    Io {
        /// The file.
        file: String,
        /// The reason.
        why: std::io::Error,
    },
    /// Logs cannot be used with these settings.
    Session(SessionError),
    /// Instrumental variables cannot be computed with these settings.
    Instruments(InstrumentError),
    /// DIDIM cannot be computed with these settings.
    Didim(DidimError),
    /// Responses cannot be fitted with these settings.
    Response(ResponseError),
    /// A simulated log lacks a signal that the estimator needs, or loops do not close at commands.
    Track(TrackError),
    /// The length of a list does not fit the model.
    Size(SizeError),
}

impl fmt::Display for RehearseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Setting(name, must) => write!(f, "{name} {must}"),
            Self::Simulation(why) => why.fmt(f),
            Self::Io { file, why } => write!(f, "cannot write {file}: {why}"),
            Self::Session(why) => why.fmt(f),
            Self::Instruments(why) => why.fmt(f),
            Self::Didim(why) => why.fmt(f),
            Self::Response(why) => why.fmt(f),
            Self::Track(why) => why.fmt(f),
            Self::Size(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for RehearseError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Setting(..) => None,
            Self::Simulation(why) => Some(why),
            Self::Io { why, .. } => Some(why),
            Self::Session(why) => Some(why),
            Self::Instruments(why) => Some(why),
            Self::Didim(why) => Some(why),
            Self::Response(why) => Some(why),
            Self::Track(why) => Some(why),
            Self::Size(why) => Some(why),
        }
    }
}

impl RehearseError {
    /// Whether the error is due to the simulated noise and may not occur with another seed: then
    /// the seed counts as failed, as the identification of a real robot would.
    pub(crate) fn is_of_one_seed(&self) -> bool {
        match self {
            Self::Session(SessionError::Data(why))
            | Self::Instruments(InstrumentError::Data(why)) => of_data(why),
            Self::Session(SessionError::Feasibility(why)) => of_fit(why),
            Self::Session(SessionError::Gains(why))
            | Self::Instruments(InstrumentError::Gains(why))
            | Self::Didim(DidimError::Gains(why)) => of_gains(why),
            Self::Session(SessionError::NoWellIdentifiedParameter)
            | Self::Instruments(InstrumentError::Loop(_))
            | Self::Didim(DidimError::Loop(_) | DidimError::NotLinearised { .. })
            | Self::Response(ResponseError::Start { .. })
            | Self::Track(TrackError::Open { .. }) => true,
            Self::Didim(DidimError::Estimate(why))
            | Self::Response(ResponseError::Estimate(why)) => of_estimate(why),
            _ => false,
        }
    }
}

fn of_data(why: &DataError) -> bool {
    match why {
        DataError::Problems { .. } => true,
        DataError::Estimate(why) => of_estimate(why),
        DataError::Feasibility(why) => of_fit(why),
        _ => false,
    }
}

fn of_estimate(why: &EstimateError) -> bool {
    matches!(
        why,
        EstimateError::TooShort { .. }
            | EstimateError::Undetermined { .. }
            | EstimateError::NoConvergence
    )
}

fn of_gains(why: &GainError) -> bool {
    match why {
        GainError::Feasibility(why) => of_fit(why),
        GainError::NotConverged => true,
        _ => false,
    }
}

fn of_fit(why: &FeasibilityError) -> bool {
    match why {
        FeasibilityError::Solver(_) => true,
        FeasibilityError::Estimate(why) => of_estimate(why),
        _ => false,
    }
}

impl From<SimulationError> for RehearseError {
    fn from(why: SimulationError) -> Self {
        Self::Simulation(why)
    }
}

impl From<SessionError> for RehearseError {
    fn from(why: SessionError) -> Self {
        Self::Session(why)
    }
}

impl From<DataError> for RehearseError {
    fn from(why: DataError) -> Self {
        Self::Session(why.into())
    }
}

impl From<InstrumentError> for RehearseError {
    fn from(why: InstrumentError) -> Self {
        Self::Instruments(why)
    }
}

impl From<DidimError> for RehearseError {
    fn from(why: DidimError) -> Self {
        Self::Didim(why)
    }
}

impl From<ResponseError> for RehearseError {
    fn from(why: ResponseError) -> Self {
        Self::Response(why)
    }
}

impl From<TrackError> for RehearseError {
    fn from(why: TrackError) -> Self {
        Self::Track(why)
    }
}

impl From<LoopError> for RehearseError {
    fn from(why: LoopError) -> Self {
        Self::Didim(DidimError::Loop(why))
    }
}

impl From<SizeError> for RehearseError {
    fn from(why: SizeError) -> Self {
        Self::Size(why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_of_one_seed(why: SessionError) -> bool {
        RehearseError::Session(why).is_of_one_seed()
    }

    #[test]
    fn an_estimate_that_fails_within_a_feasible_fit_is_one_of_its_seed() {
        let noisy = || EstimateError::NoConvergence;
        let fit = |why| SessionError::Feasibility(FeasibilityError::Estimate(why));
        assert!(is_of_one_seed(fit(noisy())));
        let data = DataError::Feasibility(FeasibilityError::Estimate(noisy()));
        assert!(is_of_one_seed(SessionError::Data(data)));
    }
}
