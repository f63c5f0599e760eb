//! Derived expressions as text, which were compared with the chapter by hand.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::path::Path;

use regen_codegen::constraints::{Closed, Pivot, world_equations};
use regen_codegen::diag::Source;
use regen_codegen::dynamics::{Reduction, TreeKinematics, reduced_regressor};
use regen_codegen::functions::Symbols;
use regen_codegen::kinematics::{Arguments, Frames, Geometry, Rates, centres, motions, twists};
use regen_codegen::model::{self, Model};
use regen_codegen::spec::{Spec, parse};
use regen_codegen::sym::{Ex, Graph, print::text};

/// A vertical planar arm of two bars; the axes point out of the plane.
const ARM: &str = "
name: arm
geometry: {l1: 2/5, g: 9.81}
gravity: [0, -g, 0]
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, friction: linear}
      - {name: q2, type: revolute, dh: {a: l1}, body: 2, actuated: true, rotor_inertia: true}
";

fn read(name: &str, text: &str) -> Spec {
    let source = Source::new(name, text);
    parse(&source).unwrap_or_else(|e| panic!("{e}"))
}

fn file(name: &str) -> Spec {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/oracle");
    let text = std::fs::read_to_string(path.join(name)).unwrap();
    read(name, &text)
}

/// Frames in which every name of the geometry stands for itself.
fn named_frames(g: &mut Graph, spec: &Spec, model: &Model) -> Frames {
    let _ = Symbols::new(g, model);
    let names: Vec<&str> = spec
        .geometry
        .iter()
        .map(|(n, _)| n.value.as_str())
        .collect();
    let names = Arguments::new(g, spec, &names, str::to_owned);
    Frames::new(g, model, Geometry::Arguments(names))
}

/// The nonzero entries of a matrix, one per line.
fn entries(
    g: &Graph,
    name: &str,
    rows: &[String],
    columns: &[String],
    at: impl Fn(usize, usize) -> Ex,
) -> String {
    let mut out = String::new();
    for (j, column) in columns.iter().enumerate() {
        for (i, row) in rows.iter().enumerate() {
            let entry = at(i, j);
            if !entry.is_zero() {
                writeln!(out, "{name}[{row}, {column}] = {}", text(g, entry)).unwrap();
            }
        }
    }
    out
}

fn coordinates(model: &Model) -> Vec<String> {
    model.coordinates.iter().map(|c| c.name.clone()).collect()
}

fn rates(g: &mut Graph, model: &Model) -> Rates {
    let mut all = |suffix: &str| -> Vec<Ex> {
        let names = model.coordinates.iter();
        names
            .map(|c| g.symbol(&format!("{}{suffix}", c.name)))
            .collect()
    };
    let (qd, qdd) = (all("'"), all("''"));
    Rates {
        rd: qd.clone(),
        qd,
        qdd,
        gravity: true,
    }
}

/// Checked by hand against Eq. 4, with w the angular velocity, al its rate, a
/// the acceleration of a frame's origin less gravity, r = r_OkOi:
///
/// - Body 1 only rotates about its axis: a_1 = R_1^T (0, g, 0) =
///   (g sin q1, g cos q1, 0). With r = 0, Eq. 4 leaves z.(eta_hat I - a_1 x m r):
///   Izz: al, mx: a_1y, my: -a_1x.
/// - Body 2: w = q1' + q2', al = q1'' + q2'', and its origin adds eta_tilde_1 (l1, 0, 0) =
///   (-l1 q1'^2, l1 q1'', 0) to a_1, rotated back by q2:
///   a_2x = cos(q2) (g sin q1 - l1 q1'^2) + sin(q2) (g cos q1 + l1 q1''),
///   a_2y = -sin(q2) (g sin q1 - l1 q1'^2) + cos(q2) (g cos q1 + l1 q1'').
///   In row q2 again r = 0: mx: a_2y, my: -a_2x.
/// - Row q1 of body 2 has r = l1 (cos q2, -sin q2, 0) in frame 2, from O1 to O2:
///   r x eta_tilde m r adds l1 (cos(q2) al - sin(q2) w^2) to mx and
///   -l1 (cos(q2) w^2 + sin(q2) al) to my, and r x a_2 m is
///   l1 (cos(q2) a_2y + sin(q2) a_2x), which contains l1^2 q1'' > 0.
///   With r from Oi to Ok, as the chapter's text says, these three would change sign, and a
///   mass at the elbow would help to accelerate the arm.
/// - No entry for mz, for Ixx ... Iyz, or in row q2 for body 1 and m(2).
/// - Friction opposes: +Fv q' and +Fc sgn(q') on the side of the effort (Eq. 14 with its
///   sign corrected); a rotor is multiplied by the q'' of its row (Eq. 18).
#[test]
fn columns_of_a_planar_arm_are_those_of_equation_4() {
    let spec = read("arm.yaml", ARM);
    let model = model::build(&spec);
    let mut g = Graph::new();
    let frames = named_frames(&mut g, &spec, &model);
    let rates = rates(&mut g, &model);
    let motions = motions(&mut g, &frames, &rates, None);
    let twists = twists(&mut g, &frames, &model);
    let j = Reduction::new(&mut g, &model, &[]);
    let centres = centres(&mut g, &frames, &model);
    let tree = TreeKinematics {
        frames: &frames,
        twists: &twists,
        centres: &centres,
    };
    let wanted = vec![true; model.parameters.len()];
    let columns = reduced_regressor(&mut g, &model, &motions, &tree, &rates, &j, &wanted);
    let parameters: Vec<String> = model.parameters.iter().map(|p| p.label.clone()).collect();
    let shown = entries(&g, "K", &coordinates(&model), &parameters, |i, j| {
        columns[j][i]
    });
    insta::assert_snapshot!(shown);
}

