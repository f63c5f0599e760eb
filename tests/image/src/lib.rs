//! What a controller without the standard library would link: every function of every robot for
//! `f64`, and the runtime's loop closure.
//!
//! The functions of robots are generic, so nothing of them is compiled before somebody names a
//! number type. This package does, behind the features `robots` and `closure`. The tests of
//! `regen-objects` build it in release, read the object files, and run the tests that are here.
#![no_std]

#[cfg(feature = "closure")]
pub mod closure;
#[cfg(feature = "robots")]
pub mod robots;
