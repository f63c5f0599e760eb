//! Written equations against the programs that they are written from.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod evaluated;
mod written;
