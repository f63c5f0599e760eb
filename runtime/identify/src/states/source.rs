//! A log as the steps after reading see it: samples of all coordinates with their efforts.

use super::{Filtering, MotionSeries};
use crate::estimate::EstimateError;

/// One sample of a log: the state of motion of all n coordinates with its efforts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSample<'a> {
    /// Time, s.
    pub time: f64,
    /// All n coordinates in the model's order, rad or m.
    pub q: &'a [f64],
    /// Their n velocities, rad/s or m/s.
    pub qd: &'a [f64],
    /// Their n accelerations, rad/s^2 or m/s^2; not used by energy balances.
    pub qdd: &'a [f64],
    /// The left side of Eq. 10, `dof` entries in the order of `Info::independent`, N or N m: see
    /// [`Model::generalized_forces`](regen_runtime::Model::generalized_forces).
    pub tau: &'a [f64],
    /// The efforts of the actuated joints as they were measured, in the order of
    /// `Info::actuated`, N or N m; empty where they are not known.
    pub efforts: &'a [f64],
    /// For each of the actuated joints the residual of its effort with the right parameters if the
    /// controller holds efforts from row to row, N or N m; empty where accelerations are not computed
    /// from sampled motion.
    pub held: &'a [f64],
    /// For each of the n coordinates, whether it is at rest, or moves so slowly that noise decides on
    /// the direction of its friction; empty where that is not known.
    pub at_standstill: &'a [bool],
    /// The weight of each equation of this sample, `dof` entries, which multiplies the weight of
    /// the effort; an energy balance has the first entry of the sample at which its window starts. An
    /// equation of weight 0 has an effort without a value here, which no filter passes on to others.
    pub weights: &'a [f64],
    /// Whether the sample follows the one before it without a gap.
    pub follows: bool,
    /// Whether its motion or its efforts are interpolated across a gap in the log: it keeps a filter
    /// going, and gives no equation.
    pub bridged: bool,
}

/// A log that can be read any number of times: each pass of the identification reads it once.
pub trait Source {
    /// The error of reading the log.
    type Error: From<EstimateError>;

    /// Passes all rows to `each` in order of time.
    ///
    /// # Errors
    /// When the log cannot be read, and the errors of `each`.
    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), Self::Error>;

    /// How the equations of the rows are filtered, decimated and left out at standstill.
    fn filtering(&self) -> Filtering;

    /// The density of the noise of each effort near the highest frequency that the filter passes, (N or N m)^2 s, in the
    /// order of `Info::actuated`: the variance of white noise times the step of its samples. None where it is not
    /// known, as here.
    ///
    /// # Errors
    /// When the log cannot be read.
    fn effort_densities(&self) -> Result<Vec<f64>, Self::Error> {
        Ok(Vec::new())
    }

    /// Says whether states at some of the rows suffice, as they do for equations behind the filter; returns
    /// the number of rows to one state. A source gives all states unless this admits fewer, or always, as here.
    fn allow_fewer_states(&mut self, are_allowed: bool) -> usize {
        let _ = are_allowed;
        1
    }

    /// Passes some hundred states, each with the change of its predicted efforts if the same positions
    /// are differentiated in another way: what sampling leaves unknown of the motion. There are none
    /// where motion is not differentiated from positions, as here.
    ///
    /// - `beta`: the r base parameters that predict the efforts, SI;
    /// - `motion`: for [`instrumental`](crate::identify::instrumental) variables their motion, in place of the
    ///   measured one, whose noise both ways of differentiation would pass to different extents. A log
    ///   whose motion is a series or the average of its periods is compared as it was measured.
    ///
    /// # Errors
    /// When the log cannot be read, or the motion is not that of the model, and the errors of `each`.
    fn changed_efforts(
        &mut self,
        beta: &[f64],
        motion: Option<&MotionSeries>,
        each: &mut dyn FnMut(&ChangedEfforts<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), Self::Error> {
        let _ = (beta, motion, each);
        Ok(())
    }
}

/// A state at which positions were differentiated in two ways.
#[derive(Clone, Copy, Debug)]
pub struct ChangedEfforts<'a> {
    /// The positions of all coordinates, rad or m.
    pub q: &'a [f64],
    /// The velocities of all coordinates, rad/s or m/s, and those with the other derivatives.
    pub qd: [&'a [f64]; 2],
    /// The base regressor, dof x r, column-major, SI.
    pub w: &'a [f64],
    /// The predicted efforts less those with the other derivatives, dof, N m or N. The positions of
    /// both are nearly the same.
    pub change: &'a [f64],
    /// The number of rows of the log for which the state stands.
    pub rows: f64,
}
