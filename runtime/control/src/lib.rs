//! What a controller calls in its cycle, in arrays of fixed size and in bounded time: loop closure,
//! estimates of parameters and payloads while the robot moves, external forces, adaptive control.
//!
//! [`Closure`] does in a cycle what `regen_runtime::LoopClosure::track` does with an allocator: it
//! follows home's assembly branch from one cycle to the next, with at most as many Newton steps in a
//! call as it is told. [`Estimator`] is least squares that continues from sample to sample, on
//! equations that need no acceleration, with deviations; [`Physical`] finds the closest parameters that
//! bodies can have, and [`Payload`] what the robot carries. [`Observer`] gives the external force, and
//! [`Collision`] tells contact from noise. [`GradientLaw`] and [`NaturalLaw`] are the update laws of
//! adaptive control.
//!
//! Nothing here allocates or can panic; everything works on `f64` and `f32`. `no_std`; depends on
//! `regen-runtime` and `libm` alone.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
//!
//! ```
//! use regen_control::{Outcome, closure};
//! use regen_generated::rps3::{self, Rps3};
//!
//! // the lengths of the arrays are those of the module's constants
//! let mut legs = <closure!(rps3::Rps3, f64)>::new(&Rps3)?;
//! assert_eq!(legs.track(&[0.60, 0.62, 0.58], 10), Outcome::Closed);
//!
//! let motion = legs.motion(&[0.1, 0.0, 0.0], &[0.0; 3]);
//! assert!(motion.condition.is_regular());
//! let phi = [1.0; rps3::PARAMETERS.len()];
//! let (tau, _) = rps3::inverse_dynamics(legs.q(), &motion.qd, &motion.qdd, &phi);
//! assert!(tau.iter().all(|force| force.is_finite()));
//! # Ok::<(), regen_control::ClosureError>(())
//! ```
#![no_std]
#![allow(
    clippy::doc_markdown,
    reason = "A_e and qdd_i are formulas, written as in the equations"
)]

mod adaptive;
mod closure;
mod estimator;
mod factored;
mod filter;
mod observer;
mod outcome;
mod payload;
mod physical;
mod real;
mod symmetric;
mod triangle;

pub use adaptive::{GradientLaw, NaturalLaw};
pub use closure::{Closure, Motion};
pub use estimator::{Estimator, Forgetting, Settings};
pub use observer::{Collision, Observer};
pub use outcome::{ClosureError, Outcome, Sample, SettingError};
pub use payload::{Load, Payload};
pub use physical::{Physical, Projected, Search};
pub use real::Real;

/// The type of a [`Closure`] of a generated model: `closure!(rps3::Rps3, f64)` for the struct `Rps3`
/// of the module `rps3`, whose constants give the lengths of arrays.
#[macro_export]
macro_rules! closure {
    ($module:ident :: $model:ident, $number:ty) => {
        $crate::Closure<
            'static,
            $number,
            { $module::COORDINATES.len() },
            { $module::INDEPENDENT.len() },
            { $module::DEPENDENT.len() },
            { $module::INFO.rows },
            $module::$model,
        >
    };
}
