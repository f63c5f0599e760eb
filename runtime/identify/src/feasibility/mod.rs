//! Physical feasibility: of given base parameters, and as a constraint of the identification.
//!
//! A set of parameters is physical when every body's pseudo-inertia is positive semidefinite and
//! friction and rotors are not negative (Eq. 28 and the triangle inequality). [`verdict()`]
//! judges base parameters, with a proof either way. [`identify()`] finds the parameters that fit
//! the observations best among the physical ones; it yields all ten of every body, not only
//! what the observations determine.
//!
//! The feature `feasibility` brings the conic solver, with the dense routines it needs; the
//! feature `lapack-system` leaves those to a BLAS and LAPACK that the program links.

mod cones;
mod constrained;
mod constraints;
mod equalities;
mod error;
mod faces;
mod inertia;
mod interior;
mod layout;
mod options;
mod output;
mod problem;
mod program;
mod psd_completion;
mod reduced;
mod sizes;
mod symmetric;
mod verdict;

// the solver's symbols
extern crate regen_lapack as _;

pub use constrained::{OPTIMAL, Outcome, Physical, SizeLimit, identify, nearest};
pub use error::FeasibilityError;
pub use inertia::{InertialParameters, Scale, inertial_parameters, pseudo_inertia};
pub use layout::{BaseMap, Body, Check, ParameterLayout, SYMBOLS};
pub use options::{Bound, Options, Prior, Total};
pub use output::{bodies_yaml, rust_constants, unit};
pub use verdict::{InfeasibilityCertificate, Verdict, verdict};
