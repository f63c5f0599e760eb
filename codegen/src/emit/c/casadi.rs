//! Functions of a robot for `casadi.external`, with their Jacobians, around those of its C files.
//!
//! `CasADi` finds a function and what it tells of itself by name in a shared library, and its Jacobian
//! by the name with `jac_` before it. That takes all arguments and the results, of which it needs none,
//! and gives one block by each argument, column by column.

use std::fmt::Write as _;

use crate::robot::Robot;
use crate::signature::{FunctionKind, Size};

use super::close;
use super::names::comment;
use super::words::Spelling;

/// A function of independent coordinates.
struct External {
    name: &'static str,
    about: &'static str,
    inputs: &'static [(&'static str, Size)],
    output: (&'static str, Size),
    /// Entries of the result per element of its size.
    each: usize,
    body: &'static str,
    /// The body of the Jacobian; empty where there is none.
    jacobian: &'static str,
    /// The functions of the C files that both bodies call.
    calls: &'static [FunctionKind],
}

/// Bodies return 1 where a state has no meaning, at which solvers take a shorter step.
const ALL: [External; 5] = [
    External {
        name: "inverse_dynamics",
        about: "the efforts of the independent coordinates, N m or N",
        inputs: &[
            ("q_i", Size::Independent),
            ("qd_i", Size::Independent),
            ("qdd_i", Size::Independent),
            ("phi", Size::Parameters),
        ],
        output: ("tau_i", Size::Independent),
        each: 1,
        body: "    double *q = w, *qd = q + N, *qdd = qd + N;
    if (closed(arg[0], q) || is_singular(@velocities(q, given(arg[1]), qd))
        || is_singular(@accelerations(q, qd, given(arg[2]), qdd))) {
        return 1;
    }
    return res[0] ? is_singular(@inverse_dynamics(q, qd, qdd, given(arg[3]), res[0])) : 0;
",
        jacobian: "    double *q = w, *qd = q + N, *qdd = qd + N, *slopes = qdd + N;
    if (closed(arg[0], q) || is_singular(@velocities(q, given(arg[1]), qd))
        || is_singular(@accelerations(q, qd, given(arg[2]), qdd))) {
        return 1;
    }
    if (res[0] || res[1]) {
        if (is_singular(@inverse_dynamics_derivatives(q, qd, qdd, given(arg[3]), slopes))) {
            return 1;
        }
        copy(slopes, I * I, res[0]);
        copy(slopes + I * I, I * I, res[1]);
    }
    if (res[2] && is_singular(@mass_matrix(q, given(arg[3]), res[2]))) {
        return 1;
    }
    return res[3] ? is_singular(@regressor(q, qd, qdd, res[3])) : 0;
",
        calls: &[
            FunctionKind::InverseDynamics,
            FunctionKind::InverseDynamicsDerivatives,
            FunctionKind::MassMatrix,
            FunctionKind::Regressor,
        ],
    },
    External {
        name: "forward_dynamics",
        about: "the accelerations of the independent coordinates, rad/s^2 or m/s^2",
        inputs: &[
            ("q_i", Size::Independent),
            ("qd_i", Size::Independent),
            ("tau_i", Size::Independent),
            ("phi", Size::Parameters),
        ],
        output: ("qdd_i", Size::Independent),
        each: 1,
        body: "    double *q = w, *qd = q + N;
    if (closed(arg[0], q) || is_singular(@velocities(q, given(arg[1]), qd))) {
        return 1;
    }
    return res[0] ? is_singular(@forward_dynamics(q, qd, given(arg[2]), given(arg[3]), res[0])) : 0;
",
        jacobian: "    double *q = w, *qd = q + N, *qdd = qd + N, *slopes = qdd + N;
    if (closed(arg[0], q) || is_singular(@velocities(q, given(arg[1]), qd))
        || is_singular(@forward_dynamics_derivatives(q, qd, given(arg[2]), given(arg[3]), slopes))) {
        return 1;
    }
    for (int block = 0; block < 3; block++) {
        copy(slopes + I * I * block, I * I, res[block]);
    }
    if (res[3]) {
        /* M qdd_i + h = tau_i: with phi the efforts change as if qdd_i were given */
        const double *inverse = slopes + 2 * I * I;
        double *qdd_i = slopes + 3 * I * I, *columns = qdd_i + I;
        if (is_singular(@forward_dynamics(q, qd, given(arg[2]), given(arg[3]), qdd_i))
            || is_singular(@accelerations(q, qd, qdd_i, qdd)) || is_singular(@regressor(q, qd, qdd, columns))) {
            return 1;
        }
        for (int c = 0; c < P; c++) {
            for (int r = 0; r < I; r++) {
                double sum = 0.0;
                for (int k = 0; k < I; k++) {
                    sum -= inverse[I * k + r] * columns[I * c + k];
                }
                res[3][I * c + r] = sum;
            }
        }
    }
    return 0;
",
        calls: &[
            FunctionKind::ForwardDynamics,
            FunctionKind::ForwardDynamicsDerivatives,
            FunctionKind::Regressor,
        ],
    },
    External {
        name: "close",
        about: "all coordinates of the closed state, rad or m",
        inputs: &[("q_i", Size::Independent)],
        output: ("q", Size::Coordinates),
        each: 1,
        body: "    if (closed(arg[0], w)) {
        return 1;
    }
    copy(w, N, res[0]);
    return 0;
",
        jacobian: "    double *q = w, *unit = q + N;
    if (closed(arg[0], q)) {
        return 1;
    }
    for (int c = 0; c < I && res[0]; c++) {
        for (int k = 0; k < I; k++) {
            unit[k] = k == c ? 1.0 : 0.0;
        }
        if (is_singular(@velocities(q, unit, res[0] + N * c))) {
            return 1;
        }
    }
    return 0;
",
        calls: &[FunctionKind::Velocities],
    },
    External {
        name: "frame_pose",
        about: "the poses of the frames: rotation to the world row by row, then the origin, m",
        inputs: &[("q_i", Size::Independent)],
        output: ("poses", Size::Frames),
        each: 12,
        body: "    if (closed(arg[0], w)) {
        return 1;
    }
    if (res[0]) {
        @frame_pose(w, res[0]);
    }
    return 0;
