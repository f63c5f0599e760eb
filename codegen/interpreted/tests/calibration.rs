//! Calibration of described mechanisms: derivatives against differences, closures against the derived
//! programs, counts of what can be known, and estimates against the truth.

#![allow(clippy::unwrap_used)]
use regen_calibrate::{
    Efforts, Geometry, Kind, Kinematics, Mounting, Problem, Sensor, Simulation, Why,
};
use regen_codegen::diag::Source;
use regen_codegen::pipeline::Mechanism;
use regen_codegen::robot::Robot;
use regen_codegen::signature::FunctionKind;
use regen_codegen::spec::edit::with_placements;
use regen_interpreted::{ChosenGeometry, Described, Interpreted, NominalEfforts, UnknownEfforts};
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

/// A robot with what its efforts at rest need.
fn with_efforts(name: &str) -> Robot {
    let mechanism = Mechanism::open(&source(name)).unwrap();
    mechanism.robot(&NominalEfforts::KINDS).unwrap()
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
        efforts: None,
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

/// The unknowns with errors of 2 mrad and 2 mm.
fn wrong(geometry: &ChosenGeometry<'_>, draws: &mut Normal) -> Vec<f64> {
    let unknowns = geometry.unknowns().iter();
    unknowns
        .map(|own| own.nominal + 2e-3 * draws.next())
        .collect()
}

/// A description with errors written into it is the mechanism with the errors, and the scales that no
/// description holds are named.
#[test]
fn errors_that_are_written_into_a_description_move_it_as_they_do() {
    let frames =
        "\nframes:\n  - {name: tool, body: 6, rpy: [0, pi/7, 0]}\n  - name: bare\n    body: 5\n";
    // joints in one line, a name that is not the first key, and one in block style
    let forms = "name: forms
limbs:
  - name: a
    joints: [{name: q1, type: revolute, body: 5, actuated: true}, {type: revolute, name: q2, origin: {xyz: [1, 0, 0]}, body: 6, actuated: true}]
  - name: b
    joints:
      - type: revolute
        origin: {rpy: [1, 0, 0]}
        name: q3
        body: 7
        actuated: true
frames: [{name: tool, xyz: [0.1, 0, 0], body: 6}]
";
    let robots = [
        ("puma560", frames),
        ("ur5e", ""),
        ("3rps", ""),
        ("delta", ""),
        ("stewart", ""),
        ("fivebar", ""),
        ("palletiser", ""),
        ("slider_crank", ""),
    ];
    let robots = robots.map(|(name, more)| (name, source(name).text + more));
    for (name, text) in robots.into_iter().chain([("forms", forms.to_owned())]) {
        let open = |text: &str| {
            let mechanism = Mechanism::open(&Source::new(name, text)).unwrap();
            let robot = mechanism.robot(&[]).unwrap();
            Described::new(mechanism.spec(), mechanism.model(), &robot)
        };
        let described = open(&text);
        let frames = described.kinematics.frames.iter();
        let tool = frames.clone().position(|(own, _)| own == "tool");
        let bare = frames.clone().position(|(own, _)| own == "bare");
        let named: Vec<usize> = tool.into_iter().chain(bare).collect();
        let geometry = described.with_all_errors(&named);
        let names: Vec<String> = geometry.unknowns().iter().map(|u| u.name.clone()).collect();
        let scale = format!("{}.scale", described.kinematics.coordinates[0]);
        let with_scale = [&names[..], std::slice::from_ref(&scale)].concat();
        let mut draws = Normal(11);
        let scaled = described.with(&with_scale).unwrap();
        let (_, unheld) = scaled.placements(&wrong(&scaled, &mut draws));
        assert_eq!(unheld, [scale.as_str()], "{name}");
        let mut wrong = wrong(&geometry, &mut draws);
        // what loops hold could not be assembled
        let kinematics = &described.kinematics;
        let all: Vec<usize> = (0..kinematics.coordinates.len()).collect();
        let held = known(&geometry, kinematics, &all, &[]).fixed;
        let held = held.iter().filter(|own| own.why == Why::LoopsFixed);
        for own in held {
            let k = names.iter().position(|name| *name == own.name).unwrap();
            wrong[k] = geometry.unknowns()[k].nominal;
        }
        let (placements, unheld) = geometry.placements(&wrong);
        assert!(
            unheld.is_empty() && !placements.is_empty(),
            "{name}: {unheld:?}"
        );
        let spec = regen_codegen::spec::parse(&Source::new(name, &text)).unwrap();
        let written = with_placements(&text, &spec, &placements).unwrap();
        let other = open(&written);
        let scalars = geometry.scalars(&wrong).unwrap();
        let own = other.with(&[]).unwrap().scalars(&[]).unwrap();
        assert_eq!(
            kinematics.coordinates, other.kinematics.coordinates,
            "{name}"
        );
        for _ in 0..5 {
            let home = kinematics.home.iter();
            let q: Vec<f64> = home.map(|q| q + 0.5 * draws.next()).collect();
            let [a, b] = [
                kinematics.closure(&scalars, &q).residual,
                other.kinematics.closure(&own, &q).residual,
            ];
            assert!(
                a.len() == b.len() && (0..a.len()).all(|k| (a[k] - b[k]).abs() < 1e-12),
                "{name}"
            );
            let pairs = kinematics
                .frames(&scalars, &q)
                .into_iter()
                .zip(other.kinematics.frames(&own, &q));
            for (a, b) in pairs {
                let off = (a.axes - b.axes).amax().max((a.point - b.point).amax());
                assert!(off < 1e-12, "{name}: {off}\n{written}");
            }
        }
    }
}

/// A scale is a factor of a reading in every equation: derivatives against differences, also of couplings.
#[test]
fn scales_multiply_readings_in_closures_and_couplings() {
    for name in ["palletiser", "fivebar", "slider_crank"] {
        let (described, _) = described(name);
        let kinematics = &described.kinematics;
        let names: Vec<String> = kinematics
            .coordinates
            .iter()
            .map(|c| format!("{c}.scale"))
            .collect();
        let geometry = described.with(&names).unwrap();
        let mut draws = Normal(5);
        let scale: Vec<f64> = names.iter().map(|_| 1.0 + 0.1 * draws.next()).collect();
        let one = geometry.scalars(&vec![1.0; names.len()]).unwrap();
        let scalars = geometry.scalars(&scale).unwrap();
        let home = kinematics.home.iter();
        let q: Vec<f64> = home.map(|q| q + 0.3 * draws.next()).collect();
        let angles: Vec<f64> = q.iter().zip(&scale).map(|(q, s)| q * s).collect();
        let closure = kinematics.closure(&scalars, &q);
        let off = (&closure.residual - kinematics.closure(&one, &angles).residual).amax();
        assert!(off < 1e-13, "{name}: {off}");
        let by_scale = closure.by_scalar * geometry.slopes(&scale);
        for k in 0..scale.len() {
            let ends = [-1e-6, 1e-6].map(|step| {
                let mut moved = scale.clone();
                moved[k] += step;
                kinematics
                    .closure(&geometry.scalars(&moved).unwrap(), &q)
                    .residual
            });
            let slope = (&ends[1] - &ends[0]) / 2e-6;
            assert!(
                (slope - by_scale.column(k)).amax() < 1e-8,
                "{name} {}",
                names[k]
            );
        }
    }
}

/// A beam on a joint about a level axis, of which the masses are needed and nothing else is.
#[test]
fn efforts_at_rest_are_those_of_the_stated_masses_and_missing_ones_are_named() {
    let text = "name: beam\nlimbs:\n  - name: arm\n    base: {rpy: [-pi/2, 0, 0]}\n    joints:\n      \
                - {name: q1, type: revolute, body: beam, actuated: true, friction: viscous}\n";
    let open = |text: &str| {
        let mechanism = Mechanism::open(&Source::new("beam", text)).unwrap();
        mechanism.robot(&NominalEfforts::KINDS).unwrap()
    };
    let bare = open(text);
    let Err(UnknownEfforts::Missing(labels)) = NominalEfforts::new(&bare) else {
        panic!("a beam without a mass has efforts");
    };
    assert_eq!(labels, ["mx(beam)", "my(beam)"]);
    let nominal = "bodies:\n  beam: {mass: 2, com: [0.5, 0, 0], inertia: [1, 0, 0, 1, 0, 1]}\n";
    let stated = open(&format!("{text}{nominal}"));
    let efforts = NominalEfforts::new(&stated).unwrap();
    // x is level at 0, and z of the joint is along the world's y: the beam falls as q1 grows
    let found = efforts.at(&[0.4]).unwrap();
    assert!(
        (found[0] + 2.0 * 9.81 * 0.5 * 0.4_f64.cos()).abs() < 1e-12,
        "{found:?}"
    );
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
    efforts: Option<&'a dyn Efforts>,
}

/// How estimates of many seeds are about the truth.
struct Coverage {
    /// The part of the intervals that hold the truth, percent.
    held: f64,
    /// The rms of the errors in deviations.
    rms: f64,
    /// The part of the values within three deviations, and that of the seeds with every value, percent.
    within: [f64; 2],
    /// The mean number of values of a seed.
    values: f64,
}

impl Trial<'_> {
    fn coverage(&self, seeds: u64) -> Coverage {
        let mut count = 0.0;
        let (mut held, mut squares, mut within) = (0.0, 0.0, [0.0; 2]);
        let noise = vec![self.noise_of_readings; self.measured.len()];
        let problem = Problem {
            kinematics: &self.described.kinematics,
            geometry: &self.geometry,
            measured: self.measured,
            noise_of_readings: &noise,
            sensors: &self.sensors,
            tolerance: self.tolerance,
            efforts: self.efforts,
            poses: &[],
        };
        let names = problem.known().unwrap().kept;
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
            let mut worst: f64 = 0.0;
            for estimate in &fit.estimates {
                let at = names
                    .iter()
                    .position(|name| *name == estimate.name)
                    .unwrap();
                let [low, high] = estimate.interval;
                count += 1.0;
                held += f64::from(u8::from(low <= truth[at] && truth[at] <= high));
                let off = (estimate.value - truth[at]) / estimate.sigma;
                squares += off.powi(2);
                within[0] += f64::from(u8::from(off.abs() < 3.0));
                worst = worst.max(off.abs());
            }
            within[1] += f64::from(u8::from(worst < 3.0));
        }
        let all = seeds as f64;
        Coverage {
            held: 100.0 * held / count,
            rms: (squares / count).sqrt(),
            within: [100.0 * within[0] / count, 100.0 * within[1] / all],
            values: count / all,
        }
    }
}

