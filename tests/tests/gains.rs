//! Unknown drive gains and payloads of simulated robots: found within their deviations, serial and
//! with a closed loop, and refused if nothing determines the scale.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod constrained;
mod instruments;
mod loops;
mod robust;
mod sampling;

use nalgebra::{DMatrix, DVector};
use regen_codegen::diag::Source;
use regen_codegen::pipeline;
use regen_codegen::robot::Robot;
use regen_identify::gains::{
    CarriedRun, GainError, GainFit, GainOptions, KnownPayload, KnownRobot, Plan, fit,
};
use regen_identify::model::{IdentifiedModel, Interval};
use regen_identify::states::{Recorded, StateSample};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_reference::Random;
use regen_runtime::{BaseModel, LoopClosure, Model};

const STEP: f64 = 0.02;
const SAMPLES: u32 = 600;
const SEEDS: u64 = 4;
/// Standard deviation of the noise of currents, A.
const NOISE: f64 = 0.01;

fn file(path: &str) -> String {
    let path = format!("{}/../{path}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).unwrap()
}

fn derived(text: &str) -> Robot {
    pipeline::derive(&Source::new("robot.yaml", text)).unwrap()
}

/// An arm of three joints whose load has all ten parameters.
fn arm() -> Robot {
    derived(&file("tests/fixtures/mechanisms/payload.yaml"))
}

/// A five-bar with a load at its tip.
fn fivebar(more: &str) -> Robot {
    let limb = "limbs:\n  - name: tool\n    from: 2\n    joints:\n      - {type: fixed, origin: {xyz: \
                [0.4, 0, 0]}, body: load, payload: true}\n";
    let text = file("robots/fivebar.yaml").replacen("limbs:\n", limb, 1);
    let load = "  load: {mass: 0.7, com: [0.02, 0.01, 0.03], inertia: [0.001, 0, 0, 0.002, 0, \
                0.0015]}\n";
    derived(&format!("{text}{load}{more}"))
}

fn normal(random: &mut Random) -> f64 {
    let (u, v) = (random.uniform(1e-12, 1.0), random.uniform(0.0, 1.0));
    (-2.0 * f64::ln(u)).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A simulated robot.
#[derive(Clone)]
struct Twin<'m> {
    model: &'m Interpreted<'m>,
    gains: Vec<f64>,
    beta: Vec<f64>,
    /// The part of the currents that are off by 1 A.
    outliers: f64,
}

impl<'m> Twin<'m> {
    fn new(model: &'m Interpreted<'m>, gains: &[f64]) -> Self {
        let info = model.info();
        let values = info.nominal.iter().zip(info.parameters);
        // what the description leaves open is a coefficient of friction
        let phi: Vec<f64> = values.map(|(v, _)| v.unwrap_or(0.3)).collect();
        let mut beta = vec![0.0; model.rank()];
        BaseModel::<f64>::to_base(model, &phi, &mut beta).unwrap();
        Self {
            model,
            gains: gains.to_vec(),
            beta,
            outliers: 0.0,
        }
    }

    /// The twin with a load of these parameters about the origin of its frame.
    fn with_load(&self, values: &[(&str, f64)]) -> Self {
        let mut out = self.clone();
        let base = self.model.base_info().base;
        for (name, value) in values {
            let label = format!("{name}(load)");
            let place = base.iter().position(|b| b.label == label).expect(name);
            assert_eq!(
                base[place].terms.len(),
                1,
                "{name} alone is a base parameter"
            );
            out.beta[place] = *value;
        }
        out
    }

    /// The base parameters of the load, as places.
    fn load(&self) -> Vec<usize> {
        let base = self.model.base_info().base.iter().enumerate();
        base.filter(|(_, b)| b.label.ends_with("(load)"))
            .map(|(k, _)| k)
            .collect()
    }

    /// A run with noisy currents of all drives.
    fn run(&self, carried: bool, random: &mut Random) -> Recorded {
        let info = self.model.info();
        let (n, dof) = (info.coordinates.len(), info.dof());
        let mut beta = self.beta.clone();
        if !carried {
            for k in self.load() {
                beta[k] = 0.0;
            }
        }
        let waves: Vec<[f64; 3]> = (0..dof * 3)
            .map(|k| {
                // loops close near home only
                let is_driven = info.independent == info.actuated;
                let size = match (n > dof, is_driven) {
                    (false, _) => 0.5,
                    (true, true) => 0.15,
                    (true, false) => 0.06,
                };
                let hertz = 0.3 * (1 + k / dof) as f64 + 0.05 * random.uniform(0.0, 1.0);
                let w = std::f64::consts::TAU * hertz;
                [size, w, random.uniform(0.0, 6.0)]
            })
            .collect();
        let mut closure = (n > dof).then(|| LoopClosure::new(self.model).unwrap());
        let mut noise = vec![0.0; dof];
        let mut log = Recorded::new();
        for k in 0..SAMPLES {
            let t = STEP * f64::from(k);
            let mut own = [vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]];
            for (j, [size, w, phase]) in waves.iter().enumerate() {
                let (sin, cos) = (w * t + phase).sin_cos();
                own[0][j % dof] += size * sin;
                own[1][j % dof] += size * w * cos;
                own[2][j % dof] -= size * w * w * sin;
            }
            for (q, c) in own[0].iter_mut().zip(info.independent) {
                *q += info.home[*c];
            }
            let [q, qd, qdd] = match &mut closure {
                None => own,
                Some(closure) => {
                    let state = closure.track_state(&own[0], &own[1], &own[2]).unwrap();
                    assert!(state.outcome.is_closed());
                    [state.q, state.qd, state.qdd]
                }
            };
            let mut tau = vec![0.0; dof];
            let condition = self
                .model
                .base_inverse_dynamics(&q, &qd, &qdd, &beta, &mut tau);
            assert!(condition.unwrap().is_regular());
            // efforts of the drives that give these forces
            let mut forces = DMatrix::zeros(dof, dof);
            for a in 0..dof {
                let mut unit = vec![0.0; dof];
                unit[a] = 1.0;
                let mut column = vec![0.0; dof];
                let _ = self
                    .model
                    .generalized_forces(&q, &unit, &mut column)
                    .unwrap();
                forces.set_column(a, &DVector::from_vec(column));
            }
            let efforts = forces.clone().lu().solve(&DVector::from_vec(tau)).unwrap();
            // noise that is correlated in time
            let currents: Vec<f64> = (0..dof)
                .map(|a| {
                    noise[a] = 0.6 * noise[a] + 0.8 * NOISE * normal(random);
                    let is_off = self.outliers > random.uniform(0.0, 1.0);
                    let off = if is_off { normal(random).signum() } else { 0.0 };
                    efforts[a] / self.gains[a] + noise[a] + off
                })
                .collect();
            let tau = &forces * DVector::from_vec(currents.clone());
            log.push_row(&StateSample {
                time: t,
                q: &q,
                qd: &qd,
                qdd: &qdd,
                tau: tau.as_slice(),
                efforts: &currents,
                held: &[],
                at_standstill: &vec![false; n],
                weights: &vec![1.0; dof],
                follows: k > 0,
                bridged: false,
            });
        }
        log
    }

    /// Runs without and with the load.
    fn runs(&self, seed: u64) -> [Recorded; 2] {
        let mut random = Random::new(seed);
        [self.run(false, &mut random), self.run(true, &mut random)]
    }

    /// Fits runs without and with the load.
    fn fit(&self, plan: &Plan, seed: u64) -> Result<GainFit, GainError> {
        fit(
            self.model,
            &GainOptions::default(),
            plan,
            &mut carried(&mut self.runs(seed)),
        )
    }

    fn names(&self) -> Vec<String> {
        let info = self.model.info();
        let names = info.actuated.iter().map(|c| info.coordinates[*c]);
        names.map(str::to_owned).collect()
    }
}

