//! The function that closes a robot's loops: Newton's method along a straight line, in sub-steps.

use std::fmt::Write as _;

use crate::robot::Robot;
use crate::signature::FunctionKind;

use super::NEAR_SINGULAR;
use super::functions::Functions;
use super::statements::Precision;
use super::support::spelled;
use super::words::Spelling;

/// The largest number of sub-steps.
const MOST_STEPS: usize = 1000;
/// A step of Newton's method that moves no coordinate by more closes the loops, by precision.
const SMALL: [f64; 2] = [1e-9, 1e-5];

/// Whether a robot's files have the function: it has loops, and its Newton steps are among the functions.
pub(super) fn exists(robot: &Robot) -> bool {
    let mut kinds = robot.functions.iter().map(|f| f.kind);
    !robot.dependent.is_empty() && kinds.any(|kind| kind == FunctionKind::NewtonStep)
}

/// The names of the functions, of both precisions.
pub(super) fn symbols<'r>(robot: &Robot, names: &'r Spelling) -> impl Iterator<Item = String> + 'r {
    let all = Precision::ALL.into_iter().filter(|_| exists(robot));
    let all: Vec<Precision> = all.collect();
    all.into_iter()
        .map(|p| format!("{}_close{}", names.prefix, p.suffix()))
}

/// The documented prototypes; nothing where there is no function.
pub(super) fn declarations(
    robot: &Robot,
    names: &Spelling,
    functions: &Functions,
    out: &mut String,
) {
    if !exists(robot) {
        return;
    }
    let Spelling { prefix, macros } = names;
    let (independent, coordinates) = (robot.independent.len(), robot.coordinates.len());
    let geometry = match robot.adjustable.len() {
        0 => String::new(),
        count => format!(
            "geometry[{count}]: the geometry with which they close, in the order of {prefix}_geometry\n   "
        ),
    };
    let stack = |precision: Precision, bytes: usize| {
        let own = bytes * (2 * coordinates + robot.dependent.len()) + 256;
        (functions.stack(FunctionKind::NewtonStep, precision) + own).next_multiple_of(64)
    };
    let _ = write!(
        out,
        "\n/* Closes the loops at other independent coordinates, along the straight line to them: in one step where\n   \
         they move little, as from one cycle of a controller to the next, and in as many sub-steps as it takes\n   \
         where they move far. Begin with a copy of {prefix}_home.\n\n   \
         q_i[{independent}]: the independent coordinates to move to, in the order of {prefix}_independent\n   \
         {geometry}\
         q[{coordinates}], changed: the coordinates of a closed state, and then those of the new one\n   \
         Returns 0 where the loops are closed, and else -1 with q as it was: where the line leads to a nearly\n   \
         singular state or to none, after {MOST_STEPS} sub-steps, and where a number is not finite.\n\n   \
         Stack: at most {} bytes on double, {} on float. */\n",
        stack(Precision::Double, 8),
        stack(Precision::Float, 4),
    );
    for precision in Precision::ALL {
        let guard = super::functions::guard(macros, precision);
        let _ = writeln!(
            out,
            "#ifndef {guard}\n{};\n#endif",
            spelled(&head(robot), prefix, precision)
        );
    }
}

/// The function in one precision; nothing where there is none.
pub(super) fn definition(robot: &Robot, names: &Spelling, precision: Precision) -> String {
    if !exists(robot) {
        return String::new();
    }
    // a drive counts by the motion of its joints
    let travel = |c: &usize| {
        let joint = robot.joints.get(*c);
        joint.map_or(1.0, |j| j.travel[0] + j.travel[1])
    };
    let units = robot.dependent.iter().map(travel);
    let units: Vec<f64> = units.map(|x| if x > 0.0 { x } else { 1.0 }).collect();
    let is_one = units.iter().all(|x| (x - 1.0).abs() < f64::EPSILON);
    let (table, size) = if is_one {
        (String::new(), "step[k]")
    } else {
        let units: Vec<String> = units.iter().map(|x| precision.literal(*x)).collect();
        let units = units.join(", ");
        (
            format!("    static const REAL units[] = {{ {units} }};\n"),
            "step[k] / units[k]",
        )
    };
    let small = match precision {
        Precision::Double => SMALL[0],
        Precision::Float => SMALL[1],
    };
    let body = BODY
        .replace("MOST", &MOST_STEPS.to_string())
        .replace("SMALL", &precision.literal(small))
        .replace("NEAR", &precision.literal(NEAR_SINGULAR))
        .replace("SIZE", size);
    let body = if robot.adjustable.is_empty() {
        body
    } else {
        body.replace("(next, step)", "(next, geometry, step)")
    };
    let text = spelled(
        &format!("\n{}\n{{\n{table}{body}", head(robot)),
        &names.prefix,
        precision,
    );
    text.replace("%M", &names.macros)
        .replace("%p", &names.prefix)
}

/// The head of the function.
fn head(robot: &Robot) -> String {
    let geometry = if robot.adjustable.is_empty() {
        ""
    } else {
        "const REAL *RESTRICT geometry, "
    };
    format!("int @close(const REAL *RESTRICT q_i, {geometry}REAL *RESTRICT q)")
}

const BODY: &str = r"    REAL last[%M_COORDINATE_COUNT], next[%M_COORDINATE_COUNT], step[%M_DEPENDENT_COUNT];
    REAL done = #0.0, part = #1.0;
    int taken = 0;
    for (int k = 0; k < %M_COORDINATE_COUNT; k++) {
        last[k] = q[k];
    }
    while (done < #1.0) {
        const REAL to = done + part < #1.0 ? done + part : #1.0;
        REAL before = #0.5; /* the first step is at most a quarter, rad or m */
        int closed = 0;
        for (int k = 0; k < %M_COORDINATE_COUNT; k++) {
            next[k] = last[k];
        }
        for (int k = 0; k < %M_INDEPENDENT_COUNT; k++) {
            const REAL from = q[%p_independent[k]];
            next[%p_independent[k]] = to < #1.0 ? from + to * (q_i[k] - from) : q_i[k];
        }
        while (!closed) {
            const REAL condition = @newton_step(next, step);
            REAL length = #0.0;
            for (int k = 0; k < %M_DEPENDENT_COUNT; k++) {
                const REAL own = SIZE;
                const REAL size = own < #0.0 ? -own : own;
                length = length < size || size != size ? size : length;
                next[%p_dependent[k]] += step[k];
            }
            /* also false for NaN */
            if (!(condition >= NEAR && length <= #0.5 * before)) {
                break;
            }
            closed = length < SMALL;
            before = length;
        }
        taken += 1;
        if (closed) {
            for (int k = 0; k < %M_COORDINATE_COUNT; k++) {
                last[k] = next[k];
            }
            done = to;
            part *= #2.0;
        } else {
            part *= #0.5;
        }
        if (part < #0.0009765625 || taken == MOST) {
            return -1;
        }
    }
    for (int k = 0; k < %M_COORDINATE_COUNT; k++) {
        q[k] = last[k];
    }
    return 0;
}
";
