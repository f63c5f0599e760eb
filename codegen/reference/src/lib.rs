//! The reference derivation: a mechanism read from its YAML spec, with all quantities computed by
//! straightforward numeric methods at given states.
//!
//! | what | how |
//! |---|---|
//! | poses | products of 4x4 matrices, generic over dual numbers |
//! | regressor K of the tree | Newton-Euler in the world frame, one parameter at a time |
//! | the same efforts | Eq. 1 with derivatives by second-order duals; Lagrange by hyper-duals |
//! | f, A, b | rows of the cuts; Jacobian and bias by duals |
//! | X, K_i - X^T K_e | singular value decomposition over all rows |
//! | energy | trace form with the pseudo-inertia, velocities by duals |
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.

mod closure;
mod energy;
mod expr;
mod friction;
mod gibbs_appell;
mod kinematics;
mod load;
mod load_fields;
mod mechanism;
mod newton_euler;
mod random;
mod reduced;
mod scalar;
mod springs;
mod states;
mod yaml;

pub use expr::evaluate;
pub use friction::Friction;
pub use kinematics::Motion;
pub use mechanism::{
    Axis, Body, Coupling, Cut, CutKind, CutSide, JointMotion, Mechanism, Node, PARAMETERS_PER_BODY,
    Parameter,
};
pub use random::{PhysicalBody, Random};
pub use scalar::{Mat4, Scalar, Vec3};
pub use springs::{EffortTerm, Point, Spring, Stored};
pub use states::State;