/// A run without the load, and one with it.
fn carried(runs: &mut [Recorded; 2]) -> [CarriedRun<'_, Recorded>; 2] {
    let [free, loaded] = runs;
    [
        CarriedRun {
            source: free,
            carried: None,
        },
        CarriedRun {
            source: loaded,
            carried: Some(0),
        },
    ]
}

/// How many of its deviations a value is off; 0 where both are to rounding.
fn off(value: f64, truth: f64, interval: Option<Interval>) -> f64 {
    let interval = interval.expect("an interval");
    assert!(interval.low < value && value < interval.high && interval.sigma > 0.0);
    (value - truth).abs() / interval.sigma
}

/// Checks gains, base parameters and payload against the truth; returns how many of all are beyond
/// two deviations, and how many there are.
fn check_against_truth(twin: &Twin<'_>, found: &GainFit, truth: &[(&str, f64)]) -> (usize, usize) {
    let model = &found.model;
    let mut ratios = Vec::new();
    let names = twin.names();
    for gain in &model.gains {
        let place = names.iter().position(|name| *name == gain.effort).unwrap();
        ratios.push((
            gain.effort.clone(),
            off(gain.value, twin.gains[place], gain.interval),
        ));
    }
    let base = twin.model.base_info().base;
    for (k, (value, exact)) in model.beta.iter().zip(&twin.beta).enumerate() {
        let label = base[k].label.to_owned();
        match model.intervals.base[k] {
            // what was given of the payload is a base parameter
            None => assert!((value - exact).abs() < 1e-12, "{label}"),
            interval => ratios.push((label, off(*value, *exact, interval))),
        }
    }
    for (name, exact) in truth {
        let values = &model.payloads[0].values;
        let value = values.iter().find(|v| v.name == *name).expect(name);
        if value.is_known {
            // a known value is taken as it is
            assert_eq!(value.value.to_bits(), exact.to_bits(), "{name}");
        } else {
            ratios.push(((*name).to_owned(), off(value.value, *exact, value.interval)));
        }
    }
    for (name, ratio) in &ratios {
        assert!(*ratio < 4.0, "{name} is off by {ratio} of its deviation");
    }
    let beyond = ratios.iter().filter(|r| r.1 > 2.0).count();
    (beyond, ratios.len())
}

