//! Chooses controllers that follow a motion: the slowest of some with which a trial run stays close to it.

use core::fmt;

use regen_identify::text::figure_of;
use regen_runtime::Info;
use serde::Serialize;

use super::control::Drive;
use super::log::{Log, Termination};
use super::settings::Reference;

/// The bandwidths that are tried in turn, Hz. Slow controllers come first: what noise of positions adds to
/// efforts grows with the square of the bandwidth.
const BANDWIDTHS: [f64; 6] = [3.0, 6.0, 12.0, 24.0, 48.0, 96.0];
/// The times between samples that are tried where none is given, s; the first one is usual.
const STEPS: [f64; 4] = [0.01, 0.005, 0.002, 0.001];
const SHORTEST: f64 = 0.0005;
/// The product of bandwidth, spread and time between samples at most where all are chosen, and that of bandwidth
/// and time where this is given. A sampled controller of one inertia damps up to 0.09 as it does in continuous
/// time, and not at all from 0.12 on, as the eigenvalues of its samples show; drives lag besides.
const SAMPLED: [f64; 2] = [0.06, 0.08];
/// The part of its range by which a coordinate may be off a motion that is followed closely, and by which it
/// may be off one that is followed.
const CLOSE: f64 = 0.05;
const MOST: f64 = 0.2;

/// A trial of controllers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// The bandwidth, Hz.
    pub bandwidth: f64,
    /// The time between samples, s.
    pub step: f64,
    /// The independent coordinate that is farthest from the motion compared with its range there.
    pub coordinate: Option<String>,
    /// The part of the range by which it is off, at most.
    pub off: f64,
    /// Why the run ended early, in words.
    pub ended: Option<String>,
    /// The part of the samples at which an effort is at its limit, for the joint that is there most.
    pub limited: f64,
}

impl Trial {
    /// What a run says about its controllers.
    ///
    /// - `bandwidth`, `step`: Hz and s;
    /// - `drives`: those of the run.
    pub fn of<R: Reference + ?Sized>(
        (bandwidth, step): (f64, f64),
        info: &Info<'_>,
        drives: &[Drive],
        (log, motion): (&Log, &R),
    ) -> Self {
        let stray = log.stray(info, motion);
        let is_complete = log.ended == Termination::Complete;
        let count = log.t.len().max(1) as f64;
        let at_limit = |(k, drive): (usize, &Drive)| {
            let efforts = log.effort.iter().skip(k).step_by(drives.len().max(1));
            let [low, high] = drive.limit.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            efforts
                .filter(|effort| **effort <= low || **effort >= high)
                .count() as f64
                / count
        };
        Self {
            bandwidth,
            step,
            coordinate: stray.map(|(name, _)| name.to_owned()),
            off: stray.map_or(0.0, |(_, off)| off),
            ended: (!is_complete).then(|| log.ended.to_string()),
            limited: drives.iter().enumerate().map(at_limit).fold(0.0, f64::max),
        }
    }

    /// How far off the motion the run was; infinite where it ended early.
    fn distance(&self) -> f64 {
        if self.ended.is_some() {
            f64::INFINITY
        } else {
            self.off
        }
    }

    /// Whether the coordinates stay within a fifth of their ranges of the motion: the log of a run that does
    /// not is one of another motion than was asked for.
    pub fn follows(&self) -> bool {
        self.distance() <= MOST
    }
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(name) = &self.coordinate else {
            return f.write_str("no coordinate moves");
        };
        let off = figure_of(2, 100.0 * self.off);
        write!(f, "{name} is off the motion by up to {off} % of its range")
    }
}

/// Controllers that were chosen since they follow a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Following {
    /// The trial of these controllers.
    #[serde(flatten)]
    pub chosen: Trial,
    /// The other trials.
    pub others: Vec<Trial>,
}

impl fmt::Display for Following {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (chosen, others) = (&self.chosen, &self.others);
        write!(
            f,
            "{} Hz every {} s: {chosen}",
            chosen.bandwidth, chosen.step
        )?;
        let mut head = "; others:";
        for other in others {
            write!(f, "{head} {} Hz ", other.bandwidth)?;
            match other.ended {
                Some(_) => f.write_str("ended early")?,
                None => write!(f, "{} %", figure_of(2, 100.0 * other.off))?,
            }
            head = ",";
        }
        write!(
            f,
            " (--bandwidth {} --step {})",
            chosen.bandwidth, chosen.step
        )
    }
}

