//! Estimates and corrects the delays of efforts behind the motion, until none is significant.

use regen_runtime::BaseModel;

use super::{MonitoredLogs, Session, SessionError};
use crate::data::{DataError, Run};
use crate::estimate::EstimateError;
use crate::friction::with_linear_friction;
use crate::identify::{self, Delay, EquationKind, Identified, Options};
use crate::states::nonlinear_joints;

/// The largest number of rounds of correcting delays; usually three suffice.
const MAX_ROUNDS: usize = 10;
/// A correction is taken back by half where it makes the residuals of its effort larger than they were
/// without any, by more than this part.
const SLACK: f64 = 1e-4;
/// The part by which the delays of efforts may differ that one cause delays: errors of the model differ
/// from effort to effort.
const ONE_CAUSE_PART: f64 = 0.1;
/// A delay is settled where less of its standard deviation is left of it.
const SETTLED_DEVIATIONS: f64 = 0.2;
/// It is taken back wholly where so many standard deviations are left of it.
const MIN_DEVIATIONS: f64 = 3.0;
/// A correction by more than this, s, must make the residuals of its effort smaller by
/// [`MIN_GAIN_OF_LONG`]: efforts that a wrong model does not explain fit better with some delay too.
const LONG_DELAY_S: f64 = 0.02;
const MIN_GAIN_OF_LONG: f64 = 2.0;

/// The delay of an effort that is searched.
struct Search {
    effort: String,
    /// The first delay, s.
    start: f64,
    /// The delay that is tried, s.
    tried: f64,
    /// The last delay with residuals that are not larger than those at the first one, s.
    best: f64,
    /// The standard deviations of the residuals at the first delay and at the best.
    first: f64,
    smallest: f64,
    /// What is left at the best delay, s, with its standard deviation.
    left: (f64, f64),
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
        self.smallest = residual;
        self.left = (correction, sigma);
        if self.is_done || !is_worth_it {
            return false;
        }
        self.tried += correction;
        true
    }

    /// Goes back to the first delay where the best one is far from it and explains little.
    fn doubt(&mut self) {
        let correction = self.best - self.start;
        if correction.abs() > LONG_DELAY_S && MIN_GAIN_OF_LONG * self.smallest > self.first {
            self.left.0 += correction;
            self.best = self.start;
        }
    }

    /// Whether residuals at a long delay are far smaller than at the best one: the corrections of other efforts lessen
    /// them at that one too.
    fn is_explained_by(&self, residual: f64) -> bool {
        MIN_GAIN_OF_LONG * residual < self.smallest
    }

    /// Whether another delay is as likely, or differs from the found one by at most a tenth.
    fn agrees_with(&self, delay: f64) -> bool {
        let (left, sigma) = self.left;
        let apart = (self.best + left - delay).abs();
        apart <= (MIN_DEVIATIONS * sigma).max(ONE_CAUSE_PART * delay.abs())
    }
}

/// The delay of all efforts if one cause may delay them all: if at least half of them, and two, were
/// corrected, and the mean of these, weighted by their deviations, agrees with every effort. An effort
/// whose own delay is too uncertain to be corrected then is as late as the others, and was not to be
/// left behind.
fn one_cause(searches: &[Search]) -> Option<f64> {
    let corrected = || searches.iter().filter(|own| own.best != 0.0);
    let count = corrected().count();
    if count < 2 || 2 * count < searches.len() {
        return None;
    }
    let mean = mean_delay(corrected());
    let is_one = mean.is_finite() && searches.iter().all(|own| own.agrees_with(mean));
    is_one.then_some(mean)
}

/// The mean of the delays that were corrected, weighted by their deviations, where there are two at least, all are
/// long, and agree with it: two efforts are not as late as each other by chance.
fn long_delay(searches: &[Search]) -> Option<f64> {
    let corrected = || searches.iter().filter(|own| own.best != 0.0);
    let mean = mean_delay(corrected());
    let is_one = |own: &Search| own.best.abs() > LONG_DELAY_S && own.agrees_with(mean);
    (corrected().count() > 1 && mean.is_finite() && corrected().all(is_one)).then_some(mean)
}

