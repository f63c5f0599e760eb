//! States at some of the rows only, where a filter of a far lower cutoff follows.
//!
//! Neither the positions behind the filter nor the equations behind it have high frequencies: states at every row of
//! a fast log are as many times the work for the same estimate. Positions and efforts pass a filter below half the
//! rate of the states that remain before, so that noise of high frequencies does not appear at lower ones.

use super::logs::{Log, Logs};
use super::problem::DataError;
use super::thinned::filter_before;
use crate::signals::{Butterworth, Method};
use crate::states::{depends_on_direction, nonlinear_joints};
use regen_runtime::BaseModel;

/// The least rate of the states over the cutoff of the filter: at three times the cutoff, to where the positions
/// reach, the filter before changes them by a ten-thousandth.
const RATE_PER_CUTOFF: f64 = 20.0;
/// The same where friction changes its sign with the velocity: the instant of the change is known to a state.
const RATE_WITH_FRICTION: f64 = 100.0;

/// States at one of so many rows, and the filter that their signals pass before.
pub(super) struct FewerStates {
    pub(super) every: usize,
    pub(super) filter: Butterworth,
}

impl<M: BaseModel<f64> + ?Sized> Logs<'_, M> {
    /// The number of rows to one state.
    pub(crate) fn states_every(&self) -> usize {
        self.states_every
    }

    /// The largest number of rows to one state that the filter and its decimation admit; without decimation, the
    /// equations of so many rows would be averaged, and a mean of few rows passes more noise of high frequencies, of
    /// which accelerations have most, than the filter before states does.
    pub(super) fn fewest_states(&self) -> usize {
        let Method::Butterworth { cutoff, .. } = self.settings.method else {
            return 1;
        };
        let is_measured = |log: &Log| log.file.layout.derivatives || log.series.is_some();
        let settings = &self.settings;
        if settings.period.is_some()
            || settings.poses
            || self.files.iter().any(is_measured)
            || !nonlinear_joints(self.model).is_empty()
        {
            return 1;
        }
        let has_friction = self.model.info().joints.iter().any(depends_on_direction);
        let rate = cutoff
            * if has_friction {
                RATE_WITH_FRICTION
            } else {
                RATE_PER_CUTOFF
            };
        let steps = self.files.iter().map(|log| log.survey.time_step());
        let step = steps.fold(0.0, f64::max);
        let most = 1.0 / (rate * step);
        let equations = match settings.decimation {
            0 | 1 => settings.filtering().averaged(step),
            given => given,
        };
        (1..=equations)
            .rev()
            .find(|every| equations.is_multiple_of(*every) && *every as f64 <= most)
            .unwrap_or(1)
    }

    /// The states that are computed of a log; `None` if there is one at each row.
    pub(super) fn fewer_states(&self, log: &Log) -> Result<Option<FewerStates>, DataError> {
        let every = self.states_every;
        if every == 1 {
            return Ok(None);
        }
        let filter = filter_before(log, every)?;
        Ok(Some(FewerStates { every, filter }))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::data::Settings;
    use crate::estimate::EstimateError;
    use crate::identify::{EquationKind, Identified, Options, identify};
    use crate::states::{Filtering, Source, StateSample};
    use crate::suspect::swings_for_tests::{Swings, swings, written};
    use regen_runtime::Friction;

    const FAST: f64 = 1.0;

    fn with(cutoff: f64, decimation: usize) -> Settings {
        Settings {
            method: Method::Butterworth { order: 2, cutoff },
            decimation,
            ..Settings::default()
        }
    }

    /// Logs whose every state is computed.
    struct AllStates<'m>(Logs<'m, Swings>);

    impl Source for AllStates<'_> {
        type Error = DataError;

        fn filtering(&self) -> Filtering {
            self.0.filtering()
        }

        fn visit(
            &mut self,
            each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
        ) -> Result<(), DataError> {
            self.0.visit(each)
        }
    }

    fn solved(logs: &mut impl Source<Error = DataError>) -> Identified {
        let model = swings(false);
        identify(&model, EquationKind::Forces, &Options::default(), logs).unwrap()
    }

    #[test]
    fn fewer_states_give_the_same_estimate() {
        let model = swings(false);
        let run = written("fewer", 6000, 0.0, |_| true);
        // without decimation, those of the equations
        for (cutoff, decimation, rows_to_a_state) in [(FAST, 10, 10), (0.9 * FAST, 1, 4)] {
            let settings = with(cutoff, decimation);
            let open = || Logs::open(&model, std::slice::from_ref(&run.0), &settings).unwrap();
            let mut every = AllStates(open());
            let all = solved(&mut every);
            let rows = every.0.reports()[0].states;
            let mut logs = open();
            assert_eq!(logs.fewest_states(), rows_to_a_state);
            let fewer = solved(&mut logs);
            // each counts as its rows
            assert!(logs.reports()[0].states.abs_diff(rows) < 200);
            assert_eq!(
                logs.states_every(),
                1,
                "whatever does not ask for less gets all"
            );
            let (few, many) = (fewer.left_out.samples, all.left_out.samples);
            assert!(few.abs_diff(many) < 20, "{few} {many}");
            let pairs = all.estimate.values.iter().zip(&fewer.estimate.values);
            for (k, (a, b)) in pairs.enumerate() {
                let sigma = all.deviations.sigma(k);
                assert!((a - b).abs() < 0.3 * sigma, "{k}: {a} {b} {sigma}");
                let ratio = fewer.deviations.sigma(k) / sigma;
                assert!((0.7..1.4).contains(&ratio), "{k}: {ratio}");
            }
        }
    }

    #[test]
    fn every_row_has_a_state_where_something_needs_it() {
        let run = written("all-states", 1000, 0.0, |_| true);
        let every = |friction: Friction, settings: Settings| {
            let mut model = swings(false);
            model.joints[1].friction = friction;
            let logs = Logs::open(&model, std::slice::from_ref(&run.0), &settings).unwrap();
            logs.fewest_states()
        };
        let none = Friction::Viscous;
        assert_eq!(every(none, with(FAST, 10)), 10);
        assert_eq!(every(none, with(FAST, 7)), 7);
        assert_eq!(
            every(none, with(FAST, 22)),
            2,
            "ten rows at most, and parts of 22"
        );
        assert_eq!(
            every(none, with(20.0, 10)),
            1,
            "the log has ten times the cutoff"
        );
        assert_eq!(
            every(Friction::Linear, with(FAST, 10)),
            2,
            "friction changes its sign"
        );
        assert_eq!(every(Friction::Stribeck, with(FAST, 10)), 1);
        let central = Settings {
            method: Method::Central,
            ..with(FAST, 10)
        };
        assert_eq!(every(none, central), 1);
    }
}
