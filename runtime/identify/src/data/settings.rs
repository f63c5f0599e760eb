//! How logs are read.

use super::bridge::Bridging;
use super::columns::Assignment;
use super::policy::{Checks, Gaps, Policies, Policy, UsedFaults};
use super::table::Format;
use crate::signals::Method;
use crate::states::{Filtering, Standstill};

/// How logs are read, checked and differentiated.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Assignments of columns whose headers do not name their quantities; of several for the same
    /// quantity the first one counts.
    pub columns: Vec<Assignment>,
    /// How CSV files are written.
    pub format: Format,
    /// The topic of recordings that is read, in place of those of the runs.
    pub topic: Option<String>,
    /// The episode of files of LeRobot that is read, in place of those of the runs.
    pub episode: Option<u64>,
    /// Whether each row is a pose at rest, with efforts that were averaged there: no time is read,
    /// velocities and accelerations are 0, and rows that differ much from their neighbours are no faults.
    pub poses: bool,
    /// The rate of the rows, Hz, where no column has their time: the first row of a file is at 0.
    pub rate: Option<f64>,
    /// The rate of an even grid of times, Hz, onto which the rows are interpolated.
    pub resample: Option<f64>,
    /// Whether columns of measured velocities and accelerations are used; `None` if they are unless the
    /// choice from the logs finds those computed from the positions better.
    pub measured_rates: Option<bool>,
    /// How positions are differentiated, and what filter efforts and regressor pass. Measured
    /// velocities pass the filter of the positions, and accelerations are their derivative; with a
    /// Fourier series, velocities and accelerations are those of the series of the positions. Where
    /// accelerations are measured too, velocities and accelerations are used as they are.
    pub method: Method,
    /// Who decided on the method.
    pub method_by: Decision,
    /// What is done with faulty rows.
    pub policy: Policy,
    /// What is done with doubtful rows, where it differs from `policy`.
    pub checks: Checks,
    /// Decimation ratio: one of this many states gives equations; at least 1.
    pub decimation: usize,
    /// The period in s of a trajectory that is run several times: the runs are averaged, and their
    /// variance gives the rows' weights.
    pub period: Option<f64>,
    /// Standard deviations of positions by coordinate, rad or m, where more coordinates are
    /// measured than needed; 1 for those not named.
    pub deviations: Vec<(String, f64)>,
    /// What is done with equations of coordinates at rest. A coordinate is at rest if its raw
    /// positions stay within the encoder's step or noise for 0.2 s, or if its velocity is within
    /// two standard deviations of zero or reverses within the samples that it is computed from.
    pub standstill: Standstill,
    /// The speed below which a coordinate counts as resting too, rad/s or m/s.
    pub rest_speed: f64,
    /// By how many seconds efforts are logged after the motion that they belong to, by
    /// coordinate; 0 for those not named.
    pub delays: Vec<(String, f64)>,
    /// Whether the delays were found from the same logs: how uncertain they are then is part of the
    /// deviations of parameters.
    pub are_delays_found: bool,
}

/// Who decided how positions are differentiated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Decision {
    /// No one: a filter is chosen from the logs where one can be.
    #[default]
    Open,
    /// A person, by an option or an experiment file.
    Given,
    /// The choice from the same logs, which compared the filter with others.
    Chosen,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            columns: Vec::new(),
            format: Format::default(),
            topic: None,
            episode: None,
            poses: false,
            rate: None,
            resample: None,
            measured_rates: None,
            method: Method::Central,
            method_by: Decision::Open,
            policy: Policy::Fail,
            checks: Checks::default(),
            decimation: 1,
            period: None,
            deviations: Vec::new(),
            standstill: Standstill::Drop,
            rest_speed: 0.0,
            delays: Vec::new(),
            are_delays_found: false,
        }
    }
}

impl Settings {
    /// What is done with each kind of fault.
    pub fn policies(&self) -> Policies {
        Policies {
            all: self.policy,
            checks: self.checks,
        }
    }

    /// Gives currents of unknown gain these gains, N m/A or N/A, by coordinate; those not named are
    /// read in A.
    ///
    /// ```
    /// use regen_identify::data::{Assignment, Settings};
    ///
    /// let current = Assignment { gain: None, .."tau_q1=i1:mA*1".parse()? };
    /// let settings = Settings { columns: vec![current], ..Settings::default() };
    /// let columns = settings.clone().with_gains(&[("q1".to_owned(), 4.0)]).columns;
    /// assert_eq!((columns[0].gain, columns[0].factor), (Some(4.0), 4e-3));
    /// let columns = settings.with_gains(&[]).columns;
    /// assert_eq!((columns[0].gain, columns[0].factor), (Some(1.0), 1e-3));
    /// # Ok::<(), regen_identify::data::AssignmentError>(())
    /// ```
    #[must_use]
    pub fn with_gains(mut self, gains: &[(String, f64)]) -> Self {
        for column in &mut self.columns {
            if column.is_current() && column.gain.is_none() {
                let name = column.quantity.coordinate();
                let known = gains.iter().find(|(own, _)| Some(own.as_str()) == name);
                let gain = known.map_or(1.0, |(_, gain)| *gain);
                column.factor *= gain;
                column.gain = Some(gain);
            }
        }
        self
    }

    /// The filter that efforts and regressor pass, the decimation, and what is done at standstill.
    pub fn filtering(&self) -> Filtering {
        Filtering {
            smoothing: self.method.smoothing(),
            decimation: self.decimation,
            standstill: self.standstill,
        }
    }

    /// How gaps and dropouts are bridged; `None` if the log is divided at all of them. The rows of
    /// several periods are averaged instead.
    pub(super) fn bridging(&self) -> Option<Bridging> {
        let bridges = self.checks.gaps == Gaps::Bridge && self.period.is_none() && !self.poses;
        Bridging::of(self.method, self.resample.is_none()).filter(|_| bridges)
    }

    pub(super) fn used_faults(&self) -> UsedFaults {
        self.policies().used_faults()
    }
}