/// 95 % intervals hold the truth, and errors are as large as deviations say: of the values of one
/// seed most are correlated, so that some hundred of them are worth some tens. `REGEN_FULL` takes 200
/// seeds, and a platform on six struts (tests/records/full.md).
#[test]
fn intervals_hold_the_truth() {
    let is_full = std::env::var_os("REGEN_FULL").is_some();
    // a camera with arms and platforms, a tracker, and redundant encoders alone
    // with and without knowing how well the machine was made, and with joints that yield
    for (name, tip, kind, tolerance, yields) in [
        ("puma560", "6", Some(Kind::Pose), None, false),
        ("puma560", "6", Some(Kind::Pose), None, true),
        ("3rps", "3", Some(Kind::Pose), None, false),
        ("3rps", "3", Some(Kind::Point), Some(5e-4), false),
        ("delta", "platform", Some(Kind::Point), None, false),
        ("delta", "platform", Some(Kind::Pose), None, true),
        ("fivebar", "tip", None, None, false),
        ("stewart", "platform", Some(Kind::Pose), None, false),
    ] {
        if name == "stewart" && !is_full {
            continue;
        }
        let robot = with_efforts(name);
        let efforts = NominalEfforts::new(&robot).unwrap();
        let (described, actuated) = described(name);
        let kinematics = &described.kinematics;
        let all: Vec<usize> = (0..kinematics.coordinates.len()).collect();
        let tip = frame(kinematics, tip);
        let compliant = ["q*", "q*.compliance"].map(str::to_owned);
        let trial = Trial {
            described: &described,
            measured: if kind.is_some() { &actuated } else { &all },
            geometry: if yields {
                described.with(&compliant).unwrap()
            } else {
                described.with_all_errors(&[tip])
            },
            sensors: kind.iter().map(|kind| camera(tip, *kind)).collect(),
            errors: 5e-4,
            noise: [2e-5, 5e-5],
            noise_of_readings: Some(if kind.is_some() { 0.0 } else { 2e-5 }),
            tolerance,
            efforts: yields.then_some(&efforts as &dyn Efforts),
        };
        let found = trial.coverage(if is_full { 200 } else { 12 });
        let Coverage {
            held,
            rms,
            within,
            values,
        } = found;
        // so many seeds have every value within three deviations if values were independent
        let expected = 100.0 * 0.9973_f64.powf(values);
        println!(
            "{name} {yields}: {held:.1} % {rms:.3}, within 3 deviations {:.2} % of {values:.1} values, all \
             in {:.1} % of the seeds, {expected:.1} % if independent",
            within[0], within[1]
        );
        let [low, high] = if is_full { [93.0, 97.0] } else { [90.0, 100.0] };
        assert!(
            (low..=high).contains(&held) && (0.85..1.15).contains(&rms),
            "{name}: {held} {rms}"
        );
    }
}
