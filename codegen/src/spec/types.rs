//! The validated spec: every name resolves, every expression is finite, every label is unique. The
//! types describe the file only; dynamics are derived elsewhere. Quantities are in SI units and
//! radians.

use crate::diag::Span;
use crate::sym::Number;

pub use super::friction::Friction;
pub use super::springs::{EffortExpr, JointSpring, PointSpring, SpringEnd, SpringForce};

/// A value and its place in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// The place in the file.
    pub span: Span,
}

/// A scalar of the spec: its expression as written and its exact value.
#[derive(Clone, Debug)]
pub struct Quantity {
    /// The expression as written, with the names of `geometry`.
    pub expr: Expr,
    /// The value of the expression at the values in `geometry`.
    pub value: Number,
    /// The place in the file.
    pub span: Span,
}

/// A function that expressions may call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Function {
    /// Square root.
    Sqrt,
    /// Sine of radians.
    Sin,
    /// Cosine of radians.
    Cos,
    /// Tangent of radians.
    Tan,
    /// Degrees to radians.
    Deg,
    /// The sign, -1, 0 or 1; in effort terms only.
    Sign,
    /// The absolute value; in effort terms only.
    Abs,
}

/// An arithmetic expression over numbers, `pi` and geometry names.
#[derive(Clone, Debug, PartialEq)]
pub enum Expr {
    /// A number, exact as in the source text.
    Number(Number),
    /// The constant pi.
    Pi,
    /// A geometry name.
    Name(String),
    /// Negation.
    Neg(Box<Expr>),
    /// Sum.
    Add(Box<Expr>, Box<Expr>),
    /// Difference.
    Sub(Box<Expr>, Box<Expr>),
    /// Product.
    Mul(Box<Expr>, Box<Expr>),
    /// Quotient.
    Div(Box<Expr>, Box<Expr>),
    /// Power.
    Pow(Box<Expr>, Box<Expr>),
    /// A function of one argument.
    Call(Function, Box<Expr>),
}

/// A constant plus a linear combination of coordinates (in `couplings`) or of dynamic parameters
/// (in `base: zero`).
#[derive(Clone, Debug)]
pub struct LinearForm {
    /// The constant part.
    pub constant: Quantity,
    /// The names of the coordinates or parameters with their coefficients, in the order written.
    pub terms: Vec<(Spanned<String>, Quantity)>,
    /// The place of the whole form in the file.
    pub span: Span,
}

/// The whole spec.
#[derive(Clone, Debug)]
pub struct Spec {
    /// The generated module's name, a Rust identifier.
    pub name: Spanned<String>,
    /// One line about the robot.
    pub description: Option<String>,
    /// Gravity in the world frame, m/s^2.
    pub gravity: [Quantity; 3],
    /// Named constants in the order written; an expression uses earlier names only.
    pub geometry: Vec<(Spanned<String>, Quantity)>,
    /// The names of `geometry` that are arguments of functions in generated sources.
    pub adjustable: Vec<Spanned<String>>,
    /// Serial branches in order, then one for each drive: a massless joint from the world.
    pub limbs: Vec<Limb>,
    /// Joints opened to obtain the tree.
    pub cuts: Vec<Cut>,
    /// Springs and constant pulls between points of two bodies.
    pub springs: Vec<PointSpring>,
    /// The names of the independent coordinates; `None`: the actuated ones.
    pub independent: Option<Spanned<Vec<Spanned<String>>>>,
    /// Coordinates that are a linear form in others (parallelograms, belts, gears), each with its
    /// form: those under `couplings`, then the drives.
    pub couplings: Vec<(Spanned<String>, LinearForm)>,
    /// The names of the drives, which are their coordinates'.
    pub drives: Vec<Spanned<String>>,
    /// Values of the coordinates at which the solve of the loop closure starts, rad or m; missing
    /// ones are 0. They select the assembly branch.
    pub home: Vec<(Spanned<String>, Quantity)>,
    /// The place of `home` in the file; `None` without `home`.
    pub home_span: Option<Span>,
    /// Nominal inertial parameters by body label.
    pub bodies: Vec<(Spanned<String>, BodyInertia)>,
    /// Choices about the base parameters.
    pub base: BaseChoices,
    /// Named frames on bodies, in the order written.
    pub frames: Vec<NamedFrame>,
    /// Whether generated sources have the functions of controllers and optimisers.
    pub control: bool,
}

impl Spec {
    /// The adjustable names of the geometry with their values.
    pub fn adjusted(&self) -> impl Iterator<Item = (&str, f64)> {
        let values = |name: &str| {
            let mut all = self.geometry.iter();
            all.find(|(own, _)| own.value == name)
        };
        let names = self.adjustable.iter();
        names.filter_map(move |name| {
            let (_, quantity) = values(&name.value)?;
            Some((name.value.as_str(), quantity.value.to_f64()))
        })
    }