const LOAD: [(&str, f64); 10] = [
    ("m", 2.2),
    ("cx", 0.02),
    ("cy", 0.01),
    ("cz", 0.04),
    ("Ixx", 0.006),
    ("Ixy", 0.001),
    ("Ixz", 0.0),
    ("Iyy", 0.007),
    ("Iyz", 0.0),
    ("Izz", 0.004),
];

fn known(mass: Option<f64>) -> KnownPayload {
    KnownPayload {
        body: "load".to_owned(),
        mass,
        ..KnownPayload::default()
    }
}

/// All gains are unknown, and all of the load but its mass, if that is given.
fn unknown(twin: &Twin<'_>, mass: Option<f64>) -> Plan {
    Plan {
        unknown_gains: twin.names(),
        payloads: vec![known(mass)],
        robot: None,
    }
}

/// The robot and its gains are known from another fit, with or without their covariance.
fn weighing(before: &IdentifiedModel, with_covariance: bool) -> Plan {
    let gains = before.gains.iter().map(|g| (g.effort.clone(), g.value));
    let gains: Vec<(String, f64)> = gains.collect();
    Plan {
        unknown_gains: gains.iter().map(|(name, _)| name.clone()).collect(),
        payloads: vec![known(None)],
        robot: Some(KnownRobot {
            beta: before.beta.clone(),
            gains,
            covariance: before.covariance.clone().filter(|_| with_covariance),
        }),
    }
}

#[test]
fn gains_and_payload_of_an_arm_are_found_within_their_deviations() {
    let robot = arm();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let twin = Twin::new(&model, &[8.0, -12.0, 3.0]);
    let mass = KnownPayload {
        mass: Some(2.2),
        ..known(None)
    };
    let all = twin.names();
    let inertia = Some([0.006, 0.001, 0.0, 0.007, 0.0, 0.004]);
    let mut beyond = (0, 0);
    for (unknown_gains, payload) in [
        // the mass tells the scale of all gains
        (all.clone(), mass.clone()),
        // one known gain tells that of the others and of the payload
        (all[..2].to_vec(), known(None)),
        // an inertia about a centre of mass that is found
        (all.clone(), KnownPayload { inertia, ..mass }),
    ] {
        let mut twin = Twin::new(&model, &twin.gains);
        for (name, gain) in twin.names().iter().zip(&mut twin.gains) {
            if !unknown_gains.contains(name) {
                *gain = 1.0;
            }
        }
        let plan = Plan {
            unknown_gains,
            payloads: vec![payload],
            robot: None,
        };
        for seed in 0..SEEDS {
            let found = twin.fit(&plan, seed).unwrap();
            let (more, of) = check_against_truth(&twin, &found, &LOAD);
            beyond = (beyond.0 + more, beyond.1 + of);
        }
    }
    // 5 % are expected
    assert!(beyond.0 * 8 < beyond.1, "{beyond:?}");
}

