//! A derived robot: its names and its functions as straight-line programs. What
//! the stages after the derivation work on; it no longer knows expressions.

use crate::base::Analysis;
use crate::model::{self, Model, MotionKind};
use crate::optimize::{Operations, Program};
use crate::spec::{Friction, Interval, Spec};

/// What a function computes. `n` coordinates, `n_i` of them independent, `n_e`
/// dependent, `p` parameters, `m` closure rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum FunctionKind {
    /// f(q), m (Eq. 6).
    Constraints,
    /// A(q), m x n (Eq. 7).
    Jacobian,
    /// b(q, qd), m (Eq. 7).
    Bias,
    /// The step of the dependent coordinates, `A_e dq_e = -f`.
    NewtonStep,
    /// The square A_e on the rows kept, n_e x n_e (Eq. 8).
    DependentJacobian,
    /// qd from qd_i.
    Velocities,
    /// qdd from qd and qdd_i.
    Accelerations,
    /// K_i - X^T K_e with friction and rotor columns (Eq. 11, 20).
    Regressor,
    /// tau from q, qd, qdd and parameters.
    InverseDynamics,
    /// The part of tau from gravity.
    Gravity,
    /// The part of tau from velocities, friction included.
    BiasForces,
    /// M over the independent coordinates.
    MassMatrix,
    /// Y(q, qd, qd_r, qdd_r) (Slotine and Li, 1987).
    SlotineLi,
    /// tau_i - X^T tau_e from the actuated efforts (Eq. 10).
    Efforts,
    /// Rotation and position of every body.
    Poses,
    /// Cosines of the angles that cones limit.
    Cones,
    /// W at the kept columns (Eq. 23).
    BaseRegressor,
    /// Base parameters from parameters.
    ToBase,
    /// All parameters with given base parameters.
    FromBase,
    /// tau from q, qd, qdd and base parameters.
    BaseInverseDynamics,
    /// Gravity from base parameters.
    BaseGravity,
    /// The part from velocities, from base parameters.
    BaseBiasForces,
    /// M from base parameters.
    BaseMassMatrix,
}

impl FunctionKind {
    /// All of them, in the order in which they are emitted.
    pub const ALL: [FunctionKind; 23] = [
        FunctionKind::Constraints,
        FunctionKind::Jacobian,
        FunctionKind::Bias,
        FunctionKind::NewtonStep,
        FunctionKind::DependentJacobian,
        FunctionKind::Velocities,
        FunctionKind::Accelerations,
        FunctionKind::Regressor,
        FunctionKind::InverseDynamics,
        FunctionKind::Gravity,
        FunctionKind::BiasForces,
        FunctionKind::MassMatrix,
        FunctionKind::SlotineLi,
        FunctionKind::Efforts,
        FunctionKind::Poses,
        FunctionKind::Cones,
        FunctionKind::BaseRegressor,
        FunctionKind::ToBase,
        FunctionKind::FromBase,
        FunctionKind::BaseInverseDynamics,
        FunctionKind::BaseGravity,
        FunctionKind::BaseBiasForces,
        FunctionKind::BaseMassMatrix,
    ];

    /// Its name in code.
    pub fn name(self) -> &'static str {
        match self {
            FunctionKind::Constraints => "constraints",
            FunctionKind::Jacobian => "jacobian",
            FunctionKind::Bias => "bias",
            FunctionKind::NewtonStep => "newton_step",
            FunctionKind::DependentJacobian => "dependent_jacobian",
            FunctionKind::Velocities => "velocities",
            FunctionKind::Accelerations => "accelerations",
            FunctionKind::Regressor => "regressor",
            FunctionKind::InverseDynamics => "inverse_dynamics",
            FunctionKind::Gravity => "gravity",
            FunctionKind::BiasForces => "bias_forces",
            FunctionKind::MassMatrix => "mass_matrix",
            FunctionKind::SlotineLi => "slotine_li",
            FunctionKind::Efforts => "efforts",
            FunctionKind::Poses => "poses",
            FunctionKind::Cones => "cones",
            FunctionKind::BaseRegressor => "base_regressor",
            FunctionKind::ToBase => "to_base",
            FunctionKind::FromBase => "parameters_from_base",
            FunctionKind::BaseInverseDynamics => "base_inverse_dynamics",
            FunctionKind::BaseGravity => "base_gravity",
            FunctionKind::BaseBiasForces => "base_bias_forces",
            FunctionKind::BaseMassMatrix => "base_mass_matrix",
        }
    }

    /// Whether only robots with base parameters have it.
    pub fn needs_base(self) -> bool {
        matches!(
            self,
            FunctionKind::BaseRegressor
                | FunctionKind::ToBase
                | FunctionKind::FromBase
                | FunctionKind::BaseInverseDynamics
                | FunctionKind::BaseGravity
                | FunctionKind::BaseBiasForces
                | FunctionKind::BaseMassMatrix
        )
    }

    /// Whether only mechanisms with cuts or couplings have it.
    pub fn needs_rows(self) -> bool {
        matches!(
            self,
            FunctionKind::Constraints | FunctionKind::Jacobian | FunctionKind::Bias
        )
    }

    /// Whether only mechanisms with dependent coordinates have it.
    pub fn needs_solve(self) -> bool {
        matches!(
            self,
            FunctionKind::NewtonStep | FunctionKind::DependentJacobian
        )
    }
}

