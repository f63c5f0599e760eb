//! The regressor K of Eq. 4-5 and its reduction (Eq. 8-11), inverse dynamics and mass matrix for
//! given parameters, momentum, Coriolis matrix and derivatives, and the columns of friction, rotors and springs (Eq. 14-20).

mod derivatives;
mod effort_columns;
mod forces;
mod inertia;
mod momentum;
mod reduction;
mod reference_points;
mod regressor;

pub use derivatives::{TreeDerivatives, coriolis_and_mass, tree_derivatives};
pub use effort_columns::effort_column;
pub use forces::{Inertial, joint_efforts};
pub use inertia::mass_matrix;
pub use momentum::{Momentum, momentum, momentum_rate_columns, velocities_as_accelerations};
pub use reduction::Reduction;
pub use regressor::{InertiaWrench, TreeKinematics, reduced_regressor};
