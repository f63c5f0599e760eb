//! Drives: the same robot as with massless joints and couplings, and random mechanisms with drives
//! against the second derivation.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;

use regen_codegen::diag::Source;
use regen_codegen::pipeline::derive;
use regen_codegen::signature::FunctionKind;
use regen_tests::base::{Derivation, Verdict, check_base, states_for};
use regen_tests::derived::Derived;
use regen_tests::engine::{Engine, check_engine};
use regen_tests::random_spec;
use regen_tests::reference::Mechanism;

fn fixture(name: &str) -> String {
    let path = format!("{}/fixtures/mechanisms/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).unwrap()
}

/// The wrist with its drives written as massless joints, and its joints coupled to them.
fn wrist_by_couplings() -> String {
    let text = fixture("differential_wrist.yaml");
    let (before, rest) = text.split_once("drives:\n").unwrap();
    let (drives, after) = rest.split_once("home:").unwrap();
    let mut motors = String::new();
    for line in drives.lines() {
        let (name, fields) = line.trim().split_once(": {of: ").unwrap();
        let (_, fields) = fields.split_once(", friction").unwrap();
        let _ = writeln!(
            motors,
            "  - {{name: {name}, joints: [{{name: {name}, type: revolute, actuated: true, friction{fields}]}}"
        );
    }
    let couplings = "couplings: {q4: (m4 - pi/3)/ratio4, q5: (m5 + m6)/(2*n), q6: (m5 - m6)/(2*n)}\n\
                     independent: [m4, m5, m6]\n";
    let home = after.replacen(
        " {q4: 0.3, q5: 0.2, q6: -0.4}",
        "{m4: 50*0.3 + pi/3, m5: -32*0.2, m6: 32*0.6}",
        1,
    );
    format!("{before}{motors}{couplings}home: {home}")
}

#[test]
fn a_robot_with_drives_equals_one_with_massless_joints_and_couplings() {
    let (direct, coupled) = (fixture("differential_wrist.yaml"), wrist_by_couplings());
    let [direct, coupled] =
        [&direct, &coupled].map(|text| Derived::new("wrist.yaml", text).unwrap());
    let names = direct.names();
    assert_eq!(names.coordinates, coupled.names().coordinates);
    assert_eq!(names.parameters, coupled.names().parameters);
    assert_eq!(names.actuated, ["m4", "m5", "m6"]);
    assert_eq!(names.nominal, coupled.names().nominal);
    for (a, b) in direct.home().iter().zip(coupled.home()) {
        assert!((a - b).abs() < 1e-14, "{a} {b}");
    }
    let mechanism = Mechanism::from_yaml(&fixture("differential_wrist.yaml")).unwrap();
    for state in mechanism.random_states(3, 5).unwrap() {
        let of = |engine: &Derived| {
            let arguments: [&[f64]; 3] = [&state.q, &state.qd, &state.qdd];
            engine.matrix(FunctionKind::Regressor, &arguments).unwrap()
        };
        let (a, b) = (of(&direct), of(&coupled));
        assert!((&a - &b).amax() < 1e-12 * a.amax(), "{a} {b}");
    }
    let base = |engine: &Derived| -> Vec<(usize, Vec<(usize, f64)>)> {
        let analysis = engine.robot.analysis.as_ref().unwrap();
        assert!(analysis.complete);
        let parameters = analysis.base.parameters.iter();
        parameters
            .map(|p| {
                let terms = p.terms.iter().map(|t| (t.column, t.value.to_f64()));
                let mut terms: Vec<(usize, f64)> = terms.collect();
                terms.sort_by_key(|t| t.0);
                (p.column, terms)
            })
            .collect()
    };
    let (a, b) = (base(&direct), base(&coupled));
    assert_eq!(a.len(), b.len());
    for ((column, terms), (other, others)) in a.iter().zip(&b) {
        assert_eq!((column, terms.len()), (other, others.len()));
        for (x, y) in terms.iter().zip(others) {
            assert!(
                x.0 == y.0 && (x.1 - y.1).abs() <= 1e-12 * x.1.abs(),
                "{x:?} {y:?}"
            );
        }
    }
}

#[test]
fn the_regressor_of_a_geared_joint_is_that_computed_by_hand() {
    let text = "\
name: geared
gravity: [0, -9.81, 0]
limbs:
  - name: arm
    joints:
      - {name: q, type: revolute, body: arm, friction: viscous}
drives:
  motor: {of: 50*q, friction: linear, rotor_inertia: true, offset: true}
";
    let engine = Derived::new("geared.yaml", text).unwrap();
    let names = engine.names();
    assert_eq!(names.independent, ["motor"]);
    let (q, qd, qdd) = ([0.3, 15.0], [-0.2, -10.0], [0.5, 25.0]);
    let w = engine
        .matrix(FunctionKind::Regressor, &[&q, &qd, &qdd])
        .unwrap();
    let at = |label: &str| w[(0, names.parameters.iter().position(|p| p == label).unwrap())];
    // the motor's own columns are like those of a joint; the joint's are divided by the gear ratio
    let expected = [
        ("Izz(arm)", 0.5 / 50.0),
        ("Fv(q)", -0.2 / 50.0),
        ("Fv(motor)", -10.0),
        ("Fc(motor)", -1.0),
        ("Fo(motor)", 1.0),
        ("J(motor)", 25.0),
        ("mx(arm)", 9.81 * 0.3_f64.cos() / 50.0),
    ];
    for (label, value) in expected {
        assert!((at(label) - value).abs() < 1e-13, "{label}: {}", at(label));
    }
}

/// Replaces the actuated joints of a random spec by drives. The form of each contains one of the
/// coordinates `moved` and, except for the first drive, the coordinate before it.
fn with_drives(text: &str, moved: &[String]) -> String {
    let mechanism = Mechanism::from_yaml(text).unwrap();
    let lines = text
        .lines()
        .filter(|line| !line.starts_with("independent:"));
    let mut out = String::new();
    for line in lines {
        out.push_str(&line.replace(", actuated: true", ""));
        out.push('\n');
    }
    out.push_str("drives:\n");
    for (k, name) in moved.iter().enumerate() {
        let at = mechanism
            .coordinates
            .iter()
            .position(|c| c == name)
            .unwrap();
        let kind = if mechanism.slides(at) {
            "prismatic"
        } else {
            "revolute"
        };
        let ratio = 3 + 7 * k;
        let mut form = format!("{ratio}*{name} - 1/7");
        if let Some(before) = k.checked_sub(1).and_then(|k| moved.get(k)) {
            let _ = write!(form, " - 5/3*{before}");
        }
        let friction = ["linear", "asymmetric", "viscous"][k % 3];
        let rest = if k % 2 == 0 {
            ", rotor_inertia: true, offset: true"
        } else {
            ""
        };
        let _ = writeln!(
            out,
            "  motor{k}: {{of: {form}, type: {kind}, friction: {friction}{rest}}}"
        );
    }
    out
}

/// A random tree and a random loop with drives.
fn random(seed: u64) -> [String; 2] {
    let tree = random_spec::tree(seed);
    let all = Mechanism::from_yaml(&tree).unwrap().coordinates;
    let closed = random_spec::closed_loop(seed).unwrap();
    let mechanism = Mechanism::from_yaml(&closed).unwrap();
    let independent = mechanism.independent.iter();
    let independent: Vec<String> = independent
        .map(|k| mechanism.coordinates[*k].clone())
        .collect();
    [with_drives(&tree, &all), with_drives(&closed, &independent)]
}

#[test]
fn random_mechanisms_with_drives_agree_with_the_second_derivation() {
    for seed in 0..6 {
        for text in random(seed) {
            let mechanism = Mechanism::from_yaml(&text).unwrap();
            assert_eq!(mechanism.independent, mechanism.drives);
            let derived = Derived::without_base("random.yaml", &text)
                .unwrap_or_else(|e| panic!("{e}\n{text}"));
            let checked = check_engine(&derived, &mechanism, seed, 2);
            checked.unwrap_or_else(|e| panic!("{e}\n{text}"));
        }
    }
}

#[test]
fn the_base_of_random_mechanisms_with_drives_is_certified_and_right() {
    let mut certified = 0;
    for seed in 0..6 {
        for text in random(seed) {
            match check_base(&text, seed).unwrap_or_else(|e| panic!("{e}\n{text}")) {
                Verdict::Correct(_) => certified += 1,
                Verdict::Uncertified(_) => {}
                Verdict::Wrong(why) => panic!("{why}\n{text}"),
            }
        }
    }
    assert!(certified >= 8, "{certified}");
}

#[test]
fn the_base_of_differentials_and_tendons_has_the_rank_of_singular_values() {
    for file in ["differential_wrist.yaml", "tendons.yaml"] {
        let text = fixture(file);
        let mechanism = Mechanism::from_yaml(&text).unwrap();
        let derivation = Derivation::completed(&text).unwrap();
        let states = mechanism
            .random_states(1, 3 * states_for(&mechanism))
            .unwrap();
        let found = derivation
            .agreement(&mechanism, &states, &Derivation::value)
            .unwrap();
        assert!(found.error < 1e-10, "{file}: {found:?}");
        assert_eq!(derivation.kept().len(), found.rank, "{file}: {found:?}");
    }
}

#[test]
fn home_follows_the_joints_or_the_drives() {
    let home = |text: &str| derive(&Source::new("home.yaml", text)).unwrap().home;
    let text = fixture("tendons.yaml");
    // home gives the tendons, and the joints are computed
    let q = home(&text);
    assert!(
        (q[0] - 0.5).abs() < 1e-13 && (q[1] - 0.5).abs() < 1e-13,
        "{q:?}"
    );
    // home gives the joints, one of them by a coupling of another one
    let text = "\
name: coupled
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: 1}
      - {name: q2, type: revolute, dh: {a: 1}, body: 2}
couplings: {q2: -q1/2}
drives: {m: {of: 30*q2 + 1}}
home: {q1: 0.4}
";
    let q = home(text);
    let expected = [0.4, -0.2, -5.0];
    for (found, known) in q.iter().zip(expected) {
        assert!((found - known).abs() < 1e-13, "{q:?}");
    }
}

