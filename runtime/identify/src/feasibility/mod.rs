//! Physical feasibility: of given base parameters, and as a constraint of the identification.
//!
//! A set of parameters is physical when every body's pseudo-inertia is positive semidefinite and
//! friction and rotor parameters are not negative (Eq. 28 and the triangle inequality).
//! [`verdict()`] decides whether base parameters are feasible, with a proof either way.
//! [`identify()`] finds the parameters that fit the observations best among the physical ones; it
//! yields all ten parameters of every body, not only the combinations that the observations
//! determine.
//!
//! The feature `feasibility` adds the conic solver with the dense linear algebra routines it needs;
//! with the feature `lapack-system` the program links a BLAS and LAPACK for them instead.

mod closest;
mod cones;
mod constrained;
mod constraints;
mod equalities;
mod error;
mod faces;
mod inertia;
mod interior;
mod known;
mod layout;
mod least_defect;
mod normal;
mod options;
mod output;
mod problem;
mod program;
mod psd_completion;
mod reduced;
mod scaled;
mod sizes;
mod sums;
mod symmetric;
mod triangle;
mod verdict;
mod words;

// links the BLAS and LAPACK symbols that the solver calls
extern crate regen_lapack as _;

pub use constrained::{MAX_OPTIMAL_GAP, Outcome, PhysicalFit, SizeLimit, identify, nearest};
pub(crate) use constrained::{identify_first, identify_like};
pub use error::FeasibilityError;
pub(crate) use inertia::about_centre;
pub use inertia::{InertialParameters, Scale, inertial_parameters, pseudo_inertia};
pub(crate) use known::Known;
pub use layout::{BaseMap, Body, Check, ParameterLayout, SYMBOLS};
pub use options::{Bound, Form, Options, Prior, Total};
pub use output::{bodies_yaml, rust_constants, unit};
pub(crate) use verdict::physical_range;
pub use verdict::{InfeasibilityCertificate, Verdict, verdict};
pub(crate) use words::{
    MAX_COST, describe_draws, describe_fit, describe_gap, describe_held, describe_verdict,
    limits_of_free_masses, unbounded,
};
