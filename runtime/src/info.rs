//! The data that describe a model: names, sizes, limits, nominal values.

use crate::{Friction, Parameter};

/// One loop closure: a joint that was cut to obtain a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut<'a> {
    /// The name of the cut.
    pub name: &'a str,
    /// The number of constraint equations of the cut.
    pub rows: usize,
}

/// The kind of motion of a coordinate, which decides the units of its positions and efforts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Rotation: positions in rad, efforts in N m.
    Rotation,
    /// Translation: positions in m, efforts in N.
    Translation,
}

/// The limits of a coordinate, each the lowest and the highest value; `None` where the description
/// states no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Limits of the position, rad or m.
    pub position: Option<[f64; 2]>,
    /// Limits of the velocity, rad/s or m/s.
    pub velocity: Option<[f64; 2]>,
    /// Limits of the acceleration, rad/s^2 or m/s^2.
    pub acceleration: Option<[f64; 2]>,
    /// Limits of the jerk, the rate of the acceleration, rad/s^3 or m/s^3.
    pub jerk: Option<[f64; 2]>,
    /// Limits of the effort, N m or N.
    pub effort: Option<[f64; 2]>,
}

/// Motion, friction, limits and nominal friction values of one coordinate's joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Whether the coordinate is a rotation or a translation.
    pub motion: Motion,
    /// The friction model of the joint.
    pub friction: Friction,
    /// The limits of the coordinate.
    pub limits: Limits,
    /// The nominal values of the friction model's coefficients, in the order of
    /// [`Friction::symbols`], SI units. They include the coefficients of nonlinear models, which
    /// are not among the dynamic parameters. `None` if the description states no value, and after the
    /// last symbol.
    pub nominal: [Option<f64>; 5],
    /// How far the coordinate moves if its joint turns by 1 rad, and if it slides by 1 m: `[1, 0]`
    /// for a rotation, `[0, 1]` for a translation. For a drive, whose coordinate is linear in those of
    /// joints, these are sums of the sizes of its factors, such as the ratio of a gear.
    pub travel: [f64; 2],
}

/// A swing limit: a bound of the angle between two z axes, those of the frames before and after a
/// spherical or universal joint, or those of a cut's two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwingLimit<'a> {
    /// The name of the joint or the cut.
    pub name: &'a str,
    /// The greatest allowed angle, rad.
    pub greatest: f64,
}

/// The names, sizes and stated values of a model. All lists are borrowed slices, so that generated
/// code can define an `Info` as a constant, and a model read at run time can lend its own lists.
///
/// ```
/// use regen_runtime::{Cut, Info, Parameter, Symbol};
///
/// const FOUR_BAR: Info<'static> = Info {
///     name: "four_bar",
///     coordinates: &["q1", "q2", "q3"],
///     independent: &[0],
///     dependent: &[1, 2],
///     actuated: &[0],
///     parameters: &[
///         Parameter::new(Symbol::Izz, "1"),
///         Parameter::new(Symbol::Mx, "1"),
///         Parameter::new(Symbol::My, "1"),
///     ],
///     bodies: &["1", "2", "3"],
///     cuts: &[Cut { name: "pin", rows: 2 }],
///     home: &[0.5, 0.3, -0.8],
///     rows: 2,
///     // no limits, no nominal values
///     ..Info::EMPTY
/// };
/// assert_eq!(FOUR_BAR.dof(), 1);
/// assert_eq!(FOUR_BAR.index_of("q3"), Some(2));
/// assert_eq!(FOUR_BAR.parameter_of("my(1)"), Some(2));
/// assert_eq!(FOUR_BAR.nominal_parameters(), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Info<'a> {
    /// The robot's name.
    pub name: &'a str,
    /// The names of all coordinates, in the order of `q`; in rad or m by the joint's motion.
    pub coordinates: &'a [&'a str],
    /// The independent coordinates: indices into `coordinates`, in the order of the regressor's
    /// rows.
    pub independent: &'a [usize],
    /// The dependent coordinates: indices into `coordinates`, in the order of A_e's columns.
    pub dependent: &'a [usize],
    /// The actuated coordinates, whose efforts are measured: indices into `coordinates`.
    pub actuated: &'a [usize],
    /// The dynamic parameters, in the order of the regressor's columns.
    pub parameters: &'a [Parameter<'a>],
    /// The labels of the bodies, in the order of `poses`.
    pub bodies: &'a [&'a str],
    /// The names of the frames, in the order of `frame_pose`.
    pub frames: &'a [&'a str],
    /// The cuts, in the order of their constraint rows.
    pub cuts: &'a [Cut<'a>],
    /// A closed state (n, rad or m): every closure solve starts from it, and it selects the
    /// assembly branch.
    pub home: &'a [f64],
    /// Gravity in the world frame, m/s^2.
    pub gravity: [f64; 3],
    /// The number of constraint rows: those of all cuts, redundant ones included, then those of
    /// couplings.
    pub rows: usize,
    /// The joint of each coordinate, in the order of `coordinates`; empty if the model has no data
    /// of its joints.
    pub joints: &'a [Joint],
    /// The swing limits of spherical and universal joints in the order of their coordinates, then
    /// those of cuts. The order of [`Model::cones`](crate::Model::cones).
    pub cones: &'a [SwingLimit<'a>],
    /// The nominal value of each parameter, in the order of `parameters`, about the origin of the
    /// body's frame; `None` where the description gives none. Empty if the model has no nominal
    /// values.
    pub nominal: &'a [Option<f64>],
}

