//! Three joints that swing a load of one moment each, all the same: a model whose logs are known in closed
//! form, to try mistakes in them.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::data::{Logs, Settings};
use crate::intervals::Random;
use regen_runtime::{
    Arguments, BaseFunction, BaseInfo, BaseParameter, BaseTerm, Condition, Function, Info, Joint,
    Model, Parameter, SizeError, Symbol,
};

const DOF: usize = 3;
const COLUMNS: usize = 7;
/// The inertias, the moment, and the viscous friction.
const TRUTH: [f64; COLUMNS] = [0.5, 0.3, 0.4, 0.6, 0.2, 0.1, 0.15];

const PARAMETERS: [Parameter<'static>; COLUMNS] = [
    Parameter::new(Symbol::Izz, "1"),
    Parameter::new(Symbol::Izz, "2"),
    Parameter::new(Symbol::Izz, "3"),
    Parameter::new(Symbol::Mx, "1"),
    Parameter::new(Symbol::Friction("Fv"), "q1"),
    Parameter::new(Symbol::Friction("Fv"), "q2"),
    Parameter::new(Symbol::Friction("Fv"), "q3"),
];

const fn alone(parameter: &'static str, index: usize) -> [BaseTerm<'static>; 1] {
    [BaseTerm {
        parameter,
        index,
        coefficient: "1",
        value: 1.0,
    }]
}

const TERMS: [[BaseTerm<'static>; 1]; COLUMNS] = [
    alone("Izz(1)", 0),
    alone("Izz(2)", 1),
    alone("Izz(3)", 2),
    alone("mx(1)", 3),
    alone("Fv(q1)", 4),
    alone("Fv(q2)", 5),
    alone("Fv(q3)", 6),
];

const BASE: [BaseParameter<'static>; COLUMNS] = [
    BaseParameter {
        label: "Izz(1)",
        terms: &TERMS[0],
    },
    BaseParameter {
        label: "Izz(2)",
        terms: &TERMS[1],
    },
    BaseParameter {
        label: "Izz(3)",
        terms: &TERMS[2],
    },
    BaseParameter {
        label: "mx(1)",
        terms: &TERMS[3],
    },
    BaseParameter {
        label: "Fv(q1)",
        terms: &TERMS[4],
    },
    BaseParameter {
        label: "Fv(q2)",
        terms: &TERMS[5],
    },
    BaseParameter {
        label: "Fv(q3)",
        terms: &TERMS[6],
    },
];

/// The model, with nominal bodies or without.
pub(crate) struct Swings {
    nominal: Vec<Option<f64>>,
    pub(crate) joints: Vec<Joint>,
    pub(super) parameters: Vec<Parameter<'static>>,
}

/// Row `i` of the regressor.
fn row(i: usize, q: f64, qd: f64, qdd: f64) -> [f64; COLUMNS] {
    let mut out = [0.0; COLUMNS];
    out[i] = qdd;
    out[DOF] = 9.81 * q.sin();
    out[DOF + 1 + i] = qd;
    out
}

impl Model for Swings {
    fn info(&self) -> Info<'_> {
        Info {
            name: "swings",
            coordinates: &["q1", "q2", "q3"],
            independent: &[0, 1, 2],
            actuated: &[0, 1, 2],
            parameters: &self.parameters,
            home: &[0.0; DOF],
            joints: &self.joints,
            nominal: &self.nominal,
            ..Info::EMPTY
        }
    }

    fn eval(
        &self,
        function: Function,
        x: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        match function {
            Function::Velocities => out.copy_from_slice(x.qd_i),
            Function::Accelerations => out.copy_from_slice(x.qdd_i),
            Function::GeneralizedForces => out.copy_from_slice(x.tau_actuated),
            _ => {}
        }
        Ok(Condition::regular(0.0))
    }
}

impl BaseModel for Swings {
    fn base_info(&self) -> BaseInfo<'_> {
        BaseInfo {
            base: &BASE,
            free: &[],
            certificate: None,
            complete: true,
        }
    }

    fn eval_base(
        &self,
        function: BaseFunction,
        x: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        match function {
            BaseFunction::BaseRegressor => {
                for i in 0..DOF {
                    for (k, entry) in row(i, x.q[i], x.qd[i], x.qdd[i]).into_iter().enumerate() {
                        out[k * DOF + i] = entry;
                    }
                }
            }
            BaseFunction::ToBase => out.copy_from_slice(x.phi),
            BaseFunction::BaseMassMatrix => {
                out.fill(0.0);
                for i in 0..DOF {
                    out[i * (DOF + 1)] = x.beta[i];
                }
            }
            _ => {}
        }
        Ok(Condition::regular(0.0))
    }
}

