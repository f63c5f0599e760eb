//! The keys of the spec format, in the one list from which the reader, its errors and the JSON
//! Schema follow.

use super::shape::{
    BodyReference, Chosen, ConstantName, CoordinateReference, CouplingForm, Flag, Label, LabelKey,
    Located, Name, Ordered, ParameterForm, ParameterReference, ParameterSymbol, RobotName, Scalar,
    TermExpression, TermName, Text, choices, record,
};
use super::types::{Axis, CutKind, DriveKind, Friction, JointKind};

choices! { JointKind, "joint type" {
    "revolute" => Revolute: "one rotation about the axis",
    "prismatic" => Prismatic: "one translation along the axis",
    "helical" => Helical: "a screw: one rotation about the axis, with a translation along it by the pitch per turn",
    "cylindrical" => Cylindrical: "Rz(n.1) Tz(n.2)",
    "universal" => Universal: "Rx(n.1) Ry(n.2)",
    "spherical" => Spherical: "Rz(n.1) Ry(n.2) Rx(n.3)",
    "fixed" => Fixed: "no coordinate: what it carries is attached rigidly",
} }

choices! { CutKind, "cut joint" {
    "spherical" => Spherical: "3 equations",
    "universal" => Universal: "4 equations",
    "revolute" => Revolute: "5 equations, about the frames' z axes",
    "prismatic" => Prismatic: "5 equations, along the frames' z axes",
    "helical" => Helical: "5 equations, about and along the frames' z axes by the pitch per turn",
    "cylindrical" => Cylindrical: "4 equations, about and along the frames' z axes",
    "fixed" => Fixed: "6 equations",
} }

choices! { Axis, "axis" {
    "x" => X: "the frame's x axis",
    "y" => Y: "the frame's y axis",
    "z" => Z: "the frame's z axis",
} }

choices! { DriveKind, "drive type" {
    "revolute" => Revolute: "a turning motor: angle and torque",
    "prismatic" => Prismatic: "a sliding motor, or a tendon: length and force",
} }

record! {
    /// One mechanism: serial limbs from the world or from bodies, and the cuts that close loops. SI units, radians.
    struct RawSpec, "robot" {
        /// The robot's name, a Rust identifier: the generated module is called so
        required name: RobotName,
        /// One line about the robot
        optional description: Text,
        /// Gravity in the world frame, m/s^2
        default gravity: [Scalar; 3] = "[0, 0, -9.81]",
        /// Named constants in order: a number, or an expression in earlier names
        optional geometry: Ordered<ConstantName, Scalar>,
        /// Names of `geometry` that functions of generated sources take as arguments, such as those that are calibrated; the others are constants in them
        default adjustable: Vec<ConstantName> = "[]",
        /// Serial branches in order; the coordinates are numbered in this order
        required limbs: Vec<RawLimb>,
        /// Loop closures: joints opened to obtain the tree
        optional cuts: Vec<RawCut>,
        /// Springs and constant pulls between points of two bodies
        optional springs: Vec<RawSpring>,
        /// The independent coordinates; default: the actuated ones
        optional independent: Located<Vec<CoordinateReference>>,
        /// Coordinates tied linearly to others (parallelograms, belts, gears)
        optional couplings: Ordered<CoordinateReference, CouplingForm>,
        /// Motors whose coordinates are linear in those of joints (gears, tendons, differentials), by name
        optional drives: Ordered<Name, RawDrive>,
        /// Start of the loop-closure solve by coordinate, missing ones 0; picks the assembly branch
        optional home: Located<Ordered<CoordinateReference, Scalar>>,
        /// Nominal inertias by body label, for simulation and comparison
        optional bodies: Ordered<LabelKey, RawInertia>,
        /// Choices about the base parameters; they never change the parameters or the regressor
        optional base: RawBase,
        /// Frames on bodies, such as tools: the functions of controllers have their poses and Jacobians
        optional frames: Vec<RawFrame>,
        /// Whether generated sources have the functions of controllers and optimisers too: momentum, Coriolis matrix, forward dynamics, derivatives, frames
        default control: Flag = "false",
    }
}

record! {
    /// A serial branch
    struct RawLimb, "limb" {
        /// Unique name of the limb
        required name: Label,
        /// Where it starts: the world or a body's label
        default from: BodyReference = "world",
        /// Placement of the limb's frame 0 in the frame it starts from
        default base: RawPlacement = "{}",
        /// The joints, from the base outward
        required joints: Vec<RawJoint>,
    }
}

record! {
    /// A constant pose
    struct RawPlacement, "placement" {
        /// Translation, m
        default xyz: [Scalar; 3] = "[0, 0, 0]",
        /// Fixed-axis roll, pitch, yaw, rad: R = Rz(y) Ry(p) Rx(r)
        default rpy: [Scalar; 3] = "[0, 0, 0]",
    }
}

record! {
    /// A modified Denavit-Hartenberg row: Rx(alpha) Tx(a) Rz(theta) Tz(d)
    struct RawDh, "DH row" {
        /// Twist about x, rad
        default alpha: Scalar = "0",
        /// Length along x, m
        default a: Scalar = "0",
        /// Offset along z, m; the coordinate of a prismatic joint adds to it
        default d: Scalar = "0",
        /// Angle about z, rad; the coordinate of a revolute joint adds to it
        default theta: Scalar = "0",
    }
}

