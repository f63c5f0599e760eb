//! A planar arm of two links whose payload, collisions and parameters are found: an observer, an
//! estimate of the load and adaptive control on one simulation in generalised momentum, written by
//! hand.

use regen_control::{
    Collision, GradientLaw, Load, NaturalLaw, Observer, Payload, Sample, Search, SettingError,
    Settings,
};
use regen_runtime::{Parameter, Symbol};

/// Length of the first link, m.
const LENGTH: f64 = 0.5;
const GRAVITY: f64 = 9.81;
const PERIOD: f64 = 1e-3;

/// The columns of a body on a link with frame origin at the elbow, in the plane: those of Izz, mx,
/// my and m in momentum and in the part of its rate without acceleration.
fn columns(q: [f64; 2], qd: [f64; 2]) -> ([[f64; 2]; 10], [[f64; 2]; 10]) {
    let turn = qd[0] + qd[1];
    let (s2, c2) = q[1].sin_cos();
    let (s, c) = (q[0] + q[1]).sin_cos();
    let mut momentum = [[0.0; 2]; 10];
    let mut rate = [[0.0; 2]; 10];
    let l = LENGTH;
    momentum[5] = [turn, turn];
    momentum[6] = [l * c2 * (turn + qd[0]), l * c2 * qd[0]];
    momentum[7] = [-l * s2 * (turn + qd[0]), -l * s2 * qd[0]];
    momentum[9] = [l * l * qd[0], 0.0];
    rate[6] = [-GRAVITY * c, -l * qd[0] * turn * s2 - GRAVITY * c];
    rate[7] = [GRAVITY * s, -l * qd[0] * turn * c2 + GRAVITY * s];
    rate[9] = [-GRAVITY * l * q[0].cos(), 0.0];
    (momentum, rate)
}

fn times(columns: &[[f64; 2]; 10], values: &[f64; 10]) -> [f64; 2] {
    std::array::from_fn(|d| columns.iter().zip(values).map(|(c, v)| c[d] * v).sum())
}

/// The second link with its payload; the first link and viscous friction are known.
#[derive(Clone)]
struct Arm {
    link: [f64; 10],
    load: [f64; 10],
    q: [f64; 2],
    p: [f64; 2],
}

const LINK: [f64; 10] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.12, 0.4, 0.0, 0.0, 2.0];
const LOAD: [f64; 10] = [0.01, 0.0, 0.0, 0.4, 0.0, 0.41, 0.9, 0.05, 0.0, 2.3];
/// Inertia and first moment of the first link, viscous friction of both joints.
const FIRST: [f64; 2] = [0.3, 0.8];
const VISCOUS: [f64; 2] = [1.2, 0.7];

/// Momentum and rate of the robot with a body on its second link.
fn robot(body: &[f64; 10], q: [f64; 2], qd: [f64; 2]) -> ([f64; 2], [f64; 2]) {
    let (momentum, rate) = columns(q, qd);
    let (mut p, mut n) = (times(&momentum, body), times(&rate, body));
    p[0] += FIRST[0] * qd[0];
    n[0] -= FIRST[1] * GRAVITY * q[0].cos();
    for d in 0..2 {
        n[d] -= VISCOUS[d] * qd[d];
    }
    (p, n)
}

impl Arm {
    fn new(load: [f64; 10]) -> Self {
        Self {
            link: LINK,
            load,
            q: [0.3, -0.4],
            p: [0.0; 2],
        }
    }

    fn body(&self) -> [f64; 10] {
        std::array::from_fn(|k| self.link[k] + self.load[k])
    }

    fn velocity(&self, q: [f64; 2], p: [f64; 2]) -> [f64; 2] {
        let unit = |qd| robot(&self.body(), q, qd).0;
        let (a, b) = (unit([1.0, 0.0]), unit([0.0, 1.0]));
        let det = a[0] * b[1] - a[1] * b[0];
        [
            (b[1] * p[0] - b[0] * p[1]) / det,
            (a[0] * p[1] - a[1] * p[0]) / det,
        ]
    }