pub(crate) fn swings(has_nominal: bool) -> Swings {
    let stated = TRUTH[..4].iter().map(|x| Some(1.05 * x));
    let nominal = stated.chain([None; 3]).collect();
    Swings {
        nominal: if has_nominal { nominal } else { Vec::new() },
        joints: vec![Joint::ROTATION, Joint::ROTATION, Joint::TRANSLATION],
        parameters: PARAMETERS.to_vec(),
    }
}

/// The log of this model, whose columns have the usual names.
pub(super) fn columns(model: &Swings) -> LogColumns<'_, Swings> {
    LogColumns {
        file: "log.csv",
        given: &[],
        model,
    }
}

/// The states of a log, with a little noise in the efforts.
pub(super) fn sample() -> Sample {
    sample_of(400, 0.02)
}

/// So many states, with noise of this deviation.
pub(super) fn sample_of(states: u32, noise: f64) -> Sample {
    let mut random = Random(7);
    let waves = [(1.1, 2.3, 0.2), (0.8, 3.1, 1.3), (0.6, 4.3, 2.2)];
    let mut state = |k: u32| {
        let time = 0.02 * f64::from(k);
        let mut own = Measured {
            time,
            motion: [vec![], vec![], vec![]],
            ..Measured::default()
        };
        for (i, (size, w, phase)) in waves.into_iter().enumerate() {
            let (s, c) = (w * time + phase).sin_cos();
            let (s2, c2) = (1.7 * w * time).sin_cos();
            let q = size * (s + 0.3 * c2) + 0.1;
            let qd = size * w * (c - 0.51 * s2);
            let qdd = -size * w * w * (s + 0.867 * c2);
            let tau: f64 = row(i, q, qd, qdd)
                .iter()
                .zip(TRUTH)
                .map(|(w, x)| w * x)
                .sum();
            for (list, value) in own.motion.iter_mut().zip([q, qd, qdd]) {
                list.push(value);
            }
            own.efforts.push(tau + noise * random.normal());
        }
        own
    };
    Sample {
        measured: vec![0, 1, 2],
        states: (0..states).map(&mut state).collect(),
        step: 0.02,
        whole: states as usize,
        ..Sample::default()
    }
}

/// The sample with another reading of the efforts and the positions of each state.
pub(super) fn with(change: impl Fn(&mut Measured)) -> Sample {
    let mut out = sample();
    out.states.iter_mut().for_each(change);
    out
}

/// A factor on the position of a joint and its derivatives.
pub(super) fn scale(state: &mut Measured, k: usize, factor: f64) {
    state.motion.iter_mut().for_each(|of| of[k] *= factor);
}

/// The largest difference between the quantities of two samples, over their size.
fn difference(one: &Sample, other: &Sample) -> f64 {
    let mut most: f64 = 0.0;
    for (a, b) in one.states.iter().zip(&other.states) {
        let pairs = a.motion[0].iter().zip(&b.motion[0]);
        let pairs = pairs.chain(a.motion[2].iter().zip(&b.motion[2]));
        for (x, y) in pairs.chain(a.efforts.iter().zip(&b.efforts)) {
            most = most.max((x - y).abs() / (1.0 + x.abs().min(y.abs())));
        }
    }
    most
}

/// The change that is found in a sample, if there is one.
fn found(model: &Swings, sample: &Sample, own: [f64; 3]) -> Option<Change> {
    look(model, sample, &own, None, &mut |_, _| {}).change
}

/// Reads a log with the change that is found in it: it must be the log without the mistake.
#[track_caller]
fn assert_undone(what: &str, model: &Swings, mistaken: &Sample, own: [f64; 3], tolerance: f64) {
    let change = found(model, mistaken, own).unwrap_or_else(|| panic!("{what}: nothing is found"));
    let apart = difference(&mistaken.read_with(&change), &sample());
    assert!(apart < tolerance, "{what}: {apart} apart with {change:?}");
}

