//! Poses chosen for a calibration: better than poses at random, within limits, reached in order, and
//! judged by the definitions of the indices.

#![allow(clippy::unwrap_used)]
use nalgebra::DMatrix;
use regen_calibrate::{
    Choice, Geometry, Kind, Kinematics, Mounting, Problem, Sensor, Simulation, Split,
};
use regen_codegen::diag::Source;
use regen_codegen::pipeline::Mechanism;
use regen_interpreted::Described;

/// A robot's geometry and its actuated coordinates.
fn described(name: &str) -> (Described, Vec<usize>) {
    let path = format!("{}/../../robots/{name}.yaml", env!("CARGO_MANIFEST_DIR"));
    let source = Source::new(name, std::fs::read_to_string(&path).unwrap());
    let mechanism = Mechanism::open(&source).unwrap();
    let robot = mechanism.robot(&[]).unwrap();
    let described = Described::new(mechanism.spec(), mechanism.model(), &robot);
    (described, mechanism.model().actuated.clone())
}

/// A sensor that stands at the world's origin.
fn sensor(kinematics: &Kinematics, frame: &str, kind: Kind) -> Sensor {
    let mut frames = kinematics.frames.iter();
    Sensor {
        name: "camera".to_owned(),
        kind,
        frame: frames.position(|(own, _)| own == frame).unwrap(),
        mounting: Mounting::WORLD,
        noise: Some(1e-4),
        noise_of_angles: Some(2e-4),
    }
}

/// The Jacobian of the measurements in deviations, from differences of predictions with the loops
/// closed again.
fn differences(
    problem: &Problem<'_>,
    names: &[String],
    split: &Split,
    states: &[Vec<f64>],
) -> DMatrix<f64> {
    let unknowns = problem.geometry.unknowns();
    let nominal: Vec<f64> = unknowns.iter().map(|own| own.nominal).collect();
    let sensor = &problem.sensors[0];
    let seen = |values: &[f64], q: &[f64]| {
        let scalars = problem.geometry.scalars(values).unwrap();
        let q = problem
            .kinematics
            .close(&scalars, split, q.to_vec())
            .unwrap();
        let frames = problem.kinematics.frames(&scalars, &q);
        sensor.predict(&frames, &problem.kinematics.gravity)
    };
    let step = 1e-6;
    let mut columns = Vec::new();
    for name in names {
        let at = unknowns.iter().position(|own| own.name == *name).unwrap();
        let mut column = Vec::new();
        for q in states {
            let ends = [-step, step].map(|step| {
                let mut values = nominal.clone();
                values[at] += step;
                seen(&values, q)
            });
            let slope = |k: usize| (ends[1][k] - ends[0][k]) / (2.0 * step);
            let now = seen(&nominal, q);
            if sensor.kind == Kind::Pose {
                // the turn in the instrument's frame: w of dR R^T
                for (i, j) in [(2, 1), (0, 2), (1, 0)] {
                    let w: f64 = (0..3).map(|k| slope(3 * i + k) * now[3 * j + k]).sum();
                    column.push(w / 2e-4);
                }
            }
            let first = now.len() - if sensor.kind == Kind::Distance { 1 } else { 3 };
            column.extend((first..now.len()).map(|k| slope(k) / 1e-4));
        }
        columns.push(column);
    }
    DMatrix::from_fn(columns[0].len(), columns.len(), |i, k| columns[k][i])
}