    fn qd(&self) -> [f64; 2] {
        self.velocity(self.q, self.p)
    }

    /// One period under held efforts and an external force, by Runge and Kutta's method in four steps.
    fn step(&mut self, effort: [f64; 2], external: [f64; 2]) {
        let rate = |q: [f64; 2], p: [f64; 2]| {
            let qd = self.velocity(q, p);
            let (_, n) = robot(&self.body(), q, qd);
            (qd, std::array::from_fn(|d| n[d] + effort[d] + external[d]))
        };
        let along = |x: [f64; 2], k: [f64; 2], h: f64| [x[0] + h * k[0], x[1] + h * k[1]];
        let h = PERIOD;
        let (q1, p1) = rate(self.q, self.p);
        let (q2, p2) = rate(along(self.q, q1, h / 2.0), along(self.p, p1, h / 2.0));
        let (q3, p3) = rate(along(self.q, q2, h / 2.0), along(self.p, p2, h / 2.0));
        let (q4, p4): ([f64; 2], [f64; 2]) = rate(along(self.q, q3, h), along(self.p, p3, h));
        for d in 0..2 {
            self.q[d] += h / 6.0 * (q1[d] + 2.0 * q2[d] + 2.0 * q3[d] + q4[d]);
            self.p[d] += h / 6.0 * (p1[d] + 2.0 * p2[d] + 2.0 * p3[d] + p4[d]);
        }
    }
}

/// Positions, velocities and accelerations to follow.
fn wanted(t: f64) -> [[f64; 2]; 3] {
    let wave = |size: f64, rate: f64| {
        let (s, c) = (rate * t).sin_cos();
        [size * (1.0 - c), size * rate * s, size * rate * rate * c]
    };
    let (a, b, c) = (wave(0.6, 2.1), wave(-0.5, 3.3), wave(0.2, 5.9));
    std::array::from_fn(|k| {
        let start = if k == 0 { [0.3, -0.4] } else { [0.0; 2] };
        [start[0] + a[k] + c[k], start[1] + b[k] - c[k]]
    })
}

/// Efforts of a controller without a model but for the weight of the link.
fn drive(arm: &Arm, t: f64) -> [f64; 2] {
    let ([q, qd, _], now) = (wanted(t), arm.qd());
    let (_, weight) = robot(&LINK, arm.q, [0.0; 2]);
    std::array::from_fn(|d| 400.0 * (q[d] - arm.q[d]) + 40.0 * (qd[d] - now[d]) - weight[d])
}

/// Numbers of variance one, nearly normal, the same on every machine.
struct Noise(u64);

impl Noise {
    fn normal(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..12).map(|_| uniform()).sum()
    }
}

/// The external force behind the observer's low-pass, to what straight lines between samples leave.
#[test]
fn the_observer_is_the_filtered_external_force() {
    let bandwidth = 80.0;
    let mut observer = Observer::<f64, 2>::new(bandwidth, PERIOD).unwrap();
    let mut single = Observer::<f32, 2>::new(bandwidth, PERIOD).unwrap();
    let mut arm = Arm::new([0.0; 10]);
    let (push, from) = ([3.0, -1.5], 1500);
    let (mut worst, mut effort) = (0.0_f64, [0.0; 2]);
    for k in 0..3000 {
        let qd = arm.qd();
        let (p, n) = robot(&LINK, arm.q, qd);
        let narrow = |x: [f64; 2]| x.map(|x| x as f32);
        let sample = observer.update(&p, &n, &effort);
        assert_eq!(sample == Sample::First, k == 0);
        assert_eq!(
            single.update(&narrow(p), &narrow(n), &narrow(effort)),
            sample
        );
        let since = PERIOD * f64::from((k - from).max(0));
        for (d, push) in push.iter().enumerate() {
            let known = push * (1.0 - (-bandwidth * since).exp());
            worst = worst.max((observer.force()[d] - known).abs());
            assert!((f64::from(single.force()[d]) - known).abs() < 0.01);
        }
        if k == 2000 {
            // a sample that is not finite leaves the force as it is
            let before = observer.force();
            assert_eq!(
                observer.update(&[f64::NAN, 0.0], &n, &effort),
                Sample::Refused
            );
            assert_eq!(observer.force(), before);
        }
        effort = drive(&arm, PERIOD * f64::from(k));
        arm.step(effort, if k >= from { push } else { [0.0; 2] });
    }
    assert!(worst < 1e-3, "{worst:e}");
    observer.restart();
    assert_eq!(observer.force(), [0.0; 2]);
    assert_eq!(
        Observer::<f64, 2>::new(1001.0, PERIOD).unwrap_err(),
        SettingError::Bandwidth
    );
}

