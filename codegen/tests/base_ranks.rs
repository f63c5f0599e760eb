//! The known numbers of base parameters of some mechanisms, and the numbers that the spanning trees
//! give.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::base::Provenance;
use regen_codegen::diag::Source;
use regen_codegen::pipeline::derive;

use crate::base_support::{base, base_with, file};

fn rank(text: &str) -> usize {
    base(text).1.rank()
}

/// A rotor on every joint.
fn with_rotors(text: &str) -> String {
    text.replace("actuated: true", "actuated: true, rotor_inertia: true")
}

#[test]
fn serial_arms_have_their_known_ranks_and_one_tree_suffices() {
    for (path, plain, rotors) in [
        ("robots/puma560.yaml", 36, 40),
        ("tests/fixtures/base/rx90.yaml", 36, 40),
        ("tests/fixtures/base/ur5.yaml", 36, 40),
        ("tests/fixtures/base/panda.yaml", 43, 48),
        ("tests/fixtures/base/iiwa.yaml", 43, 48),
        ("tests/fixtures/base/stanford.yaml", 33, 37),
        ("tests/fixtures/base/scara.yaml", 8, 11),
        ("tests/fixtures/base/skew6r.yaml", 36, 41),
    ] {
        let text = file(path);
        let (_, found) = base(&text);
        assert_eq!((found.rank(), found.trees), (plain, 1), "{path}");
        assert_eq!(rank(&with_rotors(&text)), rotors, "{path} with rotors");
    }
}

#[test]
fn gravity_off_the_first_axis_shows_two_more_parameters() {
    let text = file("tests/fixtures/base/skew6r.yaml");
    let tilted = text.replace("limbs:", "gravity: [1.1, 0.7, -9.6]\nlimbs:");
    assert_eq!(rank(&tilted), rank(&text) + 2);
    assert_eq!(rank(&tilted), 38);
}

/// Path, and the number of base parameters by the spec's tree, by the sum over trees, and
/// certified.
const LOOPS: [(&str, usize, usize, usize); 14] = [
    ("robots/fourbar.yaml", 9, 8, 8),
    ("tests/fixtures/pairs/slider_crank/pin.yaml", 7, 6, 6),
    ("tests/fixtures/oracle/fivebar.yaml", 12, 11, 11),
    ("tests/fixtures/mechanisms/rrr3.yaml", 21, 19, 19),
    ("tests/fixtures/base/rpr3.yaml", 21, 19, 19),
    ("tests/fixtures/base/prr3.yaml", 15, 13, 13),
    ("tests/fixtures/oracle/3rps.yaml", 27, 25, 25),
    ("tests/fixtures/mechanisms/hexapod.yaml", 87, 82, 82),
    ("tests/fixtures/pairs/rsur/universal.yaml", 15, 14, 14),
    // 12 parameters of friction and rotors in addition to 21 and 19
    ("tests/fixtures/mechanisms/prs3.yaml", 33, 31, 31),
    // null directions that no tree gives
    ("tests/fixtures/mechanisms/delta.yaml", 45, 43, 34),
    ("tests/fixtures/mechanisms/parallelogram_cut.yaml", 9, 8, 3),
    ("tests/fixtures/pairs/turntable/pin.yaml", 24, 22, 21),
    ("tests/fixtures/base/fourbar_two_names.yaml", 9, 8, 3),
];

#[test]
fn sums_over_trees_reach_the_known_ranks_of_loops() {
    for (path, first, sum, _) in LOOPS {
        let text = file(path);
        let (model, one) = base_with(&text, Some(0));
        assert_eq!(one.trees, 1, "{path}");
        let (_, all) = base(&text);
        let columns = model.parameters.len();
        assert_eq!(
            (columns - one.from_trees, columns - all.from_trees),
            (first, sum),
            "{path}"
        );
    }
}

#[test]
fn null_directions_that_no_tree_yields_are_completed_to_the_certified_rank() {
    for (path, _, sum, known) in LOOPS {
        let source = Source::new(path, file(path));
        let robot = derive(&source).unwrap_or_else(|e| panic!("{e}"));
        let analysis = robot.analysis.unwrap();
        let certificate = analysis.certificate.unwrap();
        assert!(certificate.is_certain(), "{path}: {certificate:?}");
        assert_eq!(certificate.rank, known, "{path}");
        assert!(analysis.complete, "{path}");
        assert_eq!(analysis.base.completed, sum - known, "{path}");
        assert_eq!(analysis.base.rank(), known, "{path}");
        let completed = analysis.base.parameters.iter();
        let completed = completed
            .filter(|p| p.provenance != Provenance::Derived)
            .count();
        assert_eq!(completed > 0, sum > known, "{path}");
    }
}

