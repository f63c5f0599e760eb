//! Failures of the fits to simulated motions, with the options that help.

use regen_response::{DidimError, ResponseError, TrackError};

use crate::exit::Failure;

impl From<TrackError> for Failure {
    fn from(error: TrackError) -> Self {
        let text = match &error {
            TrackError::Missing {
                what: "command",
                joint,
            } => format!(
                "{error}: name its column with --command {joint}=COLUMN or with `commands` in an \
                 experiment file, or give what the controllers followed to didim by --reference"
            ),
            TrackError::Missing { joint, .. } => {
                format!("{error}: name its column with --column tau_{joint}=COLUMN")
            }
            _ => error.to_string(),
        };
        Self::Input(text)
    }
}

impl From<DidimError> for Failure {
    fn from(error: DidimError) -> Self {
        match error {
            DidimError::Estimate(error) => error.into(),
            DidimError::Gains(error) => error.into(),
            DidimError::Loop(_) | DidimError::NotLinearised { .. } => Self::Numeric(format!(
                "didim: {error}; start from other parameters (--start), or check the gains"
            )),
            other => Self::Input(other.to_string()),
        }
    }
}

impl From<ResponseError> for Failure {
    fn from(error: ResponseError) -> Self {
        match error {
            ResponseError::Estimate(error) => error.into(),
            ResponseError::Start { .. } => Self::Numeric(error.to_string()),
            ResponseError::Setting("window") => Self::Input("--window must be above 0".to_owned()),
            ResponseError::Setting("friction width") => {
                Self::Input("--friction-width must be above 0".to_owned())
            }
            other => Self::Input(other.to_string()),
        }
    }
}
