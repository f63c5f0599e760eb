//! Estimates and corrects the delays of efforts behind the motion, until none is significant.

use regen_runtime::BaseModel;

use super::{Session, SessionError};
use crate::data::Run;
use crate::identify::{self, EquationKind, Options};

/// The largest number of rounds of correcting delays; usually three suffice.
const MAX_ROUNDS: usize = 10;
/// A correction is taken back by half where it makes the residuals of its effort larger than they were
/// without any, by more than this part.
const SLACK: f64 = 1e-4;
/// It is taken back wholly where so many standard deviations are left of it.
const MIN_DEVIATIONS: f64 = 3.0;

/// The delay of an effort that is searched.
struct Search {
    effort: String,
    /// The delay that is tried, s.
    tried: f64,
    /// The last delay with residuals that are not larger than those at the first one, s.
    best: f64,
    /// The standard deviation of the residuals at the first delay.
    first: f64,
    is_done: bool,
}

impl Search {
    /// Takes what one round found at the tried delay; whether another delay is to be tried.
    ///
    /// - `correction`: the delay that is left, s, with its standard deviation;
    /// - `is_worth_it`: whether it is to be corrected.
    fn advance(
        &mut self,
        residual: f64,
        (correction, sigma): (f64, f64),
        is_worth_it: bool,
    ) -> bool {
        if residual > self.first * (1.0 + SLACK) {
            self.tried = 0.5 * (self.tried + self.best);
            if (self.tried - self.best).abs() <= MIN_DEVIATIONS * sigma {
                self.tried = self.best;
                self.is_done = true;
            }
            return true;
        }
        self.best = self.tried;
        if self.is_done || !is_worth_it {
            return false;
        }
        self.tried += correction;
        true
    }
}

/// Estimates the delays of efforts in logs; returns names of efforts and delays in s. To the delays
/// in the session's settings, those are added that are beyond three standard deviations, see
/// [`Delay::is_worth_correcting`](crate::identify::Delay::is_worth_correcting). As the estimate of a delay
/// is of first order, it is repeated with corrected efforts until none is left. Corrections that leave
/// the residuals of an effort larger than without any are taken back by half until they do not: of
/// efforts that the model hardly explains, first order overshoots.
///
/// # Errors
/// [`SessionError::DelaysFromEnergyBalance`] for energy balances; when a log cannot be read.
pub fn settled_delays<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[Run],
) -> Result<Vec<(String, f64)>, SessionError> {
    settled_delays_within(session, logs, MAX_ROUNDS)
}

/// As [`settled_delays`], with at most so many rounds: where the model lacks what looks like a delay,
/// more of them cost time and settle nothing.
///
/// # Errors
/// As [`settled_delays`].
pub fn settled_delays_within<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[Run],
    rounds: usize,
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
    let given = session.reading.delays.clone();
    let mut searches: Vec<Search> = Vec::new();
    for _ in 0..rounds {
        let mut opened = session.open(logs)?;
        let found = identify::identify(session.model, session.kind, &options, &mut opened)?;
        let mut moves = false;
        for delay in &found.delays.efforts {
            let mut fits = found.estimate.efforts.iter();
            let fit = fits.find(|own| own.name == delay.effort);
            let residual = fit.map_or(f64::INFINITY, |own| own.sigma);
            let known = searches.iter().position(|own| own.effort == delay.effort);
            let place = known.unwrap_or_else(|| {
                let start = given.iter().find(|(own, _)| *own == delay.effort);
                let start = start.map_or(0.0, |(_, seconds)| *seconds);
                searches.push(Search {
                    effort: delay.effort.clone(),
                    tried: start,
                    best: start,
                    first: residual,
                    is_done: false,
                });
                searches.len() - 1
            });
            let left = (delay.seconds, delay.sigma);
            if let Some(own) = searches.get_mut(place) {
                moves |= own.advance(residual, left, delay.is_worth_correcting());
            }
        }
        if !moves {
            break;
        }
        session.reading.delays = with(&given, &searches, |own| own.tried);
    }
    Ok(with(&given, &searches, |own| own.best))
}

/// The given delays with those that were searched in their places, or behind them where they are not
/// zero.
fn with(
    given: &[(String, f64)],
    searches: &[Search],
    value: impl Fn(&Search) -> f64,
) -> Vec<(String, f64)> {
    let mut out = given.to_vec();
    for search in searches {
        let seconds = value(search);
        match out.iter_mut().find(|(own, _)| *own == search.effort) {
            Some((_, known)) => *known = seconds,
            None if seconds != 0.0 => out.push((search.effort.clone(), seconds)),
            None => {}
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Follows a search: the residual at a delay, and the first-order estimate of what is left.
    fn followed(residual: impl Fn(f64) -> f64, correction: impl Fn(f64) -> f64) -> f64 {
        let mut search = Search {
            effort: String::new(),
            tried: 0.0,
            best: 0.0,
            first: residual(0.0),
            is_done: false,
        };
        for _ in 0..MAX_ROUNDS {
            let left = correction(search.tried);
            let is_worth_it = left.abs() > 3e-4;
            if !search.advance(residual(search.tried), (left, 1e-4), is_worth_it) {
                break;
            }
        }
        search.best
    }

    #[test]
    fn a_correction_that_is_too_long_is_taken_back() {
        let valley = |d: f64| 1.0 + 1e4 * (d - 0.02).powi(2);
        // by so much too long
        for factor in [0.7, 1.0, 1.5] {
            let found = followed(valley, |d| factor * (0.02 - d));
            assert!((found - 0.02).abs() < 1e-3, "{factor}: {found}");
        }
        // of an effort whose residuals only rise, nothing is corrected
        let found = followed(|d| 1.0 + d.abs(), |_| 0.076);
        assert!(found.abs() < 1e-15, "{found}");
    }
}