/// The report of the mistakes of a spec whose joints are q1 and q2.
fn refused(drives: &str) -> String {
    let text = format!(
        "name: r\nlimbs:\n  - name: arm\n    joints:\n      \
         - {{name: q1, type: revolute, body: 1}}\n      \
         - {{name: q2, type: revolute, dh: {{a: 1}}, body: 2}}\n{drives}"
    );
    let report = derive(&Source::new("r.yaml", text)).expect_err(drives);
    report.to_string()
}

#[test]
fn drives_that_do_not_fit_the_joints_are_named() {
    let few = refused("drives: {m1: {of: 45*(q1 + q2)}}\n");
    assert!(
        few.contains("drives 'm1': the drive 'm1' does not determine the joints 'q1' and 'q2'"),
        "{few}"
    );
    assert!(
        few.contains("r.yaml:7:10") && few.contains("add a drive"),
        "{few}"
    );
    let same = refused("drives: {m1: {of: 45*(q1 + q2)}, m2: {of: -3*(q1 + q2)}}\n");
    assert!(
        same.contains("the drives 'm1' and 'm2' cannot move independently"),
        "{same}"
    );
    assert!(
        same.contains("the drives 'm1' and 'm2' do not determine the joints 'q1' and 'q2'"),
        "{same}"
    );
    let many = refused("drives: {m1: {of: 45*q1}, m2: {of: 3*q2}, m3: {of: q1 - q2}}\n");
    assert!(
        many.contains("the drives 'm1', 'm2' and 'm3' cannot move independently")
            && many.contains("under `independent:`"),
        "{many}"
    );
    let coupled = refused("couplings: {q2: 2*q1}\ndrives: {m1: {of: 45*q1}, m2: {of: 3*q2}}\n");
    assert!(
        coupled.contains("the drives 'm1' and 'm2' cannot move independently"),
        "{coupled}"
    );
    // a redundant drive is allowed where the independent coordinates are chosen
    let text = "name: r\nlimbs: [{name: a, joints: [{name: q, type: revolute, body: 1}]}]\n\
                drives: {m1: {of: 45*q}, m2: {of: -30*q}}\nindependent: [m1]\n";
    let robot = derive(&Source::new("r.yaml", text)).unwrap();
    assert_eq!((robot.independent, robot.actuated), (vec![1], vec![1, 2]));
}
