//! Payloads, external forces and collisions on simulated robots, found by the functions of a control
//! cycle: a serial arm, a five-bar and a 3-RPS, whose momentum is that of their derived models.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::diag::Source;
use regen_codegen::pipeline::{BaseSource, derive_with};
use regen_codegen::robot::Robot;
use regen_control::{Collision, Observer, Payload, Sample, Settings};
use regen_interpreted::Interpreted;
use regen_runtime::{ControlModel, LoopClosure, Model};
use regen_tests::sample_size;

/// The time between two samples, s, and how many of them are a second.
const PERIOD: f64 = 2e-3;
const SECOND: usize = 500;

/// A robot with a body that it can carry.
struct Case {
    name: &'static str,
    /// The body that carries it.
    on: &'static str,
    /// Mass and centre, kg and m.
    load: [f64; 4],
    /// How far the independent coordinates move, rad or m, and their first angular frequency, rad/s.
    swing: [f64; 2],
    /// Deviations of the noise of velocities and efforts.
    noise: [f64; 2],
    /// The external force of a collision on each independent coordinate, N m or N.
    push: f64,
}

const CASES: [Case; 3] = [
    Case {
        name: "puma560",
        on: "6",
        load: [2.0, 0.03, -0.02, 0.1],
        swing: [0.5, 1.3],
        noise: [1e-3, 0.5],
        push: 6.0,
    },
    Case {
        name: "fivebar",
        on: "2",
        load: [0.5, 0.02, 0.01, 0.0],
        swing: [0.3, 2.0],
        noise: [1e-3, 0.05],
        push: 0.6,
    },
    Case {
        name: "3rps",
        on: "3",
        load: [4.0, 0.02, 0.05, 0.04],
        swing: [0.05, 2.0],
        noise: [2e-4, 3.0],
        push: 30.0,
    },
];

impl Case {
    /// The robot with the functions of controllers.
    fn robot(&self) -> Robot {
        let path = format!(
            "{}/../robots/{}.yaml",
            env!("CARGO_MANIFEST_DIR"),
            self.name
        );
        let text = std::fs::read_to_string(path).unwrap();
        let limb = format!(
            "limbs:\n  - name: tool\n    from: {}\n    joints:\n      \
             - {{type: fixed, origin: {{xyz: [0.05, 0.02, 0.01]}}, body: load, payload: true}}\n",
            self.on
        );
        let mut text = text.replacen("limbs:\n", &limb, 1);
        if !text.contains("control: true") {
            text += "\ncontrol: true\n";
        }
        match derive_with(&Source::new(self.name, &text), BaseSource::Skip) {
            Ok(robot) => robot,
            Err(error) => panic!("{}: {error:?}", self.name),
        }
    }

    /// The ten parameters of the load.
    fn load(&self) -> [f64; 10] {
        let [m, x, y, z] = self.load;
        let (own, far) = (2e-3 * m, m * (x * x + y * y + z * z));
        let inertia = |a: f64, b: f64, same: f64| same * (own + far) - m * a * b;
        [
            inertia(x, x, 1.0),
            inertia(x, y, 0.0),
            inertia(x, z, 0.0),
            inertia(y, y, 1.0),
            inertia(y, z, 0.0),
            inertia(z, z, 1.0),
            m * x,
            m * y,
            m * z,
            m,
        ]
    }
}

/// Normal numbers by Box and Muller, from SplitMix64.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A simulated motion: each sample with its efforts since the sample before.
struct Run<const D: usize> {
    q: Vec<Vec<f64>>,
    qd_i: Vec<[f64; D]>,
    effort: Vec<[f64; D]>,
}