record! {
    /// A joint of a limb, and the body it carries
    struct RawJoint, "joint" {
        /// Unique name of the joint, which names its coordinate; only fixed joints may lack it
        optional name: Name,
        /// The joint's type
        required kind: Chosen<JointKind>,
        /// Modified Denavit-Hartenberg row; missing entries are 0
        optional dh: RawDh,
        /// Any placement of the joint's frame, instead of dh
        optional origin: RawPlacement,
        /// The axis of a revolute, prismatic or helical joint; z if missing
        optional axis: Chosen<Axis>,
        /// How far a helical joint slides per turn, m; negative for a left-handed screw
        optional pitch: Scalar,
        /// Label of the body carried, a whole number or an identifier; none: massless
        optional body: Label,
        /// Whether the body is a payload, carried in some runs only: its parameters are then base parameters apart from the robot's; at a fixed joint that ends its limb
        default payload: Flag = "false",
        /// Whether each of its coordinates is actuated
        default actuated: Flag = "false",
        /// Friction at each of its coordinates
        default friction: Chosen<Friction> = "none",
        /// Adds the parameter Fo: a constant effort of either sign, N m or N (amplifier, sensor, cable)
        default offset: Flag = "false",
        /// Adds the parameter J: rotor and drive, reflected to the joint
        default rotor_inertia: Flag = "false",
        /// Adds the parameter K: a spring at each of its coordinates, with the effort K (q - rest)
        optional spring: RawJointSpring,
        /// Adds a parameter for each name: an effort that is an expression in the joint's own q and qd (cables, cogging)
        optional terms: Ordered<TermName, TermExpression>,
        /// Limits of each coordinate
        optional limits: RawLimits,
        /// Nominal values by symbol (Fv, Fc, Fo, J, K, names of terms, ...), for simulation and comparison
        optional nominal: Ordered<ParameterSymbol, Scalar>,
    }
    exclusive { "dh" "origin" }
    unless { "name" "type" "fixed" }
}

record! {
    /// A spring at a joint
    struct RawJointSpring, "joint spring" {
        /// The coordinate at which the spring is relaxed, rad or m; if that is unknown, leave it 0 and add `offset: true`
        default rest: Scalar = "0",
    }
}

record! {
    /// A spring between points of two bodies: the parameter k, its stiffness, and without a length also kl, stiffness times length
    struct RawSpring, "spring" {
        /// Unique name of the spring
        required name: Label,
        /// The two points
        required between: [RawPoint; 2],
        /// The length of the relaxed spring, m
        optional length: Scalar,
        /// A constant pull instead, the parameter f (gas springs, springs on a cam)
        default constant: Flag = "false",
        /// Nominal values by symbol (k, kl, f), for simulation and comparison
        optional nominal: Ordered<ParameterSymbol, Scalar>,
    }
}

record! {
    /// A point of a body
    struct RawPoint, "point" {
        /// Label of the body, or world
        required body: BodyReference,
        /// The point in the body's frame, m
        default xyz: [Scalar; 3] = "[0, 0, 0]",
    }
}

record! {
    /// A motor whose coordinate is linear in joint coordinates: it is actuated, and has a row in logs instead of the joints
    struct RawDrive, "drive" {
        /// The motor's coordinate: a constant plus constant multiples of joint coordinates, such as 32*(q5 + q6)
        required of: Located<CouplingForm>,
        /// Whether the motor's coordinate is an angle or a length
        default kind: Chosen<DriveKind> = "revolute",
        /// Friction on the motor's side
        default friction: Chosen<Friction> = "none",
        /// Adds the parameter Fo: a constant effort of either sign of the motor, N m or N
        default offset: Flag = "false",
        /// Adds the parameter J: the rotor's inertia, not multiplied by the ratio
        default rotor_inertia: Flag = "false",
        /// Adds the parameter K: a spring at the motor, with the effort K (q - rest)
        optional spring: RawJointSpring,
        /// Adds a parameter for each name: an effort that is an expression in the motor's own q and qd (cogging)
        optional terms: Ordered<TermName, TermExpression>,
        /// Limits of the motor
        optional limits: RawLimits,
        /// Nominal friction, offset and rotor values by symbol (Fv, Fc, Fo, J, ...), for simulation and comparison
        optional nominal: Ordered<ParameterSymbol, Scalar>,
    }
}

record! {
    /// Limits of a joint's coordinates
    struct RawLimits, "set of limits" {
        /// Lowest and highest position, rad or m
        optional position: [Scalar; 2],
        /// Lowest and highest velocity, rad/s or m/s
        optional velocity: [Scalar; 2],
        /// Lowest and highest acceleration, rad/s^2 or m/s^2
        optional acceleration: [Scalar; 2],
        /// Lowest and highest jerk, rad/s^3 or m/s^3
        optional jerk: [Scalar; 2],
        /// Lowest and highest effort, N m or N
        optional effort: [Scalar; 2],
        /// Greatest angle between the z axes before and after a spherical or universal joint, rad
        optional cone: Scalar,
    }
}

