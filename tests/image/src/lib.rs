//! The code that a controller without the standard library links: every function of every robot for
//! `f64`, the runtime's loop closure, and what `regen-control` does in a cycle.
//!
//! The functions of robots are generic, so they are compiled only where a number type is chosen.
//! This package chooses one, behind the features `robots`, `closure` and `control`. The tests of
//! `regen-objects` build it in release, read the object files, and run the tests of this package.
#![no_std]

#[cfg(feature = "closure")]
pub mod closure;
#[cfg(feature = "control")]
pub mod control;
#[cfg(feature = "robots")]
pub mod robots;