/// The simulated robot under computed torques that are held over each period, with an external force
/// from a sample on.
fn simulate<const D: usize>(
    model: &Interpreted<'_>,
    phi: &[f64],
    case: &Case,
    samples: usize,
    hit: Option<usize>,
) -> Run<D> {
    let info = Model::<f64>::info(model);
    let mut closure = LoopClosure::new(model as &dyn Model).unwrap();
    let home: [f64; D] = std::array::from_fn(|d| info.home[info.independent[d]]);
    let [size, rate] = case.swing;
    let acceleration = |closure: &mut LoopClosure<'_, dyn Model>,
                        q_i: &[f64; D],
                        qd_i: &[f64; D],
                        effort: &[f64; D]| {
        let state = closure.track_state(q_i, qd_i, &[0.0; D]).unwrap();
        assert!(state.outcome.is_closed());
        let mut qdd = [0.0; D];
        let condition = model
            .forward_dynamics(&state.q, &state.qd, effort, phi, &mut qdd)
            .unwrap();
        assert!(condition.is_regular());
        (qdd, state.q)
    };
    let (mut q_i, mut qd_i) = (home, [0.0; D]);
    let mut run = Run {
        q: Vec::new(),
        qd_i: Vec::new(),
        effort: Vec::new(),
    };
    let mut effort = [0.0; D];
    for k in 0..samples {
        let t = PERIOD * k as f64;
        let (_, q) = acceleration(&mut closure, &q_i, &qd_i, &effort);
        run.q.push(q.clone());
        run.qd_i.push(qd_i);
        run.effort.push(effort);
        let wanted: [f64; D] = std::array::from_fn(|d| {
            let w = rate * (1.0 + 0.37 * d as f64);
            let wave = |w: f64, size: f64| {
                let (s, c) = (w * t).sin_cos();
                [size * (1.0 - c), size * w * s, size * w * w * c]
            };
            let (a, b) = (wave(w, 0.7 * size), wave(2.3 * w, 0.3 * size));
            let error = home[d] + a[0] + b[0] - q_i[d];
            a[2] + b[2] + 400.0 * error + 40.0 * (a[1] + b[1] - qd_i[d])
        });
        let state = closure.track_state(&q_i, &qd_i, &wanted).unwrap();
        let _ = model
            .inverse_dynamics(&state.q, &state.qd, &state.qdd, phi, &mut effort)
            .unwrap();
        let external = if hit.is_some_and(|hit| k >= hit) {
            case.push
        } else {
            0.0
        };
        let total = effort.map(|effort| effort + external);
        // Runge and Kutta's method of four stages
        let ahead = |x: &[f64; D], k: &[f64; D], h: f64| -> [f64; D] {
            std::array::from_fn(|d| x[d] + h * k[d])
        };
        let h = PERIOD;
        let v1 = qd_i;
        let (a1, _) = acceleration(&mut closure, &q_i, &v1, &total);
        let v2 = ahead(&qd_i, &a1, 0.5 * h);
        let (a2, _) = acceleration(&mut closure, &ahead(&q_i, &v1, 0.5 * h), &v2, &total);
        let v3 = ahead(&qd_i, &a2, 0.5 * h);
        let (a3, _) = acceleration(&mut closure, &ahead(&q_i, &v2, 0.5 * h), &v3, &total);
        let v4 = ahead(&qd_i, &a3, h);
        let (a4, _) = acceleration(&mut closure, &ahead(&q_i, &v3, h), &v4, &total);
        for d in 0..D {
            q_i[d] += h / 6.0 * (v1[d] + 2.0 * v2[d] + 2.0 * v3[d] + v4[d]);
            qd_i[d] += h / 6.0 * (a1[d] + 2.0 * a2[d] + 2.0 * a3[d] + a4[d]);
        }
    }
    run
}

/// The robot's nominal parameters, and the place of the load's.
fn nominal(robot: &Interpreted<'_>) -> (Vec<f64>, usize) {
    let info = Model::<f64>::info(robot);
    let load = info
        .parameters
        .iter()
        .position(|parameter| *parameter == *"Ixx(load)")
        .unwrap();
    let values = info.parameters.iter().zip(info.nominal);
    let phi = values.map(|(_, value)| value.unwrap_or(0.0)).collect();
    (phi, load)
}

