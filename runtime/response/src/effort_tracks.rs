//! Makes the runs of DIDIM from the tracks of logs.

use regen_experiment::closed_loop::{ClosedLoop, Controllers};
use regen_experiment::simulate::Reference;
use regen_identify::data::Track;
use regen_runtime::Model;

use crate::commanded::Commanded;
use crate::didim::EffortRun;
use crate::logs::{TrackError, efforts};

/// The motion that a robot was commanded, on the time axis of the logs, and the time for which it is
/// simulated before the first row (s): a period, if the robot repeated the motion, or the time since it
/// began.
pub type KnownReference<'a> = (&'a (dyn Reference + Sync), f64);

/// The efforts of several tracks, and the motion that was commanded in each.
pub struct EffortTracks<'a> {
    tracks: &'a [Track],
    /// By track and actuated joint, N m or N.
    efforts: Vec<Vec<Vec<f64>>>,
    references: References<'a>,
}

enum References<'a> {
    /// One motion for all tracks.
    Known(KnownReference<'a>),
    /// The logged commands of each track.
    Commanded(Vec<Commanded>),
}

impl<'a> EffortTracks<'a> {
    /// Reads the efforts of tracks and, without a known motion, their commands.
    ///
    /// - `known`: the motion that was commanded in all tracks; `None`: the commands that the tracks
    ///   contain, simulated from their first row on.
    ///
    /// # Errors
    /// When a track lacks the effort of an actuated joint, when no motion is known and a track lacks
    /// the command of an actuated joint, or when the loops do not close at the commands.
    ///
    /// ```
    /// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs")); }
    /// use regen_experiment::closed_loop::Controllers;
    /// use regen_identify::data::Track;
    /// use regen_response::EffortTracks;
    ///
    /// let track = Track {
    ///     times: vec![0.0, 0.1],
    ///     efforts: vec![(0, vec![1.0, 2.0])],
    ///     ..Track::default()
    /// };
    /// let still = |_: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
    ///     (q[0], qd[0], qdd[0]) = (0.0, 0.0, 0.0);
    /// };
    /// let tracks = [track];
    /// let known = EffortTracks::new(&models::Pendulum, &tracks, Some((&still, 1.0)))?;
    /// let tuned = Controllers::Tuned { bandwidth: 5.0, given: &[] };
    /// let runs = known.runs(|_| tuned);
    /// assert_eq!((runs[0].efforts[0][1], runs[0].closed_loop.lead), (2.0, 1.0));
    ///
    /// // without a known motion there must be commands
    /// assert!(EffortTracks::new(&models::Pendulum, &tracks, None).is_err());
    /// # Ok::<(), regen_response::TrackError>(())
    /// ```
    pub fn new<M: Model<f64> + ?Sized>(
        model: &M,
        tracks: &'a [Track],
        known: Option<KnownReference<'a>>,
    ) -> Result<Self, TrackError> {
        let info = model.info();
        let own: Result<Vec<_>, _> = tracks.iter().map(|track| efforts(track, &info)).collect();
        let references = if let Some(known) = known {
            References::Known(known)
        } else {
            let commanded = tracks.iter().map(|track| Commanded::new(model, track));
            References::Commanded(commanded.collect::<Result<_, _>>()?)
        };
        Ok(Self {
            tracks,
            efforts: own?,
            references,
        })
    }

    /// One run for each track.
    ///
    /// - `controllers`: the controllers of a track, by its number from 0.
    pub fn runs<'b>(
        &'b self,
        controllers: impl Fn(usize) -> Controllers<'b>,
    ) -> Vec<EffortRun<'b>> {
        let of_track = |(k, track): (usize, &'b Track)| {
            let (reference, lead) = match &self.references {
                References::Known((reference, lead)) => (*reference, *lead),
                References::Commanded(all) => (all.get(k)? as &(dyn Reference + Sync), 0.0),
            };
            Some(EffortRun {
                times: &track.times,
                efforts: self.efforts.get(k)?,
                positions: &track.positions,
                closed_loop: ClosedLoop {
                    reference,
                    lead,
                    controllers: controllers(k),
                },
            })
        };
        self.tracks
            .iter()
            .enumerate()
            .filter_map(of_track)
            .collect()
    }
}
