//! Compares the loop closure for control cycles with the one that needs an allocator.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(
    clippy::float_cmp,
    reason = "states that must stay as they were are compared bit for bit"
)]

mod agrees;
mod allocates;
mod refuses;
mod steps;
