//! The tests of this folder as one program, which links once: a file is a module here.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod closures;
mod common;
mod cuts;
mod dh_table;
mod equalities;
mod export;
mod losses;
mod mjcf;
mod mutations;
mod snapshots;
mod urdf;
mod usd;
mod vectors;
