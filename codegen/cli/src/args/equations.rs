//! The options of `regen equations`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Debug, Args)]
#[command(after_help = "\
Intermediate terms come first, in the order in which they are computed: s_12 and
c_12 are the sine and cosine of q1 + q2, and t_1, t_2, ... all other terms that
are used more than once. Names of `geometry` stay symbols, but for zeros and
multiples of right angles. With loops, X is solved with the order of pivots that
generated code uses in the middle of the workspace.

Examples:
  regen equations robots/fivebar.yaml
  regen equations robots/3rps.yaml --of X --format latex > x.tex
  regen equations robots/scara.yaml --of mass --format latex
  regen equations robots/ur5e.yaml --of regressor --parameters base")]
pub(crate) struct EquationsArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// The language of the result
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: StyleArg,
    /// The equations [default: closure with loops, dynamics without]
    #[arg(long, value_enum)]
    pub(crate) of: Option<OfArg>,
    /// The parameters of the regressor, the efforts and their parts [default: all]
    #[arg(long, value_enum)]
    pub(crate) parameters: Option<ParametersArg>,
}

/// The language of equations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum StyleArg {
    /// Plain text
    #[default]
    Text,
    /// LaTeX, for the package amsmath
    Latex,
    /// A Python script for SymPy
    Sympy,
}

/// The equations that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OfArg {
    /// The closure equations f(q)
    Closure,
    /// Their Jacobian A
    Jacobian,
    /// X, with qd_e = -X qd_i
    #[value(name = "X", alias = "x")]
    X,
    /// The regressor W
    Regressor,
    /// The efforts
    Dynamics,
    /// The mass matrix M of the efforts M qdd_i + C qd_i + g
    Mass,
    /// The matrix C of Coriolis and centrifugal efforts
    Coriolis,
    /// The efforts g of gravity, springs and offsets
    Gravity,
    /// The Jacobians of the frames that the spec names
    Frames,
}

/// The parameters of the regressor, the efforts and their parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ParametersArg {
    /// Those of all bodies and joints
    All,
    /// The base parameters
    Base,
}