    /// Every quantity of the mechanism and its home: gravity, placements, leads, springs, effort
    /// terms, couplings and home coordinates. Not the geometry's values, limits, nominal values and `base`.
    pub fn quantities_mut(&mut self) -> Vec<&mut Quantity> {
        let mut all: Vec<&mut Quantity> = self.gravity.iter_mut().collect();
        for limb in &mut self.limbs {
            all.extend(limb.base.quantities_mut());
            for joint in &mut limb.joints {
                match &mut joint.frame {
                    JointFrame::Dh { alpha, a, d, theta } => all.extend([alpha, a, d, theta]),
                    JointFrame::Origin(origin) => all.extend(origin.quantities_mut()),
                }
                all.extend(&mut joint.lead);
                all.extend(joint.spring.as_mut().map(|spring| &mut spring.rest));
                let terms = joint.terms.iter_mut();
                all.extend(terms.flat_map(|(_, factor)| factor.constants_mut()));
            }
        }
        for cut in &mut self.cuts {
            let sides = cut.sides.iter_mut();
            all.extend(sides.flat_map(|side| side.placement.quantities_mut()));
            all.extend(&mut cut.lead);
        }
        for spring in &mut self.springs {
            all.extend(spring.ends.iter_mut().flat_map(|end| &mut end.xyz));
            if let SpringForce::Elastic { length } = &mut spring.force {
                all.extend(length);
            }
        }
        let frames = self.frames.iter_mut();
        all.extend(frames.flat_map(|frame| frame.on.placement.quantities_mut()));
        for (_, form) in &mut self.couplings {
            all.push(&mut form.constant);
            all.extend(form.terms.iter_mut().map(|(_, factor)| factor));
        }
        all.extend(self.home.iter_mut().map(|(_, q)| q));
        all
    }
}

impl Placement {
    fn quantities_mut(&mut self) -> impl Iterator<Item = &mut Quantity> {
        self.xyz.iter_mut().chain(&mut self.rpy)
    }
}

/// A serial branch.
#[derive(Clone, Debug)]
pub struct Limb {
    /// Unique name.
    pub name: Spanned<String>,
    /// The body it starts from; `None` is the world.
    pub from: Option<Spanned<String>>,
    /// Placement of the limb's frame 0 in the `from` frame.
    pub base: Placement,
    /// The joints, from the base outward.
    pub joints: Vec<Joint>,
    /// The place of the limb in the file.
    pub span: Span,
}

/// A constant pose: translation and fixed-axis roll, pitch, yaw.
#[derive(Clone, Debug)]
pub struct Placement {
    /// Translation, m.
    pub xyz: [Quantity; 3],
    /// Roll, pitch, yaw, rad: R = Rz(y) Ry(p) Rx(r).
    pub rpy: [Quantity; 3],
}

/// The joint types of `limbs`. A joint n of several coordinates names them n.1, n.2, n.3; Rx, Tz
/// and so on are rotations and translations by them, about and along the axes of the joint's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JointKind {
    /// A rotation about [`Joint::axis`].
    Revolute,
    /// A translation along [`Joint::axis`].
    Prismatic,
    /// A screw with one coordinate, the angle about [`Joint::axis`]; the translation along the axis
    /// is [`Joint::lead`] times the angle.
    Helical,
    /// Rz(n.1) Tz(n.2).
    Cylindrical,
    /// Rx(n.1) Ry(n.2).
    Universal,
    /// Rz(n.1) Ry(n.2) Rx(n.3).
    Spherical,
    /// No coordinate.
    Fixed,
}

/// The types of `drives`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveKind {
    /// The motor's coordinate is an angle.
    Revolute,
    /// The motor's coordinate is a length.
    Prismatic,
}

impl DriveKind {
    /// The type of the massless joint that stands for the drive.
    pub fn joint(self) -> JointKind {
        match self {
            Self::Revolute => JointKind::Revolute,
            Self::Prismatic => JointKind::Prismatic,
        }
    }
}

/// The constant placement of a joint's frame in the preceding frame.
#[derive(Clone, Debug)]
pub enum JointFrame {
    /// Modified Denavit-Hartenberg row: Rx(alpha) Tx(a) Rz(theta) Tz(d).
    Dh {
        /// Twist about x, rad.
        alpha: Quantity,
        /// Length along x, m.
        a: Quantity,
        /// Offset along z, m.
        d: Quantity,
        /// Angle about z, rad.
        theta: Quantity,
    },
    /// A placement by translation and rotation.
    Origin(Placement),
}

/// An axis of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Axis {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

impl Axis {
    /// The axis's index in a vector.
    pub fn index(self) -> usize {
        match self {
            Axis::X => 0,
            Axis::Y => 1,
            Axis::Z => 2,
        }
    }
}

/// A closed interval: lowest and highest value.
pub type Interval = [Quantity; 2];