",
        jacobian: "    double *q = w, *poses = q + N, *rates = poses + 12 * F;
    if (!res[0]) {
        return 0;
    }
    if (closed(arg[0], q) || is_singular(@frame_jacobian(q, rates))) {
        return 1;
    }
    @frame_pose(q, poses);
    for (int c = 0; c < I; c++) {
        for (int f = 0; f < F; f++) {
            const double *turn = poses + 12 * f, *v = rates + 6 * I * f + c, *o = v + 3 * I;
            double *out = res[0] + 12 * (F * c + f);
            for (int k = 0; k < 3; k++) {
                /* the axes turn with the angular velocity o */
                out[k] = o[I] * turn[6 + k] - o[2 * I] * turn[3 + k];
                out[3 + k] = o[2 * I] * turn[k] - o[0] * turn[6 + k];
                out[6 + k] = o[0] * turn[3 + k] - o[I] * turn[k];
                out[9 + k] = v[I * k];
            }
        }
    }
    return 0;
",
        calls: &[FunctionKind::FramePose, FunctionKind::FrameJacobian],
    },
    External {
        name: "nominal",
        about: "the nominal parameters, SI, NAN where none is stated",
        inputs: &[],
        output: ("phi", Size::Parameters),
        each: 1,
        body: "    (void)arg;
    (void)w;
    copy(%p_nominal, P, res[0]);
    return 0;
",
        jacobian: "",
        calls: &[],
    },
];

