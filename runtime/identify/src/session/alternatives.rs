//! Compares what a chosen filter does with what else reads and solves the same logs, by the same errors.

use regen_runtime::BaseModel;

use super::choice::{Basis, rate_of};
use super::cutoffs::{
    BIAS_WEIGHT, KnownBias, ORDER, Search, Trial, all_errors, fitted, mean_square, percent_of,
    trial,
};
use super::motion_noise::{NoisyLogs, is_undetermined, rates};
use super::{Session, SessionError};
use crate::choice::{Choice, LossChoice, SeriesChoice, VelocityChoice};
use crate::data::{DataError, Logs, Run, Settings};
use crate::identify::{Delay, Delays};
use crate::signals::{Method, SignalError, fitting_series};

/// A Fourier series takes the place of a filter if its mean square error is below this part of the filter's: of a
/// motion that repeats itself, it loses nothing and keeps no noise.
const SERIES_BELOW: f64 = 1.0;
/// The same of a series of parts of the logs: what their other rows tell, such as weights at rest, is then lost.
const PART_BELOW: f64 = 0.5;
/// Of many samples, so many are tried first, and the others too unless the filter is clearly better: by this factor
/// of the mean square errors.
const ENOUGH_SAMPLES: usize = 4000;
const CLEARLY: f64 = 1.3;
/// Velocities computed from the positions are taken in place of measured ones if their mean square error is
/// below this part of that of the measured ones.
const COMPUTED_BELOW: f64 = 0.7;
/// Huber's loss takes the place of squares if its mean square error is below this part of theirs.
const ROBUST_BELOW: f64 = 0.7;
/// Delays of less than this part of the time between rows are not corrected: errors of the derivatives look
/// like them.
const MIN_DELAY_ROWS: f64 = 0.02;
/// A delay that all efforts share is corrected from so many standard deviations on: one cause delays the efforts
/// of most machines, and what is left uncorrected moves friction by many deviations.
const MIN_COMMON_DEVIATIONS: f64 = 4.0;
/// The delay of a single effort is corrected from so many on: of logs without delays one in a hundred has one beyond
/// four, and what is left uncorrected is part of the deviations.
const MIN_SINGLE_DEVIATIONS: f64 = 4.5;
/// An effort whose delay differs from that of all by more standard deviations has another cause.
const MAX_APART_DEVIATIONS: f64 = 3.0;
/// Huber's loss is tried where a residual is as many standard deviations large: the largest of ten thousand
/// normal ones is.
const HEAVY: f64 = 4.0;
/// The bound of Huber's loss, in standard deviations: with normal residuals it loses 5 % of the efficiency
/// (Huber, 1964).
pub const HUBER_BOUND: f64 = 1.345;

/// Compares measured velocities with those computed from the positions, at the chosen cutoff and lower ones,
/// as long as these are better: differences of positions have more noise at high frequencies; `None` where the computed ones do not determine the parameters.
///
/// - `without`: the logs without measured velocities.
pub(super) fn velocity_choice<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    found: &Search,
    without: &Logs<'_, M>,
) -> Result<Option<VelocityChoice>, DataError> {
    let Some(measured) = found.chosen.and_then(|(_, place)| found.trials.get(place)) else {
        return Ok(None);
    };
    let efforts = mean_square(&measured.factor);
    let (levels, rate) = (without.noise_levels(), rate_of(without));
    let percent = |square: f64| percent_of(square, efforts);
    let mut best: Option<VelocityChoice> = None;
    let cutoffs = found.trials.iter().map(|own| own.cutoff);
    let mut lower: Vec<f64> = cutoffs.filter(|own| *own <= measured.cutoff).collect();
    lower.reverse();
    for cutoff in lower {
        let computed = match trial(session, without, &levels, (cutoff, rate), KnownBias::None) {
            Ok(found) => found,
            Err(error) if is_undetermined(&error) => continue,
            Err(error) => return Err(error),
        };
        // positions belong to the geometry: where both differ, the measured velocities are wrong
        let errors = all_errors(&[&computed, measured], 1);
        let [computed, measured] =
            [0, 1].map(|k| errors.get(k).map_or(f64::INFINITY, |own| own.sum()));
        if !(computed + measured).is_finite() {
            continue;
        }
        let own = VelocityChoice {
            are_computed: computed < COMPUTED_BELOW * measured,
            measured: percent(measured),
            computed: percent(computed),
        };
        if best.is_some_and(|best| best.computed <= own.computed) {
            break;
        }
        best = Some(own);
    }
    Ok(best)
}

