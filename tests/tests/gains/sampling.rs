//! What the sampling of the motion leaves unknown, in the deviations of gains and payloads.

use super::*;
use regen_identify::estimate::EstimateError;
use regen_identify::gains::instrumental;
use regen_identify::identify::InstrumentOptions;
use regen_identify::states::{ChangedEfforts, Filtering, MotionSeries, Source as LogSource};

/// A log whose efforts change with other derivatives of its positions, and if they are held.
struct Sampled<'m> {
    model: &'m Interpreted<'m>,
    log: Recorded,
    /// The parameters that were passed, and whether the instruments' motion was.
    asked: Option<(Vec<f64>, bool)>,
}

/// A row of a log: the positions, the regressor, the change of its efforts by other derivatives, and
/// what is left of its currents if they are held.
type Row = (Vec<f64>, DMatrix<f64>, [DVector<f64>; 2]);

fn held(dof: usize, time: f64) -> DVector<f64> {
    DVector::from_fn(dof, |i, _| 0.02 * (5.0 * time + 2.0 * i as f64).cos())
}

fn rows(model: &Interpreted<'_>, log: &mut Recorded) -> Vec<Row> {
    let (dof, r) = (model.info().dof(), model.rank());
    let mut out = Vec::new();
    log.visit(&mut |row| {
        let mut w = vec![0.0; dof * r];
        let _ = model.base_regressor(row.q, row.qd, row.qdd, &mut w)?;
        let change = DVector::from_fn(dof, |i, _| {
            0.03 * row.qdd[i] + 0.2 * (7.0 * row.time + i as f64).sin()
        });
        let changes = [change, held(dof, row.time)];
        out.push((row.q.to_vec(), DMatrix::from_vec(dof, r, w), changes));
        Ok(())
    })
    .unwrap();
    out
}

impl LogSource for Sampled<'_> {
    type Error = EstimateError;

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), EstimateError> {
        let dof = self.model.info().dof();
        self.log.visit(&mut |row| {
            each(&StateSample {
                held: held(dof, row.time).as_slice(),
                ..*row
            })
        })
    }

    fn filtering(&self) -> Filtering {
        self.log.filtering()
    }

    fn changed_efforts(
        &mut self,
        beta: &[f64],
        motion: Option<&MotionSeries>,
        each: &mut dyn FnMut(&ChangedEfforts<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), EstimateError> {
        let along = motion.is_some_and(|own| own.len() == SAMPLES as usize);
        self.asked = Some((beta.to_vec(), along));
        for (q, w, [change, _]) in rows(self.model, &mut self.log) {
            each(&ChangedEfforts {
                q: &q,
                qd: [&[], &[]],
                w: w.as_slice(),
                change: change.as_slice(),
                rows: 1.0,
            })?;
        }
        Ok(())
    }
}

/// The generalized forces of a unit effort of each drive.
fn forces(model: &Interpreted<'_>, q: &[f64]) -> DMatrix<f64> {
    let dof = model.info().dof();
    let mut all = DMatrix::zeros(dof, dof);
    for k in 0..dof {
        let unit: Vec<f64> = (0..dof).map(|i| if i == k { 1.0 } else { 0.0 }).collect();
        let mut column = vec![0.0; dof];
        let _ = model.generalized_forces(q, &unit, &mut column).unwrap();
        all.set_column(k, &DVector::from_vec(column));
    }
    all
}

/// The changes of robot's parameters and gains, by least squares of the linearised equations of both runs
/// written out.
fn expected(twin: &Twin<'_>, found: &GainFit, logs: [Recorded; 2]) -> [Vec<f64>; 2] {
    let (model, load) = (twin.model, twin.load());
    let robot: Vec<usize> = (0..model.rank()).filter(|k| !load.contains(k)).collect();
    let gains: Vec<f64> = found.model.gains.iter().map(|gain| gain.value).collect();
    let (m, n) = (robot.len(), robot.len() + gains.len());
    assert_eq!(found.estimate.labels.len(), n);
    let (mut products, mut sides) = (DMatrix::zeros(n, n), DMatrix::zeros(n, 2));
    for (run, mut log) in logs.into_iter().enumerate() {
        let mut x = DVector::from_column_slice(&found.model.beta);
        if run == 0 {
            for k in &load {
                x[*k] = 0.0;
            }
        }
        for (q, w, [change, held]) in rows(model, &mut log) {
            let solved = forces(model, &q).lu();
            let (w, change) = (solved.solve(&w).unwrap(), solved.solve(&change).unwrap());
            let efforts = &w * &x;
            for (i, gain) in gains.iter().enumerate() {
                // the weight in the unit of the current
                let weight = found.estimate.efforts[i].weight * gain.abs();
                let mut row = DVector::zeros(n);
                for (column, place) in robot.iter().enumerate() {
                    row[column] = weight * w[(i, *place)] / gain;
                }
                row[m + i] = -weight * efforts[i] / (gain * gain);
                let own = [weight * change[i] / gain, weight * held[i]];
                sides += &row * DMatrix::from_row_slice(1, 2, &own);
                products += &row * row.transpose();
            }
        }
    }
    let found = products.lu().solve(&sides).unwrap();
    // a thousandth of the whole log stands for no change by derivatives
    [
        (found.column(0) / 1.001).as_slice().to_vec(),
        found.column(1).as_slice().to_vec(),
    ]
}

