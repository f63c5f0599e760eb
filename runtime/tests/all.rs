//! The tests of this folder as one program, which links once: a file is a module here.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(unreachable_pub, reason = "other packages include the models too")]

mod angles;
mod closure;
#[cfg(feature = "closure")]
#[path = "models/four_bars.rs"]
mod four_bars;
mod friction;
mod linear;
mod model;
mod named;
mod panic_free;
#[cfg(feature = "closure")]
#[path = "models/pendulum.rs"]
mod pendulum;
mod scalar;
#[cfg(feature = "closure")]
#[path = "models/slider_crank.rs"]
mod slider_crank;
