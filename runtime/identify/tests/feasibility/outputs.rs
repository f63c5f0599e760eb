//! Output of parameters as text: units, inertias, and keys that YAML must read as text.

use regen_identify::feasibility::{ParameterLayout, SYMBOLS, bodies_yaml, unit};
use regen_runtime::{Friction, Info, Joint, Motion};

/// A joint with the given kind of motion.
fn joint(motion: Motion) -> Joint {
    let bare = match motion {
        Motion::Rotation => Joint::ROTATION,
        Motion::Translation => Joint::TRANSLATION,
    };
    Joint {
        friction: Friction::Linear,
        ..bare
    }
}

#[test]
fn every_kind_of_parameter_has_its_unit() {
    let joints = [joint(Motion::Rotation), joint(Motion::Translation)];
    let info = Info {
        coordinates: &["turn", "slide"],
        joints: &joints,
        ..Info::EMPTY
    };
    for symbol in ["Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"] {
        assert_eq!(unit(&format!("{symbol}(arm)"), &info), "kg m^2");
    }
    for symbol in ["mx", "my", "mz"] {
        assert_eq!(unit(&format!("{symbol}(arm)"), &info), "kg m");
    }
    assert_eq!(unit("m(arm)", &info), "kg");
    for (symbol, turn, slide) in [
        ("J", "kg m^2", "kg"),
        ("Fv", "N m s/rad", "N s/m"),
        ("Fv+", "N m s/rad", "N s/m"),
        ("Fc", "N m", "N"),
        ("Fc-", "N m", "N"),
        ("Fs", "N m", "N"),
        ("Fo", "N m", "N"),
    ] {
        assert_eq!(unit(&format!("{symbol}(turn)"), &info), turn);
        assert_eq!(unit(&format!("{symbol}(slide)"), &info), slide);
        // the model has no such joint
        assert_eq!(unit(&format!("{symbol}(other)"), &info), "SI");
    }
    assert_eq!(unit("vs(turn)", &info), "rad/s");
    assert_eq!(unit("delta(turn)", &info), "1");
}

/// The YAML of one body with these ten parameters.
fn yaml(label: &str, ten: [f64; 10]) -> String {
    let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}({label})")).collect();
    bodies_yaml(&ParameterLayout::new(&labels).unwrap(), &ten).unwrap()
}

/// YAML reads `yes`, `on` and the like as something other than text, and some characters as syntax:
/// these keys are quoted, and no others.
#[test]
fn keys_are_quoted_exactly_where_yaml_would_not_read_text() {
    for (label, key) in [
        ("1", "1"),
        ("upper_arm2", "upper_arm2"),
        ("yes", "\"yes\""),
        ("No", "\"No\""),
        ("TRUE", "\"TRUE\""),
        ("null", "\"null\""),
        ("n", "\"n\""),
        ("arm: left", "\"arm: left\""),
        ("arm-left", "arm-left"),
        ("1e5", "\"1e5\""),
        ("", "\"\""),
        ("a\"b\\c", "\"a\\\"b\\\\c\""),
        ("nose", "nose"),
    ] {
        let text = yaml(label, [0.0; 10]);
        let line = text.lines().nth(1).unwrap();
        assert!(line.starts_with(&format!("  {key}: {{mass: ")), "{line}");
    }
}

#[test]
fn a_body_without_mass_has_its_centre_at_the_origin() {
    let text = yaml("1", [1.0, 0.5, 0.0, 2.0, 0.25, 3.0, 0.5, 0.0, 0.0, 0.0]);
    assert_eq!(
        text,
        "bodies:\n  1: {mass: 0.0, com: [0.0, 0.0, 0.0], \
         inertia: [1.0, 0.5, 0.0, 2.0, 0.25, 3.0]}\n"
    );
}