/// Checked by hand: a leg's pivot is r (cos p, sin p, 0), p = 0, 120, -120 degrees, and the
/// leg extends by q (cos p sin t, sin p sin t, cos t) for its length q and tilt t about the
/// tangent. So f of s2 ends with -r/2 - q7 sin(q6)/2, sqrt(3)/2 (r + q7 sin(q6)), q7 cos(q6),
/// and begins with minus the position of the joint on the platform, r + q2 sin(q1), 0, q2 cos(q1)
/// and the platform's side a along its x axis. s3 is half of that along x and sqrt(3)/2 a along y.
/// A's columns are the partial derivatives; s1.3 rotates the platform about its side towards s2, so
/// the column of s1.3 is zero in s2.
#[test]
fn closure_equations_of_the_3rps_are_those_of_its_legs() {
    let spec = file("3rps.yaml");
    let model = model::build(&spec);
    let mut g = Graph::new();
    let frames = named_frames(&mut g, &spec, &model);
    let equations = world_equations(&mut g, &frames, &model, None);
    let rows: Vec<String> = row_names(&model);
    let mut shown = String::new();
    for (row, f) in rows.iter().zip(&equations.residual) {
        writeln!(shown, "f[{row}] = {}", text(&g, *f)).unwrap();
    }
    shown.push_str(&entries(&g, "A", &rows, &coordinates(&model), |i, j| {
        equations.jacobian[i][j]
    }));
    insta::assert_snapshot!(shown);
}

/// Names of the rows: `s2.1` is row 1 of the cut s2.
fn row_names(model: &Model) -> Vec<String> {
    let cuts = model.cuts.iter().flat_map(|cut| {
        let rows = 1..=cut.kind.equations();
        rows.map(|row| format!("{}.{row}", cut.name))
    });
    let velocity_constraints = model.couplings.iter();
    let velocity_constraints =
        velocity_constraints.map(|tie| format!("tie of {}", model.coordinates[tie.key].name));
    cuts.chain(velocity_constraints).collect()
}

/// A summary of the output of each stage.
fn stages(spec: &Spec) -> String {
    let model = &model::build(spec);
    let mut g = Graph::new();
    let _ = Symbols::new(&mut g, model);
    let frames = Frames::new(&mut g, model, Geometry::Values);
    let closed = Closed::new(&mut g, &frames, model).unwrap();
    let closure = closed.closure.unwrap();
    let names = |which: &[usize]| -> String {
        let all = coordinates(model);
        let names: Vec<&str> = which.iter().map(|c| all[*c].as_str()).collect();
        names.join(" ")
    };
    let mut out = String::new();
    writeln!(out, "independent: {}", names(&model.independent)).unwrap();
    writeln!(out, "dependent: {}", names(&model.dependent)).unwrap();
    writeln!(out, "home:").unwrap();
    for (coordinate, value) in model.coordinates.iter().zip(&closed.home) {
        // adding 0.0 turns -0.0 into 0.0
        let rounded = (value * 1e6).round() / 1e6 + 0.0;
        writeln!(out, "  {} = {rounded}", coordinate.name).unwrap();
    }
    for (cut, view) in model.cuts.iter().zip(closure.viewpoints()) {
        writeln!(out, "loop of {}: seen from {view:?}", cut.name).unwrap();
    }
    let rows = row_names(model);
    for Pivot {
        row,
        column,
        median_size: size,
    } in &closure.plan().pivots
    {
        let column = names(&[model.dependent[*column]]);
        writeln!(
            out,
            "pivot: row {}, {column}, usually {size:.2}",
            rows[*row]
        )
        .unwrap();
    }
    for row in closure.redundant_rows() {
        writeln!(out, "redundant: row {}", rows[*row]).unwrap();
    }
    for chunk in model.parameters.chunks(10) {
        let labels: Vec<&str> = chunk.iter().map(|p| p.label.as_str()).collect();
        writeln!(out, "parameters: {}", labels.join(" ")).unwrap();
    }
    out
}

/// The closure of the planar loop keeps the two rows in its plane, whatever the orientation of the
/// plane.
#[test]
fn stages_of_the_fivebar() {
    insta::assert_snapshot!(stages(&file("fivebar.yaml")));
}

#[test]
fn stages_of_the_3rps() {
    insta::assert_snapshot!(stages(&file("3rps.yaml")));
}
