//! The rows of the function table, in the order in which functions are emitted.

use super::{Argument, Layout, Needs, Passing, Shape, Signature, Size, Trait};

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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::Model,
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
        of: Trait::BaseModel,
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
        of: Trait::BaseModel,
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
        of: Trait::BaseModel,
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
        of: Trait::BaseModel,
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
        of: Trait::BaseModel,
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
        of: Trait::BaseModel,
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
        of: Trait::BaseModel,
    }
    Momentum {
        formula: "The generalised momentum p = M(q) qd_i, the gradient of the kinetic energy by qd_i.",
        name: "momentum",
        arguments: &[Argument::Q, Argument::Qd, Argument::Phi],
        output: "p",
        shape: Shape::Vector(Size::Independent),
        output_doc: "p = M qd_i, kg m^2/s or kg m/s, in the order of `INDEPENDENT`; rotors included",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
        of: Trait::ControlModel,
    }
    MomentumRate {
        formula: "The part of dp/dt that needs no acceleration: dp/dt = tau + r, r = C^T qd_i less gravity, friction, offsets, springs and effort terms.",
        name: "momentum_rate",
        arguments: &[Argument::Q, Argument::Qd, Argument::Phi],
        output: "r",
        shape: Shape::Vector(Size::Independent),
        output_doc: "r = dp/dt - tau, N m or N, in the order of `INDEPENDENT`",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
        of: Trait::ControlModel,
    }
    MomentumRegressor {
        formula: "The regressor Y_p of the generalised momentum, p = Y_p phi.",
        name: "momentum_regressor",
        arguments: &[Argument::Q, Argument::Qd],
        output: "w",
        shape: by_columns(Size::Independent, Size::Parameters),
        output_doc: "column by column: `w[c][r]` multiplies `PARAMETERS[c]` in p of `INDEPENDENT[r]`",
        passing: Passing::Written,
        has_condition: true,
        needs: Needs::Nothing,
        of: Trait::ControlModel,
    }
    MomentumRateRegressor {
        formula: "The regressor Y_r of the momentum's rate: d/dt(Y_p phi) - Y_r phi = tau.",
        name: "momentum_rate_regressor",
        arguments: &[Argument::Q, Argument::Qd],
        output: "w",
        shape: by_columns(Size::Independent, Size::Parameters),
        output_doc: "column by column: `w[c][r]` multiplies `PARAMETERS[c]` in r of `INDEPENDENT[r]`",
        passing: Passing::Written,
        has_condition: true,
        needs: Needs::Nothing,
        of: Trait::ControlModel,
    }
    CoriolisMatrix {
        formula: "The matrix C(q, qd) of Christoffel symbols: C qd_i are the Coriolis and centrifugal efforts, and dM/dt - 2 C is skew-symmetric.",
        name: "coriolis_matrix",
        arguments: &[Argument::Q, Argument::Qd, Argument::Phi],
        output: "c",
        shape: by_rows(Size::Independent, Size::Independent),
        output_doc: "C(q, qd), row by row, in the order of `INDEPENDENT`",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
        of: Trait::ControlModel,
    }
    ForwardDynamics {
        formula: "Forward dynamics: the accelerations of the independent coordinates that efforts cause.",
        name: "forward_dynamics",
        arguments: &[Argument::Q, Argument::Qd, Argument::TauI, Argument::Phi],
        output: "qdd_i",
        shape: Shape::Vector(Size::Independent),
        output_doc: "qdd_i with M qdd_i + C qd_i + gravity, friction and others = tau_i, in the order of `INDEPENDENT`",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Nothing,
        of: Trait::ControlModel,
    }
    InverseDynamicsDerivatives {
        formula: "The derivatives of the inverse dynamics by the independent coordinates and velocities, along the closure.",
        name: "inverse_dynamics_derivatives",
        arguments: &[Argument::Q, Argument::Qd, Argument::Qdd, Argument::Phi],
        output: "slopes",
        shape: by_columns(Size::Independent, Size::State),
        output_doc: "column by column: the derivatives of tau_i by q_i, then those by qd_i, each in the order of `INDEPENDENT`",
        passing: Passing::Written,
        has_condition: true,
        needs: Needs::Nothing,
        of: Trait::ControlModel,
    }
    ForwardDynamicsDerivatives {
        formula: "The derivatives of the forward dynamics by the independent coordinates, velocities and efforts, along the closure.",
        name: "forward_dynamics_derivatives",
        arguments: &[Argument::Q, Argument::Qd, Argument::TauI, Argument::Phi],
        output: "slopes",
        shape: by_columns(Size::Independent, Size::StateEfforts),
        output_doc: "column by column: the derivatives of qdd_i by q_i, by qd_i and by tau_i, each in the order of `INDEPENDENT`",
        passing: Passing::Written,
        has_condition: true,
        needs: Needs::Nothing,
        of: Trait::ControlModel,
    }
    FramePose {
        formula: "Where the named frames are.",
        name: "frame_pose",
        arguments: &[Argument::Q],
        output: "poses",
        shape: by_rows(Size::Frames, Size::Pose),
        output_doc: "per frame in the order of `FRAMES`: rotation to the world frame, row by row, then the origin in the world, m",
        passing: Passing::Returned,
        has_condition: false,
        needs: Needs::Frames,
        of: Trait::ControlModel,
    }
    FrameJacobian {
        formula: "The Jacobians of the named frames by the independent velocities, along the closure.",
        name: "frame_jacobian",
        arguments: &[Argument::Q],
        output: "jacobian",
        shape: by_rows(Size::FrameRates, Size::Independent),
        output_doc: "row by row: per frame in the order of `FRAMES` the velocity of its origin, m/s, then its angular velocity, rad/s, both in the axes of the world, per unit of each of `INDEPENDENT`",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Frames,
        of: Trait::ControlModel,
    }
    FrameJacobianRate {
        formula: "The product of the rate of the frames' Jacobians and the independent velocities.",
        name: "frame_jacobian_rate",
        arguments: &[Argument::Q, Argument::Qd],
        output: "bias",
        shape: Shape::Vector(Size::FrameRates),
        output_doc: "dJ/dt qd_i: the accelerations of the frames at qdd_i = 0, in the order of the rows of `frame_jacobian`, m/s^2 and rad/s^2",
        passing: Passing::Returned,
        has_condition: true,
        needs: Needs::Frames,
        of: Trait::ControlModel,
    }
}
