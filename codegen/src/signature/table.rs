//! The rows of the function table, in the order in which functions are emitted.

use super::{Argument, Layout, Needs, Passing, Shape, Signature, Size};

const fn by_rows(rows: Size, columns: Size) -> Shape {
    Shape::Matrix {
        rows,
        columns,
        layout: Layout::RowMajor,
    }
}

const fn by_columns(rows: Size, columns: Size) -> Shape {
    Shape::Matrix {
        rows,
        columns,
        layout: Layout::ColumnMajor,
    }
}

macro_rules! functions {
    ($($case:ident { formula: $formula:literal, $($field:ident: $value:expr,)* })*) => {
        /// A function that a robot can have.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum FunctionKind {
            $(#[doc = $formula] $case,)*
        }

        impl FunctionKind {
            /// All functions, in the order in which they are emitted.
            pub const ALL: [FunctionKind; [$(stringify!($case)),*].len()] =
                [$(FunctionKind::$case),*];

            /// The table's row for this function.
            pub fn signature(self) -> &'static Signature {
                match self {
                    $(FunctionKind::$case => {
                        const ROW: Signature = Signature { formula: $formula, $($field: $value,)* };
                        &ROW
                    })*
                }
            }
        }
    };
}

impl FunctionKind {
    /// The function's name in code.
    pub fn name(self) -> &'static str {
        self.signature().name
    }
}

