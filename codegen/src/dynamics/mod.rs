//! The regressor K of Eq. 4-5 and its reduction (Eq. 8-11), inverse dynamics and mass matrix for
//! given parameters, and the columns of friction, rotors and springs (Eq. 14-20).

mod effort_columns;
mod forces;
mod inertia;
mod reduction;
mod reference_points;
mod regressor;

pub use effort_columns::effort_column;
pub use forces::{Inertial, joint_efforts};
pub use inertia::mass_matrix;
pub use reduction::Reduction;
pub use regressor::{InertiaWrench, TreeKinematics, reduced_regressor};