#[test]
fn a_log_without_a_mistake_is_left_as_it_is() {
    for has_nominal in [true, false] {
        let model = swings(has_nominal);
        assert_eq!(found(&model, &sample(), [1.0; 3]), None);
        let findings = look(&model, &sample(), &[1.0; 3], None, &mut |_, _| {});
        assert!(findings.driving.is_empty() && findings.far.is_empty());
        assert_eq!(findings.errors.len(), 3);
        assert!(worst(&findings.errors) < 0.02, "{:?}", findings.errors);
        assert_eq!(findings.nominal.len(), if has_nominal { 3 } else { 0 });
        for own in &findings.nominal {
            assert_eq!(own.equation, own.effort);
            assert!(
                (0.99..1.0 + 1e-9).contains(&own.correlation)
                    && (own.factor * 1.05 - 1.0).abs() < 0.01,
                "{own:?}"
            );
            assert!((0.3..1.01).contains(&own.part), "{own:?}");
        }
    }
}

#[test]
fn the_change_that_is_found_undoes_a_mistake_in_efforts() {
    let model = swings(true);
    let one = [1.0; 3];
    assert_undone(
        "two swapped",
        &model,
        &with(|s| s.efforts.swap(0, 2)),
        one,
        1e-9,
    );
    assert_undone(
        "all turned round",
        &model,
        &with(|s| s.efforts.rotate_left(1)),
        one,
        1e-9,
    );
    assert_undone("a sign", &model, &with(|s| s.efforts[1] *= -1.0), one, 1e-9);
    let both = with(|s| {
        s.efforts.swap(0, 1);
        s.efforts[0] *= -1.0;
    });
    assert_undone("swapped with a sign", &model, &both, one, 1e-9);
    let turned = with(|s| {
        s.efforts.rotate_left(1);
        s.efforts[2] *= -1.0;
    });
    assert_undone("turned round with a sign", &model, &turned, one, 1e-9);
    assert_undone("a unit", &model, &with(|s| s.efforts[2] *= 1e3), one, 1e-9);
    assert_undone(
        "a constant",
        &model,
        &with(|s| s.efforts[1] += 2.0),
        one,
        0.1,
    );
}

#[test]
fn torque_constants_stay_with_their_joints_where_columns_are_exchanged() {
    let model = swings(true);
    let own = [2.0, 5.0, 0.7];
    // efforts are columns times the constants of the joints that they are read for
    let exchanged = |order: [usize; 3]| {
        with(|s| {
            let column: Vec<f64> = (0..3)
                .map(|k| s.efforts[order[k]] / own[order[k]])
                .collect();
            s.efforts = (0..3).map(|k| own[k] * column[k]).collect();
        })
    };
    assert_undone("two columns", &model, &exchanged([1, 0, 2]), own, 1e-9);
    assert_undone("three columns", &model, &exchanged([1, 2, 0]), own, 1e-9);
}

#[test]
fn the_change_that_is_found_undoes_a_mistake_in_positions() {
    let model = swings(true);
    let one = [1.0; 3];
    let degrees = with(|s| scale(s, 0, 180.0 / core::f64::consts::PI));
    assert_undone("one in degrees", &model, &degrees, one, 1e-9);
    let all = with(|s| (0..2).for_each(|k| scale(s, k, 180.0 / core::f64::consts::PI)));
    assert_undone("rotations in degrees", &model, &all, one, 1e-9);
    assert_undone("one in mm", &model, &with(|s| scale(s, 2, 1e3)), one, 1e-9);
    let turns = with(|s| scale(s, 1, 1.0 / core::f64::consts::TAU));
    assert_undone("one in turns", &model, &turns, one, 1e-9);
    let both = with(|s| {
        scale(s, 0, 100.0);
        s.efforts[1] *= 1e3;
    });
    assert_undone("a gear and a unit", &model, &both, one, 1e-9);
    assert_undone(
        "a zero",
        &model,
        &with(|s| s.motion[0][1] += 0.3),
        one,
        0.02,
    );
}

