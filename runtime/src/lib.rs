//! What generated robot models run on.
//!
//! Emitted code is generic over [`Scalar`], falls back on [`solve_pivoted`] where a static
//! pivot order loses accuracy, and reports the outcome as a [`Condition`]. [`Model`] is the
//! interface that all robots share, generated or interpreted. The core is `no_std`, allocates
//! nothing and has no dependencies.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
//!
//! # Features
//!
//! Numbers, from one provider of the elementary functions:
//! - `std` (default): `f64` and `f32` by the standard library. Wins over `libm`.
//! - `libm`: `f64` and `f32` by the crate `libm`, for targets without `std`.
//!
//! Further scalars:
//! - `dual`: `Dual` over the crate `num-dual`, derivatives of everything a model computes.
//!   Needs `std`.
//! - `tangent`: `Tangent`, derivatives in several directions, the same bits on every machine.
//!   Brings `libm` along.
//! - `simd`: `Lane`, several states at once, by the instruction set found at run time; `batch`,
//!   base regressors of many samples. Brings `libm` along for targets without `std`.
//!
//! Solvers and evaluation over a [`Model`]:
//! - `closure` (default): loop closure on an assembly branch; observation matrices over
//!   samples. Needs an allocator and, through `std` or `libm`, `f64`.
//! - `simulation`: a simulated robot, `simulate`: forward dynamics of closed chains, control,
//!   friction and sensors.
//! - `excitation`: exciting trajectories, `excite`. Brings a conic solver.
//! - `alloc`: set by the above; of no use alone.
//!
//! Identification:
//! - `signals`: velocities and accelerations from sampled positions. Needs `std`.
//! - `estimation`: observations reduced to a triangle, least squares with statistics.
//! - `data`: logs from CSV files.
//! - `parquet`: logs from Parquet files too, plain or compressed by snappy.
//!
//! Physical parameters:
//! - `feasibility`: verdicts, identification under constraints, nonlinear friction, reduction to
//!   what is identifiable. Brings a conic solver, with dense routines of its own.
//! - `lapack-system`: leaves the dense routines to a BLAS and LAPACK that the program links.
//!
//! The macro:
//! - `macros`: `robot_model!`, a robot from its YAML file at compile time.
#![no_std]
#![allow(
    clippy::doc_markdown,
    reason = "A_e and qdd_i are formulas, written as in the equations"
)]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

mod base;
#[cfg(feature = "simd")]
pub mod batch;
#[cfg(all(feature = "closure", any(feature = "std", feature = "libm")))]
mod closure;
mod condition;
#[cfg(feature = "data")]
pub mod data;
#[cfg(feature = "estimation")]
pub mod estimate;
#[cfg(feature = "excitation")]
pub mod excite;
#[cfg(feature = "feasibility")]
pub mod feasibility;
#[cfg(feature = "feasibility")]
pub mod friction;
pub mod function;
mod guarded;
#[cfg(feature = "feasibility")]
pub mod identifiability;
#[cfg(feature = "estimation")]
pub mod identify;
mod info;
#[cfg(feature = "feasibility")]
pub mod intervals;
mod kernel;
#[cfg(any(feature = "feasibility", feature = "simulation"))]
mod law;
mod linear;
mod model;
#[cfg(all(feature = "closure", any(feature = "std", feature = "libm")))]
mod observe;
mod scalar;
#[cfg(feature = "signals")]
pub mod signals;
#[cfg(feature = "simulation")]
pub mod simulate;
mod size;
#[cfg(feature = "signals")]
mod triangle;

pub use base::{BaseInfo, BaseModel, BaseParameter, BaseTerm, Certificate};
#[cfg(all(feature = "closure", any(feature = "std", feature = "libm")))]
pub use closure::{Closure, Misuse, Outcome, Solution, State};
pub use condition::{Condition, NEAR_SINGULAR, SINGULAR, Status};
pub use function::{Arguments, BaseFunction, Function};
pub use guarded::{PIVOT_BOUND, guarded};
pub use info::{Cone, Cut, Friction, Info, Joint, Limits, Motion};
pub use kernel::BaseKernel;
pub use linear::solve_pivoted;
pub use model::Model;
#[cfg(all(feature = "closure", any(feature = "std", feature = "libm")))]
pub use observe::{Observation, Sample, observation};
#[cfg(feature = "macros")]
pub use regen_macros::robot_model;
#[cfg(feature = "dual")]
pub use scalar::Dual;
pub use scalar::Scalar;
#[cfg(feature = "tangent")]
pub use scalar::Tangent;
#[cfg(feature = "simd")]
pub use scalar::{Lane, LaneMask};
pub use size::{SizeError, array, array_mut, matrix_mut};
