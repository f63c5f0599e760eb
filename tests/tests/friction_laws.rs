//! The friction laws of the generator, of the runtime and of the second derivation are the same.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;

use regen_codegen::{Mechanism, diag, spec};
use regen_experiment::simulate::{Pid, Settings, Termination, nominal_friction, simulate};
use regen_generated::fivebar;
use regen_identify::estimate::EstimateError;
use regen_identify::feasibility::{BaseMap, FeasibilityError, Options, ParameterLayout};
use regen_identify::friction::{collect, fit};
use regen_identify::states::FrictionJoint;
use regen_identify::states::{Filtering, Recorded, Source, StateSample};
use regen_interpreted::Interpreted;
use regen_runtime::{BaseModel, Friction, JointFriction, Model};
use regen_tests::reference;

/// A law's entry in both tables: its variant, its word, its symbols, whether it is linear in them.
type Stated = (String, &'static str, &'static [&'static str], bool);

#[test]
fn the_generator_and_the_runtime_have_the_same_laws() {
    let ours = spec::Friction::ALL.iter();
    let ours = ours.map(|law| -> Stated {
        let name = law.name().to_owned();
        (name, law.word(), law.symbols(), law.is_linear())
    });
    let theirs = Friction::ALL.iter();
    let theirs = theirs.map(|law| -> Stated {
        let name = format!("{law:?}");
        (name, law.name(), law.symbols(), law.is_linear())
    });
    assert_eq!(ours.collect::<Vec<_>>(), theirs.collect::<Vec<_>>());
}

/// A robot of one revolute joint, with values for every symbol of its law.
fn arm(law: spec::Friction) -> String {
    let mut nominal = String::new();
    for (k, symbol) in law.symbols().iter().enumerate() {
        let _ = write!(nominal, "{symbol}: {}, ", 0.3 + 0.4 * k as f64);
    }
    format!(
        "name: arm\nlimbs:\n  - name: arm\n    joints:\n      - {{name: q1, type: revolute, \
         body: 1, actuated: true, friction: {}, nominal: {{{nominal}}}}}\n",
        law.word()
    )
}

/// Two implementations from the same description: that of simulation and identification, and that
/// of the second derivation.
#[test]
fn every_law_has_the_effort_of_the_second_derivation() {
    for law in spec::Friction::ALL {
        let text = arm(*law);
        let reference = reference::Mechanism::from_yaml(&text).unwrap();
        let mechanism = Mechanism::open(&diag::Source::new("arm.yaml", &text));
        let robot = mechanism.and_then(|m| m.robot(&[])).unwrap();
        let model = Interpreted::new(&robot);
        let joint = nominal_friction(&model.info()).unwrap()[0];
        assert_eq!(joint.law.name(), law.word());
        let mut moving = 0;
        for v in [-2.0, -0.31, -0.004, 0.0, 0.02, 0.7, 1.9] {
            let expected = reference.friction_effort(0, v).unwrap();
            let effort = joint.effort(v);
            assert!(
                (effort - expected).abs() < 1e-14,
                "{law:?} {v}: {effort} {expected}"
            );
            moving += usize::from(effort != 0.0);
        }
        // the effort is zero at rest only
        assert_eq!(
            moving,
            if law.symbols().is_empty() { 0 } else { 6 },
            "{law:?}"
        );
    }
}

/// Without values for its symbols a law has no effort, instead of an effort of 0.
#[test]
fn a_law_without_values_has_no_effort() {
    let bare = arm(spec::Friction::None).replace("friction: none", "friction: stribeck");
    let reference = reference::Mechanism::from_yaml(&bare).unwrap();
    assert_eq!(reference.friction_effort(0, 1.0), None);
}

/// A log whose reading may fail as a fit does.
struct Log(Recorded);

impl Source for Log {
    type Error = FeasibilityError;

    fn filtering(&self) -> Filtering {
        self.0.filtering()
    }

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), FeasibilityError> {
        Ok(self.0.visit(each)?)
    }
}

/// The five-bar runs under control with LuGre's friction at its cranks; what is identified from
/// the log is what was simulated.
#[test]
fn lugre_friction_is_identified_from_a_simulation() {
    let model = fivebar::Fivebar;
    let info = Model::<f64>::info(&model);
    let phi = info.nominal_parameters().expect("nominal values");
    let laws = [[0.12, 0.2, 0.25, 0.06, 0.0], [0.08, 0.17, 0.4, 0.09, 0.0]];
    let mut friction = vec![JointFriction::NONE; info.coordinates.len()];
    for (place, values) in info.actuated.iter().zip(laws) {
        friction[*place] = JointFriction {
            law: Friction::Lugre,
            values,
        };
    }
    let settings = Settings {
        duration: 12.0,
        period: 0.005,
        pid: vec![
            Pid {
                kp: 20.0,
                ki: 0.0,
                kd: 1.0,
                ..Pid::default()
            };
            info.actuated.len()
        ],
        friction,
        friction_width: 1e-4,
        ..Settings::default()
    };
    let home: Vec<f64> = info.independent.iter().map(|c| info.home[*c]).collect();
    let swing = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
        for (k, home) in home.iter().enumerate() {
            (q[k], qd[k], qdd[k]) = (*home, 0.0, 0.0);
            for (size, w) in [(0.15, 2.1 + 0.8 * k as f64), (0.08, 4.7 + 0.3 * k as f64)] {
                q[k] += size * (w * t).sin();
                qd[k] += size * w * (w * t).cos();
                qdd[k] -= size * w * w * (w * t).sin();
            }
        }
    };
    let log = simulate(&model, &phi, &swing, &settings).unwrap();
    assert_eq!(log.ended, Termination::Complete);
    let (n, m) = (info.coordinates.len(), info.actuated.len());
    let mut rows = Recorded::new();
    for (k, t) in log.t.iter().enumerate() {
        let of = |all: &[f64]| all[n * k..n * (k + 1)].to_vec();
        let (q, qd, qdd) = (of(&log.q), of(&log.qd), of(&log.qdd));
        // near a reversal, the simulation replaces the sign of the velocity by a smooth function
        if info.actuated.iter().all(|c| qd[*c].abs() > 2e-3) {
            rows.push(*t, &q, &qd, &qdd, &log.effort[m * k..m * (k + 1)]);
        }
    }
    let joints: Vec<FrictionJoint> = info
        .actuated
        .iter()
        .map(|c| FrictionJoint {
            name: info.coordinates[*c].to_owned(),
            friction: Friction::Lugre,
        })
        .collect();
    let (data, _) = collect(&model, &mut Log(rows), &joints).unwrap();
    let base = BaseModel::<f64>::base_info(&model);
    let combinations = BaseMap::from_base(&base, info.parameters.len()).unwrap();
    let layout = ParameterLayout::of(info.parameters).unwrap();
    let found = fit(&data, &combinations, &layout, &Options::default()).unwrap();
    for (joint, values) in found.joints.iter().zip(laws) {
        for (a, b) in joint.values.iter().zip(values) {
            assert!((a - b).abs() < 1e-3 * b, "{:?} {values:?}", joint.values);
        }
    }
}
