//! The runtime library that generated robot models are compiled against.
//!
//! Generated code is generic over [`Scalar`], calls [`solve_pivoted`] where its fixed pivot order
//! would lose accuracy, and reports how well that solve was conditioned as a [`Condition`].
//! [`Model`] is the interface of all robots, generated or interpreted. The core is `no_std`,
//! allocates nothing and depends on `libm` alone.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
//!
//! # Features
//!
//! Features only add items; none changes a numerical result:
//! - `std` (default): fused products where the target has them.
//! - `closure` (default): solving the loop closure on one assembly branch. Needs an allocator.
//! - `dual`: `Dual`, dual numbers of the crate `num-dual`, to differentiate everything that a model
//!   computes. Needs `std`.
//! - `tangent`: `Tangent`, derivatives in several directions at once, bit-identical on every
//!   machine.
//! - `macros`: `robot_model!`, which derives a robot from its YAML file at compile time.
//!
//! The crate `regen-identify` identifies parameters from logs; `regen-experiment` computes exciting
//! trajectories and simulates; `regen-batch` computes several states at once in SIMD registers. A
//! controller links none of them.
#![no_std]
#![allow(
    clippy::doc_markdown,
    reason = "A_e and qdd_i are formulas, written as in the equations"
)]

#[cfg(feature = "closure")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

mod base;
#[cfg(feature = "closure")]
mod closure;
mod condition;
mod control;
pub mod friction;
pub mod function;
mod info;
mod kernel;
mod linear;
mod many;
mod model;
mod parameter;
mod scalar;
mod size;
mod solve_guarded;

pub use base::{BaseInfo, BaseModel, BaseParameter, BaseTerm, Certificate};
#[cfg(feature = "closure")]
pub use closure::{ClosureError, LoopClosure, Outcome, Solution, State};
pub use condition::{Condition, NEAR_SINGULAR, SINGULAR, Status};
pub use control::ControlModel;
pub use friction::{Friction, JointFriction};
pub use function::{Arguments, BaseFunction, ControlFunction, Function};
pub use info::{Cut, Info, Joint, Limits, Motion, SwingLimit};
pub use kernel::BaseKernel;
pub use linear::solve_pivoted;
pub use many::ManyStates;
pub use model::Model;
pub use parameter::{INERTIAL, Parameter, Sign, Symbol};
#[cfg(feature = "macros")]
pub use regen_macros::robot_model;
#[cfg(feature = "dual")]
pub use scalar::Dual;
#[cfg(feature = "tangent")]
pub use scalar::{DIRECTIONS, Tangent};
pub use scalar::{Scalar, angles};
pub use size::{SizeError, array, array_mut, matrix_mut};
pub use solve_guarded::{PIVOT_BOUND, solve_guarded};
