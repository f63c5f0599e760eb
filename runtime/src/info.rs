//! What a model states about itself: names, sizes, limits, nominal values.

use crate::{Friction, Parameter};

/// One loop closure: a joint that was cut to obtain a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut<'a> {
    /// Its name.
    pub name: &'a str,
    /// The number of its constraint equations.
    pub rows: usize,
}

/// How a coordinate moves: it decides the units of positions and efforts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// A turn: rad, N m.
    Rotation,
    /// A shift: m, N.
    Translation,
}

/// The limits of a coordinate that are stated: lowest and highest value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Of the position, rad or m.
    pub position: Option<[f64; 2]>,
    /// Of the velocity, rad/s or m/s.
    pub velocity: Option<[f64; 2]>,
    /// Of the acceleration, rad/s^2 or m/s^2.
    pub acceleration: Option<[f64; 2]>,
    /// Of the effort, N m or N.
    pub effort: Option<[f64; 2]>,
}

/// What is stated about the joint of one coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// How it moves.
    pub motion: Motion,
    /// Its friction model.
    pub friction: Friction,
    /// Its limits.
    pub limits: Limits,
    /// The nominal values of the friction model's coefficients, in the order of
    /// [`Friction::symbols`], SI units; those of nonlinear models too, which have no place
    /// among the parameters. `None` where none is stated, and beyond the symbols.
    pub nominal: [Option<f64>; 5],
}

/// A limit of the angle between two z axes: those before and after a spherical or universal
/// joint, or those of a cut's two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwingLimit<'a> {
    /// The joint or the cut.
    pub name: &'a str,
    /// The greatest angle, rad.
    pub greatest: f64,
}

/// The names, sizes and stated values of a model: borrowed slices, so that generated code can
/// state them as a constant and a model read at run time can lend its own.
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
    /// The names of all coordinates, in the order of `q`; rad or m by the joint's kind.
    pub coordinates: &'a [&'a str],
    /// Which coordinates are independent: indices into `coordinates`, in the order of the
    /// regressor's rows.
    pub independent: &'a [usize],
    /// Which coordinates are dependent: indices into `coordinates`, in the order of A_e's
    /// columns.
    pub dependent: &'a [usize],
    /// Which coordinates have a measured effort: indices into `coordinates`.
    pub actuated: &'a [usize],
    /// The dynamic parameters, in the order of the regressor's columns.
    pub parameters: &'a [Parameter<'a>],
    /// The labels of the bodies, in the order of `poses`.
    pub bodies: &'a [&'a str],
    /// The cuts, in the order of their constraint rows.
    pub cuts: &'a [Cut<'a>],
    /// A closed state: the start of every closure solve, and the choice of assembly branch.
    pub home: &'a [f64],
    /// Gravity in the world frame, m/s^2.
    pub gravity: [f64; 3],
    /// The number of constraint rows: of all cuts, redundant ones included, then of couplings.
    pub rows: usize,
    /// What is stated about each coordinate's joint, in the order of `coordinates`; empty
    /// where nothing is known about any.
    pub joints: &'a [Joint],
    /// The cones that limit spherical and universal joints: joints in the order of their
    /// coordinates, then cuts. The order of [`Model::cones`](crate::Model::cones).
    pub cones: &'a [SwingLimit<'a>],
    /// The nominal value of each parameter, in the order of `parameters`, about the origin of
    /// the body's frame; `None` where the spec gives none. Empty where nothing is known.
    pub nominal: &'a [Option<f64>],
}

impl Limits {
    /// None stated.
    pub const NONE: Limits = Limits {
        position: None,
        velocity: None,
        acceleration: None,
        effort: None,
    };
}

impl Joint {
    /// A turn, nothing else stated.
    pub const TURN: Joint = Joint {
        motion: Motion::Rotation,
        friction: Friction::None,
        limits: Limits::NONE,
        nominal: [None; 5],
    };
    /// A shift, nothing else stated.
    pub const SHIFT: Joint = Joint {
        motion: Motion::Translation,
        ..Joint::TURN
    };
}

impl Info<'static> {
    /// Without coordinates, parameters or anything stated: for `..Info::EMPTY`.
    pub const EMPTY: Info<'static> = Info {
        name: "",
        coordinates: &[],
        independent: &[],
        dependent: &[],
        actuated: &[],
        parameters: &[],
        bodies: &[],
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
    /// The number of degrees of freedom: of independent coordinates.
    pub fn dof(&self) -> usize {
        self.independent.len()
    }

    /// The place of a coordinate in `q`, if there is one of that name.
    pub fn index_of(&self, coordinate: &str) -> Option<usize> {
        self.coordinates.iter().position(|name| *name == coordinate)
    }

    /// The place of a parameter among the regressor's columns, if there is one of that label.
    pub fn parameter_of(&self, label: &str) -> Option<usize> {
        self.parameters.iter().position(|p| *p == *label)
    }

    /// The labels of the parameters, in the order of the regressor's columns.
    #[cfg(feature = "closure")]
    pub fn labels(&self) -> alloc::vec::Vec<alloc::string::String> {
        self.parameters.iter().map(Parameter::label).collect()
    }

    /// How the joint of a coordinate moves, where that is stated.
    pub fn motion_of(&self, coordinate: &str) -> Option<Motion> {
        let joint = self.joints.get(self.index_of(coordinate)?)?;
        Some(joint.motion)
    }

    /// The nominal parameters in the order of `parameters`, if every one has a value.
    #[cfg(feature = "closure")]
    pub fn nominal_parameters(&self) -> Option<alloc::vec::Vec<f64>> {
        if self.nominal.len() != self.parameters.len() {
            return None;
        }
        self.nominal.iter().copied().collect()
    }
}
