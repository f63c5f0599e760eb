//! Numbers of all robots where they are hard to come by, with what `tests/objects` builds in release.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod double;
mod nan;
mod robot;
mod singular;
