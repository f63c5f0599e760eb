//! The dynamics of the robots that `sources.txt` names, as `regen generate` writes them.
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
pub mod puma560;
#[rustfmt::skip]
pub mod rps3;
#[rustfmt::skip]
pub mod rps3_friction;
// </regen modules>
