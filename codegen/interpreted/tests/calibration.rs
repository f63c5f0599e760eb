//! Calibration of described mechanisms: derivatives against differences, closures against the derived
//! programs, counts of what can be known, and estimates against the truth.

#![allow(clippy::unwrap_used)]
use regen_calibrate::{Geometry, Kind, Kinematics, Mounting, Problem, Sensor, Simulation};
use regen_codegen::diag::Source;
use regen_codegen::pipeline::Mechanism;
use regen_codegen::signature::FunctionKind;
use regen_interpreted::{ChosenGeometry, Described, Interpreted};
use regen_runtime::Model;

fn source(name: &str) -> Source {
    let path = format!("{}/../../robots/{name}.yaml", env!("CARGO_MANIFEST_DIR"));
    Source::new(name, std::fs::read_to_string(&path).unwrap())
}

/// A robot's geometry and its actuated coordinates.
fn described(name: &str) -> (Described, Vec<usize>) {
    let mechanism = Mechanism::open(&source(name)).unwrap();
    let robot = mechanism.robot(&[]).unwrap();
    let described = Described::new(mechanism.spec(), mechanism.model(), &robot);
    (described, mechanism.model().actuated.clone())
}

/// Numbers of the normal distribution, the same ones in every run.
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

fn frame(kinematics: &Kinematics, name: &str) -> usize {
    kinematics
        .frames
        .iter()
        .position(|(own, _)| own == name)
        .unwrap()
}

fn camera(frame: usize, kind: Kind) -> Sensor {
    Sensor {
        name: "camera".to_owned(),
        kind,
        frame,
        mounting: Mounting {
            unknown: true,
            ..Mounting::WORLD
        },
        noise: None,
        noise_of_angles: None,
    }
}

fn known(
    geometry: &ChosenGeometry<'_>,
    kinematics: &Kinematics,
    measured: &[usize],
    sensors: &[Sensor],
) -> regen_calibrate::Known {
    let noise = vec![None; measured.len()];
    Problem {
        kinematics,
        geometry,
        measured,
        noise_of_readings: &noise,
        sensors,
        tolerance: None,
        poses: &[],
    }
    .known()
    .unwrap()
}

/// What is known of the counts of identifiable numbers: 4 R + 2 P + 6 for serial arms whose tool's pose
/// is measured (Everett, Driels, Mooring 1987), 7 for each leg of a 6-UPS platform, of which 12 are
/// the places of instrument and tool.
#[test]
fn counts_of_what_can_be_known_are_those_of_the_theory() {
    for (name, tip, count) in [
        ("puma560", "6", 30),
        ("panda", "7", 34),
        ("scara", "4", 20),
        ("stanford", "6", 28),
        ("stewart", "platform", 42),
    ] {
        let (described, measured) = described(name);
        let kinematics = &described.kinematics;
        let tip = frame(kinematics, tip);
        let geometry = described.with_all_errors(&[tip]);
        let sensors = [camera(tip, Kind::Pose)];
        let found = known(&geometry, kinematics, &measured, &sensors);
        assert_eq!(found.kept.len() + found.mountings, count, "{name}");
        // what is left of the others are rounding errors
        assert!(
            found.smallest_kept > 1e-4 && found.largest_absorbed < 1e-10,
            "{found:?}"
        );
    }
}

/// Closure equations, their Jacobian and the bodies' frames, against the derived programs.
#[test]
fn closures_and_frames_are_those_of_the_derived_programs() {
    for name in [
        "3rps",
        "3prs",
        "stewart",
        "delta",
        "fivebar",
        "palletiser",
        "slider_crank",
    ] {
        let source = source(name);
        let mechanism = Mechanism::open(&source).unwrap();
        let kinds = [
            FunctionKind::Constraints,
            FunctionKind::Jacobian,
            FunctionKind::Poses,
        ];
        let robot = mechanism.robot(&kinds).unwrap();
        let described = Described::new(mechanism.spec(), mechanism.model(), &robot);
        let kinematics = &described.kinematics;
        let geometry = described.with_all_errors(&[]);
        let nominal: Vec<f64> = geometry.unknowns().iter().map(|u| u.nominal).collect();
        let scalars = geometry.scalars(&nominal).unwrap();
        let model = Interpreted::new(&robot);
        let mut draws = Normal(7);
        for _ in 0..20 {
            // states that are not closed show every entry
            let home = kinematics.home.iter();
            let q: Vec<f64> = home.map(|q| q + 0.3 * draws.next()).collect();
            let closure = kinematics.closure(&scalars, &q);
            let rows = closure.residual.len();
            let mut f = vec![0.0; rows];
            model.constraints(&q, &mut f).unwrap();
            let mut a = vec![0.0; rows * q.len()];
            model.jacobian(&q, &mut a).unwrap();
            for row in 0..rows {
                assert!((closure.residual[row] - f[row]).abs() < 1e-13, "{name}");
                for c in 0..q.len() {
                    let entry = a[row * q.len() + c];
                    assert!(
                        (closure.by_coordinate[(row, c)] - entry).abs() < 1e-13,
                        "{name}"
                    );
                }
            }
            let bodies = mechanism.model().bodies.len();
            let mut poses = vec![0.0; 12 * bodies];
            model.poses(&q, &mut poses).unwrap();
            let frames = kinematics.frames(&scalars, &q);
            let frames = &frames[frames.len() - bodies..];
            for (frame, pose) in frames.iter().zip(poses.chunks(12)) {
                for i in 0..3 {
                    assert!((frame.point[i] - pose[9 + i]).abs() < 1e-13, "{name}");
                    for j in 0..3 {
                        assert!(
                            (frame.axes[(i, j)] - pose[3 * i + j]).abs() < 1e-13,
                            "{name}"
                        );
                    }
                }
            }
        }
    }
}

