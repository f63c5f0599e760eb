//! C99: a header with constants and documentation, and a file with the functions in double and in
//! single precision.
//!
//! Each function exists twice, `robot_regressor` on `double` and `robot_regressor_f` on `float`,
//! instead of once on a type that a macro chooses: the compiler then sees when numbers of one type
//! are given to a function of the other, object files that were compiled with different macros
//! cannot be linked into each other, and a program may use both. `ROBOT_NO_DOUBLE` and
//! `ROBOT_NO_FLOAT` leave one set out.
//!
//! Matrices are flat arrays, as Eigen, LAPACK, ROS and Simulink pass them.

mod angles;
mod casadi;
mod close;
mod constants;
mod functions;
mod header;
mod names;
mod statements;
mod support;
mod words;

use crate::robot::Robot;

/// Smallest ratio of a pivot to its usual size at which the fixed order of pivots is used, as in
/// the interpreter and the runtime.
const PIVOT_BOUND: f64 = 1e-3;
/// The condition below which a state is singular, and nearly singular, as in the runtime.
const SINGULAR: f64 = 1e-10;
const NEAR_SINGULAR: f64 = 1e-4;

/// The texts of a robot's two files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    /// The name of both files without extension, which names of functions begin with.
    pub name: String,
    /// The contents of the header, `NAME.h`.
    pub header: String,
    /// The contents of the source, `NAME.c`, which includes the header.
    pub source: String,
}

/// The C files of a robot, with its functions in double and in single precision.
///
/// ```
/// use regen_codegen::Mechanism;
/// use regen_codegen::diag::Source;
/// use regen_codegen::emit::c;
/// use regen_codegen::robot::FunctionKind;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
/// let files = c::files(&mechanism.robot(&[FunctionKind::Poses])?);
/// assert_eq!(files.name, "arm");
/// assert!(files.header.contains("void arm_poses(const double *ARM_RESTRICT q"));
/// assert!(files.source.contains("#include \"arm.h\""));
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn files(robot: &Robot) -> Files {
    let names = words::Spelling::of(robot);
    let functions = functions::Functions::of(robot, &names);
    Files {
        header: header::text(robot, &names, &functions),
        source: functions.text(robot, &names),
        name: names.prefix,
    }
}

/// The text of a further file, `NAME_casadi.c`: functions of the independent coordinates for
/// `casadi.external`, with exact Jacobians, around the robot's functions in double precision.
///
/// ```
/// use regen_codegen::Mechanism;
/// use regen_codegen::diag::Source;
/// use regen_codegen::emit::c;
/// use regen_codegen::robot::FunctionKind;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
/// let text = c::casadi(&mechanism.robot(&FunctionKind::ALL)?);
/// assert!(text.contains("int arm_casadi_forward_dynamics("));
/// assert!(text.contains("int jac_arm_casadi_forward_dynamics("));
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn casadi(robot: &Robot) -> String {
    casadi::text(robot, &words::Spelling::of(robot))
}

/// The names that [`casadi()`] gives to the linker, as [`symbols`].
pub fn casadi_symbols(robot: &Robot) -> Vec<String> {
    casadi::symbols(robot, &words::Spelling::of(robot))
}

/// What the names of a robot's files, functions and constants begin with, by the robot's name; in
/// capitals, those of its macros.
///
/// ```
/// assert_eq!(regen_codegen::emit::c::prefix("UR5e"), "ur5e");
/// ```
pub fn prefix(robot: &str) -> String {
    names::prefix(robot)
}

/// Whether a robot's header would have the name of one of the C library's, which includes would no
/// longer find.
///
/// ```
/// use regen_codegen::emit::c::hides_a_header;
/// assert!(hides_a_header("math"));
/// assert!(!hides_a_header("double"));
/// ```
pub fn hides_a_header(robot: &str) -> bool {
    names::hides_header(&names::prefix(robot))
}

/// The names that a robot's C files give to the linker. Two robots of one program must have none in
/// common, as `arm` with its function `base_gravity` and another robot `arm_base` with `gravity`
/// would.
pub fn symbols(robot: &Robot) -> Vec<String> {
    let names = words::Spelling::of(robot);
    functions::symbols(robot, &names)
        .chain(close::symbols(robot, &names))
        .chain(constants::symbols(robot, &names))
        .collect()
}
