//! Mechanisms with null directions that the trees do not give.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::path::PathBuf;

use regen_codegen::base::certificate::{Float320, certify};
use regen_codegen::base::{Analysis, Exactness, Provenance, analyse, restore, store};
use regen_codegen::constraints::{NumericLoops, close_home, world_equations};
use regen_codegen::diag::Source;
use regen_codegen::kinematics::{Frames, Geometry};
use regen_codegen::model::{self, Model};
use regen_codegen::spec;
use regen_codegen::sym::Graph;

fn file(path: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures");
    std::fs::read_to_string(root.join(path)).unwrap()
}

fn analysed(text: &str) -> (Model, Vec<f64>, Analysis) {
    let spec = spec::parse(&Source::new("test.yaml", text)).unwrap_or_else(|e| panic!("{e}"));
    let model = model::build(&spec);
    let mut g = Graph::new();
    for coordinate in &model.coordinates {
        g.symbol(&coordinate.name);
    }
    let frames = Frames::new(&mut g, &model, Geometry::Values);
    let equations = world_equations(&mut g, &frames, &model, None);
    let loops = NumericLoops::new(&g, &equations, &model);
    let home = close_home(&loops, &model).unwrap();
    let analysis = analyse(&spec, &model, &home);
    (model, home, analysis)
}

fn table(model: &Model, analysis: &Analysis) -> String {
    let mut text = String::new();
    let label = |c: usize| &model.parameters[c].label;
    for parameter in &analysis.base.parameters {
        let terms = parameter.terms.iter();
        let terms: Vec<String> = terms
            .map(|t| format!("[{}] {}", t.coefficient, label(t.column)))
            .collect();
        writeln!(text, "{:?} {}", parameter.provenance, terms.join(" + ")).unwrap();
    }
    text
}

/// The analysis of a mechanism with some completed directions, after asserting that it is complete,
/// has the given rank, that all factors are recognised, and that the directions are null at further
/// states.
fn complete(path: &str, text: &str, rank: usize, completed: usize) -> (Model, Analysis) {
    let (model, home, analysis) = analysed(text);
    let table = table(&model, &analysis);
    assert!(
        analysis.complete,
        "{path}: {} completed\n{table}",
        analysis.base.completed
    );
    assert_eq!(analysis.base.rank(), rank, "{path}\n{table}");
    assert_eq!(analysis.base.completed, completed, "{path}");
    assert_eq!(analysis.base.unrecognised, [""; 0], "{path}\n{table}");
    reproduces(path, &model, &home, &analysis);
    for parameter in &analysis.base.parameters {
        for term in &parameter.terms {
            let text = term.coefficient.to_string();
            assert!(!text.contains('.'), "{path}: a bare number: {text}");
        }
    }
    let parameters = analysis.base.parameters.iter();
    let marked = parameters
        .filter(|p| p.provenance != Provenance::Derived)
        .count();
    assert!(marked > 0, "{path}");
    // the angles of a Bennett linkage are related, but not linearly
    let mut null = analysis.base.null.iter();
    let is_recognised_only = null.any(|row| row.provenance == Provenance::Completed);
    assert_eq!(is_recognised_only, path.contains("bennett"), "{path}");
    (model, analysis)
}

/// Asserts that W(all) phi = W(base) beta at fresh states.
fn reproduces(path: &str, model: &Model, home: &[f64], analysis: &Analysis) {
    let fresh = certify(model, home, 99).unwrap();
    let phi: Vec<Float320> = (0..model.parameters.len())
        .map(|c| Float320::from_f64(((c * 7919 + 13) % 101) as f64 / 16.0 - 3.0))
        .collect();
    let mut difference = phi.clone();
    for parameter in &analysis.base.parameters {
        let terms = parameter.terms.iter();
        let beta = terms.fold(Float320::ZERO, |sum, t| {
            sum + Float320::from_number(&t.value) * phi[t.column]
        });
        difference[parameter.column] = difference[parameter.column] - beta;
    }
    assert!(fresh.scaled_residual(&phi) > 1e-9, "{path}");
    assert!(fresh.scaled_residual(&difference) < 1e-60, "{path}");
}