/// Limits of a joint or a cut, all optional.
#[derive(Clone, Debug, Default)]
pub struct Limits {
    /// Position, rad or m.
    pub position: Option<Interval>,
    /// Velocity, rad/s or m/s.
    pub velocity: Option<Interval>,
    /// Acceleration, rad/s^2 or m/s^2.
    pub acceleration: Option<Interval>,
    /// Jerk, the rate of the acceleration, rad/s^3 or m/s^3.
    pub jerk: Option<Interval>,
    /// Effort, N m or N.
    pub effort: Option<Interval>,
    /// Greatest swing angle, rad: between the z axes of the two frames that a spherical or
    /// universal joint connects.
    pub cone: Option<Quantity>,
}

/// A joint of a limb.
#[expect(clippy::struct_excessive_bools, reason = "flags of the format")]
#[derive(Clone, Debug)]
pub struct Joint {
    /// The joint's name, which names its coordinates; only `fixed` joints may lack it.
    pub name: Option<Spanned<String>>,
    /// The joint's type.
    pub kind: Spanned<JointKind>,
    /// The placement of the joint's frame in the preceding frame.
    pub frame: JointFrame,
    /// The axis of the joint's frame that a joint of one coordinate moves about or along.
    pub axis: Axis,
    /// The lead of a helical joint, m per radian: its pitch over 2 pi.
    pub lead: Option<Quantity>,
    /// Label of the body that the joint carries; `None` if it carries no mass.
    pub body: Option<Spanned<String>>,
    /// Whether the body is a payload: carried in some runs only.
    pub payload: bool,
    /// Whether each of its coordinates is actuated.
    pub actuated: bool,
    /// Friction at each of its coordinates.
    pub friction: Friction,
    /// Whether each coordinate has the parameter Fo: a constant effort of either sign, N m or N.
    pub offset: bool,
    /// Whether each coordinate has the parameter J: the inertia of rotor and drive, reflected to
    /// the joint, kg m^2 or kg.
    pub rotor_inertia: bool,
    /// A spring at each coordinate, with the parameter K; `None` without one.
    pub spring: Option<JointSpring>,
    /// Effort terms at each coordinate: a parameter each, with its column.
    pub terms: Vec<(Spanned<String>, EffortExpr)>,
    /// Limits of each coordinate.
    pub limits: Limits,
    /// Nominal friction, offset, rotor, spring and term values, SI, by parameter symbol (`Fv`, `Fc`, `Fo`, `J`,
    /// `K`, the names of terms, ...).
    pub nominal: Vec<(Spanned<String>, Quantity)>,
    /// The place of the joint in the file.
    pub span: Span,
}

/// The joint types of `cuts`, with the number of closure equations of each. The axis of a joint
/// with one axis is the z axis of the cut's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CutKind {
    /// 3 equations.
    Spherical,
    /// 4 equations; the x axis of frame A stays perpendicular to the y axis of frame B.
    Universal,
    /// 5 equations.
    Revolute,
    /// 5 equations.
    Prismatic,
    /// 5 equations.
    Helical,
    /// 4 equations.
    Cylindrical,
    /// 6 equations.
    Fixed,
}

/// One side of a cut: a frame on a body.
#[derive(Clone, Debug)]
pub struct CutSide {
    /// Body label; `None` is the world.
    pub body: Option<Spanned<String>>,
    /// The frame on that body.
    pub placement: Placement,
}

/// A named frame on a body, such as a tool's.
#[derive(Clone, Debug)]
pub struct NamedFrame {
    /// Unique name.
    pub name: Spanned<String>,
    /// The body and the frame's pose on it.
    pub on: CutSide,
}

/// A joint opened to obtain the tree; its closure equations close the loop.
#[derive(Clone, Debug)]
pub struct Cut {
    /// Unique name.
    pub name: Spanned<String>,
    /// The type of the joint that was opened.
    pub kind: Spanned<CutKind>,
    /// The lead of a helical cut, m per radian: its pitch over 2 pi.
    pub lead: Option<Quantity>,
    /// The frames A and B that the closure equations hold together.
    pub sides: [CutSide; 2],
    /// Limits of the opened joint; only `cone` is used.
    pub limits: Limits,
    /// The place of the cut in the file.
    pub span: Span,
}

/// Nominal inertia of a body.
#[derive(Clone, Debug)]
pub struct BodyInertia {
    /// Mass, kg.
    pub mass: Quantity,
    /// Centre of mass in the body's frame, m.
    pub com: [Quantity; 3],
    /// `Ixx Ixy Ixz Iyy Iyz Izz` about the centre of mass in body axes, kg m^2; Ixy is the entry of
    /// the tensor, the negative integral of x y dm.
    pub inertia: [Quantity; 6],
}

/// The user's choices about the base parameters.
#[derive(Clone, Debug, Default)]
pub struct BaseChoices {
    /// Parameters that are eliminated first, in this order, where the others can replace them.
    pub eliminate: Vec<Spanned<String>>,
    /// Linear forms in the parameters that are known to be zero.
    pub zero: Vec<LinearForm>,
    /// Groups of bodies that are known to be identical: their columns are added, under the labels
    /// of the first body.
    pub equal: Vec<Vec<Spanned<String>>>,
    /// Base parameters to leave out of the model, each by the label of the parameter whose column
    /// represents it.
    pub drop: Vec<Spanned<String>>,
}
