//! The friction laws of the generator, of the runtime and of the second derivation are the same.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;

use regen_codegen::{Mechanism, diag::Source, spec};
use regen_experiment::simulate::nominal_friction;
use regen_interpreted::Interpreted;
use regen_runtime::Friction;
use regen_tests::reference;

/// What both tables state about a law: case, word, symbols, whether it is linear in them.
type Row = (String, &'static str, &'static [&'static str], bool);

#[test]
fn the_generator_and_the_runtime_have_the_same_laws() {
    let ours = spec::Friction::ALL.iter();
    let ours = ours.map(|law| -> Row {
        let name = law.name().to_owned();
        (name, law.word(), law.symbols(), law.is_linear())
    });
    let theirs = Friction::ALL.iter();
    let theirs = theirs.map(|law| -> Row {
        let name = format!("{law:?}");
        (name, law.name(), law.symbols(), law.is_linear())
    });
    assert_eq!(ours.collect::<Vec<_>>(), theirs.collect::<Vec<_>>());
}

/// One joint that turns, with values for every symbol of its law.
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
        let mechanism = Mechanism::open(&Source::new("arm.yaml", &text));
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
        // at rest alone there is none
        assert_eq!(
            moving,
            if law.symbols().is_empty() { 0 } else { 6 },
            "{law:?}"
        );
    }
}

/// A value that the description leaves out is no value that is 0.
#[test]
fn a_missing_value_is_no_effort() {
    let bare = arm(spec::Friction::None).replace("friction: none", "friction: stribeck");
    let reference = reference::Mechanism::from_yaml(&bare).unwrap();
    assert_eq!(reference.friction_effort(0, 1.0), None);
}