/// The combination of the base parameter with the given kept parameter.
fn combination(model: &Model, analysis: &Analysis, kept: &str) -> Vec<String> {
    let label = |c: usize| model.parameters[c].label.as_str();
    let mut parameters = analysis.base.parameters.iter();
    let found = parameters.find(|p| label(p.column) == kept);
    let found = found.unwrap_or_else(|| panic!("{}", table(model, analysis)));
    let mut terms: Vec<String> = found
        .terms
        .iter()
        .map(|t| format!("{} {}", t.coefficient, label(t.column)))
        .collect();
    terms.sort();
    terms
}

#[test]
fn a_parallelogram_has_3_base_parameters() {
    let path = "mechanisms/parallelogram_cut.yaml";
    let (model, analysis) = complete(path, &file(path), 3, 5);
    assert_eq!(
        combination(&model, &analysis, "Izz(1)"),
        ["1 Izz(1)", "1 Izz(3)", "l^2 m(2)"]
    );
    assert_eq!(
        combination(&model, &analysis, "mx(1)"),
        ["1 mx(1)", "1 mx(3)", "l m(2)"]
    );
    assert_eq!(
        combination(&model, &analysis, "my(1)"),
        ["1 my(1)", "1 my(3)"]
    );
}

#[test]
fn sides_that_are_equal_by_value_only_stay_equal() {
    let path = "mechanisms/parallelogram_cut.yaml";
    let text = file(path)
        .replace("w: 0.25", "w: 0.25, l2: 0.4, w2: 0.25")
        .replace("{body: 2, xyz: [w, 0, 0]}", "{body: 2, xyz: [w2, 0, 0]}")
        .replace("{body: 3, xyz: [l, 0, 0]}", "{body: 3, xyz: [l2, 0, 0]}");
    let (model, analysis) = complete("four names", &text, 3, 5);
    assert_eq!(
        combination(&model, &analysis, "mx(3)"),
        ["1 mx(3)", "l2 m(2)", "l2/l mx(1)"]
    );
}

/// Velocity constraints that hold by construction leave no direction to complete.
#[test]
fn coupled_trees_are_derived() {
    for (path, rank) in [
        ("mechanisms/parallelogram.yaml", 5),
        ("mechanisms/geared_fivebar.yaml", 15),
    ] {
        let (model, home, analysis) = analysed(&file(path));
        assert!(analysis.complete, "{path}");
        let base = &analysis.base;
        assert_eq!((base.rank(), base.completed), (rank, 0), "{path}");
        reproduces(path, &model, &home, &analysis);
    }
    let (model, _, analysis) = analysed(&file("mechanisms/parallelogram.yaml"));
    assert_eq!(
        combination(&model, &analysis, "my(1)"),
        ["1 my(1)", "1 my(3)"]
    );
}

/// Frames of coupled bodies may have any orientation: with a constant in the coupling, and rotated
/// by a skew angle about skew axes.
#[test]
fn coupled_bodies_of_one_orientation_are_derived_in_any_axes() {
    let text = "name: carried
geometry: {l: 0.4}
limbs:
  - name: arm
    base: {xyz: [0.1, 0, 0], rpy: [0.3, 0.5, -0.2]}
    joints:
      - {name: stand, type: fixed, body: 0}
      - {name: q1, type: revolute, origin: {xyz: [l, 0, 0], rpy: [0.7, 0, 0]}, body: 1, actuated: true}
      - {name: q2, type: revolute, dh: {a: l}, body: 2}
  - name: beside
    from: 0
    base: {xyz: [0, 0.2, 0], rpy: [0.7, 0, 0]}
    joints:
      - {name: q3, type: revolute, origin: {rpy: [0, 0, 0.4]}, body: 3}
couplings: {q2: -q1 + 0.9, q3: q1 + 0.3}
home: {q1: 0.3}
";
    let (model, home, analysis) = analysed(text);
    assert!(analysis.complete, "{}", table(&model, &analysis));
    assert_eq!(analysis.base.completed, 0, "{}", table(&model, &analysis));
    reproduces("carried", &model, &home, &analysis);
}

