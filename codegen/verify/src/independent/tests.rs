//! Every independent check detects faults: each test puts a fault into a derived robot, its vectors
//! or its certificate, and the checks that should detect it must fail.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::PathBuf;

use regen_codegen::diag::Source;
use regen_codegen::optimize::{Op, Operand, Step, Temp};
use regen_codegen::pipeline;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_codegen::sym::Number;

use crate::check::Verdict;
use crate::testing::ARM;

use super::{INDEPENDENT, Vectors, independent};

fn path(name: &str) -> PathBuf {
    PathBuf::from(format!(
        "{}/../../robots/{name}.yaml",
        env!("CARGO_MANIFEST_DIR")
    ))
}

fn text(name: &str) -> String {
    std::fs::read_to_string(path(name)).unwrap()
}

fn vectors(name: &str) -> Option<Vectors> {
    let file = format!(
        "{}/../../tests/fixtures/vectors/{name}.json",
        env!("CARGO_MANIFEST_DIR")
    );
    let text = std::fs::read_to_string(file).ok()?;
    Some(Vectors::parse(&text).unwrap())
}

fn derived(text: &str) -> Robot {
    pipeline::derive(&Source::new("robot.yaml", text)).unwrap()
}

/// A robot, with the spec text and the test vectors of another program against which it is checked.
struct Case {
    robot: Robot,
    text: String,
    vectors: Option<Vectors>,
}

impl Case {
    fn new(name: &str) -> Self {
        let text = text(name);
        Self {
            robot: derived(&text),
            text,
            vectors: vectors(name),
        }
    }

    /// Runs all checks and returns the keys of those with the given verdict.
    fn with(&self, verdict: Verdict) -> Vec<&'static str> {
        let report = independent(&self.robot, &self.text, self.vectors.as_ref()).unwrap();
        let made: Vec<_> = report.checks.iter().map(|c| c.what).collect();
        assert_eq!(made, INDEPENDENT);
        let checks = report.checks.iter();
        checks
            .filter(|c| c.verdict == verdict)
            .map(|c| c.what.key)
            .collect()
    }

    fn failing(&self) -> Vec<&'static str> {
        self.with(Verdict::Failed)
    }

    /// Asserts that the checks with the given keys fail; others may fail too.
    #[track_caller]
    fn fails(&self, keys: &[&str]) {
        let failing = self.failing();
        for key in keys {
            assert!(failing.contains(key), "{key}: {failing:?}");
        }
    }

    /// Reverses the sign of one output of a robot's function: the last that is not a constant.
    fn negate_last_output(&mut self, kind: FunctionKind) {
        let functions = &mut self.robot.functions;
        let function = functions.iter_mut().find(|f| f.kind == kind).unwrap();
        let program = &mut function.program;
        let is_computed = |o: &Operand| !matches!(o, Operand::Constant(_));
        let k = program.outputs.iter().rposition(is_computed).unwrap();
        let result = Temp(u32::try_from(program.names.len()).unwrap());
        program.names.push(None);
        program.steps.push(Step {
            op: Op::Neg(program.outputs[k]),
            results: vec![result],
        });
        program.outputs[k] = Operand::Temp(result);
    }
}

#[test]
fn sound_robots_pass_every_check() {
    for name in ["fivebar", "3rps_friction", "tree_branch"] {
        let case = Case::new(name);
        assert_eq!(case.failing(), [""; 0], "{name}");
        assert!(case.with(Verdict::Passed).len() >= 8, "{name}");
    }
}

#[test]
fn a_wrong_sign_in_one_entry_of_the_regressor_is_detected_by_every_derivation() {
    let mut case = Case::new("fivebar");
    case.negate_last_output(FunctionKind::Regressor);
    case.fails(&["second_derivation", "peer", "power"]);
}

#[test]
fn a_wrong_length_is_detected_by_every_derivation_and_opens_the_loop() {
    let mut case = Case::new("fivebar");
    let wrong = case.text.replace("l1: 0.30", "l1: 0.301");
    assert_ne!(wrong, case.text);
    case.robot = derived(&wrong);
    case.fails(&["second_derivation", "peer", "power", "drift"]);
}

#[test]
fn a_wrong_acceleration_opens_the_loop() {
    let mut case = Case::new("fivebar");
    case.negate_last_output(FunctionKind::Accelerations);
    case.fails(&["drift"]);
}

#[test]
fn vectors_with_a_wrong_force_or_of_another_robot_are_detected() {
    let mut case = Case::new("fivebar");
    case.vectors.as_mut().unwrap().states[1].tau[0] *= 1.0 + 1e-9;
    assert_eq!(case.failing(), ["peer"]);
    case.vectors = vectors("fourbar");
    assert_eq!(case.failing(), ["peer"]);
    case.vectors = None;
    assert!(case.failing().is_empty());
    assert_eq!(case.with(Verdict::NotApplicable), ["peer"]);
}

#[test]
fn a_wrong_factor_in_a_combination_turns_the_null_space() {
    let mut case = Case::new("fivebar");
    let base = &mut case.robot.analysis.as_mut().unwrap().base;
    let direction = base.null.iter_mut().find(|d| d.terms.len() > 1).unwrap();
    let term = &mut direction.terms[1];
    // a relative error of one millionth
    let factor = Number::ratio(1_000_001, 1_000_000).unwrap();
    term.value = term.value.mul(&factor);
    assert_eq!(case.failing(), ["span"]);
}

#[test]
fn a_wrong_conversion_to_or_from_base_parameters_changes_forces() {
    for kind in [FunctionKind::ToBase, FunctionKind::FromBase] {
        let mut case = Case::new("fivebar");
        case.negate_last_output(kind);
        assert_eq!(case.failing(), ["way_back"], "{kind:?}");
    }
}

#[test]
fn a_certificate_with_another_rank_is_detected() {
    let mut case = Case::new("fivebar");
    let analysis = case.robot.analysis.as_mut().unwrap();
    analysis.certificate.as_mut().unwrap().rank += 1;
    assert_eq!(case.failing(), ["rank"]);
}

#[test]
fn a_narrow_gap_and_an_incomplete_base_are_detected() {
    let mut case = Case::new("fivebar");
    let analysis = case.robot.analysis.as_mut().unwrap();
    let certificate = analysis.certificate.as_mut().unwrap();
    certificate.largest_remainder = 1e-15 * certificate.smallest_pivot;
    assert_eq!(case.failing(), ["gap"]);
    case.robot.analysis.as_mut().unwrap().complete = false;
    case.fails(&["gap", "rank"]);
}

/// The square of the length 1e25 m overflows single precision, but not double precision.
#[test]
fn lengths_beyond_single_precision_are_detected() {
    let text = "\
name: long
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
      - {name: q2, type: revolute, dh: {a: 1e25}, body: 2, actuated: true}
";
    let case = Case {
        robot: derived(text),
        text: text.to_owned(),
        vectors: None,
    };
    case.fails(&["single_precision"]);
}

/// Parameters that have no part in the base parameters, and those that the spec relates to others,
/// are no parameters that the way back has to keep.
#[test]
fn robots_whose_base_drops_or_relates_parameters_pass_every_check() {
    for choice in ["  drop: [mx(2)]\n", "  zero: [mx(2)]\n"] {
        let text = format!("{ARM}base:\n{choice}");
        let case = Case {
            robot: derived(&text),
            text,
            vectors: None,
        };
        assert_eq!(case.failing(), [""; 0], "{choice}");
        assert!(case.with(Verdict::Passed).contains(&"way_back"));
    }
}