/// Momentum and its rate at a sample of a run, with noise of the velocities.
fn momentum<const D: usize>(
    model: &Interpreted<'_>,
    phi: &[f64],
    q: &[f64],
    qd: &[f64],
) -> ([f64; D], [f64; D]) {
    let (mut p, mut n) = ([0.0; D], [0.0; D]);
    let _ = model.momentum(q, qd, phi, &mut p).unwrap();
    let _ = model.momentum_rate(q, qd, phi, &mut n).unwrap();
    (p, n)
}

/// All velocities from independent ones with noise.
fn velocities<const D: usize>(
    model: &Interpreted<'_>,
    q: &[f64],
    qd_i: &[f64; D],
    deviation: f64,
    noise: &mut Noise,
) -> Vec<f64> {
    let noisy = qd_i.map(|qd| qd + deviation * noise.normal());
    let mut qd = vec![0.0; q.len()];
    let _ = model.velocities(q, &noisy, &mut qd).unwrap();
    qd
}

/// The payload after ten seconds, of twins with noise of their own: how many masses are within 2 %,
/// and how many of mass and centre within three deviations.
fn twins<const D: usize>(case: &Case, count: u64) -> [u64; 3] {
    let robot = case.robot();
    let model = Interpreted::new(&robot);
    let (empty, load) = nominal(&model);
    let mut phi = empty.clone();
    phi[load..load + 10].copy_from_slice(&case.load());
    let run = simulate::<D>(&model, &phi, case, 10 * SECOND, None);
    let [mass, ..] = case.load;
    let mut found = [0; 3];
    for twin in 0..count {
        let mut noise = Noise(twin);
        let settings = Settings::new(PERIOD);
        let mut payload =
            Payload::<f64, D>::new(&settings, &[case.noise[1]; D], 10.0 * mass, 0.3).unwrap();
        let mut columns = [vec![0.0; D * phi.len()], vec![0.0; D * phi.len()]];
        for ((q, qd_i), effort) in run.q.iter().zip(&run.qd_i).zip(&run.effort) {
            let qd = velocities(&model, q, qd_i, case.noise[0], &mut noise);
            let (p, n) = momentum(&model, &empty, q, &qd);
            let [momentum, rate] = &mut columns;
            let _ = model.momentum_regressor(q, &qd, momentum).unwrap();
            let _ = model.momentum_rate_regressor(q, &qd, rate).unwrap();
            let body = |all: &[f64]| -> [[f64; D]; 10] {
                std::array::from_fn(|k| std::array::from_fn(|d| all[(load + k) * D + d]))
            };
            let measured = effort.map(|effort| effort + case.noise[1] * noise.normal());
            let sample = payload.update((&p, &n), (&body(momentum), &body(rate)), &measured);
            assert_ne!(sample, Sample::Refused);
        }
        let Some(load) = payload.load() else {
            continue;
        };
        found[0] += u64::from((load.mass / mass - 1.0).abs() < 0.02);
        found[1] += u64::from((load.mass - mass).abs() < 3.0 * load.mass_deviation);
        let near = |axis: usize| {
            let error = load.centre[axis] - case.load[1 + axis];
            error.abs() < 3.0 * load.centre_deviation[axis]
        };
        // a mechanism in a plane tells nothing of the third coordinate
        let axes = if case.name == "fivebar" { 2 } else { 3 };
        found[2] += u64::from((0..axes).all(near));
    }
    println!(
        "{}: of {count} twins {found:?} (mass in 2 %, in 3 sigma, centre in 3 sigma)",
        case.name
    );
    found
}

/// 200 twins in `.ci/full`; `tests/records/full.md` has their figures.
#[test]
fn the_payload_is_known_within_2_percent_after_10_s_with_a_true_deviation() {
    let count = sample_size(200, 4);
    let [arm, planar, platform] = &CASES;
    for found in [
        twins::<6>(arm, count),
        twins::<2>(planar, count),
        twins::<3>(platform, count),
    ] {
        assert!(
            found.iter().all(|found| 100 * found >= 95 * count),
            "{found:?} of {count}"
        );
    }
}