#[test]
fn the_ratio_of_a_position_is_told_to_be_that_of_a_gear() {
    let model = swings(false);
    for (k, factor) in [(0, 0.5), (1, 1.0 / core::f64::consts::TAU), (2, 3.0)] {
        let what = format!("{factor} times q{}", k + 1);
        let mistaken = with(|s| scale(s, k, factor));
        assert_undone(&what, &model, &mistaken, [1.0; 3], 1e-9);
    }
    // less may be an error of the geometry
    assert_eq!(found(&model, &with(|s| scale(s, 1, 1.1)), [1.0; 3]), None);
}

#[test]
fn efforts_that_are_all_late_are_told_with_how_late_they_are() {
    let model = swings(true);
    for late in [0.05, 0.15, -0.08] {
        let log = written(&format!("behind-{late}"), 4000, late, |_| true);
        let settings = Settings {
            method: crate::signals::Method::Butterworth {
                order: 4,
                cutoff: 8.0,
            },
            ..Settings::default()
        };
        let logs = Logs::open(&model, std::slice::from_ref(&log.0), &settings).unwrap();
        let change = found(&model, &logs.sample(0).unwrap(), [1.0; 3]).unwrap();
        assert!((change.behind - late).abs() < 2e-3, "{late}: {change:?}");
        // those that are corrected are none any more
        let names = ["q1", "q2", "q3"].map(|name| (name.to_owned(), late));
        let settings = Settings {
            delays: names.to_vec(),
            ..settings.clone()
        };
        let logs = Logs::open(&model, std::slice::from_ref(&log.0), &settings).unwrap();
        assert_eq!(
            found(&model, &logs.sample(0).unwrap(), [1.0; 3]),
            None,
            "{late}"
        );
    }
}

#[test]
fn states_that_the_filter_bends_are_no_part_of_a_sample() {
    let model = swings(true);
    let mut text = "t,q1,q2,q3,tau_q1,tau_q2,tau_q3\n".to_owned();
    for k in 0..4000 {
        let t = 0.005 * f64::from(k);
        let burst = 0.3 * (6.0 * core::f64::consts::TAU * t).sin();
        let burst = burst * (-((t - 8.5) / 0.15).powi(2)).exp();
        let cells = [
            t,
            (2.0 * t).sin() + burst,
            (3.0 * t).cos(),
            0.1 * t.sin(),
            0.0,
            0.0,
            0.0,
        ];
        let cells: Vec<String> = cells.iter().map(ToString::to_string).collect();
        text += &(cells.join(",") + "\n");
    }
    let log = Written::new("bent", &text);
    let settings = Settings {
        method: crate::signals::Method::Butterworth {
            order: 4,
            cutoff: 4.0,
        },
        ..Settings::default()
    };
    let logs = Logs::open(&model, std::slice::from_ref(&log.0), &settings).unwrap();
    let sample = logs.sample(0).unwrap();
    let count = |from: f64, to: f64| {
        let within = |own: &&Measured| (from..to).contains(&own.time);
        sample.states.iter().filter(within).count()
    };
    assert!(count(8.3, 8.7) < 10 && count(2.3, 2.7) > 15 && count(15.3, 15.7) > 15);
}

#[test]
fn another_unit_in_which_a_joint_would_hardly_move_is_not_looked_for() {
    let model = swings(true);
    let small = with(|s| {
        for (k, own) in s.motion.iter_mut().enumerate() {
            own[0] = 0.4 * own[0] + if k == 0 { 1.0 } else { 0.0 };
        }
        s.efforts[0] = 3.0 * (s.time * 1.7).sin();
    });
    let change = found(&model, &small, [1.0; 3]);
    let degree = core::f64::consts::PI / 180.0;
    let is_degree = |own: &Reading| (own.factor - degree).abs() < 1e-9;
    assert!(!change.is_some_and(|change| change.positions.iter().any(is_degree)));
}

#[test]
fn a_drift_of_an_effort_is_told_with_its_size() {
    let model = swings(false);
    let of = |change: f64| {
        let all = sample();
        let last = all.states.last().map_or(1.0, |s| s.time);
        let drifting = with(|s| s.efforts[2] += change * s.time / last);
        look(&model, &drifting, &[1.0; 3], None, &mut |_, _| {}).drifts
    };
    assert_eq!(of(0.0), []);
    let found = of(3.0);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].effort, 2);
    let Drifting::Constant(change) = found[0].change else {
        panic!("{found:?}");
    };
    assert!((change / 3.0 - 1.0).abs() < 0.3, "{found:?}");
}