/// Checks that the deviations of a fit with changes are those of one without, and the changes.
fn check_added(plain: &GainFit, sampled: &GainFit, changes: &[Vec<f64>; 2]) {
    let n = changes[0].len();
    for i in 0..n {
        for j in 0..n {
            let covariance = |fit: &GainFit| fit.deviations.covariance[i * n + j];
            let added = covariance(sampled) - covariance(plain);
            let expected: f64 = changes.iter().map(|own| own[i] * own[j]).sum();
            let size = covariance(sampled).abs().max(expected.abs());
            assert!(
                (added - expected).abs() <= 1e-6 * size,
                "{} {}: {added:e} {expected:e}",
                plain.estimate.labels[i],
                plain.estimate.labels[j],
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

/// The runs without and with the load.
fn both<'a, 'm>(logs: &'a mut [Sampled<'m>; 2]) -> [CarriedRun<'a, Sampled<'m>>; 2] {
    let [free, loaded] = logs;
    [(free, None), (loaded, Some(0))].map(|(source, carried)| CarriedRun { source, carried })
}

fn sampling_is_added(robot: &Robot, gains: &[f64], known: &KnownPayload) {
    let terms = BaseTerms::new(robot);
    let model = Interpreted::with_terms(robot, &terms);
    let twin = Twin::new(&model, gains);
    let plan = Plan {
        unknown_gains: twin.names(),
        payloads: vec![known.clone()],
        robot: None,
    };
    let sampled = || {
        twin.runs(3).map(|log| Sampled {
            model: &model,
            log,
            asked: None,
        })
    };
    let check = |plain: &GainFit, found: &GainFit, logs: &[Sampled<'_>; 2], along: bool| {
        check_added(plain, found, &expected(&twin, found, twin.runs(3)));
        for (run, log) in logs.iter().enumerate() {
            let (beta, motion) = log.asked.as_ref().unwrap();
            assert_eq!(*motion, along);
            let carries = |k: &usize| beta[*k] != 0.0;
            assert_eq!(twin.load().iter().any(carries), run == 1);
        }
    };

    let plain = twin.fit(&plan, 3).unwrap();
    let mut logs = sampled();
    let found = fit(&model, &GainOptions::default(), &plan, &mut both(&mut logs)).unwrap();
    check(&plain, &found, &logs, false);

    let motions = twin.runs(3);
    let motions = motions.map(|mut log| MotionSeries::recorded(&model, &mut log).unwrap());
    let options = (&InstrumentOptions::default(), 0.95);
    let mut own = Some(motions.to_vec());
    let mut runs = twin.runs(3);
    let plain = instrumental(
        &model,
        options,
        &plan,
        &mut carried(&mut runs),
        &mut [&mut |_| Ok(own.take())],
    );
    let mut own = Some(motions.to_vec());
    let mut logs = sampled();
    let found = instrumental(
        &model,
        options,
        &plan,
        &mut both(&mut logs),
        &mut [&mut |_| Ok(own.take())],
    );
    check(&plain.unwrap().fit, &found.unwrap().fit, &logs, true);
}

#[test]
fn changes_by_sampling_are_in_the_deviations_of_an_arm_and_its_gains() {
    let load = KnownPayload {
        mass: Some(2.2),
        com: Some([0.02, 0.01, 0.04]),
        inertia: Some([0.006, 0.001, 0.0, 0.007, 0.0, 0.004]),
        ..known(None)
    };
    sampling_is_added(&arm(), &[8.0, -12.0, 3.0], &load);
}

#[test]
fn changes_by_sampling_are_in_the_deviations_where_drives_move_dependent_coordinates() {
    let load = KnownPayload {
        mass: Some(0.7),
        com: Some([0.02, 0.01, 0.03]),
        inertia: Some([0.001, 0.0, 0.0, 0.002, 0.0, 0.0015]),
        ..known(None)
    };
    let robot = fivebar("independent: [q1, q2]\n");
    sampling_is_added(&robot, &[4.0, 3.0], &load);
}
