//! The text of equations, and the errors for equations that a robot does not have.

use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_equations::{EquationSet, Parameters, Style, equations, kinds};

/// An arm of two joints.
const ARM: &str = "\
name: arm
gravity: [0, -9.81, 0]
geometry: {reach: 0.37}
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: upper, actuated: true}
      - {name: q2, type: revolute, dh: {a: reach}, body: lower, actuated: true}
";

fn written(of: EquationSet, parameters: Parameters, style: Style) -> String {
    let mechanism = Mechanism::open(&Source::new("arm.yaml", ARM)).unwrap();
    let robot = mechanism.robot_in_names(&kinds(of, parameters)).unwrap();
    equations(&robot, of, parameters, style).unwrap()
}

#[test]
fn terms_have_the_names_of_their_angles_and_lengths() {
    let text = written(EquationSet::Dynamics, Parameters::Base, Style::Text);
    assert!(text.contains("c_1 = cos(q1)"), "{text}");
    assert!(text.contains("reach = 0.37"), "{text}");
    let latex = written(EquationSet::Dynamics, Parameters::All, Style::Latex);
    assert!(latex.contains("\\cos\\left(q_{1}\\right)"), "{latex}");
    assert!(latex.contains("\\mathrm{reach}"), "{latex}");
    assert!(latex.contains("\\dot{q}_{2}"), "{latex}");
    assert_eq!(latex.matches('{').count(), latex.matches('}').count());
}

#[test]
fn every_name_is_defined_before_it_is_used() {
    let text = written(EquationSet::Regressor, Parameters::All, Style::Text);
    let mut known = Vec::new();
    for line in text.lines() {
        let Some((name, value)) = line.split_once(" = ") else {
            continue;
        };
        let words = value.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        for word in words.filter(|w| w.starts_with("t_") || w.starts_with("s_")) {
            assert!(known.contains(&word.to_owned()), "{word} in {line}");
        }
        known.push(name.to_owned());
    }
    assert!(known.iter().any(|name| name.starts_with("W_")), "{text}");
}

#[test]
fn named_angles_stay_symbols_and_roots_of_numbers_are_exact() {
    let text = ARM
        .replace("{reach: 0.37}", "{reach: 0.37, alpha: 0.6, beta: pi/2}")
        .replace(
            "dh: {a: reach}",
            "dh: {a: reach, alpha: alpha + pi/3, d: sqrt(6)/4}",
        );
    let mechanism = Mechanism::open(&Source::new("arm.yaml", &text)).unwrap();
    let (of, all) = (EquationSet::Dynamics, Parameters::All);
    let robot = mechanism.robot_in_names(&kinds(of, all)).unwrap();
    let text = equations(&robot, of, all, Style::Text).unwrap();
    assert!(
        text.contains("alpha = 0.6\n") && !text.contains("beta"),
        "{text}"
    );
    assert!(text.contains("sin(alpha + pi/3)"), "{text}");
    assert!(
        text.contains("sqrt(6)/4") && !text.contains("0.61237"),
        "{text}"
    );
    let latex = equations(&robot, of, all, Style::Latex).unwrap();
    for part in ["\\tfrac{\\sqrt{6}}{4}", "\\sin\\left(\\alpha + "] {
        assert!(latex.contains(part), "{part}\n{latex}");
    }
}

#[test]
fn an_arm_has_nothing_to_close() {
    let mechanism = Mechanism::open(&Source::new("arm.yaml", ARM)).unwrap();
    for of in [EquationSet::Closure, EquationSet::Jacobian, EquationSet::X] {
        let robot = mechanism
            .robot_in_names(&kinds(of, Parameters::All))
            .unwrap();
        let missing = equations(&robot, of, Parameters::All, Style::Text).unwrap_err();
        assert!(missing.to_string().contains("no loops"), "{missing}");
    }
}

#[test]
fn a_script_calls_only_what_it_imports_or_defines() {
    let text = ARM.replace("body: upper,", "body: upper, friction: asymmetric,");
    let mechanism = Mechanism::open(&Source::new("arm.yaml", &text)).unwrap();
    let (of, all) = (EquationSet::Regressor, Parameters::All);
    let robot = mechanism.robot_in_names(&kinds(of, all)).unwrap();
    let script = equations(&robot, of, all, Style::Sympy).unwrap();
    let imported = script
        .lines()
        .find_map(|l| l.strip_prefix("from sympy import "));
    let imported: Vec<&str> = imported.unwrap().split(", ").collect();
    let (_, code) = script.split_once("from sympy import ").unwrap();
    let defined = |name: &str| script.contains(&format!("def {name}("));
    let mut called = Vec::new();
    for (at, _) in code.match_indices('(') {
        let before = &code[..at];
        let start = before.rfind(|c: char| !(c.is_alphanumeric() || c == '_'));
        let start = start.map_or(0, |k| k + 1);
        // a method belongs to what it is called on
        if start < at && !code[..start].ends_with('.') {
            called.push(&code[start..at]);
        }
    }
    for name in &called {
        assert!(
            imported.contains(name) || defined(name) || *name == "in",
            "{name}: {script}"
        );
    }
    // friction of its own in either direction, and none at rest
    assert!(
        code.contains("Heaviside(dq1, 0)") && code.contains("Heaviside(-(dq1), 0)"),
        "{code}"
    );
}
