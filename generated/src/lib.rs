//! The dynamics of every robot in `robots/`, as `regen generate` writes them.
//!
//! One module per robot. Nothing here needs the standard library or an allocator.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
#![no_std]

// <regen modules>
#[rustfmt::skip]
pub mod delta;
#[rustfmt::skip]
pub mod fivebar;
#[rustfmt::skip]
pub mod fourbar;
#[rustfmt::skip]
pub mod hybrid;
#[rustfmt::skip]
pub mod iiwa14;
#[rustfmt::skip]
pub mod linear_delta;
#[rustfmt::skip]
pub mod palletiser;
#[rustfmt::skip]
pub mod panda;
#[rustfmt::skip]
pub mod prs3;
#[rustfmt::skip]
pub mod puma560;
#[rustfmt::skip]
pub mod rps3;
#[rustfmt::skip]
pub mod rps3_friction;
#[rustfmt::skip]
pub mod rrr3;
#[rustfmt::skip]
pub mod rx90;
#[rustfmt::skip]
pub mod scara;
#[rustfmt::skip]
pub mod slider_crank;
#[rustfmt::skip]
pub mod stanford;
#[rustfmt::skip]
pub mod stewart;
#[rustfmt::skip]
pub mod tree_branch;
#[rustfmt::skip]
pub mod ur5e;
// </regen modules>