/// Compares Huber's loss with squares of the residuals at the chosen cutoff; `None` where no residual is as
/// large that it would be better.
///
/// - `robust`: the session with Huber's loss.
pub(super) fn loss_choice<M: BaseModel<f64> + ?Sized>(
    robust: &Session<'_, M>,
    basis: &Basis<'_, M>,
) -> Result<Option<LossChoice>, DataError> {
    let Some(squares) = basis.trial().filter(|own| own.largest > HEAVY) else {
        return Ok(None);
    };
    let levels = basis.logs.noise_levels();
    let place = (squares.cutoff, basis.rate());
    let bounded = match trial(
        robust,
        &basis.logs,
        &levels,
        place,
        KnownBias::OfEquations(squares),
    ) {
        Err(error) if is_undetermined(&error) => return Ok(None),
        found => found?,
    };
    // the weights of both are other ones: errors are those of the efforts in the units of squares
    let own = |own: &Trial| {
        let errors = all_errors(&[squares, own], 0);
        errors
            .get(1)
            .map_or(f64::INFINITY, |own| own.variance + BIAS_WEIGHT * own.bias)
    };
    let (with_squares, with_bound) = (own(squares), own(&bounded));
    if !(with_squares + with_bound).is_finite() {
        return Ok(None);
    }
    let efforts = mean_square(&squares.factor);
    let percent = |square: f64| percent_of(square, efforts);
    Ok(Some(LossChoice {
        huber: (with_bound < ROBUST_BELOW * with_squares).then_some(HUBER_BOUND),
        squares: percent(with_squares),
        bounded: percent(with_bound),
    }))
}

/// Which efforts are late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lateness {
    /// None beyond chance.
    None,
    /// All by the same time as far as is known, and none by itself beyond chance.
    Common,
    /// Some by themselves.
    Each,
}

/// Whether an effort may be late by this time, s.
fn may_be(own: &Delay, seconds: f64) -> bool {
    (own.seconds - seconds).abs() <= MAX_APART_DEVIATIONS * own.sigma
}

/// Which efforts have a delay with the chosen filter or series.
///
/// - `of_series`: the delays of the efforts behind the series, if one is chosen.
pub(super) fn lateness<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    basis: &Basis<'_, M>,
    of_series: Option<Delays>,
) -> Result<Lateness, SessionError> {
    let Some(chosen) = basis.trial() else {
        return Ok(Lateness::None);
    };
    let (cutoff, rate) = (chosen.cutoff, basis.rate());
    let levels = basis.logs.noise_levels();
    let behind = |cutoff: f64| {
        let method = Method::Butterworth {
            order: ORDER,
            cutoff,
        };
        let [every, decimation] = rates(rate, cutoff);
        let thinned = basis.logs.thinned(method, every, decimation)?;
        let mut noisy = NoisyLogs::new(&thinned, &levels, cutoff);
        fitted(session, &mut noisy, true)
    };
    let is_series = of_series.is_some();
    let found = match of_series {
        Some(found) => found,
        None => behind(cutoff)?.delays,
    };
    let is_long = |own: &Delay| own.seconds.abs() * rate > MIN_DELAY_ROWS;
    let (each, common) = (&found.efforts, &found.common);
    let is_beyond = |own: &Delay, deviations: f64| own.seconds.abs() > deviations * own.sigma;
    let is_common_certain =
        (common.as_ref()).is_some_and(|own| is_beyond(own, MIN_COMMON_DEVIATIONS));
    // a filter that bends the motion makes delays too, which are others behind a higher cutoff
    let higher = basis
        .higher_cutoff()
        .filter(|_| !is_series && (is_common_certain || each.iter().any(Delay::is_significant)));
    let higher = match higher.map(behind) {
        Some(Err(error)) if is_undetermined(&error) => None,
        Some(found) => Some(found?.delays),
        None => None,
    };
    let lasts = |own: &Delay, all: &[Delay]| {
        let mut others = all.iter().filter(|other| other.effort == own.effort);
        others.all(|other| !own.is_contradicted_by(other))
    };
    let lasts_behind = |own: &Delay| (higher.as_ref()).is_none_or(|all| lasts(own, &all.efforts));
    let certain = (each.iter()).filter(|own| own.is_significant() && lasts_behind(own));
    let mut signs: Vec<bool> = certain.clone().map(|own| own.seconds > 0.0).collect();
    signs.dedup();
    if signs.len() > 1 {
        // what makes some efforts late and others early is an error of the model or of the motion
        return Ok(Lateness::None);
    }
    let mut certain = certain.filter(|own| is_beyond(own, MIN_SINGLE_DEVIATIONS));
    if certain.any(&is_long) {
        return Ok(Lateness::Each);
    }
    let is_common = common.as_ref().is_some_and(|all| {
        let other = higher.as_ref().and_then(|own| own.common.as_ref());
        is_common_certain
            && other.is_none_or(|other| !all.is_contradicted_by(other))
            && all.slower.is_none()
            && is_long(all)
            && each.iter().all(|own| may_be(own, all.seconds))
    });
    Ok(if is_common {
        Lateness::Common
    } else {
        Lateness::None
    })
}