/// How many of some runs gave an alarm before the collision, and how many told it within 20 ms.
fn collisions<const D: usize>(case: &Case, count: u64) -> [u64; 2] {
    let robot = case.robot();
    let model = Interpreted::new(&robot);
    let (phi, _) = nominal(&model);
    let hit = 9 * SECOND;
    let run = simulate::<D>(&model, &phi, case, hit + 20, Some(hit));
    let mut detector = Collision::<f64, D>::new(0.01, hit as u32).unwrap();
    let mut counted = [0; 2];
    for twin in 0..=count {
        let mut noise = Noise(1000 + twin);
        let mut observer = Observer::<f64, D>::new(100.0, PERIOD).unwrap();
        let mut alarm = None;
        let samples = run.q.iter().zip(&run.qd_i).zip(&run.effort).enumerate();
        for (k, ((q, qd_i), effort)) in samples {
            let qd = velocities(&model, q, qd_i, case.noise[0], &mut noise);
            let (p, n) = momentum(&model, &phi, q, &qd);
            let measured = effort.map(|effort| effort + case.noise[1] * noise.normal());
            assert_ne!(observer.update(&p, &n, &measured), Sample::Refused);
            let force = observer.force();
            // the first twin's motion before the collision is what the detector learns from
            if twin == 0 && k <= hit {
                detector.learn(&force);
            } else if alarm.is_none() && detector.contact(&force).is_some() {
                alarm = Some(k);
            }
        }
        if twin > 0 {
            counted[0] += u64::from(alarm.is_some_and(|k| k <= hit));
            let within = hit + SECOND / 50;
            counted[1] += u64::from(alarm.is_some_and(|k| k > hit && k <= within));
        }
    }
    println!(
        "{}: of {count} runs {counted:?} (false alarms, found in 20 ms)",
        case.name
    );
    counted
}

#[test]
fn a_collision_is_found_in_20_ms_at_1_percent_of_false_alarms() {
    let count = sample_size(200, 10);
    let [arm, planar, platform] = &CASES;
    let all = [
        collisions::<6>(arm, count),
        collisions::<2>(planar, count),
        collisions::<3>(platform, count),
    ];
    for [alarms, found] in all {
        assert!(
            100 * alarms <= count && 100 * found >= 99 * (count - alarms),
            "{alarms} {found} of {count}"
        );
    }
}

/// The observer's force is the external one behind its low-pass, on loops as on the arm.
#[test]
fn the_observer_gives_the_external_force_of_loops() {
    fn worst<const D: usize>(case: &Case) -> f64 {
        let robot = case.robot();
        let model = Interpreted::new(&robot);
        let (phi, _) = nominal(&model);
        let (hit, bandwidth) = (500, 50.0);
        let run = simulate::<D>(&model, &phi, case, 1000, Some(hit));
        let mut observer = Observer::<f64, D>::new(bandwidth, PERIOD).unwrap();
        let mut worst = 0.0_f64;
        for (k, q) in run.q.iter().enumerate() {
            let mut qd = vec![0.0; q.len()];
            let _ = model.velocities(q, &run.qd_i[k], &mut qd).unwrap();
            let (p, n) = momentum(&model, &phi, q, &qd);
            assert_ne!(observer.update(&p, &n, &run.effort[k]), Sample::Refused);
            let since = PERIOD * k.saturating_sub(hit) as f64;
            let known = case.push * (1.0 - (-bandwidth * since).exp());
            for force in observer.force() {
                worst = worst.max((force - known).abs() / case.push);
            }
        }
        worst
    }
    let [arm, planar, platform] = &CASES;
    for worst in [worst::<6>(arm), worst::<2>(planar), worst::<3>(platform)] {
        println!("the force is off by {worst:e} of it");
        // straight lines between samples 2 ms apart, where the arm's force bends them
        assert!(worst < 1e-2, "{worst:e}");
    }
}