#[test]
fn a_target_ends_the_search_with_the_same_null_space() {
    for (path, _, sum, known) in LOOPS {
        if sum != known {
            continue;
        }
        let text = file(path);
        let (model, all) = base(&text);
        let (_, targeted) = base_with(&text, Some(model.parameters.len() - known));
        assert!(targeted.trees <= all.trees, "{path}");
        // the reduced form of a null space does not depend on how the space was found
        assert_eq!(targeted.null.len(), all.null.len(), "{path}");
        assert_eq!(targeted.parameters, all.parameters, "{path}");
    }
}

#[test]
fn gravity_along_the_axes_leaves_a_four_bar_4_base_parameters() {
    let text = file("robots/fourbar.yaml").replace("[0, 0, -9.81]", "[0, -9.81, 0]");
    assert_eq!(rank(&text), 4);
}

#[test]
fn identical_legs_reduce_the_ranks_to_the_known_numbers() {
    let with = |path: &str, groups: &str| {
        let text = file(path);
        let text = text.split("\nbase:").next().unwrap();
        rank(&format!("{text}\nbase: {{equal: [{groups}]}}\n"))
    };
    assert_eq!(
        with("tests/fixtures/oracle/3rps.yaml", "[1, 4, 6], [2, 5, 7]"),
        15
    );
    assert_eq!(
        with(
            "tests/fixtures/mechanisms/rrr3.yaml",
            "[1, 4, 6], [2, 5, 7]"
        ),
        9
    );
    // 12 parameters of friction and rotors remain
    let prs = "[slider1, slider2, slider3], [rod1, rod2, rod3]";
    assert_eq!(with("tests/fixtures/mechanisms/prs3.yaml", prs), 13 + 12);
    let ups = "[1, 3, 5, 7, 9, 11], [2, 4, 6, 8, 10, 12]";
    assert_eq!(with("tests/fixtures/mechanisms/hexapod.yaml", ups), 22);
}

/// `BASE.md` proves it; the guide has the table.
#[test]
fn one_tree_gives_the_published_numbers_of_planar_robots_and_all_trees_one_fewer() {
    let equal = "\nbase: {equal: [[1, 4, 6], [2, 5, 7]]}\n";
    let page = file("runtime/guide/pages/compare.md");
    for (name, path, legs, published, certified) in [
        ("four-bar", "robots/fourbar.yaml", "", 9, 8),
        ("3-RRR", "tests/fixtures/mechanisms/rrr3.yaml", equal, 10, 9),
        ("3-RPR", "tests/fixtures/base/rpr3.yaml", equal, 10, 9),
        ("3-PRR", "tests/fixtures/base/prr3.yaml", equal, 8, 7),
    ] {
        let text = file(path) + legs;
        let (_, one) = base_with(&text, Some(0));
        assert_eq!((one.trees, one.rank()), (1, published), "{name}");
        let robot = derive(&Source::new(path, text)).unwrap_or_else(|e| panic!("{e}"));
        let analysis = robot.analysis.unwrap();
        assert!(analysis.complete, "{name}");
        assert_eq!(analysis.base.rank(), certified, "{name}");
        let row = page.lines().find(|l| l.starts_with(&format!("| {name} |")));
        let cells: Vec<&str> = row.unwrap().split('|').map(str::trim).collect();
        assert!(
            cells[2].starts_with(&format!("{published} ")),
            "{name}: {cells:?}"
        );
        assert_eq!(cells[3], certified.to_string(), "{name}");
    }
    let paper = file("runtime/guide/pages/paper.md");
    for (row, name) in [
        ("four-bar in a vertical plane", "fourbar"),
        ("five-bar", "fivebar"),
        ("planar 3-RRR", "3rrr"),
        ("3-RPS", "3rps"),
        ("Stewart platform, 6-UPS", "stewart"),
        ("translational Delta, 3-RUU", "delta"),
    ] {
        let (model, one) = base_with(&file(&format!("robots/{name}.yaml")), Some(0));
        let cells = format!("| {row} | {} | {} |", model.parameters.len(), one.rank());
        assert!(one.trees == 1 && paper.contains(&cells), "{cells}");
    }
}