#[test]
fn what_a_slow_motion_explains_is_no_drift() {
    let model = swings(false);
    let all = sample();
    let last = all.states.last().map_or(1.0, |s| s.time);
    // a joint that goes once from one end to the other, and a moment that the model lacks
    let swept = |moment: f64, drift: f64| {
        let mut out = all.clone();
        for own in &mut out.states {
            let part = own.time / last;
            let (q, qd) = (2.0 * part - 1.0 + 0.05 * (2.0 * own.time).sin(), 2.0 / last);
            let list = [
                q,
                qd + 0.1 * (2.0 * own.time).cos(),
                -0.2 * (2.0 * own.time).sin(),
            ];
            for (of, value) in own.motion.iter_mut().zip(list) {
                of[2] = value;
            }
            let [q, qd, qdd] = list;
            own.efforts[2] =
                0.4 * qdd + 0.6 * 9.81 * q.sin() + 0.15 * qd + moment * q + drift * part;
        }
        let grams = Grams::of(&model, &out, &Reading::plain(3), 1).unwrap();
        let fit = grams.fit(&Reading::plain(3), &[]).unwrap();
        drifts::search(&out, &grams, &fit)
    };
    assert_eq!(swept(4.0, 0.0), []);
}

#[test]
fn a_gain_that_grows_is_told_with_its_size() {
    let model = swings(false);
    let of = |growth: f64| {
        let last = sample().states.last().map_or(1.0, |s| s.time);
        let grown = with(|s| s.efforts[1] *= 1.0 + growth * (s.time / last - 0.5));
        look(&model, &grown, &[1.0; 3], None, &mut |_, _| {}).drifts
    };
    assert_eq!(of(0.02), []);
    for growth in [0.2, -0.3] {
        let found = of(growth);
        let [own] = found[..] else {
            panic!("{found:?}");
        };
        let Drifting::Gain(change) = own.change else {
            panic!("{own:?}");
        };
        // parameters of this effort alone take a part of it up
        assert!(
            own.effort == 1 && (change / growth - 1.0).abs() < 0.3,
            "{own:?}"
        );
    }
}

#[test]
fn a_factor_that_leaves_noise_is_told_however_small_it_is() {
    let model = swings(false);
    let change = found(&model, &with(|s| s.efforts[1] *= 1.2), [1.0; 3]).unwrap();
    let factors: Vec<f64> = change.efforts.iter().map(|own| own.factor).collect();
    assert!((factors[1] * 1.2 - 1.0).abs() < 0.02, "{change:?}");
    assert!((factors[0] - 1.0).abs() < 1e-9 && (factors[2] - 1.0).abs() < 1e-9);
}

#[test]
fn friction_that_no_nominal_body_has_does_not_disturb_the_comparison_with_them() {
    let model = swings(true);
    let mut rough = sample();
    for state in &mut rough.states {
        for (effort, qd) in state.efforts.iter_mut().zip(&state.motion[1]) {
            *effort += 2.0 * qd;
        }
    }
    let findings = look(&model, &rough, &[1.0; 3], None, &mut |_, _| {});
    assert_eq!((findings.change, findings.nominal.len()), (None, 3));
    for own in &findings.nominal {
        assert!(
            (0.99..1.0 + 1e-9).contains(&own.correlation) && (own.factor * 1.05 - 1.0).abs() < 0.01,
            "{own:?}"
        );
    }
}

#[test]
fn signs_that_leave_the_errors_as_they_are_are_told_by_friction() {
    let model = swings(false);
    let flipped = with(|s| s.efforts.iter_mut().for_each(|u| *u *= -1.0));
    assert_undone("all signs", &model, &flipped, [1.0; 3], 1e-9);
    let change = found(&model, &flipped, [1.0; 3]).unwrap();
    assert!(change.sign, "{change:?}");
}