/// Compares the Fourier series of a motion that repeats itself, or of the part of each log in which it does, with the
/// chosen filter. `None` where the motion does not repeat, or repeats itself only roughly: where the estimates of both
/// differ by more than chance, and what the series leaves of the motion is not noise alone.
///
/// - `choice`: that of the filter; `finds_delays`: whether the delays of the efforts behind a series that is used are
///   returned too.
pub(super) fn series_choice<M: BaseModel<f64> + ?Sized>(
    session: &Session<'_, M>,
    runs: &[Run],
    basis: &Basis<'_, M>,
    choice: &Choice,
    finds_delays: bool,
) -> Result<Option<(SeriesChoice, Option<Delays>)>, SessionError> {
    let (Some(filtered), Some(positions)) = (basis.trial(), basis.logs.positions()) else {
        return Ok(None);
    };
    let Some(fitting) = fitting_series(&positions) else {
        return Ok(None);
    };
    let found = SeriesChoice {
        frequency: fitting.frequency,
        harmonics: fitting.harmonics,
        parts: fitting.parts.unwrap_or_default(),
        is_used: true,
        filtered: None,
        series: 0.0,
    };
    let with_series = Choice {
        series: Some(found.clone()),
        ..choice.clone()
    };
    let reading = Settings {
        decimation: 1,
        ..with_series.applied(&session.reading)
    };
    let mut logs = match Logs::open(session.model, &with_series.runs(runs), &reading) {
        // too short a part of a period
        Err(DataError::Signal {
            why: SignalError::Setting(_) | SignalError::TooFew { .. },
            ..
        }) => return Ok(None),
        opened => opened?,
    };
    let fitted = |logs: &mut Logs<'_, M>, finds_delays: bool| -> Result<_, DataError> {
        match fitted(session, logs, finds_delays) {
            Err(error) if is_undetermined(&error) => Ok(None),
            found => {
                let found = found?;
                let delays = found.delays.clone();
                let trial = Trial::of_exact_motion(found, filtered.cutoff);
                Ok(Some((trial, delays)))
            }
        }
    };
    let below = if found.parts.is_empty() {
        SERIES_BELOW
    } else {
        PART_BELOW
    };
    let samples: usize = positions.iter().map(|own| own.times.len()).sum();
    let every = samples / ENOUGH_SAMPLES;
    if every > 1
        && let Some((few, _)) = fitted(&mut logs.thinned(reading.method, 1, every)?, false)?
        && let [own, other] = &all_errors(&[&few, filtered], 0)[..]
    {
        // with all equations it is at least this, unless their errors alternate
        let least = own.variance / every as f64;
        if least > CLEARLY * below * other.sum() {
            let efforts = mean_square(&few.factor);
            let percent = |square: f64| percent_of(square, efforts);
            let found = SeriesChoice {
                is_used: false,
                filtered: Some(percent(other.sum())),
                series: percent(least),
                ..found
            };
            return Ok(Some((found, None)));
        }
    }
    let Some((series, delays)) = fitted(&mut logs, finds_delays)? else {
        return Ok(None);
    };
    // the errors of efforts along the whole motion, which no filter has smoothed
    let errors = all_errors(&[&series, filtered], 0);
    let [Some(own), Some(other)] = [errors.first(), errors.get(1)] else {
        return Ok(None);
    };
    if other.apart > 0.0 && !fitting.leaves_noise {
        return Ok(None);
    }
    let (with_series, with_filter) = (own.variance, other.sum());
    if !with_series.is_finite() {
        return Ok(None);
    }
    let efforts = mean_square(&series.factor);
    let percent = |square: f64| percent_of(square, efforts);
    let found = SeriesChoice {
        is_used: with_series < below * with_filter,
        filtered: with_filter.is_finite().then(|| percent(with_filter)),
        series: percent(with_series),
        ..found
    };
    let delays = (finds_delays && found.is_used).then_some(delays);
    Ok(Some((found, delays)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effort_may_be_as_late_as_all_are_within_its_deviations() {
        let own = |seconds: f64| Delay {
            effort: "q1".to_owned(),
            seconds,
            sigma: 1e-4,
            degrees_of_freedom: 100.0,
            slower: None,
        };
        assert!(may_be(&own(2e-3), 2.2e-3) && may_be(&own(2e-3), 1.8e-3));
        assert!(may_be(&own(-2e-3), -2.2e-3));
        assert!(!may_be(&own(2e-3), 2.5e-3) && !may_be(&own(2e-3), -2e-3));
    }
}