impl Limits {
    /// No limits.
    pub const NONE: Limits = Limits {
        position: None,
        velocity: None,
        acceleration: None,
        jerk: None,
        effort: None,
    };
}

impl Joint {
    /// A rotation without friction model, limits or nominal values.
    pub const ROTATION: Joint = Joint {
        motion: Motion::Rotation,
        friction: Friction::None,
        limits: Limits::NONE,
        nominal: [None; 5],
        travel: [1.0, 0.0],
    };
    /// A translation without friction model, limits or nominal values.
    pub const TRANSLATION: Joint = Joint {
        motion: Motion::Translation,
        travel: [0.0, 1.0],
        ..Joint::ROTATION
    };

    /// How far the coordinate moves, rad or m, where the joints behind it turn by `turn` (rad) and
    /// slide by `slide` (m).
    ///
    /// ```
    /// use regen_runtime::Joint;
    ///
    /// assert_eq!(Joint::ROTATION.reach(0.5, 0.1), 0.5);
    /// // a motor with a gear of ratio 45
    /// let motor = Joint { travel: [45.0, 0.0], ..Joint::ROTATION };
    /// assert_eq!(motor.reach(0.5, 0.1), 22.5);
    /// ```
    pub fn reach(&self, turn: f64, slide: f64) -> f64 {
        let [per_turn, per_slide] = self.travel;
        per_turn * turn + per_slide * slide
    }

    /// Whether the coordinate moves by another amount than its joint: that of a drive with a ratio,
    /// or of several joints.
    pub fn is_drive(&self) -> bool {
        let joint = match self.motion {
            Motion::Rotation => Joint::ROTATION,
            Motion::Translation => Joint::TRANSLATION,
        };
        self.travel.map(f64::to_bits) != joint.travel.map(f64::to_bits)
    }
}

impl Info<'static> {
    /// An `Info` without coordinates, parameters or values, to be completed with `..Info::EMPTY`.
    pub const EMPTY: Info<'static> = Info {
        name: "",
        coordinates: &[],
        independent: &[],
        dependent: &[],
        actuated: &[],
        parameters: &[],
        bodies: &[],
        frames: &[],
        cuts: &[],
        home: &[],
        gravity: [0.0; 3],
        rows: 0,
        joints: &[],
        cones: &[],
        nominal: &[],
    };
}

impl Info<'_> {
    /// The number of degrees of freedom, which is the number of independent coordinates.
    pub fn dof(&self) -> usize {
        self.independent.len()
    }

    /// The index of a coordinate in `q`, if there is one of that name.
    pub fn index_of(&self, coordinate: &str) -> Option<usize> {
        self.coordinates.iter().position(|name| *name == coordinate)
    }

    /// The index of a parameter among the regressor's columns, if there is one with that label.
    pub fn parameter_of(&self, label: &str) -> Option<usize> {
        self.parameters.iter().position(|p| *p == *label)
    }

    /// The labels of the parameters, in the order of the regressor's columns.
    #[cfg(feature = "closure")]
    pub fn labels(&self) -> alloc::vec::Vec<alloc::string::String> {
        self.parameters.iter().map(Parameter::label).collect()
    }

    /// Whether a coordinate is a rotation or a translation; `None` if there is no such coordinate
    /// or no data of its joint.
    pub fn motion_of(&self, coordinate: &str) -> Option<Motion> {
        let joint = self.joints.get(self.index_of(coordinate)?)?;
        Some(joint.motion)
    }

    /// The nominal parameters (p, SI units) in the order of `parameters`, if every one has a value.
    #[cfg(feature = "closure")]
    pub fn nominal_parameters(&self) -> Option<alloc::vec::Vec<f64>> {
        if self.nominal.len() != self.parameters.len() {
            return None;
        }
        self.nominal.iter().copied().collect()
    }
}