#[test]
fn chosen_poses_are_better_than_random_ones_and_their_indices_are_those_of_the_definitions() {
    for (name, frame, kind, poses) in [
        ("puma560", "6", Kind::Pose, 12),
        ("delta", "platform", Kind::Point, 20),
        ("3rps", "3", Kind::Pose, 15),
        ("scara", "4", Kind::Distance, 20),
    ] {
        let (described, measured) = described(name);
        let kinematics = &described.kinematics;
        let sensors = [sensor(kinematics, frame, kind)];
        let geometry = described.with_all_errors(&[sensors[0].frame]);
        let problem = Problem {
            kinematics,
            geometry: &geometry,
            measured: &measured,
            noise_of_readings: &vec![Some(0.0); measured.len()],
            sensors: &sensors,
            tolerance: None,
            efforts: None,
            poses: &[],
        };
        let what = Choice {
            poses,
            margin: 0.05,
            noise: [1e-4, 1e-4],
            seed: 1,
        };
        let chosen = problem.choose(&what).unwrap();
        assert_eq!(chosen.states.len(), poses, "{name}");
        assert_eq!(
            chosen,
            problem.choose(&what).unwrap(),
            "{name}: the same every time"
        );

        // better than at random, and not by a trifle
        let worst = |sigmas: &[f64]| sigmas.iter().copied().fold(0.0, f64::max);
        let (own, random) = (&chosen.design, &chosen.random);
        let count = own.sigmas.len() as f64;
        let gain = (own.log_determinant - random.log_determinant) / count;
        let ratio = worst(&own.sigmas) / worst(&random.sigmas);
        println!("{name}: log det per number + {gain:.3}, worst sigma times {ratio:.3}");
        assert!(gain > 0.05 && ratio < 0.95, "{name}: {gain} {ratio}");

        // the indices, from differences and the definitions
        let scalars = {
            let unknowns = geometry.unknowns().iter();
            geometry
                .scalars(&unknowns.map(|own| own.nominal).collect::<Vec<_>>())
                .unwrap()
        };
        let split = kinematics.split(&scalars, &measured).unwrap();
        let names: Vec<String> = chosen.found.iter().map(|own| own.0.clone()).collect();
        let jacobian = differences(&problem, &names, &split, &chosen.states);
        let normal = jacobian.tr_mul(&jacobian);
        let singular: Vec<f64> = jacobian.singular_values().iter().copied().collect();
        let [least, most] =
            [f64::min, f64::max].map(|of| singular.iter().copied().reduce(of).unwrap());
        let product: f64 = singular.iter().map(|s| s.powf(1.0 / count)).product();
        let o = own.observability;
        for (found, expected) in [
            (o.mean, product / (poses as f64).sqrt()),
            (o.inverse_condition, least / most),
            (o.smallest, least),
            (o.noise_amplification, least * least / most),
            (
                o.harmonic,
                1.0 / singular.iter().map(|s| s.recip()).sum::<f64>(),
            ),
        ] {
            // differences of 1e-6 are exact to some 1e-9, relative to the largest singular value
            let close = 1e-5 * expected + 1e-8 * most * found / least;
            assert!(
                (found - expected).abs() < close,
                "{name}: {found} {expected}"
            );
        }
        let inverse = normal.try_inverse().unwrap();
        for (k, sigma) in own.sigmas.iter().enumerate() {
            let expected = inverse[(k, k)].sqrt();
            assert!(
                (sigma / expected - 1.0).abs() < 1e-3,
                "{name} {}: {sigma} {expected}",
                names[k]
            );
        }

        // each state is closed, within the limits, and reached from the one before it
        let mut before = kinematics.home.clone();
        for (k, state) in chosen.states.iter().enumerate() {
            assert!(
                kinematics.closure(&scalars, state).residual.amax() < 1e-9
                    || kinematics.rows() == 0
            );
            for (limits, x) in kinematics.limits.iter().zip(state) {
                assert!(
                    limits.is_none_or(|[low, high]| (low - 1e-9..=high + 1e-9).contains(x)),
                    "{name}"
                );
            }
            let from = if chosen.from_home.contains(&k) {
                &kinematics.home
            } else {
                &before
            };
            let target: Vec<f64> = split.driving.iter().map(|c| state[*c]).collect();
            let end = kinematics.reach(&scalars, &split, from, &target).unwrap();
            let off = end
                .iter()
                .zip(state)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(off < 1e-6, "{name}: pose {k}");
            before.clone_from(state);
        }
        assert!(
            chosen.from_home.len() < poses / 2,
            "{name}: {:?}",
            chosen.from_home
        );
    }
}

/// Deviations that are predicted are those of fits.
#[test]
fn predicted_deviations_are_those_of_a_fit_with_the_poses() {
    let (described, measured) = described("puma560");
    let kinematics = &described.kinematics;
    let sensors = [sensor(kinematics, "6", Kind::Pose)];
    let geometry = described.with_all_errors(&[sensors[0].frame]);
    let noise = vec![Some(0.0); measured.len()];
    let problem = Problem {
        kinematics,
        geometry: &geometry,
        measured: &measured,
        noise_of_readings: &noise,
        sensors: &sensors,
        tolerance: None,
        efforts: None,
        poses: &[],
    };
    let what = Choice {
        poses: 12,
        margin: 0.05,
        noise: [1e-4, 1e-4],
        seed: 3,
    };
    let chosen = problem.choose(&what).unwrap();
    let simulation = Simulation {
        poses: 12,
        errors: 0.0,
        noise: [1e-4, 2e-4],
        seed: 5,
    };
    let (_, mut poses) = problem.simulate(&simulation).unwrap();
    let nominal: Vec<f64> = geometry.unknowns().iter().map(|own| own.nominal).collect();
    let scalars = geometry.scalars(&nominal).unwrap();
    for (pose, q) in poses.iter_mut().zip(&chosen.states) {
        pose.readings = measured.iter().map(|c| q[*c]).collect();
        let frames = kinematics.frames(&scalars, q);
        pose.values = vec![Some(sensors[0].predict(&frames, &kinematics.gravity))];
    }
    let fit = Problem {
        poses: &poses,
        ..problem
    }
    .calibrate(0.95)
    .unwrap();
    assert_eq!(fit.estimates.len(), chosen.found.len());
    for (own, sigma) in fit.estimates.iter().zip(&chosen.design.sigmas) {
        assert!(
            (own.sigma / sigma - 1.0).abs() < 1e-6,
            "{}: {} {sigma}",
            own.name,
            own.sigma
        );
    }
}