#[test]
fn a_translational_delta_has_34_base_parameters() {
    let path = "mechanisms/delta.yaml";
    let (model, analysis) = complete(path, &file(path), 34, 9);
    // its platform never rotates: only its mass has an effect
    for parameter in &analysis.base.parameters {
        for term in &parameter.terms {
            let label = &model.parameters[term.column].label;
            assert!(!label.ends_with("(platform)") || label == "m(platform)");
        }
    }
}

#[test]
fn a_four_bar_on_a_turntable_has_one_null_direction_more_than_its_trees_yield() {
    let path = "pairs/turntable/pin.yaml";
    complete(path, &file(path), 21, 1);
}

#[test]
fn a_four_bar_on_a_rotating_base_has_19_base_parameters() {
    let text = "name: rotating
geometry: {crank: 0.12, coupler: 0.35, rocker: 0.30, ground: 0.40, h: 0.1}
limbs:
  - name: driven
    joints:
      - {name: t, type: revolute, body: 0, actuated: true}
      - {name: q1, type: revolute, origin: {xyz: [h, 0, 0], rpy: [pi/2, 0, 0]}, body: 1, actuated: true}
      - {name: q2, type: revolute, dh: {a: crank}, body: 2}
  - name: following
    from: 0
    base: {xyz: [h + ground, 0, 0], rpy: [pi/2, 0, 0]}
    joints:
      - {name: q3, type: revolute, body: 3}
cuts:
  - {name: pin, joint: revolute, between: [{body: 2, xyz: [coupler, 0, 0]}, {body: 3, xyz: [rocker, 0, 0]}]}
home: {q1: pi/3, q2: -0.46557, q3: 1.72997}
";
    complete("rotating base", text, 19, 1);
}

#[test]
fn overconstrained_linkages_are_complete() {
    for (file_name, rank, completed) in [
        ("bennett", 9, 1),
        ("sarrus", 5, 7),
        ("delta4", 43, 11),
        ("agile_eye", 7, 24),
        ("pantograph", 25, 9),
    ] {
        let path = format!("base/{file_name}.yaml");
        complete(&path, &file(&path), rank, completed);
    }
}

/// Trees give all null directions of loops without special geometry.
#[test]
fn spherical_and_planar_loops_of_any_plane_need_no_completion() {
    for (file_name, rank) in [("spherical_fourbar", 11), ("tilted_fourbar", 8)] {
        let (_, _, analysis) = analysed(&file(&format!("base/{file_name}.yaml")));
        assert!(analysis.complete, "{file_name}");
        let base = &analysis.base;
        assert_eq!((base.rank(), base.completed), (rank, 0), "{file_name}");
    }
}

/// A Bennett linkage closes for one ratio of its lengths only, and at angles that cannot be varied:
/// no factor of it is known as a function of all of them.
#[test]
fn factors_that_are_right_only_at_the_given_values_are_marked() {
    let (_, _, analysis) = analysed(&file("base/bennett.yaml"));
    let base = &analysis.base;
    let unvaried = base.unvaried_names.join("\n");
    assert!(unvaried.contains("alpha as given only"), "{unvaried}");
    assert!(unvaried.contains("beta as given only"), "{unvaried}");
    assert!(unvaried.contains("a, b in proportion only"), "{unvaried}");
    for parameter in &base.parameters {
        let expected = match parameter.provenance {
            Provenance::Derived => Exactness::Symbolic,
            Provenance::Completed => Exactness::AtThisGeometry,
            Provenance::Proven => panic!("{parameter:?}"),
        };
        assert_eq!(parameter.exactness, expected);
    }
    let (_, _, delta) = analysed(&file("mechanisms/delta.yaml"));
    assert_eq!(delta.base.unvaried_names, [""; 0]);
    let everywhere = |e: Exactness| e == Exactness::Symbolic;
    assert!(
        delta
            .base
            .parameters
            .iter()
            .all(|p| everywhere(p.exactness))
    );
    assert!(delta.base.null.iter().all(|row| everywhere(row.exactness)));
}

