//! Makes the runs of DIDIM from the tracks of logs.

use regen_experiment::closed_loop::{ClosedLoop, Controllers};
use regen_experiment::simulate::Reference;
use regen_identify::data::Track;
use regen_runtime::{BaseModel, Model};

use crate::departure::motion_distance;
use crate::didim::EffortRun;
use crate::logs::{Commanded, TrackError, efforts};
use crate::track_controllers::TrackControllers;

/// The motion that a robot was commanded, on the time axis of the logs, and the time for which it is
/// simulated before the first row (s): a period, if the robot repeated the motion.
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

    /// The same, where the motion may have been repeated before the first rows or begin with them:
    /// as is nearer to the measured positions.
    ///
    /// - `known`: the motion, with its period;
    /// - `controllers`: of the tracks, with the bandwidth of tuned ones in Hz;
    /// - `values`: the base parameters to simulate with, r.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    ///
    /// ```
    /// # mod models {
    /// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
    /// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
    /// # }
    /// use regen_experiment::closed_loop::{ClosedLoop, Controllers, follow};
    /// use regen_identify::data::Track;
    /// use regen_response::{EffortTracks, TrackControllers};
    ///
    /// let swing = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
    ///     (q[0], qd[0], qdd[0]) = (t.sin(), t.cos(), -t.sin());
    /// };
    /// let tuned = Controllers::Tuned { bandwidth: 2.0, given: &[] };
    /// let times: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
    /// for lead in [0.0, core::f64::consts::TAU] {
    ///     let ran = ClosedLoop { reference: &swing, lead, controllers: tuned };
    ///     let log = follow(&models::Pendulum, &ran, &[0.5, 2.0], &times)?;
    ///     let tracks = [Track {
    ///         times: times.clone(),
    ///         positions: vec![(0, log.q)],
    ///         efforts: vec![(0, log.effort)],
    ///         ..Track::default()
    ///     }];
    ///     let known = (&swing as _, core::f64::consts::TAU);
    ///     let (pendulum, values) = (&models::Pendulum, [0.5, 2.0]);
    ///     let own = TrackControllers::new(&[None], &[]);
    ///     let along = EffortTracks::along(pendulum, &tracks, known, (&own, 2.0), &values)?;
    ///     assert_eq!(along.runs(|_| tuned)[0].closed_loop.lead, lead);
    /// }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn along<M: BaseModel<f64> + ?Sized + Sync>(
        model: &M,
        tracks: &'a [Track],
        (motion, period): KnownReference<'a>,
        (controllers, bandwidth): (&TrackControllers<'_>, f64),
        values: &[f64],
    ) -> Result<Self, TrackError> {
        let [repeated, begun] =
            [period, 0.0].map(|lead| Self::new(model, tracks, Some((motion, lead))));
        let (repeated, begun) = (repeated?, begun?);
        let distance = |own: &Self| {
            let runs = own.runs(|track| controllers.of(track, bandwidth));
            motion_distance(model, &runs, 0.0, values)
        };
        let is_begun = matches!(
            (distance(&repeated), distance(&begun)),
            (Some(repeated), Some(begun)) if begun < repeated
        );
        Ok(if is_begun { begun } else { repeated })
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