#[test]
fn friction_and_rotors_of_the_3_rps_are_independent_of_its_25() {
    let linear = file("robots/3rps_friction.yaml");
    assert_eq!(rank(&linear), 34);
    let asymmetric = linear.replace("friction: linear", "friction: coulomb_asymmetric");
    assert_eq!(rank(&asymmetric), 37);
}

#[test]
fn on_a_vertical_slide_weight_and_one_sided_friction_are_one() {
    let text = with_rotors(&file("tests/fixtures/base/scara.yaml"));
    let asymmetric = text.replace("actuated: true", "actuated: true, friction: asymmetric");
    let (model, found) = base(&asymmetric);
    assert_eq!(model.parameters.len(), 40 + 16 + 4);
    assert_eq!(found.rank(), 11 + 16 - 1);
    let (_, symmetric) = base(&text.replace("actuated: true", "actuated: true, friction: linear"));
    assert_eq!(symmetric.rank(), 11 + 8);
    // the combined parameter: m(4) with Fc+(q4) and Fc-(q4), weighing 9.81 N/kg
    let label = |c: usize| model.parameters[c].label.as_str();
    let mixed: Vec<Vec<(&str, String)>> = found
        .null
        .iter()
        .map(|row| {
            let terms = row
                .terms
                .iter()
                .map(|t| (label(t.column), t.value.to_string()));
            let mut all: Vec<(&str, String)> = terms.collect();
            all.sort();
            assert!(all.iter().any(|(l, _)| *l == label(row.column)));
            all
        })
        .filter(|row| row.iter().any(|(l, _)| l.starts_with('F')))
        .collect();
    assert_eq!(mixed.len(), 1, "{mixed:?}");
    let labels: Vec<&str> = mixed[0].iter().map(|(l, _)| *l).collect();
    insta::assert_debug_snapshot!((labels, &mixed[0]));
}

/// The moving side of the slide is on the world: the tree begins at the cut, passes the joint
/// backward, and combines the sliding mass with the slide's asymmetric friction with the opposite
/// sign.
#[test]
fn a_slide_that_is_passed_backward_has_its_friction_weighed_with_its_sign() {
    let text = "name: backward
limbs:
  - name: chain
    base: {xyz: [0.2, 0, 0]}
    joints:
      - {name: s, type: spherical, body: 1}
      - {name: p, type: prismatic, origin: {xyz: [0.1, 0, 0.3]}, body: 2}
      - {name: u, type: universal, origin: {xyz: [0, 0.2, 0]}, body: 3}
      - {name: v, type: prismatic, origin: {xyz: [0.1, 0, 0.2]}, body: 4, friction: coulomb_asymmetric, rotor_inertia: true, actuated: true}
cuts:
  - {name: foot, joint: fixed, between: [{body: 4}, {body: world, xyz: [0.4, 0.2, 0.5]}]}
independent: [v]
";
    let robot = derive(&Source::new("backward.yaml", text)).unwrap_or_else(|e| panic!("{e}"));
    let analysis = robot.analysis.unwrap();
    assert!(analysis.complete, "{analysis:?}");
    assert_eq!(analysis.base.refuted, 0);
    let label = |c: usize| robot.parameters[c].label.as_str();
    let row = analysis.base.null.iter().find(|row| {
        let names: Vec<&str> = row.terms.iter().map(|t| label(t.column)).collect();
        let one = |start: &str| names.iter().any(|n| n.starts_with(start));
        one("m(") && one("J(") && one("Fc")
    });
    assert!(row.is_some(), "{:?}", analysis.base.null);
}

#[test]
fn a_rotor_merges_where_its_joint_is_the_first_on_the_ground() {
    // J(q1) has the same effect as Izz(1) where nothing else moves body 1
    let (model, found) = base(&with_rotors(&file("robots/puma560.yaml")));
    let label = |c: usize| model.parameters[c].label.as_str();
    let together = found.null.iter().any(|row| {
        let mut names: Vec<&str> = row.terms.iter().map(|t| label(t.column)).collect();
        names.sort_unstable();
        names == ["Izz(1)", "J(q1)"]
    });
    assert!(together);
}
