//! Numerical tests of all robots with NaN, with infinity and near singularities. `tests/objects`
//! runs them in release.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod double;
mod nan;
mod robot;
mod singular;
