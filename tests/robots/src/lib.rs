//! Every robot of `robots/` as compiled Rust: by the macro, or from `regen-generated` if the
//! robot's whole source is checked in.
//!
//! All tests use the robots of this crate, so that each robot is compiled only once.
#![no_std]

#[cfg(feature = "all")]
pub mod fixtures;

pub use regen_generated::{delta, fivebar, fourbar, puma560, rps3, rps3_friction};
#[cfg(feature = "all")]
use regen_runtime::{BaseModel, ControlModel};

#[cfg(feature = "derived")]
mod derived;
#[cfg(feature = "derived")]
pub use derived::*;

/// A robot for `f64`.
#[cfg(feature = "all")]
pub type Robot = &'static (dyn BaseModel<f64> + Sync);

/// A robot with the functions of controllers for `f64`.
#[cfg(feature = "all")]
pub type Controlled = &'static (dyn ControlModel<f64> + Sync);

/// The robots whose descriptions ask for the functions of controllers.
#[cfg(feature = "all")]
pub static CONTROLLED: &[(&str, Controlled)] =
    &[("fivebar", &fivebar::Fivebar), ("scara", &scara::Scara)];

/// All robots with the names of their files in `robots/`. Their functions are compiled here, so
/// that no test compiles them again.
#[cfg(feature = "all")]
pub static ALL: &[(&str, Robot)] = &[
    ("3prs", &prs3::Prs3),
    ("3rps", &rps3::Rps3),
    ("3rps_friction", &rps3_friction::Rps3Friction),
    ("3rrr", &rrr3::Rrr3),
    ("delta", &delta::Delta),
    ("fivebar", &fivebar::Fivebar),
    ("fourbar", &fourbar::Fourbar),
    ("hybrid", &hybrid::Hybrid),
    ("iiwa14", &iiwa14::Iiwa14),
    ("linear_delta", &linear_delta::LinearDelta),
    ("palletiser", &palletiser::Palletiser),
    ("panda", &panda::Panda),
    ("puma560", &puma560::Puma560),
    ("rx90", &rx90::Rx90),
    ("scara", &scara::Scara),
    ("slider_crank", &slider_crank::SliderCrank),
    ("stanford", &stanford::Stanford),
    ("stewart", &stewart::Stewart),
    ("tree_branch", &tree_branch::TreeBranch),
    ("ur5e", &ur5e::Ur5e),
];