/// A payload is known within 2 % after ten seconds of motion, and its deviation is true.
#[test]
fn the_load_is_known_after_ten_seconds() {
    let mut noise = Noise(7);
    let truth = [0.9 / 2.3, 0.05 / 2.3];
    let mut count = 0;
    for _ in 0..10 {
        let load = carried(&mut noise, 10_000).load().unwrap();
        let error = load.mass - 2.3;
        assert!(
            error.abs() < 0.02 * 2.3 && load.mass_deviation < 0.01 * 2.3,
            "{load:?}"
        );
        let near = |value: f64, sigma: f64| i32::from(value.abs() < 3.0 * sigma);
        count += near(error, load.mass_deviation);
        for (axis, truth) in truth.iter().enumerate() {
            count += near(load.centre[axis] - truth, load.centre_deviation[axis]);
        }
    }
    assert!(count >= 29, "{count} of 30");
}

/// The payload's estimate after some samples with noise of velocities and efforts.
fn carried(noise: &mut Noise, samples: usize) -> Payload<f64, 2> {
    let settings = Settings::new(PERIOD);
    let mut payload = Payload::new(&settings, &[0.5, 0.5], 10.0, 0.5).unwrap();
    assert_eq!(payload.load().map(|load| load.mass), None);
    let mut arm = Arm::new(LOAD);
    let mut effort = [0.0; 2];
    for k in 0..samples {
        let qd = arm.qd().map(|qd| qd + 2e-3 * noise.normal());
        let (p, n) = robot(&LINK, arm.q, qd);
        let (momentum, rate) = columns(arm.q, qd);
        let measured = effort.map(|effort| effort + 0.5 * noise.normal());
        let sample = payload.update((&p, &n), (&momentum, &rate), &measured);
        assert_ne!(sample, Sample::Refused);
        effort = drive(&arm, PERIOD * k as f64);
        arm.step(effort, [0.0; 2]);
    }
    payload
}

/// The plane tells four of ten parameters; the physical body that fits best has the same mass, and
/// moments of inertia that belong to it.
#[test]
fn the_physical_load_fits_as_well() {
    let payload = carried(&mut Noise(11), 4000);
    let found = payload.physical(80, 1e-4).unwrap();
    assert_eq!(found.status, Search::Reached);
    let Load { mass, centre, .. } = payload.at(&found.values).unwrap();
    assert!(
        (mass - 2.3).abs() < 0.05 && (centre[0] - 0.9 / 2.3).abs() < 0.02,
        "{mass} {centre:?}"
    );
    let [ixx, .., izz, _, _, _, _] = found.values;
    let iyy = found.values[3];
    assert!(
        ixx > 0.0 && ixx + iyy > izz && izz - 0.41 < 0.05,
        "{:?}",
        found.values
    );
    assert!(payload.physical(80, f64::NAN).is_err());
    assert!(Payload::<f64, 2>::new(&Settings::new(PERIOD), &[0.5; 2], -1.0, 0.5).is_err());
}

