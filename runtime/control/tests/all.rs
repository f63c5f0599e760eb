//! The closure of a control cycle beside the one with an allocator.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod agrees;
mod allocates;
mod refuses;