/// The mean of found delays, weighted by their deviations, s.
fn mean_delay<'a>(searches: impl Iterator<Item = &'a Search>) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for own in searches {
        let weight = own.left.1.powi(-2);
        sum += weight * own.best;
        weights += weight;
    }
    sum / weights
}

/// Estimates the delays of efforts in logs; returns names of efforts and delays in s. To the delays
/// in the session's settings, those are added that are beyond three standard deviations, see
/// [`Delay::is_worth_correcting`](crate::identify::Delay::is_worth_correcting). As the estimate of a delay
/// is of first order, it is repeated with corrected efforts until none is left. Corrections that leave
/// the residuals of an effort larger than without any are taken back by half until they do not: of
/// efforts that the model hardly explains, first order overshoots. A correction by more than 20 ms that
/// does not halve the residuals of its effort is left out; where two such delays agree, theirs is tried for the others.
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
    let mut session = session.with_reading(session.reading.clone());
    let given = session.reading.delays.clone();
    let mut searches: Vec<Search> = Vec::new();
    for _ in 0..rounds {
        let mut moves = false;
        for (residual, delay) in round(&session, &options, logs)? {
            let known = searches.iter().position(|own| own.effort == delay.effort);
            let place = known.unwrap_or_else(|| {
                let start = given.iter().find(|(own, _)| *own == delay.effort);
                let start = start.map_or(0.0, |(_, seconds)| *seconds);
                searches.push(Search {
                    effort: delay.effort.clone(),
                    start,
                    tried: start,
                    best: start,
                    first: residual,
                    smallest: residual,
                    left: (delay.seconds, delay.sigma),
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
    searches.iter_mut().for_each(Search::doubt);
    let found = with(&given, &searches, |own| own.best);
    let common = one_cause(&searches).filter(|_| given.is_empty());
    let Some(common) = common else {
        return match long_delay(&searches).filter(|_| given.is_empty()) {
            Some(long) => with_others(&mut session, &options, logs, &searches, long),
            None => Ok(found),
        };
    };
    session.reading.delays = with(&given, &searches, |_| common);
    let residuals = round(&session, &options, logs)?;
    let is_larger = |(residual, delay): &(f64, Delay)| {
        let own = searches.iter().find(|own| own.effort == delay.effort);
        own.is_none_or(|own| *residual > own.first * (1.0 + SLACK))
    };
    if residuals.iter().any(is_larger) {
        return Ok(found);
    }
    Ok(session.reading.delays)
}

/// The delays that were found, and the long one that they share for those of the other efforts whose residuals are far
/// smaller with it: an effort that a delay of others spoils has another one of its own at first.
fn with_others<M: BaseModel<f64> + ?Sized>(
    session: &mut Session<'_, M>,
    options: &Options,
    logs: &[Run],
    searches: &[Search],
    long: f64,
) -> Result<Vec<(String, f64)>, SessionError> {
    let each = |own: &Search| if own.best == 0.0 { long } else { own.best };
    session.reading.delays = with(&[], searches, each);
    let residuals = round(session, options, logs)?;
    let is_late = |own: &Search| {
        let mut residuals = residuals.iter();
        let after = residuals.find(|(_, delay)| delay.effort == own.effort);
        own.best != 0.0 || after.is_some_and(|after| own.is_explained_by(after.0))
    };
    Ok(with(&[], searches, |own| {
        if is_late(own) { each(own) } else { 0.0 }
    }))
}

/// The largest number of rounds of correcting a delay that all efforts share.
const COMMON_ROUNDS: usize = 4;

/// Estimates the delay that all efforts share; returns it in s for each effort, or nothing where their residuals
/// are not smaller with it.
///
/// # Errors
/// As [`settled_delays`].
pub(super) fn settled_common_delay<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    logs: &[Run],
) -> Result<Vec<(String, f64)>, SessionError> {
    let options = Options {
        weighting: session.options.weighting,
        ..Options::default()
    };
    let mut session = session.with_reading(session.reading.clone());
    let (mut delay, mut first, mut found) = (0.0, None, Vec::new());
    for _ in 0..COMMON_ROUNDS {
        let identified = identified(&session, &options, &mut session.open(logs)?)?;
        let sizes = identified.estimate.efforts.iter();
        let size: f64 = sizes.map(|own| libm::log(own.sigma)).sum();
        if size > *first.get_or_insert(size) {
            break;
        }
        found.clone_from(&session.reading.delays);
        let Some(left) = identified.delays.common else {
            break;
        };
        if left.seconds.abs() < SETTLED_DEVIATIONS * left.sigma {
            break;
        }
        delay += left.seconds;
        let each = identified.delays.efforts.into_iter();
        session.reading.delays = each.map(|own| (own.effort, delay)).collect();
    }
    Ok(found)
}

/// Identifies base parameters with the delays of the efforts from the equations of motion, as
/// [`identify`](identify::identify) does, with linear friction at the joints whose friction is nonlinear.
/// There are no delays where the logs do not determine these.
///
/// # Errors
/// As [`identify`](identify::identify).
pub fn identified<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    options: &Options,
    logs: &mut MonitoredLogs<'_, M>,
) -> Result<Identified, SessionError> {
    if !nonlinear_joints(session.model).is_empty() {
        match with_linear_friction(session.model, options, logs) {
            Err(DataError::Estimate(EstimateError::Undetermined { .. })) => {}
            found => return Ok(found?),
        }
    }
    let forces = EquationKind::Forces;
    Ok(identify::identify(session.model, forces, options, logs)?)
}

/// The standard deviation of the residuals of each effort, and its delay, from logs as the session
/// reads them.
fn round<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    options: &Options,
    logs: &[Run],
) -> Result<Vec<(f64, Delay)>, SessionError> {
    let mut opened = session.open(logs)?;
    let found = identified(session, options, &mut opened)?;
    let efforts = found.delays.efforts.into_iter().map(|delay| {
        let mut fits = found.estimate.efforts.iter();
        let fit = fits.find(|own| own.name == delay.effort);
        (fit.map_or(f64::INFINITY, |own| own.sigma), delay)
    });
    Ok(efforts.collect())
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
            start: 0.0,
            tried: 0.0,
            best: 0.0,
            first: residual(0.0),
            smallest: residual(0.0),
            left: (0.0, 1e-4),
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

    fn settled(best: f64, left: f64, sigma: f64) -> Search {
        Search {
            effort: String::new(),
            start: 0.0,
            tried: best,
            best,
            first: 1.0,
            smallest: 1.0,
            left: (left, sigma),
            is_done: false,
        }
    }

    #[test]
    fn efforts_of_uncertain_delays_are_as_late_as_the_others() {
        let certain = [settled(1e-3, 0.0, 1e-5), settled(1.02e-3, 0.0, 2e-5)];
        let with = |third: Search| {
            let mut all = Vec::from(
                certain
                    .each_ref()
                    .map(|own| settled(own.best, own.left.0, own.left.1)),
            );
            all.push(third);
            one_cause(&all)
        };
        let found = with(settled(0.0, 2e-4, 4e-4)).unwrap_or_default();
        assert!((found - 1.004e-3).abs() < 1e-9, "{found}");
        // one that is certainly on time, or on its own, shows that there are several causes
        assert_eq!(with(settled(0.0, 0.0, 1e-5)), None);
        assert_eq!(with(settled(3e-3, 0.0, 1e-5)), None);
        // of a single one nothing follows for others
        assert_eq!(one_cause(&certain[..1]), None);
    }

    #[test]
    fn half_of_the_efforts_have_one_cause_for_their_delays_and_fewer_do_not() {
        let with = |late: usize, uncertain: usize| {
            let late = (0..late).map(|_| settled(1e-3, 0.0, 1e-5));
            let rest = (0..uncertain).map(|_| settled(0.0, 2e-4, 4e-4));
            one_cause(&late.chain(rest).collect::<Vec<_>>())
        };
        let is_found = |found: Option<f64>| found.is_some_and(|own| (own - 1e-3).abs() < 1e-9);
        assert!(is_found(with(3, 3)) && is_found(with(4, 4)));
        assert_eq!(with(3, 4), None);
    }

    #[test]
    fn two_long_delays_that_agree_may_be_those_of_all() {
        let of = |delays: &[f64]| {
            let all: Vec<Search> = delays.iter().map(|own| settled(*own, 0.0, 1e-5)).collect();
            long_delay(&all)
        };
        let found = of(&[0.095, 0.0, 0.097, 0.0, 0.0]).unwrap_or_default();
        assert!((found - 0.096).abs() < 1e-9, "{found}");
        assert_eq!(of(&[0.095, 0.0, 0.15]), None);
        assert_eq!(of(&[0.095, 0.0, 0.0]), None);
        assert_eq!(of(&[0.0095, 0.0097, 0.0]), None);
    }

    #[test]
    fn an_effort_that_the_corrections_of_others_explain_has_no_delay_of_theirs() {
        let after = |smallest: f64| Search {
            smallest,
            ..settled(0.0, 0.0, 1e-5)
        };
        assert!(after(0.9).is_explained_by(0.1));
        assert!(!after(0.05).is_explained_by(0.1));
    }

    #[test]
    fn an_effort_agrees_with_a_delay_that_what_is_left_of_its_own_leads_to() {
        assert!(settled(1e-3, 1e-3, 1e-4).agrees_with(2e-3));
        assert!(!settled(1e-3, 1e-3, 1e-5).agrees_with(1e-3));
        assert!(!settled(1e-3, -1e-3, 1e-5).agrees_with(2e-3));
    }

    #[test]
    fn a_long_delay_that_explains_little_is_not_corrected() {
        let after = |best: f64, smallest: f64| {
            let mut own = Search {
                smallest,
                ..settled(best, 1e-4, 1e-4)
            };
            own.doubt();
            (own.best, own.left.0)
        };
        assert_eq!(after(-0.16, 0.9), (0.0, -0.16 + 1e-4));
        assert_eq!(after(0.16, 0.1), (0.16, 1e-4));
        assert_eq!(after(0.002, 0.9), (0.002, 1e-4));
    }

    #[test]
    fn residuals_that_only_rounding_makes_larger_take_no_correction_back() {
        let mut search = settled(0.0, 0.0, 1e-5);
        assert!(search.advance(1.0, (1e-3, 1e-5), true));
        assert!((search.tried - 1e-3).abs() < 1e-15);
        assert!(!search.advance(1.0 + 0.5 * SLACK, (0.0, 1e-5), false));
        assert!((search.best - 1e-3).abs() < 1e-15);
    }

    #[test]
    fn efforts_that_are_late_are_corrected_by_their_delay_each() {
        use crate::suspect::swings_for_tests::{swings, written};
        let model = swings(false);
        let reading = crate::data::Settings {
            method: crate::signals::Method::Butterworth {
                order: 4,
                cutoff: 10.0,
            },
            ..crate::data::Settings::default()
        };
        let session = Session::new(&model, reading);
        let late = written("late", 3000, 0.013, |_| true);
        let found = settled_delays(&session, &[late.0.clone().into()]).unwrap_or_default();
        let names: Vec<&str> = found.iter().map(|own| own.0.as_str()).collect();
        assert_eq!(names, ["q1", "q2", "q3"], "{found:?}");
        assert!(
            found.iter().all(|own| (own.1 - 0.013).abs() < 1e-3),
            "{found:?}"
        );
        let on_time = written("on-time", 3000, 0.0, |_| true);
        assert_eq!(
            settled_delays(&session, &[on_time.0.clone().into()]).unwrap_or_default(),
            []
        );
    }
}