/// A collision is found within 20 ms, and runs of ten seconds without one give no alarm.
#[test]
fn a_collision_is_found_in_20_ms() {
    let (mut noise, mut alarms, mut found) = (Noise(3), 0, 0);
    let mut detector = Collision::<f64, 2>::new(0.01, 10_000).unwrap();
    assert_eq!(detector.contact(&[1e9; 2]), None, "nothing is learned yet");
    assert!(matches!(
        Collision::<f64, 2>::new(1.0, 10),
        Err(SettingError::Probability)
    ));
    let runs = 6;
    for run in 0..=runs {
        let mut observer = Observer::<f64, 2>::new(100.0, PERIOD).unwrap();
        let mut arm = Arm::new([0.0; 10]);
        let mut effort = [0.0; 2];
        let (hit, mut alarm) = (8000, None);
        for k in 0..10_000 {
            let qd = arm.qd().map(|qd| qd + 1e-3 * noise.normal());
            let (p, n) = robot(&LINK, arm.q, qd);
            let measured = effort.map(|effort| effort + 0.3 * noise.normal());
            assert_ne!(observer.update(&p, &n, &measured), Sample::Refused);
            let force = observer.force();
            if run == 0 {
                detector.learn(&force);
            } else if alarm.is_none() && detector.contact(&force).is_some() {
                alarm = Some(k);
            }
            effort = drive(&arm, PERIOD * f64::from(k));
            // 10 N on the hand, half a metre from the elbow
            let contact = run > 0 && k >= hit;
            let (s2, c2) = arm.q[1].sin_cos();
            let push = [10.0 * (LENGTH * c2 + 0.5 + 0.0 * s2), 10.0 * 0.5];
            arm.step(effort, if contact { push } else { [0.0; 2] });
        }
        if run > 0 {
            alarms += i32::from(alarm.is_some_and(|k| k < hit));
            found += i32::from(alarm.is_some_and(|k| k >= hit && k <= hit + 20));
        }
    }
    println!("{:?}: {found} found, {alarms} false", detector.thresholds());
    assert_eq!((alarms, found), (0, runs));
}

/// Ten inertial parameters of the body on the second link, beside what is known.
type Regressor = [[f64; 2]; 10];

/// The regressor of Slotine and Li for the body on the second link: M(phi) qdd_r + C qd_r + g, with
/// Christoffel symbols.
fn regressor(q: [f64; 2], qd: [f64; 2], qd_r: [f64; 2], qdd_r: [f64; 2]) -> Regressor {
    let (momentum, _) = columns(q, qdd_r);
    let (_, weight) = columns(q, [0.0; 2]);
    let (s2, c2) = q[1].sin_cos();
    let mut y: Regressor =
        std::array::from_fn(|k| std::array::from_fn(|d| momentum[k][d] - weight[k][d]));
    // both first moments bend the mass matrix by the elbow alone
    for (column, slope) in [(6, -LENGTH * s2), (7, -LENGTH * c2)] {
        y[column][0] += slope * (qd[1] * qd_r[0] + (qd[0] + qd[1]) * qd_r[1]);
        y[column][1] -= slope * qd[0] * qd_r[0];
    }
    y
}

/// The rms error of positions in the first and the last of twelve seconds of adaptive control.
fn adapted(mut law: impl FnMut(&Regressor, &[f64; 2]) -> [f64; 10], start: [f64; 10]) -> [f64; 2] {
    let mut arm = Arm::new(LOAD);
    let (mut values, mut errors) = (start, [0.0; 2]);
    for k in 0..12_000 {
        let t = PERIOD * f64::from(k);
        let ([q, qd, qdd], now) = (wanted(t), arm.qd());
        let qd_r: [f64; 2] = std::array::from_fn(|d| qd[d] - 8.0 * (arm.q[d] - q[d]));
        let qdd_r: [f64; 2] = std::array::from_fn(|d| qdd[d] - 8.0 * (now[d] - qd[d]));
        let s = std::array::from_fn(|d| now[d] - qd_r[d]);
        let y = regressor(arm.q, now, qd_r, qdd_r);
        let body = times(&y, &values);
        let effort = std::array::from_fn(|d| {
            let first = if d == 0 {
                FIRST[0] * qdd_r[0] + FIRST[1] * GRAVITY * arm.q[0].cos()
            } else {
                0.0
            };
            body[d] + first + VISCOUS[d] * now[d] - 6.0 * s[d]
        });
        values = law(&y, &s);
        arm.step(effort, [0.0; 2]);
        let error: f64 = (0..2).map(|d| (arm.q[d] - q[d]).powi(2)).sum();
        let place = if k < 1000 {
            Some(0)
        } else if k >= 11_000 {
            Some(1)
        } else {
            None
        };
        if let Some(place) = place {
            errors[place] += error / 1000.0;
        }
    }
    errors.map(f64::sqrt)
}

