//! The closure of a control cycle beside the one with an allocator.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(
    clippy::float_cmp,
    reason = "states that must stay as they were are compared bit for bit"
)]

mod agrees;
mod allocates;
mod refuses;