/// A four-bar in a tilted plane on a turntable: a factor is the sine of a tilt times a ratio of lengths, which is not
/// recognised.
#[test]
fn no_formula_in_names_is_made_with_a_number_known_by_its_digits() {
    let text = "name: tilted
geometry: {e: 0.45, r: 0.22, s: 0.41, u: 0.33}
limbs:
  - name: table
    joints: [{name: z, type: revolute, body: table, actuated: true}]
  - name: left
    from: table
    base: {xyz: [0.12, 0.04, 0.1], rpy: [pi/2 - 0.28, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: crank, actuated: true}
      - {name: q2, type: revolute, dh: {a: r}, body: coupler}
      - {name: q4, type: revolute, dh: {alpha: 0.7, a: s/2, d: 0.05}, body: tool, actuated: true}
  - name: right
    from: table
    base: {xyz: [0.12 + e, 0.04, 0.1], rpy: [pi/2 - 0.28, 0, 0]}
    joints: [{name: q3, type: revolute, body: rocker}]
cuts:
  - {name: k, joint: revolute, between: [{body: coupler, xyz: [s, 0, 0]}, {body: rocker, xyz: [u, 0, 0]}]}
home: {q1: 1.0, q2: -0.7, q3: 1.5}
";
    let (model, _, analysis) = analysed(text);
    let table = table(&model, &analysis);
    assert!(
        analysis.complete && !analysis.base.unrecognised.is_empty(),
        "{table}"
    );
    let rows = analysis.base.parameters.iter();
    let rows = rows.filter(|row| row.exactness == Exactness::Numeric);
    let terms: Vec<String> = rows
        .flat_map(|row| &row.terms)
        .map(|term| term.coefficient.to_string())
        .collect();
    let numbers = |text: &str| {
        let words = text.split(|c: char| !c.is_ascii_digit() && c != '.');
        words.map(str::len).max().unwrap_or(0)
    };
    let is_of_digits = |text: &&String| numbers(text) > 12;
    assert!(terms.iter().any(|own| is_of_digits(&own)), "{table}");
    for own in terms.iter().filter(is_of_digits) {
        assert!(own.parse::<f64>().is_ok(), "{own}");
    }
}

/// The rocker's frame is rotated by 0.3 rad, whose sine has no short expression.
#[test]
fn a_factor_without_a_short_expression_is_a_number_and_is_marked() {
    let text = file("mechanisms/parallelogram_cut.yaml")
        .replace(
            "- {name: q3, type: revolute,",
            "- {name: q3, type: revolute, dh: {theta: 0.3},",
        )
        .replace(
            "{body: 3, xyz: [l, 0, 0]}",
            "{body: 3, xyz: [l*cos(0.3), -l*sin(0.3), 0]}",
        )
        .replace("q3: 1.1", "q3: 0.8");
    let (model, _, analysis) = analysed(&text);
    assert!(text.contains("theta: 0.3") && analysis.complete);
    let base = &analysis.base;
    assert_eq!(base.rank(), 3);
    let of_digits = base
        .null
        .iter()
        .filter(|row| row.exactness == Exactness::Numeric);
    let labels: Vec<&str> = of_digits
        .map(|row| model.parameters[row.column].label.as_str())
        .collect();
    assert!(!labels.is_empty(), "{}", table(&model, &analysis));
    assert!(!base.unrecognised.is_empty());
    for note in &base.unrecognised {
        assert!(note.contains("no short expression"), "{note}");
    }
}

#[test]
fn completed_parameters_can_be_stored() {
    let source = Source::new("test.yaml", file("mechanisms/parallelogram_cut.yaml"));
    let spec = spec::parse(&source).unwrap();
    let (model, _, analysis) = analysed(&source.text);
    let text = store(&source, &analysis);
    assert_eq!(restore(&text, &source, &spec, &model), Ok(analysis));
}
