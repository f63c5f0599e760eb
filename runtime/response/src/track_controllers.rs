//! The controllers of the logs that DIDIM simulates.

use regen_experiment::closed_loop::Controllers;
use regen_experiment::simulate::{Gains, Pid};

use regen_runtime::Info;

use crate::setup::{Action, Setup};

/// How many times in a row of the log a controller acts that is much faster than the log: what is left of its
/// delay is a sixteenth of a row.
const CONTINUOUS_ACTS: usize = 8;

/// The controllers of several tracks: those that are known, and tuned ones for the others.
#[derive(Clone, Debug)]
pub struct TrackControllers<'a> {
    /// For each track with known controllers these, and the constant efforts that are added to theirs.
    known: Vec<Option<(Vec<Pid>, Vec<f64>)>>,
    /// Gains that replace those of tuned controllers.
    given: &'a [Gains],
    /// Whether these are the gains of all joints.
    are_given: bool,
}

impl<'a> TrackControllers<'a> {
    /// Gathers controllers.
    ///
    /// - `known`: for each track its controllers, `None` to tune them;
    /// - `given`: gains that replace those of tuned controllers;
    /// - `info`: the robot's.
    ///
    /// ```
    /// use regen_experiment::closed_loop::Controllers;
    /// use regen_experiment::simulate::Gains;
    /// use regen_response::{Law, Setup, TrackControllers};
    /// use regen_runtime::Info;
    ///
    /// let info = Info { coordinates: &["q1"], actuated: &[0], ..Info::EMPTY };
    /// let setup = Setup::new(vec![Law::pd(40.0, 2.0)]);
    /// let own = TrackControllers::new(&[Some(&setup), None], &[], &info);
    /// assert!(matches!(own.of(0, 3.0), Controllers::Known { pid, .. } if pid[0].kp == 40.0));
    /// assert!(matches!(own.of(1, 3.0), Controllers::Tuned { bandwidth, .. } if bandwidth == 3.0));
    /// assert!(own.are_tuned());
    /// let given = [Gains { name: Some("q1".to_owned()), values: [40.0, 0.0, 2.0] }];
    /// assert!(!TrackControllers::new(&[None], &given, &info).are_tuned());
    /// ```
    pub fn new(known: &[Option<&Setup>], given: &'a [Gains], info: &Info<'_>) -> Self {
        let of_setup = |setup: &Setup| {
            let laws = setup.laws.iter();
            let pid = laws.clone().map(|law| Pid {
                kp: law.kp.value,
                ki: law.ki.value,
                kd: law.kd.value,
                ki_velocity: law.ki_velocity,
                damping: law.damping,
                late: law.late,
                velocity_late: law.velocity_late,
                acts_per_row: match setup.action {
                    Action::Sampled => 1,
                    Action::Continuous => CONTINUOUS_ACTS,
                },
            });
            (pid.collect(), laws.map(|law| law.offset.value).collect())
        };
        let known = known.iter().map(|setup| setup.map(of_setup));
        Self {
            known: known.collect(),
            given,
            are_given: Gains::are_of_all(given, info),
        }
    }

    /// The controllers of a track, by its number from 0.
    ///
    /// - `bandwidth`: of tuned controllers, Hz.
    pub fn of(&self, track: usize, bandwidth: f64) -> Controllers<'_> {
        match self.known.get(track) {
            Some(Some((pid, offset))) => Controllers::Known { pid, offset },
            _ => Controllers::Tuned {
                bandwidth,
                given: self.given,
            },
        }
    }

    /// Whether the gains of any joint are tuned, in any track.
    pub fn are_tuned(&self) -> bool {
        !self.are_given && self.known.iter().any(Option::is_none)
    }
}
