//! Estimates and corrects the delays of efforts behind the motion, until none is significant.

use regen_runtime::BaseModel;

use super::{Session, SessionError};
use crate::data::Run;
use crate::identify::{self, EquationKind, Options};

/// Most rounds of correcting delays; usually two or three suffice.
const MAX_ROUNDS: usize = 6;

/// Estimates the delays of efforts in logs; returns names of efforts and delays in s. To the delays
/// in the session's settings, those are added that differ from zero by more than three standard
/// deviations. As the estimate of a delay is of first order, it is repeated with corrected efforts
/// until no further delay is significant.
///
/// # Errors
/// [`SessionError::DelaysFromEnergyBalance`] for energy balances; when a log cannot be read.
pub fn settled_delays<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[Run],
) -> Result<Vec<(String, f64)>, SessionError> {
    if session.kind != EquationKind::Forces {
        return Err(SessionError::DelaysFromEnergyBalance);
    }
    let options = Options {
        weighting: session.options.weighting,
        ..Options::default()
    };
    let mut session = Session {
        model: session.model,
        reading: session.reading.clone(),
        kind: session.kind,
        options: session.options,
        confidence: session.confidence,
        watch: session.watch,
    };
    for _ in 0..MAX_ROUNDS {
        let mut opened = session.open(logs)?;
        let found = identify::identify(session.model, session.kind, &options, &mut opened)?;
        let late = found.delays.efforts.iter().filter(|d| d.is_significant());
        let late: Vec<(String, f64)> = late.map(|d| (d.effort.clone(), d.seconds)).collect();
        if late.is_empty() {
            break;
        }
        let delays = &mut session.reading.delays;
        for (name, seconds) in late {
            match delays.iter_mut().find(|(own, _)| *own == name) {
                Some((_, known)) => *known += seconds,
                None => delays.push((name, seconds)),
            }
        }
    }
    Ok(session.reading.delays)
}