/// A body to start from that is physical: the link with thickness.
fn start() -> [f64; 10] {
    let mut start = LINK;
    (start[0], start[3]) = (0.01, 0.12);
    start[5] = 0.125;
    start
}

#[test]
fn adaptive_control_follows_the_motion() {
    let mut law = GradientLaw::new(&start(), &[0.5; 10]).unwrap();
    let [first, last] = adapted(
        |y, s| {
            assert_eq!(law.update(y, s, PERIOD), Sample::Taken);
            law.values()
        },
        start(),
    );
    println!("gradient: {first:e}, then {last:e}");
    assert!(last < 0.1 * first, "{first:e} {last:e}");
    let before = law.values();
    assert_eq!(
        law.update(&[[f64::NAN; 2]; 10], &[1.0; 2], PERIOD),
        Sample::Refused
    );
    assert_eq!(law.values(), before);
    assert!(GradientLaw::new(&start(), &[-1.0; 10]).is_err());
}

#[test]
fn the_natural_law_follows_the_motion_and_stays_physical() {
    let parameters = Symbol::INERTIAL.map(|symbol| Parameter::new(symbol, "2"));
    let set = regen_control::Physical::<10, 1>::new(&parameters).unwrap();
    let of = |gain| NaturalLaw::<f64, 10, 1>::new(&parameters, &start(), gain, 0.0).unwrap();
    let mut law = of(2.0);
    let [first, last] = adapted(
        |y, s| {
            assert_eq!(law.update(y, s, PERIOD), Sample::Taken);
            assert!(set.contains(&law.values()));
            law.values()
        },
        start(),
    );
    let [_, without] = adapted(|_, _| start(), start());
    println!("natural: {first:e}, then {last:e}, without {without:e}");
    assert!(
        last < 0.2 * first && last < 0.1 * without,
        "{last:e} {without:e}"
    );
    // steps as large as they come leave it physical
    let mut noise = Noise(5);
    let mut law = of(1e6);
    for _ in 0..200 {
        let y = std::array::from_fn(|_| [noise.normal(), noise.normal()]);
        let s = [noise.normal(), noise.normal()];
        if law.update(&y, &s, 1.0) == Sample::Taken {
            assert!(law.values()[9] > 0.0);
        }
    }
    // a small step is that of the differential equation
    let (mut law, before) = (of(1.0), start());
    let (y, s) = (
        std::array::from_fn(|k| [f64::from(u8::from(k == 9)), 0.0]),
        [1.0, 0.0],
    );
    assert_eq!(law.update(&y, &s, 1e-6), Sample::Taken);
    let slope: [f64; 10] = std::array::from_fn(|k| (law.values()[k] - before[k]) / 1e-6);
    // L has only the entry of the mass: dJ = -J e e^T J
    assert!((slope[9] + before[9] * before[9]).abs() < 1e-4, "{slope:?}");
    assert!((slope[6] + before[6] * before[9]).abs() < 1e-4, "{slope:?}");
    assert!((slope[5] + before[6] * before[6]).abs() < 1e-4, "{slope:?}");
    let bad = NaturalLaw::<f64, 10, 1>::new(&parameters, &LINK, 1.0, 0.0);
    assert_eq!(bad.unwrap_err(), SettingError::Start);
}
