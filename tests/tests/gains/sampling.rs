//! What the sampling of the motion leaves unknown, in the deviations of gains and payloads.

use super::*;
use regen_identify::estimate::EstimateError;
use regen_identify::gains::instrumental;
use regen_identify::identify::{
    ChangedEfforts, Filtering, InstrumentOptions, MotionSeries, Source as LogSource,
};

/// A log whose efforts change as if the base parameters were other ones, with other derivatives of its
/// positions.
struct Sampled<'m> {
    model: &'m Interpreted<'m>,
    log: Recorded,
    /// By how much each base parameter seems to change.
    change: Vec<f64>,
    /// Whether the instruments' motion was passed.
    along: Option<bool>,
}

impl LogSource for Sampled<'_> {
    type Error = EstimateError;

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), EstimateError> {
        self.log.visit(each)
    }

    fn filtering(&self) -> Filtering {
        self.log.filtering()
    }

    fn changed_efforts(
        &mut self,
        _: &[f64],
        motion: Option<&MotionSeries>,
        each: &mut dyn FnMut(&ChangedEfforts<'_>),
    ) -> Result<(), EstimateError> {
        self.along = Some(motion.is_some_and(|own| own.len() == SAMPLES as usize));
        let (model, delta) = (self.model, &self.change);
        let mut w = vec![0.0; model.info().dof() * delta.len()];
        self.log.visit(&mut |row| {
            let _ = model.base_regressor(row.q, row.qd, row.qdd, &mut w)?;
            let rows = DMatrix::from_column_slice(model.info().dof(), delta.len(), &w);
            let change = rows * DVector::from_column_slice(delta);
            each(&ChangedEfforts {
                q: row.q,
                w: &w,
                change: change.as_slice(),
            });
            Ok(())
        })
    }
}

/// Checks that the deviations of a fit with changes are those of one without, and the changes.
fn check_added(plain: &GainFit, sampled: &GainFit, change: &[f64], labels: &[&str]) {
    let own = &plain.estimate.labels;
    let n = own.len();
    let expected: Vec<f64> = own
        .iter()
        .map(|label| labels.iter().position(|l| l == label))
        .map(|place| place.map_or(0.0, |k| change[k]))
        .collect();
    assert!(expected.iter().any(|x| *x != 0.0) && expected.contains(&0.0));
    for i in 0..n {
        for j in 0..n {
            let covariance = |fit: &GainFit| fit.deviations.covariance[i * n + j];
            let added = covariance(sampled) - covariance(plain);
            let size = (covariance(sampled).abs()).max((expected[i] * expected[j]).abs());
            // a thousandth of the whole log stands for no change
            assert!(
                (added - expected[i] * expected[j]).abs() <= 4e-3 * size + 1e-15,
                "{} {}: {added:e} {:e}",
                own[i],
                own[j],
                expected[i] * expected[j]
            );
        }
    }
    assert!(!plain.model.intervals.method.contains("sampling"));
    let method = &sampled.model.intervals.method;
    assert!(
        method.contains("; and what sampling leaves unknown of the motion"),
        "{method}"
    );
}

fn sampling_is_added(robot: &Robot, gain: &[f64], mass: f64) {
    let terms = BaseTerms::new(robot);
    let model = Interpreted::with_terms(robot, &terms);
    let twin = Twin::new(&model, gain);
    let plan = unknown(&twin, Some(mass));
    let labels: Vec<&str> = model.base_info().base.iter().map(|b| b.label).collect();
    let mut change: Vec<f64> = (0..labels.len()).map(|k| 0.02 + 0.003 * k as f64).collect();
    for k in twin.load() {
        change[k] = 0.0;
    }
    let sampled = || {
        twin.runs(3).map(|log| Sampled {
            model: &model,
            log,
            change: change.clone(),
            along: None,
        })
    };
    let carried_by = |run: usize| (run == 1).then_some(0);

    let plain = twin.fit(&plan, 3).unwrap();
    let mut logs = sampled();
    let mut own = logs.iter_mut().enumerate();
    let mut runs: Vec<CarriedRun<'_, Sampled<'_>>> = own
        .by_ref()
        .map(|(run, source)| CarriedRun {
            source,
            carried: carried_by(run),
        })
        .collect();
    let found = fit(&model, &GainOptions::default(), &plan, &mut runs).unwrap();
    check_added(&plain, &found, &change, &labels);
    assert!(logs.iter().all(|own| own.along == Some(false)));

    let motions = || {
        let all = twin.runs(3);
        Some(all.map(|mut log| MotionSeries::recorded(&model, &mut log).unwrap()))
    };
    let options = (&InstrumentOptions::default(), 0.95);
    let mut own = motions().map(Vec::from);
    let plain = instrumental(
        &model,
        options,
        &plan,
        &mut carried(&mut twin.runs(3)),
        &mut [&mut |_| Ok(own.take())],
    );
    let mut logs = sampled();
    let runs = logs.iter_mut().enumerate();
    let mut runs: Vec<CarriedRun<'_, Sampled<'_>>> = runs
        .map(|(run, source)| CarriedRun {
            source,
            carried: carried_by(run),
        })
        .collect();
    let mut own = motions().map(Vec::from);
    let found = instrumental(
        &model,
        options,
        &plan,
        &mut runs,
        &mut [&mut |_| Ok(own.take())],
    );
    check_added(&plain.unwrap().fit, &found.unwrap().fit, &change, &labels);
    assert!(logs.iter().all(|own| own.along == Some(true)));
}

#[test]
fn changes_by_sampling_are_in_the_deviations_of_an_arm_and_its_gains() {
    sampling_is_added(&arm(), &[12.0, 9.0, 5.0], 2.2);
}

#[test]
fn changes_by_sampling_are_in_the_deviations_where_drives_move_dependent_coordinates() {
    let robot = fivebar("independent: [q1, q2]\n");
    sampling_is_added(&robot, &[4.0, 3.0], 0.7);
}
