//! Nonlinear friction (Eq. 16, 17, 32), at active and passive joints, identified together with
//! the other parameters under the constraints of [`feasibility`](crate::feasibility) (Eq. 29).
//!
//! The laws are linear in their coefficients and nonlinear in their shape parameters: `vs` and
//! `delta` of Stribeck's law, `Fv3` of the arctangent, `delta` of the power law. No coefficient is
//! negative, and static friction is not below Coulomb friction: its excess `Fs-Fc` is the
//! coefficient. For each shape, the coefficients and all other parameters are the solution of a
//! convex programme, so they are eliminated. What remains is a function of the logarithms of the
//! shape parameters, which is minimised by Gauss-Newton steps with exact derivatives and a trust
//! region, from several starts and from the best shapes of a grid. Each step is a cone programme in all unknowns, so that it obeys the
//! constraints; ready-made nonlinear least-squares solvers do not support them.

mod columns;
mod data;
mod fit;
mod intervals;
mod likelihood;
mod one_joint;
mod passes;
mod reduced;
mod residuals;
mod reversals;
mod scores;
mod starts;
mod values;

pub use data::FrictionData;
pub use fit::{FrictionFit, JointFit, fit};
pub use intervals::{FrictionIntervals, intervals};
pub use passes::{JointEfforts, collect, residuals};
pub(crate) use passes::{discretisation, observe_linear_friction, with_linear_friction};
