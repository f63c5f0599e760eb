//! The constants of a robot's C files: declared in the header, defined in the source.

use std::fmt::Write as _;

use crate::base::Term;
use crate::robot::{JointInfo, MotionKind, Robot};
use crate::signature::Size;

use super::super::elements::{base_of, elements};
use super::super::text::wrapped;
use super::names::{comment, literal, string};
use super::words::Spelling;

/// Longest text of a base parameter, in bytes: C99 compilers need not read strings above 4095.
const MAX_TEXT: usize = 4000;

/// The contents of an array.
enum Values {
    Texts(Vec<String>),
    Indices(Vec<usize>),
    Numbers(Vec<f64>),
}

/// A constant array.
struct Array {
    name: &'static str,
    doc: &'static str,
    values: Values,
}

/// The macros of sizes.
const SIZES: [(&str, Size, &str); 11] = [
    ("COORDINATE_COUNT", Size::Coordinates, "coordinates"),
    (
        "INDEPENDENT_COUNT",
        Size::Independent,
        "independent coordinates",
    ),
    ("DEPENDENT_COUNT", Size::Dependent, "other coordinates"),
    ("ACTUATED_COUNT", Size::Actuated, "actuated coordinates"),
    ("ROW_COUNT", Size::Rows, "closure rows"),
    ("PARAMETER_COUNT", Size::Parameters, "dynamic parameters"),
    ("BODY_COUNT", Size::Bodies, "bodies"),
    ("FRAME_COUNT", Size::Frames, "named frames"),
    ("CONE_COUNT", Size::Cones, "limits of swing angles"),
    ("BASE_COUNT", Size::Base, "base parameters"),
    ("FREE_COUNT", Size::Free, "eliminated parameters"),
];

impl Values {
    /// The elements as C text.
    fn spelled(&self) -> (&'static str, Vec<String>) {
        match self {
            Values::Texts(texts) => (
                "const char *const",
                texts.iter().map(|text| string(text)).collect(),
            ),
            Values::Indices(indices) => {
                ("const int", indices.iter().map(usize::to_string).collect())
            }
            Values::Numbers(numbers) => (
                "const double",
                numbers.iter().copied().map(literal).collect(),
            ),
        }
    }

    fn len(&self) -> usize {
        match self {
            Values::Texts(texts) => texts.len(),
            Values::Indices(indices) => indices.len(),
            Values::Numbers(numbers) => numbers.len(),
        }
    }
}

/// Lower and upper limits, one pair after the other.
fn limits(robot: &Robot, which: usize) -> Values {
    let limit = |joint: &JointInfo| {
        let stated = joint.limits.get(which).copied().flatten();
        stated.unwrap_or([f64::NEG_INFINITY, f64::INFINITY])
    };
    Values::Numbers(robot.joints.iter().flat_map(limit).collect())
}

/// All arrays that have an element.
fn arrays(robot: &Robot) -> Vec<Array> {
    let named = |size| Values::Texts(elements(robot, size));
    let joints = || robot.joints.iter();
    let unit = |joint: &JointInfo| match joint.motion {
        MotionKind::Rotation => "rad".to_owned(),
        MotionKind::Translation => "m".to_owned(),
    };
    let base = if base_of(robot).is_some() {
        [
            named(Size::Base),
            Values::Texts(combinations(robot)),
            named(Size::Free),
        ]
    } else {
        [(); 3].map(|()| Values::Texts(Vec::new()))
    };
    let [base, base_text, free] = base;
    let mut all = Vec::new();
    let mut add = |name, doc, values: Values| {
        if values.len() > 0 {
            all.push(Array { name, doc, values });
        }
    };
    add(
        "coordinates",
        "Names of the coordinates, in the order of q.",
        named(Size::Coordinates),
    );
    add(
        "coordinate_units",
        "Units of the coordinates.",
        Values::Texts(joints().map(unit).collect()),
    );
    add(
        "independent",
        "The independent coordinates, as indices: the rows of the regressor.",
        Values::Indices(robot.independent.clone()),
    );
    add(
        "dependent",
        "The other coordinates, as indices.",
        Values::Indices(robot.dependent.clone()),
    );
    add(
        "actuated",
        "The actuated coordinates, as indices.",
        Values::Indices(robot.actuated.clone()),
    );
    add(
        "parameters",
        "Labels of the parameters, in the order of phi: the columns of the regressor.",
        named(Size::Parameters),
    );
    add(
        "nominal",
        "Nominal values of the parameters, SI, about the origins of the bodies' frames; NAN where none is\n   stated.",
        Values::Numbers(
            robot
                .nominal
                .iter()
                .map(|x| x.unwrap_or(f64::NAN))
                .collect(),
        ),
    );
    add("bodies", "Labels of the bodies.", named(Size::Bodies));
    add("frames", "Names of the frames.", named(Size::Frames));
    add(
        "home",
        "The home configuration, closed; it picks the assembly branch.",
        Values::Numbers(robot.home.clone()),
    );
    let names = robot.adjustable.iter().map(|(name, _)| name.clone());
    add(
        "geometry",
        "Names of the adjustable geometry, in the order of geometry.",
        Values::Texts(names.collect()),
    );
    let values = robot.adjustable.iter().map(|(_, value)| *value);
    add(
        "stated_geometry",
        "The adjustable geometry as the description states it, m or rad; home is closed with it.",
        Values::Numbers(values.collect()),
    );
    add(
        "gravity_vector",
        "Gravity in the world frame, m/s^2.",
        Values::Numbers(robot.gravity.to_vec()),
    );
    let kinds: [(&str, &str); 5] = [
        (
            "position_limits",
            "Lower and upper limit of each coordinate, one pair after the other; infinite where none is stated.",
        ),
        ("velocity_limits", "The same of the velocities."),
        ("acceleration_limits", "The same of the accelerations."),
        ("jerk_limits", "The same of the rates of the accelerations."),
        ("effort_limits", "The same of the efforts, N m or N."),
    ];
    for (which, (name, doc)) in kinds.into_iter().enumerate() {
        add(name, doc, limits(robot, which));
    }
    add(
        "friction_laws",
        "Names of the friction laws of the coordinates.",
        Values::Texts(joints().map(|j| j.friction_name().to_owned()).collect()),
    );
    add(
        "cone_names",
        "Names of the joints and cuts whose swing angles are limited.",
        Values::Texts(robot.cones.iter().map(|c| c.name.clone()).collect()),
    );
    add(
        "greatest_swings",
        "The greatest swing angles of these, rad.",
        Values::Numbers(robot.cones.iter().map(|c| c.greatest).collect()),
    );
    add(
        "base",
        "Labels of the base parameters, in the order of beta: the columns of base_regressor.",
        base,
    );
    add(
        "base_combinations",
        "The combinations of parameters that the base parameters are, in the lengths of the description.",
        base_text,
    );
    add(
        "free",
        "Labels of the eliminated parameters, in the order of free.",
        free,
    );
    all
}