/// A function of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Function {
    /// What it computes.
    pub kind: FunctionKind,
    /// How.
    pub program: Program,
}

/// A cut and its rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CutInfo {
    /// Its name.
    pub name: String,
    /// How many rows of A it has.
    pub rows: usize,
}

/// What the spec states about the joint of one coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct JointInfo {
    /// Turn or shift.
    pub motion: MotionKind,
    /// Its friction model.
    pub friction: Friction,
    /// Limits of position, velocity, acceleration and effort, where given.
    pub limits: [Option<[f64; 2]>; 4],
    /// Nominal values of the friction model's symbols, in their order.
    pub nominal: [Option<f64>; 5],
}

impl JointInfo {
    /// The motion's name in code.
    pub fn motion_name(&self) -> &'static str {
        match self.motion {
            MotionKind::Rotation => "Turn",
            MotionKind::Translation => "Shift",
        }
    }

    /// The friction model's name in code.
    pub fn friction_name(&self) -> &'static str {
        match self.friction {
            Friction::None => "None",
            Friction::Viscous => "Viscous",
            Friction::Coulomb => "Coulomb",
            Friction::Linear => "Linear",
            Friction::CoulombAsymmetric => "CoulombAsymmetric",
            Friction::Asymmetric => "Asymmetric",
            Friction::Stribeck => "Stribeck",
            Friction::Atan => "Atan",
            Friction::Power => "Power",
        }
    }
}

/// A limit of the angle between two z axes.
#[derive(Clone, Debug, PartialEq)]
pub struct ConeInfo {
    /// The joint or the cut.
    pub name: String,
    /// The greatest angle, rad.
    pub greatest: f64,
}

/// A derived robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// The spec's name.
    pub name: String,
    /// The spec's description.
    pub description: Option<String>,
    /// Coordinates in order.
    pub coordinates: Vec<String>,
    /// Indices of the independent ones, in the order of the regressor's rows.
    pub independent: Vec<usize>,
    /// Indices of the others, ascending.
    pub dependent: Vec<usize>,
    /// Indices of the actuated ones, ascending.
    pub actuated: Vec<usize>,
    /// Labels of the parameters in order.
    pub parameters: Vec<String>,
    /// Labels of the bodies in order.
    pub bodies: Vec<String>,
    /// Cuts in order.
    pub cuts: Vec<CutInfo>,
    /// What is stated about the joint of each coordinate.
    pub joints: Vec<JointInfo>,
    /// Cones in order: joints, then cuts.
    pub cones: Vec<ConeInfo>,
    /// Nominal values of the parameters, in their order.
    pub nominal: Vec<Option<f64>>,
    /// Rows of A: cuts, then couplings.
    pub rows: usize,
    /// Rows found redundant, by index in the spec's order.
    pub redundant_rows: Vec<usize>,
    /// Gravity in the world frame, m/s^2.
    pub gravity: [f64; 3],
    /// The closed home configuration.
    pub home: Vec<f64>,
    /// Its functions.
    pub functions: Vec<Function>,
    /// Its base parameters, where they were asked for.
    pub analysis: Option<Analysis>,
}

/// The joint of each coordinate, as the spec states it.
pub fn joints(spec: &Spec, model: &Model) -> Vec<JointInfo> {
    let interval = |stated: &Option<Interval>| {
        let stated = stated.as_ref()?;
        Some([stated[0].value.to_f64(), stated[1].value.to_f64()])
    };
    let joints = model::joints_of_coordinates(spec);
    let with_joints = model.coordinates.iter().zip(joints);
    with_joints
        .map(|(coordinate, joint)| JointInfo {
            motion: model.links[coordinate.link]
                .motion
                .as_ref()
                .map_or(MotionKind::Rotation, |m| m.kind),
            friction: joint.friction,
            limits: [
                interval(&joint.limits.position),
                interval(&joint.limits.velocity),
                interval(&joint.limits.acceleration),
                interval(&joint.limits.effort),
            ],
            nominal: std::array::from_fn(|k| {
                let symbol = joint.friction.symbols().get(k)?;
                Some(joint.nominal_value(symbol)?.value.to_f64())
            }),
        })
        .collect()
}

impl Robot {
    /// A function, if the robot has it.
    pub fn function(&self, kind: FunctionKind) -> Option<&Function> {
        self.functions.iter().find(|f| f.kind == kind)
    }

    /// Operations of the full regressor.
    pub fn operations(&self) -> Operations {
        self.function(FunctionKind::Regressor)
            .map_or_else(Operations::default, |f| f.program.operations())
    }
}