#[test]
fn a_closed_loop_has_its_gains_and_payload_found_whichever_coordinates_are_independent() {
    for more in ["", "independent: [q1, q2]\n"] {
        let robot = fivebar(more);
        let terms = BaseTerms::new(&robot);
        let model = Interpreted::with_terms(&robot, &terms);
        let twin = Twin::new(&model, &[2.0, 5.0]);
        let plan = unknown(&twin, Some(0.7));
        for seed in 0..SEEDS / 2 {
            let found = twin.fit(&plan, seed).unwrap();
            // in its plane, the load has no inertia about other axes
            let in_plane = [("m", 0.7), ("cx", 0.02), ("cy", 0.01), ("Izz", 0.0015)];
            check_against_truth(&twin, &found, &in_plane);
            let told = &found.model.payloads[0].values;
            assert_eq!(told.len(), in_plane.len(), "{told:?}");
        }
    }
}

#[test]
fn a_scale_that_nothing_fixes_is_refused_by_the_names_of_the_gains() {
    let robot = arm();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let twin = Twin::new(&model, &[8.0, 12.0, 3.0]);
    let plan = unknown(&twin, None);
    let Err(GainError::Undetermined {
        rank,
        unknowns,
        free,
    }) = twin.fit(&plan, 1)
    else {
        panic!("refused");
    };
    assert_eq!((unknowns - rank, free.len()), (1, 1), "{free:?}");
    assert!(free[0].is_scale);
    assert_eq!(free[0].names[..3], ["gain(q1)", "gain(q2)", "gain(q3)"]);
    assert!(free[0].names.iter().any(|name| name == "m(load)"));

    // a centre of mass has no unit of mass in it
    let com = KnownPayload {
        com: Some([0.02, 0.01, 0.04]),
        ..known(None)
    };
    let plan = Plan {
        payloads: vec![com],
        ..plan
    };
    let refused = twin.fit(&plan, 1).unwrap_err();
    assert!(refused.to_string().contains("nothing determines the scale"));

    let nothing = Plan {
        unknown_gains: Vec::new(),
        payloads: vec![KnownPayload {
            com: Some([0.0; 3]),
            inertia: Some([0.0; 6]),
            ..known(Some(1.0))
        }],
        robot: Some(KnownRobot {
            beta: twin.beta.clone(),
            ..KnownRobot::default()
        }),
    };
    assert_eq!(
        twin.fit(&nothing, 1).unwrap_err(),
        GainError::NothingUnknown
    );
    let other = Plan {
        unknown_gains: vec!["q9".to_owned()],
        ..Plan::default()
    };
    let refused = twin.fit(&other, 1).unwrap_err();
    assert_eq!(refused, GainError::NoEffort("q9".to_owned()));
    let body = Plan {
        payloads: vec![KnownPayload {
            body: "fore".to_owned(),
            ..KnownPayload::default()
        }],
        ..Plan::default()
    };
    // the body of a link has its own base parameters joined with those of others
    let refused = twin.fit(&body, 1).unwrap_err();
    assert_eq!(refused, GainError::NoPayload("fore".to_owned()));
}

#[test]
fn a_load_on_an_identified_robot_has_the_robot_s_uncertainty_in_its_own() {
    let robot = arm();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let twin = Twin::new(&model, &[8.0, 12.0, 3.0]);
    let joint = unknown(&twin, Some(2.2));
    for seed in 0..SEEDS {
        let before = twin.fit(&joint, seed).unwrap().model;
        let mut random = Random::new(100 + seed);
        let mut loaded = twin.run(true, &mut random);
        let mut run = |with: bool| {
            let plan = weighing(&before, with);
            let mut runs = [CarriedRun {
                source: &mut loaded,
                carried: Some(0),
            }];
            fit(&model, &GainOptions::default(), &plan, &mut runs).unwrap()
        };
        let (whole, exact) = (run(true), run(false));
        assert!(exact.is_robot_exact && !whole.is_robot_exact);
        for (value, narrow) in whole.model.payloads[0]
            .values
            .iter()
            .zip(&exact.model.payloads[0].values)
        {
            let truth = LOAD.iter().find(|l| l.0 == value.name).unwrap().1;
            let ratio = off(value.value, truth, value.interval);
            assert!(ratio < 4.0, "{}: {ratio}", value.name);
            let (own, less) = (
                value.interval.unwrap().sigma,
                narrow.interval.unwrap().sigma,
            );
            assert!(own > less, "{}: {own} {less}", value.name);
        }
        // another load on the same arm, weighed to better than a part in a hundred
        let mass = &whole.model.payloads[0].values[0];
        assert!(mass.interval.unwrap().sigma < 0.01 * mass.value);
    }
}