/// The base parameters as sums of parameters. Where a sum is too long for a string, its coefficients
/// are numbers; where it still is, it ends in dots.
fn combinations(robot: &Robot) -> Vec<String> {
    let label = |column: usize| {
        robot
            .parameters
            .get(column)
            .map_or("", |p| p.label.as_str())
    };
    let exact = |term: &Term| {
        let (minus, size) = term.coefficient.unsigned();
        let text = match &size {
            one if one.is_one() => String::new(),
            sum if sum.is_sum() => format!("({sum})*"),
            other => format!("{other}*"),
        };
        (minus, text)
    };
    let number = |term: &Term| {
        let value = term.value.to_f64();
        (value < 0.0, format!("{:e}*", value.abs()))
    };
    let sum = |terms: &[Term], part: &dyn Fn(&Term) -> (bool, String)| {
        let mut text = String::new();
        for term in terms {
            let (minus, factor) = part(term);
            let sign = match (minus, text.is_empty()) {
                (true, true) => "-",
                (false, true) => "",
                (true, false) => " - ",
                (false, false) => " + ",
            };
            let _ = write!(text, "{sign}{factor}{}", label(term.column));
        }
        text
    };
    let parameters = robot.analysis.iter().flat_map(|a| &a.base.parameters);
    parameters
        .filter(|p| !p.dropped)
        .map(|p| {
            let mut text = sum(&p.terms, &exact);
            if text.len() > MAX_TEXT {
                text = sum(&p.terms, &number);
            }
            if text.len() > MAX_TEXT {
                let cut = text.char_indices().map(|(at, _)| at);
                let cut = cut.take_while(|at| *at <= MAX_TEXT).last().unwrap_or(0);
                text.truncate(cut);
                text.push_str(" ...");
            }
            text
        })
        .collect()
}

/// The names of the arrays.
pub(super) fn symbols<'r>(robot: &Robot, names: &'r Spelling) -> impl Iterator<Item = String> + 'r {
    let all = arrays(robot).into_iter();
    all.map(|array| format!("{}_{}", names.prefix, array.name))
}

/// Writes the macros of sizes and the declarations of arrays.
pub(super) fn declarations(robot: &Robot, names: &Spelling, out: &mut String) {
    let Spelling { prefix, macros } = names;
    out.push_str("\n/* Sizes. Arrays of length zero are not declared. */\n");
    for (name, size, doc) in SIZES {
        let length = robot.length(size);
        let _ = writeln!(out, "#define {macros}_{name} {length} /* {doc} */");
    }
    for Array { name, doc, values } in arrays(robot) {
        let (kind, items) = values.spelled();
        let doc = comment_lines(doc);
        let _ = writeln!(
            out,
            "\n/* {doc} */\nextern {kind} {prefix}_{name}[{}];",
            items.len()
        );
    }
}

/// Documentation of our own may have several lines.
fn comment_lines(doc: &str) -> String {
    let lines: Vec<String> = doc
        .split('\n')
        .map(|l| comment(l).trim_end().to_owned())
        .collect();
    lines.join("\n")
}

/// Writes the definitions of arrays.
pub(super) fn definitions(robot: &Robot, names: &Spelling, out: &mut String) {
    for Array { name, values, .. } in arrays(robot) {
        let (kind, items) = values.spelled();
        let _ = writeln!(
            out,
            "\n{kind} {}_{name}[{}] = {{",
            names.prefix,
            items.len()
        );
        wrapped(out, items.into_iter());
        out.push_str("};\n");
    }
}
