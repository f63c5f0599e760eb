//! The functions of a model as data: name, arguments and output shape of each.

use crate::{BaseInfo, Info, SizeError};

mod arguments;
mod table;

pub use arguments::{Argument, Arguments};
pub use table::{BaseFunction, ControlFunction, Function};

/// The items that the length of an argument or an output counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// All coordinates: n.
    Coordinates,
    /// The independent coordinates: dof.
    Independent,
    /// The dependent coordinates: n_e.
    Dependent,
    /// The actuated coordinates.
    Actuated,
    /// The closure rows of cuts and couplings.
    Rows,
    /// The dynamic parameters: p.
    Parameters,
    /// The bodies.
    Bodies,
    /// The swing limits of joints and cuts.
    Cones,
    /// The base parameters: rank.
    Base,
    /// The eliminated parameters.
    Free,
    /// The twelve numbers of a pose: a rotation matrix and a position.
    Pose,
    /// The named frames.
    Frames,
    /// Six for each named frame: the velocity of its origin, then its angular velocity.
    FrameRates,
    /// The independent coordinates, then their velocities: 2 dof.
    State,
    /// The independent coordinates, then their velocities, then their efforts: 3 dof.
    StateEfforts,
}

/// The order in which a matrix is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Row by row.
    RowMajor,
    /// Column by column.
    ColumnMajor,
}

/// The shape of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A vector.
    Vector(Size),
    /// A matrix.
    Matrix {
        /// The number of rows.
        rows: Size,
        /// The number of columns.
        columns: Size,
        /// The order in which the entries are stored.
        layout: Layout,
    },
}

/// The name, the arguments and the output of a function.
///
/// ```
/// use regen_runtime::function::{Argument, Shape, Size};
/// use regen_runtime::Function;
///
/// let gravity = Function::Gravity.signature();
/// assert_eq!(gravity.name, "gravity");
/// assert_eq!(gravity.arguments, [Argument::Q, Argument::Phi]);
/// assert_eq!(gravity.shape, Shape::Vector(Size::Independent));
/// assert!(gravity.has_condition);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signature {
    /// The name of the method.
    pub name: &'static str,
    /// The arguments, in the order of the method.
    pub arguments: &'static [Argument],
    /// The shape of the output.
    pub shape: Shape,
    /// Whether the method returns the [`Condition`](crate::Condition) of a solve with A_e.
    pub has_condition: bool,
}

/// The number of items that each [`Size`] counts, in one model.
///
/// ```
/// use regen_runtime::function::{Size, Sizes};
/// use regen_runtime::{Arguments, Function, Info};
///
/// let info = Info {
///     coordinates: &["q1", "q2"],
///     independent: &[0, 1],
///     ..Info::EMPTY
/// };
/// let sizes = Sizes::of(&info);
/// assert_eq!(sizes.length(Size::Independent), 2);
/// // the arguments and the output of `velocities` in a model of two coordinates
/// let velocities = Function::Velocities.signature();
/// let (q, qd_i) = (&[0.1, 0.2][..], &[1.0][..]);
/// let arguments = Arguments { q, qd_i, ..Arguments::EMPTY };
/// assert_eq!(sizes.output(velocities), 2);
/// let error = sizes.check(velocities, &arguments, &[0.0; 2]).unwrap_err();
/// assert_eq!(error.to_string(), "`qd_i` has 1 entries, the model needs 2");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// The number of all coordinates.
    pub coordinates: usize,
    /// The number of independent coordinates.
    pub independent: usize,
    /// The number of dependent coordinates.
    pub dependent: usize,
    /// The number of actuated coordinates.
    pub actuated: usize,
    /// The number of closure rows of cuts and couplings.
    pub rows: usize,
    /// The number of dynamic parameters.
    pub parameters: usize,
    /// The number of bodies.
    pub bodies: usize,
    /// The number of named frames.
    pub frames: usize,
    /// The number of swing limits of joints and cuts.
    pub cones: usize,
    /// The number of base parameters.
    pub base: usize,
    /// The number of eliminated parameters.
    pub free: usize,
}

impl Sizes {
    /// The sizes of a model; the numbers of base and eliminated parameters are 0.
    pub fn of(info: &Info<'_>) -> Self {
        Self {
            coordinates: info.coordinates.len(),
            independent: info.independent.len(),
            dependent: info.dependent.len(),
            actuated: info.actuated.len(),
            rows: info.rows,
            parameters: info.parameters.len(),
            bodies: info.bodies.len(),
            frames: info.frames.len(),
            cones: info.cones.len(),
            base: 0,
            free: 0,
        }
    }

    /// The same with the numbers of base and eliminated parameters of `base`.
    #[must_use]
    pub fn with_base(self, base: &BaseInfo<'_>) -> Self {
        Self {
            base: base.base.len(),
            free: base.free.len(),
            ..self
        }
    }

    /// The number of items that `size` counts; 12 for [`Size::Pose`].
    pub fn length(&self, size: Size) -> usize {
        match size {
            Size::Coordinates => self.coordinates,
            Size::Independent => self.independent,
            Size::Dependent => self.dependent,
            Size::Actuated => self.actuated,
            Size::Rows => self.rows,
            Size::Parameters => self.parameters,
            Size::Bodies => self.bodies,
            Size::Cones => self.cones,
            Size::Base => self.base,
            Size::Free => self.free,
            Size::Pose => 12,
            Size::Frames => self.frames,
            Size::FrameRates => 6 * self.frames,
            Size::State => 2 * self.independent,
            Size::StateEfforts => 3 * self.independent,
        }
    }

    /// The length of a function's output.
    pub fn output(&self, signature: &Signature) -> usize {
        match signature.shape {
            Shape::Vector(size) => self.length(size),
            Shape::Matrix { rows, columns, .. } => self.length(rows) * self.length(columns),
        }
    }

    /// Checks that arguments and output have the lengths that a function needs.
    ///
    /// # Errors
    /// The first length that does not fit: of the arguments in order, then of the output.
    pub fn check<T>(
        &self,
        signature: &Signature,
        arguments: &Arguments<'_, T>,
        out: &[T],
    ) -> Result<(), SizeError> {
        self.check_many(signature, 1, arguments, out)
    }

    /// As [`check`](Self::check) for the arguments and the output of `count` states in one
    /// [`ManyStates`](crate::ManyStates) call.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn check_many<T>(
        &self,
        signature: &Signature,
        count: usize,
        arguments: &Arguments<'_, T>,
        out: &[T],
    ) -> Result<(), SizeError> {
        let inputs = signature.arguments.iter().map(|argument| {
            let got = arguments.get(*argument).len();
            let states = if argument.is_parameter() { 1 } else { count };
            (argument.name(), self.length(argument.size()) * states, got)
        });
        let output = ("out", self.output(signature) * count, out.len());
        for (argument, expected, got) in inputs.chain([output]) {
            if got != expected {
                return Err(SizeError {
                    argument,
                    expected,
                    got,
                });
            }
        }
        Ok(())
    }
}