/// The functions that a robot has: none where those of its C files take its geometry too.
fn externals(robot: &Robot) -> Vec<&'static External> {
    let has = |kind: &FunctionKind| robot.functions.iter().any(|f| f.kind == *kind);
    let exist = |external: &&External| {
        let is_close = external.name == "close";
        (!is_close || close::exists(robot)) && external.calls.iter().all(has)
    };
    let all = ALL.iter().filter(|_| robot.adjustable.is_empty());
    all.filter(exist).collect()
}

/// The names that the file gives to the linker.
pub(super) fn symbols(robot: &Robot, names: &Spelling) -> Vec<String> {
    let own = externals(robot).into_iter();
    own.map(|external| symbol(external, names)).collect()
}

fn symbol(external: &External, names: &Spelling) -> String {
    format!("{}_casadi_{}", names.prefix, external.name)
}

/// The contents of the file.
pub(super) fn text(robot: &Robot, names: &Spelling) -> String {
    let Spelling { prefix, .. } = names;
    let mut out = format!(
        "/* {}: functions for casadi.external, with exact Jacobians. Compile the robot's two files to a\n   \
         shared library, in which CasADi finds them by name:\n\n       \
         cc -O2 -march=native -fPIC -shared {prefix}.c {prefix}_casadi.c -lm -o {prefix}.so\n       \
         casadi.external(\"{prefix}_casadi_forward_dynamics\", \"./{prefix}.so\")\n\n   \
         Arguments are the independent coordinates, their velocities and accelerations, in rad or m and s, their\n   \
         efforts, N m or N, and the parameters phi, SI, in the order of {prefix}_parameters. The loops are closed\n   \
         within, on the straight line from {prefix}_home; where that fails, and at singular states, a function\n   \
         fails, and solvers take a shorter step.\n\n",
        comment(&robot.name)
    );
    for external in externals(robot) {
        let inputs: Vec<&str> = external.inputs.iter().map(|(name, _)| *name).collect();
        let _ = writeln!(
            out,
            "   {}({}): {}",
            symbol(external, names),
            inputs.join(", "),
            external.about
        );
    }
    out.pop();
    out.push_str(" */\n\n");
    let mut head = HEAD.replace(
        "CLOSED",
        if close::exists(robot) {
            "return %p_close(given(q_i), q) != 0;"
        } else {
            "for (int k = 0; k < I; k++) {\n        q[%p_independent[k]] = given(q_i)[k];\n    }\n    return 0;"
        },
    );
    if robot.frames.is_empty() {
        head = head.replace(", F = %M_FRAME_COUNT", "");
    }
    let most = robot.parameters.len().max(robot.independent.len());
    out.push_str(&spelled(&head, names).replace("MOST", &most.to_string()));
    for external in externals(robot) {
        write_external(external, robot, names, &mut out);
    }
    out.push_str("\n#ifdef __cplusplus\n}\n#endif\n");
    out
}

/// A function with what it tells of itself, and its Jacobian.
fn write_external(external: &External, robot: &Robot, names: &Spelling, out: &mut String) {
    let length = |size: Size| robot.length(size);
    let (output, size) = external.output;
    let rows = external.each * length(size);
    let dense = |name: &str, rows: usize, columns: usize| Argument {
        name: name.to_owned(),
        sparsity: format!("{{ {rows}, {columns}, 1, 0 }}"),
    };
    let inputs = external.inputs.iter();
    let mut inputs: Vec<Argument> = inputs.map(|(n, s)| dense(n, length(*s), 1)).collect();
    let name = symbol(external, names);
    let [n, i] = [robot.coordinates.len(), robot.independent.len()];
    let body = spelled(external.body, names);
    write_function(&name, &inputs, &[dense(output, rows, 1)], 3 * n, &body, out);
    if external.jacobian.is_empty() {
        return;
    }
    let blocks = external.inputs.iter();
    let blocks: Vec<Argument> = blocks
        .map(|(n, s)| dense(&format!("jac_{output}_{n}"), rows, length(*s)))
        .collect();
    // without entries: it is not needed
    inputs.push(Argument {
        name: format!("out_{output}"),
        sparsity: format!("{{ {rows}, 1, 0, 0 }}"),
    });
    let frames = 12 * length(Size::Frames);
    let work = 3 * n + 3 * i * i + i + i * length(Size::Parameters) + frames + frames * i;
    let body = spelled(external.jacobian, names);
    write_function(&format!("jac_{name}"), &inputs, &blocks, work, &body, out);
}