#[test]
fn a_zero_that_is_a_quarter_of_a_turn_off_is_told_as_such() {
    let model = swings(true);
    let quarter = core::f64::consts::FRAC_PI_2;
    let shifted = with(|s| s.motion[0][0] += quarter);
    let change = found(&model, &shifted, [1.0; 3]).unwrap();
    assert!(
        (change.positions[0].offset + quarter).abs() < 1e-12,
        "{change:?}"
    );
    // that of a sliding joint is no angle
    let shifted = with(|s| s.motion[0][2] += quarter);
    let change = found(&model, &shifted, [1.0; 3]).unwrap();
    let off = (change.positions[2].offset + quarter).abs();
    assert!(off > 1e-12 && off < 0.02, "{change:?}");
}

#[test]
fn three_equations_are_needed_for_each_parameter() {
    assert_eq!(least_states(&swings(true)), 7);
}

/// Writes a log of so many rows, 5 ms apart, whose efforts are late by this time, s.
///
/// - `has`: whether a row is in it.
pub(crate) fn written(name: &str, rows: u32, late: f64, has: impl Fn(u32) -> bool) -> Written {
    let mut random = Random(13);
    let waves = [(1.1, 2.3, 0.2), (0.8, 3.1, 1.3), (0.6, 4.3, 2.2)];
    let motion = |i: usize, t: f64| {
        let (size, w, phase) = waves[i];
        let (s, c) = (w * t + phase).sin_cos();
        let (s2, c2) = (1.7 * w * t).sin_cos();
        let q = size * (s + 0.3 * c2) + 0.1;
        [
            q,
            size * w * (c - 0.51 * s2),
            -size * w * w * (s + 0.867 * c2),
        ]
    };
    let mut text = "t,q1,q2,q3,tau_q1,tau_q2,tau_q3\n".to_owned();
    for k in 0..rows {
        let t = 0.005 * f64::from(k);
        let mut cells = vec![t];
        cells.extend((0..DOF).map(|i| motion(i, t)[0]));
        for i in 0..DOF {
            let [q, qd, qdd] = motion(i, t - late);
            let tau: f64 = row(i, q, qd, qdd)
                .iter()
                .zip(TRUTH)
                .map(|(w, x)| w * x)
                .sum();
            cells.push(tau + 0.02 * random.normal());
        }
        if has(k) {
            let cells: Vec<String> = cells.iter().map(ToString::to_string).collect();
            text += &(cells.join(",") + "\n");
        }
    }
    Written::new(name, &text)
}

/// A log in a file that lasts as long as this.
pub(crate) struct Written(pub(crate) std::path::PathBuf);

impl Written {
    pub(crate) fn new(name: &str, text: &str) -> Self {
        let file = format!("regen-swings-{name}-{}.csv", std::process::id());
        let path = std::env::temp_dir().join(file);
        std::fs::write(&path, text).unwrap();
        Self(path)
    }
}

