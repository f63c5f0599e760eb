//! The table of the traits' functions, one row each.

use super::{Argument, Layout, Shape, Signature, Size};

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
    (
        $(#[$about:meta])*
        $enum:ident of $trait:ident {
            $($case:ident = $name:ident($($argument:ident),*) -> $shape:expr, $condition:expr;)*
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum $enum {
            $(
                #[doc = concat!("[`", stringify!($trait), "::", stringify!($name), "`](crate::",
                    stringify!($trait), "::", stringify!($name), ").")]
                $case,
            )*
        }

        impl $enum {
            /// All functions.
            pub const ALL: [$enum; [$(stringify!($case)),*].len()] = [$($enum::$case),*];

            /// The name, the arguments and the output of the function.
            pub fn signature(self) -> &'static Signature {
                match self {
                    $($enum::$case => {
                        const SIGNATURE: Signature = Signature {
                            name: stringify!($name),
                            arguments: &[$(Argument::$argument),*],
                            shape: $shape,
                            has_condition: $condition,
                        };
                        &SIGNATURE
                    })*
                }
            }
        }
    };
}

/// Value of [`Signature::has_condition`]: the method returns a condition.
const CONDITION: bool = true;
/// Value of [`Signature::has_condition`]: the method returns no condition.
const NO_CONDITION: bool = false;

functions! {
    /// A function of every [`Model`](crate::Model).
    Function of Model {
        Constraints = constraints(Q) -> Shape::Vector(Size::Rows), NO_CONDITION;
        Jacobian = jacobian(Q) -> by_rows(Size::Rows, Size::Coordinates), NO_CONDITION;
        Bias = bias(Q, Qd) -> Shape::Vector(Size::Rows), NO_CONDITION;
        NewtonStep = newton_step(Q) -> Shape::Vector(Size::Dependent), CONDITION;
        DependentJacobian = dependent_jacobian(Q)
            -> by_rows(Size::Dependent, Size::Dependent), NO_CONDITION;
        Velocities = velocities(Q, QdI) -> Shape::Vector(Size::Coordinates), CONDITION;
        Accelerations = accelerations(Q, Qd, QddI)
            -> Shape::Vector(Size::Coordinates), CONDITION;
        Regressor = regressor(Q, Qd, Qdd)
            -> by_columns(Size::Independent, Size::Parameters), CONDITION;
        InverseDynamics = inverse_dynamics(Q, Qd, Qdd, Phi)
            -> Shape::Vector(Size::Independent), CONDITION;
        Gravity = gravity(Q, Phi) -> Shape::Vector(Size::Independent), CONDITION;
        BiasForces = bias_forces(Q, Qd, Phi) -> Shape::Vector(Size::Independent), CONDITION;
        MassMatrix = mass_matrix(Q, Phi)
            -> by_rows(Size::Independent, Size::Independent), CONDITION;
        AdaptiveRegressor = adaptive_regressor(Q, Qd, QdRI, QddRI)
            -> by_columns(Size::Independent, Size::Parameters), CONDITION;
        GeneralizedForces = generalized_forces(Q, TauActuated) -> Shape::Vector(Size::Independent), CONDITION;
        Poses = poses(Q) -> by_rows(Size::Bodies, Size::Pose), NO_CONDITION;
        Cones = cones(Q) -> Shape::Vector(Size::Cones), NO_CONDITION;
    }
}

functions! {
    /// A function of every [`BaseModel`](crate::BaseModel).
    BaseFunction of BaseModel {
        BaseRegressor = base_regressor(Q, Qd, Qdd)
            -> by_columns(Size::Independent, Size::Base), CONDITION;
        ToBase = to_base(Phi) -> Shape::Vector(Size::Base), NO_CONDITION;
        FromBase = parameters_from_base(Beta, Free)
            -> Shape::Vector(Size::Parameters), NO_CONDITION;
        BaseInverseDynamics = base_inverse_dynamics(Q, Qd, Qdd, Beta)
            -> Shape::Vector(Size::Independent), CONDITION;
        BaseGravity = base_gravity(Q, Beta) -> Shape::Vector(Size::Independent), CONDITION;
        BaseBiasForces = base_bias_forces(Q, Qd, Beta)
            -> Shape::Vector(Size::Independent), CONDITION;
        BaseMassMatrix = base_mass_matrix(Q, Beta)
            -> by_rows(Size::Independent, Size::Independent), CONDITION;
    }
}

functions! {
    /// A function of every [`ControlModel`](crate::ControlModel).
    ControlFunction of ControlModel {
        Momentum = momentum(Q, Qd, Phi) -> Shape::Vector(Size::Independent), CONDITION;
        MomentumRate = momentum_rate(Q, Qd, Phi) -> Shape::Vector(Size::Independent), CONDITION;
        MomentumRegressor = momentum_regressor(Q, Qd)
            -> by_columns(Size::Independent, Size::Parameters), CONDITION;
        MomentumRateRegressor = momentum_rate_regressor(Q, Qd)
            -> by_columns(Size::Independent, Size::Parameters), CONDITION;
        CoriolisMatrix = coriolis_matrix(Q, Qd, Phi)
            -> by_rows(Size::Independent, Size::Independent), CONDITION;
        ForwardDynamics = forward_dynamics(Q, Qd, TauI, Phi)
            -> Shape::Vector(Size::Independent), CONDITION;
        InverseDynamicsDerivatives = inverse_dynamics_derivatives(Q, Qd, Qdd, Phi)
            -> by_columns(Size::Independent, Size::State), CONDITION;
        ForwardDynamicsDerivatives = forward_dynamics_derivatives(Q, Qd, TauI, Phi)
            -> by_columns(Size::Independent, Size::StateEfforts), CONDITION;
        FramePose = frame_pose(Q) -> by_rows(Size::Frames, Size::Pose), NO_CONDITION;
        FrameJacobian = frame_jacobian(Q)
            -> by_rows(Size::FrameRates, Size::Independent), CONDITION;
        FrameJacobianRate = frame_jacobian_rate(Q, Qd) -> Shape::Vector(Size::FrameRates), CONDITION;
    }
}