functions! {
    Constraints {
        formula: "The closure equations f(q) (Eq. 6): every row of every cut in the world frame, then the couplings.",
        name: "constraints",
        arguments: &[Argument::Q],
        output: "f",
        shape: Shape::Vector(Size::Rows),
        output_doc: "closure residual f, zero when closed (Eq. 6)",
        passing: Passing::Returned,
        has_condition: false,
        needs: Needs::Rows,
    }
    Jacobian {
        formula: "The Jacobian A = df/dq (Eq. 7).",
        name: "jacobian",
        arguments: &[Argument::Q],
        output: "a",
        shape: by_rows(Size::Rows, Size::Coordinates),
        output_doc: "A = df/dq, row by row (Eq. 7)",
        passing: Passing::Returned,
        has_condition: false,
        needs: Needs::Rows,
    }
    Bias {
        formula: "The bias b = -(dA/dt) qd of A qdd = b (Eq. 7).",
        name: "bias",
        arguments: &[Argument::Q, Argument::Qd],
        output: "b",
        shape: Shape::Vector(Size::Rows),
        output_doc: "b = -(dA/dt) qd, so that A qdd = b (Eq. 7)",
        passing: Passing::Returned,
        has_condition: false,
        needs: Needs::Rows,
    }
    NewtonStep {
        formula: "The Newton step of the dependent coordinates, A_e dq_e = -f.",
        name: "newton_step",
        arguments: &[Argument::Q],
        output: "dq_e",
        shape: Shape::Vector(Size::Dependent),
        output_doc: "step of the dependent coordinates in the order of `DEPENDENT`: A_e dq_e = -f",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Dependent,
    }
    DependentJacobian {
        formula: "The square A_e (Eq. 8).",
        name: "dependent_jacobian",
        arguments: &[Argument::Q],
        output: "a_e",
        shape: by_rows(Size::Dependent, Size::Dependent),
        output_doc: "the square A_e on the rows that are kept, each loop seen from one of its own frames (Eq. 8)",
        passing: Passing::Returned,
        has_condition: false,
        needs: Needs::Dependent,
    }
    Velocities {
        formula: "All velocities from the independent ones: A_e qd_e = -A_i qd_i (Eq. 8).",
        name: "velocities",
        arguments: &[Argument::Q, Argument::QdI],
        output: "qd",
        shape: Shape::Vector(Size::Coordinates),
        output_doc: "velocities of all coordinates",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
    }
    Accelerations {
        formula: "All accelerations from the independent ones: A_e qdd_e = b - A_i qdd_i (Eq. 8).",
        name: "accelerations",
        arguments: &[Argument::Q, Argument::Qd, Argument::QddI],
        output: "qdd",
        shape: Shape::Vector(Size::Coordinates),
        output_doc: "accelerations of all coordinates",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
    }
    Regressor {
        formula: "The regressor K_i - X^T K_e (Eq. 11) with friction and rotor columns (Eq. 20).",
        name: "regressor",
        arguments: &[Argument::Q, Argument::Qd, Argument::Qdd],
        output: "w",
        shape: by_columns(Size::Independent, Size::Parameters),
        output_doc: "column by column: `w[c][r]` multiplies `PARAMETERS[c]` in the equation of `INDEPENDENT[r]`",
        passing: Passing::Written,
        has_condition: true,
        needs: Needs::Nothing,
    }
    InverseDynamics {
        formula: "Inverse dynamics: the regressor times `phi`, without forming it.",
        name: "inverse_dynamics",
        arguments: &[Argument::Q, Argument::Qd, Argument::Qdd, Argument::Phi],
        output: "tau",
        shape: Shape::Vector(Size::Independent),
        output_doc: "(K_i - X^T K_e) phi, N m or N, in the order of `INDEPENDENT`",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
    }
    Gravity {
        formula: "The efforts of gravity.",
        name: "gravity",
        arguments: &[Argument::Q, Argument::Phi],
        output: "tau",
        shape: Shape::Vector(Size::Independent),
        output_doc: "the efforts that hold the mechanism at rest",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
    }
    BiasForces {
        formula: "Coriolis, centrifugal and friction efforts.",
        name: "bias_forces",
        arguments: &[Argument::Q, Argument::Qd, Argument::Phi],
        output: "tau",
        shape: Shape::Vector(Size::Independent),
        output_doc: "Coriolis, centrifugal and friction efforts: inverse dynamics at qdd_i = 0, less gravity",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
    }
    MassMatrix {
        formula: "The mass matrix over the independent coordinates.",
        name: "mass_matrix",
        arguments: &[Argument::Q, Argument::Phi],
        output: "m",
        shape: by_rows(Size::Independent, Size::Independent),
        output_doc: "M = J^T M_tree J, J = [1; -X]; rotors included",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
    }
    AdaptiveRegressor {
        formula: "The regressor Y(q, qd, qd_r, qdd_r) of passivity-based adaptive control (Slotine and Li, 1987).",
        name: "adaptive_regressor",
        arguments: &[Argument::Q, Argument::Qd, Argument::QdRI, Argument::QddRI],
        output: "y",
        shape: by_columns(Size::Independent, Size::Parameters),
        output_doc: "column by column: Y phi = M qdd_r + C(q, qd) qd_r + g, with dM/dt - 2 C skew",
        passing: Passing::Written,
        has_condition: true,
        needs: Needs::Nothing,
    }
    GeneralizedForces {
        formula: "The left side of Eq. 10 from the actuated efforts.",
        name: "generalized_forces",
        arguments: &[Argument::Q, Argument::TauActuated],
        output: "left",
        shape: Shape::Vector(Size::Independent),
        output_doc: "tau_i - X^T tau_e (Eq. 10): what W phi must equal",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
    }
    Poses {
        formula: "Where the bodies are.",
        name: "poses",
        arguments: &[Argument::Q],
        output: "poses",
        shape: by_rows(Size::Bodies, Size::Pose),
        output_doc: "per body in the order of `BODIES`: rotation to the world frame, row by row, then the origin in the world, m",
        passing: Passing::Returned,
        has_condition: false,
        needs: Needs::Nothing,
    }
    Cones {
        formula: "The cosines of the angles that cones limit.",
        name: "cones",
        arguments: &[Argument::Q],
        output: "cosines",
        shape: Shape::Vector(Size::Cones),
        output_doc: "per cone in the order of `INFO.cones`: the cosine of the angle between the two z axes",
        passing: Passing::Returned,
        has_condition: false,
        needs: Needs::Cones,
    }
    BaseRegressor {
        formula: "The reduced regressor W_red (Eq. 23): only the columns that are kept.",
        name: "base_regressor",
        arguments: &[Argument::Q, Argument::Qd, Argument::Qdd],
        output: "w",
        shape: by_columns(Size::Independent, Size::Base),
        output_doc: "W_red (Eq. 23), column by column: `w[c][r]` multiplies `BASE[c]` in the equation of `INDEPENDENT[r]`",
        passing: Passing::Written,
        has_condition: true,
        needs: Needs::Base,
    }
    ToBase {
        formula: "The base parameters of given parameters.",
        name: "to_base",
        arguments: &[Argument::Phi],
        output: "beta",
        shape: Shape::Vector(Size::Base),
        output_doc: "base parameters, in the order of `BASE`",
        passing: Passing::Returned,
        has_condition: false,
        needs: Needs::Base,
    }
    FromBase {
        formula: "Parameters with given base parameters; all of them, as `free` takes all values.",
        name: "parameters_from_base",
        arguments: &[Argument::Beta, Argument::Free],
        output: "phi",
        shape: Shape::Vector(Size::Parameters),
        output_doc: "dynamic parameters, in the order of `PARAMETERS`",
        passing: Passing::Returned,
        has_condition: false,
        needs: Needs::Base,
    }
    BaseInverseDynamics {
        formula: "Inverse dynamics from base parameters.",
        name: "base_inverse_dynamics",
        arguments: &[Argument::Q, Argument::Qd, Argument::Qdd, Argument::Beta],
        output: "tau",
        shape: Shape::Vector(Size::Independent),
        output_doc: "(K_i - X^T K_e) phi, N m or N, in the order of `INDEPENDENT`",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Base,
    }
    BaseGravity {
        formula: "The efforts of gravity from base parameters.",
        name: "base_gravity",
        arguments: &[Argument::Q, Argument::Beta],
        output: "tau",
        shape: Shape::Vector(Size::Independent),
        output_doc: "the efforts that hold the mechanism at rest",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Base,
    }
    BaseBiasForces {
        formula: "Coriolis, centrifugal and friction efforts from base parameters.",
        name: "base_bias_forces",
        arguments: &[Argument::Q, Argument::Qd, Argument::Beta],
        output: "tau",
        shape: Shape::Vector(Size::Independent),
        output_doc: "Coriolis, centrifugal and friction efforts: inverse dynamics at qdd_i = 0, less gravity",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Base,
    }
    BaseMassMatrix {
        formula: "The mass matrix from base parameters.",
        name: "base_mass_matrix",
        arguments: &[Argument::Q, Argument::Beta],
        output: "m",
        shape: by_rows(Size::Independent, Size::Independent),
        output_doc: "M = J^T M_tree J, J = [1; -X]; rotors included",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Base,
    }
}