/// An argument or a result.
struct Argument {
    name: String,
    sparsity: String,
}

fn write_function(
    name: &str,
    inputs: &[Argument],
    outputs: &[Argument],
    work: usize,
    body: &str,
    out: &mut String,
) {
    let _ = write!(
        out,
        "\nEXPORT int {name}(const double **arg, double **res, INT *iw, double *w, int mem)\n{{\n    \
         (void)iw;\n    (void)mem;\n{body}}}\n\n"
    );
    for (kind, arguments) in [("in", inputs), ("out", outputs)] {
        let count = arguments.len();
        let _ = writeln!(
            out,
            "EXPORT INT {name}_n_{kind}(void) {{ return {count}; }}"
        );
        for (what, kind_of, list) in [
            (
                "name",
                ("const char *", "const char *const list[]"),
                arguments
                    .iter()
                    .map(|a| format!("\"{}\"", a.name))
                    .collect(),
            ),
            (
                "sparsity",
                ("const INT *", "const INT list[][4]"),
                arguments
                    .iter()
                    .map(|a| a.sparsity.clone())
                    .collect::<Vec<_>>(),
            ),
        ] {
            let (returned, list_type) = kind_of;
            let _ = write!(out, "EXPORT {returned}{name}_{what}_{kind}(INT i)\n{{\n");
            if list.is_empty() {
                out.push_str("    (void)i;\n    return 0;\n}\n");
                continue;
            }
            let list = list.join(", ");
            let _ = write!(
                out,
                "    static {list_type} = {{ {list} }};\n    \
                 return 0 <= i && i < {count} ? list[i] : 0;\n}}\n"
            );
        }
    }
    let _ = write!(
        out,
        "EXPORT int {name}_work(INT *sz_arg, INT *sz_res, INT *sz_iw, INT *sz_w)\n{{\n    \
         if (sz_arg) *sz_arg = {};\n    if (sz_res) *sz_res = {};\n    if (sz_iw) *sz_iw = 0;\n    \
         if (sz_w) *sz_w = {work};\n    return 0;\n}}\n",
        inputs.len(),
        outputs.len()
    );
}

/// Replaces the robot's names in a template: `@name` of a function, `%p` and `%M` of others.
fn spelled(template: &str, names: &Spelling) -> String {
    template
        .replace('@', &format!("{}_", names.prefix))
        .replace("%p", &names.prefix)
        .replace("%M", &names.macros)
}

const HEAD: &str = r#"#include "%p.h"

#define INT long long int /* casadi_int */
#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

#ifdef __cplusplus
extern "C" {
#endif

enum { N = %M_COORDINATE_COUNT, I = %M_INDEPENDENT_COUNT, P = %M_PARAMETER_COUNT, F = %M_FRAME_COUNT };

/* An argument; a null pointer stands for zeros. */
static const double *given(const double *argument)
{
    static const double zeros[MOST] = { 0.0 };
    return argument ? argument : zeros;
}

/* All coordinates of a state from the independent ones; 1 where it cannot be closed. */
static int closed(const double *q_i, double *q)
{
    for (int k = 0; k < N; k++) {
        q[k] = %p_home[k];
    }
    CLOSED
}

/* Also for NaN. */
static int is_singular(double condition)
{
    return !(condition >= %M_SINGULAR);
}

/* A result that nobody wants has a null pointer. */
static void copy(const double *from, int count, double *to)
{
    for (int k = 0; k < count && to; k++) {
        to[k] = from[k];
    }
}
"#;
