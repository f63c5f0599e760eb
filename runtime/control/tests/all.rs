//! Compares the loop closure and the estimators for control cycles with ones that need an allocator.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(
    clippy::float_cmp,
    reason = "states that must stay as they were are compared bit for bit"
)]

mod agrees;
mod allocates;
mod arm;
mod estimator;
mod fivebar;
mod physical;
mod refuses;
mod steps;
