//! A derived robot: its names and its functions as straight-line programs. What
//! the stages after the derivation work on; it no longer knows expressions.

use crate::base::{Analysis, Base};
use crate::model::{self, Model, MotionKind};
use crate::optimize::{Operations, Program};
use crate::signature::Size;
use crate::spec::{Friction, Interval, Spec};

pub use crate::model::{Parameter, ParameterKind};
pub use crate::signature::FunctionKind;

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
        self.friction.name()
    }
}

/// A limit of the angle between two z axes.
#[derive(Clone, Debug, PartialEq)]
pub struct SwingLimitInfo {
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
    /// The parameters in order.
    pub parameters: Vec<Parameter>,
    /// Labels of the bodies in order.
    pub bodies: Vec<String>,
    /// Cuts in order.
    pub cuts: Vec<CutInfo>,
    /// What is stated about the joint of each coordinate.
    pub joints: Vec<JointInfo>,
    /// Cones in order: joints, then cuts.
    pub cones: Vec<SwingLimitInfo>,
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

    /// The labels of the parameters, in order.
    pub fn labels(&self) -> Vec<&str> {
        self.parameters.iter().map(|p| p.label.as_str()).collect()
    }

    /// How many there are of what a size counts.
    pub fn length(&self, size: Size) -> usize {
        let base = || self.analysis.iter().map(|analysis| &analysis.base);
        match size {
            Size::Coordinates => self.coordinates.len(),
            Size::Independent => self.independent.len(),
            Size::Dependent => self.dependent.len(),
            Size::Actuated => self.actuated.len(),
            Size::Rows => self.rows,
            Size::Parameters => self.parameters.len(),
            Size::Bodies => self.bodies.len(),
            Size::Cones => self.cones.len(),
            Size::Base => base().map(Base::rank).sum(),
            Size::Free => base().map(|base| base.null.len()).sum(),
            Size::Pose => 12,
        }
    }

    /// Operations of the full regressor.
    pub fn operations(&self) -> Operations {
        self.function(FunctionKind::Regressor)
            .map_or_else(Operations::default, |f| f.program.operations())
    }
}