impl Drop for Written {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

#[test]
fn the_sign_of_an_effort_is_told_by_its_friction_and_its_own_nominal_body() {
    let mut model = swings(true);
    // without the load that all joints share, nothing else tells it
    model.nominal[3] = Some(0.0);
    let flipped = |k: Option<usize>| {
        with(|s| {
            for (u, q) in s.efforts.iter_mut().zip(&s.motion[0]) {
                *u -= TRUTH[3] * 9.81 * q.sin();
            }
            if let Some(k) = k {
                s.efforts[k] *= -1.0;
            }
        })
    };
    assert_eq!(found(&model, &flipped(None), [1.0; 3]), None);
    for k in 0..DOF {
        let change = found(&model, &flipped(Some(k)), [1.0; 3]).unwrap();
        let factors: Vec<f64> = change.efforts.iter().map(|own| own.factor).collect();
        let expected: Vec<f64> = (0..DOF).map(|j| if j == k { -1.0 } else { 1.0 }).collect();
        assert_eq!(factors, expected, "{change:?}");
    }
}

#[test]
fn a_change_that_leaves_an_effort_less_explained_than_before_is_no_remedy() {
    let of = |before: &[f64], after: &[f64]| Change {
        before: before.to_vec(),
        after: after.to_vec(),
        ..Change::none(2, 2)
    };
    assert!(of(&[0.54, 1.25], &[1.0, 0.4]).harms());
    assert!(!of(&[0.54, 1.25], &[0.5, 0.4]).harms());
    // what is explained well may be explained a little less
    assert!(!of(&[0.01, 1.25], &[0.1, 0.05]).harms());
    // the worst stays as it is
    assert!(of(&[0.3, 1.52], &[0.1, 1.51]).harms());
    // of noise nothing explains more
    assert!(!of(&[0.3, 0.99], &[0.1, 0.98]).harms());
    assert!(of(&[0.3, 0.99], &[0.2, 0.98]).harms());
    // the loops did not close
    assert!(!of(&[], &[0.1, 0.9]).harms());
}

#[test]
fn constants_of_efforts_are_told_where_errors_are_small() {
    let model = swings(false);
    let plain = Reading::plain(3);
    let told = |constants: [f64; 3]| {
        let sample = with(|s| {
            for (own, constant) in s.efforts.iter_mut().zip(constants) {
                *own += constant;
            }
        });
        let grams = Grams::of(&model, &sample, &plain, 1).unwrap();
        let now = grams.fit(&plain, &[]).unwrap();
        unknowns::constants(&model, &sample, &grams, &now).map(|own| own.offsets)
    };
    assert_eq!(told([0.0; 3]), None);
    // less than a twentieth of the effort does not matter
    assert_eq!(told([0.0, 0.05, 0.0]), None);
    for constants in [[0.0, 0.4, 0.0], [-0.5, 0.0, 0.6]] {
        let found = told(constants).unwrap();
        for (own, expected) in found.iter().zip(constants) {
            assert!((own - expected).abs() < 0.01, "{found:?}");
        }
    }
}

#[test]
fn limits_tell_the_unit_of_positions_whatever_the_efforts_are() {
    let mut model = swings(false);
    for joint in model.joints.iter_mut().take(2) {
        joint.limits.position = Some([-2.5, 2.5]);
    }
    let degree = 180.0 / core::f64::consts::PI;
    let factors = |sample: &Sample| {
        let found = facts::units_by_limits(&model, sample)?;
        Some(
            found
                .positions
                .iter()
                .map(|own| own.factor)
                .collect::<Vec<_>>(),
        )
    };
    assert_eq!(factors(&sample()), None);
    let one = with(|s| scale(s, 1, degree));
    assert_eq!(factors(&one), Some(vec![1.0, 1.0 / degree, 1.0]));
    let parts = factors(&with(|s| scale(s, 1, 1000.0 * degree))).unwrap_or_default();
    assert!((parts[1] - 0.001 / degree).abs() < 1e-15, "{parts:?}");
    // angles from 0 to 360 degrees are those from -180 to 180
    let turned = with(|s| {
        scale(s, 1, degree);
        s.motion[0][1] += 360.0;
    });
    assert_eq!(factors(&turned), Some(vec![1.0, 1.0 / degree, 1.0]));
    // a zero that is far off moves it out of its range, too, but not over more than that
    assert_eq!(factors(&with(|s| s.motion[0][1] += 50.0)), None);
    // the order of the efforts hides both units from the equations
    let all = with(|s| {
        (0..2).for_each(|k| scale(s, k, degree));
        s.efforts.rotate_left(1);
    });
    assert_undone("units and an order", &model, &all, [1.0; 3], 1e-9);
}

#[test]
fn a_unit_that_noise_hides_a_part_of_is_told_where_only_noise_is_left() {
    let (model, plain) = (swings(false), Reading::plain(3));
    let rough = |factor: f64| {
        let mut out = sample_of(400, 0.6);
        out.states.iter_mut().for_each(|s| s.efforts[1] *= factor);
        out
    };
    let of = |sample: &Sample| {
        let grams = Grams::of(&model, sample, &plain, 1).unwrap();
        let now = grams.fit(&plain, &[]).unwrap();
        (efforts::in_noise(&model, &grams, &[1.0; 3], &now), now)
    };
    assert_eq!(of(&rough(1.0)).0, None);
    let mistaken = rough(1.0 / 9.806_65);
    let (change, now) = of(&mistaken);
    let change = change.unwrap();
    let factors: Vec<f64> = change.efforts.iter().map(|own| own.factor).collect();
    assert_eq!(factors, [1.0, 9.806_65, 1.0]);
    assert!(leaves_noise(&model, &mistaken, &change, &now));
    // what is left with another unit is no noise
    let mut wrong = change.clone();
    wrong.efforts[1].factor = 1e3;
    assert!(!leaves_noise(&model, &mistaken, &wrong, &now));
}