/// What is simulated for a calibration: a mechanism whose errors are known.
struct Trial<'a> {
    described: &'a Described,
    measured: &'a [usize],
    geometry: ChosenGeometry<'a>,
    sensors: Vec<Sensor>,
    /// The deviation of errors, rad and m, of lengths, m, and of angles, rad.
    errors: f64,
    noise: [f64; 2],
    noise_of_readings: Option<f64>,
    tolerance: Option<f64>,
}

impl Trial<'_> {
    /// The part of the intervals that hold the truth, percent, and the rms of the errors in deviations,
    /// over seeds.
    fn coverage(&self, seeds: u64) -> [f64; 2] {
        let mut count = 0.0;
        let (mut held, mut squares) = (0.0, 0.0);
        let noise = vec![self.noise_of_readings; self.measured.len()];
        let problem = Problem {
            kinematics: &self.described.kinematics,
            geometry: &self.geometry,
            measured: self.measured,
            noise_of_readings: &noise,
            sensors: &self.sensors,
            tolerance: self.tolerance,
            poses: &[],
        };
        for seed in 0..seeds {
            let what = Simulation {
                poses: 40,
                errors: self.errors,
                noise: self.noise,
                seed,
            };
            let (truth, poses) = problem.simulate(&what).unwrap();
            let unstated = vec![noise[0].filter(|s| *s == 0.0); noise.len()];
            let problem = Problem {
                noise_of_readings: &unstated,
                poses: &poses,
                ..problem
            };
            let fit = problem.calibrate(0.95).unwrap();
            assert!(
                fit.converged && fit.outliers.is_empty(),
                "seed {seed}: {:?}",
                fit.outliers
            );
            let names = problem.known().unwrap().kept;
            for estimate in &fit.estimates {
                let at = names
                    .iter()
                    .position(|name| *name == estimate.name)
                    .unwrap();
                let [low, high] = estimate.interval;
                count += 1.0;
                held += f64::from(u8::from(low <= truth[at] && truth[at] <= high));
                squares += ((estimate.value - truth[at]) / estimate.sigma).powi(2);
            }
        }
        [100.0 * held / count, (squares / count).sqrt()]
    }
}

/// 95 % intervals hold the truth, and errors are as large as deviations say: of the values of one
/// seed most are correlated, so that some hundred of them are worth some tens.
#[test]
fn intervals_hold_the_truth() {
    // a camera with arms and platforms, a tracker, and redundant encoders alone
    // with and without knowing how well the machine was made
    for (name, tip, kind, tolerance) in [
        ("puma560", "6", Some(Kind::Pose), None),
        ("3rps", "3", Some(Kind::Pose), None),
        ("3rps", "3", Some(Kind::Point), Some(5e-4)),
        ("delta", "platform", Some(Kind::Point), None),
        ("fivebar", "tip", None, None),
    ] {
        let (described, actuated) = described(name);
        let kinematics = &described.kinematics;
        let all: Vec<usize> = (0..kinematics.coordinates.len()).collect();
        let tip = frame(kinematics, tip);
        let trial = Trial {
            described: &described,
            measured: if kind.is_some() { &actuated } else { &all },
            geometry: described.with_all_errors(&[tip]),
            sensors: kind.iter().map(|kind| camera(tip, *kind)).collect(),
            errors: 5e-4,
            noise: [2e-5, 5e-5],
            noise_of_readings: Some(if kind.is_some() { 0.0 } else { 2e-5 }),
            tolerance,
        };
        let [held, rms] = trial.coverage(12);
        println!("{name}: {held:.1} % {rms:.3}");
        assert!(
            held > 90.0 && (0.85..1.15).contains(&rms),
            "{name}: {held} {rms}"
        );
    }
}
