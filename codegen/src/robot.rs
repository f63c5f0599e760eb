//! A derived robot: its names, and its functions as straight-line programs. The stages after the
//! derivation (emission, interpretation) read this type; it holds no expressions.

use crate::base::{Analysis, Base};
use crate::model::{self, Model};
use crate::optimize::{Operations, Program};
use crate::signature::Size;
use crate::spec::{Friction, Interval, Spec};

pub use crate::model::{MotionKind, Parameter, ParameterKind, SpringPart};
pub use crate::signature::FunctionKind;

/// A function of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Function {
    /// Which function of the table it is.
    pub kind: FunctionKind,
    /// The straight-line program that computes it.
    pub program: Program,
}

/// A cut joint and the number of its closure rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CutInfo {
    /// The name of the cut.
    pub name: String,
    /// How many rows of A (Eq. 7) the cut has.
    pub rows: usize,
}

/// What the spec states about the joint behind one coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct JointInfo {
    /// Whether the coordinate is a rotation (rad) or a translation (m).
    pub motion: MotionKind,
    /// The friction model.
    pub friction: Friction,
    /// Lower and upper limits of position, velocity, acceleration, jerk and effort, where given; rad
    /// or m and s, effort in N m or N.
    pub limits: [Option<[f64; 2]>; 5],
    /// Nominal values of the friction model's parameters, in the order of [`Friction::symbols`].
    pub nominal: [Option<f64>; 5],
    /// How far the coordinate moves if its joint turns by 1 rad, and if it slides by 1 m. For a drive,
    /// whose coordinate is linear in those of joints, these are sums of the sizes of its factors.
    pub travel: [f64; 2],
}

impl JointInfo {
    /// The name of the runtime's `Motion` variant, for generated code.
    pub fn motion_name(&self) -> &'static str {
        match self.motion {
            MotionKind::Rotation => "Rotation",
            MotionKind::Translation => "Translation",
        }
    }

    /// The name of the runtime's `Friction` variant, for generated code.
    pub fn friction_name(&self) -> &'static str {
        self.friction.name()
    }
}

/// A limit of the swing angle: the angle between the z axes of a joint's or cut's two frames.
#[derive(Clone, Debug, PartialEq)]
pub struct SwingLimitInfo {
    /// The name of the joint or the cut.
    pub name: String,
    /// The largest swing angle, rad.
    pub greatest: f64,
}

/// A derived robot: names, limits, nominal values and programs.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// The spec's name.
    pub name: String,
    /// The spec's description.
    pub description: Option<String>,
    /// Names of the coordinates; their order is the order of q.
    pub coordinates: Vec<String>,
    /// Indices of the independent coordinates, in the order of the regressor's rows.
    pub independent: Vec<usize>,
    /// Indices of the dependent coordinates, ascending.
    pub dependent: Vec<usize>,
    /// Indices of the actuated coordinates, ascending.
    pub actuated: Vec<usize>,
    /// The dynamic parameters, in the order of phi.
    pub parameters: Vec<Parameter>,
    /// Labels of the bodies, in order.
    pub bodies: Vec<String>,
    /// Names of the frames that the spec names, in order.
    pub frames: Vec<String>,
    /// The indices of the bodies that are payloads, whose base parameters are separate from the
    /// robot's.
    pub payloads: Vec<usize>,
    /// The cuts, in the order of the spec.
    pub cuts: Vec<CutInfo>,
    /// What the spec states about the joint of each coordinate.
    pub joints: Vec<JointInfo>,
    /// The swing limits: first those of joints, then those of cuts.
    pub cones: Vec<SwingLimitInfo>,
    /// Nominal values of the parameters in their order, where the spec gives them.
    pub nominal: Vec<Option<f64>>,
    /// Number of rows of A: first the rows of the cuts, then those of the couplings.
    pub rows: usize,
    /// Redundant closure rows, by index in the spec's order; all rows if there is no dependent
    /// coordinate.
    pub redundant_rows: Vec<usize>,
    /// Gravity in the world frame, m/s^2.
    pub gravity: [f64; 3],
    /// The home configuration with all loops closed, rad or m.
    pub home: Vec<f64>,
    /// The names of the geometry that all functions take as their last argument, with the values of the
    /// description, rad or m.
    pub adjustable: Vec<(String, f64)>,
    /// The derived functions.
    pub functions: Vec<Function>,
    /// The base parameters with their certificate, if they were derived.
    pub analysis: Option<Analysis>,
}

/// For each coordinate, what the spec states about its joint.
pub fn joints(spec: &Spec, model: &Model) -> Vec<JointInfo> {
    let interval = |stated: &Option<Interval>| {
        let stated = stated.as_ref()?;
        Some([stated[0].value.to_f64(), stated[1].value.to_f64()])
    };
    let joints = model::joints_of_coordinates(spec);
    let with_joints = model.coordinates.iter().zip(joints).enumerate();
    with_joints
        .map(|(index, (coordinate, joint))| JointInfo {
            motion: model.links[coordinate.link]
                .motion
                .as_ref()
                .map_or(MotionKind::Rotation, |m| m.kind),
            friction: joint.friction,
            limits: [
                interval(&joint.limits.position),
                interval(&joint.limits.velocity),
                interval(&joint.limits.acceleration),
                interval(&joint.limits.jerk),
                interval(&joint.limits.effort),
            ],
            nominal: std::array::from_fn(|k| {
                let symbol = joint.friction.symbols().get(k)?;
                Some(joint.nominal_value(symbol)?.value.to_f64())
            }),
            travel: [model.reach(index, 1.0, 0.0), model.reach(index, 0.0, 1.0)],
        })
        .collect()
}

impl Robot {
    /// The label of the payload that a parameter belongs to, by its column; `None` for the robot's
    /// own.
    pub fn payload_of(&self, column: usize) -> Option<&str> {
        let ParameterKind::Inertial { body, .. } = self.parameters.get(column)?.kind else {
            return None;
        };
        let label = self.bodies.get(body)?;
        self.payloads.contains(&body).then_some(label.as_str())
    }

    /// The function of this kind, if it was derived and the robot has it.
    pub fn function(&self, kind: FunctionKind) -> Option<&Function> {
        self.functions.iter().find(|f| f.kind == kind)
    }

    /// The labels of the parameters, in order.
    pub fn labels(&self) -> Vec<&str> {
        self.parameters.iter().map(|p| p.label.as_str()).collect()
    }

    /// The value of a symbolic size for this robot; sizes of the base parameters are 0 if these
    /// were not derived.
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
            Size::Frames => self.frames.len(),
            Size::FrameRates => 6 * self.frames.len(),
            Size::State => 2 * self.independent.len(),
            Size::StateEfforts => 3 * self.independent.len(),
        }
    }

    /// Number of operations of the full regressor's program; zero if it was not derived.
    pub fn operations(&self) -> Operations {
        self.function(FunctionKind::Regressor)
            .map_or_else(Operations::default, |f| f.program.operations())
    }
}
