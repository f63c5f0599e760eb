//! The regressor K of Eq. 4-5 and its reduction (Eq. 8-11), inverse dynamics and mass matrix for
//! given parameters, and friction and rotor columns (Eq. 14-20).

mod forces;
mod inertia;
mod reduction;
mod reference_points;
mod regressor;

pub use forces::{Inertial, joint_efforts};
pub use inertia::mass_matrix;
pub use reduction::Reduction;
pub use regressor::{InertiaWrench, UnitTwists, friction_factor, offset_factor, reduced_regressor};