record! {
    /// A loop closure: a joint opened to obtain the tree
    struct RawCut, "cut" {
        /// Unique name of the cut
        required name: Label,
        /// The joint that was opened
        required joint: Chosen<CutKind>,
        /// How far a helical cut slides per turn, m; negative for a left-handed screw
        optional pitch: Scalar,
        /// Frame A, then frame B
        required between: [RawSide; 2],
        /// Limits of the opened joint
        optional limits: RawCutLimits,
    }
}

record! {
    /// A frame on a body
    struct RawSide, "side" {
        /// Label of the body, or world
        required body: BodyReference,
        /// Translation in the body's frame, m
        default xyz: [Scalar; 3] = "[0, 0, 0]",
        /// Fixed-axis roll, pitch, yaw in the body's frame, rad
        default rpy: [Scalar; 3] = "[0, 0, 0]",
    }
}

record! {
    /// A named frame on a body
    struct RawFrame, "frame" {
        /// Unique name of the frame
        required name: Label,
        /// Label of the body, or world
        required body: BodyReference,
        /// Translation in the body's frame, m
        default xyz: [Scalar; 3] = "[0, 0, 0]",
        /// Fixed-axis roll, pitch, yaw in the body's frame, rad
        default rpy: [Scalar; 3] = "[0, 0, 0]",
    }
}

record! {
    /// Limits of a cut
    struct RawCutLimits, "set of cut limits" {
        /// Greatest angle between the frames' z axes, rad; spherical and universal cuts
        optional cone: Scalar,
    }
}

record! {
    /// Nominal inertia of a body
    struct RawInertia, "nominal inertia" {
        /// Mass, kg
        required mass: Scalar,
        /// Centre of mass in the body's frame, m
        default com: [Scalar; 3] = "[0, 0, 0]",
        /// Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre of mass in body axes, kg m^2; Ixy = -integral of x y dm
        default inertia: [Scalar; 6] = "[0, 0, 0, 0, 0, 0]",
    }
}

record! {
    /// Choices about the base parameters
    struct RawBase, "set of base choices" {
        /// Parameters eliminated first, in this order, where they can be
        default eliminate: Vec<ParameterReference> = "[]",
        /// Parameters or linear forms in them known to be zero: the columns are reduced by them first
        default zero: Vec<ParameterForm> = "[]",
        /// Groups of bodies known to be identical: their columns are added, under the first one's labels
        default equal: Vec<Vec<BodyReference>> = "[]",
        /// Base parameters left out, by the label of the column they are kept at
        default drop: Vec<ParameterReference> = "[]",
    }
}

impl RawPlacement {
    /// The placement's expressions in the geometry names.
    pub(super) fn constants(&self) -> impl Iterator<Item = &Scalar> {
        self.xyz.iter().chain(&self.rpy)
    }
}

impl RawJoint {
    /// The joint's expressions in the geometry names.
    pub(super) fn constants(&self) -> Vec<&Scalar> {
        let mut all = Vec::new();
        if let Some(dh) = &self.dh {
            all.extend([&dh.alpha, &dh.a, &dh.d, &dh.theta]);
        }
        all.extend(self.origin.iter().flat_map(RawPlacement::constants));
        all.extend(&self.pitch);
        all.extend(self.spring.iter().map(|spring| &spring.rest));
        if let Some(limits) = &self.limits {
            let intervals = [
                &limits.position,
                &limits.velocity,
                &limits.acceleration,
                &limits.jerk,
                &limits.effort,
            ];
            all.extend(intervals.into_iter().flatten().flatten());
            all.extend(&limits.cone);
        }
        let nominal = self.nominal.iter().flat_map(|nominal| &nominal.0);
        all.extend(nominal.map(|(_, scalar)| scalar));
        all
    }
}

impl RawCut {
    /// The cut's expressions in the geometry names.
    pub(super) fn constants(&self) -> Vec<&Scalar> {
        let sides = self.between.iter();
        let mut all: Vec<&Scalar> = sides
            .flat_map(|side| side.xyz.iter().chain(&side.rpy))
            .collect();
        all.extend(&self.pitch);
        all.extend(self.limits.iter().flat_map(|limits| &limits.cone));
        all
    }
}

impl RawSpring {
    /// The symbols of the spring's parameters, in order.
    pub(super) fn symbols(&self) -> &'static [&'static str] {
        match (self.constant.value, &self.length) {
            (true, _) => &["f"],
            (false, Some(_)) => &["k"],
            (false, None) => &["k", "kl"],
        }
    }

    /// The spring's expressions in the geometry names.
    pub(super) fn constants(&self) -> Vec<&Scalar> {
        let mut all: Vec<&Scalar> = self.between.iter().flat_map(|point| &point.xyz).collect();
        all.extend(&self.length);
        let nominal = self.nominal.iter().flat_map(|nominal| &nominal.0);
        all.extend(nominal.map(|(_, scalar)| scalar));
        all
    }
}
