//! The loops that DIDIM simulates, with the bandwidth of controllers that are not known.

use regen_experiment::closed_loop::nearest_bandwidth;
use regen_identify::data::Track;
use regen_runtime::BaseModel;

use crate::departure::motion_distance;
use crate::didim::EffortRun;
use crate::effort_tracks::{EffortTracks, KnownReference};
use crate::logs::TrackError;
use crate::track_controllers::TrackControllers;

/// The bandwidth of tuned controllers if it is not given and logs have no positions to choose it by,
/// Hz.
const BANDWIDTH_HZ: f64 = 3.0;

/// The loops of several logs, as they are to be simulated.
pub struct SimulatedLoops<'a> {
    tracks: EffortTracks<'a>,
    controllers: &'a TrackControllers<'a>,
    bandwidth: f64,
    /// The time at the start of each log whose efforts are not used, s: 0 along a known motion.
    pub settle: f64,
}

impl<'a> SimulatedLoops<'a> {
    /// Chooses what is not known of the loops by the positions of the logs: whether a known motion
    /// begins with all of them or was repeated before, and the bandwidth of controllers without gains.
    ///
    /// - `known`: the motion that was commanded in all tracks, with its period, s; `None`: the commands
    ///   that the tracks contain;
    /// - `bandwidth`: Hz, if it is given;
    /// - `settle`: the time at the start of logs with commands whose efforts are not used, s;
    /// - `values`: the base parameters to simulate each track with, r.
    ///
    /// # Errors
    /// As [`EffortTracks::new`].
    ///
    /// ```
    /// # mod models {
    /// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
    /// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
    /// # }
    /// use regen_experiment::closed_loop::{ClosedLoop, Controllers, follow};
    /// use regen_identify::data::Track;
    /// use regen_response::{SimulatedLoops, TrackControllers};
    /// use regen_runtime::Model;
    ///
    /// let swing = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
    ///     (q[0], qd[0], qdd[0]) = (t.sin(), t.cos(), -t.sin());
    /// };
    /// let times: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
    /// for lead in [0.0, core::f64::consts::TAU] {
    ///     let controllers = Controllers::Tuned { bandwidth: 2.0, given: &[] };
    ///     let ran = ClosedLoop { reference: &swing, lead, controllers };
    ///     let log = follow(&models::Pendulum, &ran, &[0.5, 2.0], &times)?;
    ///     let tracks = [Track {
    ///         times: times.clone(),
    ///         positions: vec![(0, log.q)],
    ///         efforts: vec![(0, log.effort)],
    ///         ..Track::default()
    ///     }];
    ///     let info = Model::<f64>::info(&models::Pendulum);
    ///     let own = TrackControllers::new(&[None], &[], &info);
    ///     let known = Some((&swing as _, core::f64::consts::TAU));
    ///     let (pendulum, values) = (&models::Pendulum, [vec![0.5, 2.0]]);
    ///     let loops = SimulatedLoops::choose(pendulum, &tracks, known, &own, None, 0.5, &values)?;
    ///     assert!((loops.bandwidth().unwrap() - 2.0).abs() < 0.1);
    ///     assert_eq!((loops.settle, loops.runs()[0].closed_loop.lead), (0.0, lead));
    /// }
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn choose<M: BaseModel<f64> + ?Sized + Sync>(
        model: &M,
        tracks: &'a [Track],
        known: Option<KnownReference<'a>>,
        controllers: &'a TrackControllers<'a>,
        bandwidth: Option<f64>,
        settle: f64,
        values: &[Vec<f64>],
    ) -> Result<Self, TrackError> {
        let settle = if known.is_some() { 0.0 } else { settle };
        let with = |known: Option<KnownReference<'a>>| -> Result<Self, TrackError> {
            let mut own = Self {
                tracks: EffortTracks::new(model, tracks, known)?,
                controllers,
                bandwidth: bandwidth.unwrap_or(BANDWIDTH_HZ),
                settle,
            };
            if bandwidth.is_none() {
                own.choose_bandwidth(model, tracks, values);
            }
            Ok(own)
        };
        let Some((motion, period)) = known else {
            return with(None);
        };
        let repeated = with(Some((motion, period)))?;
        let begun = Self {
            tracks: EffortTracks::new(model, tracks, Some((motion, 0.0)))?,
            ..repeated
        };
        let distance = |own: &Self| motion_distance(model, &own.runs(), settle, values);
        let is_begun = match (distance(&repeated), distance(&begun)) {
            (Some(repeated), Some(begun)) => begun < repeated,
            (None, Some(_)) => true,
            (_, None) => false,
        };
        if is_begun {
            with(Some((motion, 0.0)))
        } else {
            Ok(repeated)
        }
    }

    /// Sets the bandwidth of tuned controllers to that with which the simulated motion is nearest to the
    /// measured one; leaves it where none is.
    fn choose_bandwidth<M: BaseModel<f64> + ?Sized + Sync>(
        &mut self,
        model: &M,
        tracks: &[Track],
        values: &[Vec<f64>],
    ) {
        let times = tracks.first().map(|track| track.times.as_slice());
        let (true, Some([first, second, ..])) = (self.controllers.are_tuned(), times) else {
            return;
        };
        let found = nearest_bandwidth(second - first, &mut |hertz| {
            let runs = self.tracks.runs(|track| self.controllers.of(track, hertz));
            motion_distance(model, &runs, self.settle, values)
        });
        self.bandwidth = found.unwrap_or(self.bandwidth);
    }

    /// The bandwidth of tuned controllers, Hz; `None` where all controllers are known.
    pub fn bandwidth(&self) -> Option<f64> {
        self.controllers.are_tuned().then_some(self.bandwidth)
    }

    /// One run for each track.
    pub fn runs(&self) -> Vec<EffortRun<'_>> {
        self.tracks
            .runs(|track| self.controllers.of(track, self.bandwidth))
    }
}