/// Chooses the slowest controllers with which a run stays within a twentieth of each range of the motion,
/// or those with which it is closest; returns them with what their attempt made.
///
/// - `step`: the time between samples, s, if it is given;
/// - `spread`: as [`Control::spread`](super::Control::spread);
/// - `attempt`: simulates a run with controllers of a bandwidth, Hz, and a time between samples, s.
///
/// # Errors
/// Those of `attempt`, and all trials where none [follows](Trial::follows) the motion.
///
/// ```
/// use regen_experiment::simulate::{Trial, follow};
///
/// let mut attempt = |bandwidth: f64, step: f64| {
///     let coordinate = Some("q1".to_owned());
///     let off = 3.6 / (bandwidth * bandwidth);
///     let trial = Trial { bandwidth, step, coordinate, off, ended: None, limited: 0.0 };
///     Ok::<_, ()>((trial, ()))
/// };
/// let (found, ()) = follow(None, 1.0, &mut attempt)?.map_err(|_| ())?;
/// assert_eq!(
///     found.to_string(),
///     "12 Hz every 0.005 s: q1 is off the motion by up to 2.5 % of its range; others: 3 Hz 40 %, \
///      6 Hz 10 % (--bandwidth 12 --step 0.005)"
/// );
/// let (found, ()) = follow(Some(0.01), 1.0, &mut attempt)?.map_err(|_| ())?;
/// assert_eq!(found.chosen.bandwidth, 8.0);
/// assert!(follow(Some(0.05), 1.0, &mut attempt)?.is_err());
/// # Ok::<(), ()>(())
/// ```
pub fn follow<T, E>(
    step: Option<f64>,
    spread: f64,
    attempt: &mut dyn FnMut(f64, f64) -> Result<(Trial, T), E>,
) -> Result<Result<(Following, T), Vec<Trial>>, E> {
    let mut best: Option<(usize, T)> = None;
    let mut trials: Vec<Trial> = Vec::new();
    for (bandwidth, step) in candidates(step, spread) {
        let (trial, made) = attempt(bandwidth, step)?;
        let distance = trial.distance();
        let least = best.as_ref().and_then(|(k, _)| trials.get(*k));
        if least.is_none_or(|least| distance < least.distance()) {
            best = Some((trials.len(), made));
        }
        trials.push(trial);
        if distance <= CLOSE {
            break;
        }
    }
    Ok(match best {
        Some((k, made)) if trials.get(k).is_some_and(Trial::follows) => {
            let chosen = trials.remove(k);
            Ok((
                Following {
                    chosen,
                    others: trials,
                },
                made,
            ))
        }
        _ => Err(trials),
    })
}

/// The bandwidths, Hz, and times between samples, s, to try in turn.
fn candidates(step: Option<f64>, spread: f64) -> Vec<(f64, f64)> {
    let [chosen, given] = SAMPLED;
    let Some(step) = step else {
        let of = |bandwidth: f64| {
            let mut steps = STEPS.into_iter();
            let step = steps.find(|step| bandwidth * step * spread <= chosen);
            (bandwidth, step.unwrap_or(SHORTEST))
        };
        let mut found = vec![(BANDWIDTHS[0], STEPS[0])];
        found.extend(BANDWIDTHS.map(of));
        found.dedup();
        return found;
    };
    let most = given / step;
    let mut found: Vec<f64> = BANDWIDTHS.into_iter().filter(|own| *own <= most).collect();
    if found.len() < BANDWIDTHS.len() && found.last().is_none_or(|last| 1.2 * last < most) {
        found.push(most);
    }
    found
        .into_iter()
        .map(|bandwidth| (bandwidth, step))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joints that differ ten times in the speed of their controllers need samples ten times as often.
    #[test]
    fn a_time_between_samples_suits_the_fastest_controllers_that_damp_the_slowest_mode() {
        assert_eq!(
            candidates(None, 1.0)[..3],
            [(3.0, 0.01), (6.0, 0.01), (12.0, 0.005)]
        );
        assert_eq!(
            candidates(None, 10.0)[..3],
            [(3.0, 0.01), (3.0, 0.002), (6.0, 0.001)]
        );
        for (bandwidth, step) in candidates(None, 5.0) {
            let is_usual = (bandwidth, step) == (3.0, 0.01);
            assert!(
                is_usual || step <= 0.0005 || bandwidth * step <= 0.012,
                "{bandwidth} {step}"
            );
        }
    }

    #[test]
    fn a_given_time_between_samples_stays_and_bounds_the_bandwidth() {
        for step in [0.05, 0.01, 0.002, 0.0001] {
            let found = candidates(Some(step), 3.0);
            assert!(!found.is_empty());
            let suits = |own: &(f64, f64)| {
                own.1.to_bits() == step.to_bits() && own.0 * step <= 0.08 + 1e-12
            };
            assert!(found.iter().all(suits), "{found:?}");
        }
    }

    #[test]
    fn without_controllers_that_are_close_the_closest_that_follow_are_chosen() {
        let run = |limit: f64| {
            let mut attempt = |bandwidth: f64, step: f64| {
                let off = limit + 0.01 * (bandwidth / 20.0).ln().abs();
                let (coordinate, ended) = (None, (bandwidth > 40.0).then(|| "it ended".to_owned()));
                let limited = 0.0;
                let trial = Trial {
                    bandwidth,
                    step,
                    coordinate,
                    off,
                    ended,
                    limited,
                };
                Ok::<_, ()>((trial, bandwidth))
            };
            follow(None, 1.0, &mut attempt).unwrap()
        };
        let (found, made) = run(0.1).unwrap();
        assert_eq!(
            (found.chosen.bandwidth, made, found.others.len()),
            (24.0, 24.0, 5)
        );
        let trials = run(0.21).unwrap_err();
        assert_eq!(trials.len(), BANDWIDTHS.len());
    }
}
