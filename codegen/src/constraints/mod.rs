//! Loop closures: the equations f, their Jacobian A and bias b (Eq. 6-7), the partition into
//! independent and dependent coordinates (Eq. 8-9), and X = A_e^-1 A_i (Eq. 10) by an elimination
//! whose order of pivots fits the structure of A_e.

mod closed;
mod elimination;
mod gap;
mod home;
mod loops;
mod rows;
mod samples;
mod screw;
mod search;
mod singular;
mod units;
mod view;
mod viewpoints;

pub use closed::{Closed, LoopSolver};
pub use elimination::{Eliminated, Entry, Pivot, Plan, eliminate, plan, structure};
pub use gap::{Gap, gaps};
pub use home::{HomeProblem, Mismatch, NumericLoops, RegularHome, close_home};
pub use loops::{LoopEquations, Viewpoint};
pub use rows::{Equations, Form, agreement, half_turns, world_equations, world_views};
pub use samples::closed_states;
pub use units::Units;
pub use view::{Column, View};
