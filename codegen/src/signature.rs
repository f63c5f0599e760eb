//! The table of functions: one row for each function that a robot can have. The emitter, the
//! interpreter, the command and the tests take names, arguments and shapes from here.

mod table;

pub use table::FunctionKind;

/// The length of an argument or of an output, as a quantity of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// All coordinates.
    Coordinates,
    /// The independent coordinates.
    Independent,
    /// The dependent coordinates.
    Dependent,
    /// The actuated coordinates.
    Actuated,
    /// The closure rows of cuts and couplings.
    Rows,
    /// The dynamic parameters.
    Parameters,
    /// The bodies.
    Bodies,
    /// The limits of the swing angle of joints and cuts.
    Cones,
    /// The base parameters.
    Base,
    /// The eliminated (non-base) parameters.
    Free,
    /// The twelve numbers of a pose: a rotation matrix row by row, then a position, m.
    Pose,
    /// The named frames.
    Frames,
    /// Six for each named frame: the velocity of its origin, then its angular velocity.
    FrameRates,
    /// The independent coordinates, then their velocities.
    State,
    /// The independent coordinates, then their velocities, then their efforts.
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
        /// Number of rows.
        rows: Size,
        /// Number of columns.
        columns: Size,
        /// The order in which its entries are stored.
        layout: Layout,
    },
}

impl Shape {
    /// The lengths of the stored array's dimensions, the outermost first.
    pub fn outer_first(self) -> Vec<Size> {
        match self {
            Shape::Vector(size) => vec![size],
            Shape::Matrix {
                rows,
                columns,
                layout: Layout::RowMajor,
            } => vec![rows, columns],
            Shape::Matrix {
                rows,
                columns,
                layout: Layout::ColumnMajor,
            } => vec![columns, rows],
        }
    }
}

/// What a mechanism must have for a function to exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Every robot has the function.
    Nothing,
    /// Cuts or couplings.
    Rows,
    /// Dependent coordinates.
    Dependent,
    /// Swing limits of joints or cuts.
    Cones,
    /// Named frames.
    Frames,
    /// Base parameters.
    Base,
}

/// The trait of the runtime that has a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trait {
    /// `Model`: every robot has its functions.
    Model,
    /// `BaseModel`: robots with base parameters have its functions.
    BaseModel,
    /// `ControlModel`: only robots have its functions whose description asks for them with
    /// `control: true`, since few programs need them and they take long to compile.
    ControlModel,
}

impl Trait {
    /// All traits, in the order in which they are implemented.
    pub const ALL: [Trait; 3] = [Trait::Model, Trait::BaseModel, Trait::ControlModel];
}

/// How an emitted function passes its result to the caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passing {
    /// It returns the result.
    Returned,
    /// It writes the result through its last argument, because the result is large.
    Written,
}

/// The table's row for an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArgumentRow {
    /// The argument's name in emitted functions.
    pub name: &'static str,
    /// The argument's name in the runtime's `Arguments` and traits.
    pub runtime_name: &'static str,
    /// The length of the argument.
    pub size: Size,
    /// Prefix of the names of its elements in emitted functions.
    pub prefix: &'static str,
    /// What the argument contains: the text of its documentation.
    pub doc: &'static str,
}

/// The table's row for a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signature {
    /// The function's name in code.
    pub name: &'static str,
    /// What the function computes, with the number of the equation.
    pub formula: &'static str,
    /// The arguments in order.
    pub arguments: &'static [Argument],
    /// The name of the output in emitted functions.
    pub output: &'static str,
    /// The shape of the output.
    pub shape: Shape,
    /// What the output contains: the text of its documentation.
    pub output_doc: &'static str,
    /// How an emitted function passes the output to the caller.
    pub passing: Passing,
    /// Whether the function also returns the condition of its solve with A_e.
    pub has_condition: bool,
    /// What a mechanism must have for the function to exist.
    pub needs: Needs,
    /// The trait of the runtime that has the function.
    pub of: Trait,
}

/// The argument with the values of the adjustable geometry, which is the last one of every function of a
/// robot that has such geometry.
pub const GEOMETRY: GeometryRow = GeometryRow {
    name: "geometry",
    doc: "values of the adjustable geometry, m or rad, in the order of `GEOMETRY`",
};

/// The row of [`GEOMETRY`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeometryRow {
    /// Its name in emitted functions.
    pub name: &'static str,
    /// What it contains.
    pub doc: &'static str,
}

macro_rules! arguments {
    ($($case:ident { doc: $doc:literal, $($field:ident: $value:expr,)* })*) => {
        /// An argument of a function.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Argument {
            $(#[doc = $doc] $case,)*
        }

        impl Argument {
            /// All arguments, in the order of the table.
            pub const ALL: [Argument; [$(stringify!($case)),*].len()] = [$(Argument::$case),*];

            /// The table's row for this argument.
            pub fn row(self) -> &'static ArgumentRow {
                match self {
                    $(Argument::$case => &ArgumentRow { doc: $doc, $($field: $value,)* },)*
                }
            }
        }
    };
}

arguments! {
    Q {
        doc: "coordinates, rad or m, in the order of `COORDINATES`",
        name: "q", runtime_name: "q", size: Size::Coordinates, prefix: "",
    }
    Qd {
        doc: "velocities of all coordinates",
        name: "qd", runtime_name: "qd", size: Size::Coordinates, prefix: "d_",
    }
    Qdd {
        doc: "accelerations of all coordinates",
        name: "qdd", runtime_name: "qdd", size: Size::Coordinates, prefix: "dd_",
    }
    QdI {
        doc: "velocities of the independent coordinates, in the order of `INDEPENDENT`",
        name: "qd_i", runtime_name: "qd_i", size: Size::Independent, prefix: "d_",
    }
    QddI {
        doc: "accelerations of the independent coordinates",
        name: "qdd_i", runtime_name: "qdd_i", size: Size::Independent, prefix: "dd_",
    }
    QdRI {
        doc: "reference velocities of the independent coordinates",
        name: "qd_r", runtime_name: "qd_r_i", size: Size::Independent, prefix: "r_",
    }
    QddRI {
        doc: "reference accelerations of the independent coordinates",
        name: "qdd_r", runtime_name: "qdd_r_i", size: Size::Independent, prefix: "dr_",
    }
    TauI {
        doc: "efforts of the independent coordinates, N m or N, in the order of `INDEPENDENT`",
        name: "tau_i", runtime_name: "tau_i", size: Size::Independent, prefix: "tau_",
    }
    Phi {
        doc: "dynamic parameters, SI, in the order of `PARAMETERS`",
        name: "phi", runtime_name: "phi", size: Size::Parameters, prefix: "p_",
    }
    TauActuated {
        doc: "efforts of the actuated coordinates, N m or N, in the order of `ACTUATED`",
        name: "tau", runtime_name: "tau_actuated", size: Size::Actuated, prefix: "tau_",
    }
    Beta {
        doc: "base parameters, SI, in the order of `BASE`",
        name: "beta", runtime_name: "beta", size: Size::Base, prefix: "p_",
    }
    Free {
        doc: "values of the eliminated parameters, in the order of `FREE`",
        name: "free", runtime_name: "free", size: Size::Free, prefix: "p_",
    }
}
